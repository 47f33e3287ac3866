//! Curve_Deform: an existing groom follows guide curves.
//!
//! At rest each curve is bound to the guides with the nearest roots, as in Curve_Interpolate, with weights that fall to 0
//! before one guide is replaced by another. At every frame a curve's segments turn as its guides have turned since rest
//! at the same fraction of their lengths ([`curves::deform`]): the groom keeps its own shapes, lengths and attributes. On
//! a skin, roots stay on their faces and curves turn with it as in Curve_Attach; roots that are lifted off the skin, as
//! Curve_Wind_Collision lifts those of guides, lift those of the curves.
//!
//! With `keep_out` a curve that would enter the skin is blended with its rest shape by the least share that frees it
//! ([`curves::collide::keep_out`]). Those that stay above everything around their roots need no test.
//!
//! `v`, `N` and `orient` turn too, those of a CV with the segment after it, those of a curve with its root. If the curves
//! have no `Pref`, it is set to their incoming positions.

use curves::attach::{RootPose, RootPositions, SkinBinding, rotate_orientations, rotate_vectors};
use curves::collide::{Clearance, KeepOut, KeptOut, keep_out};
use curves::deform::{
    CurveDeform, DeformedCurves, GuideSegments, GuideTurns, HairGuides, carried_poses, deform_curves, guide_poses,
};
use curves::guides::{GuideWeights, MAX_GUIDES, OrientedPoint, guide_weights};
use engine::prelude::*;
use numerics::vector::{DQuat, DVec3, to_f32, to_f64};
use std::sync::Arc;

use crate::shared::faces::{counted, inside_out, same_faces};
use crate::shared::kept::Array;
use crate::shared::skin::skin;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The groom at rest, root first.");
    REST_GUIDES: Input = Input::one("rest_guides", Kind::Curves, "The guides at rest, as they stand in the groom.");
    GUIDES: Input = Input::one("guides", Kind::Curves, "The same guides now: blown, swung, collided or keyed.");
    REST_SKIN: Input<Opt> = Input::optional("rest_skin", Kind::Mesh,
        "The mesh on which groom and guides stand at rest. By default `skin` at the scene's first frame.");
    SKIN: Input<Opt> = Input::optional("skin", Kind::Mesh,
        "The same mesh in its current pose, on which `guides` stand. Without it roots move with those of the guides.")
        .read_at(|_| Times::NOW.and(Times::START));
}

params! { PARAMS:
    COUNT: Param<i64> = Param::int("guides", 3,
        "Number of nearest guides that a curve follows: 1 makes tufts around the guides, more make a smoother coat.")
        .within(1.0, MAX_GUIDES as f64).soft(1.0, 8.0);
    RADIUS: Param<f32> = Param::float("radius", 0.0,
        "Distance from a guide's root up to which curves follow the guide, less and less towards that distance; curves \
         farther from all guides only follow the skin. 0 lets every curve follow its nearest guides, however far they \
         are.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 1.0);
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0,
        "How much of the guides' turn is followed: 0 only carries curves along with their roots, 1 turns them as the \
         guides turn. Lengths are kept at any value.").within(0.0, 1.0);
    KEEP_OUT: Param<bool> = Param::bool("keep_out", true,
        "Keeps curves from entering the skin where their guides are some way off. Curves that cross the skin at rest \
         first have their roots lifted out of it.");
}

const OUT: Output = Output::like("curves", &CURVES, "The groom, deformed as the guides are. Lengths are kept.");

metrics! { METRICS:
    KEPT_OUT = Metric::new("kept_out", Unit::None, "Curves that would have entered the skin.");
    CROSSINGS_LEFT = Metric::new("crossings_left", Unit::None,
        "Segments that still cross the skin although `keep_out` is on.")
        .warn_above(0.0, "No turn frees these segments from the skin. Raise `offset_root` of the guides' \
            Curve_Wind_Collision, which lifts roots out of creases.");
    STARTED_INSIDE = Metric::new("started_inside", Unit::None,
        "Curves that would enter the skin and, even with their roots lifted, also cross it at rest. They are turned out \
         of it as far as possible.");
    UNGUIDED = Metric::new("unguided", Unit::None, "Curves without a guide, or with none within `radius`.")
        .warn_above(0.0, "These curves follow no guide: they only move with the skin, if one is wired. Raise `radius`, set it to 0 \
            to let every curve follow its nearest guides, or grow guides near them.");
    OFF_SKIN = Metric::new("guides_off_skin", Unit::None,
        "Guides that do not move with the skin. A guide counts if its root misses the point to which the skin carries it \
         by more than half the distance carried, and by more than 0.01 of the guide's length.")
        .warn_above(0.0, "`skin` moves and these guides do not, so the curves that follow them leave the skin. Put Curve_Attach, \
            with the same skins, after `rest_guides` and before the nodes that bend the guides.");
    FAR_ROOTS = Metric::new("far_roots", Unit::None,
        "Curves and guides whose roots are farther from the skin at rest than they are long.")
        .warn_above(0.0, "These curves are farther from `rest_skin` than they are long, so they probably grew on another \
            mesh, or on this one at another scale or pose. Wire the mesh in the pose in which they were grown.");
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Deform",
    6,
    "Lets an existing groom follow guide curves, so that only a few hundred guides need to be simulated. Each curve \
     turns as the guides nearest to its root have turned since rest, and keeps its own shape, length and attributes. If \
     `skin` is wired, curves are kept out of it.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P, &PREF])
.writes(&[&P, &PREF])
.attributes(|_| {
    // Only existing attributes are rotated, so they are read as well.
    [(); 2].map(|()| AttrNames::These([V.name, N.name, ORIENT.name].map(Name::from).to_vec()))
})
.metrics(METRICS)
.leaves_out(|params, wires| match params {
    _ if !params.get(KEEP_OUT) => vec![LeftOut::new("keep_out", "`keep_out` is false")],
    _ if wires.count(&SKIN) == 0 => vec![LeftOut::new("keep_out", "no skin is wired")],
    _ => Vec::new(),
});

fn cook(cx: &Cx) -> Result<Outputs> {
    let (curves, rest_guides, guides) = (cx.part(CURVES), cx.part(REST_GUIDES), cx.part(GUIDES));
    if rest_guides.runs() != guides.runs() {
        let [now, rest] = [guides, rest_guides].map(count);
        let fact = format!("`guides` has {now}, `rest_guides` {rest}, or their distribution differs");
        return Err(Error::refused(fact).hint("give the same guides at rest and now"));
    }
    let skins = skins(cx)?;
    let key = BoundKey::of(cx, rest_guides, skins.map(|(rest, _)| rest));
    let bound = curves.kept(key, || Bound::new(cx, curves, rest_guides, skins.map(|(rest, _)| rest)))?;
    cx.check_cancelled()?;

    let mut out = cx.edit(CURVES);
    if cx.wants(PREF) && curves.get(PREF).is_none() {
        let rest = curves.table(Owner::Point).column(P.name).cloned().expect("every component has `P`");
        out.set_column(Owner::Point, PREF.name, rest)?;
    }
    cx.publish(UNGUIDED, bound.unguided as f64);
    cx.publish(FAR_ROOTS, bound.far_roots as f64);
    let skin_rests = skins.is_none_or(|(rest, now)| rest.positions() == now.positions());
    let moves = !skin_rests || guides.positions() != rest_guides.positions();
    let keeps_out = skins.filter(|_| cx.get(KEEP_OUT));
    let (mut kept, mut length_error, mut off_skin) = (KeptOut::default(), 0.0, 0);
    // What crosses the skin at rest is freed there too: else it would jump with the first move.
    if moves || keeps_out.is_some() {
        let on_skin = match skins {
            Some((_, now)) => {
                now.kept(SameBound(bound.clone()), || Ok(OnSkin::new(&bound, curves.element_count(), now, skin_rests)))?
            }
            None => Arc::new(OnSkin::without(&bound, curves, rest_guides, guides)),
        };
        let skin = keeps_out.map(|(_, mesh)| skin(mesh));
        let keep_out_of = skin.as_ref().map(|skin| KeepOut {
            skin: skin.surface(),
            rest: curves.positions(),
            poses: on_skin.hairs(),
            gap: GAP * bound.mean_length,
            clearance: &on_skin.clearance,
        });
        let starts = curves.runs().starts();
        if let Some(how) = &keep_out_of {
            how.prepare(starts);
        }
        let deformed = match moves {
            true => deformed(cx, &bound, &on_skin, [rest_guides, guides], keep_out_of.as_ref())?,
            false => DeformedCurves { points: curves.positions().to_vec(), ..DeformedCurves::default() },
        };
        length_error = deformed.length_error;
        if let (Some(_), Some(poses)) = (skins, on_skin.guides()) {
            off_skin = roots_off(rest_guides, guides, poses);
        }
        let mut points = deformed.points;
        if let Some(how) = &keep_out_of {
            kept = keep_out(starts, &mut points, how, &deformed.may_meet);
        }
        if moves || kept.kept_out > 0 {
            out.set(P, points)?;
        }
        rotate_attributes(&mut out, on_skin.hairs(), &deformed.rotations);
    }
    cx.publish(OFF_SKIN, off_skin as f64);
    cx.publish(KEPT_OUT, kept.kept_out as f64);
    cx.publish(CROSSINGS_LEFT, kept.crossings_left as f64);
    cx.publish(STARTED_INSIDE, kept.started_inside as f64);
    cx.publish(LENGTH_ERROR, kept.length_error.max(length_error));
    Ok(OUT.with(out))
}

/// Number of guides whose roots are off where the poses of their skin carry them.
fn roots_off(rest: &Component, now: &Component, poses: &[RootPose]) -> usize {
    let is_off = |(cvs, pose): (std::ops::Range<usize>, &RootPose)| {
        let Some(first) = cvs.clone().next() else { return false };
        let moved = to_f64(now.positions()[first]) - to_f64(rest.positions()[first]);
        let off = (moved - pose.translation).norm();
        off > 0.5 * pose.translation.norm() && off > 0.01 * length(&rest.positions()[cvs])
    };
    rest.runs().ranges().zip(poses).filter(|one| is_off(one.clone())).count()
}

/// Arc length at which a curve stops before the skin, in mean lengths of curves.
const GAP: f64 = 1e-3;

/// The skin at rest and now, if it is wired.
fn skins<'c>(cx: &'c Cx) -> Result<Option<(&'c Component, &'c Component)>> {
    let Some(now) = cx.part(SKIN) else { return Ok(None) };
    let Some(rest) = cx.part(REST_SKIN).or(cx.part_at_start(SKIN)) else { return Ok(None) };
    if same_faces(rest, now) {
        return Ok(Some((rest, now)));
    }
    if inside_out(rest, now) {
        let fact = "`skin` is the skin at rest mirrored, with its faces inside out";
        return Err(Error::refused(fact).hint("mirror the output of this node instead of `skin`"));
    }
    let [now, rest] = [now, rest].map(counted);
    let fact = format!("`skin` has {now}, at rest {rest}, or their topology differs");
    Err(Error::refused(fact).hint("give two poses of one mesh"))
}

fn count(curves: &Component) -> String {
    format!("{} curves and {} CVs", curves.element_count(), curves.point_count())
}

/// The groom deformed, before it is kept out of the skin.
fn deformed(
    cx: &Cx,
    bound: &Bound,
    on_skin: &OnSkin,
    [rest, now]: [&Component; 2],
    keep_out: Option<&KeepOut<'_>>,
) -> Result<DeformedCurves> {
    let curves = cx.part(CURVES);
    let positions = [rest.positions(), now.positions()];
    let turns = GuideTurns::new(&bound.segments, rest.runs().starts(), positions, on_skin.guides());
    let how = CurveDeform {
        guides: &bound.guides,
        turns: &turns,
        poses: on_skin.hairs(),
        blend: cx.mask(BLEND, curves)?,
        keep_out,
    };
    let turned = |name: &str| curves.columns().any(|(owner, column, _)| owner == Owner::Point && **column == *name);
    let with_rotations = [V.name, N.name, ORIENT.name].into_iter().any(turned);
    Ok(deform_curves(curves.runs().starts(), &how, with_rotations))
}

/// Rotates vectors and orientations, of CVs and of curves.
fn rotate_attributes(curves: &mut Component, roots: Option<&[RootPose]>, rotations: &[DQuat]) {
    let pose = |rotation: &_| RootPose { translation: DVec3::zeros(), rotation: *rotation, lost: false };
    let cvs: Vec<RootPose> = rotations.iter().map(pose).collect();
    let rows = |poses: &[RootPose]| (0..=poses.len() as u32).collect::<Vec<u32>>();
    if !cvs.is_empty() {
        for name in [V.name, N.name] {
            if let Some(vectors) = curves.edit(Attr::point(name)) {
                rotate_vectors(&rows(&cvs), vectors, &cvs);
            }
        }
        if let Some(turns) = curves.edit(ORIENT) {
            rotate_orientations(&rows(&cvs), turns, &cvs);
        }
    }
    let Some(roots) = roots else { return };
    for name in [V.name, N.name] {
        if let Some(vectors) = curves.edit(Attr::element(name)) {
            rotate_vectors(&rows(roots), vectors, roots);
        }
    }
    if let Some(turns) = curves.edit(Attr::element(ORIENT.name)) {
        rotate_orientations(&rows(roots), turns, roots);
    }
}

/// What a binding depends on, besides the curves.
struct BoundKey {
    guides: (Array, Topology),
    skin: Option<(Array, Topology)>,
    count: i64,
    radius: u32,
}

impl BoundKey {
    fn of(cx: &Cx, guides: &Component, skin: Option<&Component>) -> Self {
        let of = |part: &Component| (Array::of(part, P.name), part.topology().clone());
        Self { guides: of(guides), skin: skin.map(of), count: cx.get(COUNT), radius: cx.get(RADIUS).to_bits() }
    }
}

impl PartialEq for BoundKey {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&(Array, Topology), &(Array, Topology))| a.0 == b.0 && (a.1.same(&b.1) || a.1 == b.1);
        same((&self.guides, &other.guides))
            && self.skin.is_some() == other.skin.is_some()
            && self.skin.iter().zip(&other.skin).all(same)
            && (self.count, self.radius) == (other.count, other.radius)
    }
}

/// The guides of each curve: the same at every frame.
struct Bound {
    weights: GuideWeights,
    /// The same, and where each segment is along them.
    guides: HairGuides,
    /// Of the guides.
    segments: GuideSegments,
    /// Of the curves, metres.
    mean_length: f64,
    /// Roots of curves and of guides on the skin at rest.
    on_skin: Option<(SkinBinding, SkinBinding)>,
    unguided: usize,
    far_roots: usize,
}

impl Bound {
    fn new(cx: &Cx, curves: &Component, guides: &Component, skin: Option<&Component>) -> Result<Self> {
        let roots = [curves, guides].map(|part| RootPositions::of(part.runs().starts(), part.positions()));
        let bind = |roots: &RootPositions| match skin {
            None => Ok(None),
            Some(skin) => SkinBinding::to_closest(skin.positions(), &skin.triangles().corners, roots.as_slice())
                .map(Some)
                .ok_or_else(|| {
                    Error::refused("the skin at rest has no face to attach curves to")
                        .hint("wire the mesh that the curves grew on")
                }),
        };
        let on_skin = bind(&roots[0])?.zip(bind(&roots[1])?);
        let oriented = |roots: &RootPositions, binding: Option<&SkinBinding>| -> Vec<OrientedPoint> {
            // Without a skin all normals are alike, so that distances are Euclidean.
            let normals = binding.map_or_else(|| vec![DVec3::y(); roots.as_slice().len()], SkinBinding::normals);
            let both = roots.as_slice().iter().zip(normals);
            both.map(|(root, normal)| OrientedPoint { position: *root, normal: to_f32(normal) }).collect()
        };
        let hairs = oriented(&roots[0], on_skin.as_ref().map(|(curves, _)| curves));
        let posts = oriented(&roots[1], on_skin.as_ref().map(|(_, guides)| guides));
        let mut weights = guide_weights(&posts, &hairs, cx.get(COUNT) as usize);
        if cx.get(RADIUS) > 0.0 {
            weights = weights.within(&posts, &hairs, cx.get(RADIUS));
        }
        // Without guides there are no weights.
        let unguided = |hair: &usize| weights.hairs() == 0 || weights.of(*hair).iter().all(|guide| guide.weight == 0.0);
        let far = |binding: &SkinBinding, part: &Component| binding.far_roots(part.runs().starts(), part.positions());
        let segments = GuideSegments::of(guides.runs().starts(), guides.positions());
        Ok(Self {
            guides: HairGuides::of(&weights, &segments, curves.runs().starts(), curves.positions()),
            unguided: (0..curves.element_count()).filter(unguided).count(),
            weights,
            segments,
            mean_length: mean_length(curves),
            far_roots: on_skin.as_ref().map_or(0, |(hairs, posts)| far(hairs, curves) + far(posts, guides)),
            on_skin,
        })
    }
}

fn mean_length(curves: &Component) -> f64 {
    let points = curves.positions();
    curves.runs().ranges().map(|cvs| length(&points[cvs])).sum::<f64>() / curves.element_count().max(1) as f64
}

fn length(cvs: &[[f32; 3]]) -> f64 {
    cvs.windows(2).map(|ends| (to_f64(ends[1]) - to_f64(ends[0])).norm()).sum()
}

/// A binding as a key: it equals itself alone.
struct SameBound(Arc<Bound>);

impl PartialEq for SameBound {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// What follows from a binding and a pose of the skin.
struct OnSkin {
    /// Poses of the roots of curves and of guides; `None` at rest.
    poses: Option<(Vec<RootPose>, Vec<RootPose>)>,
    clearance: Clearance,
}

impl OnSkin {
    fn new(bound: &Bound, curves: usize, skin: &Component, rests: bool) -> Self {
        let moved = bound.on_skin.as_ref().filter(|_| !rests);
        let poses = moved.map(|(hairs, guides)| (hairs.poses(skin.positions()), guides.poses(skin.positions())));
        Self { poses, clearance: Clearance::of(curves) }
    }

    /// Without a skin.
    fn without(bound: &Bound, curves: &Component, rest: &Component, now: &Component) -> Self {
        let starts = rest.runs().starts();
        let guides = guide_poses(starts, rest.positions(), now.positions());
        let roots = [curves, rest].map(|part| RootPositions::of(part.runs().starts(), part.positions()));
        let hairs = carried_poses(&bound.weights, roots[0].as_slice(), roots[1].as_slice(), &guides);
        Self { poses: Some((hairs, guides)), clearance: Clearance::of(curves.element_count()) }
    }

    fn hairs(&self) -> Option<&[RootPose]> {
        self.poses.as_ref().map(|(hairs, _)| &hairs[..])
    }

    fn guides(&self) -> Option<&[RootPose]> {
        self.poses.as_ref().map(|(_, guides)| &guides[..])
    }
}

#[cfg(test)]
mod tests;
