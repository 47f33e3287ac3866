//! Curve_Full: moves CVs across their curve.
//!
//! If it implements a paper, say here which one, which section, and where and why it departs from it.

use engine::prelude::*;
use numerics::ramp::Ramp;
use numerics::trig::sin;
use std::f32::consts::TAU;
use std::sync::Arc;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to move, root first. Their shape at rest is `Pref`, \
        or else their shape at the scene's first frame.").read_at(|_| Times::NOW.and(Times::START));
}

params! { PARAMS:
    BEND: Param<Maskable> = Param::maskable("bend", 0.01, "How far CVs move. 0 leaves the curves alone.")
        .unit(Unit::Metres).soft(0.0, 1.0);
    FALLOFF: Param<Arc<Ramp>> = Param::ramp("falloff", &[[0.0, 0.0], [1.0, 1.0]],
        "Scales the movement along the curve, from root (0) to tip (1).");
    SEED: Param<Seed> = Param::seed("Each seed moves every curve by another random fraction.");
}

const OUT: Output = Output::like("curves", &CURVES, "The moved curves. Their segments keep their lengths.");

metrics! { METRICS:
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Full",
    1,
    "Moves the CVs of curves across their direction. Segments keep their lengths; roots move with the rest of the curve.",
    Cook::Frame { cook, reads_clock: |params| params.get(BEND).value != 0.0 },
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &PREF, &CURVE_ID])
.writes(&[&P])
.metrics(METRICS)
.neutral(|params, _| (params.get(BEND).value == 0.0).then_some("`bend` is 0"));

fn cook(cx: &FrameCx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let amount = cx.mask(BEND, &curves)?;
    let ramp = cx.get(FALLOFF);
    // Seconds are reduced in f64: late frames keep their precision.
    let swing = sin(TAU * cx.seconds().fract() as f32 + 1.0);
    let rest = cx.at_rest(CURVES, &curves)?;
    let moved = CurveLoop::over(&curves).framed_by(rest).seeded(cx.get(SEED)).keeping_lengths().map(|curve, out| {
        let own = curve.random(0);
        for cv in curve.cvs() {
            let offset = amount.at(cv.row) * ramp.eval(cv.u) * own * swing;
            out[cv.index] = std::array::from_fn(|k| cv.point[k] + offset * cv.normal[k]);
        }
    });
    cx.publish(LENGTH_ERROR, moved.length_error);
    curves.set(P, moved.points)?;
    Ok(OUT.with(curves))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    #[test]
    fn curves_move_and_keep_their_lengths() {
        let points: Vec<[f32; 3]> = (0..9).map(|k| [0.0, 0.125 * k as f32, 0.0]).collect();
        let curve = Component::curves(vec![9], points.clone()).unwrap();
        let out = bench(&NODE).input(CURVES, curve).set(BEND, 0.5.into()).cook();
        assert!(out.curves().positions() != points && out.metrics["length_error"] < 1e-5);
    }
}
