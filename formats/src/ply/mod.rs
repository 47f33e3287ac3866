//! PLY: faces are a mesh, edges are curves, and vertices without either are points.
//!
//! **Read**: ascii and both binary encodings, any scalar type. `x y z` are `P`, `nx ny nz` are `N`, `red green blue`
//! are the attribute `Cd` (three floats, 0…1: bytes are divided by 255, shorts by 65535), `s t`, `u v` or
//! `texture_u texture_v` are `uvw`. Any other scalar property is an attribute: floats become f32, integers i32 (`uint`
//! above 2³¹ keeps its bits). An underscore is appended to a well-known name with another type. Lists other than a
//! face's corners, and elements other than `vertex`, `face`, `edge` and `curve`, are skipped. Edges are joined to
//! polylines at every vertex with exactly two edges, in the order and direction of each polyline's first edge in the
//! file; a closed polyline ends at its first CV. With one kind of element all vertices belong to it; with several, each
//! component has the vertices that its elements reference, in file order.
//!
//! **Written**: binary little endian, so that every bit survives. Curves are written as edges, which other programs can
//! read, followed by an element `curve` (number of CVs `count`, and the curve's attributes) from which this reader
//! restores them exactly; faces have their attributes. Vector attributes are `name.0 name.1 name.2`; characters that a
//! property name cannot contain, or that would change its meaning, are `%` and two hexadecimal digits. `Cd` is written
//! as bytes if that is lossless. Several components, or a mesh without a face, share the vertex table, with a property
//! `convect_component` for the component of a vertex (0 curves, 1 mesh, 2 points); an attribute that one of them lacks
//! is zero there. PLY drops attributes of the whole component, and components without a point.

mod attributes;
mod body;
mod chains;
mod header;
mod names;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use read::read;
pub(crate) use write::write;

/// The vertex property for the component of a vertex: the number of its [`engine::geometry::Kind`].
const COMPONENT: &str = "convect_component";
