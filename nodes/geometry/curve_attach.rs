//! Curve_Attach: curves follow the skin that they grew on.
//!
//! Each root is bound to its closest point on `rest_skin`, at its distance from it, and carried to `skin`
//! ([`curves::attach`]): the whole curve moves with that point and rotates about it by the rotation closest to the
//! local deformation of the skin. Curves therefore keep their lengths, and neighbours on either side of an edge rotate
//! alike, however the skin stretches. `v`, `N` and `orient` rotate too. If the curves have no `Pref`, it is set to
//! their incoming positions, so that anything sampled at rest sticks to them.
//!
//! Where the skin around a root is degenerate (collapsed to a point or a line), its curve moves without rotating, and
//! is counted; if a single face collapses, its neighbours carry its curves. A face turned inside out turns its curves
//! inwards. The motion of the skin is not added to `v`. The binding is cached as long as the roots and `rest_skin` do
//! not change, even if the rest of the curves moves.

use curves::attach::{RootPose, RootPositions, SkinBinding, attach_curves, rotate_orientations, rotate_vectors};
use engine::prelude::*;

use crate::shared::faces::{counted, inside_out, same_faces};

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves as they stand on `rest_skin`, root first.");
    REST_SKIN: Input = Input::one("rest_skin", Kind::Mesh, "The mesh on which the curves were grown.");
    SKIN: Input = Input::one("skin", Kind::Mesh, "The same mesh in its current pose: the same faces, other positions.");
}

const OUT: Output = Output::like("curves", &CURVES, "The curves, carried to `skin`. Lengths are kept.");

metrics! { METRICS:
    BOUND = Metric::new("bound", Unit::Metres, "The largest distance of a root from `rest_skin`. A large \
        distance suggests that the curves were grown on another mesh.");
    FAR_ROOTS = Metric::new("far_roots", Unit::None,
        "Curves whose roots are farther from `rest_skin` than the curves are long.")
        .warn_above(0.0, "These roots are farther from `rest_skin` than their curves are long, so the curves probably \
            grew on another mesh, or on this one at another scale. Compare the `scale` of both files, and wire the \
            mesh in the pose in which the curves were grown.");
    UNTURNED = Metric::new("unturned", Unit::None,
        "Curves that move without rotating, because the skin around their roots has collapsed to a line or a point.")
        .warn_above(0.0, "The skin around these roots has collapsed to a line or a point, so that it gives no \
            direction; the curves keep that of their rest shape.");
    LENGTH_ERROR = Metric::length_error();
}

pub(crate) static NODE: Node = Node::new(
    "Curve_Attach",
    2,
    "Carries curves along with the skin that they grew on. Roots stay at their positions on its faces; each curve \
     rotates with the skin around its root and keeps its shape and length. A root that does not lie on the skin keeps \
     its distance from it.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.outputs(&[&OUT])
.reads(&[&P, &PREF])
.writes(&[&P, &PREF])
.attributes(|_| {
    // Only existing attributes are rotated, so they are read as well.
    [(); 2].map(|()| AttrNames::These([V.name, N.name, ORIENT.name].map(Name::from).to_vec()))
})
.metrics(METRICS);

fn cook(cx: &Cx) -> Result<Outputs> {
    let (curves, rest, skin) = (cx.part(CURVES), cx.part(REST_SKIN), cx.part(SKIN));
    if !same_faces(rest, skin) {
        if inside_out(rest, skin) {
            let fact = "`skin` is `rest_skin` mirrored, with its faces inside out";
            return Err(Error::refused(fact).hint("mirror the output of this node instead of `skin`"));
        }
        let [skin, rest] = [skin, rest].map(counted);
        let fact = format!("`skin` has {skin}, `rest_skin` {rest}, or their topology differs");
        return Err(Error::refused(fact).hint("give two poses of one mesh"));
    }
    let roots = RootPositions::of(curves.runs().starts(), curves.positions());
    let bind = || Ok(SkinBinding::to_closest(rest.positions(), &rest.triangles().corners, roots.as_slice()));
    let binding = rest.kept(roots.clone(), bind)?;
    let Some(binding) = &*binding else {
        let fact = format!("`rest_skin` has no face to attach {} curves to", curves.element_count());
        return Err(Error::refused(fact).hint("wire the mesh that the curves grew on"));
    };
    cx.check_cancelled()?;

    let mut out = cx.edit(CURVES);
    if cx.wants(PREF) && curves.get(PREF).is_none() {
        let rest = curves.table(Owner::Point).column(P.name).cloned().expect("every component has `P`");
        out.set_column(Owner::Point, PREF.name, rest)?;
    }
    cx.publish(BOUND, binding.max_distance());
    cx.publish(FAR_ROOTS, binding.far_roots(curves.runs().starts(), curves.positions()) as f64);
    if rest.positions() == skin.positions() {
        cx.publish(UNTURNED, 0.0);
        cx.publish(LENGTH_ERROR, 0.0);
    } else {
        let poses = binding.poses(skin.positions());
        let attached = attach_curves(curves.runs().starts(), curves.positions(), &poses);
        cx.publish(UNTURNED, poses.iter().filter(|pose| pose.lost).count() as f64);
        cx.publish(LENGTH_ERROR, attached.length_error);
        out.set(P, attached.points)?;
        rotate_attributes(&mut out, &poses);
    }
    Ok(OUT.with(out))
}

/// Rotates vectors and orientations, of CVs and of curves.
fn rotate_attributes(curves: &mut Component, poses: &[RootPose]) {
    let by_cv = curves.runs().starts().to_vec();
    let by_curve: Vec<u32> = (0..by_cv.len() as u32).collect();
    for name in [V.name, N.name] {
        if let Some(rows) = curves.edit(Attr::point(name)) {
            rotate_vectors(&by_cv, rows, poses);
        }
        if let Some(rows) = curves.edit(Attr::element(name)) {
            rotate_vectors(&by_curve, rows, poses);
        }
    }
    if let Some(rows) = curves.edit(ORIENT) {
        rotate_orientations(&by_cv, rows, poses);
    }
    if let Some(rows) = curves.edit(Attr::element(ORIENT.name)) {
        rotate_orientations(&by_curve, rows, poses);
    }
}

#[cfg(test)]
mod tests;
