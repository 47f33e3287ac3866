//! A mesh that curves grow on, in the form that kernels take.

use std::sync::Arc;

use curves::collide::SkinMesh;
use engine::geometry::Component;
use numerics::tree::TriangleTree;

/// The skin of a mesh; computed once while it does not move, also for nodes of other families.
pub(crate) fn skin(mesh: &Component) -> Arc<SkinMesh> {
    mesh.derived(|mesh| {
        let (points, triangles) = (mesh.positions(), &mesh.triangles().corners);
        SkinMesh::new(mesh.derived(|_| TriangleTree::build(points, triangles)), points, triangles)
    })
}
