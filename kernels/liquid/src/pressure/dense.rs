//! The coarsest grid, solved directly.

use super::level::{CellKind, Level};

/// L·D·Lᵀ of the matrix of a small grid.
#[derive(Clone, Debug)]
pub(super) struct Factors {
    /// Where the values of the liquid cells are.
    cells: Vec<usize>,
    /// The rows of L below its diagonal of ones.
    lower: Vec<f64>,
    /// 1/D; 0 where a component that meets no air has no last pivot.
    inverse_pivots: Vec<f64>,
}

/// Share of a diagonal entry below which a pivot is rounding alone.
const ROUNDING: f64 = 1e-6;

impl Factors {
    pub(super) fn new(level: &Level) -> Self {
        let rows = level.rows();
        let cells: Vec<usize> = level.stencil.active().iter().filter_map(|cell| rows.find(cell)).collect();
        let n = cells.len();
        let mut number = vec![None; rows.len()];
        cells.iter().enumerate().for_each(|(i, at)| number[*at] = Some(i));
        let mut lower = vec![0.0; n * n];
        let mut diagonal = vec![0.0; n];
        for run in level.stencil.runs() {
            for step in 0..run.len as usize {
                let at = run.at as usize + step;
                let Some(row) = number[at].filter(|_| level.kinds[at] == CellKind::Liquid) else { continue };
                diagonal[row] += f64::from(level.surface[at]);
                let above = [at + 1, run.y[1] as usize + step, run.z[1] as usize + step];
                let below = [at - 1, run.y[0] as usize + step, run.z[0] as usize + step];
                for axis in 0..3 {
                    for (neighbour, face) in [(below[axis], at), (above[axis], above[axis])] {
                        let weight = f64::from(level.weights[axis][face]);
                        diagonal[row] += weight;
                        if let Some(column) = number[neighbour] {
                            lower[row * n + column] -= weight;
                        }
                    }
                }
            }
        }
        let inverse_pivots = factor(&mut lower, &diagonal);
        Self { cells, lower, inverse_pivots }
    }

    pub(super) fn solve(&self, b: &[f32], q: &mut [f32]) {
        let n = self.cells.len();
        let mut x: Vec<f64> = self.cells.iter().map(|at| f64::from(b[*at])).collect();
        for row in 0..n {
            let known: f64 = (0..row).map(|column| self.lower[row * n + column] * x[column]).sum();
            x[row] -= known;
        }
        for (x, inverse) in x.iter_mut().zip(&self.inverse_pivots) {
            *x *= inverse;
        }
        for row in (0..n).rev() {
            let value = x[row];
            for column in 0..row {
                x[column] -= self.lower[row * n + column] * value;
            }
        }
        for (at, x) in self.cells.iter().zip(x) {
            q[*at] = x as f32;
        }
    }
}

/// Replaces the entries below the diagonal by those of L; returns 1/D.
fn factor(lower: &mut [f64], diagonal: &[f64]) -> Vec<f64> {
    let n = diagonal.len();
    let mut inverse_pivots = vec![0.0; n];
    for row in 0..n {
        let (before, own) = lower.split_at_mut(row * n);
        let own = &mut own[..n];
        let mut pivot = diagonal[row];
        for column in 0..row {
            let other = &before[column * n..][..column];
            let known: f64 = (0..column).map(|k| own[k] * other[k]).sum();
            own[column] -= known;
        }
        for column in 0..row {
            let product = own[column];
            own[column] *= inverse_pivots[column];
            pivot -= product * own[column];
        }
        inverse_pivots[row] = if pivot > ROUNDING * diagonal[row] { 1.0 / pivot } else { 0.0 };
    }
    inverse_pivots
}
