//! Where the liquid of each piece went, by the markers that were on it.

use std::collections::BTreeMap;

use crate::markers::NO_PIECE;

/// Liquid of an old piece in a new one, and the markers that say so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Passage {
    pub(super) old: usize,
    pub(super) new: usize,
    pub(super) markers: usize,
}

/// Of the markers of an old piece and of those on a new one, this share of either has to be in both. Fewer are markers
/// between two pieces that nearly touch.
const ENOUGH: usize = 8;
/// Least share of a new piece's volume that is left for old pieces that are in others too.
const LEAST_ROOM: f64 = 1e-3;
/// Volume, in cells, that a piece counts for at least.
const LEAST_VOLUME: f64 = 1e-9;

/// Which old pieces are in which new ones: for each marker, the piece that it was on and the piece that it is on.
pub(super) fn passages(old: &[u32], new: &[u32]) -> Vec<Passage> {
    let known: Vec<(u32, u32)> = old
        .iter()
        .copied()
        .zip(new.iter().copied())
        .filter(|(old, new)| *old != NO_PIECE && *new != NO_PIECE)
        .collect();
    let (mut both, mut of_old, mut of_new) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    // Markers next to each other in the list mostly are on the same piece.
    for run in known.chunk_by(|a, b| a == b) {
        let (old, new) = run[0];
        *both.entry((old, new)).or_insert(0) += run.len();
        *of_old.entry(old).or_insert(0) += run.len();
        *of_new.entry(new).or_insert(0) += run.len();
    }
    let mut most: BTreeMap<u32, usize> = BTreeMap::new();
    for ((old, _), count) in &both {
        let most = most.entry(*old).or_insert(0);
        *most = (*most).max(*count);
    }
    let counts = |(old, new): &(u32, u32), count: usize| {
        ENOUGH * count >= of_old[old] || ENOUGH * count >= of_new[new] || count == most[old]
    };
    let found = both.iter().filter(|(pair, count)| counts(pair, **count));
    found.map(|((old, new), markers)| Passage { old: *old as usize, new: *new as usize, markers: *markers }).collect()
}

/// The targets of new pieces that enclose `volumes`, of which each old target is passed on whole. One that splits is shared
/// by what the new pieces enclose, without what they have from pieces that did not split.
pub(super) fn passed_on(targets: &[f64], passages: &[Passage], volumes: &[f64]) -> Vec<f64> {
    let mut ways = vec![0; targets.len()];
    passages.iter().for_each(|passage| ways[passage.old] += 1);
    let (whole, split): (Vec<&Passage>, Vec<&Passage>) = passages.iter().partition(|passage| ways[passage.old] == 1);
    let mut out = vec![0.0; volumes.len()];
    whole.iter().for_each(|passage| out[passage.new] += targets[passage.old]);
    let mut markers = vec![0; volumes.len()];
    split.iter().for_each(|passage| markers[passage.new] += passage.markers);
    let weights: Vec<f64> = split
        .iter()
        .map(|passage| {
            let volume = volumes[passage.new].max(LEAST_VOLUME);
            let room = (volume - out[passage.new]).max(LEAST_ROOM * volume);
            room * passage.markers as f64 / markers[passage.new] as f64
        })
        .collect();
    let mut sums = vec![0.0; targets.len()];
    for (passage, weight) in split.iter().zip(&weights) {
        sums[passage.old] += weight;
    }
    for (passage, weight) in split.iter().zip(&weights) {
        out[passage.new] += targets[passage.old] * weight / sums[passage.old];
    }
    out
}
