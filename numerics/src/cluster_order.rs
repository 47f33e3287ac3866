//! An order of particles for solvers: piece by piece and, within a piece, cluster by cluster, so that neighbours are
//! near each other in memory and a cluster is a range of indices.
//!
//! Clusters come from recursive median splits along the longest side, which makes them compact and of equal size on
//! any mesh. They are ordered so that coupled clusters have near indices, for the envelope of the coarse matrix. The
//! result does not depend on how a sort orders equal keys.

use crate::partition::Partition;
use crate::pieces::pieces;
use crate::vector::DVec3;
use std::ops::Range;

/// A body of n particles has CLUSTERS·n^GROWTH clusters. That keeps the number of iterations nearly constant from
/// 2,000 particles (80 a cluster) to 60,000 (630). Two or three times as many save no iterations under contact.
const CLUSTERS: f64 = 2.0;
const GROWTH: f64 = 0.35;
/// Smallest cluster: with six modes each, smaller ones would be no coarser than the particles.
const SMALLEST: usize = 24;
/// Sets of particles smaller than this are not split any further for locality.
const LEAF: usize = 8;

/// The solver's order.
#[derive(Clone, Debug, PartialEq)]
pub struct ClusterOrder {
    /// The caller's index of each particle.
    pub caller_of: Vec<u32>,
    /// The solver's index for each of the caller's.
    pub index_of: Vec<u32>,
    /// Clusters, as ranges of particles.
    pub clusters: Partition,
    /// Connected components, as ranges of clusters.
    pub pieces: Vec<Range<usize>>,
}

impl ClusterOrder {
    /// The order for particles at `points`, joined by `springs`.
    pub fn new(points: &[DVec3], springs: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let roots = pieces(points.len(), springs.clone());
        let wanted = CLUSTERS * libm::pow(points.len() as f64, GROWTH);
        let clusters = |count: usize| {
            let share = (wanted * count as f64 / points.len() as f64) as usize;
            share.clamp(1, (count / SMALLEST).max(1))
        };
        let CompactSets { items, starts, groups } = CompactSets::new(points, &roots, LEAF, clusters);
        let (caller_of, starts) = reordered(&items, &starts, &groups, springs);
        let mut index_of = vec![0; points.len()];
        for (index, caller) in caller_of.iter().enumerate() {
            index_of[*caller as usize] = index as u32;
        }
        Self { caller_of, index_of, clusters: Partition::new(starts), pieces: groups }
    }
}

/// Reorders the clusters of each piece by reverse Cuthill–McKee (1969), so that coupled ones have near indices.
/// `caller_of` lists the particles cluster by cluster, and clusters begin at `starts`.
fn reordered(
    caller_of: &[u32],
    starts: &[usize],
    pieces: &[Range<usize>],
    springs: impl Iterator<Item = [u32; 2]>,
) -> (Vec<u32>, Vec<usize>) {
    let mut cluster = vec![0; caller_of.len()];
    for (index, ends) in starts.windows(2).enumerate() {
        caller_of[ends[0]..ends[1]].iter().for_each(|caller| cluster[*caller as usize] = index);
    }
    let mut joined = vec![Vec::new(); starts.len() - 1];
    for ends in springs {
        let [a, b] = ends.map(|end| cluster[end as usize]);
        if a != b {
            joined[a].push(b);
            joined[b].push(a);
        }
    }
    for others in &mut joined {
        others.sort_unstable();
        others.dedup();
    }
    let (mut ordered, mut ends) = (Vec::with_capacity(caller_of.len()), vec![0]);
    let mut met = vec![false; joined.len()];
    for piece in pieces {
        let line = breadth_first(&joined, piece.start, &mut met);
        // The last cluster reached is a peripheral one, or nearly so.
        let line = breadth_first(&joined, line[line.len() - 1], &mut met);
        for cluster in line.into_iter().rev() {
            ordered.extend_from_slice(&caller_of[starts[cluster]..starts[cluster + 1]]);
            ends.push(ordered.len());
        }
    }
    (ordered, ends)
}

/// All clusters connected with `first` in breadth-first order, those with few neighbours first; `met` must be all
/// false, and is again on return.
fn breadth_first(joined: &[Vec<usize>], first: usize, met: &mut [bool]) -> Vec<usize> {
    let (mut line, mut next) = (vec![first], 0);
    met[first] = true;
    while next < line.len() {
        let begin = line.len();
        for other in &joined[line[next]] {
            if !std::mem::replace(&mut met[*other], true) {
                line.push(*other);
            }
        }
        line[begin..].sort_by_key(|cluster| (joined[*cluster].len(), *cluster));
        next += 1;
    }
    line.iter().for_each(|cluster| met[*cluster] = false);
    line
}

/// Items in compact sets of equal size, by recursive median splits.
pub struct CompactSets {
    /// The items, set by set.
    pub items: Vec<u32>,
    /// Start of each set among them, and the end of the last.
    pub starts: Vec<usize>,
    /// The sets of each group.
    pub groups: Vec<Range<usize>>,
}

impl CompactSets {
    /// The items at `points`, group by group, and each group in as many sets, one or more, as `sets` gives for its size. Groups
    /// have different `roots`, and are in their order. Further splits order what is in sets of more than `leaf` items;
    /// others are in order.
    pub fn new(points: &[DVec3], roots: &[u32], leaf: usize, sets: impl Fn(usize) -> usize) -> Self {
        let mut items: Vec<u32> = (0..points.len() as u32).collect();
        items.sort_by_key(|item| (roots[*item as usize], *item));
        let (mut starts, mut groups, mut first) = (vec![0], Vec::new(), 0);
        for group in items.chunk_by_mut(|a, b| roots[*a as usize] == roots[*b as usize]) {
            let before = starts.len() - 1;
            halve(points, group, (sets(group.len()), leaf), first, &mut starts);
            groups.push(before..starts.len() - 1);
            first += group.len();
        }
        Self { items, starts, groups }
    }
}

/// Orders `items` and appends the ends of their `sets` to `starts`; `base` is the index of the first item.
fn halve(points: &[DVec3], items: &mut [u32], (sets, leaf): (usize, usize), base: usize, starts: &mut Vec<usize>) {
    let count = items.len();
    if sets <= 1 && count <= leaf {
        items.sort_unstable();
    } else {
        let middle = if sets > 1 { count * (sets / 2) / sets } else { count / 2 };
        split(points, items, middle);
        let (left, right) = items.split_at_mut(middle);
        if sets > 1 {
            halve(points, left, (sets / 2, leaf), base, starts);
            return halve(points, right, (sets - sets / 2, leaf), base + middle, starts);
        }
        let nowhere = &mut Vec::new();
        halve(points, left, (0, leaf), base, nowhere);
        halve(points, right, (0, leaf), base + middle, nowhere);
    }
    if sets == 1 {
        starts.push(base + count);
    }
}

/// Partitions `items` so that the `middle` lowest along the longest side of their bounding box come first.
fn split(points: &[DVec3], items: &mut [u32], middle: usize) {
    let mut low = DVec3::repeat(f64::INFINITY);
    let mut high = -low;
    for item in items.iter() {
        low = low.inf(&points[*item as usize]);
        high = high.sup(&points[*item as usize]);
    }
    let axis = (high - low).imax();
    if middle > 0 && middle < items.len() {
        items.select_nth_unstable_by(middle, |a, b| {
            points[*a as usize][axis].total_cmp(&points[*b as usize][axis]).then(a.cmp(b))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: u32) -> Vec<DVec3> {
        (0..side * side * side)
            .map(|i| DVec3::new(f64::from(i % side), f64::from(i / side % side), f64::from(i / side / side)))
            .collect()
    }

    #[test]
    fn clusters_are_compact_and_of_equal_size() {
        let points = grid(16);
        let line = (1..points.len() as u32).map(|i| [i - 1, i]);
        let order = ClusterOrder::new(&points, line);
        assert_eq!(order.pieces.len(), 1);
        let clusters = &order.clusters;
        assert!((30..45).contains(&clusters.len()), "{} clusters", clusters.len());
        for cluster in 0..clusters.len() {
            let range = clusters.range(cluster);
            assert!((90..150).contains(&range.len()), "{} particles", range.len());
            let members = || order.caller_of[range.clone()].iter().map(|particle| points[*particle as usize]);
            let high = members().fold(DVec3::repeat(-1e9), |high, p| high.sup(&p));
            let low = members().fold(DVec3::repeat(1e9), |low, p| low.inf(&p));
            assert!((high - low).max() <= 8.0, "a cluster as long as {}", (high - low).max());
        }
    }

    #[test]
    fn pieces_share_no_cluster_and_both_index_maps_are_inverse() {
        let points = grid(6);
        // Even particles are all connected, odd ones in pairs.
        let even = (2..216).step_by(2).map(|i| [i - 2, i]);
        let pairs = (1..216).step_by(4).map(|i| [i, i + 2]);
        let order = ClusterOrder::new(&points, even.chain(pairs));
        assert_eq!(order.pieces.len(), 1 + 54);
        for (index, caller) in order.caller_of.iter().enumerate() {
            assert_eq!(order.index_of[*caller as usize] as usize, index);
        }
        let last = order.pieces.last().unwrap().clone();
        assert_eq!(order.clusters.range(last.start).len(), 2);
    }

    #[test]
    fn coupled_clusters_have_near_indices() {
        let points: Vec<DVec3> =
            (0..16 * 400).map(|i| DVec3::new(f64::from(i / 16), f64::from(i % 4), f64::from(i / 4 % 4))).collect();
        let springs = (0..points.len() as u32).flat_map(|i| [[i, i + 1], [i, i + 4], [i, i + 16]]);
        let inside = springs.filter(|ends| (ends[1] as usize) < points.len());
        let order = ClusterOrder::new(&points, inside.clone());
        let cluster = |particle: u32| {
            let index = order.index_of[particle as usize] as usize;
            (0..order.clusters.len()).find(|cluster| order.clusters.range(*cluster).contains(&index)).unwrap()
        };
        assert!(order.clusters.len() > 30);
        assert!(inside.step_by(7).all(|ends| cluster(ends[0]).abs_diff(cluster(ends[1])) <= 1));
    }

    #[test]
    fn an_empty_body_has_no_clusters() {
        let order = ClusterOrder::new(&[], std::iter::empty());
        assert_eq!((order.clusters.len(), order.pieces.len()), (0, 0));
    }
}
