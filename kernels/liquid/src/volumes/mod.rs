//! The volume of each piece of a liquid, kept: how much it should have follows it where it splits and merges, and its
//! surface is moved until the mesh encloses that.
//!
//! A piece is liquid that the mesh does not part; bubbles belong to the piece around them. Markers tell where its liquid
//! went: pieces that merge add up their targets, and one that splits shares its target by what the parts enclose. A piece
//! that got too small for the grid is lost, with its target, to whoever carries it on.
//!
//! Promise: targets, lost pieces and what waits to be added make up all that there was at the start and was added since;
//! a piece within [`LEAST_ERROR`] of its target is not touched; no surface moves farther in a frame than [`cap`] says; the
//! bits are the same on any number of threads. Limit: liquid that goes from one piece to another and parts again within a frame
//! is not noticed.

mod follow;
mod pieces;
#[cfg(test)]
mod tests;

use std::mem::take;

use numerics::parallel;
use numerics::vector::{Vec3, add, length, scale, sub};
use serde::{Deserialize, Serialize};

use crate::level_set::Distance;
use crate::level_set::floor;
use crate::marked::MarkedSurface;
use crate::markers::NO_PIECE;
use crate::rows::CellRows;
use follow::{Passage, passages, passed_on};
use pieces::{Measured, Pieces};

/// Error of a piece's volume ÷ its target up to which its surface stays.
pub const LEAST_ERROR: f64 = 1e-5;
/// The farthest that the surface of a liquid at rest is moved in a frame, in solver cells.
pub const CAP: f64 = 0.1;
/// Share of the way of the fastest liquid in a frame up to which its surface is moved besides, and the farthest, in solver
/// cells. What moves by cells in a frame loses more at once than [`CAP`] gives back, and hides a larger move.
const OF_WAY: f64 = 0.1;
const FARTHEST: f64 = 0.5;
/// The farthest that a surface is moved in a frame, in its own cells: in the first move half of it, which φ follows.
const OWN_CAP: f64 = 1.0;
/// Times that a surface is moved in a frame, at most, each at most half as far as the one before.
const PASSES: u32 = 8;
/// Moves after which it is enough that the errors of all pieces sum up to [`CLOSE`] of the volume.
const FIRST_PASSES: u32 = 2;
/// Share of the volume that may be wrong after them: a twentieth of what a frame is to be kept to.
const CLOSE: f64 = 5e-5;
/// Share of a known volume from which on what cells round off is given back: edges, which faces that move make up for; a ball
/// of three cells radius stays as it is.
const ROUNDED: f64 = 0.04;
/// Frames' worth of moves that the surface of the start may take to enclose a known volume.
const START_MOVES: u32 = 3;
/// Distance, in surface cells, from which liquid that is added belongs to no piece.
const BESIDE: f32 = 4.0;

/// How much a piece should enclose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PieceTarget {
    /// m³.
    pub volume: f64,
    /// What its mesh enclosed when it was last measured, m³.
    pub measured: f64,
    /// The mean of its cells then, in solver cells.
    pub place: Vec3,
}

/// A piece that the grid no longer shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LostPiece {
    /// Its target, m³.
    pub volume: f64,
    /// Where it was last seen, in solver cells.
    pub place: Vec3,
}

/// Liquid that came or went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Change {
    /// m³.
    volume: f64,
    /// In solver cells; everywhere where `None`.
    at: Option<Vec3>,
}

/// Part of a liquid at the start.
#[derive(Clone, Debug)]
pub struct StartPart {
    /// The surface cells inside it.
    pub inside: CellRows,
    /// m³; `None` where walls, solids or other parts may take from it.
    pub volume: Option<f64>,
}

/// What a frame's correction found and left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeReport {
    /// Volume of the mesh, m³.
    pub volume: f64,
    /// The targets of all pieces, m³.
    pub target: f64,
    /// Error of the volume ÷ target.
    pub drift: f64,
    /// What the drift would be if no surface had ever been moved here.
    pub raw_drift: f64,
    /// What moving surfaces has added since the start, m³.
    pub corrected: f64,
    /// What it added now, m³.
    pub corrected_now: f64,
    /// Pieces.
    pub pieces: usize,
    /// The largest error of a piece's volume, m³.
    pub worst: f64,
    /// The farthest that a surface was moved, in solver cells.
    pub moved: f64,
    /// Pieces that vanished.
    pub lost: Vec<LostPiece>,
}

/// How much each piece of a liquid should enclose. Kept exactly by any format that keeps numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VolumeTargets {
    /// The side of a solver cell, m.
    cell: f64,
    pieces: Vec<PieceTarget>,
    changes: Vec<Change>,
    /// What moving surfaces has added so far, m³.
    corrected: f64,
}

impl VolumeTargets {
    /// Targets that are what each piece of a surface encloses outside a solid. `cell` is the side of a solver cell, m.
    pub fn new(surface: &mut MarkedSurface, cell: f64, solid: Option<&Distance<'_>>) -> Self {
        Self::of_parts(surface, cell, solid, &[])
    }

    /// The same, but a piece of which all parts are known has their volume, where cells round off much of it, and its surface
    /// is moved so that it encloses that.
    pub fn of_parts(surface: &mut MarkedSurface, cell: f64, solid: Option<&Distance<'_>>, parts: &[StartPart]) -> Self {
        let found = Pieces::new(surface, solid);
        let now = marked(surface, &found);
        surface.markers_mut().set_pieces(now);
        let mut targets = Self { cell, pieces: Vec::new(), changes: Vec::new(), corrected: 0.0 };
        let unit = targets.unit(surface);
        let is_off = |seen: f64, known: f64| (unit * seen / known - 1.0).abs() > ROUNDED;
        let known: Vec<Option<f64>> = known_volumes(&found, parts)
            .into_iter()
            .zip(&found.all)
            .map(|(known, piece)| known.filter(|known| is_off(piece.volume, *known)))
            .collect();
        let most = if known.iter().any(Option::is_some) { START_MOVES } else { 0 };
        let volumes = found.all.iter().zip(known).map(|(piece, known)| known.unwrap_or(unit * piece.volume));
        targets.set(surface, &found, volumes);
        for _ in 0..most {
            if targets.is_close() {
                break;
            }
            targets.correct(surface, solid);
        }
        // What cells round off at the start is no drift.
        targets.corrected = 0.0;
        targets
    }

    /// Adds to what pieces should enclose, or takes from it where `volume`, m³, is negative: that of the piece around a
    /// place in solver cells, or of all pieces in proportion. Counts from the next correction on. What is added far from
    /// any piece waits for one.
    pub fn add(&mut self, volume: f64, at: Option<Vec3>) {
        self.changes.push(Change { volume, at });
    }

    /// The pieces as of the last correction, in the order of their first cells.
    pub fn pieces(&self) -> &[PieceTarget] {
        &self.pieces
    }

    /// What all pieces enclosed when they were last measured, m³.
    pub fn volume(&self) -> f64 {
        self.pieces.iter().fold(0.0, |sum, piece| sum + piece.measured)
    }

    /// What all pieces should enclose, m³.
    pub fn target(&self) -> f64 {
        self.pieces.iter().fold(0.0, |sum, piece| sum + piece.volume)
    }

    /// What was added and waits for a piece, m³.
    pub fn waiting(&self) -> f64 {
        self.changes.iter().fold(0.0, |sum, change| sum + change.volume)
    }

    /// Follows the pieces of a surface that has moved, and moves it by at most [`CAP`] so that each encloses its target;
    /// once a frame. The solid is where it is at the end of the frame.
    pub fn correct(&mut self, surface: &mut MarkedSurface, solid: Option<&Distance<'_>>) -> VolumeReport {
        self.correct_within(surface, solid, CAP)
    }

    /// The same with surfaces moved by at most `most` solver cells.
    pub fn correct_within(
        &mut self,
        surface: &mut MarkedSurface,
        solid: Option<&Distance<'_>>,
        most: f64,
    ) -> VolumeReport {
        let (unit, size) = (self.unit(surface), f64::from(surface.resolution()));
        let (mut found, mut lost) = self.follow(surface, solid);
        let before = self.corrected;
        let (mut cap, mut moved) = (0.5 * (most * size).min(OWN_CAP), 0.0);
        let mut responses = vec![1.0; found.all.len()];
        for pass in 0..PASSES {
            if pass >= FIRST_PASSES && self.is_close() {
                break;
            }
            let by: Vec<f64> = found
                .all
                .iter()
                .zip(&self.pieces)
                .zip(&responses)
                .map(|((piece, target), response)| shift(piece, target.volume / unit, *response, cap))
                .collect();
            let farthest = by.iter().fold(0.0_f64, |most, by| most.max(by.abs()));
            if farthest == 0.0 {
                break;
            }
            let shifts: Vec<f32> = by.iter().map(|by| *by as f32).collect();
            found.shift(surface, &shifts);
            let (now, vanished) = self.follow(surface, solid);
            self.corrected += unit * (now.volume() - found.volume());
            responses = now.responses(&found, &by, &responses);
            // What vanished by a shift was not lost by the solver.
            self.corrected += vanished.iter().fold(0.0, |sum, piece| sum + piece.volume);
            lost.extend(vanished);
            (found, cap, moved) = (now, 0.5 * cap, moved + farthest / size);
        }
        let report = self.report(&found, unit, moved, lost);
        VolumeReport { corrected_now: self.corrected - before, ..report }
    }

    /// Whether further moves would change little.
    fn is_close(&self) -> bool {
        let sum = |of: &dyn Fn(&PieceTarget) -> f64| self.pieces.iter().fold(0.0, |sum, piece| sum + of(piece));
        sum(&|piece| (piece.measured - piece.volume).abs()) <= CLOSE * sum(&|piece| piece.volume)
    }

    /// Takes out what was added where there is no piece, m³ and its places, for somebody else to carry on.
    pub fn take_waiting(&mut self) -> Vec<LostPiece> {
        let is_meant = |change: &Change| change.volume > 0.0 && change.at.is_some();
        let (taken, kept): (Vec<Change>, Vec<Change>) = take(&mut self.changes).into_iter().partition(is_meant);
        self.changes = kept;
        taken.iter().filter_map(|change| Some(LostPiece { volume: change.volume, place: change.at? })).collect()
    }

    /// Drops what was to be taken and no piece had; returns how much, m³.
    pub fn forgive(&mut self) -> f64 {
        let (owed, kept): (Vec<Change>, Vec<Change>) =
            take(&mut self.changes).into_iter().partition(|change| change.volume < 0.0);
        self.changes = kept;
        owed.iter().fold(0.0, |sum, change| sum - change.volume)
    }

    /// Follows the pieces of a surface that has moved, and leaves it as it is.
    pub fn measure(&mut self, surface: &mut MarkedSurface, solid: Option<&Distance<'_>>) -> VolumeReport {
        let (found, lost) = self.follow(surface, solid);
        self.report(&found, self.unit(surface), 0.0, lost)
    }

    fn report(&self, found: &Pieces, unit: f64, moved: f64, lost: Vec<LostPiece>) -> VolumeReport {
        let volume = unit * found.volume();
        let target = self.target();
        let errors = self.pieces.iter().map(|piece| piece.measured - piece.volume);
        let share = |error: f64| if target > 0.0 { error / target } else { 0.0 };
        VolumeReport {
            volume,
            target,
            drift: share(volume - target),
            raw_drift: share(volume - self.corrected - target),
            corrected: self.corrected,
            corrected_now: 0.0,
            pieces: found.all.len(),
            worst: errors.fold(0.0, |worst, error| worst.max(error.abs())),
            moved,
            lost,
        }
    }

    /// The volume of a surface cell, m³.
    fn unit(&self, surface: &MarkedSurface) -> f64 {
        let cell = self.cell / f64::from(surface.resolution());
        cell * cell * cell
    }

    /// Gives each piece its target, m³.
    fn set(&mut self, surface: &MarkedSurface, found: &Pieces, targets: impl IntoIterator<Item = f64>) {
        let (unit, size) = (self.unit(surface), 1.0 / surface.resolution() as f32);
        let piece = |(piece, volume): (&Measured, f64)| PieceTarget {
            volume,
            measured: unit * piece.volume,
            place: scale(piece.place, size),
        };
        self.pieces = found.all.iter().zip(targets).map(piece).collect();
    }

    /// Finds the pieces and passes the targets on to them; returns them and the old ones that are in none.
    fn follow(&mut self, surface: &mut MarkedSurface, solid: Option<&Distance<'_>>) -> (Pieces, Vec<LostPiece>) {
        let found = Pieces::new(surface, solid);
        let now = marked(surface, &found);
        let (unit, size) = (self.unit(surface), surface.resolution() as f32);
        let mut passages = passages(surface.markers().pieces(), &now);
        self.keep_unmarked(surface, &found, &mut passages);
        let unknown = self.newcomers(surface, &found, &mut passages);
        let targets: Vec<f64> = self.pieces.iter().map(|piece| piece.volume).collect();
        let volumes: Vec<f64> = found.all.iter().map(|piece| unit * piece.volume).collect();
        let mut shares = passed_on(&targets, &passages, &volumes);
        let mut is_lost = vec![true; self.pieces.len()];
        passages.iter().for_each(|passage| is_lost[passage.old] = false);
        let mut lost = self.lost(surface, &is_lost);
        find_again(&unknown, &volumes, &mut lost, &mut shares);
        self.apply(&found, &mut shares, &mut lost, size);
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

    /// Adds passages for old pieces that no marker was on because they fill all that holds them and have no surface to mark:
    /// to such a piece where they were, at most as far off as they are large.
    fn keep_unmarked(&self, surface: &MarkedSurface, found: &Pieces, passages: &mut Vec<Passage>) {
        let (unit, size) = (self.unit(surface), surface.resolution() as f32);
        let mut is_marked = vec![false; self.pieces.len()];
        for old in surface.markers().pieces().iter().filter(|old| **old != NO_PIECE) {
            is_marked[*old as usize] = true;
        }
        for (old, piece) in self.pieces.iter().enumerate().filter(|(old, _)| !is_marked[*old]) {
            let near = |(_, away): &(usize, f32)| f64::from(*away) <= libm::cbrt(piece.measured / unit);
            match found.closest(scale(piece.place, size)).filter(near) {
                Some((new, _)) if found.all[new].area <= 0.0 => passages.push(Passage { old, new, markers: 1 }),
                _ => {}
            }
        }
    }

    /// Adds passages for pieces that no marker was on: from the piece that most markers around were on. Returns those that
    /// are of unknown origin. Pieces beside which something was added need none.
    fn newcomers(&self, surface: &MarkedSurface, found: &Pieces, passages: &mut Vec<Passage>) -> Vec<usize> {
        let size = surface.resolution() as f32;
        let mut has_origin = vec![false; found.all.len()];
        passages.iter().for_each(|passage| has_origin[passage.new] = true);
        for change in self.changes.iter().filter(|change| change.volume > 0.0) {
            let closest = change.at.and_then(|at| found.closest(scale(at, size)));
            if let Some((piece, _)) = closest.filter(|(_, distance)| *distance < BESIDE) {
                has_origin[piece] = true;
            }
        }
        let mut unknown = Vec::new();
        for new in (0..found.all.len()).filter(|piece| !has_origin[*piece]) {
            let around = found.cells_around(new, BESIDE as i32);
            let mut votes = vec![0; self.pieces.len()];
            let markers = surface.markers();
            for (marker, old) in markers.markers.iter().zip(markers.pieces()) {
                if *old != NO_PIECE && around.find(marker.point.map(floor)).is_some() {
                    votes[*old as usize] += 1;
                }
            }
            match (0..votes.len()).rev().max_by_key(|old| votes[*old]).filter(|old| votes[*old] > 0) {
                Some(old) => passages.push(Passage { old, new, markers: 1 }),
                None => unknown.push(new),
            }
        }
        unknown
    }

    /// The old pieces that are in no new one, where their markers are now.
    fn lost(&self, surface: &MarkedSurface, is_lost: &[bool]) -> Vec<LostPiece> {
        let size = 1.0 / surface.resolution() as f32;
        let markers = surface.markers();
        let lost = |(old, piece): (usize, &PieceTarget)| {
            let own = markers.markers.iter().zip(markers.pieces()).filter(|(_, of)| **of as usize == old);
            let (sum, count) = own.fold(([0.0; 3], 0.0), |(sum, n), (marker, _)| (add(sum, marker.point), n + 1.0));
            let place = if count > 0.0 { scale(sum, size / count) } else { piece.place };
            LostPiece { volume: piece.volume, place }
        };
        self.pieces.iter().enumerate().filter(|(old, _)| is_lost[*old]).map(lost).collect()
    }

    /// Adds what came and takes what went, also from pieces that vanished where it went.
    fn apply(&mut self, found: &Pieces, shares: &mut [f64], lost: &mut [LostPiece], size: f32) {
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
                (_, Some((piece, distance))) if change.volume < 0.0 || distance < BESIDE => {
                    everywhere += change_by(&mut shares[piece], change.volume);
                }
                _ => self.changes.push(change),
            }
        }
        let sum = shares.iter().fold(0.0, |sum, share| sum + share);
        let spread = if sum > 0.0 { everywhere.max(-sum) } else { 0.0 };
        if spread != 0.0 {
            shares.iter_mut().for_each(|share| *share *= 1.0 + spread / sum);
        }
        if spread != everywhere {
            self.changes.push(Change { volume: everywhere - spread, at: None });
        }
    }
}

/// The farthest that a surface is to be moved after a frame in which the fastest liquid moved `way` solver cells.
pub fn cap(way: f64) -> f64 {
    (OF_WAY * way).clamp(CAP, FARTHEST)
}

/// Gives pieces of unknown origin what was lost elsewhere, up to their volumes: liquid that was too fast to be followed. What
/// is more than that is nobody's, and correction takes it away.
fn find_again(unknown: &[usize], volumes: &[f64], lost: &mut [LostPiece], shares: &mut [f64]) {
    for piece in unknown {
        for lost in lost.iter_mut() {
            let found = lost.volume.min(volumes[*piece] - shares[*piece]);
            lost.volume -= found;
            shares[*piece] += found;
        }
    }
}

/// Adds to a volume, which stays at 0 or above; returns what could not be taken from it.
fn change_by(volume: &mut f64, by: f64) -> f64 {
    let sum = *volume + by;
    *volume = sum.max(0.0);
    sum.min(0.0)
}

/// How far outward, in surface cells, the surface of a piece has to move; at most `cap`. `response`: how much its volume
/// changes ÷ area · way.
fn shift(piece: &Measured, target: f64, response: f64, cap: f64) -> f64 {
    let error = target - piece.volume;
    if error.abs() <= LEAST_ERROR * target || piece.area <= 0.0 {
        return 0.0;
    }
    (error / (response * piece.area)).clamp(-cap, cap)
}

/// The piece of each marker.
fn marked(surface: &MarkedSurface, found: &Pieces) -> Vec<u32> {
    let markers = &surface.markers().markers;
    parallel::tabulate(markers.len(), parallel::CHUNK, |n| found.of_marker(&markers[n]))
}

/// The volume of each piece, m³, where all its parts are in no other and have one.
fn known_volumes(found: &Pieces, parts: &[StartPart]) -> Vec<Option<f64>> {
    let mut volumes: Vec<Option<f64>> = vec![None; found.all.len()];
    let mut is_unknown = vec![false; found.all.len()];
    for part in parts {
        let spans = part.inside.spans();
        let mut pieces: Vec<usize> =
            spans.filter_map(|([y, z], span)| Some(found.of_cell([span.start, y, z])? as usize)).collect();
        pieces.sort_unstable();
        pieces.dedup();
        match (&pieces[..], part.volume) {
            ([piece], Some(volume)) => *volumes[*piece].get_or_insert(0.0) += volume,
            _ => pieces.iter().for_each(|piece| is_unknown[*piece] = true),
        }
    }
    volumes.iter_mut().zip(is_unknown).filter(|(_, is_unknown)| *is_unknown).for_each(|(volume, _)| *volume = None);
    volumes
}
