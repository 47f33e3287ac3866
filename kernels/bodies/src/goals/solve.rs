//! Conjugate gradients, three coordinates at a time.

use super::equations::{CHUNK, Equations};
use numerics::vector::DVec3;
use rayon::prelude::*;

/// When a solve may stop, and when it must.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalLimits {
    /// Share of the forces that may be left.
    pub relative: f64,
    /// Most steps.
    pub steps: usize,
}

impl Default for GoalLimits {
    /// Below the rounding of f32 for any body: what is left of a place is at most the condition (1e5 for a body a hundred
    /// points across) times this.
    fn default() -> Self {
        Self { relative: 1e-10, steps: 10_000 }
    }
}

/// What a solve reached.
pub(super) struct Solved {
    pub(super) rows: Vec<DVec3>,
    pub(super) steps: usize,
    /// Measured on `rows`, as a share of the forces; 0 where there were none.
    pub(super) residual: f64,
}

/// Finds the rows whose forces among each other hold those from outside. Each coordinate takes its own step, as if it were
/// solved alone.
pub(super) fn solve(equations: &Equations, limits: GoalLimits) -> Solved {
    let count = equations.forces.len();
    let inverse: Vec<f64> = equations.diagonal.iter().map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 }).collect();
    let mut rows = vec![DVec3::zeros(); count];
    let mut left = equations.forces.clone();
    let outside = total(dots(&left, &left));
    let enough = limits.relative * limits.relative * outside;
    let mut along: Vec<DVec3> = left.iter().zip(&inverse).map(|(left, inverse)| left * *inverse).collect();
    let mut pushed = vec![DVec3::zeros(); count];
    let mut energy = dots(&left, &along);
    let mut steps = 0;
    // A comparison that NaN fails: it stops, and its residual says so.
    while steps < limits.steps && total(dots(&left, &left)) > enough {
        equations.times(&along, &mut pushed);
        let bend = dots(&along, &pushed);
        let step = quotient(energy, bend);
        rows.par_chunks_mut(CHUNK).zip(along.par_chunks(CHUNK)).for_each(|(rows, along)| add(rows, step, along));
        let back = -step;
        left.par_chunks_mut(CHUNK).zip(pushed.par_chunks(CHUNK)).for_each(|(left, pushed)| add(left, back, pushed));
        // The preconditioned rest takes the place of what is not needed any more.
        let rest = pushed.par_chunks_mut(CHUNK).zip(left.par_chunks(CHUNK)).zip(inverse.par_chunks(CHUNK));
        rest.for_each(|((rest, left), inverse)| {
            for ((rest, left), inverse) in rest.iter_mut().zip(left).zip(inverse) {
                *rest = left * *inverse;
            }
        });
        let now = dots(&left, &pushed);
        let kept = quotient(now, energy);
        along.par_chunks_mut(CHUNK).zip(pushed.par_chunks(CHUNK)).for_each(|(along, rest)| {
            for (along, rest) in along.iter_mut().zip(rest) {
                *along = rest + kept.component_mul(along);
            }
        });
        energy = now;
        steps += 1;
    }
    equations.times(&rows, &mut pushed);
    for (pushed, force) in pushed.iter_mut().zip(&equations.forces) {
        *pushed -= force;
    }
    let residual = if outside == 0.0 { 0.0 } else { (total(dots(&pushed, &pushed)) / outside).sqrt() };
    Solved { rows, steps, residual }
}

/// `to` + `share` · `of`.
fn add(to: &mut [DVec3], share: DVec3, of: &[DVec3]) {
    for (to, of) in to.iter_mut().zip(of) {
        *to += share.component_mul(of);
    }
}

/// Coordinate by coordinate; 0 where there is nothing left to divide.
fn quotient(a: DVec3, b: DVec3) -> DVec3 {
    a.zip_map(&b, |a, b| if b > 0.0 { a / b } else { 0.0 })
}

fn total(v: DVec3) -> f64 {
    v.x + v.y + v.z
}

/// Scalar products coordinate by coordinate: of chunks, then those in their order.
fn dots(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    let of_chunk =
        |(a, b): (&[DVec3], &[DVec3])| a.iter().zip(b).fold(DVec3::zeros(), |sum, (a, b)| sum + a.component_mul(b));
    let chunks: Vec<DVec3> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of_chunk).collect();
    chunks.iter().fold(DVec3::zeros(), |sum, chunk| sum + chunk)
}
