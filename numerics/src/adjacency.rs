//! Incident springs of each particle. A spring within a cluster is listed once, at its first end; one between two
//! clusters at both ends. Each cluster can then be computed on its own, and most springs are visited only once.

use crate::partition::Partition;
use std::ops::Range;

/// A spring as seen from one of its ends.
#[derive(Clone, Copy, Debug, Default)]
pub struct Incident {
    /// Its other end.
    pub other: u32,
    /// Index of the spring.
    pub spring: u32,
}

/// The springs of each particle: first those within its cluster to later particles, then all that lead to other
/// clusters.
#[derive(Clone, Debug, Default)]
pub struct Adjacency {
    /// Index of the first entry of each particle, and the number of entries at the end.
    pub starts: Vec<u32>,
    /// Index of the first entry that leads to another cluster.
    middles: Vec<u32>,
    /// The springs of all particles, in order.
    pub incident: Vec<Incident>,
}

impl Adjacency {
    /// The adjacency of springs with these ends.
    pub fn new(clusters: &Partition, ends: &[[u32; 2]]) -> Self {
        let mut cluster = Vec::new();
        for index in 0..clusters.len() {
            cluster.extend(clusters.range(index).map(|_| index));
        }
        let across = |[a, b]: [u32; 2]| cluster[a as usize] != cluster[b as usize];
        let mut all: Vec<(u32, bool, Incident)> = Vec::with_capacity(ends.len() * 5 / 4);
        for (spring, [a, b]) in ends.iter().enumerate() {
            let (first, second) = (*a.min(b), *a.max(b));
            let spring = spring as u32;
            all.push((first, across([first, second]), Incident { other: second, spring }));
            if across([first, second]) {
                all.push((second, true, Incident { other: first, spring }));
            }
        }
        all.sort_unstable_by_key(|(particle, across, incident)| (*particle, *across, incident.other, incident.spring));
        let begin = |particle: usize, across: bool| {
            all.partition_point(|known| (known.0 as usize, known.1) < (particle, across)) as u32
        };
        Self {
            starts: (0..=cluster.len()).map(|particle| begin(particle, false)).collect(),
            middles: (0..cluster.len()).map(|particle| begin(particle, true)).collect(),
            incident: all.into_iter().map(|known| known.2).collect(),
        }
    }

    /// Splits `all`, which has one element for each entry, into those of `particle` within its cluster and those to
    /// other clusters.
    #[inline(always)]
    pub fn of<'a, T>(&self, particle: usize, all: &'a [T]) -> [&'a [T]; 2] {
        let [start, middle, end] =
            [self.starts[particle], self.middles[particle], self.starts[particle + 1]].map(|at| at as usize);
        [&all[start..middle], &all[middle..end]]
    }

    /// [`Self::of`] for each of some `particles`.
    #[inline(always)]
    pub fn each<'a, T>(&'a self, particles: Range<usize>, all: &'a [T]) -> impl Iterator<Item = [&'a [T]; 2]> {
        let starts = &self.starts[particles.start..=particles.end];
        let mut left = &all[starts[0] as usize..];
        starts.windows(2).zip(&self.middles[particles]).map(move |(ends, middle)| {
            let (inside, others) = left.split_at((middle - ends[0]) as usize);
            let (across, others) = others.split_at((ends[1] - middle) as usize);
            left = others;
            [inside, across]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_is_listed_once_within_a_cluster_and_twice_between_clusters() {
        let clusters = Partition::new(vec![0, 3, 5]);
        let adjacency = Adjacency::new(&clusters, &[[1, 0], [3, 1], [1, 2], [4, 3], [0, 4]]);
        let others = |particle| {
            adjacency
                .of(particle, &adjacency.incident)
                .map(|some| some.iter().map(|incident| incident.other).collect::<Vec<_>>())
        };
        let each: Vec<_> = adjacency.each(1..4, &adjacency.incident).collect();
        for (particle, each) in (1..4).zip(each) {
            let all = adjacency.of(particle, &adjacency.incident);
            assert!(each.iter().zip(all).all(|(each, all)| std::ptr::eq(*each, all)), "{particle}");
        }
        assert_eq!(others(0), [vec![1], vec![4]]);
        assert_eq!(others(1), [vec![2], vec![3]]);
        assert_eq!(others(2), [vec![], vec![]]);
        assert_eq!(others(3), [vec![4], vec![1]]);
        assert_eq!(others(4), [vec![], vec![0]]);
        assert_eq!(adjacency.incident[0].spring, 0);
    }
}
