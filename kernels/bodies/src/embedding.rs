//! Embedded points: a fine surface carried by a coarse tet mesh.
//!
//! Each point is bound by barycentric coordinates to the tet that contains it, or to the tet of the nearest face. It
//! follows affine motion of the tets exactly. Limit: a point far outside all tets extrapolates from its tet, which
//! magnifies that tet's deformation.

use crate::tets::{faces_of, sorted};
use numerics::parallel;
use numerics::tree::TriangleTree;
use numerics::vector::{DMat3, DVec3, Vec3, to_f64};

/// Points that a thread binds at a time.
const TASK: usize = 32;

/// Barycentric coordinates of a point: particles and weights, which sum to 1. Unused entries have weight 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmbeddedPoint {
    /// Indices of the particles.
    pub particles: [u32; 4],
    /// Weight of each particle.
    pub weights: [f64; 4],
}

impl EmbeddedPoint {
    /// A point that coincides with one particle.
    pub fn at_particle(particle: u32) -> Self {
        Self { particles: [particle, 0, 0, 0], weights: [1.0, 0.0, 0.0, 0.0] }
    }

    /// The particles that it depends on, with their weights.
    #[inline]
    pub fn sides(&self) -> impl Iterator<Item = (u32, f64)> {
        self.particles.into_iter().zip(self.weights).filter(|(_, weight)| *weight != 0.0)
    }

    /// The point's position for the given particle positions, metres; exact for a point that coincides with a
    /// particle.
    #[inline]
    pub fn position(&self, positions: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (particle, weight) in self.sides() {
            let position = positions[particle as usize];
            (0..3).for_each(|k| sum[k] += position[k] * weight);
        }
        sum
    }
}

/// The positions of particles, followed by those of points that ride along on them, metres.
pub fn with_riding(mut particles: Vec<[f64; 3]>, riding: &[EmbeddedPoint]) -> Vec<[f64; 3]> {
    let count = particles.len();
    particles.resize(count + riding.len(), [0.0; 3]);
    let (particles_only, out) = particles.split_at_mut(count);
    parallel::fill(out, 16 * TASK, |n| riding[n].position(particles_only));
    particles
}

/// Binds the points `carried` to `tets` over `points`; all in metres. `None` if no tet has a volume.
///
/// # Panics
/// If a tet has a corner index out of range.
pub fn embed(points: &[Vec3], tets: &[[u32; 4]], carried: &[Vec3]) -> Option<Vec<EmbeddedPoint>> {
    let solid: Vec<u32> =
        (0..tets.len() as u32).filter(|tet| BarycentricMap::of(points, tets[*tet as usize]).is_some()).collect();
    if solid.is_empty() {
        return None;
    }
    // The segment from a point to the nearest of all faces crosses no face, so that face belongs to the tet that
    // contains the point.
    let faces: Vec<[u32; 3]> = solid.iter().flat_map(|tet| faces_of(&tets[*tet as usize])).collect();
    let tree = TriangleTree::build(points, &faces);
    let mut owners: Vec<([u32; 3], u32)> =
        faces.iter().enumerate().map(|(k, face)| (sorted(*face), solid[k / 4])).collect();
    owners.sort_unstable();
    let bind = |p: &Vec3| {
        let nearest = tree.closest(*p, f32::INFINITY).map_or([0; 3], |found| sorted(faces[found.triangle as usize]));
        let from = owners.partition_point(|owner| owner.0 < nearest);
        let around = owners[from..].iter().take_while(|owner| owner.0 == nearest).map(|owner| owner.1);
        let shares = |tet: u32| Some((tet, BarycentricMap::of(points, tets[tet as usize])?.shares(p)));
        let least = |shares: &[f64; 4]| shares.iter().copied().fold(f64::INFINITY, f64::min);
        let best = around.filter_map(shares).reduce(|a, b| if least(&b.1) > least(&a.1) { b } else { a });
        best.map_or(EmbeddedPoint::at_particle(0), |(tet, weights)| EmbeddedPoint {
            particles: tets[tet as usize],
            weights,
        })
    };
    let mut bound = vec![EmbeddedPoint::at_particle(0); carried.len()];
    parallel::fill(&mut bound, TASK, |n| bind(&carried[n]));
    Some(bound)
}

/// For each position, the nearest corner of the triangle that is nearest to it; the first of `points` without triangles.
///
/// # Panics
/// If a triangle has a corner index out of range.
pub fn nearest_points(points: &[Vec3], triangles: &[[u32; 3]], positions: &[Vec3]) -> Vec<u32> {
    let tree = TriangleTree::build(points, triangles);
    parallel::tabulate(positions.len(), TASK, |n| {
        let Some(found) = tree.closest(positions[n], f32::INFINITY) else { return 0 };
        let distance = |corner: &u32| (to_f64(points[*corner as usize]) - to_f64(positions[n])).norm_squared();
        let corners = triangles[found.triangle as usize];
        corners.into_iter().reduce(|a, b| if distance(&b) < distance(&a) { b } else { a }).unwrap_or(0)
    })
}

/// Maps positions to barycentric coordinates of one tet.
struct BarycentricMap {
    first: DVec3,
    rows: DMat3,
}

impl BarycentricMap {
    /// The map for a tet; `None` if it has no volume.
    fn of(points: &[Vec3], tet: [u32; 4]) -> Option<Self> {
        /// Smallest determinant ÷ product of edge lengths of a tet with a volume: above the rounding of f32
        /// positions.
        const FLAT: f64 = 1e-6;
        let [a, b, c, d] = tet.map(|corner| to_f64(points[corner as usize]));
        let (p, q, r) = (b - a, c - a, d - a);
        let volume = p.dot(&q.cross(&r));
        let solid = volume.abs() > FLAT * p.norm() * q.norm() * r.norm();
        if !solid {
            return None;
        }
        let rows = DMat3::from_rows(&[
            (q.cross(&r) / volume).transpose(),
            (r.cross(&p) / volume).transpose(),
            (p.cross(&q) / volume).transpose(),
        ]);
        Some(Self { first: a, rows })
    }

    fn shares(&self, p: &Vec3) -> [f64; 4] {
        let [b, c, d]: [f64; 3] = (self.rows * (to_f64(*p) - self.first)).into();
        [1.0 - b - c - d, b, c, d]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [Vec3; 5] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
    const TETS: [[u32; 4]; 2] = [[0, 1, 2, 3], [1, 2, 3, 4]];

    #[test]
    fn a_point_is_bound_to_the_tet_that_contains_it() {
        let found = embed(&POINTS, &TETS, &[[0.1, 0.2, 0.3], [0.75, 0.75, 0.75], [0.0, 1.0, 0.0]]).unwrap();
        assert_eq!(found[0].particles, TETS[0]);
        for (share, expected) in found[0].weights.iter().zip([0.4, 0.1, 0.2, 0.3]) {
            assert!((share - expected).abs() < 1e-7);
        }
        assert_eq!(found[1].particles, TETS[1]);
        assert_eq!(found[2].position(&POINTS.map(|p| p.map(f64::from))), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn embedded_points_follow_affine_motion_inside_and_outside_the_tets() {
        let carried = [[0.2, 0.3, 0.1], [0.6, 0.6, 0.7], [-0.5, 0.2, 0.1], [3.0, 3.0, 3.0]];
        let found = embed(&POINTS, &TETS, &carried).unwrap();
        let affine = |p: Vec3| {
            let [x, y, z] = p.map(f64::from);
            [2.0 * x + 0.5 * y + 3.0, y - 0.25 * z - 1.0, 0.5 * z + x]
        };
        let positions = POINTS.map(affine);
        for (carrier, p) in found.iter().zip(carried) {
            let (at, expected) = (carrier.position(&positions), affine(p));
            assert!((0..3).all(|k| (at[k] - expected[k]).abs() < 1e-6), "{at:?}, expected {expected:?}");
        }
    }

    #[test]
    fn nothing_can_be_embedded_in_flat_tets() {
        assert_eq!(embed(&[[0.0; 3]; 4], &[[0, 1, 2, 3]], &[[0.0; 3]]), None);
        assert_eq!(embed(&[], &[], &[]), None);
    }
}
