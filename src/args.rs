//! Types of command-line values: frames, sizes, settings.

use std::str::FromStr;

use engine::frames::FrameSet;
use engine::graph::Scene;
use engine::time::Frame;

/// Requested frames: `1-48`, `1-48x2`, `10`, `10.5`, `1-2x0.25`, and several of these separated by commas.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames(FrameSet);

/// More frames than this are assumed to be a typing error.
const MOST_FRAMES: i64 = 10_000_000;

impl Frames {
    /// The frames.
    pub fn frames(&self) -> FrameSet {
        self.0.clone()
    }

    /// All frames of a scene.
    pub fn of_scene(scene: &Scene) -> FrameSet {
        FrameSet::whole(scene.first, scene.last)
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut frames = FrameSet::default();
        for part in text.split(',') {
            frames = frames.union(&part_of(part.trim())?);
        }
        Ok(Self(frames))
    }
}

fn part_of(part: &str) -> Result<FrameSet, String> {
    let frame = |text: &str| text.parse::<Frame>().map_err(|error| format!("{error}; write 1-48, 1-48x2 or 10.5"));
    let (range, step) = match part.split_once('x') {
        Some((range, step)) => (range, Some(step)),
        None => (part, None),
    };
    // A minus at the start is a sign.
    let dash = range.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(at, _)| at);
    let Some(dash) = dash else {
        if step.is_some() {
            return Err(format!("`{part}` has a step but no range; write 1-48x2"));
        }
        return Ok(vec![frame(part)?].into());
    };
    let (first, last) = (frame(&range[..dash])?, frame(&range[dash + 1..])?);
    let step = step.map_or(Ok(Frame::whole(1)), frame)?;
    if step <= Frame::whole(0) {
        return Err(format!("the step in `{part}` is {step}, expected more than 0"));
    }
    if last < first {
        return Err(format!("`{part}` ends before it starts; write {last}-{first}"));
    }
    let count = (last.ticks() - first.ticks()) / step.ticks() + 1;
    if count > MOST_FRAMES {
        return Err(format!("`{part}` is {count} frames, expected at most {MOST_FRAMES}"));
    }
    Ok(FrameSet::range(first, last, step.ticks()))
}

/// A size in bytes: `500M`, `8G`, `1.5G`, `1000000`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size(pub u64);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a size; write 500M or 8G");
        let upper = text.trim().to_ascii_uppercase();
        let plain = upper.strip_suffix("IB").or_else(|| upper.strip_suffix('B')).unwrap_or(&upper);
        let (number, unit) = match plain.char_indices().last() {
            Some((at, 'K')) => (&plain[..at], 1_u64 << 10),
            Some((at, 'M')) => (&plain[..at], 1 << 20),
            Some((at, 'G')) => (&plain[..at], 1 << 30),
            Some((at, 'T')) => (&plain[..at], 1 << 40),
            _ => (plain, 1),
        };
        let number: f64 = number.trim().parse().map_err(|_| wrong())?;
        if !number.is_finite() || number < 0.0 || number * unit as f64 > (1_u64 << 63) as f64 {
            return Err(wrong());
        }
        Ok(Self((number * unit as f64) as u64))
    }
}

/// `KEY=JSON` of `--set`.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting(pub String, pub String);

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((key, json)) if !key.trim().is_empty() => Ok(Self(key.trim().into(), json.into())),
            _ => Err(format!("`{text}` is not a setting; write node.param=JSON or control=JSON")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<f64> {
        text.parse::<Frames>().unwrap().frames().iter().map(|frame| frame.number()).collect()
    }

    #[test]
    fn ranges_steps_and_fractions() {
        assert_eq!(numbers("1-4"), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(numbers("1-6x2"), [1.0, 3.0, 5.0]);
        assert_eq!(numbers("10.5"), [10.5]);
        assert_eq!(numbers("1-2x0.25"), [1.0, 1.25, 1.5, 1.75, 2.0]);
        assert_eq!(numbers("-3--1"), [-3.0, -2.0, -1.0]);
        assert_eq!(numbers("5,1-2,2"), [1.0, 2.0, 5.0]);
    }

    #[test]
    fn errors_of_frame_ranges_have_hints() {
        let error = |text: &str| text.parse::<Frames>().unwrap_err();
        assert_eq!(error("5-1"), "`5-1` ends before it starts; write 1-5");
        assert_eq!(error("1-5x0"), "the step in `1-5x0` is 0, expected more than 0");
        assert_eq!(error("5x2"), "`5x2` has a step but no range; write 1-48x2");
        assert_eq!(error("a"), "`a` is not a frame number; write 1-48, 1-48x2 or 10.5");
        assert_eq!(error(""), "`` is not a frame number; write 1-48, 1-48x2 or 10.5");
        assert_eq!(error("1-900000000"), "`1-900000000` is 900000000 frames, expected at most 10000000");
    }

    #[test]
    fn sizes_have_units() {
        let size = |text: &str| text.parse::<Size>().map(|size| size.0);
        assert_eq!((size("500M"), size("1.5GiB"), size("7")), (Ok(500 << 20), Ok(3 << 29), Ok(7)));
        assert_eq!(size("many"), Err("`many` is not a size; write 500M or 8G".into()));
        assert!(size("-1G").is_err());
    }
}
