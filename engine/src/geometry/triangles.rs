//! Triangulation of a mesh's polygons, including concave ones.

use std::sync::Arc;

use numerics::parallel;
use numerics::triangulate::triangulate;

use super::Component;

/// Faces that a thread triangulates at a time.
const TASK: usize = 256;

/// Triangles of a mesh, in the order and winding of its faces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Triangles {
    /// The points of each triangle.
    pub corners: Vec<[u32; 3]>,
    /// The face that each triangle is part of.
    pub faces: Vec<u32>,
}

impl Component {
    /// The mesh's triangles, computed once; none for other components.
    pub fn triangles(&self) -> Arc<Triangles> {
        self.derived(Triangles::of)
    }
}

impl Triangles {
    fn of(mesh: &Component) -> Self {
        let Some(faces) = mesh.faces() else { return Self::default() };
        let triangles_of = |face: usize| {
            let corners = faces.face(face);
            let at: Vec<_> = corners.iter().map(|corner| mesh.positions()[*corner as usize]).collect();
            let ears = triangulate(&at).into_iter().map(move |ear| ear.map(|k| corners[k as usize]));
            ears.map(move |corners| (corners, face as u32))
        };
        let count = faces.runs.len();
        let parts = parallel::map((0..count).step_by(TASK), |_, first| {
            (first..count.min(first + TASK)).flat_map(triangles_of).unzip::<_, _, Vec<_>, Vec<_>>()
        });
        let (corners, faces): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        Self { corners: corners.concat(), faces: faces.concat() }
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::Component;

    #[test]
    fn a_concave_quad_is_split_inside_and_a_triangle_is_kept() {
        // An arrowhead whose notch is corner 3, and a triangle beside it.
        let points = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 1.0], [5.0, 0.0], [6.0, 0.0], [5.0, 1.0]];
        let points = points.iter().map(|[x, z]| [*x, 0.0, *z]).collect();
        let mesh = Component::mesh(vec![4, 3], vec![0, 1, 2, 3, 4, 5, 6], points).unwrap();
        let triangles = mesh.triangles();
        assert_eq!(triangles.faces, [0, 0, 1]);
        assert!(triangles.corners[..2].iter().all(|corners| corners.contains(&1) && corners.contains(&3)));
        assert_eq!(triangles.corners[2], [4, 5, 6]);
        assert!(Component::points(Vec::new()).triangles().corners.is_empty());
    }
}
