//! Spring forces and their derivatives.
//!
//! A spring within a cluster is computed once and applied to both ends. Of one between clusters, each end computes
//! the force itself, from the same numbers with opposite sign. Forces therefore cancel exactly, and a cluster writes
//! only to its own particles.
//!
//! H = αI + (a²K − α)nnᵀ with α = a²K·max(0, 1 − R/l): Baraff & Witkin 1998 without the indefinite part, so it is
//! positive semi-definite at any length. K and R combine spring and dashpot, see [`Link`].

use super::body::SoftBody;
use numerics::adjacency::{Adjacency, Incident};
use numerics::partition::RaggedSlice;
use numerics::quad::Quad;
use numerics::random::Key;
use numerics::simd::{Path, kernel};
use numerics::vector::DVec3;

/// Springs that are linearised together.
const LANES: usize = 8;
/// Largest a²k of a record: products with displacements stay well within the range of f32.
const MOST_STIFFNESS: f64 = 1e24;

/// Stiffness of a spring, H·d = αd + w(w·d), with d the displacement of this end relative to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Record {
    /// w, α.
    stiffness: [f32; 4],
    pub(super) other: u32,
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
    #[inline(always)]
    fn new(other: u32, alpha: f64, w: DVec3) -> Self {
        Self { stiffness: [w.x, w.y, w.z, alpha].map(|x| x as f32), other }
    }

    #[inline(always)]
    pub(super) fn alpha(&self) -> f64 {
        f64::from(self.stiffness[3])
    }

    /// The vector w.
    #[inline(always)]
    pub(super) fn along(&self) -> DVec3 {
        Quad::widened(self.stiffness).xyz()
    }

    /// H·d.
    #[inline(always)]
    pub(super) fn times(&self, d: Quad) -> Quad {
        let w = Quad::widened(self.stiffness);
        d * w.fourth() + w * w.dot(d)
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

/// The direction of a spring from its other end, a unit vector, and its length.
#[inline(always)]
fn seen(link: &Link, particle: usize, x: &[DVec3]) -> (DVec3, f64) {
    let d = x[particle] - x[link.other as usize];
    let squared = d.norm_squared();
    // Outside this range the square has lost precision, or the length is zero.
    if squared > 1e-280 && squared < 1e280 {
        let length = squared.sqrt();
        (d * (1.0 / length), length)
    } else {
        degenerate_direction(d, link.spring, particle < link.other as usize)
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
    /// Tension at a length, newtons.
    #[inline(always)]
    fn tension(&self, length: f64) -> f64 {
        f64::from(self.k) * (length - self.rest)
    }

    /// [`Pulls`] where the squared length under- or overflows.
    #[cold]
    fn degenerate_pull(&self, x: &[DVec3], a: f64, particle: usize) -> (DVec3, f64, DVec3) {
        let (direction, length) = seen(self, particle, x);
        let k = (a * a * f64::from(self.k)).min(MOST_STIFFNESS);
        let alpha = if length > 0.0 {
            k * (1.0 - self.rest * (1.0 / length)).max(0.0)
        } else if self.rest > 0.0 {
            0.0
        } else {
            k
        };
        (direction * self.tension(length), alpha, direction * (k - alpha).max(0.0).sqrt())
    }
}

/// Springs seen from one end, eight at a time: at first the offset from the other end, K and R, then the results.
#[derive(Clone, Copy)]
struct Pulls {
    offset: [[f64; LANES]; 3],
    k: [f64; LANES],
    rest: [f64; LANES],
    /// Force along the spring, newtons.
    pull: [[f64; LANES]; 3],
    /// α and w of H.
    alpha: [f64; LANES],
    w: [[f64; LANES]; 3],
    /// Whether the squared length has not lost precision.
    sound: [bool; LANES],
}

impl Pulls {
    /// Springs of length 1 without stiffness.
    const NONE: Self = Self {
        offset: [[1.0; LANES], [0.0; LANES], [0.0; LANES]],
        k: [0.0; LANES],
        rest: [0.0; LANES],
        pull: [[0.0; LANES]; 3],
        alpha: [0.0; LANES],
        w: [[0.0; LANES]; 3],
        sound: [true; LANES],
    };

    fn set(&mut self, lane: usize, link: &Link, offset: DVec3) {
        (0..3).for_each(|axis| self.offset[axis][lane] = offset[axis]);
        (self.k[lane], self.rest[lane]) = (f64::from(link.k), link.rest);
    }

    #[inline(always)]
    fn at(&self, lane: usize) -> (DVec3, f64, DVec3) {
        let [pull, w] = [&self.pull, &self.w].map(|v| DVec3::new(v[0][lane], v[1][lane], v[2][lane]));
        (pull, self.alpha[lane], w)
    }
}

kernel! {
    /// Computes forces and H for a stage of `a`.
    fn compute_pulls(pulls: &mut [Pulls], a: f64) = compute_pulls_body;
}

#[inline(always)]
fn compute_pulls_body(pulls: &mut [Pulls], a: f64) {
    for pulls in pulls {
        let Pulls { offset: [x, y, z], k, rest, pull, alpha, w, sound } = pulls;
        for i in 0..LANES {
            let squared = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
            sound[i] = squared > 1e-280 && squared < 1e280;
            let length = squared.sqrt();
            let inverse = 1.0 / length;
            let direction = [x[i] * inverse, y[i] * inverse, z[i] * inverse];
            let tension = k[i] * (length - rest[i]);
            let stiff = (a * a * k[i]).min(MOST_STIFFNESS);
            alpha[i] = stiff * (1.0 - rest[i] * inverse).max(0.0);
            let root = (stiff - alpha[i]).max(0.0).sqrt();
            (pull[0][i], pull[1][i], pull[2][i]) =
                (direction[0] * tension, direction[1] * tension, direction[2] * tension);
            (w[0][i], w[1][i], w[2][i]) = (direction[0] * root, direction[1] * root, direction[2] * root);
        }
    }
}

/// Adds the spring forces listed at `particle` to the forces of its cluster, which starts at the particle `first`.
/// The sum of a particle is complete once it and all earlier ones of the cluster have been processed.
#[inline(always)]
pub(super) fn pull([inside, across]: [&[Link]; 2], x: &[DVec3], particle: usize, first: usize, forces: &mut [DVec3]) {
    let force = |link: &Link| {
        let (direction, length) = seen(link, particle, x);
        direction * link.tension(length)
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

/// What acts on a particle besides contacts and thin tetrahedra.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// The force of its springs, newtons.
    pub(super) pull: DVec3,
    /// External forces and those of regions, newtons.
    pub(super) others: DVec3,
    /// The diagonal block of springs and regions in the linear system: xx, xy, xz, yy, yz, zz.
    pub(super) block: [f64; 6],
}

impl Sums {
    /// Adds the force and H of a spring.
    #[inline(always)]
    fn add(&mut self, pull: DVec3, h: [f64; 6]) {
        self.pull += pull;
        self.block.iter_mut().zip(h).for_each(|(sum, h)| *sum += h);
    }
}

/// Sets `sums` to those of the springs of a cluster's `particles` at `x`, and sets the `records` of these springs, for a
/// stage of `a`.
pub(super) fn linearise(
    adjacency: &Adjacency,
    links: &[Link],
    mut records: RaggedSlice<'_, Record>,
    x: &[DVec3],
    a: f64,
    particles: std::ops::Range<usize>,
    sums: &mut [Sums],
) {
    let first = particles.start;
    let begin = adjacency.starts[first] as usize;
    let count = adjacency.starts[particles.end] as usize - begin;
    let mut pulls = vec![Pulls::NONE; count.div_ceil(LANES)];
    let mut at = 0;
    for particle in particles.clone() {
        for link in adjacency.of(particle, links).into_iter().flatten() {
            pulls[at / LANES].set(at % LANES, link, x[particle] - x[link.other as usize]);
            at += 1;
        }
    }
    compute_pulls(Path::chosen(), &mut pulls, a);
    sums.fill(Sums::default());
    at = 0;
    for (particle, records) in particles.zip(records.iter_mut()) {
        let [inside, across] = adjacency.of(particle, links);
        let mut sum = sums[particle - first];
        for (index, (link, record)) in inside.iter().chain(across).zip(records).enumerate() {
            let pulls = &pulls[at / LANES];
            let (pull, alpha, w) =
                if pulls.sound[at % LANES] { pulls.at(at % LANES) } else { link.degenerate_pull(x, a, particle) };
            at += 1;
            *record = Record::new(link.other, alpha, w);
            let h = [alpha + w.x * w.x, w.x * w.y, w.x * w.z, alpha + w.y * w.y, w.y * w.z, alpha + w.z * w.z];
            sum.add(-pull, h);
            if index < inside.len() {
                sums[link.other as usize - first].add(pull, h);
            }
        }
        sums[particle - first] = sum;
    }
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
