//! How far apart the particles of each piece are: what small motions are measured by. A mean over all pieces would let a large
//! one hide what a small one does.

use super::body::SoftBody;
use super::coarse::Layout;
use super::contact::ContactConstraint;

/// For each particle the mean rest length of the springs of its piece, metres; of pieces without springs that of all. Ends
/// are in the solver's order.
pub(super) fn spacings(layout: &Layout, pieces: usize, ends: &[[u32; 2]], lengths: &[f64]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0); pieces];
    for ([end, _], length) in ends.iter().zip(lengths) {
        let (sum, count) = &mut sums[layout.piece_of(*end as usize)];
        (*sum, *count) = (*sum + length, *count + 1);
    }
    let mean = |sum: f64, count: usize| sum / count.max(1) as f64;
    let all = mean(lengths.iter().sum(), lengths.len());
    let of = |piece: usize| if sums[piece].1 > 0 { mean(sums[piece].0, sums[piece].1) } else { all };
    (0..layout.cluster.len()).map(|particle| of(layout.piece_of(particle))).collect()
}

/// The least of the pieces in contact, metres.
pub(super) fn least(body: &SoftBody, contact: &ContactConstraint) -> f64 {
    contact.sides().map(|(particle, _)| body.spacing[particle]).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::body::{Material, Mesh};
    use super::*;
    use crate::tets::cubes;

    #[test]
    fn a_large_piece_does_not_change_the_spacing_of_a_small_one() {
        let material = Material { density: 1000.0.into(), stiffness: 1e4.into(), damping: 0.01.into() };
        let body = |points: &[[f64; 3]], tets: &[[u32; 4]]| {
            SoftBody::new(&Mesh { points, tets, ..Mesh::default() }, &material, &[]).unwrap()
        };
        let (mut points, mut tets) = cubes([2; 3], [0.0; 3], [0.01; 3]);
        let alone = body(&points, &tets).spacing[0];
        let (large, others) = cubes([2; 3], [5.0; 3], [1.0; 3]);
        let first = points.len() as u32;
        points.extend(large);
        tets.extend(others.iter().map(|tet| tet.map(|corner| corner + first)));
        let both = body(&points, &tets);
        let of = |particle: u32| both.spacing[both.order.index_of[particle as usize] as usize];
        assert_eq!(of(0), alone);
        assert!((of(first) / alone - 100.0).abs() < 1e-6);
    }
}
