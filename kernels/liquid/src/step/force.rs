//! What a liquid does to the solid in it.

use crate::pressure::PressureSolver;
use crate::rows::{Cell, CellRows};
use crate::stencil::Run;
use crate::step::domain::{Obstacle, share_outside};
use crate::velocity::{FaceFields, Site};

/// Distance of a solid's surface from the middle of a cell that it cuts, at most, in cells.
const FARTHEST: f32 = 1.0;

/// How what presses on a solid changes from the middle of a cell to the solid's surface.
#[derive(Clone, Copy)]
pub(super) enum Slopes<'a> {
    /// As the pressure does from cell to cell.
    OfPressure,
    /// As pressure and viscous stress together do: by the momentum that the liquid between lost to them. `lost`: by each
    /// low face that moves, ÷ volume, m/s, 0 at others. In thick liquid the pressure alone changes by more than its weight
    /// from cell to cell, which viscous stress balances.
    OfStress { lost: &'a FaceFields<f64> },
}

/// The impulse of a pressure `q` on a solid, ÷ density · cell³: the pressure on its surface · its area, cell by cell.
/// `open`: the open share of each low face of `rows`.
pub(super) fn pressed(
    solid: Obstacle<'_>,
    rows: &CellRows,
    open: &FaceFields<f32>,
    solver: &PressureSolver,
    q: &[f64],
    slopes: Slopes<'_>,
) -> [f64; 3] {
    // Walls and nozzles close faces, too.
    let share = |axis: usize, cell: Cell, at: usize| {
        if open[axis][at] < 1.0 { 1.0 - share_outside(axis, cell, solid) } else { 0.0 }
    };
    let covered = rows.tabulate_with(|| (), |(), cell, at| [0, 1, 2].map(|axis| share(axis, cell, at)));
    let [covered, open] = [&covered, open].map(|fields| fields.each_ref().map(|field| on_solver(solver, rows, field)));
    let mut sum = [0.0; 3];
    for run in solver.stencil().runs() {
        for n in 0..run.len as usize {
            let (at, _, above) = run.neighbours(n);
            let area = [0, 1, 2].map(|axis| f64::from(covered[axis][above[axis]] - covered[axis][at]));
            if area == [0.0; 3] {
                continue;
            }
            let cell = [run.cell[0] + n as i32, run.cell[1], run.cell[2]];
            let middle = Site::Centre.of(cell);
            let away = solid.distance(middle).clamp(-FARTHEST, FARTHEST);
            let normal = solid.normal(middle).unwrap_or_default();
            let slopes = match slopes {
                Slopes::OfPressure => of_pressure(solver, &open, q, run, n),
                Slopes::OfStress { lost } => of_stress(&open, lost, run, n),
            };
            let mut pressure = q[at];
            (0..3).for_each(|axis| pressure -= slopes[axis] * f64::from(away * normal[axis]));
            (0..3).for_each(|axis| sum[axis] += pressure * area[axis]);
        }
    }
    sum
}

fn on_solver(solver: &PressureSolver, rows: &CellRows, field: &[f32]) -> Vec<f32> {
    solver.rows().resampled(rows, field, 0.0)
}

/// How a pressure changes along each axis, per cell: the mean of the differences to liquid neighbours; 0 without one.
fn of_pressure(solver: &PressureSolver, open: &FaceFields<f32>, q: &[f64], run: &Run, n: usize) -> [f64; 3] {
    let (at, below, above) = run.neighbours(n);
    [0, 1, 2].map(|axis| {
        let above = above[axis];
        let is_joined = |face: usize, other: usize| open[axis][face] > 0.0 && solver.is_liquid(other);
        let (mut sum, mut count) = (0.0, 0.0);
        if is_joined(at, below[axis]) {
            (sum, count) = (q[at] - q[below[axis]], 1.0);
        }
        if is_joined(above, above) {
            (sum, count) = (sum + q[above] - q[at], count + 1.0);
        }
        if count > 0.0 { sum / count } else { 0.0 }
    })
}

/// The momentum lost to pressure and viscosity along each axis: the mean of a cell's faces that move.
fn of_stress(open: &FaceFields<f32>, lost: &FaceFields<f64>, run: &Run, n: usize) -> [f64; 3] {
    let (at, _, above) = run.neighbours(n);
    [0, 1, 2].map(|axis| {
        let faces = [at, above[axis]].into_iter().filter(|face| open[axis][*face] > 0.0);
        let (sum, count) = faces.fold((0.0, 0.0), |(sum, count), face| (sum + lost[axis][face], count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    })
}
