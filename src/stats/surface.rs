//! Totals over the polygons of a mesh: edges, area and volume.
//!
//! Exact up to f64 rounding, summed in the order of the faces. The area of a polygon is the length of its vector area,
//! which is exact for planar polygons, convex or not. The volume is computed with polygons as triangle fans about their
//! first corners, and only for closed surfaces.

use engine::geometry::Faces;
use numerics::vector::{DVec3, to_f64};

/// Edges, area and volume.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SurfaceStats {
    /// Corners of each face.
    pub(super) corners: Vec<u32>,
    /// Number of distinct edges.
    pub(super) edges: usize,
    /// Edges of one face: the boundary of an open mesh.
    pub(super) boundary: usize,
    /// Edges of two faces.
    pub(super) manifold: usize,
    /// Edges of more than two faces.
    pub(super) non_manifold: usize,
    /// Edges of two faces with inconsistent winding.
    pub(super) flipped: usize,
    /// m².
    pub(super) area: f64,
    /// m³, positive if faces are counter-clockwise seen from outside; `None` if the surface is not closed, that is, if
    /// an edge is not used equally often in both directions.
    pub(crate) volume: Option<f64>,
}

impl SurfaceStats {
    /// Measures `faces` with these `positions`.
    pub(crate) fn of(faces: &Faces, positions: &[[f32; 3]]) -> Self {
        let mut edges = directed_edges(faces);
        edges.sort_unstable();
        let mut surface = Self {
            corners: faces.runs.counts().collect(),
            edges: 0,
            boundary: 0,
            manifold: 0,
            non_manifold: 0,
            flipped: 0,
            area: 0.0,
            volume: None,
        };
        let mut closed = !faces.runs.is_empty();
        for edge in edges.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
            let ascending = edge.iter().filter(|one| one.ascends).count();
            closed &= 2 * ascending == edge.len();
            surface.edges += 1;
            match edge.len() {
                1 => surface.boundary += 1,
                2 => {
                    surface.manifold += 1;
                    surface.flipped += usize::from(ascending != 1);
                }
                _ => surface.non_manifold += 1,
            }
        }
        // Relative to a point of the mesh, to avoid cancellation far from the origin.
        let about = positions.first().copied().map_or(DVec3::zeros(), to_f64);
        let point = |corner: u32| to_f64(positions[corner as usize]) - about;
        let mut volume = 0.0;
        for face in faces.iter() {
            let first = point(face[0]);
            let mut vector_area = DVec3::zeros();
            for pair in face[1..].windows(2) {
                let normal = (point(pair[0]) - first).cross(&(point(pair[1]) - first));
                vector_area += normal;
                volume += first.dot(&normal);
            }
            surface.area += vector_area.norm() / 2.0;
        }
        surface.volume = closed.then_some(volume / 6.0);
        surface
    }
}

/// An edge of a face.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    low: u32,
    high: u32,
    ascends: bool,
}

/// The edges of all faces. Repeated corners make no edge.
fn directed_edges(faces: &Faces) -> Vec<Edge> {
    let mut edges = Vec::with_capacity(faces.corners.len());
    for face in faces.iter() {
        let next = face.iter().cycle().skip(1);
        edges.extend(face.iter().zip(next).filter(|(a, b)| a != b).map(|(a, b)| Edge {
            low: *a.min(b),
            high: *a.max(b),
            ascends: a < b,
        }));
    }
    edges
}

/// The volume of a tet in m³, with the sign of (b−a)×(c−a)·(d−a).
pub(crate) fn tet_volume([a, b, c, d]: [[f32; 3]; 4]) -> f64 {
    let [b, c, d] = [b, c, d].map(|corner| to_f64(corner) - to_f64(a));
    b.cross(&c).dot(&d) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::Component;

    fn surface(faces: &[&[u32]], positions: &[[f32; 3]]) -> SurfaceStats {
        let counts = faces.iter().map(|face| face.len() as u32).collect();
        let mesh = Component::mesh(counts, faces.concat(), positions.to_vec()).unwrap();
        SurfaceStats::of(mesh.faces().unwrap(), mesh.positions())
    }

    /// A cube with edges of 2 centred at `x`, with six quads facing outwards.
    fn cube(x: f32) -> (Vec<&'static [u32]>, Vec<[f32; 3]>) {
        let corner = |k: u32| [x + [-1.0, 1.0][k as usize & 1], [-1.0, 1.0][k as usize >> 1 & 1], k as f32 / 4.0];
        let positions = (0..8).map(corner).map(|[x, y, z]| [x, y, if z < 1.0 { -1.0 } else { 1.0 }]).collect();
        (vec![&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]], positions)
    }

    #[test]
    fn the_area_and_volume_of_a_cube_are_exact_near_and_far_from_zero() {
        for x in [0.0, 4096.0] {
            let (faces, positions) = cube(x);
            let cube = surface(&faces, &positions);
            assert_eq!((cube.area, cube.volume), (24.0, Some(8.0)), "about {x}");
            assert_eq!((cube.edges, cube.manifold, cube.boundary, cube.non_manifold), (12, 12, 0, 0));
        }
    }

    #[test]
    fn faces_that_point_inwards_have_a_negative_volume() {
        let (faces, positions) = cube(0.0);
        let inside_out: Vec<Vec<u32>> = faces.iter().map(|face| face.iter().rev().copied().collect()).collect();
        let inside_out: Vec<&[u32]> = inside_out.iter().map(Vec::as_slice).collect();
        assert_eq!(surface(&inside_out, &positions).volume, Some(-8.0));
    }

    #[test]
    fn an_open_or_half_flipped_cube_has_no_volume() {
        let (mut faces, positions) = cube(0.0);
        let flipped = surface(&[&[&[1, 3, 2, 0][..]], &faces[1..]].concat(), &positions);
        assert_eq!((flipped.volume, flipped.flipped, flipped.boundary), (None, 4, 0));
        faces.pop();
        let open = surface(&faces, &positions);
        assert_eq!((open.volume, open.boundary, open.area), (None, 4, 20.0));
        assert_eq!(surface(&[], &positions).volume, None, "without faces nothing is enclosed");
    }

    #[test]
    fn an_edge_of_three_faces_is_not_manifold() {
        let fan = [[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        let fan = surface(&[&[0, 1, 2], &[0, 1, 3], &[0, 1, 4]], &fan);
        assert_eq!((fan.edges, fan.non_manifold, fan.boundary), (7, 1, 6));
    }

    #[test]
    fn the_area_of_a_concave_polygon_is_exact() {
        let arrow = [[0.0, 0.0, 0.0], [2.0, -2.0, 0.0], [1.0, 0.0, 0.0], [2.0, 2.0, 0.0]];
        assert_eq!(surface(&[&[1, 2, 3, 0]], &arrow).area, 2.0);
    }

    #[test]
    fn a_tet_with_faces_that_point_outwards_has_a_positive_volume() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let [a, b, c, d] = corners;
        assert_eq!((tet_volume(corners), tet_volume([a, c, b, d])), (1.0 / 6.0, -1.0 / 6.0));
    }
}
