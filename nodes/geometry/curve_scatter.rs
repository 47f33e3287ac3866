//! Curve_Scatter: straight blades of grass or hair, spread evenly over a skin.
//!
//! Roots are chosen on the skin at the scene's first frame ([`curves::scatter`]) and stay on their faces while it
//! moves, so blades neither pop nor slide; `Pref` and the mask are taken from that frame too. Roots are a prefix of one
//! infinite sequence: a higher density keeps every blade and adds others between them, and a lower mask keeps a shorter
//! prefix, so that it thins evenly. A blade's index in the sequence is its `curve_id`, from which its length and lean
//! are drawn (`id` is reserved for points). Curves are in the order of the skin's faces.
//!
//! Each frame of a moving skin costs as much as the first; Curve_Attach is cheaper for curves grown on a still skin.
//! Distances are Euclidean: nearby folds that face the same way share their density.

use curves::scatter::{Blade, grow, vertex_normals};
use curves::surface::SurfacePoint;
use engine::prelude::*;
use numerics::random::Key;
use numerics::vector::{DVec3, to_f64};

use crate::shared::planting::{self, Planting, at_roots, same_rows};

inputs! { INPUTS:
    SKIN: Input = Input::one("skin", Kind::Mesh, "The mesh that the curves grow on. It may move, but must keep its \
        faces.")
        .read_at(|_| Times::START.and(Times::NOW));
}

params! { PARAMS:
    DENSITY: Param<f32> = Param::float("density", 1000.0, "Number of curves per square metre, before the mask.")
        .unit(Unit::PerSquareMetre).at_least(0.0).soft(0.0, 100_000.0);
    LENGTH: Param<Span> = Param::span("length", [0.05, 0.1],
        "Length of the shortest and of the longest curve. Each curve's is drawn at random in between.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 1.0);
    CVS: Param<i64> = Param::int("cvs", 5,
        "Number of CVs of each curve, evenly spaced.").within(2.0, 10_000.0).soft(2.0, 32.0);
    LEAN: Param<f32> = Param::float("lean", 0.2,
        "Largest angle between a curve and the skin's normal, as a fraction of 90 degrees: at 0 all curves are \
         upright, at 1 some lie flat. Angle and direction are random for each curve.").at_least(0.0).soft(0.0, 1.0);
    WIDTH_PARAM: Param<f32> = Param::float("width", 0.0,
        "Width of every curve. 0 leaves curves without the attribute `width`.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
    SEED: Param<Seed> = Param::seed("Each seed gives other positions, lengths and directions.");
    MASK: Param<Name> = planting::MASK;
}

const CURVES: Output = Output::new(
    "curves",
    &[Kind::Curves],
    "The curves, root first, with `Pref`, `curve_id`, `width` if it is set and, if the skin has it, the `uvw` of the root.",
);

metrics! { METRICS:
    GROWN = Metric::new("curves", Unit::None, "Number of curves grown.");
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Scatter",
    2,
    "Grows straight curves on a mesh, evenly distributed without rows or clumps. They stay on their faces while the \
     skin moves. A higher density adds curves between the existing ones.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[Accuracy::larger("cvs", Trials::These(&["3", "5", "9", "17", "33"]))])
.outputs(&[&CURVES])
.reads(&[&P, &N, &UVW])
.writes(&[&P, &PREF, &UVW, &WIDTH, &CURVE_ID])
.attributes(|params| {
    let mask = Some(params.get(MASK)).filter(|mask| !mask.is_empty());
    [AttrNames::These(mask.into_iter().collect()), AttrNames::These(Vec::new())]
})
.metrics(METRICS)
.changes_topology();

/// Random numbers of each curve.
const LENGTH_DRAW: u64 = 0;
const LEAN_DRAW: u64 = 1;
const SIDE_DRAW: u64 = 2;

fn cook(cx: &Cx) -> Result<Outputs> {
    let skin = cx.part(SKIN);
    let rest = planting::kept_faces(cx.part_at_start(SKIN), skin)?;
    let cvs = cx.get(CVS) as usize;
    let planting =
        Planting { density: cx.get(DENSITY), mask: planting::mask(&cx.get(MASK), rest)?, cvs, seed: cx.get(SEED) };
    let roots = planting.roots(cx, rest)?;
    cx.check_cancelled()?;

    // The triangulation of the first frame: if it changed on a face that bends, roots would slide.
    let triangles = &rest.triangles().corners;
    let key = Key::new(u64::from(cx.get(SEED).0));
    let shapes: Vec<Blade> = roots.iter().map(|(index, root)| blade(cx, *root, key.of(*index as u64))).collect();
    let grown = |mesh: &Component| grow(mesh.positions(), triangles, &normals(mesh, triangles), &shapes, cvs);
    let mut curves = Component::curves(vec![cvs as u32; shapes.len()], grown(skin))?;
    curves.set(CURVE_ID, roots.iter().map(|(index, _)| *index as i32).collect())?;
    if cx.wants(PREF) {
        let still = same_rows(skin, rest, P.name) && same_rows(skin, rest, N.name);
        let column = if still { curves.table(Owner::Point).column(P.name).cloned() } else { None };
        curves.set_column(Owner::Point, PREF.name, column.unwrap_or_else(|| Column::new(grown(rest))))?;
    }
    if let Some(uvw) = skin.get(UVW).filter(|_| cx.wants(UVW)) {
        curves.set(UVW, at_roots(uvw, triangles, shapes.iter().map(|blade| &blade.root), cvs))?;
    }
    let width = cx.get(WIDTH_PARAM);
    if width > 0.0 && cx.wants(WIDTH) {
        curves.set(WIDTH, vec![width; curves.point_count()])?;
    }
    cx.publish(GROWN, shapes.len() as f64);
    Ok(CURVES.with(Geometry::from(curves)))
}

fn blade(cx: &Cx, root: SurfacePoint, key: Key) -> Blade {
    use std::f32::consts::{FRAC_PI_2, TAU};
    let draw = |which: u64| key.of(which).f32();
    Blade {
        root,
        length: cx.get(LENGTH).at(draw(LENGTH_DRAW)),
        lean: cx.get(LEAN) * FRAC_PI_2 * draw(LEAN_DRAW),
        around: TAU * draw(SIDE_DRAW),
    }
}

/// The skin's own normals, or those computed from the faces around each point.
fn normals(skin: &Component, triangles: &[[u32; 3]]) -> Vec<DVec3> {
    match skin.get(N) {
        Some(normals) => normals.iter().map(|normal| to_f64(*normal)).collect(),
        None => vertex_normals(skin.positions(), triangles),
    }
}

#[cfg(test)]
mod tests;
