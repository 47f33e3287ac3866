//! Curve_Plain: moves CVs across their curve.
//!
//! If it implements a paper, say here which one, which section, and where and why it departs from it.

use engine::prelude::*;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to move, root first.");
}

params! { PARAMS:
    AMOUNT: Param<f32> = Param::float("amount", 0.01, "How far CVs move. 0 leaves the curves alone.")
        .unit(Unit::Metres).soft(0.0, 1.0);
}

const OUT: Output = Output::like("curves", &CURVES, "The moved curves. Their segments keep their lengths.");

metrics! { METRICS:
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Plain",
    1,
    "Moves the CVs of curves across their direction. Segments keep their lengths; roots move with the rest of the curve.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P])
.writes(&[&P])
.metrics(METRICS)
.neutral(|params, _| (params.get(AMOUNT) == 0.0).then_some("`amount` is 0"));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let amount = cx.get(AMOUNT);
    let moved = CurveLoop::over(&curves).keeping_lengths().map(|curve, out| {
        for cv in curve.cvs() {
            let offset = amount;
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
        let out = bench(&NODE).input(CURVES, curve).set(AMOUNT, 0.5).cook();
        assert!(out.curves().positions() != points && out.metrics["length_error"] < 1e-5);
    }
}
