//! PLY: faces are a mesh, edges curves, bare vertices points.
//!
//! **Read**: ascii and both binary encodings, any scalar type. `x y z` are `P`, `nx ny nz` are `N`, `red green blue`
//! are the attribute `Cd` (three floats, 0…1: bytes are divided by 255, shorts by 65535), `s t`, `u v` or `texture_u
//! texture_v` are `uvw`. Any other scalar is an attribute: floating ones f32, whole ones i32 (`uint` above 2³¹ keeps
//! its bits). A name that convect gives another type gets an underscore. Lists other than a face's corners, and
//! elements other than `vertex`, `face`, `edge` and `curve`, are skipped. Edges join into polylines through every
//! vertex that has exactly two, in the order and direction of each polyline's first edge in the file; a ring ends on
//! its first CV again. With one kind of element a mesh or points takes all vertices; with several, each takes those it
//! names, in file order.
//!
//! **Written**: binary little endian, so that every bit survives. Curves are edges, which other programs open, with an
//! element `curve` behind them (`count` CVs, and the curve's attributes) from which this reader takes them back
//! exactly; faces carry their attributes. Wide attributes are `name.0 name.1 name.2`; what a property name cannot
//! hold, or what would be read as something else, is `%` and two hexadecimal digits. `Cd` is written as bytes where
//! that loses nothing. Several components, or a mesh without a face, share the vertex table with a `convect_component`
//! that says whose a vertex is (0 curves, 1 mesh, 2 points); an attribute that one of them lacks is zero there. What
//! PLY drops: attributes of the whole component, and components without a point.

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

/// The vertex property that says whose a vertex is: the number of its [`engine::geometry::Kind`].
const COMPONENT: &str = "convect_component";
