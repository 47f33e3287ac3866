//! Curve_Wind_Shielding: curves in the lee of a collider receive less wind.
//!
//! W4. From each CV a ray of length `offset` runs upwind. The fraction of a curve's CVs whose ray hits a collider is
//! its `shielded` (W's alpha); its envelope is scaled by 1 − clamp(`shielded` · `shield`, 0, 1).
//!
//! Departures:
//! * W scales the envelope *by* alpha · `shield`, which would calm the exposed side. Its first sentence and figure 1
//!   show that the lee is meant.
//! * Rays are cast upwind from the CV, in a frame that looks along the wind ([`curves::shield`]), so a large offset
//!   costs neither precision nor time. The skin that a CV lies on does not shelter it; the far side of a body does.
//! * W's alpha takes n + 1 values and jumps between them as the wind turns. With `smooth` each CV looks upwind through
//!   a cone and counts by the fraction of it that is covered, which is continuous. On the bear of `graphs/assets`, in
//!   wind that turns by 1° a frame, the largest change of a curve's alpha in a frame falls from 1 to 0.28 at `smooth`
//!   0.5 and 0.18 at 1, and the curves that change by more than 0.1 in a frame from 3.1 to 0.6 and 0.1 %
//!   (tests/wind/shelter.rs).

use std::sync::Arc;

use curves::shield::{Collider, Neighbours, Shield, shield};
use engine::geometry::Triangles;
use engine::prelude::*;
use numerics::masked::Masked;
use numerics::tree::TriangleTree;

use crate::shared::group::{self, Group, taken};
use crate::shared::surface::tree;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves,
        "The curves before any wind bends them. Shelter then changes only with the skin and the wind.");
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh,
        "Meshes that block the wind, the skin included. They may move.");
}

params! { PARAMS:
    WIND_DIR: Param<[f64; 3]> = Param::direction("wind_dir", [1.0, 0.0, 0.0],
        "The direction that the wind blows towards. Its length is ignored.");
    OFFSET: Param<Maskable> = Param::maskable("offset", 10.0,
        "Largest distance upwind at which a collider still shelters a CV. 0 shelters nothing.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 10.0);
    SHIELD: Param<Maskable> = Param::maskable("shield", 1.0,
        "Fraction of the wind that a fully sheltered curve loses: 0 leaves the wind alone, 1 removes all of it. Above \
         1 even partly sheltered curves become calm.")
        .at_least(0.0).soft(0.0, 1.0);
    DISTANCE: Param<f32> = Param::float("distance", 0.0,
        "Distance over which the lee fades: a collider this far upwind no longer shelters a CV, one right next to it \
         shelters it fully. 0 shelters alike at any distance up to `offset`.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 10.0);
    FALLOFF: Param<f32> = Param::float("falloff", 1.0,
        "How shelter fades over `distance`: at 1 evenly, above 1 soon behind the collider, below 1 late. At a distance s \
         it is (1 − s ÷ `distance`) to the power of `falloff`.")
        .at_least(0.0).soft(0.0, 4.0).when(|params| params.get(DISTANCE) > 0.0);
    SMOOTH: Param<f32> = Param::float("smooth", 0.0,
        "Softens the edge of the lee, so that shelter does not pop as the wind turns: each CV looks upwind through a \
         cone instead of along a line, and is sheltered by the fraction of the cone that is covered, to 0.03 where \
         surfaces lie behind one another. 0 is a line, 1 a cone with a half angle of 0.1 radians; a cone costs more.")
        .within(0.0, 1.0);
    SKIN_GAP: Param<f32> = Param::float("skin_gap", 0.0,
        "A face whose plane is this close to a CV does not shelter it, because the CV lies on that face. 0 only allows \
         for rounding; if roots lie deeper in the skin, set this to their depth.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
    GROUP: Param<Name> = group::param();
}

/// Share of the wind that a CV lost to shelter.
const SHELTER: Attr<f32> = Attr::point("shelter");

const OUT: Output = Output::like("curves", &CURVES, "The curves, with less wind where they are sheltered.");

metrics! { METRICS:
    SHELTERED = Metric::new("sheltered_curves", Unit::None, "Curves that are at least partly sheltered.");
    RAYS = Metric::new("rays", Unit::None, "Rays, or cones, that were cast: one per CV.");
    EMPTY_GROUP = group::EMPTY;
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Wind_Shielding",
    3,
    "Reduces the wind for curves in the lee of a collider. Each CV looks upwind; the fraction of a curve's CVs that \
     see a collider is written to `shielded` and scales the curve's `envelope` down. Place this node before \
     Curve_Wind, on curves that are not yet bent.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &ENVELOPE])
.writes(&[&ENVELOPE, &SHIELDED, &SHELTER])
.attributes(|params| group::attributes(params, &[GROUP]))
.metrics(METRICS)
.neutral(|params, wires| match params {
    _ if wires.count(&COLLIDERS) == 0 => Some("no collider is wired"),
    _ if params.get(OFFSET).value == 0.0 => Some("`offset` is 0"),
    _ => None,
})
.neutral_fills(&[Fill::missing(ENVELOPE, 1.0), Fill::always(SHIELDED, 0.0), Fill::always(SHELTER, 0.0)])
.leaves_out(|params, _| {
    let stages = [
        (params.get(SHIELD).value, "envelope", "`shield` is 0"),
        (params.get(SMOOTH), "cones", "`smooth` is 0"),
        (params.get(DISTANCE), "fading", "`distance` is 0"),
    ];
    let left_out = stages.into_iter().filter(|(value, ..)| *value == 0.0);
    left_out.map(|(_, stage, why)| LeftOut::new(stage, why)).collect()
});

/// Half the angle of a cone at `smooth` 1, radians.
const WIDEST_CONE: f32 = 0.1;

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut curves = cx.edit(CURVES);
    let amount = cx.get(SHIELD).value;
    let looks = amount > 0.0 || cx.wants(SHIELDED);
    let group = Group::of(&cx.get(GROUP), &curves)?;
    cx.publish(EMPTY_GROUP, group::is_empty(group.as_ref()));
    if !looks && !cx.wants(SHELTER) {
        cx.publish(SHELTERED, 0.0);
        cx.publish(RAYS, 0.0);
        if curves.get(ENVELOPE).is_none() {
            let ones = vec![1.0; curves.point_count()];
            curves.set(ENVELOPE, ones)?;
        }
        return Ok(OUT.with(curves));
    }
    let (shielded, cast) = match &group {
        _ if !looks => (vec![0.0; curves.element_count()], 0),
        None => (sheltered(cx, &curves)?, curves.point_count()),
        Some(group) => sheltered_of(cx, group, &curves)?,
    };

    cx.publish(SHELTERED, shielded.iter().filter(|share| **share > 0.0).count() as f64);
    cx.publish(RAYS, cast as f64);
    let (envelope, lost) = {
        let shield = cx.mask(SHIELD, &curves)?;
        let factors = group.map(|group| group.factors(shield));
        let shield = group::masked(shield, factors.as_deref());
        let is_scaled = amount > 0.0 || curves.get(ENVELOPE).is_none();
        (
            is_scaled.then(|| scaled(&curves, &shielded, shield)),
            cx.wants(SHELTER).then(|| shelter(&curves, &shielded, shield)),
        )
    };
    if let Some(envelope) = envelope {
        curves.set(ENVELOPE, envelope)?;
    }
    if let Some(lost) = lost {
        curves.set(SHELTER, lost)?;
    }
    if cx.wants(SHIELDED) {
        curves.set(SHIELDED, shielded)?;
    }
    Ok(OUT.with(curves))
}

/// The fraction of each curve's CVs that the colliders shelter.
fn sheltered(cx: &Cx, curves: &Component) -> Result<Vec<f32>> {
    let smooth = cx.get(SMOOTH);
    let walls: Vec<Wall> = cx.part(COLLIDERS).into_iter().map(|mesh| Wall::of(mesh, smooth > 0.0)).collect();
    let colliders: Vec<Collider> = walls.iter().map(Wall::collider).collect();
    let how = Shield {
        wind: cx.get(WIND_DIR),
        offset: cx.mask(OFFSET, curves)?,
        distance: cx.get(DISTANCE),
        falloff: cx.get(FALLOFF),
        cone: WIDEST_CONE * smooth,
        skin_gap: cx.get(SKIN_GAP),
    };
    Ok(shield(curves.runs().starts(), curves.positions(), &colliders, &how))
}

/// The same where only the curves of a group are looked at, and the number of CVs that look.
fn sheltered_of(cx: &Cx, group: &Group, curves: &Component) -> Result<(Vec<f32>, usize)> {
    let chosen = group.curves(curves.runs());
    let part = taken(curves, &chosen)?;
    let mut shielded = vec![0.0; curves.element_count()];
    for (curve, share) in chosen.into_iter().zip(sheltered(cx, &part)?) {
        shielded[curve as usize] = share;
    }
    Ok((shielded, part.point_count()))
}

/// A collider, and what is computed once while it does not move.
struct Wall<'m> {
    points: &'m [[f32; 3]],
    triangles: Arc<Triangles>,
    tree: Arc<TriangleTree>,
    neighbours: Option<Arc<Neighbours>>,
}

impl<'m> Wall<'m> {
    fn of(mesh: &'m Component, with_neighbours: bool) -> Self {
        let triangles = mesh.triangles();
        let neighbours = || mesh.derived(|mesh| Neighbours::of(mesh.positions(), &triangles.corners));
        let neighbours = with_neighbours.then(neighbours);
        Self { points: mesh.positions(), tree: tree(mesh), neighbours, triangles }
    }

    fn collider(&self) -> Collider<'_> {
        let (tree, neighbours) = (Some(&*self.tree), self.neighbours.as_deref());
        Collider { points: self.points, triangles: &self.triangles.corners, tree, neighbours }
    }
}

/// The share of the wind that CV `cv` loses, 0…1.
#[inline(always)]
fn lost_at(cv: usize, shielded: f32, amount: &Masked<'_, f32>) -> f32 {
    (shielded * amount.at(cv)).clamp(0.0, 1.0)
}

/// A number of each CV, made of the share of the wind that it loses.
fn of_lost(curves: &Component, shielded: &[f32], amount: Masked<'_, f32>, number: impl Fn(f32) -> f32) -> Vec<f32> {
    let mut numbers = Vec::with_capacity(curves.point_count());
    for (cvs, shielded) in curves.runs().ranges().zip(shielded) {
        match amount.mask {
            None => numbers.resize(cvs.end, number(lost_at(cvs.start, *shielded, &amount))),
            Some(_) => numbers.extend(cvs.map(|cv| number(lost_at(cv, *shielded, &amount)))),
        }
    }
    numbers
}

/// The share of the wind that each CV loses.
fn shelter(curves: &Component, shielded: &[f32], amount: Masked<'_, f32>) -> Vec<f32> {
    of_lost(curves, shielded, amount, |lost| lost)
}

/// The envelope, 1 if missing, less the share that each CV loses.
fn scaled(curves: &Component, shielded: &[f32], amount: Masked<'_, f32>) -> Vec<f32> {
    let mut envelope = of_lost(curves, shielded, amount, |lost| 1.0 - lost);
    if let Some(incoming) = curves.get(ENVELOPE) {
        envelope.iter_mut().zip(incoming).for_each(|(left, envelope)| *left *= envelope);
    }
    envelope
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, bench, conforms};

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    /// A square wall across x at 0, two units high and wide.
    fn wall(scale: f32) -> Geometry {
        let points = [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]];
        let points = points.map(|p| p.map(|x| x * scale)).to_vec();
        Component::mesh(vec![4], vec![0, 1, 2, 3], points).unwrap().into()
    }

    /// An upright curve half a unit behind the wall, with two of its four CVs above it; and one in front of it.
    fn curves(scale: f32) -> Geometry {
        let lee = [0.0, 0.8, 1.6, 2.4].map(|y| [0.5, y, 0.0]);
        let windward = [0.0, 0.5].map(|y| [-0.5, y, 0.0]);
        let points = lee.iter().chain(&windward).map(|p| p.map(|x| x * scale)).collect();
        Component::curves(vec![4, 2], points).unwrap().into()
    }

    fn behind_a_wall() -> Bench {
        bench(&NODE).input(CURVES, curves(1.0)).input(COLLIDERS, wall(1.0))
    }

    #[test]
    fn a_half_sheltered_curve_loses_half_of_shield_at_any_scale() {
        for scale in [1e-3, 1.0, 1e3] {
            let bench = bench(&NODE).input(CURVES, curves(scale)).input(COLLIDERS, wall(scale));
            let out = bench.set(OFFSET, (10.0 * scale).into()).set(SHIELD, 0.5.into()).cook();
            assert_eq!(out.curves().get(SHIELDED), Some(&[0.5, 0.0][..]));
            assert_eq!(out.curves().get(ENVELOPE), Some(&[0.75, 0.75, 0.75, 0.75, 1.0, 1.0][..]));
            assert_eq!((out.metrics["sheltered_curves"], out.metrics["rays"]), (1.0, 6.0));
        }
    }

    #[test]
    fn shelter_is_the_share_of_the_wind_that_is_lost() {
        let mut some = curves(1.0);
        some.part_mut(Kind::Curves).unwrap().set(Attr::<i32>::element("some"), vec![1, 0]).unwrap();
        let shelter = |bench: Bench| bench.cook().curves().get(SHELTER).unwrap().to_vec();
        assert_eq!(shelter(behind_a_wall().set(SHIELD, 0.5.into())), [0.25, 0.25, 0.25, 0.25, 0.0, 0.0]);
        assert_eq!(shelter(behind_a_wall().set(SHIELD, 5.0.into())), [1.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
        assert_eq!(shelter(behind_a_wall().set(OFFSET, 0.0.into())), [0.0; 6]);
        let grouped = bench(&NODE).input(CURVES, some).input(COLLIDERS, wall(1.0)).set(GROUP, "some".into());
        assert_eq!(shelter(grouped), [0.5, 0.5, 0.5, 0.5, 0.0, 0.0]);
    }

    #[test]
    fn an_incoming_envelope_is_scaled() {
        let mut gusts = curves(1.0);
        gusts.part_mut(Kind::Curves).unwrap().set(ENVELOPE, vec![0.5, 0.25, 2.0, 0.0, 0.5, 0.5]).unwrap();
        let out = bench(&NODE).input(CURVES, gusts).input(COLLIDERS, wall(1.0)).cook();
        assert_eq!(out.curves().get(ENVELOPE), Some(&[0.25, 0.125, 1.0, 0.0, 0.5, 0.5][..]));
    }

    #[test]
    fn outside_a_group_nothing_is_sheltered() {
        let with = |name: &str, rows: [i32; 2], tips: [f32; 6]| {
            let mut curves = curves(1.0);
            let part = curves.part_mut(Kind::Curves).unwrap();
            part.set(ENVELOPE, vec![0.5, 0.25, 2.0, -0.0, 0.5, 0.5]).unwrap();
            part.set(Attr::<i32>::element("some"), rows.to_vec()).unwrap();
            part.set(Attr::<f32>::point("tips"), tips.to_vec()).unwrap();
            bench(&NODE).input(CURVES, curves).input(COLLIDERS, wall(1.0)).set(GROUP, name.into()).cook()
        };
        let tips = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let out = with("some", [0, 1], tips);
        assert_eq!(out.curves().get(SHIELDED), Some(&[0.0, 0.0][..]));
        let same = |a: &[f32], b: [f32; 6]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same(out.curves().get(ENVELOPE).unwrap(), [0.5, 0.25, 2.0, -0.0, 0.5, 0.5]));
        assert_eq!((out.metrics["sheltered_curves"], out.metrics["rays"]), (0.0, 2.0));
        let out = with("some", [7, 0], tips);
        assert_eq!(out.curves().get(SHIELDED), Some(&[0.5, 0.0][..]));
        assert_eq!(out.curves().get(ENVELOPE), Some(&[0.25, 0.125, 1.0, 0.0, 0.5, 0.5][..]));
        // Of a curve with one CV in the group, half of whose CVs see the wall, that CV alone loses wind.
        let out = with("tips", [0, 0], tips);
        assert_eq!(out.curves().get(SHIELDED), Some(&[0.5, 0.0][..]));
        assert!(same(out.curves().get(ENVELOPE).unwrap(), [0.5, 0.25, 1.0, -0.0, 0.5, 0.5]));
    }

    #[test]
    fn no_more_than_all_of_the_wind_is_removed() {
        let out = behind_a_wall().set(SHIELD, 5.0.into()).cook();
        assert_eq!(out.curves().get(ENVELOPE), Some(&[0.0, 0.0, 0.0, 0.0, 1.0, 1.0][..]));
    }

    #[test]
    fn a_wall_beyond_the_offset_shelters_nothing() {
        let with = |offset: f32| behind_a_wall().set(OFFSET, offset.into()).cook();
        assert_eq!(with(0.4).curves().get(SHIELDED), Some(&[0.0, 0.0][..]));
        assert_eq!(with(0.5).curves().get(SHIELDED), Some(&[0.5, 0.0][..]));
        assert_eq!(with(1e4).curves().get(SHIELDED), Some(&[0.5, 0.0][..]));
    }

    /// A mask of curves, with and without a group: the curve behind the wall looks far enough where its own offset is.
    #[test]
    fn a_mask_of_the_offset_is_read_at_each_curve() {
        let with = |far: [f32; 2], group: &str| {
            let mut curves = curves(1.0);
            let part = curves.part_mut(Kind::Curves).unwrap();
            part.set(Attr::<f32>::element("far"), far.to_vec()).unwrap();
            part.set(Attr::<i32>::element("some"), vec![1, 0]).unwrap();
            let offset = Maskable { value: 2.0, attribute: Some("far".into()) };
            let bench = bench(&NODE).input(CURVES, curves).input(COLLIDERS, wall(1.0));
            bench.set(OFFSET, offset).set(GROUP, group.into()).cook().curves().get(SHIELDED).unwrap().to_vec()
        };
        for group in ["", "some"] {
            assert_eq!(with([0.5, 0.0], group), [0.5, 0.0]);
            assert_eq!(with([0.2, 1.0], group), [0.0, 0.0]);
        }
    }

    #[test]
    fn shelter_fades_with_the_distance_of_the_nearest_collider() {
        // The wall is 0.5 upwind; two of the four CVs are behind it. (1 − 0.5 ÷ 2) to the power of 1 and 2.
        let share = |bench: Bench| bench.cook().curves().get(SHIELDED).unwrap()[0];
        let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} for {b}");
        near(share(behind_a_wall().set(DISTANCE, 2.0)), 0.5 * 0.75);
        near(share(behind_a_wall().set(DISTANCE, 2.0).set(FALLOFF, 2.0)), 0.5 * 0.5625);
        near(share(behind_a_wall().set(DISTANCE, 2.0).set(FALLOFF, 0.0)), 0.5);
        assert_eq!(share(behind_a_wall().set(DISTANCE, 0.4)), 0.0);
        assert_eq!(share(behind_a_wall().set(DISTANCE, 0.5).set(FALLOFF, 0.0)), 0.0, "at its end nothing is left");
        assert_eq!(share(behind_a_wall().set(DISTANCE, 2.0).set(OFFSET, 0.4.into())), 0.0, "`offset` still ends it");
        // A second wall farther upwind changes nothing, one between does: 1 − 0.25 ÷ 2.
        let at = |x: f32| {
            let mut wall = wall(1.0);
            wall.part_mut(Kind::Mesh).unwrap().edit(P).unwrap().iter_mut().for_each(|p| p[0] += x);
            wall
        };
        let both = |x: f32| share(behind_a_wall().input(COLLIDERS, at(x)).set(DISTANCE, 2.0));
        near(both(-1.0), 0.5 * 0.75);
        near(both(0.25), 0.5 * 0.875);
        // A cone that the wall covers all of, too: one CV low behind it.
        let low: Geometry = Component::curves(vec![1], vec![[0.5, 0.0, 0.0]]).unwrap().into();
        let cone = bench(&NODE).input(CURVES, low).input(COLLIDERS, wall(1.0)).set(SMOOTH, 1.0).set(DISTANCE, 2.0);
        let found = share(cone);
        assert!((found - 0.75).abs() < 1e-4, "{found}");
    }

    #[test]
    fn fading_scales_with_the_scene() {
        let shares = |scale: f32| {
            let bench = bench(&NODE)
                .input(CURVES, curves(scale))
                .input(COLLIDERS, wall(scale))
                .set(OFFSET, (10.0 * scale).into());
            bench.set(DISTANCE, 2.0 * scale).set(FALLOFF, 3.0).cook().curves().get(SHIELDED).unwrap().to_vec()
        };
        let here = shares(1.0);
        assert!(here[0] > 0.2 && here[1] == 0.0);
        for scale in [1e-6, 1e-3, 1e3, 1e6] {
            assert!(here.iter().zip(shares(scale)).all(|(a, b)| (a - b).abs() < 1e-6), "{scale}");
        }
    }

    #[test]
    fn with_shield_0_shielded_is_still_written() {
        let out = behind_a_wall().set(SHIELD, 0.0.into()).cook();
        assert_eq!(out.curves().get(SHIELDED), Some(&[0.5, 0.0][..]));
        assert_eq!(out.curves().get(ENVELOPE), Some(&[1.0; 6][..]));
    }

    #[test]
    fn without_colliders_or_offset_nothing_is_sheltered() {
        let alone = bench(&NODE).input(CURVES, curves(1.0)).cook();
        let near = behind_a_wall().set(OFFSET, 0.0.into()).cook();
        for out in [alone, near] {
            assert_eq!(out.curves().get(SHIELDED), Some(&[0.0, 0.0][..]));
            assert_eq!(out.curves().get(ENVELOPE), Some(&[1.0; 6][..]));
            assert_eq!(out.metrics["rays"], 0.0);
        }
    }

    #[test]
    fn smooth_counts_the_covered_fraction_of_a_cone() {
        // Half a radius above the wall's edge a disc is covered by 1/3 − √3 ÷ 4π = 0.1955.
        let height = 1.0 + 0.25 * libm::tan(0.1) as f32;
        let cv: Geometry = Component::curves(vec![1], vec![[0.5, height, 0.0]]).unwrap().into();
        let out = bench(&NODE).input(CURVES, cv).input(COLLIDERS, wall(1.0)).set(SMOOTH, 1.0).cook();
        let share = out.curves().get(SHIELDED).unwrap()[0];
        assert!((share - 0.1955).abs() < 2e-4, "{share}");
    }

    #[test]
    fn a_skin_gap_of_their_depth_frees_roots_within_the_skin() {
        let sunken: Geometry = Component::curves(vec![2], vec![[0.001, 0.0, 0.0], [-0.1, 0.0, 0.0]]).unwrap().into();
        let with = |gap| {
            let out = bench(&NODE).input(CURVES, sunken.clone()).input(COLLIDERS, wall(1.0)).set(SKIN_GAP, gap).cook();
            out.curves().get(SHIELDED).unwrap()[0]
        };
        assert_eq!((with(0.0), with(0.002)), (0.5, 0.0));
    }

    #[test]
    fn several_colliders_shelter_together_and_may_move() {
        let higher = |frame: Frame| {
            let mut wall = wall(1.0);
            for point in wall.part_mut(Kind::Mesh).unwrap().edit(P).unwrap() {
                point[1] += if frame.number() < 2.0 { 100.0 } else { 2.0 };
            }
            wall
        };
        let outs = behind_a_wall().moving(COLLIDERS, higher).frames([1, 2]);
        let shielded: Vec<f32> = outs.iter().map(|out| out.curves().get(SHIELDED).unwrap()[0]).collect();
        assert_eq!(shielded, [0.5, 1.0]);
    }
}
