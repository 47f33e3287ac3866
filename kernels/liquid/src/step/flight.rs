//! Liquid that flies: pieces that touch neither walls nor solids.

use crate::rows::CellRows;
use crate::sets::Sets;
use crate::step::domain::Domain;
use crate::step::motion::{LiquidCells, Motion};
use crate::velocity::FaceMask;

/// The faces of pieces that fly, on the rows of the cells; empty where none does.
pub(super) fn flying(cells: &LiquidCells, domain: &Domain) -> Vec<FaceMask> {
    let mut sets = Sets::of_cells(&cells.liquid, domain.periods());
    let mut is_held = vec![false; cells.liquid.len()];
    for ([y, z], span) in cells.liquid.spans() {
        let first = sets.first(span.base) as usize;
        is_held[first] = is_held[first] || is_closed(cells, [span.start, y, z], span.len());
    }
    let mut flies = |base: u32| !is_held[sets.first(base) as usize];
    if cells.liquid.spans().all(|(_, span)| !flies(span.base)) {
        return Vec::new();
    }
    let mut faces = vec![0; cells.rows.len()];
    for ([y, z], span) in cells.liquid.spans() {
        if flies(span.base) {
            each_side([span.start, y, z], |axis, cell| {
                let Some(at) = cells.rows.find(cell) else { return };
                faces[at..at + span.len()].iter_mut().for_each(|mask| *mask |= 1 << axis);
            });
        }
    }
    cells.images.fill(&mut faces);
    faces
}

/// Whether a face of so many cells along x is closed in part.
fn is_closed(cells: &LiquidCells, first: [i32; 3], count: usize) -> bool {
    let mut is_closed = false;
    each_side(first, |axis, cell| {
        let shares = cells.rows.find(cell).map(|at| &cells.open[axis][at..at + count]);
        is_closed |= shares.is_none_or(|shares| shares.iter().any(|share| *share < 1.0));
    });
    is_closed
}

/// Calls with each axis and the cells whose low faces along it are the low and the high faces of a cell.
fn each_side(cell: [i32; 3], mut call: impl FnMut(usize, [i32; 3])) {
    for side in 0..6 {
        let mut beside = cell;
        beside[side / 2] += side as i32 % 2;
        call(side / 2, beside);
    }
}

impl Motion {
    /// Keeps what flies on other rows.
    pub(super) fn fly_on(&mut self, rows: &CellRows) {
        if !self.flying.is_empty() {
            self.flying = rows.resampled(self.velocity.rows(), &self.flying, 0);
        }
    }
}
