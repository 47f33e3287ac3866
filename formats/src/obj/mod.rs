//! Wavefront OBJ: `l` polylines are curves, `f` faces a mesh, `p` or bare vertices points.
//!
//! **Read.** A file with one kind of element gives all its vertices to that component, in file order (curves: in the
//! order their lines name them). With several kinds each takes the vertices it names. Negative indices count back
//! from their line, `\` continues a line, polygons stay polygons. `v x y z r g b` is the point attribute `Cd` (three
//! floats, 0…1, as Houdini names it), `vn` is `N` and `vt` is `uvw`: each is carried where every point of a component
//! has exactly one finite value (named by its faces, or as many `vn` or `vt` as `v`), and left out else. A `w` and an
//! alpha are ignored, and so are groups, materials, free-form surfaces and statements no one knows. A file of comments
//! is an empty geometry; one of no bytes is a fault.
//!
//! **Written.** The same, in one object per component. What OBJ drops: all other attributes, `N` of curves and points
//! beside another component, faceless points of a mesh beside another component, and components without a point. A
//! mesh without a face comes back as points.

mod read;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use read::read;
pub(crate) use write::write;

/// The point attribute for colour, three floats, 0…1.
pub(crate) const CD: &str = "Cd";
