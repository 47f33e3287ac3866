//! Where the liquid of each piece went, by the markers that were on it.

use std::collections::BTreeMap;
use std::mem::take;

use numerics::parallel;
use numerics::vector::{add, length, scale, sub};

use super::pieces::Pieces;
use super::{BESIDE, Change, LostPiece, PieceTarget, VolumeTargets};
use crate::carried::PhaseShares;
use crate::level_set::{Distance, floor};
use crate::marked::MarkedSurface;
use crate::markers::NO_PIECE;

/// Liquid of an old piece in a new one, and the markers that say so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Passage {
    old: usize,
    new: usize,
    markers: usize,
}

/// Of the markers of an old piece and of those on a new one, this share of either has to be in both. Fewer are markers
/// between two pieces that nearly touch.
const ENOUGH: usize = 8;
/// Least share of a new piece's volume that is left for old pieces that are in others too.
const LEAST_ROOM: f64 = 1e-3;
/// Distance, in surface cells, up to which a place is in a piece.
const HERE: f32 = 1.0;
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
/// by what the new pieces enclose, without what they have from pieces that did not split. `least`: what each counts for at
/// least.
pub(super) fn passed_on(targets: &[f64], passages: &[Passage], volumes: &[f64], least: f64) -> Vec<f64> {
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
            let volume = volumes[passage.new].max(least);
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

impl VolumeTargets {
    /// Finds the pieces and passes the targets on to them; returns them and the old ones that are in none.
    pub(super) fn follow(
        &mut self,
        surface: &mut MarkedSurface,
        solid: Option<&Distance<'_>>,
        phases: Option<&PhaseShares>,
    ) -> (Pieces, Vec<LostPiece>) {
        let found = Pieces::new(surface, solid, phases);
        let now = marked(surface, &found);
        let (unit, size) = (self.unit(surface), surface.resolution() as f32);
        let mut passages = passages(surface.markers().pieces(), &now);
        self.keep_unmarked(surface, &found, &mut passages);
        let unknown = self.newcomers(surface, &found, &mut passages);
        self.take_before_they_split(&found, unit, size, &passages);
        let shares = |phase: usize| {
            let targets: Vec<f64> = self.pieces.iter().map(|piece| piece.of_phase(phase)).collect();
            let volumes: Vec<f64> = (0..found.all.len()).map(|piece| unit * found.volume_of(piece, phase)).collect();
            passed_on(&targets, &passages, &volumes, LEAST_VOLUME * unit)
        };
        let mut shares: Vec<Vec<f64>> = (0..self.phases().max(found.phases.count())).map(shares).collect();
        let mut is_lost = vec![true; self.pieces.len()];
        passages.iter().for_each(|passage| is_lost[passage.old] = false);
        let mut lost = self.lost(surface, &is_lost);
        let volumes: Vec<f64> = found.all.iter().map(|piece| unit * piece.volume).collect();
        find_again(&unknown, &volumes, &mut lost, &mut shares);
        self.apply(&found, unit, &mut shares, &mut lost, size);
        let on_lost = |old: &u32| is_lost.get(*old as usize).is_some_and(|is_lost| *is_lost);
        let drop: Vec<bool> = surface.markers().pieces().iter().map(on_lost).collect();
        surface.markers_mut().set_pieces(now);
        if drop.contains(&true) {
            // φ must not be made from them again.
            surface.markers_mut().retain(|n| !drop[n]);
        }
        self.set(surface, &found, shares);
        lost.retain(|piece| piece.volume > 0.0);
        (found, lost)
    }

    /// Adds passages for old pieces that no marker was on. Some fill all that holds them and have no surface to mark: to such a
    /// piece where they were, at most as far off as they are large. Of others a source has replaced all of the surface: to the
    /// piece that is where they were, if liquid came there and all of its markers are new.
    fn keep_unmarked(&self, surface: &MarkedSurface, found: &Pieces, passages: &mut Vec<Passage>) {
        let (unit, size) = (self.unit(surface), surface.resolution() as f32);
        let mut is_marked = vec![false; self.pieces.len()];
        for old in surface.markers().pieces().iter().filter(|old| **old != NO_PIECE) {
            is_marked[*old as usize] = true;
        }
        let mut is_new = self.added_to(found, size);
        passages.iter().for_each(|passage| is_new[passage.new] = false);
        for (old, piece) in self.pieces.iter().enumerate().filter(|(old, _)| !is_marked[*old]) {
            let Some((new, away)) = found.closest(scale(piece.place, size)) else { continue };
            let fills_all = found.all[new].area <= 0.0 && f64::from(away) <= libm::cbrt(piece.measured / unit);
            let is_renewed = is_new[new] && away < HERE;
            if fills_all || is_renewed {
                passages.push(Passage { old, new, markers: 1 });
            }
        }
    }

    /// Whether liquid came beside each piece. `size`: surface cells along the side of a solver cell.
    fn added_to(&self, found: &Pieces, size: f32) -> Vec<bool> {
        let mut is_added = vec![false; found.all.len()];
        for change in self.changes.iter().filter(|change| change.volume > 0.0) {
            let closest = change.at.and_then(|at| found.closest(scale(at, size)));
            if let Some((piece, _)) = closest.filter(|(_, distance)| *distance < BESIDE) {
                is_added[piece] = true;
            }
        }
        is_added
    }

    /// Adds passages for pieces that no marker was on: from the piece that most markers around were on. Returns those that
    /// are of unknown origin. Pieces beside which something was added need none.
    fn newcomers(&self, surface: &MarkedSurface, found: &Pieces, passages: &mut Vec<Passage>) -> Vec<usize> {
        let size = surface.resolution() as f32;
        let mut has_origin = vec![false; found.all.len()];
        passages.iter().for_each(|passage| has_origin[passage.new] = true);
        self.added_to(found, size).iter().zip(&mut has_origin).for_each(|(is_added, has)| *has |= is_added);
        let mut unknown = Vec::new();
        for new in (0..found.all.len()).filter(|piece| !has_origin[*piece]) {
            let around = found.cells_around(new, BESIDE as i32);
            let mut votes = vec![0; self.pieces.len()];
            let markers = surface.markers();
            let Some((low, high)) = around.bounds() else { continue };
            for (marker, old) in markers.markers.iter().zip(markers.pieces()).filter(|(_, old)| **old != NO_PIECE) {
                let cell = marker.point.map(floor);
                let is_near = (0..3).all(|axis| low[axis] <= cell[axis] && cell[axis] < high[axis]);
                votes[*old as usize] += usize::from(is_near && around.find(cell).is_some());
            }
            let voted = (0..votes.len()).rev().max_by_key(|old| votes[*old]).filter(|old| votes[*old] > 0);
            match voted.or_else(|| self.where_it_is(found, new)) {
                Some(old) => passages.push(Passage { old, new, markers: 1 }),
                None => unknown.push(new),
            }
        }
        unknown
    }

    /// The old piece that most cells of a new one were of, where that is half of them or more.
    fn where_it_is(&self, found: &Pieces, new: usize) -> Option<usize> {
        let cells = found.cells_of(new);
        let mut shared = vec![0_usize; self.pieces.len()];
        for old in cells.iter().filter_map(|cell| self.cells.of_cell(*cell)) {
            shared[old as usize] += 1;
        }
        (0..shared.len()).rev().max_by_key(|old| shared[*old]).filter(|old| 2 * shared[*old] >= cells.len().max(1))
    }

    /// Takes what went from an old piece that is now several, or none, before its target is passed on: which of them it would
    /// have been taken from is chance.
    fn take_before_they_split(&mut self, found: &Pieces, unit: f64, size: f32, passages: &[Passage]) {
        let mut ways = vec![0; self.pieces.len()];
        passages.iter().for_each(|passage| ways[passage.old] += 1);
        let Self { pieces, cells, changes, .. } = self;
        for change in changes.iter_mut().filter(|change| change.volume < 0.0) {
            let Some(at) = change.at else { continue };
            let Some(old) = cells.of_cell(scale(at, size).map(floor)).map(|old| old as usize) else { continue };
            if ways[old] != 1 {
                let parts = || passages.iter().filter(|passage| passage.old == old);
                let there = |phase| parts().fold(0.0, |sum, part| sum + unit * found.volume_of(part.new, phase));
                let mut own: Vec<&mut f64> = pieces[old].phases.iter_mut().collect();
                change.volume = take_from(&mut own, there, change.volume);
            }
        }
        changes.retain(|change| change.volume != 0.0);
    }

    /// The old pieces that are in no new one, where their markers are now.
    fn lost(&self, surface: &MarkedSurface, is_lost: &[bool]) -> Vec<LostPiece> {
        let size = 1.0 / surface.resolution() as f32;
        let markers = surface.markers();
        let lost = |(old, piece): (usize, &PieceTarget)| {
            let own = markers.markers.iter().zip(markers.pieces()).filter(|(_, of)| **of as usize == old);
            let (sum, count) = own.fold(([0.0; 3], 0.0), |(sum, n), (marker, _)| (add(sum, marker.point), n + 1.0));
            let place = if count > 0.0 { scale(sum, size / count) } else { piece.place };
            piece.lost(place).collect::<Vec<_>>()
        };
        self.pieces.iter().enumerate().filter(|(old, _)| is_lost[*old]).flat_map(lost).collect()
    }

    /// Adds what came and takes what went, also from pieces that vanished where it went.
    fn apply(&mut self, found: &Pieces, unit: f64, shares: &mut [Vec<f64>], lost: &mut [LostPiece], size: f32) {
        let mut everywhere = 0.0;
        for change in take(&mut self.changes) {
            let Some(at) = change.at else {
                everywhere += change.volume;
                continue;
            };
            let closest = found.closest(scale(at, size));
            let away = closest.map_or(f32::INFINITY, |(_, distance)| distance / size);
            let vanished = lost.iter_mut().find(|piece| length(sub(piece.place, at)) < away);
            match (vanished, closest) {
                (Some(piece), _) if change.volume < 0.0 => everywhere += change_by(&mut piece.volume, change.volume),
                (_, Some((piece, _))) if change.volume < 0.0 => {
                    let there = |phase| unit * found.volume_of(piece, phase);
                    let mut own: Vec<&mut f64> = shares.iter_mut().map(|phase| &mut phase[piece]).collect();
                    everywhere += take_from(&mut own, there, change.volume);
                }
                (_, Some((piece, distance))) if distance < BESIDE => {
                    shares[change.phase as usize][piece] += change.volume
                }
                _ => self.changes.push(change),
            }
        }
        let sum = shares.iter().flatten().fold(0.0, |sum, share| sum + share);
        let spread = if sum > 0.0 { everywhere.max(-sum) } else { 0.0 };
        if spread != 0.0 {
            shares.iter_mut().flatten().for_each(|share| *share *= 1.0 + spread / sum);
        }
        if spread != everywhere {
            self.changes.push(Change { volume: everywhere - spread, phase: 0, at: None });
        }
    }
}

/// Takes from the phases of a piece, m³, given how much of each is there: those first of which less is there than should be.
/// `volume` is negative; returns what could not be taken.
pub(super) fn take_from(phases: &mut [&mut f64], there: impl Fn(usize) -> f64, volume: f64) -> f64 {
    if let [only] = phases {
        return change_by(only, volume);
    }
    let missing: Vec<f64> =
        phases.iter().enumerate().map(|(n, phase)| (**phase - there(n)).clamp(0.0, **phase)).collect();
    let sum = missing.iter().fold(0.0, |sum, missing| sum + missing);
    let share = if sum > 0.0 { (-volume / sum).min(1.0) } else { 0.0 };
    phases.iter_mut().zip(&missing).for_each(|(phase, missing)| **phase -= share * missing);
    let rest = volume + share * sum;
    let left = phases.iter().fold(0.0, |sum, phase| sum + **phase);
    let share = if left > 0.0 { (-rest / left).min(1.0) } else { 0.0 };
    phases.iter_mut().for_each(|phase| **phase *= 1.0 - share);
    (rest + share * left).min(0.0)
}

/// Gives pieces of unknown origin what was lost elsewhere, up to their volumes: liquid that was too fast to be followed. What
/// is more than that is nobody's, and correction takes it away.
pub(super) fn find_again(unknown: &[usize], volumes: &[f64], lost: &mut [LostPiece], shares: &mut [Vec<f64>]) {
    for piece in unknown {
        for lost in lost.iter_mut() {
            let held = shares.iter().fold(0.0, |sum, phase| sum + phase[*piece]);
            let found = lost.volume.min(volumes[*piece] - held);
            lost.volume -= found;
            shares[lost.phase as usize][*piece] += found;
        }
    }
}

/// Adds to a volume, which stays at 0 or above; returns what could not be taken from it.
fn change_by(volume: &mut f64, by: f64) -> f64 {
    let sum = *volume + by;
    *volume = sum.max(0.0);
    sum.min(0.0)
}

/// The piece of each marker.
pub(super) fn marked(surface: &MarkedSurface, found: &Pieces) -> Vec<u32> {
    let markers = &surface.markers().markers;
    parallel::tabulate(markers.len(), parallel::CHUNK, |n| found.of_marker(&markers[n]))
}
