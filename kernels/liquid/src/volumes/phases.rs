//! How much of each phase is in each piece.

use std::collections::BTreeMap;

use numerics::parallel;
use numerics::vector::{Vec3, scale};

use super::pieces::{HOLDS, Pieces};
use crate::carried::{PhaseReader, PhaseShares};
use crate::level_set::PhiView;
use crate::rows::Finder;

/// What each phase has of the volume and of the free surface of each piece.
#[derive(Clone, Debug, Default)]
pub(super) struct PhasesOfPieces {
    /// Number of phases; one where they are not told apart.
    count: usize,
    /// By piece, then by phase: shares of its volume; areas, in surface cells. Empty where there is one.
    shares: Vec<f64>,
    areas: Vec<f64>,
}

impl PhasesOfPieces {
    /// All liquid is of one phase.
    pub(super) fn one() -> Self {
        Self { count: 1, ..Self::default() }
    }

    /// `free`: a place on each free part of the surface, in surface cells, its piece and its area; `size`: surface cells along
    /// the side of a solver cell.
    pub(super) fn new(
        phases: &PhaseShares,
        pieces: &Pieces,
        view: PhiView<'_>,
        free: &[(Vec3, u32, f64)],
        size: f32,
    ) -> Self {
        let by = 1.0 / size;
        let [of_cells] = view.rows.tabulate_with(
            || Finder::new(view.rows),
            |finder, cell, at| [pieces.holding(view, finder, cell, at).map_or(0, |piece| piece + 1)],
        );
        let spans: Vec<_> = view.rows.spans().collect();
        let volumes = sums(&spans, |spans, add| {
            let mut reader = phases.reader();
            for ([y, z], span) in spans {
                for x in span.start..span.end {
                    let at = span.at(x);
                    let Some(piece) = of_cells[at].checked_sub(1) else { continue };
                    let volume = f64::from((HOLDS - view.phi[at]).min(1.0));
                    let middle = [x, *y, *z].map(|x| (x as f32 + 0.5) * by);
                    reader.in_cell(middle, |phase, share| add(piece, phase, volume * f64::from(share)));
                }
            }
        });
        let areas = sums(free, |free, add| {
            let mut reader = phases.reader();
            for (place, piece, area) in free {
                reader.each(scale(*place, by), |phase, share| add(*piece, phase, area * f64::from(share)));
            }
        });
        let count = volumes.keys().chain(areas.keys()).map(|(_, phase)| phase + 1).max().unwrap_or(1) as usize;
        let mut out = Self { count, shares: vec![0.0; count * pieces.all.len()], areas: Vec::new() };
        out.areas = out.shares.clone();
        for (sums, out) in [(&volumes, &mut out.shares), (&areas, &mut out.areas)] {
            sums.iter().for_each(|((piece, phase), sum)| out[*piece as usize * count + *phase as usize] = *sum);
        }
        for shares in out.shares.chunks_mut(count) {
            let sum = shares.iter().fold(0.0, |sum, share| sum + share);
            shares.iter_mut().for_each(|share| *share /= sum);
        }
        out
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The share of a piece's volume.
    pub(super) fn share(&self, piece: usize, phase: usize) -> f64 {
        match self.shares.get(piece * self.count + phase) {
            Some(share) if phase < self.count => *share,
            None if self.count == 1 && phase == 0 => 1.0,
            _ => 0.0,
        }
    }

    /// The area of a piece's free surface, of `all` of it.
    pub(super) fn area(&self, piece: usize, phase: usize, all: f64) -> f64 {
        if self.count == 1 { all } else { self.areas[piece * self.count + phase] }
    }
}

/// How far outward the surface of each phase of each piece is to move, in surface cells.
#[derive(Clone, Debug)]
pub(super) struct Ways {
    /// Number of phases.
    pub(super) count: usize,
    /// By piece, then by phase.
    pub(super) all: Vec<f64>,
}

impl Ways {
    /// At a place, in solver cells, on a piece; 0 on none.
    #[inline]
    pub(super) fn at(&self, piece: u32, reader: Option<&mut PhaseReader<'_>>, place: impl FnOnce() -> Vec3) -> f32 {
        let first = piece as usize * self.count;
        let Some(own) = self.all.get(first..first + self.count) else { return 0.0 };
        let Some(reader) = reader.filter(|_| own.iter().any(|way| *way != own[0])) else { return own[0] as f32 };
        let mut way = 0.0;
        reader.each(place(), |phase, share| way += own.get(phase as usize).map_or(0.0, |own| share * *own as f32));
        way
    }

    /// The farthest.
    pub(super) fn farthest(&self) -> f64 {
        self.all.iter().fold(0.0_f64, |most, way| most.max(way.abs()))
    }
}

/// How far the surface of each phase of a piece has to move that lacks a volume of `error`, which each phase makes good by what
/// it lacks itself, and all together where one has too little surface. `areas`: volume ÷ way; `cap`: the farthest that the
/// surface moves now, and half of what it moves in all.
pub(super) fn ways_of_phases(error: f64, lacks: &[f64], areas: &[f64], cap: f64) -> Vec<f64> {
    let sum = |values: &[f64]| values.iter().fold(0.0, |sum, value| sum + value);
    let all = sum(lacks);
    let own = |(lack, area): (&f64, &f64)| {
        let way = error * lack / (all * area);
        if way.is_finite() { way.clamp(-2.0 * cap, 2.0 * cap) } else { 0.0 }
    };
    let ways: Vec<f64> = lacks.iter().zip(areas).map(own).collect();
    let rest = error - ways.iter().zip(areas).fold(0.0, |sum, (way, area)| sum + way * area);
    let spread = rest / sum(areas);
    ways.iter().map(|way| (way + spread).clamp(-cap, cap)).collect()
}

/// What is added for pieces and phases, in the order of items.
fn sums<T: Sync>(items: &[T], of: impl Fn(&[T], &mut dyn FnMut(u32, u32, f64)) + Sync) -> BTreeMap<(u32, u32), f64> {
    let parts = parallel::map(items.chunks(parallel::CHUNK), |_, items| {
        let mut sums = BTreeMap::new();
        of(items, &mut |piece, phase, value| *sums.entry((piece, phase)).or_insert(0.0) += value);
        sums
    });
    let mut out = BTreeMap::new();
    for (key, sum) in parts.into_iter().flatten() {
        *out.entry(key).or_insert(0.0) += sum;
    }
    out
}
