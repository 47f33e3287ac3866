//! Conjugate gradients with a two-level preconditioner: the 3×3 diagonal block of each particle, plus a coarse solve
//! for rigid motions of clusters (see [`super::coarse`]).
//!
//! Runs at most the given number of iterations and reports the residual reached, in the norm of the preconditioner.
//! Sums run by cluster in a fixed order, so bits do not depend on the number of threads.

use super::body::SoftBody;
use super::coarse::{ClusterMotions, MODES};
use super::state::CachedCoarseFactor;
use super::system::{System, solve_lower, solve_lower_transpose};
use numerics::cholesky::EnvelopeMatrix;
use numerics::quad::Quad;
use numerics::simd::Path;
use numerics::vector::{DVec3, Vec3};

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
    /// Initial squared residual.
    pub(super) start: f64,
    /// Whether the criteria were met.
    pub(super) met: bool,
}

/// The coarse level of the preconditioner; the fine one is `system.smoother`.
#[derive(Clone, Copy)]
pub(super) struct Coarse<'a> {
    body: &'a SoftBody,
    factor: &'a EnvelopeMatrix,
    motions: ClusterMotions<'a>,
}

impl<'a> Coarse<'a> {
    pub(super) fn new(body: &'a SoftBody, cached: &'a CachedCoarseFactor, offset_from_centroid: &'a [Vec3]) -> Self {
        let motions = ClusterMotions { offset_from_centroid, filters: &cached.filters };
        Self { body, factor: &cached.factor, motions }
    }

    /// The squared residual in the preconditioner's norm, from the squares and the forces of all clusters; sets the rigid
    /// motions `modes` of the clusters under these forces.
    fn squared_norm(&self, of_clusters: Vec<(f64, [f64; MODES])>, modes: &mut Vec<f64>) -> f64 {
        let (squares, forces): (Vec<f64>, Vec<[f64; MODES]>) = of_clusters.into_iter().unzip();
        modes.clear();
        if !self.factor.is_empty() {
            modes.extend(forces.iter().flatten());
            self.factor.solve(Path::chosen(), modes);
        }
        let work = forces.iter().flatten().zip(modes).fold(0.0, |sum, (force, mode)| sum + force * *mode);
        squares.iter().sum::<f64>() + work
    }

    /// The squared residual of a cluster in the norm of the fine level, and the force and torque on it; `r` are those of its
    /// particles.
    #[inline(always)]
    fn of_cluster(&self, system: &System, cluster: usize, r: &[DVec3]) -> (f64, [f64; MODES]) {
        let (mut square, mut sums) = (0.0, [0.0; MODES]);
        for (particle, r) in self.body.order.clusters.range(cluster).zip(r) {
            square += solve_lower(&system.smoother[particle], *r).norm_squared();
            sums.iter_mut().zip(self.motions.along(particle, *r)).for_each(|(sum, force)| *sum += force);
        }
        (square, sums)
    }

    /// Adds an approximate solution of A·dx = r to `x` and updates the residual `r`, which is 0 at pinned particles and
    /// stays so.
    pub(super) fn solve(&self, system: &mut System, limits: Limits, x: &mut [DVec3], r: &mut [DVec3]) -> Reached {
        let (mut p, mut ap) = (vec![Quad::default(); r.len()], vec![Quad::default(); r.len()]);
        let mut modes = Vec::new();
        let start = self.start(system, r, &mut modes);
        let mut reached = Reached { iterations: 0, share: 0.0, start, met: start.is_finite() };
        if !(start > f64::MIN_POSITIVE && start.is_finite()) {
            return reached;
        }
        let (mut rz, mut beta) = (start, 0.0);
        let asked = limits.share * limits.share * start;
        let enough = asked.min(limits.square).max(asked.min(FINEST * FINEST * start));
        reached.met = loop {
            self.update_direction(system, &modes, r, beta, &mut p);
            let curvature = system.apply(self.body, &p, &mut ap);
            reached.iterations += 1;
            if !(curvature > 0.0 && curvature.is_finite()) {
                break false;
            }
            let alpha = rz / curvature;
            let next = self.body.order.clusters.map(
                (&mut x[..], &mut r[..]),
                |cluster, (x, r): (&mut [DVec3], &mut [DVec3])| {
                    for ((particle, x), r) in self.body.order.clusters.range(cluster).zip(x).zip(&mut *r) {
                        *x += p[particle].xyz() * alpha;
                        *r -= ap[particle].xyz() * alpha;
                    }
                    self.of_cluster(system, cluster, r)
                },
            );
            let after = self.squared_norm(next, &mut modes);
            if !(after.is_finite() && after >= 0.0) {
                break false;
            }
            (beta, rz) = (after / rz, after);
            if rz <= enough || reached.iterations >= limits.cap {
                break rz <= enough;
            }
        };
        reached.share = (rz / start).sqrt();
        reached
    }

    /// The squared residual in the preconditioner's norm; sets the rigid motions `modes` of the clusters.
    fn start(&self, system: &System, r: &[DVec3], modes: &mut Vec<f64>) -> f64 {
        let of_cluster = |cluster, ()| self.of_cluster(system, cluster, &r[self.body.order.clusters.range(cluster)]);
        self.squared_norm(self.body.order.clusters.map((), of_cluster), modes)
    }

    /// Sets the search direction `p` to the preconditioned residual plus `beta` times the last direction.
    fn update_direction(&self, system: &System, modes: &[f64], r: &[DVec3], beta: f64, p: &mut [Quad]) {
        self.body.order.clusters.for_each(p, |cluster, mine: &mut [Quad]| {
            let own = modes.get(MODES * cluster..MODES * (cluster + 1));
            for (particle, p) in
                self.body.order.clusters.range(cluster).zip(mine).filter(|(particle, _)| !system.held[*particle])
            {
                let smoother = &system.smoother[particle];
                let fine = solve_lower_transpose(smoother, solve_lower(smoother, r[particle]));
                let coarse = own.map_or(DVec3::zeros(), |modes| self.motions.moved(modes, particle));
                *p = Quad::new(fine + coarse) + *p * beta;
            }
        });
    }

    /// The preconditioner applied to `r`, an approximation of A⁻¹r.
    pub(super) fn precondition(&self, system: &System, r: &[DVec3]) -> Vec<DVec3> {
        let (mut modes, mut out) = (Vec::new(), vec![Quad::default(); r.len()]);
        self.start(system, r, &mut modes);
        self.update_direction(system, &modes, r, 0.0, &mut out);
        out.into_iter().map(Quad::xyz).collect()
    }
}
