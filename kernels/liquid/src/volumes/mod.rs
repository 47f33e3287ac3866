//! The volume of each piece of a liquid, kept: how much it should have follows it where it splits and merges, and its
//! surface is moved until the mesh encloses that.
//!
//! A piece is liquid that the mesh does not part; bubbles belong to the piece around them. Markers tell where its liquid
//! went, and its cells where a sink has cut its whole surface away: pieces that merge add up their targets, and one that
//! splits shares its target by what the parts enclose. A piece
//! that got too small for the grid, [`SMALLEST`] or nothing at all, is lost, with its target, to whoever carries it on.
//!
//! Liquids that do not mix are phases of a piece ([`LiquidMaterial`]); each has a target of its own. Two ways lead to it: what a
//! piece lacks in all comes back where the phases that lack it are at its surface, and what one phase took from another is
//! exchanged where they meet.
//!
//! [`LiquidMaterial`]: crate::carried::LiquidMaterial
//!
//! Promise: targets, lost pieces and what waits to be added make up all that there was at the start and was added since;
//! a piece within [`LEAST_ERROR`] of its target is not touched; no surface moves farther in a frame than [`cap`] says; the
//! bits are the same on any number of threads. Limit: liquid that goes from one piece to another and parts again within a frame
//! is not noticed.

mod follow;
mod phases;
mod pieces;
#[cfg(test)]
mod tests;

use std::mem::{replace, take};

use numerics::vector::{Vec3, length, scale, sub};
use serde::{Deserialize, Serialize};

use crate::carried::{MaterialPoints, PhaseShares};
use crate::level_set::{Distance, floor};
use crate::marked::MarkedSurface;
use crate::rows::CellRows;
use crate::step::{Owed, Surface};
use follow::marked;
use phases::{Ways, ways_of_phases};
use pieces::{Measured, PieceCells, Pieces};

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
/// Share of the volume up to which moves end that no longer halve what is wrong: pieces of a few cells do not settle.
const SETTLED: f64 = 1e-3;
/// Share of a known volume from which on what cells round off is given back: edges, which faces that move make up for; a ball
/// of three cells radius stays as it is.
const ROUNDED: f64 = 0.04;
/// Share of the volume of a phase from which on it is exchanged for another in the same piece.
const LEAST_EXCHANGED: f64 = 1e-3;
/// Frames' worth of moves that the surface of the start may take to enclose a known volume.
const START_MOVES: u32 = 3;
/// Volume, in surface cells, below which a piece is too small for the grid: its surface would be lost and given back each frame.
const SMALLEST: f64 = 1.0;
/// Distance, in surface cells, from which liquid that is added belongs to no piece.
const BESIDE: f32 = 4.0;

/// How much a piece should enclose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PieceTarget {
    /// Of each phase, m³.
    pub phases: Vec<f64>,
    /// What its mesh enclosed when it was last measured, m³.
    pub measured: f64,
    /// The mean of its cells then, in solver cells.
    pub place: Vec3,
}

impl PieceTarget {
    /// Of all phases, m³.
    pub fn volume(&self) -> f64 {
        self.phases.iter().fold(0.0, |sum, volume| sum + volume)
    }

    fn of_phase(&self, phase: usize) -> f64 {
        self.phases.get(phase).copied().unwrap_or_default()
    }

    /// What is lost with it at a place in solver cells.
    fn lost(&self, place: Vec3) -> impl Iterator<Item = LostPiece> {
        let of_phase = move |(phase, volume): (usize, &f64)| LostPiece { volume: *volume, phase: phase as u32, place };
        self.phases.iter().enumerate().map(of_phase).filter(|piece| piece.volume > 0.0)
    }
}

/// Liquid of one phase that the grid no longer shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LostPiece {
    /// Its target, m³.
    pub volume: f64,
    /// Its phase.
    pub phase: u32,
    /// Where it was last seen, in solver cells.
    pub place: Vec3,
}

/// Liquid that came or went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Change {
    /// m³.
    volume: f64,
    /// Its phase; where it went, what there is too little of is what went.
    phase: u32,
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
    /// What the drift would be if no surface had ever been moved here: before it was now, and without `corrected` of before.
    pub raw_drift: f64,
    /// What moving surfaces has added to what the solver's cells hold since the start, m³. The mesh may change more, where it shows
    /// more or less than cells hold, and later returns by itself.
    pub corrected: f64,
    /// What it added now, m³.
    pub corrected_now: f64,
    /// Pieces.
    pub pieces: usize,
    /// The largest error of a piece's volume, m³.
    pub worst: f64,
    /// The largest error of the share that a phase has of the volume, relative to what it should be; 0 where there is one.
    pub phase_drift: f64,
    /// The farthest that a surface was moved, in solver cells.
    pub moved: f64,
    /// Pieces that vanished.
    pub lost: Vec<LostPiece>,
    /// What the surface that is left has to gain ([`Liquid::give`](crate::step::Liquid::give)): the cells of a dropped piece held
    /// more than `lost` says, since its mesh enclosed less. Negative where the liquid around has too much.
    pub owed: Vec<Owed>,
}

/// How much each piece of a liquid should enclose. Kept exactly by any format that keeps numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VolumeTargets {
    /// The side of a solver cell, m.
    cell: f64,
    pieces: Vec<PieceTarget>,
    /// Where they are.
    cells: PieceCells,
    changes: Vec<Change>,
    /// What moving surfaces has added so far, m³.
    corrected: f64,
    /// How much the volume of the largest piece changed ÷ area · way when last much of it was wrong: less says little.
    response: f64,
}

impl VolumeTargets {
    /// Targets that are what each piece of a surface encloses outside a solid. `cell` is the side of a solver cell, m.
    pub fn new(surface: &mut MarkedSurface, cell: f64, solid: Option<&Distance<'_>>) -> Self {
        Self::of_parts(surface, cell, solid, None, &[])
    }

    /// The same, but a piece of which all parts are known has their volume, where cells round off much of it, and its surface
    /// is moved so that it encloses that.
    pub fn of_parts(
        surface: &mut MarkedSurface,
        cell: f64,
        solid: Option<&Distance<'_>>,
        materials: Option<&mut MaterialPoints>,
        parts: &[StartPart],
    ) -> Self {
        let known = materials.as_ref().map(|materials| materials.phases());
        let (phases, mut materials) = (known.as_ref(), materials);
        let found = Pieces::new(surface, solid, phases);
        let now = marked(surface, &found);
        surface.markers_mut().set_pieces(now);
        let (pieces, cells, changes) = (Vec::new(), PieceCells::default(), Vec::new());
        let mut targets = Self { cell, pieces, cells, changes, corrected: 0.0, response: 1.0 };
        let unit = targets.unit(surface);
        let is_off = |seen: f64, known: f64| (unit * seen / known - 1.0).abs() > ROUNDED;
        let known: Vec<Option<f64>> = known_volumes(&found, parts)
            .into_iter()
            .zip(&found.all)
            .map(|(known, piece)| known.filter(|known| is_off(piece.volume, *known)))
            .collect();
        let most = if known.iter().any(Option::is_some) { START_MOVES } else { 0 };
        let volumes: Vec<f64> =
            found.all.iter().zip(known).map(|(piece, known)| known.unwrap_or(unit * piece.volume)).collect();
        let of_phase = |phase| {
            volumes.iter().enumerate().map(|(piece, volume)| volume * found.phases.share(piece, phase)).collect()
        };
        targets.set(surface, &found, (0..found.phases.count()).map(of_phase).collect());
        for _ in 0..most {
            if targets.error() <= CLOSE {
                break;
            }
            targets.correct_within(surface, solid, materials.as_deref_mut(), CAP);
        }
        // What cells round off at the start is no drift.
        targets.corrected = 0.0;
        targets
    }

    /// Adds to what pieces should enclose, or takes from it where `volume`, m³, is negative: that of the piece around a
    /// place in solver cells, or of all pieces in proportion. Counts from the next correction on. What is added far from
    /// any piece waits for one. What goes is of the phases of which less is there than should be.
    pub fn add(&mut self, volume: f64, at: Option<Vec3>) {
        self.add_phase(volume, 0, at);
    }

    /// The same with liquid of a phase, where it comes.
    pub fn add_phase(&mut self, volume: f64, phase: u32, at: Option<Vec3>) {
        self.changes.push(Change { volume, phase, at });
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
        self.pieces.iter().fold(0.0, |sum, piece| sum + piece.volume())
    }

    /// What was added and waits for a piece, m³.
    pub fn waiting(&self) -> f64 {
        self.changes.iter().fold(0.0, |sum, change| sum + change.volume)
    }

    /// Follows the pieces of a surface that has moved, and moves it by at most [`CAP`] so that each encloses its target;
    /// once a frame. The solid is where it is at the end of the frame.
    pub fn correct(&mut self, surface: &mut MarkedSurface, solid: Option<&Distance<'_>>) -> VolumeReport {
        self.correct_within(surface, solid, None, CAP)
    }

    /// The same with surfaces moved by at most `most` solver cells: where a piece lacks volume, that of the phases that lack
    /// it. What one phase lacks and another has too much of is exchanged where they meet.
    pub fn correct_within(
        &mut self,
        surface: &mut MarkedSurface,
        solid: Option<&Distance<'_>>,
        materials: Option<&mut MaterialPoints>,
        most: f64,
    ) -> VolumeReport {
        let known = materials.as_ref().map(|materials| materials.phases());
        let phases = known.as_ref();
        let (unit, size) = (self.unit(surface), f64::from(surface.resolution()));
        let (mut found, mut lost) = self.follow(surface, solid, phases);
        let mut owed = self.given_twice(&lost);
        let (before, mut held, mut meshed) = (self.corrected, None, 0.0);
        let (mut cap, mut moved) = (0.5 * (most * size).min(OWN_CAP), 0.0);
        let mut responses = self.likely_responses();
        let mut error = f64::INFINITY;
        for pass in 0..PASSES {
            let last = replace(&mut error, self.error());
            if pass >= FIRST_PASSES && (error <= CLOSE || error <= SETTLED && error > 0.5 * last) {
                break;
            }
            let ways = self.ways(&found, unit, &responses, cap);
            let farthest = ways.farthest();
            if farthest == 0.0 {
                break;
            }
            held.get_or_insert_with(|| surface.held(solid));
            let before = take(&mut self.pieces);
            self.pieces.clone_from(&before);
            found.shift(surface, &ways, phases);
            let (now, vanished) = self.follow(surface, solid, phases);
            let same = same_pieces(&before, &self.pieces);
            responses = now.responses(&found, &same, &found.swept(&ways), &responses);
            if pass == 0 && error > SETTLED {
                self.keep_response(&responses);
            }
            // What vanished by a shift was not lost by the solver.
            let kept = vanished.iter().fold(0.0, |sum, piece| sum + piece.volume);
            meshed += unit * (now.volume() - found.volume()) + kept;
            self.corrected += kept;
            lost.extend(vanished);
            (found, cap, moved) = (now, 0.5 * cap, moved + farthest / size);
        }
        if let Some(held) = held {
            self.corrected += (surface.held(solid) - held) * self.cell * self.cell * self.cell;
        }
        if let Some(materials) = materials
            && self.exchange(&found, surface, materials)
        {
            let (now, vanished) = self.follow(surface, solid, Some(&materials.phases()));
            lost.extend(vanished);
            found = now;
        }
        self.drop_small(&mut found, surface, solid, (&mut lost, &mut owed));
        let report = self.report(&found, unit, moved, (lost, owed));
        let corrected_now = self.corrected - before;
        let raw_drift = report.drift - share(meshed + before, report.target);
        VolumeReport { corrected_now, raw_drift, ..report }
    }

    /// How much the volume of each piece is likely to change ÷ area · way: that of the largest as in the last correction.
    fn likely_responses(&self) -> Vec<f64> {
        let mut responses = vec![1.0; self.pieces.len()];
        if let Some(largest) = self.largest() {
            responses[largest] = self.response;
        }
        responses
    }

    /// Keeps that of the largest for the next correction.
    fn keep_response(&mut self, responses: &[f64]) {
        if let Some(largest) = self.largest() {
            self.response = responses[largest];
        }
    }

    /// The piece with the largest target.
    fn largest(&self) -> Option<usize> {
        (0..self.pieces.len()).max_by(|a, b| self.pieces[*a].volume().total_cmp(&self.pieces[*b].volume()))
    }

    /// Exchanges what phases of a piece lack and others have too much of; whether any was.
    fn exchange(&self, found: &Pieces, surface: &MarkedSurface, materials: &mut MaterialPoints) -> bool {
        let (unit, size) = (self.unit(surface), surface.resolution() as f32);
        let cell = self.cell * self.cell * self.cell;
        let lack = |n: usize, phase: usize| {
            let (target, measured) = (self.pieces[n].of_phase(phase), unit * found.volume_of(n, phase));
            let lack = (target - measured) / cell;
            if lack.abs() > LEAST_EXCHANGED * target.max(measured) / cell { lack } else { 0.0 }
        };
        let count = self.phases().max(found.phases.count());
        let lacks = |n: usize| (0..count).map(|phase| lack(n, phase)).collect();
        let mut lacks: Vec<Vec<f64>> = (0..found.all.len()).map(lacks).collect();
        let is_off = |lacks: &Vec<f64>| lacks.iter().any(|lack| *lack > 0.0) && lacks.iter().any(|lack| *lack < 0.0);
        let piece_of = |place: Vec3| found.of_cell(scale(place, size).map(floor)).map(|piece| piece as usize);
        lacks.iter().any(is_off) && materials.exchange(surface.view(), &piece_of, &mut lacks)
    }

    /// What all pieces lack or have too much of ÷ what they should enclose; 0 where that is nothing.
    fn error(&self) -> f64 {
        let (wrong, target) = self.pieces.iter().fold((0.0, 0.0), |(wrong, target), piece| {
            (wrong + (piece.measured - piece.volume()).abs(), target + piece.volume())
        });
        if wrong > 0.0 { wrong / target } else { 0.0 }
    }

    /// Takes out what was added where there is no piece, m³ and its places, for somebody else to carry on.
    pub fn take_waiting(&mut self) -> Vec<LostPiece> {
        let is_meant = |change: &Change| change.volume > 0.0 && change.at.is_some();
        let (taken, kept): (Vec<Change>, Vec<Change>) = take(&mut self.changes).into_iter().partition(is_meant);
        self.changes = kept;
        taken
            .iter()
            .filter_map(|change| Some(LostPiece { volume: change.volume, phase: change.phase, place: change.at? }))
            .collect()
    }

    /// Drops what was to be taken and no piece had; returns how much, m³.
    pub fn forgive(&mut self) -> f64 {
        let (owed, kept): (Vec<Change>, Vec<Change>) =
            take(&mut self.changes).into_iter().partition(|change| change.volume < 0.0);
        self.changes = kept;
        owed.iter().fold(0.0, |sum, change| sum - change.volume)
    }

    /// Follows the pieces of a surface that has moved, and leaves it as it is.
    pub fn measure(
        &mut self,
        surface: &mut MarkedSurface,
        solid: Option<&Distance<'_>>,
        phases: Option<&PhaseShares>,
    ) -> VolumeReport {
        let (mut found, mut lost) = self.follow(surface, solid, phases);
        let mut owed = self.given_twice(&lost);
        self.drop_small(&mut found, surface, solid, (&mut lost, &mut owed));
        self.report(&found, self.unit(surface), 0.0, (lost, owed))
    }

    /// What the liquid around has too much of after pieces vanished as they moved: it was given their volume as liquid that the surface
    /// did not keep, and they are now spray, too.
    fn given_twice(&self, lost: &[LostPiece]) -> Vec<Owed> {
        lost.iter().map(|piece| (piece.place, self.in_cells(-piece.volume))).collect()
    }

    /// Takes the pieces out of a surface that are too small for its cells, and adds them to those lost.
    fn drop_small(
        &mut self,
        found: &mut Pieces,
        surface: &mut MarkedSurface,
        solid: Option<&Distance<'_>>,
        (lost, owed): (&mut Vec<LostPiece>, &mut Vec<Owed>),
    ) {
        let unit = self.unit(surface);
        let is_small = |(target, piece): (&PieceTarget, &Measured)| {
            let volume = target.volume() / unit;
            piece.volume < SMALLEST && volume < SMALLEST && volume > 0.0
        };
        let small: Vec<bool> = self.pieces.iter().zip(&found.all).map(is_small).collect();
        let (taken, held) = found.take_out(surface, solid, &small);
        owed.extend(held);
        for piece in taken {
            let target = &mut self.pieces[piece];
            let (place, volume) = (target.place, target.volume());
            lost.extend(target.lost(place));
            target.phases.fill(0.0);
            target.measured = 0.0;
            owed.push((place, self.in_cells(-volume)));
        }
    }

    /// A volume, m³, ÷ that of a solver cell.
    fn in_cells(&self, volume: f64) -> f32 {
        (volume / (self.cell * self.cell * self.cell)) as f32
    }

    fn report(&self, found: &Pieces, unit: f64, moved: f64, (lost, owed): (Vec<LostPiece>, Vec<Owed>)) -> VolumeReport {
        let volume = unit * found.volume();
        let target = self.target();
        let errors = self.pieces.iter().map(|piece| piece.measured - piece.volume());
        VolumeReport {
            volume,
            target,
            drift: share(volume - target, target),
            raw_drift: share(volume - self.corrected - target, target),
            corrected: self.corrected,
            corrected_now: 0.0,
            pieces: found.all.iter().filter(|piece| piece.volume > 0.0).count(),
            worst: errors.fold(0.0, |worst, error| worst.max(error.abs())),
            phase_drift: self.phase_drift(found),
            moved,
            lost,
            owed,
        }
    }

    /// The volume of a surface cell, m³.
    fn unit(&self, surface: &MarkedSurface) -> f64 {
        let cell = self.cell / f64::from(surface.resolution());
        cell * cell * cell
    }

    /// Number of phases that there are targets of.
    fn phases(&self) -> usize {
        let waiting = self.changes.iter().map(|change| change.phase as usize + 1).max();
        self.pieces.iter().map(|piece| piece.phases.len()).max().max(waiting).unwrap_or(1)
    }

    /// The largest error of the share that a phase has of all volume, relative to what it should be.
    fn phase_drift(&self, found: &Pieces) -> f64 {
        let drift = |phase: usize| {
            let target = self.pieces.iter().fold(0.0, |sum, piece| sum + piece.of_phase(phase)) / self.target();
            let share =
                (0..found.all.len()).fold(0.0, |sum, piece| sum + found.volume_of(piece, phase)) / found.volume();
            if target > 0.0 { (share / target - 1.0).abs() } else { 0.0 }
        };
        if found.phases.count() > 1 { (0..self.phases()).map(drift).fold(0.0, f64::max) } else { 0.0 }
    }

    /// Gives each piece its targets, by phase, m³.
    fn set(&mut self, surface: &MarkedSurface, found: &Pieces, targets: Vec<Vec<f64>>) {
        let (unit, size) = (self.unit(surface), 1.0 / surface.resolution() as f32);
        let piece = |(n, piece): (usize, &Measured)| PieceTarget {
            phases: targets.iter().map(|phase| phase[n]).collect(),
            measured: unit * piece.volume,
            place: scale(piece.place, size),
        };
        self.pieces = found.all.iter().enumerate().map(piece).collect();
        self.cells = found.cells();
    }

    /// How far the surfaces of pieces have to move; at most `cap`. `responses`: how much the volume of each changes ÷ area ·
    /// way.
    fn ways(&self, found: &Pieces, unit: f64, responses: &[f64], cap: f64) -> Ways {
        let count = found.phases.count();
        let of_piece = |n: usize| {
            let (piece, targets) = (&found.all[n], &self.pieces[n]);
            let (target, per_way) = (targets.volume() / unit, responses[n] * piece.area);
            let error = target - piece.volume;
            if error.abs() <= LEAST_ERROR * target || piece.area <= 0.0 {
                return vec![0.0; count];
            }
            if count == 1 {
                return vec![(error / per_way).clamp(-cap, cap)];
            }
            let lack = |phase| (targets.of_phase(phase) / unit - found.volume_of(n, phase)) * error.signum();
            let lacks: Vec<f64> = (0..count).map(|phase| lack(phase).max(0.0)).collect();
            let areas: Vec<f64> = (0..count).map(|phase| responses[n] * found.phases.area(n, phase, 0.0)).collect();
            ways_of_phases(error, &lacks, &areas, cap)
        };
        Ways { count, all: (0..found.all.len()).flat_map(of_piece).collect() }
    }
}

/// The farthest that a surface is to be moved after a frame in which the fastest liquid moved `way` solver cells.
pub fn cap(way: f64) -> f64 {
    (OF_WAY * way).clamp(CAP, FARTHEST)
}

/// For each piece the one that had exactly its target before, the closest if there are several.
fn same_pieces(before: &[PieceTarget], now: &[PieceTarget]) -> Vec<Option<usize>> {
    let key = |piece: &PieceTarget| piece.volume().to_bits();
    let mut by_target: Vec<(u64, usize)> = before.iter().map(key).zip(0..).collect();
    by_target.sort_unstable();
    let same = |piece: &PieceTarget| {
        let own = key(piece);
        let first = by_target.partition_point(|(target, _)| *target < own);
        let alike = by_target[first..].iter().take_while(|(target, _)| *target == own).map(|(_, n)| *n);
        let away = |n: &usize| length(sub(before[*n].place, piece.place));
        alike.min_by(|a, b| away(a).total_cmp(&away(b)))
    };
    now.iter().map(same).collect()
}

/// A volume ÷ the target; 0 where that is nothing.
fn share(volume: f64, target: f64) -> f64 {
    if target > 0.0 { volume / target } else { 0.0 }
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
