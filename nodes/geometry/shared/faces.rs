//! Two poses of one skin.

use engine::prelude::*;

/// Whether two meshes have the same faces, corner by corner, and as many points.
pub(crate) fn same_faces(a: &Component, b: &Component) -> bool {
    let topology = a.topology().same(b.topology()) || a.topology() == b.topology();
    topology && a.point_count() == b.point_count()
}

/// Whether the faces of two meshes are the same, but inside out, as those of a mesh that is mirrored.
pub(crate) fn inside_out(a: &Component, b: &Component) -> bool {
    a.point_count() == b.point_count() && a.faces().zip(b.faces()).is_some_and(|(a, b)| a.is_inside_out(b))
}

/// How many faces and points a mesh has: `6 faces and 8 points`.
pub(crate) fn counted(mesh: &Component) -> String {
    format!("{} faces and {} points", mesh.element_count(), mesh.point_count())
}
