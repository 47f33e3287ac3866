//! Clumps: curves that move together, as wet or matted fur does.
//!
//! Guarantees: clumps and means depend on the order of the curves alone, not on threads; finite for any finite roots.
//! Limit: clumps found by a radius are cells around some of the roots, about two radii wide at most. Metres.

use numerics::point_tree::PointTree;
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

/// Which curves belong together. Only clumps of two curves and more count.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clumps {
    /// The clump of each curve, or [`ALONE`].
    of_curve: Vec<u32>,
    /// The curves of all clumps, clump by clump, ascending.
    members: Vec<u32>,
    /// Where each clump starts in `members`, and where the last ends.
    starts: Vec<u32>,
}

/// No clump.
const ALONE: u32 = u32::MAX;

impl Clumps {
    /// Curves with equal numbers belong together; those with a number below 0 are alone.
    pub fn of_ids(ids: &[i32]) -> Self {
        let mut known: Vec<i32> = ids.iter().copied().filter(|id| *id >= 0).collect();
        known.sort_unstable();
        known.dedup();
        let label = |id: &i32| known.binary_search(id).map_or(ALONE, |place| place as u32);
        Self::of_labels(ids.iter().map(label).collect(), known.len())
    }

    /// The clumps of roots about as far apart as `radius`: in the order of the curves, a root farther than that from all
    /// centres becomes a centre, and each belongs to the nearest one. Roots that are not finite are alone.
    pub fn within(roots: &[Vec3], radius: f32) -> Self {
        let finite: Vec<u32> =
            (0..roots.len() as u32).filter(|root| roots[*root as usize].iter().all(|x| x.is_finite())).collect();
        let tree = PointTree::new(&finite.iter().map(|root| roots[*root as usize]).collect::<Vec<_>>());
        let mut labels = vec![ALONE; roots.len()];
        let mut nearest = vec![f64::INFINITY; roots.len()];
        let mut centres = 0;
        for root in &finite {
            if labels[*root as usize] != ALONE {
                continue;
            }
            tree.within(roots[*root as usize], f64::from(radius), |found| {
                let other = finite[found.number as usize] as usize;
                if found.square < nearest[other] {
                    (labels[other], nearest[other]) = (centres, found.square);
                }
            });
            centres += 1;
        }
        Self::of_labels(labels, centres as usize)
    }

    /// From a label below `count` for each curve, or [`ALONE`].
    fn of_labels(mut of_curve: Vec<u32>, count: usize) -> Self {
        let mut sizes = vec![0_u32; count];
        of_curve.iter().filter(|label| **label != ALONE).for_each(|label| sizes[*label as usize] += 1);
        let (mut clump, mut starts, mut end) = (vec![ALONE; count], vec![0], 0);
        for (clump, size) in clump.iter_mut().zip(&sizes).filter(|(_, size)| **size > 1) {
            *clump = starts.len() as u32 - 1;
            end += size;
            starts.push(end);
        }
        of_curve.iter_mut().for_each(|label| *label = clump.get(*label as usize).copied().unwrap_or(ALONE));
        let (mut next, mut members) = (starts.clone(), vec![0; end as usize]);
        for (curve, clump) in of_curve.iter().enumerate().filter(|(_, clump)| **clump != ALONE) {
            let next = &mut next[*clump as usize];
            members[*next as usize] = curve as u32;
            *next += 1;
        }
        Self { of_curve, members, starts }
    }

    /// Number of clumps.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether all curves are alone.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The clump of a curve; `None` if it is alone.
    pub fn of(&self, curve: usize) -> Option<usize> {
        Some(self.of_curve[curve]).filter(|clump| *clump != ALONE).map(|clump| clump as usize)
    }

    /// The curves of a clump, ascending.
    pub fn members(&self, clump: usize) -> &[u32] {
        &self.members[self.starts[clump] as usize..self.starts[clump + 1] as usize]
    }

    /// For each curve the mean root of its clump less its own root; zero for a curve that is alone.
    ///
    /// # Panics
    /// If there are fewer roots than curves.
    pub fn to_means(&self, roots: &[Vec3]) -> Vec<DVec3> {
        let mean = |clump: usize| {
            // From the first root, so that nothing is lost far from the origin.
            let members = self.members(clump);
            let first = to_f64(roots[members[0] as usize]);
            let sum: DVec3 = members.iter().map(|curve| to_f64(roots[*curve as usize]) - first).sum();
            first + sum / members.len() as f64
        };
        let means: Vec<DVec3> = (0..self.len()).map(mean).collect();
        let to_mean =
            |curve: usize| self.of(curve).map_or_else(DVec3::zeros, |clump| means[clump] - to_f64(roots[curve]));
        (0..self.of_curve.len()).map(to_mean).collect()
    }
}

/// A point moved by this share (0..1) of a way; its bits where it does not move.
pub fn drawn(point: Vec3, way: &DVec3, share: f32) -> Vec3 {
    let share = if share > 0.0 { f64::from(share.min(1.0)) } else { 0.0 };
    if share == 0.0 || *way == DVec3::zeros() { point } else { to_f32(to_f64(point) + way * share) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::random::Key;

    #[test]
    fn equal_numbers_are_clumps_and_negative_ones_alone() {
        let clumps = Clumps::of_ids(&[7, -1, 3, 7, -1, 3, 900_000, 7]);
        assert_eq!((clumps.len(), clumps.members(0), clumps.members(1)), (2, &[2, 5][..], &[0, 3, 7][..]));
        let of: Vec<_> = (0..8).map(|curve| clumps.of(curve)).collect();
        assert_eq!(of, [Some(1), None, Some(0), Some(1), None, Some(0), None, Some(1)]);
        assert!(Clumps::of_ids(&[]).is_empty() && Clumps::of_ids(&[-5, 1, 2]).is_empty());
    }

    #[test]
    fn roots_join_the_nearest_centre_within_the_radius() {
        // Centres in order: 0 at x = 0, then 1.1 (1 m off is within), not 0.9. 0.9 is nearer to 1.1 than to 0.
        let roots = [0.0, 0.9, 1.1, -0.5, 7.0, f32::NAN].map(|x| [x, 0.0, 0.0]);
        let clumps = Clumps::within(&roots, 1.0);
        assert_eq!((clumps.len(), clumps.members(0), clumps.members(1)), (2, &[0, 3][..], &[1, 2][..]));
        assert_eq!((clumps.of(4), clumps.of(5)), (None, None));
        assert!(Clumps::within(&roots, 1e-30).is_empty());
        assert_eq!(Clumps::within(&roots, f32::MAX).members(0), [0, 1, 2, 3, 4]);
        assert_eq!(Clumps::within(&[[1e30; 3]; 3], 1e-30).members(0), [0, 1, 2], "coincident");
    }

    #[test]
    fn roots_of_a_clump_are_at_most_two_radii_apart_and_each_is_in_one() {
        let roots: Vec<Vec3> = (0..3000_u64).map(|k| [0, 1, 2].map(|axis| Key::new(1).of(k).of(axis).f32())).collect();
        let clumps = Clumps::within(&roots, 0.1);
        assert!(clumps.len() > 100);
        let mut seen = vec![0; roots.len()];
        for clump in 0..clumps.len() {
            let members = clumps.members(clump);
            for member in members {
                let away = |other: &u32| (to_f64(roots[*member as usize]) - to_f64(roots[*other as usize])).norm();
                assert!(members.iter().map(away).fold(0.0, f64::max) <= 0.2 * 1.0001);
                assert_eq!(clumps.of(*member as usize), Some(clump));
                seen[*member as usize] += 1;
            }
        }
        assert!((0..roots.len()).all(|root| seen[root] == i32::from(clumps.of(root).is_some())));
    }

    #[test]
    fn means_are_those_of_the_roots_far_from_the_origin_too() {
        for far in [0.0, 4096.0] {
            let roots = [[far, 0.0, 0.0], [far + 1.0, 0.0, 3.0], [far + 2.0, 0.0, 0.0], [5.0; 3]];
            let ways = Clumps::of_ids(&[0, 0, 0, 1]).to_means(&roots);
            assert_eq!(ways, [[1.0, 0.0, 1.0], [0.0, 0.0, -2.0], [-1.0, 0.0, 1.0], [0.0; 3]].map(DVec3::from));
            assert_eq!(drawn(roots[0], &ways[0], 0.5), [far + 0.5, 0.0, 0.5]);
            assert_eq!(drawn(roots[0], &ways[0], f32::NAN).map(f32::to_bits), roots[0].map(f32::to_bits));
            assert_eq!(drawn([-0.0; 3], &ways[3], 1.0).map(f32::to_bits), [(-0.0_f32).to_bits(); 3]);
        }
    }
}
