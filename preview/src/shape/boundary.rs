//! The skin of a set of tets: the faces that only one tet has.
//!
//! Guarantees: faces wind counter-clockwise seen from outside where the tets are positively oriented, in the order of
//! their sorted corners. Limit: a face that three or more tets share is not skin either.

/// A triangle of the skin and the tet it belongs to.
pub(crate) fn boundary(tets: &[[u32; 4]]) -> Vec<([u32; 3], u32)> {
    let mut faces: Vec<([u32; 3], [u32; 3], u32)> = Vec::with_capacity(tets.len() * 4);
    for (tet, [a, b, c, d]) in tets.iter().copied().enumerate() {
        for face in [[a, c, b], [a, b, d], [a, d, c], [b, c, d]] {
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face, tet as u32));
        }
    }
    faces.sort_unstable();
    faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1).map(|same| (same[0].1, same[0].2)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tets_share_one_face_and_show_six() {
        let skin = boundary(&[[0, 1, 2, 3], [1, 2, 3, 4]]);
        assert_eq!(skin.len(), 6);
        let shared = |face: &[u32; 3]| face.iter().all(|corner| (1..=3).contains(corner));
        assert!(!skin.iter().any(|(face, _)| shared(face)));
    }

    #[test]
    fn faces_of_a_positive_tet_look_outwards() {
        let at = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0_f32]];
        for (face, _) in boundary(&[[0, 1, 2, 3]]) {
            use numerics::vector::{cross, dot, sub};
            let [a, b, c] = face.map(|k| at[k as usize]);
            let opposite = at[6 - face.iter().sum::<u32>() as usize];
            assert!(dot(cross(sub(b, a), sub(c, a)), sub(opposite, a)) < 0.0);
        }
    }
}
