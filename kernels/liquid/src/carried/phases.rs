//! Where the liquids are that do not mix.

use numerics::vector::Vec3;

use crate::level_set::floor;
use crate::rows::{CellRows, Finder};
use crate::velocity::{Sampler, Site};

/// The share that each phase has of the liquid, in the cells that have points of it.
#[derive(Clone, Debug)]
pub struct PhaseShares {
    rows: CellRows,
    /// Where the phases of each cell start in `all`; then the number of all.
    first: Vec<u32>,
    /// Phases and their shares; those of a cell sum up to 1.
    all: Vec<(u32, f32)>,
}

/// Reads shares at places near each other.
pub(crate) struct PhaseReader<'a> {
    shares: &'a PhaseShares,
    sampler: Sampler<'a>,
    finder: Finder<'a>,
}

impl PhaseShares {
    /// The shares of the cells of `rows`, given the cell and the phase of each point in them.
    pub(super) fn new(rows: CellRows, mut points: Vec<(u32, u32)>) -> Self {
        points.sort_unstable();
        let (mut first, mut all) = (vec![0; rows.len() + 1], Vec::new());
        for cell in points.chunk_by(|a, b| a.0 == b.0) {
            for phase in cell.chunk_by(|a, b| a.1 == b.1) {
                all.push((phase[0].1, phase.len() as f32 / cell.len() as f32));
            }
            first[cell[0].0 as usize + 1] = all.len() as u32;
        }
        // A cell without points has none.
        (1..first.len()).for_each(|at| first[at] = first[at].max(first[at - 1]));
        Self { rows, first, all }
    }

    pub(crate) fn reader(&self) -> PhaseReader<'_> {
        PhaseReader { shares: self, sampler: Sampler::new(&self.rows), finder: Finder::new(&self.rows) }
    }

    fn of_cell(&self, at: usize) -> &[(u32, f32)] {
        &self.all[self.first[at] as usize..self.first[at + 1] as usize]
    }
}

impl PhaseReader<'_> {
    /// Calls with each phase at a place in solver cells and its share, interpolated between the middles of cells; far from all
    /// cells, those of the closest. A phase may come several times.
    pub(crate) fn each(&mut self, place: Vec3, mut call: impl FnMut(u32, f32)) {
        for (at, weight) in self.sampler.weights(Site::Centre, place).into_iter().flatten() {
            self.shares.of_cell(at).iter().for_each(|(phase, share)| call(*phase, weight * share));
        }
    }

    /// The same for those of the cell around a place, or around it where that has none.
    pub(crate) fn in_cell(&mut self, place: Vec3, mut call: impl FnMut(u32, f32)) {
        match self.finder.find(place.map(floor)) {
            Some(at) => self.shares.of_cell(at).iter().for_each(|(phase, share)| call(*phase, *share)),
            None => self.each(place, call),
        }
    }
}
