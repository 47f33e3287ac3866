//! Types of command-line values: frames, sizes, settings.

use std::str::FromStr;

use engine::frames::FrameSet;
use engine::graph::Scene;
use engine::time::Frame;

use crate::failure::{Exit, Failure};

/// Requested frames: `1-48`, `1-48x2`, `10`, `10.5`, `1-2x0.25`, `1-` (to the scene's end), and several of these
/// separated by commas.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    known: FrameSet,
    /// First frames and steps of ranges to the scene's end.
    open: Vec<(Frame, Frame)>,
    /// As it was written.
    text: String,
}

impl std::fmt::Display for Frames {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

/// More frames than this are assumed to be a typing error.
const MOST_FRAMES: i64 = 10_000_000;

impl Frames {
    /// The frames, of a range without an end up to the end of `scene`.
    ///
    /// # Errors
    /// If such a range starts after the scene's end, or is too long.
    pub fn of(&self, scene: &Scene) -> Result<FrameSet, Failure> {
        let mut frames = self.known.clone();
        for (first, step) in &self.open {
            if *first > scene.end() {
                let line = format!("the frames {first}- start after the scene's last frame, {}", scene.last);
                return Err(Failure::new(Exit::CommandLine, line));
            }
            let range = range(*first, scene.end(), *step, &format!("{first}-"));
            frames = frames.union(&range.map_err(|line| Failure::new(Exit::CommandLine, line))?);
        }
        Ok(frames)
    }

    /// The frames that were asked for, or all frames of a scene.
    ///
    /// # Errors
    /// As for [`Frames::of`].
    pub fn of_scene(asked: Option<&Self>, scene: &Scene) -> Result<FrameSet, Failure> {
        asked.map_or_else(|| Ok(FrameSet::whole(scene.first, scene.last)), |asked| asked.of(scene))
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut frames = Self { known: FrameSet::default(), open: Vec::new(), text: text.into() };
        for part in text.split(',') {
            match part_of(part.trim())? {
                Part::Known(part) => frames.known = frames.known.union(&part),
                Part::Open(first, step) => frames.open.push((first, step)),
            }
        }
        Ok(frames)
    }
}

/// Frames between two commas.
enum Part {
    Known(FrameSet),
    /// First frame and step.
    Open(Frame, Frame),
}

fn part_of(part: &str) -> Result<Part, String> {
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
        return Ok(Part::Known(vec![frame(part)?].into()));
    };
    let first = frame(&range[..dash])?;
    let step = step.map_or(Ok(Frame::whole(1)), frame)?;
    if step <= Frame::whole(0) {
        return Err(format!("the step in `{part}` is {step}, expected more than 0"));
    }
    if range[dash + 1..].is_empty() {
        return Ok(Part::Open(first, step));
    }
    let last = frame(&range[dash + 1..])?;
    if last < first {
        return Err(format!("`{part}` ends before it starts; write {last}-{first}"));
    }
    self::range(first, last, step, part).map(Part::Known)
}

/// The frames from `first` to `last`, which `part` asks for.
fn range(first: Frame, last: Frame, step: Frame, part: &str) -> Result<FrameSet, String> {
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

/// `A-B` of `--part`: the first and the last frame of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartRange(i64, i64);

impl PartRange {
    /// Its frames.
    pub fn frames(self) -> FrameSet {
        FrameSet::whole(self.0, self.1)
    }

    /// Its first and its last frame.
    pub fn ends(self) -> (i64, i64) {
        (self.0, self.1)
    }
}

impl FromStr for PartRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a part; write the first and the last frame: 1-24");
        // A minus at the start is a sign.
        let dash = text.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(at, _)| at).ok_or_else(wrong)?;
        let end = |text: &str| text.trim().parse::<i64>().ok().filter(|frame| frame.abs() <= Frame::LIMIT);
        let (first, last) = (end(&text[..dash]).ok_or_else(wrong)?, end(&text[dash + 1..]).ok_or_else(wrong)?);
        if last < first {
            return Err(format!("`{text}` ends before it starts; write {last}-{first}"));
        }
        Ok(Self(first, last))
    }
}

/// `KEY=VALUE` of `--set`.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting(pub String, pub String);

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((key, json)) if !key.trim().is_empty() => Ok(Self(key.trim().into(), json.into())),
            _ => Err(format!("`{text}` is not a setting; write node.param=VALUE or control=VALUE")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<f64> {
        let scene = Scene { first: 1, last: 6, ..Scene::default() };
        text.parse::<Frames>().unwrap().of(&scene).unwrap().iter().map(|frame| frame.number()).collect()
    }

    #[test]
    fn ranges_steps_and_fractions() {
        assert_eq!(numbers("1-4"), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(numbers("1-6x2"), [1.0, 3.0, 5.0]);
        assert_eq!(numbers("10.5"), [10.5]);
        assert_eq!(numbers("1-2x0.25"), [1.0, 1.25, 1.5, 1.75, 2.0]);
        assert_eq!(numbers("-3--1"), [-3.0, -2.0, -1.0]);
        assert_eq!(numbers("5,1-2,2"), [1.0, 2.0, 5.0]);
        assert_eq!(numbers("4-"), [4.0, 5.0, 6.0]);
        assert_eq!(numbers("-1-x3,6-"), [-1.0, 2.0, 5.0, 6.0]);
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
    fn a_range_without_an_end_must_start_in_the_scene() {
        let refused = "7-".parse::<Frames>().unwrap().of(&Scene { last: 6, ..Scene::default() }).unwrap_err();
        assert_eq!(refused.lines, ["the frames 7- start after the scene's last frame, 6"]);
        assert_eq!(refused.exit, Exit::CommandLine);
    }

    #[test]
    fn a_part_is_a_range_of_whole_frames() {
        assert_eq!("-3-4".parse(), Ok(PartRange(-3, 4)));
        let error = |text: &str| text.parse::<PartRange>().unwrap_err();
        assert_eq!(error("4-1"), "`4-1` ends before it starts; write 1-4");
        assert_eq!(error("4"), "`4` is not a part; write the first and the last frame: 1-24");
        assert_eq!(error("1-2x2"), "`1-2x2` is not a part; write the first and the last frame: 1-24");
    }

    #[test]
    fn sizes_have_units() {
        let size = |text: &str| text.parse::<Size>().map(|size| size.0);
        assert_eq!((size("500M"), size("1.5GiB"), size("7")), (Ok(500 << 20), Ok(3 << 29), Ok(7)));
        assert_eq!(size("many"), Err("`many` is not a size; write 500M or 8G".into()));
        assert!(size("-1G").is_err());
    }
}
