//! Conjugate gradients for three right-hand sides, one for each coordinate.

use super::equations::{CHUNK, Equations};
use numerics::parallel;
use numerics::vector::DVec3;

/// Stopping criteria.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalLimits {
    /// Final ÷ initial residual.
    pub relative: f64,
    /// Maximum number of iterations.
    pub steps: usize,
}

impl Default for GoalLimits {
    /// Below f32 rounding for any body: the error of a position is at most this times the condition number, 1e5 for a
    /// body a hundred points across.
    fn default() -> Self {
        Self { relative: 1e-10, steps: 10_000 }
    }
}

/// Outcome of a solve.
pub(super) struct Solved {
    pub(super) rows: Vec<DVec3>,
    pub(super) steps: usize,
    /// True residual of `rows`, relative to the forces; 0 without forces.
    pub(super) residual: f64,
}

/// Solves the system; each coordinate takes its own step sizes, as if it were solved alone.
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
    // The comparison is false for NaN, which stops the iteration; the residual then reports it.
    while steps < limits.steps && total(dots(&left, &left)) > enough {
        equations.times(&along, &mut pushed);
        let bend = dots(&along, &pushed);
        let step = quotient(energy, bend);
        add(&mut rows, step, &along);
        let back = -step;
        add(&mut left, back, &pushed);
        // `pushed` is no longer needed and takes the preconditioned residual.
        let rest = pushed.chunks_mut(CHUNK).zip(left.chunks(CHUNK)).zip(inverse.chunks(CHUNK));
        parallel::for_each(rest, |_, ((rest, left), inverse)| {
            for ((rest, left), inverse) in rest.iter_mut().zip(left).zip(inverse) {
                *rest = left * *inverse;
            }
        });
        let now = dots(&left, &pushed);
        let kept = quotient(now, energy);
        parallel::for_each(along.chunks_mut(CHUNK).zip(pushed.chunks(CHUNK)), |_, (along, rest)| {
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

/// `to` += `share` · `of` for each coordinate.
fn add(to: &mut [DVec3], share: DVec3, of: &[DVec3]) {
    parallel::for_each(to.chunks_mut(CHUNK).zip(of.chunks(CHUNK)), |_, (to, of)| {
        for (to, of) in to.iter_mut().zip(of) {
            *to += share.component_mul(of);
        }
    });
}

/// Quotients by coordinate; 0 if the divisor is 0.
fn quotient(a: DVec3, b: DVec3) -> DVec3 {
    a.zip_map(&b, |a, b| if b > 0.0 { a / b } else { 0.0 })
}

fn total(v: DVec3) -> f64 {
    v.x + v.y + v.z
}

/// Inner products by coordinate, summed by chunks in order.
fn dots(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    let chunks = parallel::map(a.chunks(CHUNK).zip(b.chunks(CHUNK)), |_, (a, b)| {
        a.iter().zip(b).fold(DVec3::zeros(), |sum, (a, b)| sum + a.component_mul(b))
    });
    chunks.iter().fold(DVec3::zeros(), |sum, chunk| sum + chunk)
}
