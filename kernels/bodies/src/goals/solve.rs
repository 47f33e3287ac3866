//! Conjugate gradients, three coordinates at a time.

use super::equations::{CHUNK, Equations};
use rayon::prelude::*;

type Vec3 = [f64; 3];

/// When a solve may stop, and when it must.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Share of the forces that may be left.
    pub relative: f64,
    /// Most steps.
    pub steps: usize,
}

impl Default for Limits {
    /// Below the rounding of f32 for any body: what is left of a place is at most the condition (1e5 for a body a hundred
    /// points across) times this.
    fn default() -> Self {
        Self { relative: 1e-10, steps: 10_000 }
    }
}

/// What a solve reached.
pub(super) struct Solved {
    pub(super) rows: Vec<Vec3>,
    pub(super) steps: usize,
    /// Measured on `rows`, as a share of the forces; 0 where there were none.
    pub(super) residual: f64,
}

/// Finds the rows whose forces among each other hold those from outside. Each coordinate takes its own step, as if it were
/// solved alone.
pub(super) fn solve(equations: &Equations, limits: Limits) -> Solved {
    let count = equations.forces.len();
    let inverse: Vec<f64> = equations.diagonal.iter().map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 }).collect();
    let mut rows = vec![[0.0; 3]; count];
    let mut left = equations.forces.clone();
    let outside = total(dots(&left, &left));
    let enough = limits.relative * limits.relative * outside;
    let mut along: Vec<Vec3> = left.iter().zip(&inverse).map(|(left, inverse)| left.map(|x| x * inverse)).collect();
    let mut pushed = vec![[0.0; 3]; count];
    let mut energy = dots(&left, &along);
    let mut steps = 0;
    // A comparison that NaN fails: it stops, and its residual says so.
    while steps < limits.steps && total(dots(&left, &left)) > enough {
        equations.times(&along, &mut pushed);
        let bend = dots(&along, &pushed);
        let step = quotient(energy, bend);
        rows.par_chunks_mut(CHUNK).zip(along.par_chunks(CHUNK)).for_each(|(rows, along)| add(rows, step, along));
        let back = step.map(|x| -x);
        left.par_chunks_mut(CHUNK).zip(pushed.par_chunks(CHUNK)).for_each(|(left, pushed)| add(left, back, pushed));
        // The preconditioned rest takes the place of what is not needed any more.
        let rest = pushed.par_chunks_mut(CHUNK).zip(left.par_chunks(CHUNK)).zip(inverse.par_chunks(CHUNK));
        rest.for_each(|((rest, left), inverse)| {
            for ((rest, left), inverse) in rest.iter_mut().zip(left).zip(inverse) {
                *rest = left.map(|x| x * inverse);
            }
        });
        let now = dots(&left, &pushed);
        let kept = quotient(now, energy);
        along.par_chunks_mut(CHUNK).zip(pushed.par_chunks(CHUNK)).for_each(|(along, rest)| {
            for (along, rest) in along.iter_mut().zip(rest) {
                (0..3).for_each(|k| along[k] = rest[k] + kept[k] * along[k]);
            }
        });
        energy = now;
        steps += 1;
    }
    equations.times(&rows, &mut pushed);
    for (pushed, force) in pushed.iter_mut().zip(&equations.forces) {
        (0..3).for_each(|k| pushed[k] -= force[k]);
    }
    let residual = if outside == 0.0 { 0.0 } else { (total(dots(&pushed, &pushed)) / outside).sqrt() };
    Solved { rows, steps, residual }
}

/// `to` + `share` · `of`.
fn add(to: &mut [Vec3], share: Vec3, of: &[Vec3]) {
    for (to, of) in to.iter_mut().zip(of) {
        (0..3).for_each(|k| to[k] += share[k] * of[k]);
    }
}

/// Coordinate by coordinate; 0 where there is nothing left to divide.
fn quotient(a: Vec3, b: Vec3) -> Vec3 {
    [0, 1, 2].map(|k| if b[k] > 0.0 { a[k] / b[k] } else { 0.0 })
}

fn total([x, y, z]: Vec3) -> f64 {
    x + y + z
}

/// Scalar products coordinate by coordinate: of chunks, then those in their order.
fn dots(a: &[Vec3], b: &[Vec3]) -> Vec3 {
    let of_chunk = |(a, b): (&[Vec3], &[Vec3])| {
        let mut sum = [0.0; 3];
        for (a, b) in a.iter().zip(b) {
            (0..3).for_each(|k| sum[k] += a[k] * b[k]);
        }
        sum
    };
    let chunks: Vec<Vec3> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of_chunk).collect();
    chunks.iter().fold([0.0; 3], |sum, chunk| [0, 1, 2].map(|k| sum[k] + chunk[k]))
}
