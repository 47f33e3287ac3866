//! The surface of tets: faces that only one tet has.

/// Corners of each face of a positively oriented tet, counter-clockwise from outside.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Faces that belong to one tet only, in the order of the tets, counter-clockwise from outside.
pub(super) fn surface(tets: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let face = |face_index: usize| FACES[face_index % 4].map(|corner| tets[face_index / 4][corner]);
    let mut shared: Vec<([u32; 3], usize)> = (0..tets.len() * 4)
        .map(|face_index| {
            let mut corners = face(face_index);
            corners.sort_unstable();
            (corners, face_index)
        })
        .collect();
    shared.sort_unstable();
    let alone = shared.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
    let mut indices: Vec<usize> = alone.map(|same| same[0].1).collect();
    indices.sort_unstable();
    indices.into_iter().map(face).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::vector::{cross, dot, sub};

    #[test]
    fn all_faces_of_one_tet_look_outwards() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0_f32]];
        let faces = surface(&[[0, 1, 2, 3]]);
        assert_eq!(faces, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]);
        for face in faces {
            let [a, b, c] = face.map(|corner| corners[corner as usize]);
            let normal = cross(sub(b, a), sub(c, a));
            assert!(dot(normal, sub(a, [0.25; 3])) > 0.0, "{face:?}");
        }
    }

    #[test]
    fn a_face_between_two_tets_is_not_on_the_surface() {
        let faces = surface(&[[0, 1, 2, 3], [1, 2, 3, 4]]);
        assert_eq!(faces.len(), 6);
        assert!(!faces.iter().any(|face| face.iter().all(|corner| [1, 2, 3].contains(corner))));
        assert!(surface(&[]).is_empty());
    }
}
