//! Gust_Control: a gust of wind placed by hand.
//!
//! W5, "the manual method": spheres, or an inner and an outer cube, moved, rotated, scaled and keyed by the artist; a
//! ramp sets the influence "within and from the boundary". The output is the control's outline as points;
//! `shared/gust_control.rs` describes their attributes.
//!
//! Departures:
//! * W defines neither the influence between the two cubes nor the ramp's domain. Here the influence follows the ramp
//!   from the centre (0) through the inner boundary (0.5) to the outer (1), on nested cubes; a sphere has one boundary,
//!   at 1.
//! * `strength` may be negative: a calm region within a gust.

use crate::shared::gust_control;
use curves::gusts::{ControlShape, outline};
use engine::prelude::*;
use numerics::affine::Affine;
use numerics::ramp::Ramp;
use std::sync::Arc;

choice! {
    /// The shape of a control.
    ShapeChoice for ControlShape {
        ControlShape::Sphere => "sphere": "a sphere, or an ellipsoid where the scales differ",
        ControlShape::Cubes => "cubes": "a cube within a cube; with the default ramp the influence is full inside the \
                inner one and fades towards the outer one",
    }
}

params! { PARAMS:
    SHAPE: Param<ShapeChoice> = Param::choice("shape", ControlShape::Sphere, "The shape of the region.");
    TRANSLATE: Param<[f64; 3]> = Param::dvec3("translate", [0.0; 3], "Position of the centre.").unit(Unit::Metres);
    ROTATE: Param<Turn> = Param::rotation("rotate",
        "Rotates the region about its centre: about x, then y, then z. Between keys it rotates about a single axis.");
    SCALE: Param<[f64; 3]> = Param::dvec3("scale", [1.0; 3],
        "Radius of the sphere, or half the edge of the inner cube, along its own x, y and z axes. If any is 0, the \
         region is empty.")
        .unit(Unit::Metres).soft(0.01, 100.0);
    OUTER: Param<f32> = Param::float("outer", 2.0,
        "Size of the outer cube relative to the inner one. At 1 both are the same, and the influence ends abruptly.")
        .at_least(1.0).soft(1.0, 10.0).when(|params| params.get(SHAPE) == ControlShape::Cubes);
    RAMP: Param<Arc<Ramp>> = Param::ramp("ramp", &[[0.0, 1.0], [0.5, 1.0], [1.0, 0.0]],
        "Strength of the wind within the region, from its centre (0) to its boundary (1). For cubes the inner boundary \
         is at 0.5. Beyond the boundary there is no influence.");
    STRENGTH: Param<f32> = Param::float("strength", 1.0,
        "Multiplies the influence: 0 turns it off, negative values reduce the wind within the region.").soft(-1.0, 1.0);
}

const CONTROL: Output =
    Output::new("control", &[Kind::Points], "The region's outline as points, for `controls` of Curve_Wind_Gusts.");

pub(crate) static NODE: Node = Node::new(
    "Gust_Control",
    1,
    "Places a gust of wind by hand, as a sphere or as a cube within a cube. Key its position, rotation and size to \
     send it where the shot needs it, and wire it into `controls` of Curve_Wind_Gusts. It may pass through Transform \
     and Merge on the way: the region follows its points.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&CONTROL])
.writes(&[
    &P,
    &gust_control::POINTS,
    &gust_control::SHAPE,
    &gust_control::OUTER,
    &gust_control::STRENGTH,
    &gust_control::RAMP,
])
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let (shape, outer, ramp) = (cx.get(SHAPE), cx.get(OUTER), cx.get(RAMP));
    let mut outline = outline(shape, f64::from(outer), ramp.keys().len());
    Affine::new(cx.get(SCALE), cx.get(ROTATE).0, [0.0; 3], cx.get(TRANSLATE)).points(&mut outline);
    let points = gust_control::component(outline, shape, outer, cx.get(STRENGTH), &ramp)?;
    Ok(CONTROL.with(Geometry::from(points)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, BenchResult, bench, conforms};
    use curves::gusts::{Control, Gusts, evaluate};
    use engine::param::{Source, Value};
    use numerics::ramp::Interpolation;

    fn degrees(x: f64, y: f64, z: f64) -> Turn {
        let Value::Turn(turn) = engine::param::euler_to_turn([x, y, z]) else { panic!("a rotation") };
        Turn(turn)
    }

    /// The influence of the resulting controls at points.
    fn felt(out: &BenchResult, points: &[[f32; 3]]) -> Vec<f32> {
        let controls = gust_control::controls(out.part(Kind::Points), 0).unwrap();
        let none = Ramp::constant(0.0);
        evaluate(points, &Gusts { base: 0.0, falloff: &none, spheres: &[], controls: &controls, incoming: None }).values
    }

    fn linear(bench: Bench) -> Bench {
        bench.set(RAMP, Arc::new(Ramp::new(vec![[0.0, 1.0], [1.0, 0.0]], Interpolation::Linear).unwrap()))
    }

    fn close(a: &[f32], b: &[f32]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
    }

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    #[test]
    fn by_default_a_sphere_is_full_to_half_its_radius_and_fades_to_its_boundary() {
        let points = [[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.75, 0.0], [0.0, 0.0, 1.0], [0.0, 2.0, 0.0]];
        assert!(close(&felt(&bench(&NODE).cook(), &points), &[1.0, 1.0, 0.5, 0.0, 0.0]));
    }

    #[test]
    fn cubes_are_nested_from_the_centre_over_the_inner_to_the_outer_boundary() {
        let out = linear(bench(&NODE)).set(SHAPE, ControlShape::Cubes).set(OUTER, 3.0).cook();
        let points = [[0.5, 0.4, -0.5], [1.0, 0.0, 1.0], [0.0, -2.0, 1.9], [2.9999, 0.0, 0.0], [3.001, 0.0, 0.0]];
        let felt = felt(&out, &points);
        assert!(close(&felt[..3], &[0.75, 0.5, 0.25]) && felt[3] < 1e-4 && felt[4] == 0.0);
    }

    #[test]
    fn it_is_scaled_then_rotated_then_translated() {
        let out = linear(bench(&NODE))
            .set(SCALE, [4.0, 1.0, 1.0])
            .set(ROTATE, degrees(0.0, 0.0, 90.0))
            .set(TRANSLATE, [10.0, 0.0, 0.0])
            .cook();
        let points = [[10.0, 2.0, 0.0], [10.5, 0.0, 0.0], [10.0, 0.0, -0.5], [12.0, 0.0, 0.0]];
        assert!(close(&felt(&out, &points), &[0.5, 0.5, 0.5, 0.0]));
    }

    #[test]
    fn keyed_rotation_is_about_one_axis_and_keeps_the_size() {
        let out = linear(bench(&NODE))
            .set(SCALE, [4.0, 1.0, 1.0])
            .source("rotate", {
                let keys = vec![(1.0, Value::Vec3([0.0; 3])), (3.0, Value::Vec3([0.0, 0.0, 180.0]))];
                let keys = engine::param::Keyframes { keys, interpolation: Interpolation::Linear };
                Source::Keys(Arc::new(keys), engine::param::Shape::Turn)
            })
            .at(2.0)
            .cook();
        assert!(close(&felt(&out, &[[0.0, 2.0, 0.0], [2.0, 0.0, 0.0]]), &[0.5, 0.0]));
    }

    #[test]
    fn every_key_of_a_ramp_of_any_interpolation_is_passed_on() {
        for kind in [Interpolation::Linear, Interpolation::Smooth, Interpolation::Constant] {
            for count in [1, 2, 7, 900] {
                let keys = (0..count).map(|k| [k as f32 / count as f32, (k % 3) as f32]).collect();
                let ramp = Arc::new(Ramp::new(keys, kind).unwrap());
                for shape in [ControlShape::Sphere, ControlShape::Cubes] {
                    let out = bench(&NODE).set(SHAPE, shape).set(RAMP, ramp.clone()).cook();
                    let controls = gust_control::controls(out.part(Kind::Points), 0).unwrap();
                    let expected = Control::new(
                        shape,
                        [0.0; 3],
                        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                        2.0,
                        (*ramp).clone(),
                        1.0,
                    );
                    assert_eq!(controls, [expected], "{kind:?} {count}");
                }
            }
        }
    }

    #[test]
    fn flat_controls_have_no_influence_and_far_ones_are_refused() {
        for scale in [[1.0, 0.0, 1.0], [0.0; 3]] {
            assert_eq!(felt(&bench(&NODE).set(SCALE, scale).cook(), &[[0.0; 3], [0.1, 0.0, 0.1]]), [0.0, 0.0]);
        }
        let error = bench(&NODE).set(TRANSLATE, [1e39, 0.0, 0.0]).try_cook().unwrap_err();
        assert_eq!(error.kind, ErrorKind::NotFinite);
        assert!(bench(&NODE).set(OUTER, 0.5).set(SHAPE, ControlShape::Cubes).try_cook().is_err());
    }
}
