//! The coarsest grid, solved directly.

use crate::dense::DenseFactors;

use super::level::Level;

/// The factored matrix of a small grid.
#[derive(Clone, Debug)]
pub(super) struct Factors {
    /// Where the values of the liquid cells are.
    cells: Vec<usize>,
    factors: DenseFactors,
}

impl Factors {
    pub(super) fn new(level: &Level) -> Self {
        let cells: Vec<usize> = level.stencil.runs().iter().flat_map(|run| run.range()).collect();
        let n = cells.len();
        let mut number = vec![None; level.rows().len()];
        cells.iter().enumerate().for_each(|(i, at)| number[*at] = Some(i));
        let mut rows = vec![0.0; n * n];
        let runs = level.stencil.runs().iter();
        for (row, (run, step)) in runs.flat_map(|run| (0..run.len as usize).map(move |step| (run, step))).enumerate() {
            let (at, below, above) = run.neighbours(step);
            rows[row * n + row] += f64::from(level.surface[at]);
            for axis in 0..3 {
                for (neighbour, face) in [(below[axis], at), (above[axis], above[axis])] {
                    let weight = f64::from(level.weights[axis][face]);
                    rows[row * n + row] += weight;
                    if let Some(column) = number[level.images.home(neighbour)] {
                        rows[row * n + column] -= weight;
                    }
                }
            }
        }
        Self { cells, factors: DenseFactors::new(rows, n) }
    }

    pub(super) fn solve(&self, b: &[f32], q: &mut [f32]) {
        let mut x: Vec<f64> = self.cells.iter().map(|at| f64::from(b[*at])).collect();
        self.factors.solve(&mut x);
        for (at, x) in self.cells.iter().zip(x) {
            q[*at] = x as f32;
        }
    }
}
