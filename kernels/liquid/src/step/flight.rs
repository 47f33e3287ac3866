//! Liquid that flies: pieces that touch neither walls nor solids.
//!
//! A substep moves the surface with the velocity at its start, so what the liquid is accelerated by meanwhile comes a substep
//! late: after n substeps of Δt a free fall lacks ½g·t·Δt. On liquid that something holds, gravity and pressure add next to
//! nothing, and what moves with the velocity before they act has waves that neither grow nor fade. What flies moves with
//! the mean velocity of the substep, u + ½Δt·∂u/∂t. Of ∂u/∂t, gravity is that of the substep, the rest that of the substep
//! before. So the centre of mass follows gravity to second order, exactly where that is constant, and a ball that
//! spins freely, which pressure holds in part, keeps its angular momentum. ∂u/∂t is the difference of two velocities, neither
//! of which has a divergence, so that the volume stays as well as with one of them; a − (u·∇)u, with the pressure of the
//! substep before, cost a ball that spun for a third of a turn 1 % of its volume.

use crate::rows::CellRows;
use crate::sets::Sets;
use crate::step::domain::Domain;
use crate::step::motion::{LiquidCells, Motion};
use crate::velocity::{FaceFields, FaceMask};

/// Cells of a piece from which on it shows how it is accelerated: a ball of two and a half cells radius.
const LEAST_SHOWN: usize = 64;

/// What flies; on the rows of the cells, empty where nothing does.
pub(super) struct Flight {
    /// The faces of pieces that fly.
    pub faces: Vec<FaceMask>,
    /// Those of pieces whose acceleration goes on: large enough to show it, and free of all that did not fly before.
    pub steady: Vec<FaceMask>,
    /// Whether a piece that flies is large enough.
    pub is_shown: bool,
}

impl Flight {
    /// `held_before`: faces of liquid that did not fly before, on the rows of `cells`; empty where there were none.
    pub(super) fn of(cells: &LiquidCells, domain: &Domain, held_before: &[FaceMask]) -> Self {
        let mut sets = Sets::of_cells(&cells.liquid, domain.periods());
        let mut is_held = vec![false; cells.liquid.len()];
        let mut is_unsteady = vec![false; if held_before.is_empty() { 0 } else { cells.liquid.len() }];
        let mut counts = vec![0; cells.liquid.len()];
        for ([y, z], span) in cells.liquid.spans() {
            let (first, cell) = (sets.first(span.base) as usize, [span.start, y, z]);
            is_held[first] = is_held[first] || is_closed(cells, cell, span.len());
            counts[first] += span.len();
            if let Some(is_unsteady) = is_unsteady.get_mut(first) {
                *is_unsteady = *is_unsteady || any_face(cells, cell, span.len(), held_before);
            }
        }
        let flies = |sets: &mut Sets, base: u32| !is_held[sets.first(base) as usize];
        if cells.liquid.spans().all(|(_, span)| !flies(&mut sets, span.base)) {
            return Self { faces: Vec::new(), steady: Vec::new(), is_shown: false };
        }
        let mut is_shown = false;
        let (mut faces, mut steady) = (vec![0; cells.rows.len()], vec![0; cells.rows.len()]);
        for ([y, z], span) in cells.liquid.spans() {
            if flies(&mut sets, span.base) {
                let first = sets.first(span.base) as usize;
                is_shown |= counts[first] >= LEAST_SHOWN;
                let is_steady = counts[first] >= LEAST_SHOWN && !is_unsteady.get(first).is_some_and(|held| *held);
                each_side([span.start, y, z], |axis, cell| {
                    let Some(at) = cells.rows.find(cell) else { return };
                    faces[at..at + span.len()].iter_mut().for_each(|mask| *mask |= 1 << axis);
                    if is_steady {
                        steady[at..at + span.len()].iter_mut().for_each(|mask| *mask |= 1 << axis);
                    }
                });
            }
        }
        cells.images.fill(&mut faces);
        cells.images.fill(&mut steady);
        Self { faces, steady, is_shown }
    }
}

/// Whether a face of so many cells along x is in a mask.
fn any_face(cells: &LiquidCells, first: [i32; 3], count: usize, mask: &[FaceMask]) -> bool {
    let mut is_in = false;
    each_side(first, |axis, cell| {
        let masks = cells.rows.find(cell).map(|at| &mask[at..at + count]);
        is_in |= masks.is_some_and(|masks| masks.iter().any(|mask| mask >> axis & 1 == 1));
    });
    is_in
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

/// How much farther liquid flies by what pressure and viscosity did in the substep before, at most, in cells. It is far less
/// where they go on; where pieces met, they do not.
const FARTHER: f32 = 0.125;

impl Motion {
    /// The mean velocity over a substep of `seconds` in which gravity adds `gained`, m/s, on the rows of the velocity; none
    /// where nothing flies. `step`: cells moved at speed 1.
    pub(super) fn in_flight(&self, gained: [f64; 3], seconds: f64, step: f32) -> Option<FaceFields<f32>> {
        let before = self.gain.as_ref().and_then(|gain| Some((gain.changed.as_ref()?, 0.5 * seconds / gain.seconds)));
        if self.flying.is_empty() || (gained == [0.0; 3] && !self.flies_shown) {
            return None;
        }
        let most = FARTHER / step;
        let mean = |axis: usize| {
            let fall = (0.5 * gained[axis]) as f32;
            let more = |at: usize| match before {
                Some((changed, ratio)) => fall + (ratio as f32 * changed[axis][at]).clamp(-most, most),
                None => fall,
            };
            let faces = self.velocity.faces()[axis].iter().zip(&self.flying).enumerate();
            faces.map(|(at, (u, flying))| if flying >> axis & 1 == 1 { u + more(at) } else { *u }).collect()
        };
        Some([0, 1, 2].map(mean))
    }

    /// What the velocity of faces of a mask changed by in a substep, besides what gravity adds, m/s, on its rows; 0 on
    /// others. `before`: the velocity before, on the same rows.
    pub(super) fn changed(&self, before: &FaceFields<f32>, mask: &[FaceMask], pulled: [f64; 3]) -> FaceFields<f32> {
        std::array::from_fn(|axis| {
            let pulled = pulled[axis] as f32;
            let faces = self.velocity.faces()[axis].iter().zip(&before[axis]).zip(mask);
            faces.map(|((u, before), mask)| if mask >> axis & 1 == 1 { u - before - pulled } else { 0.0 }).collect()
        })
    }

    /// The faces of liquid that do not fly, on other rows.
    pub(super) fn held_on(&self, rows: &CellRows) -> Vec<FaceMask> {
        let held = self.known.iter().zip(&self.flying).map(|(known, flying)| known & !flying).collect::<Vec<_>>();
        rows.resampled(self.velocity.rows(), &held, 0)
    }

    /// Keeps what flies on other rows.
    pub(super) fn fly_on(&mut self, rows: &CellRows) {
        if !self.flying.is_empty() {
            self.flying = rows.resampled(self.velocity.rows(), &self.flying, 0);
        }
    }
}
