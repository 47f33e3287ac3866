//! Boundary faces of tets.

use numerics::vector::{Vec3, cross, dot, sub};

/// Corners of the four faces of a tet, opposite to corner 0, 1, 2 and 3. Counter-clockwise seen from outside if the
/// tet is positive, (b − a)×(c − a)·(d − a) > 0.
pub(crate) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The faces of a tet as points, in the order of [`FACES`].
pub(crate) fn faces_of(tet: &[u32; 4]) -> [[u32; 3]; 4] {
    FACES.map(|face| face.map(|corner| tet[corner]))
}

/// The points of a face in ascending order: the key by which two tets recognise the face they share.
pub(crate) fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// A face of a single tet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundaryFace {
    /// Its points, counter-clockwise seen from outside.
    pub corners: [u32; 3],
    /// Its tet.
    pub tet: u32,
}

/// Faces that belong to an odd number of tets, in the order of their tets, facing away from them for the positions
/// `points`. Faces of a flat tet are oriented as if it were positive.
pub fn boundary(tets: &[[u32; 4]], points: &[Vec3]) -> Vec<BoundaryFace> {
    let mut faces: Vec<([u32; 3], BoundaryFace)> = Vec::with_capacity(4 * tets.len());
    for (tet, corners) in (0..).zip(tets) {
        let at = corners.map(|corner| points[corner as usize]);
        let turned = dot(sub(at[1], at[0]), cross(sub(at[2], at[0]), sub(at[3], at[0]))) < 0.0;
        for corners in faces_of(corners) {
            let corners = if turned { [corners[0], corners[2], corners[1]] } else { corners };
            faces.push((sorted(corners), BoundaryFace { corners, tet }));
        }
    }
    faces.sort_unstable_by_key(|(key, face)| (*key, face.tet));
    let alone = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() % 2 == 1);
    let mut alone: Vec<BoundaryFace> = alone.map(|same| same[0].1).collect();
    alone.sort_by_key(|face| face.tet);
    alone
}

/// The closed surface that encloses the sum of the signed volumes of `tets`, sorted: each face as often as tets on
/// one side of it outnumber those on the other. Unlike [`boundary`] it is closed even where tets overlap or are
/// inverted, so that volumes and their gradients can be summed over it.
pub(crate) fn oriented_boundary(tets: impl Iterator<Item = [u32; 4]>) -> Vec<[u32; 3]> {
    let mut faces: Vec<([u32; 3], bool)> = tets.flat_map(|tet| faces_of(&tet)).map(ascending).collect();
    faces.sort_unstable();
    let remaining = |same: &[([u32; 3], bool)]| {
        let even = same.iter().filter(|face| face.1).count();
        let odd = same.len() - even;
        let [a, b, c] = same[0].0;
        let face = if even > odd { [a, b, c] } else { [a, c, b] };
        std::iter::repeat_n(face, even.abs_diff(odd))
    };
    faces.chunk_by(|a, b| a.0 == b.0).flat_map(remaining).collect()
}

/// A face's corners in ascending order, and whether that is an even permutation.
fn ascending(face: [u32; 3]) -> ([u32; 3], bool) {
    let sorted = sorted(face);
    let first = face.iter().position(|corner| *corner == sorted[0]).unwrap_or(0);
    (sorted, face[(first + 1) % 3] == sorted[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tets_have_six_boundary_faces_in_either_orientation() {
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
    fn no_tets_have_no_boundary() {
        assert_eq!(boundary(&[], &[]), []);
    }

    #[test]
    fn both_boundaries_of_a_block_are_the_same_faces() {
        let (points, tets) = crate::tets::cubes([2, 3, 2], [0.0; 3], [1.0; 3]);
        let points: Vec<Vec3> = points.iter().map(|p| p.map(|x| x as f32)).collect();
        let turn_to_lowest = |face: [u32; 3]| {
            let first = (0..3).min_by_key(|k| face[*k]).unwrap();
            [0, 1, 2].map(|k| face[(first + k) % 3])
        };
        let mut by_parity: Vec<[u32; 3]> =
            boundary(&tets, &points).iter().map(|face| turn_to_lowest(face.corners)).collect();
        let mut oriented: Vec<[u32; 3]> = oriented_boundary(tets.into_iter()).into_iter().map(turn_to_lowest).collect();
        by_parity.sort_unstable();
        oriented.sort_unstable();
        assert_eq!(oriented.len(), 2 * 2 * (2 * 3 + 3 * 2 + 2 * 2));
        assert_eq!(oriented, by_parity);
    }

    #[test]
    fn a_face_with_two_tets_on_one_side_counts_twice_in_the_oriented_boundary_and_not_by_parity() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.2, 2.0]];
        let tets = [[0, 1, 2, 3], [0, 1, 2, 4]];
        let base = oriented_boundary(tets.into_iter()).into_iter().filter(|face| sorted(*face) == [0, 1, 2]).count();
        assert_eq!(base, 2);
        assert!(boundary(&tets, &points).iter().all(|face| sorted(face.corners) != [0, 1, 2]));
    }
}
