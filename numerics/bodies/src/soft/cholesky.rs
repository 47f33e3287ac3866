//! Dense Cholesky factors of positive semi-definite matrices, packed by rows below the diagonal.
//!
//! Promise: the same bits on every SIMD path and number of threads (sums run in eight fixed lanes); a direction in which the
//! matrix is zero to rounding gets no solution component instead of a huge one. Cost n³/3 and n² a solve.

use numerics::simd::{Path, kernel};
use rayon::prelude::*;

/// Lanes of a sum.
const LANES: usize = 8;
/// Columns finished at once: their rows stay in the cache while all rows below use them.
const BLOCK: usize = 48;
/// Rows a thread takes at least.
const ROWS: usize = 32;
/// A pivot that is this share of its diagonal is rounding.
const NOTHING: f64 = 1e-11;

/// Where row `i` begins.
#[inline(always)]
pub(super) fn row(i: usize) -> usize {
    i * (i + 1) / 2
}

/// Replaces the matrix by its factor; the diagonal holds reciprocals, 0 where a pivot is nothing.
pub(super) fn factor(matrix: &mut [f64], n: usize) {
    let path = Path::chosen();
    for first in (0..n).step_by(BLOCK) {
        let end = n.min(first + BLOCK);
        let (done, below) = matrix.split_at_mut(row(end));
        for i in first..end {
            let (above, mine) = done.split_at_mut(row(i));
            finish(path, above, &mut mine[..i], first);
            let pivot = mine[i] - dot(path, &mine[..i], &mine[..i]);
            mine[i] = if pivot > NOTHING * mine[i].abs().max(f64::MIN_POSITIVE) { 1.0 / pivot.sqrt() } else { 0.0 };
        }
        let done = &*done;
        let mut left = below;
        let rows = (end..n).map(|i| left.split_off_mut(..=i).unwrap_or_default());
        let mut rows: Vec<&mut [f64]> = rows.collect();
        rows.par_iter_mut().with_min_len(ROWS).for_each(|mine| finish(path, done, &mut mine[..end], first));
    }
}

kernel! {
    /// Brings columns `first..mine.len()` of a row to the factor's, given the rows above.
    fn finish(above: &[f64], mine: &mut [f64], first: usize) -> () = finish_body;
}

#[inline(always)]
fn finish_body(above: &[f64], mine: &mut [f64], first: usize) {
    let end = mine.len();
    for j in first..end {
        let other = &above[row(j)..row(j) + j + 1];
        let (head, tail) = mine.split_at_mut(first);
        tail[j - first] -= dot_body(head, &other[..first]);
    }
    for j in first..end {
        let other = &above[row(j)..row(j) + j + 1];
        let sum = dot_body(&mine[first..j], &other[first..j]);
        mine[j] = (mine[j] - sum) * other[j];
    }
}

/// Solves with a factor, in place.
pub(super) fn solve(path: Path, factor: &[f64], x: &mut [f64]) {
    for i in 0..x.len() {
        let mine = &factor[row(i)..=row(i) + i];
        x[i] = (x[i] - dot(path, &mine[..i], &x[..i])) * mine[i];
    }
    for i in (0..x.len()).rev() {
        let mine = &factor[row(i)..=row(i) + i];
        let (before, rest) = x.split_at_mut(i);
        rest[0] *= mine[i];
        take(path, before, &mine[..i], rest[0]);
    }
}

kernel! {
    /// The scalar product.
    fn dot(a: &[f64], b: &[f64]) -> f64 = dot_body;
}

#[inline(always)]
fn dot_body(a: &[f64], b: &[f64]) -> f64 {
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
    /// a ← a − s·b.
    fn take(a: &mut [f64], b: &[f64], s: f64) -> () = take_body;
}

#[inline(always)]
fn take_body(a: &mut [f64], b: &[f64], s: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        *a -= s * b;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::random::Key;

    /// B·Bᵀ + s·I of random B, and the full matrix.
    fn matrix(n: usize, s: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
        let b = |i: usize, j: usize| Key::new(3).of((i * n + j) as u64).f64() - 0.5;
        let full: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                (0..n).map(|j| (0..n).map(|k| b(i, k) * b(j, k)).sum::<f64>() + if i == j { s } else { 0.0 }).collect()
            })
            .collect();
        ((0..n).flat_map(|i| full[i][..=i].to_vec()).collect(), full)
    }

    #[test]
    fn a_solve_undoes_the_product() {
        for n in [1, 7, 48, 131] {
            let (mut packed, full) = matrix(n, 0.1);
            let x: Vec<f64> = (0..n).map(|i| i as f64 - 3.5).collect();
            let mut b: Vec<f64> = full.iter().map(|row| row.iter().zip(&x).map(|(a, x)| a * x).sum()).collect();
            factor(&mut packed, n);
            solve(Path::widest(), &packed, &mut b);
            for i in 0..n {
                assert!((b[i] - x[i]).abs() < 1e-9 * n as f64, "{n}: {} for {}", b[i], x[i]);
            }
        }
    }

    #[test]
    fn every_path_has_the_same_bits() {
        let (mut packed, _) = matrix(100, 0.1);
        factor(&mut packed, 100);
        let solved = |path| {
            let mut x: Vec<f64> = (0..100).map(|i| (i as f64).sqrt()).collect();
            solve(path, &packed, &mut x);
            x.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        Path::all().into_iter().for_each(|path| assert_eq!(solved(path), solved(Path::BASELINE)));
    }

    #[test]
    fn what_the_matrix_does_not_resist_stays_where_it_is() {
        // diag(4, 0, 9) with the middle row and column zero.
        let mut packed = vec![4.0, 0.0, 0.0, 0.0, 0.0, 9.0];
        factor(&mut packed, 3);
        let mut x = vec![8.0, 5.0, 27.0];
        solve(Path::BASELINE, &packed, &mut x);
        assert_eq!(x, [2.0, 0.0, 3.0]);
    }
}
