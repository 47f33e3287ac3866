//! Curve_Scatter: straight blades of grass or hair, spread evenly over a skin.
//!
//! Roots are chosen on the skin as it is at the scene's first frame ([`numerics::scatter`]) and stay on their faces
//! while it moves, so blades neither pop nor slide; there, too, `Pref` is taken and the mask read. The places are the
//! first of one endless list: a higher density keeps every blade and adds some between, and a mask keeps fewer of the
//! first where it is lower, so that it thins evenly. A blade's place in the list is its `curve_id`, which its length and
//! lean are drawn by (`id` is left for points). Curves stand in the order of the skin's faces.
//!
//! Each frame of a moving skin costs as much as the first; Curve_Attach moves curves that were grown on a still one.
//! Faces with more than three corners are cut into triangles from their first corner; a hollow one may so get roots
//! beside it. Distances are straight through space: nearby folds that face the same way share their room.

use engine::prelude::*;
use numerics::random::Key;
use numerics::scatter::{Blade, Spot, Surface, grow, vertex_normals};

inputs! { INPUTS:
    SKIN: Input = Input::one("skin", Kind::Mesh, "The mesh that the curves grow on. It may move; its faces must stay.")
        .read_at(|_| Times::START.and(Times::NOW));
}

params! { PARAMS:
    DENSITY: Param<f32> = Param::float("density", 1000.0, "Curves on a square metre, before the mask.")
        .unit(Unit::PerSquareMetre).at_least(0.0).soft(0.0, 100_000.0);
    LENGTH: Param<Span> = Param::span("length", [0.05, 0.1], "Shortest and longest curve, root to tip.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 1.0);
    CVS: Param<i64> = Param::int("cvs", 5, "CVs of each curve, evenly apart.").within(2.0, 10_000.0).soft(2.0, 32.0);
    LEAN: Param<f32> = Param::float("lean", 0.2,
        "How far a curve may lean away from the skin's normal, as a share of a right angle: 0 all stand up, 1 some lie \
         flat. Each leans by its own share, to its own side.").at_least(0.0).soft(0.0, 1.0);
    SEED: Param<Seed> = Param::seed("Other numbers give other places, lengths and sides.");
    MASK: Param<Name> = Param::text("mask", "",
        "A point attribute of the skin that multiplies the density. Empty, there is none.").fixed();
}

const CURVES: Output = Output::new(
    "curves",
    &[Kind::Curves],
    "The curves, root first, with `Pref`, `curve_id` and, where the skin has it, the `uvw` of the root.",
);

const GROWN: Metric = Metric::new("curves", Unit::None, "Curves that grew.");

/// See the module.
pub static NODE: Node = Node::new(
    "Curve_Scatter",
    1,
    "Grows straight curves on a mesh, evenly spread, neither in rows nor in clumps. They stay on their faces while the \
     skin moves. A higher density adds curves between those that were there.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&CURVES])
.reads(&[&P, &N, &UVW])
.writes(&[&P, &PREF, &UVW, &CURVE_ID])
.attributes(|params| {
    let mask = Some(params.get(MASK)).filter(|mask| !mask.is_empty());
    [AttrNames::These(mask.into_iter().collect()), AttrNames::These(Vec::new())]
})
.metrics(&[&GROWN])
.changes_topology();

/// At most this many CVs: with `Pref` and `uvw`, 2.4 gigabytes.
const MOST_CVS: f64 = (1_u32 << 26) as f64;

/// What is drawn for each curve.
const LENGTH_DRAW: u64 = 0;
const LEAN_DRAW: u64 = 1;
const SIDE_DRAW: u64 = 2;

fn cook(cx: &Cx) -> Result<Outputs> {
    let skin = cx.part(SKIN);
    let rest = cx.at_start(SKIN).mesh().expect("the engine refuses a wire that lacks what its input needs");
    let triangles = triangles(rest, skin)?;
    let blades = blades(cx, rest, &triangles)?;
    cx.check_cancelled()?;

    let cvs = cx.get(CVS) as usize;
    let shapes: Vec<Blade> = blades.iter().map(|(_, blade)| *blade).collect();
    let grown = |mesh: &Component| grow(mesh.positions(), &triangles, &normals(mesh, &triangles), &shapes, cvs);
    let mut curves = Component::curves(vec![cvs as u32; shapes.len()], grown(skin))?;
    curves.set(CURVE_ID, blades.iter().map(|(id, _)| *id as i32).collect())?;
    if cx.wants(PREF) {
        let still = same_rows(skin, rest, P.name) && same_rows(skin, rest, N.name);
        let column = if still { curves.table(Owner::Point).column(P.name).cloned() } else { None };
        curves.set_column(Owner::Point, PREF.name, column.unwrap_or_else(|| Column::new(grown(rest))))?;
    }
    if let Some(uvw) = skin.get(UVW).filter(|_| cx.wants(UVW)) {
        curves.set(UVW, at_roots(uvw, &triangles, &shapes, cvs))?;
    }
    cx.publish(GROWN, shapes.len() as f64);
    Ok(CURVES.with(Geometry::from(curves)))
}

/// The skin's faces as triangles, fanned.
///
/// # Errors
/// Where they are not those of the first frame.
fn triangles(rest: &Component, skin: &Component) -> Result<Vec<[u32; 3]>> {
    if !rest.topology().same(skin.topology()) && rest.topology() != skin.topology()
        || rest.point_count() != skin.point_count()
    {
        let fact = format!(
            "`skin` has {} faces and {} points, at the scene's first frame {} and {}, or they are joined otherwise",
            skin.element_count(),
            skin.point_count(),
            rest.element_count(),
            rest.point_count()
        );
        return Err(Error::refused(fact).hint("curves grow on a skin that moves but keeps its faces"));
    }
    let faces = rest.faces().map(|faces| faces.iter()).into_iter().flatten();
    Ok(faces.flat_map(|face| (2..face.len()).map(|k| [face[0], face[k - 1], face[k]])).collect())
}

/// The curves to grow, each with its place in the endless list, by face.
fn blades(cx: &Cx, rest: &Component, triangles: &[[u32; 3]]) -> Result<Vec<(usize, Blade)>> {
    let mask = mask(cx, rest)?;
    let share = |corner: u32| mask.map_or(1.0, |mask| f64::from(mask[corner as usize]).max(0.0));
    // Only where something may grow, so that a bare plain around a meadow costs nothing.
    let fertile: Vec<u32> = (0..triangles.len() as u32)
        .filter(|triangle| triangles[*triangle as usize].iter().any(|corner| share(*corner) > 0.0))
        .collect();
    let ground: Vec<[u32; 3]> = fertile.iter().map(|triangle| triangles[*triangle as usize]).collect();
    let surface = Surface::new(rest.positions(), &ground);
    let area = surface.area();
    let most_share = ground.as_flattened().iter().map(|corner| share(*corner)).fold(0.0, f64::max);

    let unmasked = f64::from(cx.get(DENSITY)) * area;
    let places = (unmasked * most_share).round();
    let cvs = cx.get(CVS) as f64;
    if places * cvs > MOST_CVS {
        let fact = format!("{places} curves of {cvs} CVs would grow on {area} m², more than {MOST_CVS} CVs");
        return Err(Error::refused(fact).hint("lower `density` or `cvs`, or scale the skin to metres"));
    }
    let key = Key::new(u64::from(cx.get(SEED).0));
    let spots = surface.spread(places as usize, key);
    cx.check_cancelled()?;

    let grows = |place: usize, spot: &Spot| {
        let [share] = spot.mix(ground[spot.triangle as usize].map(|corner| [share(corner)]));
        place as f64 + 0.5 < unmasked * share
    };
    let mut blades: Vec<(usize, Blade)> = spots
        .into_iter()
        .enumerate()
        .filter(|(place, spot)| mask.is_none() || grows(*place, spot))
        .map(|(place, spot)| {
            let root = Spot { triangle: fertile[spot.triangle as usize], ..spot };
            (place, blade(cx, root, key.of(place as u64)))
        })
        .collect();
    blades.sort_unstable_by_key(|(place, blade)| (blade.root.triangle, *place));
    Ok(blades)
}

fn blade(cx: &Cx, root: Spot, key: Key) -> Blade {
    use std::f32::consts::{FRAC_PI_2, TAU};
    let draw = |which: u64| key.of(which).f32();
    Blade {
        root,
        length: cx.get(LENGTH).at(draw(LENGTH_DRAW)),
        lean: cx.get(LEAN) * FRAC_PI_2 * draw(LEAN_DRAW),
        around: TAU * draw(SIDE_DRAW),
    }
}

/// The skin's mask, where one is named.
///
/// # Errors
/// Where the skin has no such number a point.
fn mask<'c>(cx: &Cx, rest: &'c Component) -> Result<Option<&'c [f32]>> {
    let name = cx.get(MASK);
    if name.is_empty() {
        return Ok(None);
    }
    if let Some(mask) = rest.table(Owner::Point).get(&name) {
        return Ok(Some(mask));
    }
    let what = rest.describe(&name).map_or("which `skin` does not have".into(), |found| format!("which is {found}"));
    Err(Error::refused(format!("`mask` is `{name}`, {what}")).hint("expected one float for each vertex"))
}

/// The skin's own normals, or else those of its faces around each point.
fn normals(skin: &Component, triangles: &[[u32; 3]]) -> Vec<[f64; 3]> {
    match skin.get(N) {
        Some(normals) => normals.iter().map(|normal| normal.map(f64::from)).collect(),
        None => vertex_normals(skin.positions(), triangles),
    }
}

/// Whether both have the very same rows, or neither has any.
fn same_rows(a: &Component, b: &Component, name: &str) -> bool {
    match (a.table(Owner::Point).column(name), b.table(Owner::Point).column(name)) {
        (Some(a), Some(b)) => a.same(b),
        (None, None) => true,
        _ => false,
    }
}

/// What the skin's `rows` are at each root, for all CVs of its curve.
fn at_roots(rows: &[[f32; 3]], triangles: &[[u32; 3]], blades: &[Blade], cvs: usize) -> Vec<[f32; 3]> {
    let at = |blade: &Blade| {
        let corners = triangles[blade.root.triangle as usize].map(|corner| rows[corner as usize].map(f64::from));
        blade.root.mix(corners).map(|x| x as f32)
    };
    blades.iter().flat_map(|blade| std::iter::repeat_n(at(blade), cvs)).collect()
}

#[cfg(test)]
mod tests;
