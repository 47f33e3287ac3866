//! Conjugate gradients with a two-level preconditioner: the 3×3 diagonal block of each particle, plus a coarse solve
//! for rigid motions of clusters (see [`super::coarse`]).
//!
//! Runs at most the given number of iterations and reports the residual reached, in the norm of the preconditioner.
//! Sums run by cluster in a fixed order, so bits do not depend on the number of threads.

use super::body::SoftBody;
use super::coarse::{ContactFilters, moved};
use super::state::CachedCoarseFactor;
use super::system::{System, solve_lower, solve_lower_transpose};
use numerics::cholesky::EnvelopeMatrix;
use numerics::simd::Path;
use numerics::vector::{DVec3, Vec3, to_f64};

/// An absolute bound on the residual is not pursued below this fraction of the initial residual.
const FINEST: f64 = 1e-4;

/// Stopping criteria.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Final ÷ initial residual.
    pub(super) share: f64,
    /// The squared residual has to fall below this too, as far as [`FINEST`] allows.
    pub(super) square: f64,
    /// Maximum number of iterations.
    pub(super) cap: u32,
}

/// Outcome of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reached {
    pub(super) iterations: u32,
    /// Final ÷ initial residual.
    pub(super) share: f64,
    /// Whether the criteria were met.
    pub(super) met: bool,
}

/// Vectors kept between solves to avoid allocations.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    p: Vec<DVec3>,
    ap: Vec<DVec3>,
    modes: Vec<f64>,
}

/// The coarse level of the preconditioner; the fine one is `system.smoother`.
#[derive(Clone, Copy)]
pub(super) struct Coarse<'a> {
    factor: &'a EnvelopeMatrix,
    offset_from_centroid: &'a [Vec3],
    filters: &'a ContactFilters,
}

impl<'a> Coarse<'a> {
    pub(super) fn new(cached: &'a CachedCoarseFactor, offset_from_centroid: &'a [Vec3]) -> Self {
        Self { factor: &cached.factor, offset_from_centroid, filters: &cached.filters }
    }

    /// The squared residual in the preconditioner's norm, from the squares and the forces of all clusters; sets the rigid
    /// motions `modes` of the clusters under these forces.
    fn squared_norm(&self, of_clusters: Vec<(f64, [f64; 6])>, modes: &mut Vec<f64>) -> f64 {
        let (squares, forces): (Vec<f64>, Vec<[f64; 6]>) = of_clusters.into_iter().unzip();
        modes.clear();
        if !self.factor.is_empty() {
            modes.extend(forces.iter().flatten());
            self.factor.solve(Path::chosen(), modes);
        }
        let work = forces.iter().flatten().zip(modes).fold(0.0, |sum, (force, mode)| sum + force * *mode);
        squares.iter().sum::<f64>() + work
    }

    /// Displacement of a particle by the rigid motion of its cluster.
    #[inline(always)]
    fn moved(&self, modes: &[f64], cluster: usize, particle: usize) -> DVec3 {
        if modes.is_empty() {
            DVec3::zeros()
        } else {
            let free = moved(&modes[6 * cluster..6 * cluster + 6], to_f64(self.offset_from_centroid[particle]));
            self.filters.at(particle).map_or(free, |filter| filter * free)
        }
    }

    /// Adds a particle's contribution to the force and torque on its cluster to `sums`.
    #[inline(always)]
    fn restrict(&self, particle: usize, r: DVec3, sums: &mut [f64; 6]) {
        let r = self.filters.at(particle).map_or(r, |filter| filter.tr_mul(&r));
        let torque = to_f64(self.offset_from_centroid[particle]).cross(&r);
        for axis in 0..3 {
            sums[axis] += r[axis];
            sums[3 + axis] += torque[axis];
        }
    }
}

/// Adds an approximate solution of A·dx = r to `x` and updates the residual `r`, which is 0 at pinned particles and
/// stays so.
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

    let start = squared_norm(system, body, coarse, r, modes);
    let mut reached = Reached { iterations: 0, share: 0.0, met: true };
    if !(start > f64::MIN_POSITIVE && start.is_finite()) {
        reached.met = start.is_finite();
        return reached;
    }
    let (mut rz, mut beta) = (start, 0.0);
    let asked = limits.share * limits.share * start;
    let enough = asked.min(limits.square).max(asked.min(FINEST * FINEST * start));
    loop {
        update_direction(system, body, coarse, modes, r, beta, p);
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
        let after = coarse.squared_norm(next, modes);
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

/// Sets the search direction `p` to the preconditioned residual plus `beta` times the last direction.
fn update_direction(
    system: &System,
    body: &SoftBody,
    coarse: Coarse<'_>,
    modes: &[f64],
    r: &[DVec3],
    beta: f64,
    p: &mut [DVec3],
) {
    let (clusters, smoother) = (&body.order.clusters, &system.smoother);
    clusters.for_each(p, |cluster, mine: &mut [DVec3]| {
        for (particle, p) in clusters.range(cluster).zip(mine) {
            if !system.held[particle] {
                let fine = solve_lower_transpose(&smoother[particle], solve_lower(&smoother[particle], r[particle]));
                *p = fine + coarse.moved(modes, cluster, particle) + *p * beta;
            }
        }
    });
}

/// The squared residual in the preconditioner's norm; sets the rigid motions `modes` of the clusters.
fn squared_norm(system: &System, body: &SoftBody, coarse: Coarse<'_>, r: &[DVec3], modes: &mut Vec<f64>) -> f64 {
    let clusters = &body.order.clusters;
    let of_clusters = clusters.map((), |cluster, ()| {
        let (mut square, mut sums) = (0.0, [0.0; 6]);
        for particle in clusters.range(cluster) {
            square += solve_lower(&system.smoother[particle], r[particle]).norm_squared();
            coarse.restrict(particle, r[particle], &mut sums);
        }
        (square, sums)
    });
    coarse.squared_norm(of_clusters, modes)
}

/// The preconditioner applied to `r`, an approximation of A⁻¹r.
pub(super) fn precondition(system: &System, body: &SoftBody, coarse: Coarse<'_>, r: &[DVec3]) -> Vec<DVec3> {
    let (mut modes, mut out) = (Vec::new(), vec![DVec3::zeros(); r.len()]);
    squared_norm(system, body, coarse, r, &mut modes);
    update_direction(system, body, coarse, &modes, r, 0.0, &mut out);
    out
}
