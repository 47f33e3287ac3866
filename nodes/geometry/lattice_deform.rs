//! Lattice_Deform: free-form deformation with a box of control points.
//!
//! R2 shapes liquids with "lattice deformers". The goal shape of a soft body (R1) must have the faces of the body's
//! surface, which a lattice preserves, since it only moves points. The map is Sederberg and Parry's
//! ([`curves::lattice`]): Bernstein polynomials over the whole box, or trilinear interpolation in its cells. Offsets,
//! not positions, are set and keyed, so the default moves nothing.
//!
//! What the sources leave open:
//! * Outside the box the map is not defined. By default points there move like the closest point of the box, so nothing
//!   tears and nothing diverges; or the deformation is extrapolated linearly.
//! * `v` is mapped as a vector; `N` stays perpendicular and on the side given by the faces' winding, even where the
//!   lattice folds space over; `orient` rotates by the rotation closest to the local deformation. Vectors of an element
//!   follow the deformation at the mean of its points. `width`, `thickness` and all other attributes pass through.
//! * The motion of keyed offsets is not added to `v`. A volume's grid is aligned with the axes: it is refused.

use curves::lattice::{DeformationLattice, Deformed, Extrapolation, LatticeBasis};
use curves::lattice::{control_points, map_normals, map_orientations, map_vectors};
use engine::prelude::*;
use numerics::vector::DMat3;
use numerics::volume;
use std::sync::Arc;

choice! {
    /// Interpolation between control points.
    BasisChoice for LatticeBasis {
        LatticeBasis::Trilinear => "trilinear": "linear: each cell is moved by its eight corners only, and creases \
            show where cells meet",
        LatticeBasis::Bernstein => "bernstein": "smooth: each control point moves the whole box, most strongly near \
            itself",
    }
}

choice! {
    /// The deformation outside the box.
    OutsideChoice for Extrapolation {
        Extrapolation::Hold => "hold": "points move like the closest point of the box",
        Extrapolation::Extend => "extend": "the deformation is extrapolated linearly, so distant points move far",
    }
}

/// 64 cells along each axis are a quarter of a million control points: more than anyone sets by hand.
const MOST_DIVISIONS: f64 = 64.0;

inputs! { INPUTS:
    GEOMETRY: Input = Input::any("geometry", "The geometry to deform: curves, meshes, points and tets.");
}

params! { PARAMS:
    DIVISIONS: Param<[i64; 3]> = Param::int3("divisions", [1; 3],
        "Number of cells along x, y and z. Along each axis there is one control point more than there are cells.")
        .within(1.0, MOST_DIVISIONS).soft(1.0, 8.0).fixed();
    FROM: Param<[f64; 3]> = Param::dvec3("from", [-0.5; 3],
        "The lower corner of the box.").unit(Unit::Metres).when(bends);
    TO: Param<[f64; 3]> = Param::dvec3("to", [0.5; 3],
        "The upper corner of the box.").unit(Unit::Metres).when(bends);
    OFFSETS: Param<Arc<Vec<[f32; 3]>>> = Param::vec3s("offsets",
        "How far each control point is moved from its place in the box, in metres: a list of vectors, one per control \
         point, ordered so that x varies fastest, then y, then z. If empty, nothing moves. Keys are interpolated \
         linearly; their lists are equally long.");
    BASIS: Param<BasisChoice> = Param::choice("basis", LatticeBasis::Bernstein,
        "How the deformation is interpolated between control points. With one division along each axis both are the \
         same.").when(bends);
    OUTSIDE: Param<OutsideChoice> = Param::choice("outside", Extrapolation::Hold, "How points outside the box move.")
        .when(bends);
}

const DEFORMED: Output = Output::like("geometry", &GEOMETRY, "The deformed geometry.");

metrics! { METRICS:
    FOLDED = Metric::new("folded", Unit::None, "Points at which the lattice flattens the geometry or turns it inside \
        out. 0 is a sound deformation.")
        .warn_above(0.0, "The lattice turns the geometry inside out there. Move the offsets of neighbouring control \
            points closer together, or add `divisions`.");
    MIN_JACOBIAN = Metric::new("min_jacobian", Unit::None,
        "The smallest factor by which volume changes at any point: 1 keeps it, 0 flattens, below 0 the geometry is \
         inside out there.").neutral(1.0);
    VOLUME_RATIO = Metric::new("volume_ratio", Unit::None,
        "Volume of the tets, or that enclosed by a closed mesh, relative to that before the deformation.").neutral(1.0);
}

pub(crate) static NODE: Node = Node::new(
    "Lattice_Deform",
    1,
    "Bends, bulges, squeezes and twists geometry of any kind with a box of control points around it. Points move with \
     the control points near them; velocities, normals and orientations follow. Topology does not change, so a \
     deformed surface can be the goal of a soft body.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&DEFORMED])
.reads(&[&P])
.writes(&[&P])
.attributes(|_| {
    // Only existing attributes are changed, so they are read as well.
    [(); 2].map(|()| AttrNames::These(FOLLOWING.map(Name::from).to_vec()))
})
.metrics(METRICS)
.checks(|params| lattice(params, &params.get(OFFSETS)).map(|_| ()))
.neutral(|params, _| (!bends(params)).then_some("`offsets` move nothing"));

/// Attributes that follow the deformation.
const FOLLOWING: [&str; 3] = [V.name, N.name, ORIENT.name];

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut geometry = cx.input(GEOMETRY).clone();
    let offsets = cx.get(OFFSETS);
    let Some(lattice) = lattice(cx.params(), &offsets)? else { return Ok(DEFORMED.with(geometry)) };
    if geometry.volume().is_some() {
        return Err(Error::refused("a volume cannot be deformed: its grid is aligned with the axes")
            .hint("deform the geometry that it is made from, or its surface"));
    }
    let before = geometry.clone();
    let mut reached = Vec::new();
    for kind in Kind::ALL {
        if let Some(part) = geometry.part(kind) {
            cx.check_cancelled()?;
            let (part, moved) = deformed(part, &lattice)?;
            geometry.put(part);
            reached.push(moved);
        }
    }
    publish(cx, reached, volume_ratio(&before, &geometry));
    Ok(DEFORMED.with(geometry))
}

/// Whether any control point is moved.
fn bends(params: &Params) -> bool {
    params.get(OFFSETS).as_flattened().iter().any(|x| *x != 0.0)
}

/// The lattice given by the params; `None` if it moves nothing.
///
/// # Errors
/// If the number of offsets is not that of the control points, or the box is empty.
fn lattice<'a>(params: &Params, offsets: &'a [[f32; 3]]) -> Result<Option<DeformationLattice<'a>>> {
    let divisions = params.get(DIVISIONS).map(|cells| cells as usize);
    let expected = control_points(divisions).unwrap_or(usize::MAX);
    if !offsets.is_empty() && offsets.len() != expected {
        let [x, y, z] = divisions;
        let fact = format!("`offsets` has {} vectors for the control points of {x}×{y}×{z} divisions", offsets.len());
        return Err(Error::refused(fact).of(OFFSETS.name()).hint(format!(
            "expected {}×{}×{} = {expected}, or none",
            x + 1,
            y + 1,
            z + 1
        )));
    }
    if !bends(params) {
        return Ok(None);
    }
    let (from, to) = (params.get(FROM), params.get(TO));
    DeformationLattice::new([from, to], divisions, offsets, params.get(BASIS), params.get(OUTSIDE))
        .map(Some)
        .ok_or_else(|| {
            Error::refused(format!("`from` is {from:?} and `to` {to:?}, which is not a box"))
                .of(TO.name())
                .hint("expected each component of `to` to be greater than that of `from`, even around flat geometry")
        })
}

/// The deformed component, with the measures of its deformation; columns that do not change are shared.
fn deformed(part: &Component, lattice: &DeformationLattice) -> Result<(Component, Deformed)> {
    let mut out = part.clone();
    let has = |owner: Owner| FOLLOWING.iter().any(|name| part.table(owner).column(name).is_some());
    let mut moved = lattice.deform(part.positions(), has(Owner::Point));
    out.set(P, std::mem::take(&mut moved.points))?;
    turn(&mut out, Owner::Point, &moved.jacobians);
    if has(Owner::Element) {
        turn(&mut out, Owner::Element, &lattice.deform(&middles(part), true).jacobians);
    }
    Ok((out, moved))
}

/// Maps vectors, normals and orientations of points or elements.
fn turn(part: &mut Component, owner: Owner, jacobians: &[DMat3]) {
    let (v, n, orient) = match owner {
        Owner::Element => (Attr::element(V.name), Attr::element(N.name), Attr::element(ORIENT.name)),
        _ => (V, N, ORIENT),
    };
    // Checked first, as editing copies.
    let there = |part: &Component, name: &str| part.table(owner).column(name).is_some();
    if there(part, V.name)
        && let Some(rows) = part.edit(v)
    {
        map_vectors(rows, jacobians);
    }
    if there(part, N.name)
        && let Some(rows) = part.edit(n)
    {
        map_normals(rows, jacobians);
    }
    if there(part, ORIENT.name)
        && let Some(rows) = part.edit(orient)
    {
        map_orientations(rows, jacobians);
    }
}

/// The mean of the points of each curve, face or tet.
fn middles(part: &Component) -> Vec<[f32; 3]> {
    let mean = |points: &mut dyn ExactSizeIterator<Item = usize>| {
        let count = points.len() as f64;
        let mut sum = [0.0; 3];
        for point in points {
            (0..3).for_each(|k| sum[k] += f64::from(part.positions()[point][k]));
        }
        sum.map(|x| (x / count) as f32)
    };
    match part.topology() {
        Topology::Curves(runs) => runs.ranges().map(|mut cvs| mean(&mut cvs)).collect(),
        Topology::Mesh(faces) => {
            faces.iter().map(|face| mean(&mut face.iter().map(|corner| *corner as usize))).collect()
        }
        Topology::Tets(tets) => tets.iter().map(|tet| mean(&mut tet.iter().map(|corner| *corner as usize))).collect(),
        Topology::Points => Vec::new(),
    }
}

/// Volume of a geometry's tets, or that enclosed by its mesh; cached with the component.
#[derive(Clone, Copy)]
struct Enclosed(Option<f64>);

fn enclosed(geometry: &Geometry) -> Option<f64> {
    let part = geometry.tets().or(geometry.mesh())?;
    let measure = |part: &Component| {
        Enclosed(match part.faces() {
            Some(faces) => volume::enclosed(faces.runs.starts(), &faces.corners, part.positions()),
            None => Some(volume::of_tets(part.positions(), part.tet_corners())),
        })
    };
    part.derived(measure).0
}

/// The volume after relative to that before; `None` if there was none.
fn volume_ratio(before: &Geometry, after: &Geometry) -> Option<f64> {
    let before = enclosed(before).filter(|volume| *volume != 0.0)?;
    Some(enclosed(after)? / before)
}

fn publish(cx: &Cx, reached: impl IntoIterator<Item = Deformed>, volume_ratio: Option<f64>) {
    let (mut folded, mut least) = (0, f64::INFINITY);
    for moved in reached {
        folded += moved.folded;
        least = least.min(moved.min_determinant);
    }
    cx.publish(FOLDED, folded as f64);
    cx.publish(MIN_JACOBIAN, if least.is_finite() { least } else { 1.0 });
    if let Some(ratio) = volume_ratio.filter(|ratio| ratio.is_finite()) {
        cx.publish(VOLUME_RATIO, ratio);
    }
}

#[cfg(test)]
mod tests;
