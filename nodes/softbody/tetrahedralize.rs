//! Tetrahedralize: closed surfaces as bodies of tets.
//!
//! R1: "create a Delaunay tetrahedralization of our input surface and convert the internal nodes and edges into internal
//! particles and springs", for "an unbiased set of springs that cover the volume". The making is in [`bodies::tets`].
//!
//! What R leaves open:
//! * R's internal nodes come from nowhere in particular. Here they are a body-centred cubic lattice at the surface's mean
//!   edge length, each moved a little and all kept half an edge from the surface: of its points alone, a body's springs
//!   would all run from skin to skin.
//! * A closed shell within another is the wall of a cavity, and one within that a body again: the white of an egg ends
//!   where the yolk begins. Inside is what the surface winds around once.
//! * A surface's edge may be none of the tets'. No list of those is kept: the surface that rides along has the edges, and
//!   [`bodies::tets::missing_edges`] tells which the tets lack, so that they cannot fall out of step.
//! * Flat tets, whose volume says nothing, stay, as their edges are good springs, and are marked `sliver`.

use bodies::tets::{ClosedSurface, FillSettings, PolygonSurface, ShellSide, SurfaceFault, TetMesh};
use engine::prelude::*;

use crate::shared::attributes::{SLIVER, SURFACE_POINT};

choice! {
    /// What is done about a surface that is not in order.
    pub enum Repair {
        None = "none": "nothing: whatever is wrong is a fault that names the place",
        Safe = "safe": "what moves no point and opens nothing: points at one place are joined where the surface is open \
                or hangs together there, points without a face and faces without three points or on another's points \
                are dropped, and faces are turned to look away from the body. Holes, crossings and edges of three faces \
                are faults still",
    }
}

inputs! { INPUTS:
    SURFACE: Input = Input::one("surface", Kind::Mesh,
        "Closed surfaces, each a body; one within another walls off a cavity. Coarse faces make a coarse body.");
}

params! { PARAMS:
    SPACING: Param<f64> = Param::double("spacing", 0.0,
        "About how far apart points inside are. 0 takes the mean length of the surface's edges; half as much makes eight \
         times as many points.").unit(Unit::Metres).at_least(0.0).soft(0.0, 1.0).when(|params| params.get(INTERIOR));
    INTERIOR: Param<bool> = Param::bool("interior", true,
        "Whether there are points inside. Without, all tets run from skin to skin: few, long and thin.");
    REPAIR: Param<Repair> = Param::choice("repair", Repair::Safe, "What is done about a surface that is not in order.");
}

const TETS: Output = Output::new(
    "tets",
    &[Kind::Tets, Kind::Mesh],
    "The tets, and the repaired surface. The first points of the tets are the surface's, in its order.",
);

/// 0 inside, 1 on the outside of a body, 2 on the wall of a cavity.
const SIDE: Attr<i32> = Attr::point("side");
/// Which body a tet is part of, from 0 in the order of their first faces.
const BODY: Attr<i32> = Attr::element("body");

const COUNT: Metric = Metric::new("tets", Unit::None, "How many tets there are.");
const BODIES: Metric = Metric::new("bodies", Unit::None, "How many bodies they make.");
const MIN_DIHEDRAL: Metric =
    Metric::new("min_dihedral", Unit::Radians, "Smallest angle between two faces of a tet that is no sliver.");
const QUALITY_MEDIAN: Metric = Metric::new(
    "quality_median",
    Unit::None,
    "Median of the tets' quality: three times the radius of the inner sphere by that of the outer, 1 for a regular tet.",
);
const VOLUME_ERROR: Metric = Metric::new(
    "volume_error",
    Unit::None,
    "How much the volume of the tets differs from that of the surface, as a share of it.",
);
const MISSING_FACES: Metric = Metric::new(
    "missing_faces",
    Unit::None,
    "Faces of the surface that are no face of a tet: the tets there cut a corner or bulge.",
);
const MISSING_EDGES: Metric =
    Metric::new("missing_edges", Unit::None, "Edges of the surface that are no edge of a tet.");
const BARE_POINTS: Metric = Metric::new("bare_points", Unit::None, "Points of the surface that no tet has.");
const SLIVERS: Metric = Metric::new("slivers", Unit::None, "Tets too flat for their volume to mean anything.");
const REPAIRS: Metric =
    Metric::new("repairs", Unit::None, "Points joined or dropped, and faces dropped, trimmed or turned.");

/// See the module.
pub static NODE: Node = Node::new(
    "Tetrahedralize",
    1,
    "Fills closed surfaces with tets, so that they can be simulated as soft bodies. Points inside lie about as far \
     apart as those of the surface. On the tets' points: `surface_point`, the surface's point each one is (−1 inside), \
     and `side`, 1 on the outside of a body, 2 on the wall of a cavity, 0 inside. On the tets: `body`, numbered from 0, \
     and `sliver`, 1 where a tet is too flat for its volume to mean anything. The surface rides along.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&TETS])
.reads(&[&P])
.writes(&[&P, &SURFACE_POINT, &SIDE, &BODY, &SLIVER])
.metrics(&[
    &COUNT,
    &BODIES,
    &MIN_DIHEDRAL,
    &QUALITY_MEDIAN,
    &VOLUME_ERROR,
    &MISSING_FACES,
    &MISSING_EDGES,
    &BARE_POINTS,
    &SLIVERS,
    &REPAIRS,
])
.leaves_out(leaves_out)
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let mesh = cx.part(SURFACE);
    let faces = mesh.faces().expect("a mesh has faces");
    let surface = PolygonSurface { starts: faces.runs.starts(), corners: &faces.corners, points: mesh.positions() };
    let closed = ClosedSurface::of(&surface, cx.get(REPAIR) == Repair::Safe).map_err(refusal)?;
    cx.check_cancelled()?;
    let fill = FillSettings { spacing: cx.get(SPACING), interior: cx.get(INTERIOR) };
    let solid = closed.fill(&fill).map_err(refusal)?;
    publish(cx, &closed, &solid);
    let repaired = repaired(mesh, &closed)?;
    Ok(TETS.with(Geometry::from(tets(cx, &closed, solid)?).with(repaired)))
}

/// The bodies, with what the node writes on them.
fn tets(cx: &Cx, closed: &ClosedSurface, solid: TetMesh) -> Result<Component> {
    let mut tets = Component::tets(solid.tets, solid.points)?;
    if cx.wants(SURFACE_POINT) {
        let of_surface = closed.points.len() as i32;
        let points = 0..tets.point_count() as i32;
        tets.set(SURFACE_POINT, points.map(|point| if point < of_surface { point } else { -1 }).collect())?;
    }
    if cx.wants(SIDE) {
        let number = |side: &ShellSide| match side {
            ShellSide::Interior => 0,
            ShellSide::Outer => 1,
            ShellSide::Inner => 2,
        };
        tets.set(SIDE, solid.sides.iter().map(number).collect())?;
    }
    if cx.wants(BODY) {
        tets.set(BODY, solid.bodies.iter().map(|body| *body as i32).collect())?;
    }
    if cx.wants(SLIVER) {
        tets.set(SLIVER, solid.slivers.iter().map(|sliver| i32::from(*sliver)).collect())?;
    }
    Ok(tets)
}

/// The mesh with its repairs and all its attributes; the very one that came in where none was needed.
fn repaired(mesh: &Component, closed: &ClosedSurface) -> Result<Component> {
    if closed.changes.is_none() {
        return Ok(mesh.clone());
    }
    let counts = closed.starts.windows(2).map(|run| run[1] - run[0]).collect();
    let mut repaired = Component::mesh(counts, closed.corners.clone(), closed.points.clone())?;
    for (owner, name, column) in mesh.columns() {
        let rows = match owner {
            Owner::Point => &closed.source_points[..],
            Owner::Element => &closed.source_faces[..],
            Owner::Once => &[0],
        };
        repaired.set_column(owner, name.clone(), column.gather(rows))?;
    }
    Ok(repaired)
}

fn publish(cx: &Cx, closed: &ClosedSurface, solid: &TetMesh) {
    let measured = &solid.measured;
    cx.publish(COUNT, solid.tets.len() as f64);
    cx.publish(BODIES, closed.bodies as f64);
    cx.publish(MIN_DIHEDRAL, measured.min_dihedral);
    cx.publish(QUALITY_MEDIAN, measured.quality_median);
    cx.publish(VOLUME_ERROR, measured.volume_error);
    cx.publish(MISSING_FACES, measured.missing_faces as f64);
    cx.publish(MISSING_EDGES, measured.missing_edges as f64);
    cx.publish(BARE_POINTS, measured.bare_points as f64);
    cx.publish(SLIVERS, measured.slivers as f64);
    cx.publish(REPAIRS, closed.changes.count() as f64);
}

fn refusal(fault: SurfaceFault) -> Error {
    let hint = fault.hint();
    Error::refused(fault.to_string()).hint(hint)
}

fn leaves_out(params: &Params, _: &Wires) -> Vec<LeftOut> {
    match params.get(INTERIOR) {
        true => Vec::new(),
        false => vec![LeftOut::new("interior points", "`interior` is false")],
    }
}

#[cfg(test)]
mod tests;
