//! The pressure that makes a velocity free of divergence.
//!
//! Liquid cells have a pressure at their centre; air has pressure 0 at the surface, whose distance from the centre comes
//! from the level set (ghost fluid: Gibou et al. 2002); solids cut faces down to their open share (Batty et al. 2007).
//! Solved by conjugate gradients in `f64`, preconditioned by a multigrid cycle in `f32`, for the change of the pressure
//! of the last step: a liquid at rest takes no iteration.
//!
//! Unknown: q = pressure · Δt ÷ (reference density · cell), m/s.

mod closed;
mod coarsen;
mod cycle;
mod dense;
mod level;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::fields::{add_scaled, advance, dot, largest, scale_and_add};
use crate::rows::{Cell, CellRows, Finder, Images, Periods};
use crate::stencil::Stencil;
use crate::velocity::FaceFields;

use closed::Closed;
use cycle::Multigrid;
use level::{CellKind, HALO, Level, SurfaceDistances};

/// Depth of the centre of a liquid cell below the surface, at least, in cells: rounding must not turn cells whose centre the
/// surface goes through into liquid and back.
pub const LEAST_DEPTH: f32 = 2e-5;

/// Distance of the surface from the centre of a liquid cell along an axis, in cells: bounds the matrix.
const SURFACE_DISTANCE: [f32; 2] = [1e-6, 2.0];

/// The grid that a pressure is solved on. Cells that are not stored are solid.
#[derive(Clone, Copy, Debug)]
pub struct PressureGrid<'a> {
    /// The stored cells: liquid ones, and those next to their open faces.
    pub rows: &'a CellRows,
    /// Signed distance of the surface from each centre, in cells; negative inside liquid.
    pub level_set: &'a [f32],
    /// Of the low face of each cell along x, y and z: its open share, times the reference density ÷ the density there.
    pub weights: [&'a [f32]; 3],
    /// After how many cells the grid repeats. Images next to liquid are stored, too.
    pub periods: Periods,
}

/// When a solve ends.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Largest net flow into or out of a cell, m/s (divergence · cell).
    pub flow: f64,
    /// Most iterations.
    pub iterations: u32,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solved {
    /// Iterations taken.
    pub iterations: u32,
    /// Largest net flow into or out of a cell that is left, m/s.
    pub flow: f64,
    /// The net inflow, m/s a cell, that no pressure can drive out of a component that is closed all round. The largest.
    pub unbalanced: f64,
}

/// The matrix of a grid, ready to be solved for any velocity.
#[derive(Clone, Debug)]
pub struct PressureSolver {
    multigrid: Multigrid,
    distances: SurfaceDistances,
    closed: Closed,
}

impl PressureSolver {
    /// Sets the equations up.
    ///
    /// # Panics
    /// Where a field does not have one value a cell.
    pub fn new(grid: &PressureGrid<'_>) -> Self {
        assert!(grid.weights.iter().chain([&grid.level_set]).all(|field| field.len() == grid.rows.len()));
        let [is_liquid] = grid.rows.tabulate_with(
            || Finder::new(grid.rows),
            |finder, cell, at| [grid.level_set[at] < -LEAST_DEPTH && is_open(grid, finder, cell, at)],
        );
        let liquid = grid.rows.filtered(|cell, at| is_liquid[at] && grid.periods.holds(cell));
        let stencil = Stencil::within(grid.periods.stored(liquid.dilated(HALO), HALO), liquid);
        let rows = stencil.rows();
        let images = grid.periods.images(rows);
        let mut level_set = rows.resampled(grid.rows, grid.level_set, f32::NAN);
        images.fill(&mut level_set);
        let mut kinds: Vec<_> =
            level_set.iter().map(|phi| if *phi >= -LEAST_DEPTH { CellKind::Air } else { CellKind::Solid }).collect();
        stencil.runs().iter().for_each(|run| kinds[run.range()].fill(CellKind::Liquid));
        images.fill(&mut kinds);
        let mut weights = grid.weights.map(|weights| rows.resampled(grid.rows, weights, 0.0));
        images.fill_each(&mut weights);
        let distances = surface_distances(&stencil, &level_set, &images);
        let finest = Level::new(stencil, kinds, weights, &distances, images);
        let closed = Closed::find(&finest);
        Self { multigrid: Multigrid::new(finest, &distances), distances, closed }
    }

    /// The cells that fields of this solver are stored for.
    pub fn rows(&self) -> &CellRows {
        self.multigrid.finest().rows()
    }

    /// The images among them.
    pub(crate) fn images(&self) -> &Images {
        &self.multigrid.finest().images
    }

    /// The liquid cells, and their neighbours.
    pub fn stencil(&self) -> &Stencil {
        &self.multigrid.finest().stencil
    }

    /// Solves for the pressure `q` that drives out the net inflow of each cell, Σ weight · velocity inwards, m/s, given
    /// in `inflow`. `q` is the first guess on entry. Both on [`PressureSolver::rows`]; cells that are not liquid are set
    /// to 0. `inflow` is left as the net inflow that remains.
    pub fn solve(&self, inflow: &mut [f64], q: &mut [f64], stop: Stop) -> Solved {
        let solved = self.solve_inside(inflow, q, stop);
        self.images().fill(q);
        solved
    }

    fn solve_inside(&self, inflow: &mut [f64], q: &mut [f64], stop: Stop) -> Solved {
        let finest = self.multigrid.finest();
        clear_outside(finest, inflow);
        clear_outside(finest, q);
        let residual = inflow;
        let unbalanced = self.closed.subtract_means(residual);
        let mut product = vec![0.0; q.len()];
        finest.apply(q, &mut product);
        add_scaled(residual, -1.0, &product);
        let mut solved = Solved { iterations: 0, flow: largest(residual), unbalanced };
        if solved.flow <= stop.flow {
            return solved;
        }
        if dot(q, &product) > 0.0 {
            solved.flow = self.improve_guess(q, residual, &mut product);
        }
        let mut workspace = self.multigrid.workspace();
        let (mut direction, mut better) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        let mut energy_before = 0.0;
        while solved.flow > stop.flow && solved.iterations < stop.iterations {
            let energy = self.multigrid.solve(&mut workspace, residual, solved.flow, &mut better);
            let is_shifted = self.closed.subtract_means(&mut better) != 0.0;
            let energy = if is_shifted { dot(residual, &better) } else { energy };
            let share = if solved.iterations == 0 { 0.0 } else { energy / energy_before };
            scale_and_add(&mut direction, share, &better);
            finest.apply(&mut direction, &mut product);
            let curvature = dot(&direction, &product);
            // Nothing but rounding is left.
            if energy.is_nan() || curvature.is_nan() || energy <= 0.0 || curvature <= 0.0 {
                break;
            }
            let length = energy / curvature;
            solved.flow = advance([&mut *q, &mut *residual], length, [&direction, &product]);
            energy_before = energy;
            solved.iterations += 1;
        }
        solved
    }

    /// Improves a first guess, not 0, that solves the equations but for `residual`. Returns the largest entry of what that is then.
    fn improve_guess(&self, q: &mut [f64], residual: &mut [f64], product: &mut [f64]) -> f64 {
        let finest = self.multigrid.finest();
        // Where the surface has come near the centre of a cell, the old pressure there would drive a hundred times the flow:
        // cells beside air take the pressure that their neighbours leave them.
        let mut change: Vec<f64> = (finest.surface.iter().zip(&finest.inverse_diagonal).zip(&*residual))
            .map(|((surface, inverse), residual)| if *surface > 0.0 { f64::from(*inverse) * residual } else { 0.0 })
            .collect();
        finest.apply(&mut change, product);
        add_scaled(q, 1.0, &change);
        add_scaled(residual, -1.0, product);
        // The multiple of the guess with the least error, which may be a small one.
        finest.apply(q, product);
        let curvature = dot(q, product);
        if curvature > 0.0 {
            let more = dot(q, residual) / curvature;
            q.iter_mut().for_each(|q| *q *= 1.0 + more);
            add_scaled(residual, -more, product);
        }
        largest(residual)
    }

    /// The liquid cells of each component that meets no air, as ranges of a field.
    pub(crate) fn closed_components(&self) -> &[Vec<Range<usize>>] {
        self.closed.components()
    }

    /// The net inflow that no pressure can drive out, taken from `inflow`: its mean over each component that is closed
    /// all round. Returns the largest.
    pub(crate) fn balance(&self, inflow: &mut [f64]) -> f64 {
        clear_outside(self.multigrid.finest(), inflow);
        self.closed.subtract_means(inflow)
    }

    /// An approximate pressure for a net inflow whose largest entry is `largest`, above 0.
    pub(crate) fn precondition(&self, workspace: &mut PressureWorkspace, inflow: &[f64], largest: f64, q: &mut [f64]) {
        self.multigrid.solve(&mut workspace.0, inflow, largest, q);
        self.closed.subtract_means(q);
    }

    /// The fields that [`PressureSolver::precondition`] works on.
    pub(crate) fn workspace(&self) -> PressureWorkspace {
        PressureWorkspace(self.multigrid.workspace())
    }

    /// Whether a cell of a field is liquid.
    pub(crate) fn is_liquid(&self, at: usize) -> bool {
        self.multigrid.finest().kinds[at] == CellKind::Liquid
    }

    /// Whether a cell of a field is air.
    pub(crate) fn is_air(&self, at: usize) -> bool {
        self.multigrid.finest().kinds[at] == CellKind::Air
    }

    /// The distance of the surface from the liquid cell beside the low face of each cell, in cells; 1 where the face is
    /// not between liquid and air.
    pub(crate) fn surface_distances(&self) -> &[Vec<f32>; 3] {
        &self.distances
    }

    /// The inverse of the matrix's diagonal; 0 where the cell is not liquid.
    pub(crate) fn inverse_diagonal(&self) -> &[f32] {
        &self.multigrid.finest().inverse_diagonal
    }

    /// Calls `change` with the low face (axis, cell) of each cell that has liquid on one side at least, and what the
    /// pressure `q` takes from the velocity there for a density that is the reference density: the difference of q over
    /// the distance of the cells, or of cell and surface.
    pub fn for_each_gradient(&self, q: &[f64], mut change: impl FnMut(usize, usize, f64)) {
        (0..3).for_each(|axis| self.for_each_gradient_along(axis, q, |at, gradient| change(axis, at, gradient)));
    }

    /// The same along one axis.
    pub(crate) fn for_each_gradient_along(&self, axis: usize, q: &[f64], mut change: impl FnMut(usize, f64)) {
        let (kinds, images) = (&self.multigrid.finest().kinds, self.images());
        let gradient = |below: usize, above: usize| {
            (q[images.home(above)] - q[images.home(below)]) / f64::from(self.distances[axis][above])
        };
        for run in self.stencil().runs() {
            let at = run.at as usize;
            let [below, above] = [[at - 1, at + 1], run.y.map(|at| at as usize), run.z.map(|at| at as usize)][axis];
            for n in 0..run.len as usize {
                let (below, at, above) = (below + n, at + n, above + n);
                change(at, gradient(below, at));
                // The faces above liquid are the low faces of other cells.
                if kinds[above] != CellKind::Liquid {
                    change(images.home(above), gradient(at, above));
                }
            }
        }
    }
}

/// The density at each low face: the mean of the liquid cells beside it, where φ < 0; 1 where there is none.
pub(crate) fn face_densities(rows: &CellRows, level_set: &[f32], density: &[f32]) -> FaceFields<f32> {
    let of = |at: usize| if level_set[at] < 0.0 { Some(density[at]) } else { None };
    rows.tabulate_with(
        || Finder::new(rows),
        |finder, cell, at| {
            [0, 1, 2].map(|axis| {
                let mut below = cell;
                below[axis] -= 1;
                match (finder.find(below).and_then(of), of(at)) {
                    (Some(a), Some(b)) => 0.5 * (a + b),
                    (Some(one), None) | (None, Some(one)) => one,
                    (None, None) => 1.0,
                }
            })
        },
    )
}

/// Whether a face of the cell is open.
fn is_open(grid: &PressureGrid<'_>, finder: &Finder<'_>, cell: Cell, at: usize) -> bool {
    (0..3).any(|axis| {
        let mut above = cell;
        above[axis] += 1;
        let weights = grid.weights[axis];
        weights[at] > 0.0 || finder.find(above).is_some_and(|above| weights[above] > 0.0)
    })
}

/// The fields that a preconditioner works on.
#[derive(Clone, Debug)]
pub(crate) struct PressureWorkspace(cycle::Workspace);

fn clear_outside(level: &Level, field: &mut [f64]) {
    for (value, kind) in field.iter_mut().zip(&level.kinds) {
        if *kind != CellKind::Liquid {
            *value = 0.0;
        }
    }
    level.images.clear(field);
}

/// For each low face between liquid and air, how far from the centre of the liquid cell the surface is, in cells.
fn surface_distances(stencil: &Stencil, level_set: &[f32], images: &Images) -> SurfaceDistances {
    let mut out: SurfaceDistances = std::array::from_fn(|_| vec![1.0; level_set.len()]);
    let distance = |at: usize, air: usize| {
        let distance = level_set[at] / (level_set[at] - level_set[air]);
        distance.clamp(SURFACE_DISTANCE[0], SURFACE_DISTANCE[1])
    };
    // Above liquid, the face is that of the air: another part of the fields.
    let beyond = stencil.update_and_fold(out.each_mut().map(|field| &mut field[..]), |runs, first, out| {
        let mut beyond = Vec::new();
        for run in runs {
            for n in 0..run.len as usize {
                let (at, below, above) = run.neighbours(n);
                for axis in 0..3 {
                    if level_set[below[axis]] >= -LEAST_DEPTH {
                        out[axis][at - first] = distance(at, below[axis]);
                    }
                    if level_set[above[axis]] >= -LEAST_DEPTH {
                        beyond.push((axis, above[axis], distance(at, above[axis])));
                    }
                }
            }
        }
        beyond
    });
    beyond.into_iter().flatten().for_each(|(axis, face, distance)| out[axis][face] = distance);
    // Liquid below a side that repeats has set the image of the face.
    let is_air = |at: usize| level_set[at] >= -LEAST_DEPTH;
    for (axis, distances) in out.iter_mut().enumerate() {
        images.give_home(axis, distances, is_air);
        images.fill(distances);
    }
    out
}
