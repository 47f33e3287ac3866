//! Conjugate gradients with a two-level preconditioner: the 3×3 diagonal block of each particle, plus a coarse solve
//! for rigid motions of clusters (see [`super::coarse`]).
//!
//! Runs at most the given number of iterations and reports the residual reached, in the norm of the preconditioner.
//! Sums run by cluster in a fixed order, so bits do not depend on the number of threads.

use super::body::SoftBody;
use super::coarse::{ClusterMotions, MODES, modes};
use super::state::CachedCoarseFactor;
use super::system::{System, solve_lower, solve_lower_transpose};
use numerics::cholesky::EnvelopeMatrix;
use numerics::quad::Quad;
use numerics::simd::{Path, kernel};
use numerics::vector::DVec3;
use std::ops::Range;

/// An absolute bound on the residual is not pursued below this fraction of the initial residual.
const FINEST: f64 = 1e-4;

/// Stopping criteria.
#[derive(Clone, Copy)]
pub(super) struct Limits<'a> {
    /// Final ÷ initial residual.
    pub(super) share: f64,
    /// The squared residual has to fall below this too, as far as [`FINEST`] allows.
    pub(super) square: f64,
    /// Maximum number of iterations.
    pub(super) cap: u32,
    /// Final ÷ initial residual that suffices if this holds of the residual.
    pub(super) loose_share: f64,
    pub(super) suffices: &'a dyn Fn(&[Quad]) -> bool,
}

impl Limits<'_> {
    /// Limits of a solve that ends with a `share` of the residual.
    pub(super) fn of(share: f64, cap: u32) -> Self {
        Self { share, square: f64::INFINITY, cap, loose_share: share, suffices: &|_| false }
    }
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
    pub(super) fn new(
        body: &'a SoftBody,
        cached: &'a CachedCoarseFactor,
        offset_from_centroid: &'a [[f32; 4]],
    ) -> Self {
        let motions = ClusterMotions { offset_from_centroid, filters: &cached.filters };
        Self { body, factor: &cached.factor, motions }
    }

    /// Adds an approximate solution of A·dx = r to `x` and updates the residual `r`, which is 0 at pinned particles and
    /// stays so.
    pub(super) fn solve(&self, system: &mut System, limits: Limits<'_>, x: &mut [DVec3], r: &mut [DVec3]) -> Reached {
        let (mut p, mut ap) = (vec![Quad::default(); r.len()], vec![Quad::default(); r.len()]);
        let mut left: Vec<Quad> = r.iter().copied().map(Quad::new).collect();
        let mut modes = Vec::new();
        let start = self.reduce(system, 0.0, &ap, &mut left, &mut modes);
        let mut reached = Reached { iterations: 0, share: 0.0, start, met: start.is_finite() };
        if !(start > f64::MIN_POSITIVE && start.is_finite()) {
            return reached;
        }
        let (mut rz, mut alpha, mut beta) = (start, 0.0, 0.0);
        let asked = limits.share * limits.share * start;
        let enough = asked.min(limits.square).max(asked.min(FINEST * FINEST * start));
        let loose = (limits.loose_share * limits.loose_share * start).min(limits.square);
        reached.met = loop {
            self.update_direction(system, &modes, &left, [alpha, beta], &mut p, x);
            let curvature = system.apply(self.body, &p, &mut ap);
            reached.iterations += 1;
            if !(curvature > 0.0 && curvature.is_finite()) {
                // No step along it, which may be infinite.
                p.fill(Quad::default());
                break false;
            }
            alpha = rz / curvature;
            let after = self.reduce(system, alpha, &ap, &mut left, &mut modes);
            if !(after.is_finite() && after >= 0.0) {
                break false;
            }
            (beta, rz) = (after / rz, after);
            let met = rz <= enough || rz <= loose && (limits.suffices)(&left);
            if met || reached.iterations >= limits.cap {
                break met;
            }
        };
        x.iter_mut().zip(&p).for_each(|(x, p)| *x += (*p * alpha).xyz());
        r.iter_mut().zip(left).for_each(|(r, left)| *r = left.xyz());
        reached.share = (rz / start).sqrt();
        reached
    }

    /// Reduces the residual `r` by a step of `alpha`, whose product with the matrix is `alpha` times `ap`. Returns its square in
    /// the preconditioner's norm, and sets the rigid motions `modes` of the clusters.
    fn reduce(&self, system: &System, alpha: f64, ap: &[Quad], r: &mut [Quad], modes: &mut Vec<f64>) -> f64 {
        let of_clusters = self.body.order.clusters.map(r, |cluster, r: &mut [Quad]| {
            let particles = self.body.order.clusters.range(cluster);
            reduce_in_cluster(Path::chosen(), (system, &self.motions), particles, alpha, ap, r)
        });
        let (squares, forces): (Vec<f64>, Vec<[f64; MODES]>) = of_clusters.into_iter().unzip();
        modes.clear();
        if !self.factor.is_empty() {
            modes.extend(forces.iter().flatten());
            self.factor.solve(Path::chosen(), modes);
        }
        let work = forces.iter().flatten().zip(modes).fold(0.0, |sum, (force, mode)| sum + force * *mode);
        squares.iter().sum::<f64>() + work
    }

    /// Adds `alpha` times the search direction `p` to `x`, and sets it to the preconditioned residual plus `beta` times itself.
    fn update_direction(
        &self,
        system: &System,
        modes: &[f64],
        r: &[Quad],
        steps: [f64; 2],
        p: &mut [Quad],
        x: &mut [DVec3],
    ) {
        self.body.order.clusters.for_each((p, x), |cluster, mine: (&mut [Quad], &mut [DVec3])| {
            let particles = self.body.order.clusters.range(cluster);
            let own = modes.get(MODES * cluster..MODES * (cluster + 1));
            let own = own.map(|own| [&own[..3], &own[3..]].map(|own| Quad::new(DVec3::from_column_slice(own))));
            update_in_cluster(Path::chosen(), (system, &self.motions), particles, own, r, steps, mine);
        });
    }

    /// The preconditioner applied to `r`, an approximation of A⁻¹r.
    pub(super) fn precondition(&self, system: &System, r: &[DVec3]) -> Vec<DVec3> {
        let mut left: Vec<Quad> = r.iter().copied().map(Quad::new).collect();
        let (mut modes, mut out) = (Vec::new(), vec![Quad::default(); r.len()]);
        self.reduce(system, 0.0, &out, &mut left, &mut modes);
        self.update_direction(system, &modes, &left, [0.0; 2], &mut out, &mut vec![DVec3::zeros(); r.len()]);
        out.into_iter().map(Quad::xyz).collect()
    }
}

kernel! {
    /// The part of [`Coarse::reduce`] that belongs to one cluster: the square in the norm of the fine level, and the force and
    /// torque on it.
    fn reduce_in_cluster(
        levels: (&System, &ClusterMotions<'_>),
        particles: Range<usize>,
        alpha: f64,
        ap: &[Quad],
        r: &mut [Quad],
    ) -> (f64, [f64; MODES]) = reduce_in_cluster_body;
}

#[inline(always)]
fn reduce_in_cluster_body(
    (system, motions): (&System, &ClusterMotions<'_>),
    particles: Range<usize>,
    alpha: f64,
    ap: &[Quad],
    r: &mut [Quad],
) -> (f64, [f64; MODES]) {
    let (mut square, mut force, mut torque) = (0.0, Quad::default(), Quad::default());
    let each = ap[particles.clone()].iter().zip(&system.smoother[particles.clone()]).zip(r);
    for (particle, ((ap, smoother), r)) in particles.zip(each) {
        *r -= *ap * alpha;
        square += solve_lower(smoother, r.xyz()).norm_squared();
        let [shift, turn] = motions.along(particle, *r);
        force += shift;
        torque += turn;
    }
    (square, modes([force, torque]))
}

kernel! {
    /// The part of [`Coarse::update_direction`] that belongs to one cluster, with its rigid motion `own`.
    fn update_in_cluster(
        levels: (&System, &ClusterMotions<'_>),
        particles: Range<usize>,
        own: Option<[Quad; 2]>,
        r: &[Quad],
        steps: [f64; 2],
        mine: (&mut [Quad], &mut [DVec3]),
    ) = update_in_cluster_body;
}

#[inline(always)]
fn update_in_cluster_body(
    (system, motions): (&System, &ClusterMotions<'_>),
    particles: Range<usize>,
    own: Option<[Quad; 2]>,
    r: &[Quad],
    [alpha, beta]: [f64; 2],
    (p, x): (&mut [Quad], &mut [DVec3]),
) {
    let each = r[particles.clone()].iter().zip(&system.smoother[particles.clone()]);
    let each = each.zip(&system.held[particles.clone()]).zip(p).zip(x);
    for (particle, ((((r, smoother), held), p), x)) in particles.zip(each) {
        *x += (*p * alpha).xyz();
        if !held {
            let fine = solve_lower_transpose(smoother, solve_lower(smoother, r.xyz()));
            let coarse = own.map_or(Quad::default(), |own| motions.moved(own, particle));
            *p = Quad::new(fine) + coarse + *p * beta;
        }
    }
}
