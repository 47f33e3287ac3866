//! Notes on metrics that exceed the limit their node declares; see [`crate::node::Metric::warn_above`].

use std::collections::BTreeMap;

use crate::node::Metric;
use crate::time::Frame;

/// One note for each metric that exceeds its limit at any frame: where it is largest, at how many frames, and what that means.
pub(super) fn notes(
    id: &str,
    type_name: &str,
    declared: &[&Metric],
    published: &BTreeMap<&'static str, BTreeMap<Frame, f64>>,
) -> Vec<String> {
    let note = |metric: &&Metric| {
        let warning = metric.warning?;
        let values = published.get(metric.name)?;
        let over = || values.iter().filter(|(_, value)| **value > warning.above);
        let (frame, worst) = over().reduce(|worst, next| if next.1 > worst.1 { next } else { worst })?;
        let at = match over().count() {
            1 => format!("at frame {frame}"),
            count => format!("at frame {frame}, and too large at {count} of {} frames", values.len()),
        };
        let unit = match metric.unit.sign() {
            "" => String::new(),
            sign => format!(" {sign}"),
        };
        let text = warning.text;
        Some(format!("`{id}` ({type_name}): `{}` is {}{unit} {at}. {text}", metric.name, rounded(*worst)))
    };
    declared.iter().filter_map(note).collect()
}

/// A number as a person reads it: whole, or with three digits.
fn rounded(x: f64) -> String {
    if x.fract() == 0.0 && x.abs() < 1e15 { format!("{x}") } else { format!("{x:.2e}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::param::Unit;

    const DEEP: Metric = Metric::new("deep", Unit::Metres, "Depth.").warn_above(0.5, "Raise it.");
    const FREE: Metric = Metric::new("free", Unit::None, "Unlimited.");

    #[test]
    fn a_metric_beyond_its_limit_is_noted_once_with_its_worst_frame() {
        let frames = |values: &[f64]| {
            values
                .iter()
                .enumerate()
                .map(|(frame, value)| (Frame::whole(frame as i64), *value))
                .collect::<BTreeMap<_, _>>()
        };
        let with = |values: &[f64]| BTreeMap::from([("deep", frames(values)), ("free", frames(&[9.0]))]);
        let note = |values: &[f64]| notes("fur", "Curve_Wind", &[&DEEP, &FREE], &with(values));
        assert_eq!(note(&[0.0, 0.5]), Vec::<String>::new());
        assert_eq!(note(&[0.0, 0.75]), ["`fur` (Curve_Wind): `deep` is 7.50e-1 m at frame 1. Raise it."]);
        assert_eq!(
            note(&[1.0, 3.0, 2.0, 0.0]),
            ["`fur` (Curve_Wind): `deep` is 3 m at frame 1, and too large at 3 of 4 frames. Raise it."]
        );
    }
}
