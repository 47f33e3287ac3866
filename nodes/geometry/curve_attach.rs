//! Curve_Attach: curves follow the skin that they grew on.
//!
//! Each root is bound to its closest point on `rest_skin`, at its distance from it, and carried to `skin`
//! ([`curves::attach`]): the whole curve moves with that point and rotates about it by the rotation closest to the
//! local deformation of the skin. So curves keep their lengths, and neighbours on either side of an edge rotate alike,
//! however the skin stretches. `v`, `N` and `orient` rotate too. If the curves have no `Pref`, it is set to their
//! positions before, so that anything sampled at rest sticks to them.
//!
//! Where the skin around a root is degenerate (collapsed to a point or a line), its curve moves without rotating, and
//! is counted; if a single face collapses, its neighbours carry its curves. A face turned inside out turns its curves
//! inwards. The motion of the skin is not added to `v`. The binding is cached as long as the roots and `rest_skin` do
//! not change, also for curves that move otherwise.

use curves::attach::{Binding, Pose, carry_curves, turn_orientations, turn_vectors};
use engine::prelude::*;

use crate::shared::faces::{counted, same_faces};
use crate::shared::kept::Roots;

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves as they grew on `rest_skin`, root first.");
    REST_SKIN: Input = Input::one("rest_skin", Kind::Mesh, "The mesh on which the curves were grown.");
    SKIN: Input = Input::one("skin", Kind::Mesh, "The same mesh in its current pose: the same faces, other positions.");
}

const OUT: Output = Output::like("curves", &CURVES, "The curves, carried to `skin`. Lengths are kept.");

metrics! { METRICS:
    BOUND = Metric::new("bound", Unit::Metres, "The largest distance of a root from `rest_skin`.");
    UNTURNED = Metric::new("unturned", Unit::None,
        "Curves that move without rotating, as the skin around them is degenerate.");
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Attach",
    1,
    "Carries curves along with the skin that they grew on. Roots stay at their positions on its faces; each curve \
     rotates with the skin around its root and keeps its shape and length. A root off the skin keeps its distance.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.outputs(&[&OUT])
.reads(&[&P, &PREF])
.writes(&[&P, &PREF])
.attributes(|_| {
    // Existing attributes alone are rotated, so they are read as well.
    [(); 2].map(|()| AttrNames::These([V.name, N.name, ORIENT.name].map(Name::from).to_vec()))
})
.metrics(METRICS);

fn cook(cx: &Cx) -> Result<Outputs> {
    let (curves, rest, skin) = (cx.part(CURVES), cx.part(REST_SKIN), cx.part(SKIN));
    if !same_faces(rest, skin) {
        let [skin, rest] = [skin, rest].map(counted);
        let fact = format!("`skin` has {skin}, `rest_skin` {rest}, or their topology differs");
        return Err(Error::refused(fact).hint(
            "give two poses of one mesh; a mirroring Transform reverses faces, so mirror the output of this node \
             instead",
        ));
    }
    let roots = Roots::of(curves);
    let binding = rest.kept(roots.clone(), || bind(&roots.0, rest))?;
    cx.check_cancelled()?;

    let mut out = cx.edit(CURVES);
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
    Ok(OUT.with(out))
}

/// Binds the roots.
///
/// # Errors
/// Where there are roots and nothing to bind them to.
fn bind(roots: &[[f32; 3]], rest: &Component) -> Result<Binding> {
    Binding::nearest(rest.positions(), &rest.triangles().corners, roots).ok_or_else(|| {
        let fact = format!("`rest_skin` has no face to attach {} curves to", roots.len());
        Error::refused(fact).hint("wire the mesh that the curves grew on")
    })
}

/// Rotates vectors and orientations, of CVs and of curves.
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
