//! Curve_Interpolate: hairs that fill the skin between guide curves.
//!
//! At the scene's first frame roots are distributed over the skin as in Curve_Scatter, and each hair is bound to the
//! guides with the nearest roots; weights fall to 0 before one guide is replaced by another ([`curves::guides`]). Both
//! are kept for all frames and do not depend on the guides' motion: at every frame a hair is the same blend of the
//! current shapes of its guides, so any frame cooks alone. Shapes are blended in the roots' local frames: on a curved
//! skin hairs stand at the same angle as their guides, and where the skin moves, the frames rotate as in Curve_Attach.
//! Roots stay on their faces. A hair at a guide's root equals that guide.
//!
//! Float attributes of the guides are blended with the same weights, `v` and `N` rotated as well; integers, and
//! `orient`, are those of the guide with the largest weight. `curve_id` is the hair's index in the infinite sequence of
//! roots, `Pref` the hair at the scene's first frame, `uvw` the skin's if it has one.

use curves::attach::{RootPose, RootPositions, SkinBinding};
use curves::guides::{
    CurveDomain, GuideWeights, HairBlend, MAX_GUIDES, OrientedPoint, ResampledGuides, blend_hairs, guide_weights,
};
use curves::surface::SurfacePoint;
use engine::prelude::*;
use numerics::vector::{DVec3, to_f32, to_f64};

use crate::shared::kept::Array;
use crate::shared::planting::{self, Planting, at_roots, same_rows};

inputs! { INPUTS:
    GUIDES: Input = Input::one("guides", Kind::Curves, "Guide curves on the skin, root first. They may move, but must \
        keep their CVs.")
        .read_at(|_| Times::START.and(Times::NOW));
    SKIN: Input = Input::one("skin", Kind::Mesh, "The mesh that hairs grow on. It may move, but must keep its faces.")
        .read_at(|_| Times::START.and(Times::NOW));
}

params! { PARAMS:
    DENSITY: Param<f32> = Param::float("density", 10_000.0, "Number of hairs per square metre, before the mask.")
        .unit(Unit::PerSquareMetre).at_least(0.0).soft(0.0, 1_000_000.0);
    COUNT: Param<i64> = Param::int("guides", 3,
        "Number of nearest guides that a hair is blended from: 1 makes clumps around the guides, more make a smoother \
         coat.").within(1.0, MAX_GUIDES as f64).soft(1.0, 8.0);
    CVS: Param<i64> = Param::int("cvs", 0, "Number of CVs of each hair. 0 uses the largest CV count of any guide.")
        .within(0.0, 10_000.0).soft(0.0, 32.0);
    SEED: Param<Seed> = Param::seed("Each seed gives other root positions.");
    MASK: Param<Name> = planting::MASK;
}

const CURVES: Output = Output::new(
    "curves",
    &[Kind::Curves],
    "The hairs, root first, with `Pref`, `curve_id` and the attributes of their guides.",
);

metrics! { METRICS:
    GROWN = Metric::new("curves", Unit::None, "Number of hairs grown.");
    FAR_ROOTS = Metric::new("far_roots", Unit::None,
        "Guides whose roots are farther from the skin than the guides are long.")
        .warn_above(0.0, "These guides are farther from `skin` than they are long, so they probably belong to another \
            mesh, or to this one at another scale. Compare the `scale` of both files.");
    LENGTH_ERROR = Metric::new("length_error", Unit::None,
        "The largest difference between a hair's length and the blended length of its guides, relative to the \
         latter.");
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Interpolate",
    2,
    "Fills a skin with hairs between guide curves. Each hair blends the shapes and lengths of the guides nearest to \
     its root and moves with them; where guides point in different directions, hairs change direction gradually and do \
     not shrink.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[Accuracy::larger("cvs", Trials::These(&["3", "5", "9", "17", "33"]))])
.outputs(&[&CURVES])
.writes(&[&P, &PREF, &CURVE_ID])
.attributes(|_| [AttrNames::All, AttrNames::All])
.metrics(METRICS)
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let (rest, skin) = (planting::kept_faces(cx.part_at_start(SKIN), cx.part(SKIN))?, cx.part(SKIN));
    let (first, guides) = (guides_at_start(cx)?, cx.part(GUIDES));
    let cvs = match cx.get(CVS) {
        0 => guides.runs().counts().max().unwrap_or(2) as usize,
        cvs => cvs as usize,
    };
    let coat = rest.kept(CoatKey::of(cx, first, rest, cvs), || Coat::grow(cx, first, rest, cvs))?;
    cx.check_cancelled()?;

    let poses = (rest.positions() != skin.positions()).then(|| coat.poses(skin));
    let mut roots: Vec<DVec3> = coat.hairs.roots().collect();
    if let Some((hairs, _)) = &poses {
        roots.iter_mut().zip(hairs).for_each(|(root, pose)| *root += pose.translation);
    }
    let poses = poses.as_ref().map(|(hairs, guides)| (&hairs[..], &guides[..]));
    let now = HairBlend { weights: &coat.weights, roots: &roots, poses };
    let shapes = ResampledGuides::new(guides.runs().starts(), guides.positions(), cvs);
    let blended = blend_hairs(shapes.clone(), &now);
    let mut curves = Component::curves(vec![cvs as u32; roots.len()], blended.points)?;
    curves.set(CURVE_ID, coat.ids.clone())?;
    if cx.wants(PREF) {
        let still = poses.is_none() && same_rows(guides, first, P.name);
        let column = if still { curves.table(Owner::Point).column(P.name).cloned() } else { None };
        curves.set_column(Owner::Point, PREF.name, column.unwrap_or_else(|| Column::new(coat.at_rest(first, cvs))))?;
    }
    carry_over(cx, &mut curves, guides, &shapes, &now)?;
    if let Some(uvw) = skin.get(UVW).filter(|_| cx.wants(UVW)) {
        curves.set(UVW, at_roots(uvw, &rest.triangles().corners, coat.roots.iter(), cvs))?;
    }
    cx.publish(GROWN, roots.len() as f64);
    cx.publish(FAR_ROOTS, coat.guides.far_roots(first.runs().starts(), first.positions()) as f64);
    cx.publish(LENGTH_ERROR, blended.length_error);
    Ok(CURVES.with(Geometry::from(curves)))
}

/// The guides at the scene's first frame.
///
/// # Errors
/// If their CVs have changed since.
fn guides_at_start<'c>(cx: &'c Cx) -> Result<&'c Component> {
    let (first, now) = (cx.part_at_start(GUIDES), cx.part(GUIDES));
    if first.runs() == now.runs() {
        return Ok(first);
    }
    let fact = format!(
        "`guides` has {} curves and {} CVs, but {} and {} at the scene's first frame, or their distribution differs",
        now.element_count(),
        now.point_count(),
        first.element_count(),
        first.point_count()
    );
    Err(Error::refused(fact).hint("guides may move, but must keep their CVs"))
}

/// What a coat depends on.
#[derive(PartialEq)]
struct CoatKey {
    guides: RootPositions,
    mask: Array,
    density: u32,
    count: i64,
    cvs: usize,
    seed: u32,
}

impl CoatKey {
    fn of(cx: &Cx, guides: &Component, skin: &Component, cvs: usize) -> Self {
        Self {
            guides: RootPositions::of(guides.runs().starts(), guides.positions()),
            mask: Array::of(skin, &cx.get(MASK)),
            density: cx.get(DENSITY).to_bits(),
            count: cx.get(COUNT),
            cvs,
            seed: cx.get(SEED).0,
        }
    }
}

/// Roots, guides and weights of the hairs: the same at every frame.
struct Coat {
    ids: Vec<i32>,
    /// Roots of the hairs.
    roots: Vec<SurfacePoint>,
    weights: GuideWeights,
    hairs: SkinBinding,
    guides: SkinBinding,
}

impl Coat {
    fn grow(cx: &Cx, guides: &Component, skin: &Component, cvs: usize) -> Result<Self> {
        let mask = planting::mask(&cx.get(MASK), skin)?;
        let density = if guides.runs().is_empty() { 0.0 } else { cx.get(DENSITY) };
        let planted = Planting { density, mask, cvs, seed: cx.get(SEED) }.roots(cx, skin)?;
        let (ids, roots): (Vec<i32>, Vec<SurfacePoint>) =
            planted.into_iter().map(|(index, root)| (index as i32, root)).unzip();
        cx.check_cancelled()?;

        let (points, triangles) = (skin.positions(), &skin.triangles().corners);
        let hairs = SkinBinding::to_surface(points, triangles, &roots);
        let guide_roots = RootPositions::of(guides.runs().starts(), guides.positions());
        // On a skin without faces no hairs grow, so no guide needs a binding.
        let guides = SkinBinding::to_closest(points, triangles, guide_roots.as_slice());
        let guides = guides.unwrap_or_else(|| SkinBinding::to_surface(points, triangles, &[]));
        let oriented = |binding: &SkinBinding| -> Vec<OrientedPoint> {
            let both = binding.roots().zip(binding.normals());
            both.map(|(root, normal)| OrientedPoint { position: to_f32(root), normal: to_f32(normal) }).collect()
        };
        let weights = guide_weights(&oriented(&guides), &oriented(&hairs), cx.get(COUNT) as usize);
        Ok(Self { ids, roots, weights, hairs, guides })
    }

    /// The motion of the skin at the roots of hairs and of guides.
    fn poses(&self, skin: &Component) -> (Vec<RootPose>, Vec<RootPose>) {
        (self.hairs.poses(skin.positions()), self.guides.poses(skin.positions()))
    }

    /// The hairs at the scene's first frame.
    fn at_rest(&self, guides: &Component, cvs: usize) -> Vec<[f32; 3]> {
        let shapes = ResampledGuides::new(guides.runs().starts(), guides.positions(), cvs);
        let roots: Vec<DVec3> = self.hairs.roots().collect();
        blend_hairs(shapes, &HairBlend { weights: &self.weights, roots: &roots, poses: None }).points
    }
}

/// Transfers the guides' attributes to the hairs.
fn carry_over(
    cx: &Cx,
    hairs: &mut Component,
    guides: &Component,
    shapes: &ResampledGuides,
    now: &HairBlend,
) -> Result<()> {
    let own = |name: &str| [P.name, PREF.name, CURVE_ID.name].contains(&name);
    for (owner, name, column) in guides.columns().filter(|(_, name, _)| !own(name)) {
        let domain = match owner {
            Owner::Once => {
                hairs.set_column(owner, name.clone(), column.clone())?;
                continue;
            }
            Owner::Point => CurveDomain::Point,
            Owner::Element => CurveDomain::Curve,
        };
        if hairs.element_count() == 0 || !cx.wants_named(name) {
            continue;
        }
        let table = guides.table(owner);
        let mixed = if let Some(vectors) = table.get::<[f32; 3]>(name).filter(|_| [V.name, N.name].contains(&&**name)) {
            let mut vectors = now.vectors(shapes, vectors, domain);
            if **name == *N.name {
                vectors
                    .iter_mut()
                    .for_each(|normal| *normal = to_f64(*normal).try_normalize(0.0).map_or(*normal, to_f32));
            }
            Column::new(vectors)
        } else if let Some(turns) = table.get::<[f32; 4]>(name).filter(|_| **name == *ORIENT.name) {
            Column::new(now.orientations(shapes, turns, domain))
        } else if let Some(numbers) = table.get::<f32>(name) {
            let numbers: Vec<[f32; 1]> = numbers.iter().map(|number| [*number]).collect();
            Column::new(now.numbers(shapes, &numbers, domain).into_iter().map(|[number]| number).collect::<Vec<f32>>())
        } else if let Some(numbers) = table.get::<[f32; 3]>(name) {
            Column::new(now.numbers(shapes, numbers, domain))
        } else if let Some(numbers) = table.get::<[f32; 4]>(name) {
            Column::new(now.numbers(shapes, numbers, domain))
        } else {
            column.gather(&now.heaviest(shapes, domain))
        };
        hairs.set_column(owner, name.clone(), mixed)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
