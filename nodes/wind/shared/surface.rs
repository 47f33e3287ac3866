//! A mesh as a collider: a tree of its triangles, and its normals; computed once for a still mesh.

use std::sync::Arc;

use curves::collide::{SkinSurface, normals};
use engine::geometry::{Component, Triangles};
use numerics::tree::TriangleTree;

/// The tree of a mesh's triangles.
pub(crate) fn tree(mesh: &Component) -> Arc<TriangleTree> {
    mesh.derived(|mesh| TriangleTree::build(mesh.positions(), &mesh.triangles().corners))
}

/// A mesh that curves grow on.
pub(crate) struct Surface {
    tree: Arc<TriangleTree>,
    triangles: Arc<Triangles>,
    normals: Arc<Normals>,
}

/// Outward normals of a mesh's points.
struct Normals(Vec<[f32; 3]>);

impl Surface {
    /// The surface of a mesh.
    pub(crate) fn of(mesh: &Component) -> Self {
        let triangles = mesh.triangles();
        let normals = mesh.derived(|mesh| Normals(normals(mesh.positions(), &triangles.corners)));
        Self { tree: tree(mesh), triangles, normals }
    }

    /// The tree of its triangles.
    pub(crate) fn tree(&self) -> &Arc<TriangleTree> {
        &self.tree
    }

    /// The form that the kernel takes.
    pub(crate) fn skin(&self) -> SkinSurface<'_> {
        SkinSurface { tree: &self.tree, triangles: &self.triangles.corners, normals: &self.normals.0 }
    }
}
