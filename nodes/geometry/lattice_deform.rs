//! Lattice_Deform: space is a block of jelly, and control points in it are pulled about.
//!
//! R2 shapes liquids with "lattice deformers", and a goal shape of a soft body (R1) has to have the faces of the body's
//! surface: a lattice moves points and nothing else. The map is Sederberg and Parry's ([`curves::lattice`]): Bernstein
//! polynomials over the whole box, or tents over its cells. Offsets, not places, are set and keyed, so what is not
//! mentioned is not moved.
//!
//! What the sources leave open:
//! * Outside the box there is no lattice. By default points there move as the nearest of the box does, so nothing tears and
//!   nothing runs away; or the box's edges go straight on.
//! * `v` goes along as a vector, `N` stays perpendicular and on the side that the faces' winding says, also where space is
//!   folded over; `orient` turns by the rotation nearest to how space around it is deformed. A vector of an element follows
//!   what becomes of space in the middle of its points. `width`, `thickness` and all else stay as they are.
//! * The motion of keyed offsets is not added to `v`. A volume's grid lies along the axes: it is refused.

use curves::lattice::{DeformationLattice, Deformed, Extrapolation, LatticeBasis};
use curves::lattice::{control_points, map_normals, map_orientations, map_vectors};
use engine::prelude::*;
use numerics::vector::DMat3;
use numerics::volume;
use std::sync::Arc;

choice! {
    /// How control points share in what is between them.
    pub enum Basis {
        Trilinear = "trilinear": "straight from one to the next: each cell is moved by its eight corners alone, and creases \
                show where cells meet",
        Bernstein = "bernstein": "smooth: each control point moves the whole box, most where it is",
    }
}

choice! {
    /// What becomes of what is outside the box.
    pub enum Outside {
        Hold = "hold": "it moves as the nearest point of the box does",
        Extend = "extend": "the edges of the box go straight on, so what is far away moves far",
    }
}

/// A quarter of a million control points; nobody pulls at more by hand.
const MOST_DIVISIONS: f64 = 64.0;

inputs! { INPUTS:
    GEOMETRY: Input = Input::any("geometry", "What is deformed: curves, meshes, points and tets.");
}

params! { PARAMS:
    DIVISIONS: Param<[i64; 3]> = Param::int3("divisions", [1; 3],
        "Cells along x, y and z. Control points are one more each way.").within(1.0, MOST_DIVISIONS).soft(1.0, 8.0).fixed();
    FROM: Param<[f64; 3]> = Param::dvec3("from", [-0.5; 3],
        "The lower corner of the box.").unit(Unit::Metres).when(bends);
    TO: Param<[f64; 3]> = Param::dvec3("to", [0.5; 3],
        "The upper corner of the box.").unit(Unit::Metres).when(bends);
    OFFSETS: Param<Arc<Vec<[f32; 3]>>> = Param::vec3s("offsets",
        "How far each control point is pulled, in metres: first all along x at the lowest y and z, then the next y, then \
         the next z. None pulls at nothing. Keys run straight from list to list.");
    BASIS: Param<Basis> = Param::choice("basis", Basis::Bernstein,
        "How control points share in what is between them. With one division both are the same.").when(bends);
    OUTSIDE: Param<Outside> = Param::choice("outside", Outside::Hold, "What becomes of what is outside the box.")
        .when(bends);
}

const DEFORMED: Output = Output::like("geometry", &GEOMETRY, "The same, deformed.");

const FOLDED: Metric =
    Metric::new("folded", Unit::None, "Points where the lattice presses space flat or turns it inside out.");
const MIN_JACOBIAN: Metric = Metric::new(
    "min_jacobian",
    Unit::None,
    "The share of its volume that space keeps where a point is squeezed most; below 0 it is inside out.",
);
const VOLUME_RATIO: Metric = Metric::new(
    "volume_ratio",
    Unit::None,
    "Volume of the tets, without them of what a closed mesh encloses, as a share of what it was.",
);

/// See the module.
pub static NODE: Node = Node::new(
    "Lattice_Deform",
    1,
    "Bends, bulges, squeezes and twists geometry of any kind by a box of control points around it. Points move with the \
     control points near them; velocities, normals and orientations turn along; what joins the points stays as it is, so a \
     deformed surface can be the goal of a soft body.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&DEFORMED])
.writes(&[&P])
.attributes(|_| {
    // Only what is there is changed, so whoever needs it after this needs it before.
    [(); 2].map(|()| AttrNames::These(FOLLOWING.map(Name::from).to_vec()))
})
.metrics(&[&FOLDED, &MIN_JACOBIAN, &VOLUME_RATIO])
.checks(|params| lattice(params, &params.get(OFFSETS)).map(|_| ()))
.leaves_out(leaves_out);

/// Attributes that turn along.
const FOLLOWING: [&str; 3] = [V.name, N.name, ORIENT.name];

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut geometry = cx.input(GEOMETRY).clone();
    let offsets = cx.get(OFFSETS);
    let Some(lattice) = lattice(cx.params(), &offsets)? else {
        publish(cx, [], Some(1.0));
        return Ok(DEFORMED.with(geometry));
    };
    if geometry.volume().is_some() {
        return Err(Error::refused("a volume cannot be bent: its grid lies along the axes")
            .hint("deform what it is made from, or its surface"));
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

/// Whether any control point is pulled.
fn bends(params: &Params) -> bool {
    params.get(OFFSETS).as_flattened().iter().any(|x| *x != 0.0)
}

/// The lattice that the params say; none where it moves nothing.
///
/// # Errors
/// Where there are offsets, and not one a control point, or the box is empty.
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
    let basis = match params.get(BASIS) {
        Basis::Trilinear => LatticeBasis::Trilinear,
        Basis::Bernstein => LatticeBasis::Bernstein,
    };
    let outside = match params.get(OUTSIDE) {
        Outside::Hold => Extrapolation::Hold,
        Outside::Extend => Extrapolation::Extend,
    };
    DeformationLattice::new([from, to], divisions, offsets, basis, outside).map(Some).ok_or_else(|| {
        Error::refused(format!("`from` is {from:?} and `to` {to:?}, which is no box"))
            .of(TO.name())
            .hint("expected each number of `to` to be more than that of `from`; around what is flat, too")
    })
}

/// A component, deformed, and what that came to; columns that stay are shared.
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

/// Turns vectors, normals and orientations of points or elements.
fn turn(part: &mut Component, owner: Owner, jacobians: &[DMat3]) {
    let (v, n, orient) = match owner {
        Owner::Element => (Attr::element(V.name), Attr::element(N.name), Attr::element(ORIENT.name)),
        _ => (V, N, ORIENT),
    };
    // Asked first: what is edited is copied.
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

/// Volume of a geometry's tets, else of what its mesh encloses; kept with what was measured.
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

/// The volume after, as a share of that before; none where that was none.
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

fn leaves_out(params: &Params, _: &Wires) -> Vec<LeftOut> {
    match bends(params) {
        true => Vec::new(),
        false => vec![LeftOut::new("deformation", "`offsets` pull at nothing")],
    }
}

#[cfg(test)]
mod tests;
