//! The faces that tets have to the outside.

use numerics::vector::{Vec3, cross, dot, sub};

/// A face of one tet alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundaryFace {
    /// Its points, counter-clockwise from outside.
    pub corners: [u32; 3],
    /// The tet it is of.
    pub tet: u32,
}

/// Faces that belong to an odd number of tets, in the order of their tets and turned away from them where `points` (metres)
/// are; a flat tet's are turned as if its corners ran counter-clockwise.
pub fn boundary(tets: &[[u32; 4]], points: &[Vec3]) -> Vec<BoundaryFace> {
    let mut faces: Vec<([u32; 3], BoundaryFace)> = Vec::with_capacity(4 * tets.len());
    for (tet, corners) in (0..).zip(tets) {
        let at = corners.map(|corner| points[corner as usize]);
        let turned = dot(sub(at[1], at[0]), cross(sub(at[2], at[0]), sub(at[3], at[0]))) < 0.0;
        let [a, b, c, d] = *corners;
        for corners in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let corners = if turned { [corners[0], corners[2], corners[1]] } else { corners };
            let mut sorted = corners;
            sorted.sort_unstable();
            faces.push((sorted, BoundaryFace { corners, tet }));
        }
    }
    faces.sort_unstable_by_key(|(sorted, face)| (*sorted, face.tet));
    let alone = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() % 2 == 1);
    let mut alone: Vec<BoundaryFace> = alone.map(|same| same[0].1).collect();
    alone.sort_by_key(|face| face.tet);
    alone
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tets_have_six_faces_to_the_outside_whichever_way_they_turn() {
        let points =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]].map(|p: Vec3| p);
        for tets in [[[0, 1, 2, 3], [1, 2, 3, 4]], [[1, 0, 2, 3], [2, 1, 3, 4]]] {
            let faces = boundary(&tets, &points);
            assert_eq!(faces.iter().map(|face| face.tet).collect::<Vec<_>>(), [0, 0, 0, 1, 1, 1]);
            for face in faces {
                let [a, b, c] = face.corners.map(|corner| points[corner as usize]);
                let normal = cross(sub(b, a), sub(c, a));
                let middle = tets[face.tet as usize].map(|corner| points[corner as usize]);
                let mean = (0..3).map(|k| middle.iter().map(|p| p[k]).sum::<f32>() / 4.0).collect::<Vec<_>>();
                assert!(dot(normal, sub(a, [mean[0], mean[1], mean[2]])) > 0.0, "{face:?} looks out");
            }
        }
    }

    #[test]
    fn nothing_has_no_boundary() {
        assert_eq!(boundary(&[], &[]), []);
    }
}
