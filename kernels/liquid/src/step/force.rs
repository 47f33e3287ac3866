//! What a liquid does to the solid in it.

use crate::pressure::PressureSolver;
use crate::rows::{Cell, CellRows, Finder};
use crate::step::domain::{Domain, Obstacle, share_outside};
use crate::step::motion::LiquidCells;
use crate::velocity::Site;

/// Distance of a solid's surface from the middle of a cell that it cuts, at most, in cells.
const FARTHEST: f32 = 1.0;

/// A liquid cell of whose faces a solid covers something.
pub(super) struct CutCell {
    cell: Cell,
    /// Where it is stored.
    at: usize,
    /// The area of the solid's surface in it along each axis, ÷ cell²: what is covered of its upper face less of its lower.
    area: [f64; 3],
    /// From its middle to the solid's surface, in cells.
    way: [f64; 3],
}

/// The liquid cells of whose faces a solid covers something.
pub(super) fn cut_cells(domain: &Domain, cells: &LiquidCells, solid: Obstacle<'_>) -> Vec<CutCell> {
    let (rows, open, periods) = (&cells.rows, &cells.open, domain.periods());
    // Walls and nozzles close faces, too.
    let is_covered = |axis: usize, at: usize| open[axis][at] < 1.0;
    let covered = |axis: usize, cell: Cell| match rows.find(cell) {
        Some(at) if is_covered(axis, at) => f64::from(1.0 - share_outside(axis, cell, solid)),
        _ => 0.0,
    };
    let cut = |cell: Cell| {
        let area = [0, 1, 2].map(|axis| covered(axis, periods.home(next(cell, axis, 1))) - covered(axis, cell));
        if area == [0.0; 3] {
            return None;
        }
        let middle = Site::Centre.of(cell);
        let away = solid.distance(middle).clamp(-FARTHEST, FARTHEST);
        let way = solid.normal(middle).unwrap_or_default().map(|n| f64::from(-away * n));
        Some(CutCell { cell, at: rows.find(cell)?, area, way })
    };
    let beside: Vec<Cell> = rows
        .filtered(|_, at| (0..3).any(|axis| is_covered(axis, at)))
        .iter()
        .flat_map(|cell| std::iter::once(cell).chain((0..3).map(move |axis| next(cell, axis, -1))))
        .filter(|cell| cells.liquid.find(*cell).is_some())
        .collect();
    CellRows::from_cells(&beside).iter().filter_map(cut).collect()
}

/// The cell so many cells on.
fn next(mut cell: Cell, axis: usize, by: i32) -> Cell {
    cell[axis] += by;
    cell
}

/// The impulse of a pressure `q` on a solid, ÷ density · cell³: what the liquid whose faces move loses to it.
pub(super) fn pressed(cut: &[CutCell], solver: &PressureSolver, q: &[f64]) -> [f64; 3] {
    let finder = Finder::new(solver.rows());
    let mut sum = [0.0; 3];
    for CutCell { cell, area, .. } in cut {
        let Some(at) = finder.find(*cell) else { continue };
        (0..3).for_each(|axis| sum[axis] += q[at] * area[axis]);
    }
    sum
}

/// The impulse of the liquid between the middles of cells and a solid, which rests on it, ÷ density · cell³. Along a solid the
/// pressure changes by weight alone: by what it changes from cell to cell, a jet on a plate pressed a fifth too much.
/// `gravity`: what it adds in the substep, m/s. `density`: ÷ that of the settings, of each cell.
pub(super) fn rested(cut: &[CutCell], gravity: [f64; 3], density: Option<&[f32]>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for CutCell { at, area, way, .. } in cut {
        let weight = (0..3).fold(0.0, |sum, axis| sum + gravity[axis] * way[axis]);
        let density = density.map_or(1.0, |density| f64::from(density[*at]));
        (0..3).for_each(|axis| sum[axis] += density * weight * area[axis]);
    }
    sum
}
