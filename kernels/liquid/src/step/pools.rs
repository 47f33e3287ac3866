//! Which liquid is on which side of thin solids.

use std::collections::VecDeque;

use crate::level_set::PhiView;
use crate::rows::{Cell, CellRows, Finder};
use crate::step::domain::{Domain, Obstacle};
use crate::step::remainder::{SHOWN, STRETCHES, cells_of};
use crate::velocity::Site;

/// Distance from a solid, in cells, within which liquid is beside it.
const BESIDE: f32 = 1.5;

/// Pools that have an account of their own, at most: the largest.
const MOST: usize = 8;

/// The volume of such a pool, in cells, at least. That of the largest may be less.
const LEAST: f64 = 27.0;

/// Layers of air, counted face to face, that belong to a pool: these, and [`ACROSS`] for each cell that liquid moves, since a diagonal
/// crosses that many.
const AROUND: usize = 3;
const ACROSS: f32 = 1.75;

const NONE: u8 = u8::MAX;
const SOLID: u8 = u8::MAX - 1;

/// Pools: liquid in cells that are connected face to face without a solid between, and the air around it.
pub(super) struct Pools {
    /// The pool of each cell; [`SOLID`] in solids, [`NONE`] where no liquid can arrive.
    of: Vec<u8>,
    count: usize,
}

impl Pools {
    /// Whether liquid is beside a thin solid.
    pub(super) fn are_needed(view: &PhiView<'_>, solid: Obstacle<'_>) -> bool {
        let is_thin = |cell: Cell, at: usize| {
            let place = Site::Centre.of(cell);
            view.phi[at] < SHOWN && solid.distance(place).abs() < BESIDE && solid.is_thin_at(place)
        };
        let parts = view
            .rows
            .map_stretches(STRETCHES, |spans| spans.iter().flat_map(cells_of).any(|(cell, at)| is_thin(cell, at)));
        parts.contains(&true)
    }

    /// The pools of cells that hold these volumes. Nothing moves farther than `reach` cells.
    pub(super) fn of(rows: &CellRows, volume: &[f32], domain: &Domain, solid: Obstacle<'_>, reach: f32) -> Self {
        let [is_free] = rows.tabulate_with(|| (), |(), cell, _| [solid.distance(Site::Centre.of(cell)) >= 0.0]);
        let cells: Vec<Cell> = rows.iter().collect();
        let (finder, periods) = (Finder::new(rows), domain.periods());
        let beside = |at: usize| {
            [0, 1, 2, 3, 4, 5].map(|n: usize| {
                let mut cell = cells[at];
                cell[n / 2] += 2 * (n % 2) as i32 - 1;
                finder.find(periods.home(cell)).filter(|at| is_free[*at])
            })
        };
        let mut seen: Vec<bool> = volume.iter().zip(&is_free).map(|(volume, free)| *volume == 0.0 || !free).collect();
        let mut pools = Vec::new();
        for first in 0..cells.len() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            let (mut members, mut sum, mut next) = (vec![first], 0.0, 0);
            while let Some(&at) = members.get(next) {
                next += 1;
                sum += f64::from(volume[at]);
                for at in beside(at).into_iter().flatten() {
                    if !std::mem::replace(&mut seen[at], true) {
                        members.push(at);
                    }
                }
            }
            pools.push((sum, members));
        }
        pools.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let count = 1 + pools.iter().skip(1).take(MOST - 1).filter(|(sum, _)| *sum >= LEAST).count();
        let mut of: Vec<u8> = is_free.iter().map(|free| if *free { NONE } else { SOLID }).collect();
        for (n, (_, members)) in pools.iter().enumerate() {
            members.iter().for_each(|at| of[*at] = n.min(count) as u8);
        }
        let layers = (ACROSS * reach).ceil() as usize + AROUND;
        let mut next: VecDeque<_> = (0..cells.len()).filter(|at| of[*at] < SOLID).map(|at| (at, 0)).collect();
        while let Some((at, gone)) = next.pop_front() {
            if gone == layers {
                continue;
            }
            for beside in beside(at).into_iter().flatten() {
                if of[beside] == NONE {
                    of[beside] = of[at];
                    next.push_back((beside, gone + 1));
                }
            }
        }
        Self { of, count }
    }

    /// How many have an account of their own; smaller ones share the number after these.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The pool that a cell is in or beside.
    pub(super) fn at(&self, at: usize) -> Option<usize> {
        (self.of[at] < SOLID).then_some(usize::from(self.of[at]))
    }

    /// Whether liquid may come to a cell only through a solid.
    pub(super) fn is_sealed(&self, at: usize) -> bool {
        self.of[at] == NONE
    }
}
