//! Cholesky factors of positive semi-definite matrices that are zero far from the diagonal: each row is kept from its first
//! entry on (Jennings 1966), as a factor fills no others.
//!
//! Promise: the same bits on every SIMD path and number of threads (sums run in eight fixed lanes); a direction in which the
//! matrix is zero to rounding gets no solution component instead of a huge one. Cost Σ b²/2 over rows of b entries, and
//! Σ 2b a solve.

use numerics::simd::{Path, kernel};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Lanes of a sum.
const LANES: usize = 8;
/// Columns finished at once: their rows stay in the cache while all rows below use them.
const BLOCK: usize = 48;
/// Rows a thread takes at least.
const ROWS: usize = 32;
/// A pivot that is this share of its diagonal is rounding.
const NOTHING: f64 = 1e-11;

/// The lower half of a symmetric matrix, or its factor: rows one after the other, each from its first entry to the diagonal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Lower {
    /// Where each row begins in `values`, and where the last ends.
    starts: Vec<usize>,
    /// On a factor's diagonal reciprocals, 0 where a pivot is nothing.
    values: Vec<f64>,
}

impl Lower {
    /// Zeros, with rows whose first columns are `firsts`.
    pub(super) fn zeros(firsts: impl Iterator<Item = usize>) -> Self {
        let mut starts = vec![0];
        let mut size = 0;
        for (i, first) in firsts.enumerate() {
            size += i + 1 - first;
            starts.push(size);
        }
        Self { starts, values: vec![0.0; size] }
    }

    /// How many rows.
    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// All entries.
    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Where each `count` rows begin among the entries, and where the last end.
    pub(super) fn bands(&self, count: usize) -> Vec<usize> {
        self.starts.iter().step_by(count).copied().collect()
    }

    /// Adds to the entry in row `i` and column `j`, which is neither above the diagonal nor before the row's first.
    #[inline(always)]
    pub(super) fn add(&mut self, i: usize, j: usize, value: f64) {
        self.values[self.starts[i + 1] - 1 - (i - j)] += value;
    }

    /// Replaces the matrix by its factor.
    pub(super) fn factor(&mut self) {
        let (path, n) = (Path::chosen(), self.len());
        let Self { starts, values } = self;
        // For each column the end of the rows that reach it.
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
                let counts = pivot > NOTHING * mine[own].abs().max(f64::MIN_POSITIVE);
                mine[own] = if counts { 1.0 / pivot.sqrt() } else { 0.0 };
            }
            let (done, starts) = (&*done, &*starts);
            let mut left = below;
            let rows = (end..reach[end - 1]).map(|i| {
                let mine = left.split_off_mut(..starts[i + 1] - starts[i]).unwrap_or_default();
                (first(starts, i), mine)
            });
            let mut rows: Vec<(usize, &mut [f64])> = rows.filter(|(from, _)| *from < end).collect();
            rows.par_iter_mut().with_min_len(ROWS).for_each(|(from, mine)| {
                finish(path, (starts, done), &mut mine[..end - *from], *from, begin);
            });
        }
    }

    /// Solves with the factor, in place.
    pub(super) fn solve(&self, path: Path, x: &mut [f64]) {
        solve(path, &self.starts, &self.values, x);
    }
}

/// The first column of row `i`.
#[inline(always)]
fn first(starts: &[usize], i: usize) -> usize {
    i + 1 + starts[i] - starts[i + 1]
}

kernel! {
    /// Brings columns from `begin` on of a row, of which `mine` are those from the first one, `from`, to the factor's, given
    /// the rows above: where they begin, and their values.
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

kernel! {
    /// The scalar product.
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

kernel! {
    /// Forwards and back through a factor.
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
    use numerics::random::Key;

    /// L·Lᵀ + s·I of random L whose rows begin at `first`: the full matrix, which is zero where a row of its lower half has
    /// not begun.
    fn matrix(n: usize, s: f64, first: impl Fn(usize) -> usize) -> (Lower, Vec<Vec<f64>>) {
        let l = |i: usize, j: usize| {
            if j < first(i) || j > i { 0.0 } else { Key::new(3).of((i * n + j) as u64).f64() - 0.5 }
        };
        let product =
            |i: usize, j: usize| (0..n).map(|k| l(i, k) * l(j, k)).sum::<f64>() + if i == j { s } else { 0.0 };
        let full: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| product(i, j)).collect()).collect();
        let mut lower = Lower::zeros((0..n).map(&first));
        for (i, row) in full.iter().enumerate() {
            (first(i)..=i).for_each(|j| lower.add(i, j, row[j]));
        }
        (lower, full)
    }

    /// Rows of 1 to 60 entries, and now and then a whole one.
    fn ragged(i: usize) -> usize {
        if i % 50 == 49 { 0 } else { i.saturating_sub(i * 7 % 60) }
    }

    #[test]
    fn a_solve_undoes_the_product() {
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
    fn what_the_matrix_does_not_resist_stays_where_it_is() {
        // diag(4, 0, 9) with the middle row and column zero.
        let mut lower = Lower::zeros([0, 0, 0].into_iter());
        lower.add(0, 0, 4.0);
        lower.add(2, 2, 9.0);
        lower.factor();
        let mut x = vec![8.0, 5.0, 27.0];
        lower.solve(Path::BASELINE, &mut x);
        assert_eq!(x, [2.0, 0.0, 3.0]);
    }
}
