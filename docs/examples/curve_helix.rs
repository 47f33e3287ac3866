//! Curve_Helix: winds curves into helices about their own direction.

use engine::prelude::*;
use numerics::ramp::Ramp;
use numerics::trig::sin_cos;
use std::f32::consts::TAU;
use std::sync::Arc;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to wind, root first.");
}

params! { PARAMS:
    RADIUS: Param<Maskable> = Param::maskable("radius", 0.01, "Radius of the helix. 0 leaves the curves alone.")
        .unit(Unit::Metres).soft(0.0, 0.1);
    TURNS: Param<f32> = Param::float("turns", 3.0, "Turns from root to tip.").soft(0.0, 10.0);
    RAMP: Param<Arc<Ramp>> = Param::ramp("ramp", &[[0.0, 0.0], [1.0, 1.0]],
        "Scales the radius along the curve, from root (0) to tip (1).");
    SEED: Param<Seed> = Param::seed("Each seed gives the curves other starting angles.");
}

const OUT: Output = Output::like("curves", &CURVES, "The wound curves. Their segments keep their lengths.");

metrics! { METRICS:
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Helix",
    1,
    "Winds curves into helices about their own direction. Lengths are kept, so a wound curve is shorter from end to end.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &CURVE_ID])
.writes(&[&P])
.metrics(METRICS)
.neutral(|params, _| (params.get(RADIUS).value == 0.0).then_some("`radius` is 0"));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let (radius, turns, ramp) = (cx.mask(RADIUS, &curves)?, cx.get(TURNS), cx.get(RAMP));
    let moved = CurveLoop::over(&curves).seeded(cx.get(SEED)).keeping_lengths().map(|curve, out| {
        let start = curve.random(0);
        for cv in curve.cvs() {
            let (sine, cosine) = sin_cos(TAU * (start + turns * cv.u));
            let r = radius.at(cv.row) * ramp.eval(cv.u);
            out[cv.index] = std::array::from_fn(|k| cv.point[k] + r * (cosine * cv.normal[k] + sine * cv.binormal[k]));
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
    fn cvs_lie_on_a_cylinder_about_the_curve() {
        let points = (0..200).map(|k| [0.0, 0.01 * k as f32, 0.0]).collect();
        let curve = Component::curves(vec![200], points).unwrap();
        let ramp = Arc::new(Ramp::constant(1.0));
        let out = bench(&NODE).input(CURVES, curve).set(TURNS, 2.0).set(RAMP, ramp).cook();
        let points = out.curves().positions();
        for [x, _, z] in points {
            assert!(((x * x + z * z).sqrt() - 0.01).abs() < 1e-3, "{x} {z}");
        }
        assert!(points[199][1] < 1.99 && out.metrics["length_error"] < 1e-5);
    }
}
