//! Wavefront OBJ: `l` polylines are curves, `f` faces a mesh, `p` or bare vertices points.
//!
//! **Reading.** In a file with one kind of element all vertices belong to that component, in file order (curves: in the
//! order of their lines). With several kinds each component has the vertices that its elements reference. Negative
//! indices count back from their line, `\` continues a line, polygons stay polygons. `v x y z r g b` is the point
//! attribute `Cd` (three floats, 0…1, as Houdini names it), `vn` is `N` and `vt` is `uvw`: each is read if every point
//! of a component has exactly one finite value (referenced by its faces, or as many `vn` or `vt` as `v`), and dropped
//! otherwise. `w` and alpha are ignored, and so are groups, materials, free-form surfaces and unknown statements. A
//! file with only comments is an empty geometry; a file of zero bytes is refused.
//!
//! **Writing.** The same, with one object per component. OBJ drops all other attributes, `N` of curves and points
//! beside another component, points of a mesh that no face uses beside another component, and components without a
//! point. A mesh without a face is read back as points.

mod read;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use read::read;
pub(crate) use write::write;

/// The point attribute for colour, three floats, 0…1.
pub(crate) const CD: &str = "Cd";
