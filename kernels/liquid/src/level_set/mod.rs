//! The level set of a liquid's surface: which cells are inside, and the distance to the surface in a band around it.
//!
//! Each step φ follows the flow ([`LevelSet::advect`]: first-order semi-Lagrangian, good for signs and little else), is made
//! exact at the surface by [`crate::markers`], and becomes a distance again by [`LevelSet::fill`].
//!
//! Promise: memory and time follow the liquid and its surface; the bits are the same on any number of threads. The unit of
//! length is the cell: cell [x, y, z] reaches from there to [x + 1, y + 1, z + 1] and φ is that of its middle. At the ends
//! of the domain φ goes on as it is there, so a surface meets a wall at a right angle; beyond open sides is air. Limit: coordinates beyond 2²⁰
//! cells lose the digits that place a surface within a cell.

mod contact;
pub(crate) mod cubic;
mod fill;
mod refine;
mod sample;
mod sides;
#[cfg(test)]
mod tests;
mod view;

use numerics::vector::{Vec3, add, length, scale, sub};
use serde::{Deserialize, Serialize};

pub use contact::CONTACT;
pub use refine::refined;
pub use sample::PhiSampler;
pub(crate) use sample::floor;
pub use sides::{Held, outward};
pub(crate) use sides::{Sides, held, into};
pub use view::PhiView;
pub(crate) use view::RowBlocks;

use crate::rows::{Cell, CellRows};
use crate::stencil::Stencil;
use contact::Contact;

/// Distance, in cells, to which φ is known on either side of the surface; beyond it is this much.
pub const BAND: f32 = 5.0;

/// Cells that a solid moves from which on it may leave behind what was the half of it that liquid is continued into.
const PASSING: f32 = 0.5;

/// A distance, in cells, of a place in them; negative inside.
pub type Distance<'a> = dyn Fn(Vec3) -> f32 + Sync + 'a;

/// What φ becomes at a place in cells, given φ there.
pub type PhiChange<'a> = dyn Fn(Vec3, f32) -> f32 + Sync + 'a;

/// How far the liquid moves in one step.
pub trait Flow: Sync {
    /// The way, in cells, from each point, a place in cells. Points of successive calls are near each other, which a
    /// reader may make use of.
    fn reader(&self) -> impl FnMut(Vec3) -> Vec3;

    /// The way from the middle of each cell; cells of successive calls are near each other.
    fn centre_reader(&self) -> impl FnMut(Cell) -> Vec3 {
        let mut way = self.reader();
        move |cell| way(cell.map(|x| x as f32 + 0.5))
    }

    /// What is left of a way from a point, where a thin solid is in it: forwards in time, or backwards where `direction` is
    /// −1 instead of 1.
    fn held(&self, _from: Vec3, _way: Vec3, _direction: f32) -> Option<Held> {
        None
    }

    /// Cells that the surfaces of solids move, at most.
    fn solid_way(&self) -> f32 {
        0.0
    }
}

impl<F: Fn(Vec3) -> Vec3 + Sync> Flow for F {
    fn reader(&self) -> impl FnMut(Vec3) -> Vec3 {
        move |point| self(point)
    }
}

/// φ, negative inside the liquid, at the centres of the cells inside and of those in the band around the surface.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LevelSet {
    /// The stored cells; active are those whose φ is a distance.
    stencil: Stencil,
    phi: Vec<f32>,
    low: Cell,
    high: Cell,
    /// For x, y and z whether air comes in at the low side and at the high side.
    open: OpenSides,
}

/// For x, y and z whether the low side and the high side of a domain let air in.
pub type OpenSides = [[bool; 2]; 3];

impl LevelSet {
    /// The level set of a domain `low` ≤ cell < `high`, from values that are distances already, at the cells of `rows`;
    /// what is not among them is outside. Values must be finite.
    ///
    /// # Panics
    /// Where there is not one value for each cell.
    pub fn new(rows: &CellRows, phi: &[f32], low: Cell, high: Cell) -> Self {
        assert_eq!(rows.len(), phi.len(), "one value for each cell");
        let rows_within = rows.clipped(low, high);
        let phi = rows_within.resampled(rows, phi, BAND).into_iter().map(|phi| phi.clamp(-BAND, BAND)).collect();
        let stencil = Stencil::around(CellRows::default(), 1);
        let mut set = Self { stencil, phi: Vec::new(), low, high, open: [[false; 2]; 3] };
        set.store(&rows_within, phi, 0);
        set
    }

    /// The same with air beyond these sides, that follows liquid which moves away from them.
    #[must_use]
    pub(crate) fn open_at(mut self, open: OpenSides) -> Self {
        if open != self.open {
            self.open = open;
            let (rows, phi) = (self.rows().clone(), std::mem::take(&mut self.phi));
            self.store(&rows, phi, 0);
        }
        self
    }

    /// The stored cells.
    pub fn rows(&self) -> &CellRows {
        self.stencil.rows()
    }

    /// The cells whose φ is a distance; the others are [`BAND`] inside or outside.
    pub fn band(&self) -> &CellRows {
        self.stencil.active()
    }

    /// φ of each stored cell.
    pub fn phi(&self) -> &[f32] {
        &self.phi
    }

    /// The domain: `low` ≤ cell < `high`.
    pub fn domain(&self) -> (Cell, Cell) {
        (self.low, self.high)
    }

    /// φ to read and to extract.
    pub fn view(&self) -> PhiView<'_> {
        let (low, high) = (self.low, self.high);
        PhiView { rows: self.rows(), phi: &self.phi, outside: BAND, low, high }
    }

    /// The sides that let air in.
    pub(crate) fn open_sides(&self) -> OpenSides {
        self.open
    }

    pub(crate) fn stencil(&self) -> &Stencil {
        &self.stencil
    }

    pub(crate) fn parts(&mut self) -> (&Stencil, &mut [f32]) {
        (&self.stencil, &mut self.phi)
    }

    /// Moves φ by a flow that moves nothing farther than `reach` cells, and stores the cells that this needs. φ is a
    /// distance again after [`Self::fill`].
    pub fn advect(&mut self, flow: &impl Flow, reach: f32) {
        let (rows, phi) = (self.rows().clone(), std::mem::take(&mut self.phi));
        self.store(&rows, phi.clone(), reach.ceil() as i32);
        let has_open = self.open.as_flattened().contains(&true);
        // Beyond open sides is what the cells there say.
        let beyond = |side: usize| std::array::from_fn(|axis| i32::from(self.open[axis][side]));
        let [below, above]: [Cell; 2] = [beyond(0), beyond(1)];
        let low = [0, 1, 2].map(|axis| self.low[axis] - below[axis]);
        let high = [0, 1, 2].map(|axis| self.high[axis] + above[axis]);
        let before = PhiView { rows: &rows, phi: &phi, outside: BAND, low, high };
        let far = far_from_surface(reach);
        // What is behind a thin solid does not come through it, whether liquid moves or the solid does.
        let solid_way = flow.solid_way();
        let may_be_passed = solid_way > PASSING;
        let far = if may_be_passed { far.max(far_from_surface(solid_way)) } else { far };
        let mut phi = std::mem::take(&mut self.phi);
        self.stencil.update([&mut phi], |runs, first, [phi]| {
            let (mut way, mut way_at, mut sampler) = (flow.reader(), flow.centre_reader(), PhiSampler::new(before));
            for run in runs {
                for n in 0..run.len as usize {
                    let value = &mut phi[run.at as usize + n - first];
                    let [x, y, z] = run.cell;
                    let cell = [x + n as i32, y, z];
                    let is_near_open = has_open && self.is_near_open(cell);
                    if value.abs() < far || is_near_open {
                        let (at, way_here) = (cell.map(|x| x as f32 + 0.5), way_at(cell));
                        let moved = length(way_here).max(solid_way);
                        if value.abs() > far_from_surface(moved) && !is_near_open {
                            continue;
                        }
                        let middle = sub(at, scale(way_here, 0.5));
                        let back = scale(way(middle), -1.0);
                        let mut carried = sampler.at(add(at, back));
                        if is_near_open {
                            carried = carried.max(self.air_from(at, back));
                        }
                        let is_reached = carried <= 0.0 && (*value > 0.0 || may_be_passed);
                        // φ above it is of this side.
                        *value = match if is_reached { flow.held(at, back, -1.0) } else { None } {
                            Some(held) => {
                                sampler.at(add(add(at, held.way), scale(held.normal, contact::ABOVE_THIN[0])))
                            }
                            None => carried,
                        };
                    }
                }
            }
        });
        self.phi = phi;
    }

    /// Changes φ of the cells `low` ≤ cell < `high` to what `change` makes of the middle of the cell and its φ; the least
    /// of φ and a distance adds a shape. Follow with [`Self::fill`] where the result is no distance.
    pub fn change(&mut self, low: Cell, high: Cell, change: &PhiChange<'_>) {
        let low = [0, 1, 2].map(|axis| low[axis].max(self.low[axis]));
        let high = [0, 1, 2].map(|axis| high[axis].min(self.high[axis]));
        let part = CellRows::cuboid(low, high);
        let old = part.resampled(self.rows(), &self.phi, BAND);
        let at = |cell: Cell| old[part.find(cell).unwrap_or_default()];
        let new: Vec<f32> = part.tabulate(|cell| change(cell.map(|x| x as f32 + 0.5), at(cell)).clamp(-BAND, BAND));
        let rows = self.rows().union(&part);
        let mut phi = rows.resampled(self.rows(), &self.phi, BAND);
        rows.for_each_shared(&part, |to, from, len| phi[to..to + len].copy_from_slice(&new[from..from + len]));
        self.store(&rows, phi, 0);
    }

    /// Makes a plane between cells the surface where one side of it is liquid and the other is air. Follow with
    /// [`Self::fill`].
    pub(crate) fn part_at(&mut self, axis: usize, plane: i32) {
        let before = self.clone();
        let (mut low, mut high) = (self.low, self.high);
        (low[axis], high[axis]) = (plane - BAND as i32, plane + BAND as i32);
        self.change(low, high, &|place, phi| {
            let away = place[axis] - plane as f32;
            let mut opposite = place;
            opposite[axis] -= 2.0 * away;
            let other = before.rows().find(opposite.map(|x| x.floor() as i32)).map_or(BAND, |at| before.phi[at]);
            if (phi < 0.0) == (other < 0.0) { phi } else { phi.abs().min(away.abs()).copysign(phi) }
        });
    }

    /// Lowers φ of each stored cell by one of `by`, less than the width of a cell. Follow with [`Self::fill`].
    pub(crate) fn lower(&mut self, by: &[f32]) {
        for (phi, by) in self.phi.iter_mut().zip(by) {
            *phi -= by;
        }
    }

    /// Makes cells air, and φ around them a distance again; farther away it stays as it is.
    pub(crate) fn take_out(&mut self, cells: &CellRows) {
        let mut kept = self.phi.clone();
        let phi = &mut self.phi;
        self.stencil.rows().for_each_shared(cells, |from, _, len| phi[from..from + len].fill(BAND));
        self.fill();
        self.stencil.rows().for_each_shared(&cells.dilated(BAND as i32), |from, _, len| {
            kept[from..from + len].copy_from_slice(&self.phi[from..from + len]);
        });
        self.phi = kept;
        self.copy_to_walls();
    }

    /// Makes the surface go on into a solid that it wets, to a depth of [`CONTACT`] cells, beyond which there is no liquid.
    /// `solid` is the distance from it, in cells, negative inside; `face`, the width of the faces that it may leave open, in
    /// cells. φ goes on as it is above the solid: a film thinner than a cell then has one surface, not two that the grid
    /// cannot tell apart, and a level pool stays level. In a thin solid each half has φ of its own side.
    pub fn meet(&mut self, solid: &Distance<'_>, face: f32) {
        let (rows, phi) = (self.rows().clone(), std::mem::take(&mut self.phi));
        let before = PhiView { rows: &rows, phi: &phi, ..self.view() };
        let start = || Contact::new(solid, before, face);
        let [phi] = rows.tabulate_with(start, |contact, cell, n| {
            [contact.phi(cell.map(|x| x as f32 + 0.5), phi[n]).clamp(-BAND, BAND)]
        });
        self.store(&rows, phi, 0);
    }

    /// Makes φ a distance again: kept at the cells next to the surface, at most 1 there; elsewhere by the eikonal equation.
    pub fn fill(&mut self) {
        self.copy_to_walls();
        fill::fill(&self.stencil, &mut self.phi);
    }

    /// Replaces φ and chooses what is stored: the band, wider by `by` cells, the inside, and a ring around both.
    fn store(&mut self, rows: &CellRows, phi: Vec<f32>, by: i32) {
        let near = rows.filtered(|cell, at| phi[at].abs() < BAND || phi[at] < 0.0 && self.is_near_open(cell));
        let active = near.rounded_within(by, self.low, self.high);
        let inside = rows.filtered(|_, at| phi[at] < 0.0).clipped(self.low, self.high);
        let stored = active.dilated(1).union(&inside);
        self.phi = stored.resampled(rows, &phi, BAND);
        self.stencil = Stencil::within(stored, active);
        self.copy_to_walls();
    }

    /// How far beyond an open side that is behind it, in cells, the way of what comes to a place began; negative inside.
    fn air_from(&self, at: Vec3, back: Vec3) -> f32 {
        let mut farthest = -BAND;
        for axis in 0..3 {
            let from = at[axis] + back[axis];
            let [below, above] = self.open[axis];
            if below && back[axis] < 0.0 {
                farthest = farthest.max(self.low[axis] as f32 - from);
            }
            if above && back[axis] > 0.0 {
                farthest = farthest.max(from - self.high[axis] as f32);
            }
        }
        farthest
    }

    /// Whether the air beyond an open side is in a cell's band.
    fn is_near_open(&self, cell: Cell) -> bool {
        (0..3).any(|axis| {
            let depths = [cell[axis] - self.low[axis], self.high[axis] - 1 - cell[axis]];
            (0..2).any(|side| self.open[axis][side] && depths[side] < BAND as i32)
        })
    }

    /// Cells just beyond the domain get φ of the cell next to them, so that no surface is seen along walls; beyond open
    /// sides it goes on, where the surface of air that has come in may be within half a cell of them.
    fn copy_to_walls(&mut self) {
        let (low, high, open) = (self.low, self.high, self.open);
        let within = |x: i32, axis: usize| x.clamp(low[axis], high[axis] - 1);
        let rows = self.stencil.rows();
        for ([y, z], spans) in rows.rows() {
            let whole = within(y, 1) != y || within(z, 2) != z;
            for span in spans {
                if !whole && low[0] <= span.start && span.end <= high[0] {
                    continue;
                }
                let ends = [span.start..span.start + 1, span.end - 1..span.end];
                let all = [span.start..span.end, 0..0];
                for x in if whole { all } else { ends }.into_iter().flatten() {
                    let inner = [within(x, 0), within(y, 1), within(z, 2)];
                    if inner != [x, y, z] {
                        let phi = rows.find(inner).map_or(BAND, |at| self.phi[at]);
                        let cell = [x, y, z];
                        let is_open = |axis: usize| match cell[axis] {
                            at if at < low[axis] => open[axis][0],
                            at => at >= high[axis] && open[axis][1],
                        };
                        self.phi[span.at(x)] =
                            if phi > -1.0 && (0..3).any(is_open) { (phi + 1.0).min(BAND) } else { phi };
                    }
                }
            }
        }
    }
}

/// |φ| from which on a cell cannot come next to the surface in a step. φ may fall short of the distance by a fifth.
pub(crate) fn far_from_surface(reach: f32) -> f32 {
    1.25 * reach + 1.5
}

/// Where a point goes in a step: third order (Ralston 1962).
#[inline]
pub(crate) fn displacement(flow: &mut impl FnMut(Vec3) -> Vec3, from: Vec3) -> Vec3 {
    displacements(flow, from)[1]
}

/// The same by the midpoint method, to second order, and to third order.
#[inline]
pub(crate) fn displacements(flow: &mut impl FnMut(Vec3) -> Vec3, from: Vec3) -> [Vec3; 2] {
    let first = flow(from);
    let second = flow(add(from, scale(first, 0.5)));
    let third = flow(add(from, scale(second, 0.75)));
    let mean = |axis: usize| (2.0 * first[axis] + 3.0 * second[axis] + 4.0 * third[axis]) * (1.0 / 9.0);
    [second, std::array::from_fn(mean)]
}
