//! Tets that fill closed surfaces: springs all through a body, not on its skin alone.
//!
//! A surface's polygons are brought into order ([`Closed::of`]): joined, turned outwards, cavities told from bodies, and
//! refused, with the place, where they have no inside. Then each body is filled ([`Closed::fill`]): points on a regular
//! lattice inside, the Delaunay tets of those and of the surface's points ([`delaunay()`]), and of these the ones whose
//! middle the surface winds around.
//!
//! Promise: points are brought to a lattice of 24 bits for every decision, which is then exact; so it is the same on any
//! CPU and for any number of threads, and no input makes it loop or fail. The surface's points keep their bits and their
//! order. No tet reaches from one body to another.
//!
//! Limit: tets are Delaunay, so where the surface is not (long thin faces, sheets nearer to each other than their faces
//! are wide) they lack some of its faces and edges: [`Measured`] says how many, what volume it costs, and
//! [`missing_edges`] which. Details below 2⁻²⁴ of the bounds are lost.

mod boundary;
mod closed;
mod cubes;
mod delaunay;
mod edges;
pub mod grid;
mod insertion_order;
mod interior;
mod predicates;
mod quality;
mod repair;
mod self_crossing;
mod shells;
mod solid;
mod surface_fault;
mod winding;

pub use boundary::{BoundaryFace, boundary};
pub(crate) use boundary::{FACES, faces_of, oriented_boundary, sorted};
pub use closed::ClosedSurface;
pub use cubes::cubes;
pub use delaunay::{Delaunay, NONE, delaunay};
pub use edges::{edges, missing_edges};
pub use repair::{PolygonSurface, RepairCounts};
pub use solid::{FillQuality, FillSettings, SLIVER, ShellSide, TetMesh};
pub use surface_fault::SurfaceFault;

#[cfg(test)]
mod tests;
