//! Curve_Resample: curves with other CVs.
//!
//! New CVs lie on the old curve, evenly spaced along its length, from its root to its tip. Attributes of CVs are
//! interpolated; whole numbers, and `orient`, are those of the nearer CV. A curve of one CV keeps it.

use crate::shared::samples::{length, sampled};
use curves::guides::even_samples;
use engine::prelude::*;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves, root first.");
}

params! { PARAMS:
    CVS: Param<i64> = Param::int("cvs", 5, "Number of CVs of each curve.")
        .within(2.0, MOST_CVS).soft(2.0, 32.0).when(|params| params.get(SPACING) == 0.0);
    SPACING: Param<f64> = Param::double("spacing", 0.0,
        "Distance of CVs along a curve, instead of `cvs`: each curve gets the number of segments, at least one, that \
         brings their length closest to this. 0 uses `cvs`.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
}

/// Largest number of CVs of a curve.
const MOST_CVS: f64 = 10_000.0;

const OUT: Output = Output::like("curves", &CURVES, "The curves with their new CVs.");

metrics! { METRICS:
    TOTAL = Metric::new("cvs", Unit::None, "Number of CVs.");
    SHORTENED = Metric::new("shortened", Unit::None,
        "The largest share of its length that a curve lost, because its new segments cut corners.");
    CAPPED = Metric::new("capped", Unit::None, "Curves that would have more than 10,000 CVs, and have 10,000.")
        .warn_above(0.0, "These curves are more than 10,000 times as long as `spacing`. Raise it.");
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Resample",
    1,
    "Gives curves another number of CVs, evenly spaced from root to tip. More let a curve bend smoothly in the wind, fewer \
     make it cheaper. Roots and tips stay; attributes are interpolated.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P])
.attributes(|_| [AttrNames::All, AttrNames::All])
.metrics(METRICS)
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let curves = cx.part(CURVES);
    let (starts, points) = (curves.runs().starts(), curves.positions());
    let lengths: Vec<f64> = curves.runs().ranges().map(|cvs| length(&points[cvs])).collect();
    let (spacing, cvs) = (cx.get(SPACING), cx.get(CVS));
    let asked = |(count, length): (u32, &f64)| match count {
        1 => 1.0,
        _ if spacing > 0.0 => 1.0 + (length / spacing).round().max(1.0),
        _ => cvs as f64,
    };
    let asked: Vec<f64> = curves.runs().counts().zip(&lengths).map(asked).collect();
    let counts: Vec<u32> = asked.iter().map(|count| count.min(MOST_CVS) as u32).collect();
    let total: f64 = counts.iter().map(|count| f64::from(*count)).sum();
    // A sample and a position; attributes take as much as those that come in, in proportion.
    cx.reserve(total * 64.0, "lower `cvs`, raise `spacing`, or raise --memory")?;
    let samples = even_samples(starts, points, &counts);
    cx.check_cancelled()?;

    let out = sampled(cx, curves, counts, &samples)?;
    let lost = |(cvs, length): (std::ops::Range<usize>, &f64)| {
        if *length > 0.0 { 1.0 - self::length(&out.positions()[cvs]) / length } else { 0.0 }
    };
    cx.publish(TOTAL, out.point_count() as f64);
    cx.publish(SHORTENED, out.runs().ranges().zip(&lengths).map(lost).fold(0.0, f64::max));
    cx.publish(CAPPED, asked.iter().filter(|count| **count > MOST_CVS).count() as f64);
    let mut edited = cx.edit(CURVES);
    *edited = out;
    Ok(OUT.with(edited))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, bench, conforms};
    use numerics::vector::to_f64;

    type Point = [f32; 3];

    fn curves(list: &[&[Point]]) -> Component {
        Component::curves(list.iter().map(|curve| curve.len() as u32).collect(), list.concat()).unwrap()
    }

    /// 1 m up, then 3 m along x; and a curve of one CV.
    fn corner() -> Component {
        curves(&[&[[0.0; 3], [0.0, 1.0, 0.0], [3.0, 1.0, 0.0]], &[[7.0; 3]]])
    }

    fn resample(curves: Component) -> Bench {
        bench(&NODE).input(CURVES, curves)
    }

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    #[test]
    fn cvs_are_evenly_spaced_along_the_length() {
        let out = resample(corner()).set(CVS, 5).cook();
        assert_eq!(
            out.curves().positions(),
            [[0.0; 3], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [3.0, 1.0, 0.0], [7.0; 3]]
        );
        assert_eq!((out.metrics["cvs"], out.metrics["shortened"]), (6.0, 0.0));
        // Three CVs cut the corner: √2 + 2 of 4 m are left.
        let out = resample(corner()).set(CVS, 3).cook();
        assert_eq!(out.curves().positions()[..3], [[0.0; 3], [1.0, 1.0, 0.0], [3.0, 1.0, 0.0]]);
        let left = (std::f64::consts::SQRT_2 + 2.0) / 4.0;
        assert!((out.metrics["shortened"] - (1.0 - left)).abs() < 1e-9);
    }

    #[test]
    fn spacing_gives_each_curve_its_own_number() {
        let long = curves(&[&[[0.0; 3], [4.1, 0.0, 0.0]], &[[0.0; 3], [0.2, 0.0, 0.0]], &[[1.0; 3], [1.0; 3]]]);
        let out = resample(long).set(SPACING, 1.0).cook();
        assert_eq!(out.curves().runs().counts().collect::<Vec<_>>(), [5, 2, 2]);
        assert!((out.curves().positions()[1][0] - 1.025).abs() < 1e-6);
        let capped = resample(curves(&[&[[0.0; 3], [9.0, 0.0, 0.0]]])).set(SPACING, 1e-9).cook();
        assert_eq!((capped.metrics["cvs"], capped.metrics["capped"]), (10_000.0, 1.0));
    }

    #[test]
    fn roots_and_tips_keep_their_bits_and_attributes_are_interpolated() {
        let mut wavy = curves(&[&[[-0.0, 0.1, 0.2], [0.3, 0.7, 0.1], [0.33, 0.71, 0.9], [0.1, 1.3, 0.77]]]);
        wavy.set(WIDTH, vec![4.0, 3.0, 2.0, 1.0]).unwrap();
        wavy.set(ID, vec![1, 2, 3, 4]).unwrap();
        wavy.set(N, vec![[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        wavy.set(CURVE_ID, vec![9]).unwrap();
        let out = resample(wavy.clone()).set(CVS, 50).cook();
        let (now, before) = (out.curves(), wavy.positions());
        assert_eq!(now.positions()[0].map(f32::to_bits), before[0].map(f32::to_bits));
        assert_eq!(now.positions()[49].map(f32::to_bits), before[3].map(f32::to_bits));
        let widths = now.get(WIDTH).unwrap();
        assert!(widths[0] == 4.0 && widths[49] == 1.0 && widths.windows(2).all(|pair| pair[0] > pair[1]));
        assert_eq!(now.get(ID).unwrap().iter().copied().fold(0, i32::max), 4);
        assert!(now.get(N).unwrap().iter().all(|n| (to_f64(*n).norm() - 1.0).abs() < 1e-6));
        assert_eq!(now.get(CURVE_ID), Some(&[9][..]));
        let step = |pair: &[Point]| (to_f64(pair[1]) - to_f64(pair[0])).norm();
        let steps: Vec<f64> = now.positions().windows(2).map(step).collect();
        let longest = steps.iter().copied().fold(0.0, f64::max);
        // Only the two segments that cut a corner are shorter.
        assert!(steps.iter().filter(|step| **step < 0.999 * longest).count() <= 2);
        assert!(out.metrics["shortened"] < 0.02);
    }

    #[test]
    fn more_cvs_and_back_are_the_curve_itself() {
        let even = curves(&[&[[0.0; 3], [0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.5, 0.5]]]);
        let fine = resample(even.clone()).set(CVS, 31).cook();
        let back = resample(fine.curves().clone()).set(CVS, 4).cook();
        let off = back.curves().positions().iter().zip(even.positions()).map(|(a, b)| (to_f64(*a) - to_f64(*b)).amax());
        assert!(off.fold(0.0, f64::max) < 1e-6);
    }
}
