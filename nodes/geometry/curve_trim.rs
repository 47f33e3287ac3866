//! Curve_Trim: the part of curves between two fractions of their length.
//!
//! CVs between both ends stay as they are; at the ends are new ones, with interpolated attributes. A curve of which nothing
//! is left keeps one CV, so that attributes of curves stay with them.

use crate::shared::samples::{length, sampled};
use curves::guides::CurveSample;
use engine::prelude::*;
use numerics::masked::Masked;
use numerics::vector::to_f64;
use std::ops::Range;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves, root first.");
}

params! { PARAMS:
    FROM: Param<Maskable> = Param::maskable("from", 0.0,
        "Where curves begin, as a fraction of their length: at 0 at their roots. A mask is read at the root.")
        .within(0.0, 1.0);
    TO: Param<Maskable> = Param::maskable("to", 1.0,
        "Where curves end, as a fraction of their length: at 1 at their tips. Key it from 0 to 1 to make curves grow. A \
         mask is read at the root, so that it cuts each curve to its own length.")
        .within(0.0, 1.0);
}

const OUT: Output = Output::like("curves", &CURVES, "The trimmed curves.");

metrics! { METRICS:
    TOTAL = Metric::new("cvs", Unit::None, "Number of CVs.");
    NOTHING_LEFT = Metric::new("nothing_left", Unit::None, "Curves cut away entirely; one CV of each is kept.");
    CROSSED = Metric::new("crossed", Unit::None, "Curves whose `from` is above their `to`, so that nothing is left of them.")
        .warn_above(0.0, "These curves are left with a single CV and are not drawn, because their `from` is above their `to`. Swap \
            the two numbers; if one of them is masked, check the values of its mask.");
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Trim",
    1,
    "Cuts curves off at a fraction of their length, at the tip, at the root, or both: to shorten fur by a painted map, or \
     to let it grow. CVs in between stay as they are.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P])
.attributes(|_| [AttrNames::All, AttrNames::All])
.metrics(METRICS)
.neutral(|params, _| {
    let (from, to) = (params.get(FROM), params.get(TO));
    (from.value == 0.0 && to.value == 1.0 && to.attribute.is_none()).then_some("`from` is 0 and `to` is 1")
})
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let curves = cx.part(CURVES);
    let (from, to) = (cx.mask(FROM, curves)?, cx.mask(TO, curves)?);
    let (mut samples, mut counts) = (Vec::with_capacity(curves.point_count()), Vec::new());
    let (mut nothing_left, mut crossed) = (0, 0);
    for cvs in curves.runs().ranges() {
        let first = samples.len();
        if !cvs.is_empty() {
            let ends = [from, to].map(|end| at_root(end, cvs.start));
            let is_long = cvs.len() > 1;
            let left = trim(curves.positions(), cvs, ends, &mut samples);
            nothing_left += u32::from(is_long && !left);
            crossed += u32::from(ends[0] > ends[1]);
        }
        counts.push((samples.len() - first) as u32);
    }
    let out = sampled(cx, curves, counts, &samples)?;
    cx.publish(TOTAL, out.point_count() as f64);
    cx.publish(NOTHING_LEFT, f64::from(nothing_left));
    cx.publish(CROSSED, f64::from(crossed));
    let mut edited = cx.edit(CURVES);
    *edited = out;
    Ok(OUT.with(edited))
}

/// The number at a root, 0..1; NaN counts as 0.
fn at_root(end: Masked<'_, f32>, root: usize) -> f64 {
    let end = end.at(root);
    f64::from(if end > 0.0 { end.min(1.0) } else { 0.0 })
}

/// Adds the CVs of a curve between two fractions of its length; returns whether any length is left.
fn trim(points: &[[f32; 3]], cvs: Range<usize>, [from, to]: [f64; 2], samples: &mut Vec<CurveSample>) -> bool {
    let whole = length(&points[cvs.clone()]);
    let at = |cv: usize| CurveSample { before: cv as u32, after: cv as u32, fraction: 0.0 };
    // A curve without length has no fractions: it stays, or goes but for its root.
    if cvs.len() == 1 || whole == 0.0 {
        let kept = if from < to { cvs.len() } else { 1 };
        samples.extend(cvs.take(kept).map(at));
        return from < to;
    }
    let (start, end) = (from * whole, to * whole);
    let between = |before: usize, passed: f64, length: f64, place: f64| {
        // A segment without length has one place.
        let fraction = if length > 0.0 { ((place - passed) / length) as f32 } else { 0.0 };
        if fraction >= 1.0 {
            at(before + 1)
        } else {
            CurveSample { after: before as u32 + 1, fraction: fraction.max(0.0), ..at(before) }
        }
    };
    let (last, mut passed, mut started) = (cvs.end - 1, 0.0, from == 0.0);
    if started {
        samples.push(at(cvs.start));
    }
    for before in cvs.start..last {
        let length = (to_f64(points[before + 1]) - to_f64(points[before])).norm();
        let next = passed + length;
        // The last segment takes what rounding leaves.
        if !started && (start < next || before + 1 == last) {
            samples.push(between(before, passed, length, start));
            started = true;
        }
        if started {
            if from >= to {
                return false;
            }
            if to < 1.0 && end <= next {
                samples.push(between(before, passed, length, end));
                return true;
            }
            samples.push(at(before + 1));
        }
        passed = next;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, BenchResult, bench, conforms};

    type Point = [f32; 3];

    /// 1 m up, then 3 m along x; and a curve of one CV.
    fn corner() -> Component {
        let points = vec![[0.0; 3], [0.0, 1.0, 0.0], [3.0, 1.0, 0.0], [7.0; 3]];
        let mut curves = Component::curves(vec![3, 1], points).unwrap();
        curves.set(WIDTH, vec![4.0, 3.0, 0.0, 9.0]).unwrap();
        curves.set(Attr::<f32>::element("long"), vec![0.5, 1.0]).unwrap();
        curves
    }

    fn trimmed(from: f32, to: f32) -> Bench {
        bench(&NODE).input(CURVES, corner()).set(FROM, from.into()).set(TO, to.into())
    }

    #[test]
    fn ends_the_wrong_way_round_are_counted() {
        let crossed = |from, to| trimmed(from, to).cook().metrics["crossed"];
        assert_eq!([crossed(0.2, 0.6), crossed(0.5, 0.5), crossed(0.6, 0.2)], [0.0, 0.0, 2.0]);
        // A mask that takes one of the two curves from 0.7 to 0.35 only.
        let long = Maskable { value: 0.7, attribute: Some("long".into()) };
        let masked = bench(&NODE).input(CURVES, corner()).set(FROM, 0.5.into()).set(TO, long).cook();
        assert_eq!(masked.metrics["crossed"], 1.0);
    }

    fn first(out: &BenchResult) -> &[Point] {
        &out.curves().positions()[out.curves().runs().range(0)]
    }

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    #[test]
    fn curves_are_cut_at_fractions_of_their_length() {
        // Of 4 m: from 1/8 (½ m up) to ¾ (2 m along x); CVs in between stay.
        let out = trimmed(0.125, 0.75).cook();
        assert_eq!(first(&out), [[0.0, 0.5, 0.0], [0.0, 1.0, 0.0], [2.0, 1.0, 0.0]]);
        let widths = out.curves().get(WIDTH).unwrap().iter().zip([3.5, 3.0, 1.0, 9.0]);
        assert!(widths.clone().count() == 4 && widths.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
        assert_eq!((out.metrics["cvs"], out.metrics["nothing_left"]), (4.0, 0.0));
        assert_eq!(first(&trimmed(0.0, 0.25).cook()), [[0.0; 3], [0.0, 1.0, 0.0]], "at a CV there is one");
        assert_eq!(first(&trimmed(0.25, 1.0).cook()), [[0.0, 1.0, 0.0], [3.0, 1.0, 0.0]]);
        assert_eq!(first(&trimmed(0.5, 0.625).cook()), [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]], "within one segment");
    }

    #[test]
    fn of_nothing_one_cv_is_left() {
        for (from, to, left) in [(0.0, 0.0, [0.0; 3]), (0.5, 0.5, [1.0, 1.0, 0.0]), (1.0, 0.2, [3.0, 1.0, 0.0])] {
            let out = trimmed(from, to).cook();
            assert_eq!((first(&out), out.metrics["nothing_left"]), (&[left][..], 1.0), "{from} {to}");
            assert_eq!(out.curves().element_count(), 2);
        }
    }

    #[test]
    fn masks_give_each_curve_its_own_length() {
        let half = Maskable { value: 1.0, attribute: Some("long".into()) };
        let out = bench(&NODE).input(CURVES, corner()).set(TO, half).cook();
        assert_eq!(first(&out), [[0.0; 3], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    }

    #[test]
    fn degenerate_curves_stay_and_ends_keep_their_bits() {
        let points = vec![[1.0; 3], [1.0; 3], [1.0; 3], [-0.0; 3], [-0.0; 3], [1e-41, 0.0, 0.0], [1e30, 0.0, 0.0]];
        let curves = Component::curves(vec![3, 4], points.clone()).unwrap();
        let with =
            |from: f32, to: f32| bench(&NODE).input(CURVES, curves.clone()).set(FROM, from.into()).set(TO, to.into());
        let out = with(0.0, 0.9).cook();
        assert_eq!(out.curves().runs().counts().collect::<Vec<_>>(), [3, 4]);
        assert_eq!(out.curves().positions()[3].map(f32::to_bits), [(-0.0_f32).to_bits(); 3]);
        assert_eq!(with(0.0, 0.0).cook().curves().runs().counts().collect::<Vec<_>>(), [1, 1]);
        let column = |part: &Component| part.table(Owner::Point).column("P").unwrap().address();
        let whole = with(0.0, 1.0).cook();
        assert_eq!(column(whole.curves()), column(&curves), "the same array passes through");
    }
}
