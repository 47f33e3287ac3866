//! Curves of a clump swing together: each is drawn from its own swing towards the mean of its clump.
//!
//! As the springs are linear, the mean swing is that of a curve whose target is the mean of the targets.

use crate::clumps::Clumps;
use numerics::masked::Masked;
use numerics::parallel;
use numerics::vector::DVec3;

/// Number of clumps, and of curves, in a task.
const TASK: usize = 64;

/// The `offsets` of the CVs of curves from their targets, drawn by `share` (0..1) towards the mean of their clump at the
/// same fraction of their length; `along` are these fractions. Curves without length keep theirs and do not count.
pub(super) fn gathered(
    starts: &[u32],
    along: &[f32],
    offsets: &[DVec3],
    clumps: &Clumps,
    share: Masked<'_, f32>,
) -> Vec<DVec3> {
    let cvs = |curve: usize| starts[curve] as usize..starts[curve + 1] as usize;
    let swings = |curve: &u32| along[cvs(*curve as usize)].last().is_some_and(|end| *end > 0.0);
    let mean = |clump: usize| {
        let members: Vec<usize> =
            clumps.members(clump).iter().filter(|curve| swings(curve)).map(|curve| *curve as usize).collect();
        // The first of the curves with the most CVs says where the mean is known.
        let finest = members.iter().copied().reduce(|a, b| if cvs(b).len() > cvs(a).len() { b } else { a });
        let Some(finest) = finest else { return Mean::default() };
        let us = along[cvs(finest)].to_vec();
        let mut values = vec![DVec3::zeros(); us.len()];
        for member in &members {
            let (own, mut at) = (cvs(*member), 0);
            for (value, u) in values.iter_mut().zip(&us) {
                *value += interpolated(&along[own.clone()], &offsets[own.clone()], *u, &mut at);
            }
        }
        values.iter_mut().for_each(|value| *value /= members.len() as f64);
        Mean { us, values }
    };
    let means = parallel::tabulate(clumps.len(), TASK, mean);
    let of_curve = |curve: usize| {
        let own = cvs(curve);
        let mut out = offsets[own.clone()].to_vec();
        if let Some(clump) = clumps.of(curve).filter(|_| swings(&(curve as u32))) {
            let (mean, mut at) = (&means[clump], 0);
            for (cv, out) in own.zip(&mut out) {
                let share = share.at(cv);
                let share = f64::from(if share > 0.0 { share.min(1.0) } else { 0.0 });
                let all = interpolated(&mean.us, &mean.values, along[cv], &mut at);
                *out += (all - *out) * share;
            }
        }
        out
    };
    parallel::concat(parallel::tabulate(starts.len().saturating_sub(1), TASK, of_curve))
}

/// The mean swing of a clump along its curves.
#[derive(Clone, Default)]
struct Mean {
    us: Vec<f32>,
    values: Vec<DVec3>,
}

/// The value at `u` of a polyline over ascending `us`; `at` is where the last, smaller `u` was found.
fn interpolated(us: &[f32], values: &[DVec3], u: f32, at: &mut usize) -> DVec3 {
    while *at + 1 < us.len() && us[*at + 1] <= u {
        *at += 1;
    }
    if *at + 1 == us.len() || u <= us[*at] {
        return values[*at];
    }
    let share = f64::from((u - us[*at]) / (us[*at + 1] - us[*at]));
    values[*at] + (values[*at + 1] - values[*at]) * share
}
