//! A mesh that curves grow on, in the form that kernels take; computed once for a still mesh.

use std::sync::Arc;

use curves::collide::{SkinSurface, normals};
use engine::geometry::{Component, Triangles};
use numerics::tree::TriangleTree;

/// Tree, triangles and normals of a mesh.
pub(crate) struct Skin {
    tree: Arc<TriangleTree>,
    triangles: Arc<Triangles>,
    normals: Arc<Normals>,
}

/// Outward normals of a mesh's points.
struct Normals(Vec<[f32; 3]>);

impl Skin {
    /// The skin of a mesh.
    pub(crate) fn of(mesh: &Component) -> Self {
        let triangles = mesh.triangles();
        let tree = mesh.derived(|mesh| TriangleTree::build(mesh.positions(), &triangles.corners));
        let normals = mesh.derived(|mesh| Normals(normals(mesh.positions(), &triangles.corners)));
        Self { tree, triangles, normals }
    }

    /// The form that kernels take.
    pub(crate) fn surface(&self) -> SkinSurface<'_> {
        SkinSurface { tree: &self.tree, triangles: &self.triangles.corners, normals: &self.normals.0 }
    }
}
