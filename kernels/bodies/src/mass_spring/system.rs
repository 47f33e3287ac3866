//! The linear system of a Newton iteration, M + a²K + aC of springs, volumes, goals and contacts, applied without
//! assembling it.
//!
//! Spring stiffnesses are f32 and act on differences of displacements, so rigid motions are not resisted in any bit,
//! however stiff the springs are relative to the masses. (An assembled matrix would lose the masses at a²k ÷ m of
//! 1e7.) Vectors are f64.

use super::body::SoftBody;
use super::springs::{Record, Sums};
use numerics::quad::Quad;
use numerics::rank_one::{RankOneTerms, part_of};
use numerics::simd::{Path, kernel};
use numerics::vector::DVec3;

/// M + a²K + aC at some positions.
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    /// Springs, one for each entry of `SoftBody::adjacency`.
    pub(super) records: Vec<Record>,
    /// What acts on each particle besides contacts and thin tetrahedra.
    pub(super) sums: Vec<Sums>,
    /// Isotropic diagonal terms of each particle: mass, drag, goals. Kilograms.
    pub(super) inertia: Vec<f64>,
    /// Contacts of single particles, xx xy xz yy yz zz; empty without any. In f64: penalties may be 1e12 times as stiff as what
    /// resists along the surface.
    pub(super) blocks: Vec<[f64; 6]>,
    /// Particles that have such contacts, ascending.
    pub(super) in_contact: Vec<u32>,
    /// Pinned particles.
    pub(super) held: Vec<bool>,
    /// Particles without intact springs.
    pub(super) isolated: Vec<bool>,
    /// Terms of regions.
    pub(super) regions: RankOneTerms,
    /// Terms of thin tetrahedra, of contacts with obstacles, and of contacts between bodies.
    pub(super) transient: RankOneTerms,
    /// Number of the first two, which hold particles in space.
    pub(super) anchors: usize,
    /// For each particle the inverse Cholesky factor of its 3×3 diagonal block, lower triangle by rows.
    pub(super) smoother: Vec<[f32; 6]>,
}

impl System {
    /// Writes A·p to `out` and returns pᵀAp. `p` is 0 at pinned particles.
    pub(super) fn apply(&mut self, body: &SoftBody, p: &[Quad], out: &mut [Quad]) -> f64 {
        let clusters = &body.order.clusters;
        self.regions.measure(p);
        self.transient.measure(p);
        let system = &*self;
        clusters.sum(out, |cluster, out: &mut [Quad]| apply_in_cluster(Path::chosen(), system, body, cluster, p, out))
    }

    /// Whether a particle does not move with its piece: it is pinned or isolated.
    pub(super) fn is_loose(&self, particle: usize) -> bool {
        self.held[particle] || self.isolated[particle]
    }
}

kernel! {
    /// The part of [`System::apply`] that belongs to one cluster.
    fn apply_in_cluster(system: &System, body: &SoftBody, cluster: usize, p: &[Quad], out: &mut [Quad]) -> f64
        = apply_in_cluster_body;
}

#[inline(always)]
fn apply_in_cluster_body(system: &System, body: &SoftBody, cluster: usize, p: &[Quad], out: &mut [Quad]) -> f64 {
    let particles = body.order.clusters.range(cluster);
    let first = particles.start;
    out.fill(Quad::default());
    let (mine, inertia) = (&p[particles.clone()], &system.inertia[particles.clone()]);
    // One loop for each kind of term: beside single components the compiler would not keep vectors in registers.
    let springs = body.adjacency.each(particles.clone(), &system.records);
    for (index, ((mine, inertia), [inside, across])) in mine.iter().zip(inertia).zip(springs).enumerate() {
        let mut total = out[index] + *mine * *inertia;
        for record in inside {
            let other = record.other as usize;
            let force = record.times(*mine - p[other]);
            total += force;
            out[other - first] -= force;
        }
        for record in across {
            total += record.times(*mine - p[record.other as usize]);
        }
        out[index] = total;
    }
    for particle in part_of(&system.in_contact, particles.clone()).iter().map(|particle| *particle as usize) {
        out[particle - first] += Quad::new(times(&system.blocks[particle], p[particle].xyz()));
    }
    for terms in [&system.regions, &system.transient] {
        for particle in terms.members(particles.clone()).iter().map(|particle| *particle as usize) {
            out[particle - first] += terms.push(particle);
        }
    }
    let mut sum = 0.0;
    for ((mine, held), out) in mine.iter().zip(&system.held[particles]).zip(out) {
        if *held {
            *out = Quad::default();
        }
        sum += mine.dot(*out);
    }
    sum
}

/// A symmetric block times a vector.
#[inline(always)]
pub(super) fn times([xx, xy, xz, yy, yz, zz]: &[f64; 6], v: DVec3) -> DVec3 {
    DVec3::new(xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z)
}

/// Inverse Cholesky factor of a positive definite symmetric block, by rows: WᵀW is the inverse of the block and stays
/// positive definite in f32. A pivot lost to rounding is replaced by a small fraction of its diagonal entry.
#[inline(always)]
pub(super) fn smoother(block: &[f64; 6]) -> [f32; 6] {
    /// A pivot below this fraction of its diagonal entry is rounding noise.
    const NEGLIGIBLE: f64 = 1e-13;
    let [xx, xy, xz, yy, yz, zz] = *block;
    let pivot = |left: f64, whole: f64| 1.0 / left.max(NEGLIGIBLE * whole).sqrt();
    let a = pivot(xx, xx);
    let (ba, ca) = (xy * a, xz * a);
    let b = pivot(yy - ba * ba, yy);
    let cb = (yz - ca * ba) * b;
    let c = pivot(zz - ca * ca - cb * cb, zz);
    // l = [[1/a, 0, 0], [ba, 1/b, 0], [ca, cb, 1/c]].
    let (low, left) = (-ba * a * b, -cb * b * c);
    let corner = -(ca * a + cb * low) * c;
    let all = [a, low, b, corner, left, c];
    if all.iter().all(|value| value.is_finite()) { all.map(|value| value as f32) } else { [0.0; 6] }
}

/// W·r, with |W·r|² = rᵀ·block⁻¹·r.
#[inline(always)]
pub(super) fn solve_lower(w: &[f32; 6], r: DVec3) -> DVec3 {
    let [a, low, b, corner, left, c] = w.map(f64::from);
    DVec3::new(a * r.x, low * r.x + b * r.y, corner * r.x + left * r.y + c * r.z)
}

/// Wᵀ·h.
#[inline(always)]
pub(super) fn solve_lower_transpose(w: &[f32; 6], h: DVec3) -> DVec3 {
    let [a, low, b, corner, left, c] = w.map(f64::from);
    DVec3::new(a * h.x + low * h.y + corner * h.z, b * h.y + left * h.z, c * h.z)
}
