//! Curve_Attach: curves follow the skin that they grew on.
//!
//! Each root is bound to its nearest point of `rest_skin` and to its distance from it, and from there carried to `skin`
//! ([`curves::attach`]): the whole curve turns about it by the rotation nearest to how the skin around it has
//! deformed, and moves with it. So curves stay as long as they are and neighbours turn alike on either side of an edge,
//! however the skin stretches. What Transform turns is turned: `v`, `N`, `orient`. `Pref`, where the curves have none,
//! becomes what they were before, so that what is sampled at rest sticks to them.
//!
//! Where the skin around a root has no direction left (scaled to nothing, or to a line), its curve moves and does not
//! turn, and is counted; a single face that is lost leaves its curves to its neighbours. A face turned inside out turns
//! its curves inwards. The motion of the skin is not added to `v`. The binding is kept as long as the roots and `rest_skin`
//! stand still, so curves that already move at rest cost no more.

use curves::attach::{Binding, Pose, carry_curves, turn_orientations, turn_vectors};
use engine::prelude::*;

use crate::shared::faces::{counted, same_faces};
use crate::shared::kept::Roots;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves as they grew on `rest_skin`, root first.");
    REST_SKIN: Input = Input::one("rest_skin", Kind::Mesh, "The mesh as it was when the curves grew on it.");
    SKIN: Input = Input::one("skin", Kind::Mesh, "The same mesh as it is now: other places, the same faces.");
}

const OUT: Output = Output::like("curves", &CURVES, "The curves on `skin`. Lengths are kept.");

const BOUND: Metric = Metric::new("bound", Unit::Metres, "How far from `rest_skin` the farthest root is.");
const UNTURNED: Metric =
    Metric::new("unturned", Unit::None, "Curves that only move, as the skin around them has lost its directions.");
const LENGTH_ERROR: Metric =
    Metric::new("length_error", Unit::None, "The largest change of a length, as a share of the curve's length.");

/// See the module.
pub static NODE: Node = Node::new(
    "Curve_Attach",
    1,
    "Carries curves along with the skin that they grew on. Roots stay where they are on its faces; each curve turns as \
     the skin around its root does and keeps its shape and length. A root away from the skin keeps its distance.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.outputs(&[&OUT])
.reads(&[&P, &PREF])
.writes(&[&P, &PREF])
.attributes(|_| {
    // Only what is there is turned, so whoever needs it after this needs it before.
    [(); 2].map(|()| AttrNames::These([V.name, N.name, ORIENT.name].map(Name::from).to_vec()))
})
.metrics(&[&BOUND, &UNTURNED, &LENGTH_ERROR]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let (curves, rest, skin) = (cx.part(CURVES), cx.part(REST_SKIN), cx.part(SKIN));
    if !same_faces(rest, skin) {
        let [skin, rest] = [skin, rest].map(counted);
        let fact = format!("`skin` has {skin}, `rest_skin` {rest}, or they are joined otherwise");
        return Err(Error::refused(fact).hint(
            "they are poses of one mesh; a mirroring Transform turns faces round, so mirror what comes out instead",
        ));
    }
    let roots = Roots::of(curves);
    let binding = rest.kept(roots.clone(), || bind(&roots.0, rest))?;
    cx.check_cancelled()?;

    let mut out = curves.clone();
    if cx.wants(PREF) && curves.get(PREF).is_none() {
        let rest = curves.table(Owner::Point).column(P.name).cloned().expect("every component has `P`");
        out.set_column(Owner::Point, PREF.name, rest)?;
    }
    cx.publish(BOUND, binding.farthest());
    if rest.positions() == skin.positions() {
        cx.publish(UNTURNED, 0.0);
        cx.publish(LENGTH_ERROR, 0.0);
    } else {
        let poses = binding.carry(skin.positions());
        let carried = carry_curves(curves.runs().starts(), curves.positions(), &poses);
        cx.publish(UNTURNED, poses.iter().filter(|pose| pose.lost).count() as f64);
        cx.publish(LENGTH_ERROR, carried.length_error);
        out.set(P, carried.points)?;
        turn_attributes(&mut out, &poses);
    }
    let mut geometry = cx.input(CURVES).clone();
    geometry.put(out);
    Ok(OUT.with(geometry))
}

/// Binds the roots.
///
/// # Errors
/// Where there are roots and nothing to bind them to.
fn bind(roots: &[[f32; 3]], rest: &Component) -> Result<Binding> {
    Binding::nearest(rest.positions(), &rest.triangles().corners, roots).ok_or_else(|| {
        let fact = format!("`rest_skin` has no face for {} curves to hold on to", roots.len());
        Error::refused(fact).hint("connect the mesh that the curves grew on")
    })
}

/// Turns vectors and orientations, a row a CV or a row a curve.
fn turn_attributes(curves: &mut Component, poses: &[Pose]) {
    let by_cv = curves.runs().starts().to_vec();
    let by_curve: Vec<u32> = (0..by_cv.len() as u32).collect();
    for name in [V.name, N.name] {
        if let Some(rows) = curves.edit(Attr::point(name)) {
            turn_vectors(&by_cv, rows, poses);
        }
        if let Some(rows) = curves.edit(Attr::element(name)) {
            turn_vectors(&by_curve, rows, poses);
        }
    }
    if let Some(rows) = curves.edit(ORIENT) {
        turn_orientations(&by_cv, rows, poses);
    }
    if let Some(rows) = curves.edit(Attr::element(ORIENT.name)) {
        turn_orientations(&by_curve, rows, poses);
    }
}

#[cfg(test)]
mod tests;
