//! Filling closed surfaces with tets, so that springs run throughout a body, not only along its surface.
//!
//! First the polygons are verified ([`ClosedSurface::of`]): points merged, faces oriented, cavities distinguished
//! from bodies, and surfaces without an inside refused with the location of the fault. Then each body is filled
//! ([`ClosedSurface::fill`]): interior points on a regular lattice, the Delaunay tets of these and the surface points
//! ([`delaunay()`]), and of those the tets whose centroid is inside by winding number.
//!
//! Decisions are made on points snapped to a 24-bit integer grid and are exact; results do not depend on CPU or
//! number of threads, and no input can cause an endless loop or a failure. The surface points keep their bits and
//! order. No tet connects different bodies.
//!
//! Limit: the tets are Delaunay, so where the surface is not (long thin faces, sheets closer together than their
//! faces are wide) some of its faces and edges are missing. [`FillQuality`] counts them and gives the volume error,
//! [`missing_edges`] lists the edges. Details below 2⁻²⁴ of the bounding box are lost.

mod boundary;
mod cage;
mod closed;
mod cubes;
mod delaunay;
mod edges;
mod enclosure;
pub mod grid;
mod improve;
mod insertion_order;
mod interior;
mod lattice;
mod predicates;
mod quality;
mod repair;
mod self_crossing;
mod shells;
mod solid;
mod solid_angle;
mod soup;
mod surface_fault;
mod winding;

pub use boundary::{BoundaryFace, boundary};
pub(crate) use boundary::{faces_of, oriented_boundary, sorted};
pub use cage::{Cage, CagedSurface};
pub use closed::ClosedSurface;
pub use cubes::cubes;
pub use delaunay::{Delaunay, NONE, delaunay};
pub use edges::{edges, missing_edges};
pub use enclosure::bounds;
pub(crate) use enclosure::{Enclosure, Exit};
pub use repair::{PolygonSurface, RepairCounts};
pub use solid::{FillQuality, FillSettings, SLIVER, ShellSide, TetMesh};
pub(crate) use solid_angle::SolidAngles;
pub use surface_fault::SurfaceFault;

#[cfg(test)]
mod tests;
