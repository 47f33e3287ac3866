//! Curve_Free: moves CVs across their curve.
//!
//! If it implements a paper, say here which one, which section, and where and why it departs from it.

use engine::prelude::*;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to move, root first.");
}

params! { PARAMS:
    AMOUNT: Param<f32> = Param::float("amount", 0.01, "How far CVs move. 0 leaves the curves alone.")
        .unit(Unit::Metres).soft(0.0, 1.0);
    SEED: Param<Seed> = Param::seed("Each seed moves every curve by another random fraction.");
}

const OUT: Output = Output::like("curves", &CURVES, "The moved curves.");

pub(crate) static NODE: Node = Node::new(
    "Curve_Free",
    1,
    "Moves the CVs of curves across their direction, so that their segments change their lengths.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &CURVE_ID])
.writes(&[&P])
.neutral(|params, _| (params.get(AMOUNT) == 0.0).then_some("`amount` is 0"));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let amount = cx.get(AMOUNT);
    let moved = CurveLoop::over(&curves).seeded(cx.get(SEED)).map(|curve, out| {
        let own = curve.random(0);
        for cv in curve.cvs() {
            let offset = amount * own;
            out[cv.index] = std::array::from_fn(|k| cv.point[k] + offset * cv.normal[k]);
        }
    });
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
    fn curves_move() {
        let points: Vec<[f32; 3]> = (0..9).map(|k| [0.0, 0.125 * k as f32, 0.0]).collect();
        let curve = Component::curves(vec![9], points.clone()).unwrap();
        let out = bench(&NODE).input(CURVES, curve).set(AMOUNT, 0.5).cook();
        assert!(out.curves().positions() != points);
    }
}
