//! Notes on metrics with values that their node declares to be trouble; see [`crate::node::Metric::warn_above`].

use std::collections::BTreeMap;

use crate::geometry::Name;
use crate::node::{Metric, Trouble};
use crate::note::Note;
use crate::time::Frame;

/// How a person finds a wire: given the inputs that it is counted through, with `+` between them, and its number from 0.
pub(super) type WireNames<'a> = &'a dyn Fn(&str, usize) -> Option<String>;

/// One note for each metric with such a value at any frame: its worst value, and at which frames there are others.
pub(super) fn notes(
    id: &Name,
    type_name: &str,
    declared: &[&Metric],
    published: &BTreeMap<&'static str, BTreeMap<Frame, f64>>,
    wired: WireNames<'_>,
) -> Vec<Note> {
    let note = |metric: &&Metric| {
        let warning = metric.warning?;
        let values = published.get(metric.name)?;
        let excess = |value: &f64| warning.when.excess(*value);
        let judged = match warning.when {
            Trouble::LastAbove(_) | Trouble::LastOutside(..) => values.len().saturating_sub(1),
            _ => 0,
        };
        let over: Vec<(&Frame, &f64)> = values.iter().skip(judged).filter(|(_, value)| excess(value) > 0.0).collect();
        let (frame, worst) =
            over.iter().reduce(|worst, next| if excess(next.1) > excess(worst.1) { next } else { worst })?;
        if matches!(warning.when, Trouble::AlwaysAbove(_)) && over.len() < values.len() {
            return None;
        }
        let unit = match metric.unit.sign() {
            "" => String::new(),
            sign => format!(" {sign}"),
        };
        let text = format!("`{id}` ({type_name}): `{}` is {}{unit} at frame {frame}", metric.name, rounded(**worst));
        let frames = over.iter().map(|(frame, _)| **frame).collect();
        Some(Note::new(metric.name, text).of_node(id).at(frames).hint(filled(warning.text, **frame, published, wired)))
    };
    declared.iter().filter_map(note).collect()
}

/// A text with the names of metrics in braces replaced by their values at a frame, and `{inputs:metric}` by the wire that the
/// metric counts.
fn filled(
    text: &str,
    frame: Frame,
    published: &BTreeMap<&'static str, BTreeMap<Frame, f64>>,
    wired: WireNames<'_>,
) -> String {
    let value = |name: &str| published.get(name)?.get(&frame).copied();
    let meant = |name: &str| match name.split_once(':') {
        Some((inputs, metric)) => wired(inputs, value(metric)? as usize),
        None => value(name).map(rounded),
    };
    let mut parts = text.split('{');
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once('}').and_then(|(name, rest)| Some((meant(name)?, rest))) {
            Some((value, rest)) => out.extend([&value, rest]),
            None => out.extend(["{", part]),
        }
    }
    out
}

/// A number as a person reads it: whole, or with three digits.
pub(super) fn rounded(x: f64) -> String {
    let size = x.abs();
    if x.fract() == 0.0 && size < 1e15 {
        return format!("{x}");
    }
    let is_plain = (1e-3..1e6).contains(&size);
    let decimals = [100.0, 10.0, 1.0, 0.1, 0.01].iter().position(|least| size >= *least).unwrap_or(5);
    if is_plain { format!("{x:.decimals$}") } else { format!("{x:.2e}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::param::Unit;

    const DEEP: Metric = Metric::new("deep", Unit::Metres, "Depth.").warn_above(0.5, "Raise it.");
    const FREE: Metric = Metric::new("free", Unit::None, "Unlimited.");
    const RATIO: Metric = Metric::new("ratio", Unit::None, "Ratio.").warn_outside(0.9, 1.1, "Keep it.");
    const MISSED: Metric = Metric::new("missed", Unit::None, "So far.").warn_last_above(1.0, "Come nearer.");
    const ENDS: Metric = Metric::new("ends", Unit::None, "So far.").warn_last_outside(-1.0, 1.0, "Return.");
    const FAR: Metric = Metric::new("far", Unit::None, "Distance.").warn_always_above(1.0, "Come near.");

    const IDLE: Metric =
        Metric::new("idle", Unit::None, "Idle.").warn_above(0.0, "The first is {pins:wire}, of {wire}.");

    #[test]
    fn a_warning_names_the_values_of_other_metrics() {
        let at = |values: [f64; 2]| values.into_iter().zip(1..).map(|(x, frame)| (Frame::whole(frame), x)).collect();
        let published = BTreeMap::from([("idle", at([0.0, 2.0])), ("wire", at([7.0, 3.0]))]);
        let wired = |input: &str, number: usize| Some(format!("`nail{number}` at `{input}`"));
        let notes = notes(&"fur".into(), "Softbody", &[&IDLE], &published, &wired);
        assert_eq!(
            notes[0].to_string(),
            "`fur` (Softbody): `idle` is 2 at frame 2. The first is `nail3` at `pins`, of 3."
        );
    }

    fn shown(name: &'static str, values: &[f64]) -> Vec<String> {
        let frames: BTreeMap<Frame, f64> =
            values.iter().enumerate().map(|(frame, value)| (Frame::whole(frame as i64), *value)).collect();
        let published = BTreeMap::from([(name, frames)]);
        let notes =
            notes(&"fur".into(), "Curve_Wind", &[&DEEP, &FREE, &RATIO, &FAR, &MISSED, &ENDS], &published, &|_, _| None);
        notes.iter().map(Note::to_string).collect()
    }

    #[test]
    fn a_metric_beyond_its_limit_is_noted_once_with_its_worst_frame() {
        assert_eq!(shown("free", &[9.0]), Vec::<String>::new());
        assert_eq!(shown("deep", &[0.0, 0.5]), Vec::<String>::new());
        assert_eq!(shown("deep", &[0.0, 0.75]), ["`fur` (Curve_Wind): `deep` is 0.750 m at frame 1. Raise it."]);
        assert_eq!(
            shown("deep", &[1.0, 3.0, 2.0, 0.0]),
            ["`fur` (Curve_Wind): `deep` is 3 m at frame 1 (frames 0-2). Raise it."]
        );
    }

    #[test]
    fn a_metric_has_a_range_or_must_be_good_once_or_in_the_end() {
        assert_eq!(shown("ratio", &[1.0, 0.95]), Vec::<String>::new());
        assert_eq!(
            shown("ratio", &[1.0, 1.25, 0.5]),
            ["`fur` (Curve_Wind): `ratio` is 0.500 at frame 2 (frames 1-2). Keep it."]
        );
        assert_eq!(shown("far", &[3.0, 0.5, 3.0]), Vec::<String>::new());
        assert_eq!(shown("far", &[2.0, 3.0]), ["`fur` (Curve_Wind): `far` is 3 at frame 1 (frames 0-1). Come near."]);
        assert_eq!(shown("missed", &[3.0, 0.5]), Vec::<String>::new());
        assert_eq!(shown("missed", &[0.5, 2.0]), ["`fur` (Curve_Wind): `missed` is 2 at frame 1. Come nearer."]);
        assert_eq!(shown("ends", &[-3.0, 0.5]), Vec::<String>::new());
        assert_eq!(shown("ends", &[0.5, -2.0]), ["`fur` (Curve_Wind): `ends` is -2 at frame 1. Return."]);
    }
}
