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
//! * The outer cube of W is concentric; here it may be a box of its own (`outer_scale`, `outer_translate`), as long as it
//!   contains the inner one.
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
        "Rotates the region about its centre: about x, then y, then z. Between two keys the rotation is interpolated \
            about one common axis.");
    SCALE: Param<[f64; 3]> = Param::dvec3("scale", [1.0; 3],
        "Radius of the sphere, or half the edge of the inner cube, along its own x, y and z axes. If any is 0, the \
         region is empty.")
        .unit(Unit::Metres).soft(0.01, 100.0);
    OUTER: Param<f32> = Param::float("outer", 2.0,
        "Size of the outer cube relative to the inner one. At 1 both are the same, and the influence ends abruptly.")
        .at_least(1.0).soft(1.0, 10.0).when(|params| is_cubes(params) && params.get(OUTER_SCALE).contains(&0.0));
    OUTER_SCALE: Param<[f64; 3]> = Param::dvec3("outer_scale", [0.0; 3],
        "Half the edge of the outer cube along its own x, y and z axes, whatever the size of the inner one. Along an \
         axis where this is 0, `outer` sets the size.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 100.0).when(is_cubes);
    OUTER_TRANSLATE: Param<[f64; 3]> = Param::dvec3("outer_translate", [0.0; 3],
        "Position of the outer cube's centre relative to that of the inner one, along the region's own axes: use it for \
         a gust that rises steeply at its front and fades slowly behind. The inner cube must stay inside.")
        .unit(Unit::Metres).soft(-10.0, 10.0).when(is_cubes);
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
    &gust_control::OUTER_BELOW,
    &gust_control::OUTER_ABOVE,
    &gust_control::STRENGTH,
    &gust_control::RAMP,
])
.checks(|params| outer_box(params).map(drop))
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let (shape, outer, ramp) = (cx.get(SHAPE), cx.get(OUTER), cx.get(RAMP));
    let own = outer_box(cx.params())?;
    let mut outline = outline(shape, own.unwrap_or([[f64::from(outer); 3]; 2]), ramp.keys().len());
    Affine::new(cx.get(SCALE), cx.get(ROTATE).0, [0.0; 3], cx.get(TRANSLATE)).points(&mut outline);
    let mut points = gust_control::component(outline, shape, outer, cx.get(STRENGTH), &ramp)?;
    if let Some(own) = own {
        gust_control::set_box(&mut points, own)?;
    }
    Ok(CONTROL.with(Geometry::from(points)))
}

fn is_cubes(params: &Params) -> bool {
    params.get(SHAPE) == ControlShape::Cubes
}

/// Distances of the outer cube's sides from the centre, below and above it along each axis, in half edges of the inner
/// cube; `None` if the outer cube is a larger inner one, or the region is empty.
///
/// # Errors
/// If the inner cube reaches out of it.
fn outer_box(params: &Params) -> Result<Option<[[f64; 3]; 2]>> {
    let (inner, size, aside) = (params.get(SCALE), params.get(OUTER_SCALE), params.get(OUTER_TRANSLATE));
    if !is_cubes(params) || size == [0.0; 3] && aside == [0.0; 3] || inner.contains(&0.0) {
        return Ok(None);
    }
    let mut sides = [[0.0; 3]; 2];
    for axis in 0..3 {
        let half = inner[axis].abs();
        let outer = if size[axis] > 0.0 { size[axis] } else { f64::from(params.get(OUTER)) * half };
        // The axes of a mirrored cube run backwards.
        let aside = if inner[axis] < 0.0 { -aside[axis] } else { aside[axis] };
        for (side, away) in [outer - aside, outer + aside].into_iter().enumerate() {
            if away < half * (1.0 - ROUNDING) {
                let axis = ["x", "y", "z"][axis];
                let fact =
                    format!("the inner cube reaches {} m along {axis}, the outer one {} m", half as f32, away as f32);
                return Err(Error::refused(fact)
                    .hint("raise `outer_scale`, or lower `scale` or `outer_translate`: the inner cube must lie in the outer one")
                    .of("outer_scale"));
            }
            sides[side][axis] = away / half;
        }
    }
    Ok(Some(sides))
}

/// Cubes that touch do not differ by the rounding of their params.
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, BenchResult, bench, conforms};
    use curves::gusts::{Control, GustMasks, Gusts, evaluate};
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
        evaluate(
            points,
            &Gusts {
                base: 0.0,
                falloff: &none,
                spheres: &[],
                controls: &controls,
                incoming: None,
                masks: GustMasks::NONE,
            },
        )
        .values
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
    fn the_outer_cube_may_have_a_size_and_a_place_of_its_own() {
        // Inner half edges 1, outer 3 along x, its centre 1 before: from −2 to 4. Along y and z `outer` is 2.
        let free = |bench: Bench| {
            bench
                .set(SHAPE, ControlShape::Cubes)
                .set(OUTER_SCALE, [3.0, 0.0, 0.0])
                .set(OUTER_TRANSLATE, [1.0, 0.0, 0.0])
        };
        let points =
            [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [2.5, 0.0, 0.0], [4.1, 0.0, 0.0], [-1.5, 0.0, 0.0], [-2.1, 0.0, 0.0]];
        let felt_by = felt(&free(linear(bench(&NODE))).cook(), &points);
        assert!(close(&felt_by, &[0.75, 0.5, 0.25, 0.0, 0.25, 0.0]), "{felt_by:?}");
        // The largest excess over the inner cube counts: (1.75 − 1)/(2 − 1) of y against (2 − 1)/(4 − 1) of x.
        assert!(close(&felt(&free(linear(bench(&NODE))).cook(), &[[2.0, 1.75, 0.0]]), &[0.125]));
        // It turns with the region, and a mirrored inner cube does not mirror it.
        let turned =
            free(linear(bench(&NODE))).set(ROTATE, degrees(0.0, 0.0, 90.0)).set(SCALE, [-1.0, 1.0, 1.0]).cook();
        assert!(close(&felt(&turned, &points.map(|[x, ..]| [0.0, x, 0.0])), &felt_by));
        // What `outer` gives is given by `outer_scale`, too: the same bits.
        let grid: Vec<[f32; 3]> = (0..64).map(|k| [0.07 * k as f32, -0.05 * k as f32, 0.02 * k as f32]).collect();
        let cubes = || linear(bench(&NODE)).set(SHAPE, ControlShape::Cubes);
        let same = cubes().set(OUTER_SCALE, [2.0; 3]).cook();
        assert_eq!(felt(&same, &grid), felt(&cubes().cook(), &grid));
    }

    #[test]
    fn an_inner_cube_that_reaches_out_of_the_outer_one_is_refused() {
        let with = |size: [f64; 3], aside: [f64; 3]| {
            bench(&NODE).set(SHAPE, ControlShape::Cubes).set(OUTER_SCALE, size).set(OUTER_TRANSLATE, aside).try_cook()
        };
        assert_eq!(
            with([0.0, 3.0, 0.0], [0.0, -2.5, 0.0]).unwrap_err().fact,
            "the inner cube reaches 1 m along y, the outer one 0.5 m"
        );
        assert!(with([0.5; 3], [0.0; 3]).is_err() && with([1.0; 3], [0.0; 3]).is_ok());
        assert!(with([0.0, 3.0, 0.0], [0.0, -2.0, 0.0]).is_ok(), "they may touch");
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
