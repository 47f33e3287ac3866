//! The order in which the solver keeps a body's particles: bodies that hang together one after the other, within each
//! compact clusters one after the other, so that neighbours lie near each other in memory and a cluster is a range.
//!
//! Clusters come from halving at medians along the longest side, so they are compact and of equal size on any mesh; they
//! follow each other so that those joined by springs are few steps apart, for the coarse matrix's sake.
//! The order hangs on sets alone, never on how a sort orders equals.

use super::partition::Partition;
use numerics::vector::DVec3;
use std::ops::Range;

/// Clusters of a body of n particles: CLUSTERS·n^GROWTH, which keeps the iterations nearly level from 2,000 particles (80 a
/// cluster) to 60,000 (630). Two and three times as many save no iterations under contact.
const CLUSTERS: f64 = 2.0;
const GROWTH: f64 = 0.35;
/// Fewer particles are no cluster: six modes each would be no coarser than the particles.
const SMALLEST: usize = 24;
/// Particles below which halving no longer brings neighbours together.
const LEAF: usize = 8;

/// The particles in the solver's order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Order {
    /// The caller's index of each.
    pub(super) caller_of: Vec<u32>,
    /// Where each of the caller's is.
    pub(super) index_of: Vec<u32>,
    /// Clusters.
    pub(super) clusters: Partition,
    /// Pieces that hang together, as ranges of clusters.
    pub(super) pieces: Vec<Range<usize>>,
}

impl Order {
    /// Of particles at `points`, joined by `springs`.
    pub(super) fn new(points: &[DVec3], springs: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let roots = pieces(points.len(), springs.clone());
        // Pieces by their first particle, particles within by index.
        let mut caller_of: Vec<u32> = (0..points.len() as u32).collect();
        caller_of.sort_by_key(|particle| (roots[*particle as usize], *particle));
        let wanted = CLUSTERS * libm::pow(points.len() as f64, GROWTH);
        let (mut starts, mut ranges, mut first) = (vec![0], Vec::new(), 0);
        while first < caller_of.len() {
            let root = roots[caller_of[first] as usize];
            let count = caller_of[first..].iter().take_while(|particle| roots[**particle as usize] == root).count();
            let share = (wanted * count as f64 / points.len() as f64) as usize;
            let clusters = share.clamp(1, (count / SMALLEST).max(1));
            let before = starts.len() - 1;
            halve(points, &mut caller_of[first..first + count], clusters, first, &mut starts);
            ranges.push(before..starts.len() - 1);
            first += count;
        }
        let (caller_of, starts) = lined_up(&caller_of, &starts, &ranges, springs);
        let mut index_of = vec![0; points.len()];
        for (index, caller) in caller_of.iter().enumerate() {
            index_of[*caller as usize] = index as u32;
        }
        Self { caller_of, index_of, clusters: Partition::new(starts), pieces: ranges }
    }
}

/// `callers`, whose clusters begin at `starts`, with the clusters of each piece in an order in which joined ones are near each
/// other: outwards from one at the piece's end, reversed (Cuthill & McKee 1969).
fn lined_up(
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
        let line = outwards(&joined, piece.start, &mut met);
        // The last of them is at an end, or nearly so.
        let line = outwards(&joined, line[line.len() - 1], &mut met);
        for cluster in line.into_iter().rev() {
            ordered.extend_from_slice(&caller_of[starts[cluster]..starts[cluster + 1]]);
            ends.push(ordered.len());
        }
    }
    (ordered, ends)
}

/// All that hang together with `first`, nearest first, and those with few neighbours before others; `met` is false for all,
/// and is again.
fn outwards(joined: &[Vec<usize>], first: usize, met: &mut [bool]) -> Vec<usize> {
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

/// Orders `particles` and adds where their `clusters` end; `base` is where they begin themselves.
fn halve(points: &[DVec3], particles: &mut [u32], clusters: usize, base: usize, starts: &mut Vec<usize>) {
    let count = particles.len();
    if clusters <= 1 && count <= LEAF {
        particles.sort_unstable();
    } else {
        let middle = if clusters > 1 { count * (clusters / 2) / clusters } else { count / 2 };
        split(points, particles, middle);
        let (left, right) = particles.split_at_mut(middle);
        if clusters > 1 {
            halve(points, left, clusters / 2, base, starts);
            return halve(points, right, clusters - clusters / 2, base + middle, starts);
        }
        let nowhere = &mut Vec::new();
        halve(points, left, 0, base, nowhere);
        halve(points, right, 0, base + middle, nowhere);
    }
    if clusters == 1 {
        starts.push(base + count);
    }
}

/// Brings the `middle` items that come first along the longest side of their box to the front.
pub(super) fn split(points: &[DVec3], items: &mut [u32], middle: usize) {
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

/// The first particle of the piece that each hangs together with.
pub(super) fn pieces(count: usize, springs: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    fn root(parents: &mut [u32], mut particle: u32) -> u32 {
        while parents[particle as usize] != particle {
            parents[particle as usize] = parents[parents[particle as usize] as usize];
            particle = parents[particle as usize];
        }
        particle
    }
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for ends in springs {
        let [a, b] = ends.map(|end| root(&mut parents, end));
        parents[a.max(b) as usize] = a.min(b);
    }
    (0..count as u32).map(|particle| root(&mut parents, particle)).collect()
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
        let order = Order::new(&points, line);
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
    fn pieces_share_no_cluster_and_places_undo_the_order() {
        let points = grid(6);
        // Even particles hang together, odd ones by pairs.
        let even = (2..216).step_by(2).map(|i| [i - 2, i]);
        let pairs = (1..216).step_by(4).map(|i| [i, i + 2]);
        let order = Order::new(&points, even.chain(pairs));
        assert_eq!(order.pieces.len(), 1 + 54);
        for (index, caller) in order.caller_of.iter().enumerate() {
            assert_eq!(order.index_of[*caller as usize] as usize, index);
        }
        let last = order.pieces.last().unwrap().clone();
        assert_eq!(order.clusters.range(last.start).len(), 2);
    }

    #[test]
    fn joined_clusters_are_few_steps_apart() {
        let points: Vec<DVec3> =
            (0..16 * 400).map(|i| DVec3::new(f64::from(i / 16), f64::from(i % 4), f64::from(i / 4 % 4))).collect();
        let springs = (0..points.len() as u32).flat_map(|i| [[i, i + 1], [i, i + 4], [i, i + 16]]);
        let inside = springs.filter(|ends| (ends[1] as usize) < points.len());
        let order = Order::new(&points, inside.clone());
        let cluster = |particle: u32| {
            let index = order.index_of[particle as usize] as usize;
            (0..order.clusters.len()).find(|cluster| order.clusters.range(*cluster).contains(&index)).unwrap()
        };
        assert!(order.clusters.len() > 30);
        assert!(inside.step_by(7).all(|ends| cluster(ends[0]).abs_diff(cluster(ends[1])) <= 1));
    }

    #[test]
    fn no_particle_is_no_cluster() {
        let order = Order::new(&[], std::iter::empty());
        assert_eq!((order.clusters.len(), order.pieces.len()), (0, 0));
    }
}
