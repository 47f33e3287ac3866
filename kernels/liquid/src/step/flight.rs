//! Liquid that flies: pieces that touch neither walls nor solids.
//!
//! A substep moves the surface with the velocity at its start, so what gravity adds meanwhile comes a substep late: after n
//! substeps of Δt a free fall lacks ½g·t·Δt. On liquid that something holds, gravity and pressure add next to nothing, and
//! what moves with the velocity before they act has waves that neither grow nor fade. What flies has the acceleration g as a
//! whole, whatever pressure and viscosity do within, so it moves by ½g·Δt² more, as a whole: its centre of mass follows
//! gravity to second order, exactly where that is constant.

use crate::rows::CellRows;
use crate::sets::Sets;
use crate::step::domain::Domain;
use crate::step::motion::{LiquidCells, Motion};
use crate::velocity::{FaceFields, FaceMask};

/// The faces of pieces that fly, on the rows of `cells`; empty where there are none.
pub(super) fn flying(cells: &LiquidCells, domain: &Domain) -> Vec<FaceMask> {
    let mut sets = Sets::of_cells(&cells.liquid, domain.periods());
    let mut is_held = vec![false; cells.liquid.len()];
    for ([y, z], span) in cells.liquid.spans() {
        let first = sets.first(span.base) as usize;
        is_held[first] = is_held[first] || is_closed(cells, [span.start, y, z], span.len());
    }
    let flies = |sets: &mut Sets, base: u32| !is_held[sets.first(base) as usize];
    if cells.liquid.spans().all(|(_, span)| !flies(&mut sets, span.base)) {
        return Vec::new();
    }
    let mut faces = vec![0; cells.rows.len()];
    for ([y, z], span) in cells.liquid.spans() {
        if flies(&mut sets, span.base) {
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
    /// The mean velocity over a substep in which gravity adds `gained`, m/s, on the rows of the velocity; none where nothing
    /// flies.
    pub(super) fn in_flight(&self, gained: [f64; 3]) -> Option<FaceFields<f32>> {
        if self.flying.is_empty() || gained == [0.0; 3] {
            return None;
        }
        let mean = |axis: usize| {
            let fall = (0.5 * gained[axis]) as f32;
            let faces = self.velocity.faces()[axis].iter().zip(&self.flying);
            faces.map(|(u, flying)| if flying >> axis & 1 == 1 { u + fall } else { *u }).collect()
        };
        Some([0, 1, 2].map(mean))
    }

    /// Keeps what flies on other rows.
    pub(super) fn fly_on(&mut self, rows: &CellRows) {
        if !self.flying.is_empty() {
            self.flying = rows.resampled(self.velocity.rows(), &self.flying, 0);
        }
    }
}
