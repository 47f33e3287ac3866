//! A mesh as a collider, and as a skin: computed once while it does not move.

use std::sync::Arc;

use curves::collide::SkinMesh;
use engine::geometry::Component;
use numerics::tree::TriangleTree;

/// The tree of a mesh's triangles.
pub(crate) fn tree(mesh: &Component) -> Arc<TriangleTree> {
    mesh.derived(|mesh| TriangleTree::build(mesh.positions(), &mesh.triangles().corners))
}

/// A mesh that curves grow on.
pub(crate) fn skin(mesh: &Component) -> Arc<SkinMesh> {
    mesh.derived(|mesh| SkinMesh::new(tree(mesh), mesh.positions(), &mesh.triangles().corners))
}
