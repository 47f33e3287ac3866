//! Tetrahedralize: fills closed surfaces with tets.
//!
//! R1: "create a Delaunay tetrahedralization of our input surface and convert the internal nodes and edges into
//! internal particles and springs", for "an unbiased set of springs that cover the volume". [`bodies::tets`] does the
//! work.
//!
//! What R leaves open:
//! * R does not say where internal nodes come from. Here they are a body-centred cubic lattice with the surface's mean
//!   edge length, slightly jittered and kept half an edge away from the surface. Without internal nodes all springs of
//!   a body would reach from surface to surface.
//! * A closed shell within another is the wall of a cavity, and one within that is a body again: the white of an egg
//!   ends where the yolk begins. The inside is where the surface has winding number 1.
//! * Some edges of the surface may not be edges of tets. No list of them is stored: the output includes the surface,
//!   and [`bodies::tets::missing_edges`] finds them, so the two cannot become inconsistent.
//! * Slivers, flat tets without a meaningful volume, are flipped or moved away, or taken away where they lie on a flat
//!   part of the surface. What remains, mostly below two triangles of the surface, is kept, as its edges are good
//!   springs, and marked `sliver`.
//! * R needs a closed surface. `method` `cage` takes any: the tets are those of a lattice around the surface, which rides
//!   along in them ([`bodies::tets::CagedSurface`]).

use std::collections::BTreeSet;

use bodies::embedding::nearest_points;
use bodies::tets::{Cage, CagedSurface, ClosedSurface, FillSettings, PolygonSurface, ShellSide, SurfaceFault, TetMesh};
use engine::prelude::*;

use crate::shared::attributes::{BODY_NUMBER, FILL, SLIVER, SURFACE_POINT};
use numerics::pieces::pieces;

choice! {
    /// How the tets are made.
    enum Method {
        Delaunay = "delaunay": "Delaunay tets between the points of the surface and inner points. The surface must be \
                    closed and must not cross itself. Its points are points of the tets, and where it is fine \
                    enough its faces are faces of tets (`missing_faces`)",
        Cage = "cage": "the tets of a regular lattice around and inside any surface: open, crossing itself, with several \
                faces at an edge. The surface rides along in them. Parts closer together than \
                `spacing` are joined; those up to 2.2 times as far apart may be, depending on how they lie in the lattice",
    }
}

choice! {
    /// The repair of an invalid surface.
    enum Repair {
        None = "none": "no repair: any defect is refused, and its location reported",
        Safe = "safe": "repairs that neither move points nor open the surface: coincident points are merged where the \
                surface is open or already connected; unused points, degenerate faces and duplicate faces are removed; \
                faces are oriented outwards. Holes, intersections and edges with three faces are still refused",
    }
}

inputs! { INPUTS:
    SURFACE: Input = Input::one("surface", Kind::Mesh,
        "Closed surfaces, one per body. A surface within another one is the wall of a cavity, and one within a cavity is \
         a body again. Coarse faces make a coarse body; \
         faces much longer than wide make one that Softbody finds stiffer along them. With `method` `cage`, any mesh: regions with a winding \
         number of a half or more, or −½ or less, are inside (the wall of a cavity must face into the cavity), holes count as closed, and sheets become \
         one tet thick.");
    CARRY: Input<Opt> = Input::optional("carry", Kind::Mesh,
        "A mesh that rides along in the tets instead of `surface`, such as a finer version of it.");
}

params! { PARAMS:
    METHOD: Param<Method> = Param::choice("method", Method::Delaunay, "How the tets are made.");
    SPACING: Param<f64> = Param::double("spacing", 0.0,
        "Approximate distance between inner points, and the size of a cage's tets. 0 uses the mean edge length of the \
         surface. Half the distance makes eight times as many points.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 1.0)
        .when(|params| params.get(INTERIOR) || params.get(METHOD) == Method::Cage);
    INTERIOR: Param<bool> = Param::bool("interior", true,
        "Whether to add inner points. Without them all tets reach from surface to surface and are few, long and thin.")
        .when(|params| params.get(METHOD) == Method::Delaunay);
    REPAIR: Param<Repair> = Param::choice("repair", Repair::Safe,
        "How an invalid surface is repaired. For a cage, `safe` only orients connected faces alike.");
}

const TETS: Output = Output::new(
    "tets",
    &[Kind::Tets, Kind::Mesh],
    "The tets, together with the mesh that rides along: `carry`; or the surface of a cage; or the repaired surface, \
     whose points are the first points of the tets, in the same order.",
);

/// 0 inside, 1 on the outside of a body, 2 on the wall of a cavity.
const SIDE: Attr<i32> = Attr::point("side");

metrics! { METRICS:
    COUNT = Metric::new("tets", Unit::None, "Number of tets.");
    BODIES = Metric::new("bodies", Unit::None, "Number of bodies.");
    MIN_DIHEDRAL = Metric::new("min_dihedral", Unit::Radians,
        "The smallest dihedral angle of a tet, slivers excluded.");
    QUALITY_MEDIAN = Metric::new("quality_median", Unit::None,
        "Median quality of the tets: three times the inradius ÷ the circumradius. 1 is a regular tet, 0 a flat one.");
    VOLUME_ERROR = Metric::new("volume_error", Unit::None,
        "Difference between the volume of the tets and that enclosed by the surface, relative to the latter.")
        .warn_above(0.01, "The tets cut corners of the surface or bulge beyond it, so the body has another shape than its \
            surface. Use smaller and more even faces where the surface is thin or has long faces, or a smaller \
            `spacing`.");
    MISSING_FACES = Metric::new("missing_faces", Unit::None,
        "Faces of the surface that are not faces of tets. Where two triangles form a flat quad that the tets cut along its \
         other diagonal, this changes no shape; elsewhere the tets cut a corner or bulge (`volume_error`).");
    MISSING_EDGES = Metric::new("missing_edges", Unit::None, "Edges of the surface that are not edges of tets.");
    BARE_POINTS = Metric::new("bare_points", Unit::None, "Points of the surface that belong to no tet.")
        .warn_above(0.0,
        "These points of the surface belong to no tet, so they are connected only by springs along the surface. Look \
         for thin spikes and doubled walls, and thicken or remove them.");
    SLIVERS = Metric::new("slivers", Unit::None,
        "Tets too flat to have a meaningful volume; only their springs act.");
    SLIVER_SHARE = Metric::new("sliver_share", Unit::None, "`slivers` relative to `tets`.")
        .warn_above(0.02, "Many tets are too flat to preserve their volume: where they lie, the body is held by springs \
            alone. Set `interior`, or give the surface smaller and more even faces where it is thin.");
    REPAIRS = Metric::new("repairs", Unit::None,
        "Number of points merged or removed, and of faces removed, freed of repeated corners or reoriented.");
    LOST_PIECES = Metric::new("lost_pieces", Unit::None,
        "Connected pieces of the surface of which repairs left no face.")
        .warn_above(0.0, "These pieces of the surface get no tets: they are so small next to the whole surface (less than \
            1e-7 of it) that their points coincide. Fill them in a Tetrahedralize of their own, or remove them.");
}

pub(crate) static NODE: Node = Node::new(
    "Tetrahedralize",
    2,
    "Fills closed surfaces with tets, or any surface with a cage of them, so that they can be simulated as soft bodies. \
     By default inner points are about as far apart as those of the surface. Points get the attributes `surface_point`, \
     the index of the corresponding point of the surface (−1 inside, in a cage, and with `carry`), and `side`: 1 on the \
     outside of a body, 2 on the wall of a cavity, 0 inside. Tets get `body`, the number of their body from 0, and \
     `sliver`, 1 if the tet is too flat to have a meaningful volume; in a cage also `fill`, the share of the tet inside \
     the surface, by which Softbody scales mass and stiffness. Point attributes of the surface are carried to the points \
     of the tets (inner points take those of the nearest surface point), so that they can mask params of Softbody. The \
     output includes the mesh that rides along.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[Accuracy::smaller("spacing", Trials::Times(&[4.0, 2.0, 1.0]))])
.outputs(&[&TETS])
.reads(&[&P])
.writes(&[&P, &SURFACE_POINT, &SIDE, &BODY_NUMBER, &SLIVER, &FILL])
.metrics(METRICS)
.leaves_out(leaves_out)
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let mesh = cx.part(SURFACE);
    let faces = mesh.faces().expect("a mesh has faces");
    let surface = PolygonSurface { starts: faces.runs.starts(), corners: &faces.corners, points: mesh.positions() };
    let safe = cx.get(REPAIR) == Repair::Safe;
    let (tets, own) = match cx.get(METHOD) {
        Method::Cage => (caged(cx, mesh, surface, safe)?, mesh.clone()),
        Method::Delaunay => {
            let closed = ClosedSurface::of(&surface, safe).map_err(refusal)?;
            cx.check_cancelled()?;
            let fill = FillSettings { spacing: cx.get(SPACING), interior: cx.get(INTERIOR) };
            let bytes = closed.fill_bytes(&fill).map_err(refusal)?;
            cx.reserve(bytes, "raise `spacing`, fill fewer bodies, or raise --memory")?;
            let solid = closed.fill(&fill).map_err(refusal)?;
            publish(cx, mesh, &closed, &solid);
            let repaired = repaired(mesh, &closed)?;
            let on_surface = if cx.part(CARRY).is_some() { 0 } else { closed.points.len() };
            (tets(cx, &repaired, solid, on_surface)?, repaired)
        }
    };
    let along = cx.part(CARRY).cloned().unwrap_or(own);
    Ok(TETS.with(Geometry::from(tets).with(along)))
}

/// The cage of any surface.
fn caged(cx: &Cx, mesh: &Component, surface: PolygonSurface<'_>, orient: bool) -> Result<Component> {
    let caged = CagedSurface::of(surface, cx.get(SPACING), orient).map_err(refusal)?;
    cx.reserve(caged.fill_bytes(), "raise `spacing`, fill fewer bodies, or raise --memory")?;
    cx.check_cancelled()?;
    let Cage { tets: solid, fill, bodies } = caged.fill();
    publish_tets(cx, &solid, bodies);
    let mut tets = tets(cx, mesh, solid, 0)?;
    if cx.wants(FILL) {
        tets.set(FILL, fill)?;
    }
    Ok(tets)
}

/// The bodies with the attributes that the node writes, and those of the points of `mesh`. The first `on_surface` points
/// are those of the mesh that rides along.
fn tets(cx: &Cx, mesh: &Component, solid: TetMesh, on_surface: usize) -> Result<Component> {
    let mut tets = Component::tets(solid.tets, solid.points)?;
    carry_attributes(cx, &mut tets, mesh)?;
    if cx.wants(SURFACE_POINT) {
        let points = 0..tets.point_count();
        tets.set(SURFACE_POINT, points.map(|point| if point < on_surface { point as i32 } else { -1 }).collect())?;
    }
    if cx.wants(SIDE) {
        let number = |side: &ShellSide| match side {
            ShellSide::Interior => 0,
            ShellSide::Outer => 1,
            ShellSide::Inner => 2,
        };
        tets.set(SIDE, solid.sides.iter().map(number).collect())?;
    }
    if cx.wants(BODY_NUMBER) {
        tets.set(BODY_NUMBER, solid.bodies.iter().map(|body| *body as i32).collect())?;
    }
    if cx.wants(SLIVER) {
        tets.set(SLIVER, solid.slivers.iter().map(|sliver| i32::from(*sliver)).collect())?;
    }
    Ok(tets)
}

/// Gives the points of the tets the attributes of the nearest points of the mesh.
fn carry_attributes(cx: &Cx, tets: &mut Component, mesh: &Component) -> Result<()> {
    let mut nearest: Option<Vec<u32>> = None;
    for (_, name, column) in mesh.columns().filter(|(owner, name, _)| *owner == Owner::Point && ***name != *P.name) {
        if !cx.wants_named(name) || tets.point_count() == 0 {
            continue;
        }
        let rows = nearest
            .get_or_insert_with(|| nearest_points(mesh.positions(), &mesh.triangles().corners, tets.positions()));
        let carried = column.gather(rows);
        tets.set_column(Owner::Point, name.clone(), carried)?;
    }
    Ok(())
}

/// The repaired mesh with all its attributes; the input itself if no repair was needed.
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

fn publish_tets(cx: &Cx, solid: &TetMesh, bodies: usize) {
    let measured = &solid.measured;
    cx.publish(COUNT, solid.tets.len() as f64);
    cx.publish(BODIES, bodies as f64);
    cx.publish(MIN_DIHEDRAL, measured.min_dihedral);
    cx.publish(QUALITY_MEDIAN, measured.quality_median);
    cx.publish(VOLUME_ERROR, measured.volume_error);
    cx.publish(SLIVERS, measured.slivers as f64);
    cx.publish(SLIVER_SHARE, measured.slivers as f64 / solid.tets.len().max(1) as f64);
}

fn publish(cx: &Cx, mesh: &Component, closed: &ClosedSurface, solid: &TetMesh) {
    let measured = &solid.measured;
    publish_tets(cx, solid, closed.bodies);
    cx.publish(MISSING_FACES, measured.missing_faces as f64);
    cx.publish(MISSING_EDGES, measured.missing_edges as f64);
    cx.publish(BARE_POINTS, measured.bare_points as f64);
    cx.publish(REPAIRS, closed.changes.count() as f64);
    cx.publish(LOST_PIECES, lost_pieces(mesh, closed) as f64);
}

/// Number of connected pieces of `mesh` of which no face was kept, apart from faces without a size. Points at one
/// position are connected.
fn lost_pieces(mesh: &Component, closed: &ClosedSurface) -> usize {
    if closed.changes.dropped_faces == 0 {
        return 0;
    }
    let (faces, positions) = (mesh.faces().expect("a mesh has faces"), mesh.positions());
    let face = |index: usize| {
        let starts = faces.runs.starts();
        &faces.corners[starts[index] as usize..starts[index + 1] as usize]
    };
    let mut by_position: Vec<u32> = (0..positions.len() as u32).collect();
    by_position.sort_by_key(|point| positions[*point as usize].map(f32::to_bits));
    let same = by_position.windows(2).filter(|pair| positions[pair[0] as usize] == positions[pair[1] as usize]);
    let sides = (0..mesh.element_count()).flat_map(|index| face(index).windows(2));
    let piece = pieces(positions.len(), same.chain(sides).map(|pair| [pair[0], pair[1]]));
    let mut kept = vec![false; positions.len()];
    for index in &closed.source_faces {
        face(*index as usize).iter().for_each(|corner| kept[piece[*corner as usize] as usize] = true);
    }
    let pieces = faces.corners.iter().map(|corner| (*corner as usize, piece[*corner as usize] as usize));
    let lost = pieces.filter(|(corner, piece)| !kept[*piece] && positions[*corner] != positions[*piece]);
    lost.map(|(_, piece)| piece).collect::<BTreeSet<usize>>().len()
}

fn refusal(fault: SurfaceFault) -> Error {
    let hint = fault.hint();
    Error::refused(fault.to_string()).hint(hint)
}

fn leaves_out(params: &Params, _: &Wires) -> Vec<LeftOut> {
    match params.get(INTERIOR) || params.get(METHOD) == Method::Cage {
        true => Vec::new(),
        false => vec![LeftOut::new("interior points", "`interior` is false")],
    }
}

#[cfg(test)]
mod tests;
