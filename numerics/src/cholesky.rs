//! Cholesky factorisation of positive semi-definite matrices in envelope (skyline) storage: each row is stored from
//! its first non-zero entry to the diagonal, and the factor has no fill outside that (Jennings 1966).
//!
//! The same bits on every SIMD path and for any number of threads (sums run in eight fixed lanes). Where the matrix
//! is singular to rounding the solution has no component, instead of a huge one. Cost: Σ b²/2 for rows of b entries,
//! and Σ 2b a solve.

use crate::parallel;
use crate::simd::{Path, kernel};
use serde::{Deserialize, Serialize};

/// Lanes of a sum.
const LANES: usize = 8;
/// Columns factored at a time: their rows stay in the cache while all rows below use them.
const BLOCK: usize = 48;
/// Rows that a thread takes at a time.
const ROWS: usize = 32;
/// A pivot below this fraction of its diagonal entry is rounding noise.
const NEGLIGIBLE: f64 = 1e-11;

/// The lower triangle of a symmetric matrix, or its factor, row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnvelopeMatrix {
    /// Start of each row in `values`, and the total at the end.
    starts: Vec<usize>,
    /// In a factor the diagonal holds reciprocals, 0 for a negligible pivot.
    values: Vec<f64>,
}

impl EnvelopeMatrix {
    /// A zero matrix whose rows start at the columns `firsts`.
    pub fn zeros(firsts: impl Iterator<Item = usize>) -> Self {
        let mut starts = vec![0];
        let mut size = 0;
        for (i, first) in firsts.enumerate() {
            size += i + 1 - first;
            starts.push(size);
        }
        Self { starts, values: vec![0.0; size] }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All stored entries.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Start of every `count`-th row in the entries, and the total at the end.
    pub fn bands(&self, count: usize) -> Vec<usize> {
        self.starts.iter().step_by(count).copied().collect()
    }

    /// Adds to an entry of the envelope, with j ≤ i.
    #[inline(always)]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.values[self.starts[i + 1] - 1 - (i - j)] += value;
    }

    /// Replaces the matrix by its factor.
    pub fn factor(&mut self) {
        let (path, n) = (Path::chosen(), self.len());
        let Self { starts, values } = self;
        // For each column, one past the last row that has an entry in it.
        let mut reach: Vec<usize> = (1..=n).collect();
        for i in 0..n {
            let first = first(starts, i);
            reach[first] = reach[first].max(i + 1);
        }
        (1..n).for_each(|j| reach[j] = reach[j].max(reach[j - 1]));
        for begin in (0..n).step_by(BLOCK) {
            let end = n.min(begin + BLOCK);
            let (done, below) = values.split_at_mut(starts[end]);
            for i in begin..end {
                let (above, mine) = done.split_at_mut(starts[i]);
                let (own, from) = (i - first(starts, i), first(starts, i));
                finish(path, (starts, above), &mut mine[..own], from, begin);
                let pivot = mine[own] - inner_product(path, &mine[..own], &mine[..own]);
                let counts = pivot > NEGLIGIBLE * mine[own].abs().max(f64::MIN_POSITIVE);
                mine[own] = if counts { 1.0 / pivot.sqrt() } else { 0.0 };
            }
            let (done, starts) = (&*done, &*starts);
            let mut left = below;
            let rows = (end..reach[end - 1]).map(|i| {
                let mine = left.split_off_mut(..starts[i + 1] - starts[i]).unwrap_or_default();
                (first(starts, i), mine)
            });
            let mut rows: Vec<(usize, &mut [f64])> = rows.filter(|(from, _)| *from < end).collect();
            parallel::for_each(rows.chunks_mut(ROWS), |_, rows| {
                for (from, mine) in rows {
                    finish(path, (starts, done), &mut mine[..end - *from], *from, begin);
                }
            });
        }
    }

    /// Solves with the factor, in place.
    pub fn solve(&self, path: Path, x: &mut [f64]) {
        solve(path, &self.starts, &self.values, x);
    }
}

/// Column of the first entry of row `i`.
#[inline(always)]
fn first(starts: &[usize], i: usize) -> usize {
    i + 1 + starts[i] - starts[i + 1]
}

kernel! { avx512
    /// Factors the columns from `begin` on of one row, whose stored entries `mine` start at column `from`, given the
    /// rows above as their starts and values.
    fn finish(above: (&[usize], &[f64]), mine: &mut [f64], from: usize, begin: usize) -> () = finish_body;
}

#[inline(always)]
fn finish_body((starts, above): (&[usize], &[f64]), mine: &mut [f64], from: usize, begin: usize) {
    let end = from + mine.len();
    let begin = begin.max(from);
    for j in begin..end {
        let (other, low) = (&above[starts[j]..starts[j + 1]], first(starts, j));
        let both = low.max(from);
        if both < begin {
            let (head, tail) = mine.split_at_mut(begin - from);
            tail[j - begin] -= inner_product_body(&head[both - from..], &other[both - low..begin - low]);
        }
    }
    for j in begin..end {
        let (other, low) = (&above[starts[j]..starts[j + 1]], first(starts, j));
        let both = low.max(begin);
        let sum = inner_product_body(&mine[both - from..j - from], &other[both - low..j - low]);
        mine[j - from] = (mine[j - from] - sum) * other[j - low];
    }
}

kernel! { avx512
    /// Inner product of two long vectors.
    fn inner_product(a: &[f64], b: &[f64]) -> f64 = inner_product_body;
}

#[inline(always)]
fn inner_product_body(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for lane in 0..LANES {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    (((a + b) + (c + d)) + ((e + f) + (g + h))) + tail
}

kernel! { avx512
    /// Forward and back substitution.
    fn solve(starts: &[usize], values: &[f64], x: &mut [f64]) -> () = solve_body;
}

#[inline(always)]
fn solve_body(starts: &[usize], values: &[f64], x: &mut [f64]) {
    let row = |i: usize| {
        let from = first(starts, i);
        (from, &values[starts[i]..starts[i + 1] - 1], values[starts[i + 1] - 1])
    };
    for i in 0..x.len() {
        let (from, mine, inverse) = row(i);
        x[i] = (x[i] - inner_product_body(mine, &x[from..i])) * inverse;
    }
    for i in (0..x.len()).rev() {
        let (from, mine, inverse) = row(i);
        x[i] *= inverse;
        let own = x[i];
        x[from..i].iter_mut().zip(mine).for_each(|(x, l)| *x -= own * l);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Key;

    /// L·Lᵀ + s·I for a random L whose rows start at `first`, in envelope storage and as a full matrix.
    fn matrix(n: usize, s: f64, first: impl Fn(usize) -> usize) -> (EnvelopeMatrix, Vec<Vec<f64>>) {
        let l = |i: usize, j: usize| {
            if j < first(i) || j > i { 0.0 } else { Key::new(3).of((i * n + j) as u64).f64() - 0.5 }
        };
        let product =
            |i: usize, j: usize| (0..n).map(|k| l(i, k) * l(j, k)).sum::<f64>() + if i == j { s } else { 0.0 };
        let full: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| product(i, j)).collect()).collect();
        let mut lower = EnvelopeMatrix::zeros((0..n).map(&first));
        for (i, row) in full.iter().enumerate() {
            (first(i)..=i).for_each(|j| lower.add(i, j, row[j]));
        }
        (lower, full)
    }

    /// Rows of 1 to 60 entries, and every fiftieth full.
    fn ragged(i: usize) -> usize {
        if i % 50 == 49 { 0 } else { i.saturating_sub(i * 7 % 60) }
    }

    #[test]
    fn solving_inverts_the_matrix_product() {
        for (n, first) in
            [1, 7, 48, 131, 200].into_iter().flat_map(|n| [(n, (|_| 0) as fn(usize) -> usize), (n, ragged)])
        {
            let (mut lower, full) = matrix(n, 0.1, first);
            let x: Vec<f64> = (0..n).map(|i| i as f64 - 3.5).collect();
            let mut b: Vec<f64> = full.iter().map(|row| row.iter().zip(&x).map(|(a, x)| a * x).sum()).collect();
            lower.factor();
            lower.solve(Path::widest(), &mut b);
            for i in 0..n {
                assert!((b[i] - x[i]).abs() < 1e-9 * n as f64, "{n}: {} for {}", b[i], x[i]);
            }
        }
    }

    #[test]
    fn every_path_has_the_same_bits() {
        let (mut lower, _) = matrix(100, 0.1, ragged);
        lower.factor();
        let solved = |path| {
            let mut x: Vec<f64> = (0..100).map(|i| (i as f64).sqrt()).collect();
            lower.solve(path, &mut x);
            x.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        Path::all().into_iter().for_each(|path| assert_eq!(solved(path), solved(Path::BASELINE)));
    }

    #[test]
    fn null_space_components_of_the_solution_are_zero() {
        // diag(4, 0, 9): the middle row and column are zero.
        let mut lower = EnvelopeMatrix::zeros([0, 0, 0].into_iter());
        lower.add(0, 0, 4.0);
        lower.add(2, 2, 9.0);
        lower.factor();
        let mut x = vec![8.0, 5.0, 27.0];
        lower.solve(Path::BASELINE, &mut x);
        assert_eq!(x, [2.0, 0.0, 3.0]);
    }
}
