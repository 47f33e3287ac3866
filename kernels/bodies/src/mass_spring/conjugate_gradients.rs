//! Conjugate gradients on the linear system, preconditioned on two levels: each particle's own 3×3 block, plus the motions
//! of clusters (see [`super::coarse`]).
//!
//! Promise: at most the given iterations; what was reached is returned, measured in the preconditioner's norm; the same
//! bits for any number of threads. Sums run by cluster, in order.

use super::body::SoftBody;
use super::cholesky::Lower;
use super::coarse::{Anchors, moved};
use super::system::{System, solve_lower, solve_lower_transpose};
use numerics::simd::Path;
use numerics::vector::{DVec3, Vec3, to_f64};

/// Least share of a residual that is worth asking for where its square has a bound of its own.
const FINEST: f64 = 1e-4;

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Residual at the end ÷ at the start.
    pub(super) share: f64,
    /// The residual's square is to be this small too, as far as [`FINEST`] of the start allows.
    pub(super) square: f64,
    /// Most iterations.
    pub(super) cap: u32,
}

/// What a solve reached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reached {
    pub(super) iterations: u32,
    /// Residual at the end ÷ at the start.
    pub(super) share: f64,
    /// Whether `share` is what was asked.
    pub(super) met: bool,
}

/// Vectors that solves use again.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    p: Vec<DVec3>,
    ap: Vec<DVec3>,
    modes: Vec<f64>,
}

/// Both levels of the preconditioner: `system.smoother` is the other half of it.
#[derive(Clone, Copy)]
pub(super) struct Coarse<'a> {
    pub(super) factor: &'a Lower,
    pub(super) offset_from_centroid: &'a [Vec3],
    pub(super) anchors: &'a Anchors,
}

impl Coarse<'_> {
    /// The clusters' motions for the forces on them, and what they gain: cᵀ·(PᵀAP)⁻¹·c.
    fn solve(&self, forces: &[[f64; 6]], modes: &mut Vec<f64>) -> f64 {
        modes.clear();
        if self.factor.len() == 0 {
            return 0.0;
        }
        modes.extend(forces.iter().flatten());
        self.factor.solve(Path::chosen(), modes);
        forces.iter().flatten().zip(modes).fold(0.0, |sum, (force, mode)| sum + force * *mode)
    }

    /// What the clusters' motions do to a particle.
    #[inline(always)]
    fn moved(&self, modes: &[f64], cluster: usize, particle: usize) -> DVec3 {
        if modes.is_empty() {
            DVec3::zeros()
        } else {
            let free = moved(&modes[6 * cluster..6 * cluster + 6], to_f64(self.offset_from_centroid[particle]));
            self.anchors.at(particle).map_or(free, |way| way * free)
        }
    }

    /// A particle's share of the force on its cluster, added to `sums`.
    #[inline(always)]
    fn restrict(&self, particle: usize, r: DVec3, sums: &mut [f64; 6]) {
        let r = self.anchors.at(particle).map_or(r, |way| way.tr_mul(&r));
        let torque = to_f64(self.offset_from_centroid[particle]).cross(&r);
        for axis in 0..3 {
            sums[axis] += r[axis];
            sums[3 + axis] += torque[axis];
        }
    }
}

/// Moves `x` towards A⁻¹ of the residual `r`, which it keeps; `r` is 0 at held particles and stays so.
pub(super) fn solve(
    system: &mut System,
    body: &SoftBody,
    coarse: Coarse<'_>,
    limits: Limits,
    scratch: &mut Scratch,
    x: &mut [DVec3],
    r: &mut [DVec3],
) -> Reached {
    let clusters = &body.order.clusters;
    let Scratch { p, ap, modes } = scratch;
    p.clear();
    p.resize(r.len(), DVec3::zeros());
    ap.resize(r.len(), DVec3::zeros());

    // A residual's square in the preconditioner's norm, and the forces on clusters.
    let smoother = &system.smoother;
    let first = clusters.map((), |cluster, ()| {
        let (mut square, mut sums) = (0.0, [0.0; 6]);
        for particle in clusters.range(cluster) {
            square += solve_lower(&smoother[particle], r[particle]).norm_squared();
            coarse.restrict(particle, r[particle], &mut sums);
        }
        (square, sums)
    });
    let (squares, forces): (Vec<f64>, Vec<[f64; 6]>) = first.into_iter().unzip();
    let start = squares.iter().sum::<f64>() + coarse.solve(&forces, modes);
    let mut reached = Reached { iterations: 0, share: 0.0, met: true };
    if !(start > f64::MIN_POSITIVE && start.is_finite()) {
        reached.met = start.is_finite();
        return reached;
    }
    let (mut rz, mut beta) = (start, 0.0);
    let asked = limits.share * limits.share * start;
    let enough = asked.min(limits.square).max(asked.min(FINEST * FINEST * start));
    loop {
        let smoother = &system.smoother;
        clusters.for_each(&mut p[..], |cluster, mine: &mut [DVec3]| {
            for (particle, p) in clusters.range(cluster).zip(mine) {
                if !system.held[particle] {
                    let fine =
                        solve_lower_transpose(&smoother[particle], solve_lower(&smoother[particle], r[particle]));
                    *p = fine + coarse.moved(modes, cluster, particle) + *p * beta;
                }
            }
        });
        let curvature = system.apply(body, clusters, p, ap);
        reached.iterations += 1;
        if !(curvature > 0.0 && curvature.is_finite()) {
            reached.met = false;
            break;
        }
        let alpha = rz / curvature;
        let smoother = &system.smoother;
        let next = clusters.map((&mut x[..], &mut r[..]), |cluster, (x, r): (&mut [DVec3], &mut [DVec3])| {
            let (mut square, mut sums) = (0.0, [0.0; 6]);
            for ((particle, x), r) in clusters.range(cluster).zip(x).zip(r) {
                *x += p[particle] * alpha;
                *r -= ap[particle] * alpha;
                square += solve_lower(&smoother[particle], *r).norm_squared();
                coarse.restrict(particle, *r, &mut sums);
            }
            (square, sums)
        });
        let (squares, forces): (Vec<f64>, Vec<[f64; 6]>) = next.into_iter().unzip();
        let after = squares.iter().sum::<f64>() + coarse.solve(&forces, modes);
        if !(after.is_finite() && after >= 0.0) {
            reached.met = false;
            break;
        }
        beta = after / rz;
        rz = after;
        if rz <= enough {
            break;
        }
        if reached.iterations >= limits.cap {
            reached.met = false;
            break;
        }
    }
    reached.share = (rz / start).sqrt();
    reached
}

/// Replaces `r` by the preconditioner's answer to it: near A⁻¹r, in one go.
pub(super) fn precondition(system: &System, body: &SoftBody, coarse: Coarse<'_>, r: &mut [DVec3]) {
    let clusters = &body.order.clusters;
    let forces = {
        let r = &*r;
        clusters.map((), |cluster, ()| {
            let mut sums = [0.0; 6];
            clusters.range(cluster).for_each(|particle| coarse.restrict(particle, r[particle], &mut sums));
            sums
        })
    };
    let mut modes = Vec::new();
    coarse.solve(&forces, &mut modes);
    clusters.for_each(r, |cluster, r: &mut [DVec3]| {
        for (particle, r) in clusters.range(cluster).zip(r) {
            let w = &system.smoother[particle];
            let fine = solve_lower_transpose(w, solve_lower(w, *r));
            *r = if system.held[particle] { DVec3::zeros() } else { fine + coarse.moved(&modes, cluster, particle) };
        }
    });
}
