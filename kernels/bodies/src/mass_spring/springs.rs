//! Spring forces and their derivatives.
//!
//! A spring within a cluster is computed once and applied to both ends. Of one between clusters, each end computes
//! the force itself, from the same numbers with opposite sign. Forces therefore cancel exactly, and a cluster writes
//! only to its own particles.
//!
//! H = αI + (a²K − α)nnᵀ with α = a²K·max(0, 1 − R/l): Baraff & Witkin 1998 without the indefinite part, so it is
//! positive semi-definite at any length. K and R combine spring and dashpot, see [`Link`].

use super::body::SoftBody;
use numerics::adjacency::Incident;
use numerics::partition::RaggedSlice;
use numerics::random::Key;
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

/// Largest a²k of a record: products with displacements stay well within the range of f32.
const MOST_STIFFNESS: f64 = 1e24;

/// Stiffness of a spring, H·d = αd + w(w·d), with d the displacement of this end relative to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(super) struct Record {
    pub(super) other: u32,
    pub(super) alpha: f32,
    pub(super) w: Vec3,
}

/// Current rest lengths, and which springs are torn (may be empty: none).
#[derive(Clone, Copy)]
pub(super) struct RestLengths<'a> {
    pub(super) lengths: &'a [f64],
    pub(super) torn: &'a [bool],
}

impl RestLengths<'_> {
    #[inline(always)]
    pub(super) fn is_intact(&self, spring: u32) -> bool {
        !self.torn.get(spring as usize).copied().unwrap_or(false)
    }
}

impl Record {
    /// The vector w.
    #[inline(always)]
    pub(super) fn along(&self) -> DVec3 {
        to_f64(self.w)
    }

    /// H·d.
    #[inline(always)]
    pub(super) fn times(&self, d: DVec3) -> DVec3 {
        let w = self.along();
        d * f64::from(self.alpha) + w * w.dot(&d)
    }
}

/// A spring with its dashpot, as seen from one end during a stage.
///
/// Within a stage the dashpot acts on the rate of change of length, (l − lz)/a with lz the length at the start, so
/// that both combine to one spring: k(l − L₀) + c(l − lz)/a = K(l − R). This force has a potential, which a line
/// search needs, and a body that rotates by any angle in a step is not damped. Neither would hold for a dashpot on
/// the relative velocity along the spring.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Link {
    other: u32,
    spring: u32,
    /// K, N/m.
    k: f32,
    /// R, metres.
    rest: f64,
}

/// Links for all entries of `body.adjacency`, in a stage of `a` in which the dashpot of a spring starts from the
/// length `before` of its two ends. Torn springs get no stiffness.
pub(super) fn links(
    body: &SoftBody,
    rest: &RestLengths<'_>,
    a: f64,
    before: impl Fn(usize, usize) -> f64 + Sync,
    out: &mut Vec<Link>,
) {
    let adjacency = &body.adjacency;
    out.resize(adjacency.incident.len(), Link::default());
    let links = RaggedSlice::new(&adjacency.starts, out);
    body.order.clusters.for_each(links, |cluster, mut links| {
        for (particle, links) in body.order.clusters.range(cluster).zip(links.iter_mut()) {
            let incident = adjacency.of(particle, &adjacency.incident);
            for (link, incident) in links.iter_mut().zip(incident.into_iter().flatten()) {
                let at = incident.spring as usize;
                let (k, dashed) = (body.stiffness[at], body.damping[at] / a);
                let both = (k + dashed).min(f64::from(f32::MAX)) as f32;
                let mut length = rest.lengths[at];
                if dashed > 0.0 {
                    // Compensates the rounding of K to f32, so that without motion the force is exactly the spring's.
                    let before = before(particle, incident.other as usize);
                    length = (before - (before - length) * (k / f64::from(both))).max(0.0);
                }
                let k = if rest.is_intact(incident.spring) { both } else { 0.0 };
                *link = Link { other: incident.other, spring: incident.spring, k, rest: length };
            }
        }
    });
}

/// Sum of spring stiffnesses at each particle, N/m.
pub(super) fn particle_stiffness(body: &SoftBody, rest: &RestLengths<'_>, out: &mut Vec<f64>) {
    out.clear();
    out.resize(body.len(), 0.0);
    let clusters = &body.order.clusters;
    clusters.for_each(&mut out[..], |cluster, out: &mut [f64]| {
        let particles = clusters.range(cluster);
        for particle in particles.clone() {
            let [inside, across] = body.adjacency.of(particle, &body.adjacency.incident);
            let k = |incident: &Incident| {
                if rest.is_intact(incident.spring) { body.stiffness[incident.spring as usize] } else { 0.0 }
            };
            out[particle - particles.start] += inside.iter().chain(across).map(k).sum::<f64>();
            inside.iter().for_each(|incident| out[incident.other as usize - particles.start] += k(incident));
        }
    });
}

/// A spring seen from one end: unit vector from the other end, length, and 1 ÷ length.
#[derive(Clone, Copy)]
struct SpringView {
    direction: DVec3,
    length: f64,
    inverse: f64,
}

impl SpringView {
    #[inline(always)]
    fn from(link: &Link, particle: usize, x: &[DVec3]) -> Self {
        let d = x[particle] - x[link.other as usize];
        let squared = d.norm_squared();
        // Outside this range the square has lost precision, or the length is zero.
        if squared > 1e-280 && squared < 1e280 {
            let length = squared.sqrt();
            let inverse = 1.0 / length;
            Self { direction: d * inverse, length, inverse }
        } else {
            let (direction, length) = degenerate_direction(d, link.spring, particle < link.other as usize);
            Self { direction, length, inverse: 1.0 / length }
        }
    }

    /// Tension, newtons.
    #[inline(always)]
    fn tension(&self, link: &Link) -> f64 {
        f64::from(link.k) * (self.length - link.rest)
    }
}

/// Direction and length where the squared distance under- or overflows. For coinciding ends the direction is
/// pseudo-random for each spring, so that duplicate particles separate.
#[cold]
fn degenerate_direction(d: DVec3, spring: u32, first: bool) -> (DVec3, f64) {
    if d != DVec3::zeros() {
        let size = d.amax();
        let scaled = d / size;
        return (scaled.normalize(), size * scaled.norm());
    }
    let key = Key::new(u64::from(spring));
    let component = |axis: u64| 2.0 * key.of(axis).f64() - 1.0;
    let direction = DVec3::new(component(0), component(1), component(2)).try_normalize(1e-3).unwrap_or_else(DVec3::x);
    (if first { direction } else { -direction }, 0.0)
}

impl Link {
    /// Force on `particle` along the spring, newtons, and H for a stage of `a`, in full and as a record.
    #[inline(always)]
    fn linearise(&self, x: &[DVec3], a: f64, particle: usize, record: &mut Record) -> (DVec3, [f64; 6]) {
        let view = SpringView::from(self, particle, x);
        let force = view.direction * view.tension(self);
        let k = (a * a * f64::from(self.k)).min(MOST_STIFFNESS);
        let alpha = if view.length > 0.0 {
            k * (1.0 - self.rest * view.inverse).max(0.0)
        } else if self.rest > 0.0 {
            0.0
        } else {
            k
        };
        let w = view.direction * (k - alpha).max(0.0).sqrt();
        *record = Record { other: self.other, alpha: alpha as f32, w: to_f32(w) };
        let h = [alpha + w.x * w.x, w.x * w.y, w.x * w.z, alpha + w.y * w.y, w.y * w.z, alpha + w.z * w.z];
        (force, h)
    }
}

/// Adds the spring forces listed at `particle` to the forces of its cluster, which starts at the particle `first`.
/// The sum of a particle is complete once it and all earlier ones of the cluster have been processed.
#[inline(always)]
pub(super) fn pull([inside, across]: [&[Link]; 2], x: &[DVec3], particle: usize, first: usize, forces: &mut [DVec3]) {
    let force = |link: &Link| {
        let view = SpringView::from(link, particle, x);
        view.direction * view.tension(link)
    };
    let mut sum = forces[particle - first];
    for link in inside {
        let force = force(link);
        sum -= force;
        forces[link.other as usize - first] += force;
    }
    across.iter().for_each(|link| sum -= force(link));
    forces[particle - first] = sum;
}

/// Accumulators of [`linearise`], one for each particle of a cluster: forces, and sums of H.
pub(super) struct Sums<'a> {
    pub(super) forces: &'a mut [DVec3],
    pub(super) blocks: &'a mut [[f64; 6]],
}

/// As [`pull`], and sets the `records` of the springs for a stage of `a` and adds their H.
#[inline(always)]
pub(super) fn linearise(
    [inside, across]: [&[Link]; 2],
    records: &mut [Record],
    x: &[DVec3],
    a: f64,
    particle: usize,
    first: usize,
    sums: &mut Sums<'_>,
) {
    let add = |sum: &mut [f64; 6], h: [f64; 6]| sum.iter_mut().zip(h).for_each(|(sum, h)| *sum += h);
    let (mut force, mut block) = (sums.forces[particle - first], sums.blocks[particle - first]);
    let (inside_records, across_records) = records.split_at_mut(inside.len());
    for (link, record) in inside.iter().zip(inside_records) {
        let (pull, h) = link.linearise(x, a, particle, record);
        let other = link.other as usize - first;
        force -= pull;
        add(&mut block, h);
        sums.forces[other] += pull;
        add(&mut sums.blocks[other], h);
    }
    for (link, record) in across.iter().zip(across_records) {
        let (pull, h) = link.linearise(x, a, particle, record);
        force -= pull;
        add(&mut block, h);
    }
    (sums.forces[particle - first], sums.blocks[particle - first]) = (force, block);
}

/// Elastic energy of spring `at`, joules.
#[inline(always)]
pub(super) fn energy(body: &SoftBody, rest: &RestLengths<'_>, x: &[DVec3], at: usize) -> f64 {
    if rest.is_intact(at as u32) { stored(body, rest, at, spring_length(body, x, at)) } else { 0.0 }
}

/// The same of an intact spring with this length.
#[inline(always)]
pub(super) fn stored(body: &SoftBody, rest: &RestLengths<'_>, at: usize, length: f64) -> f64 {
    let strain = length - rest.lengths[at];
    0.5 * body.stiffness[at] * strain * strain
}

/// Length of spring `at`, metres.
#[inline(always)]
pub(super) fn spring_length(body: &SoftBody, x: &[DVec3], at: usize) -> f64 {
    let [a, b] = body.ends[at];
    distance(x, a as usize, b as usize)
}

/// Distance between two particles, metres.
#[inline(always)]
pub(super) fn distance(x: &[DVec3], a: usize, b: usize) -> f64 {
    let d = x[a] - x[b];
    let squared = d.norm_squared();
    if squared > 1e-280 && squared < 1e280 { squared.sqrt() } else { degenerate_direction(d, 0, true).1 }
}

/// Distance between two particles, metres, and its rate of change, m/s.
#[inline(always)]
pub(super) fn drift(x: &[DVec3], v: &[DVec3], a: usize, b: usize) -> [f64; 2] {
    let length = distance(x, a, b);
    let rate = if length > 0.0 { (x[a] - x[b]).dot(&(v[a] - v[b])) / length } else { 0.0 };
    [length, rate]
}

/// Potential within a stage of the springs listed at `particle`, each counted once, and of their dashpots, joules.
#[inline(always)]
pub(super) fn energy_at([inside, across]: [&[Link]; 2], x: &[DVec3], particle: usize) -> f64 {
    let energy = |link: &Link| {
        let strain = distance(x, particle, link.other as usize) - link.rest;
        f64::from(link.k) * strain * strain
    };
    let across = across.iter().filter(|link| particle < link.other as usize);
    0.5 * (inside.iter().map(energy).sum::<f64>() + across.map(energy).sum::<f64>())
}
