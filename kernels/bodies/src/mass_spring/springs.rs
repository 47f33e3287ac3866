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
use numerics::simd::kernel;
use numerics::vector::DVec3;
use std::ops::Range;

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

/// Whether a squared length has not lost precision, and is not zero.
#[inline(always)]
fn is_sound(squared: f64) -> bool {
    squared > 1e-280 && squared < 1e280
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

    /// The force on the other end, newtons.
    #[inline(always)]
    fn force(&self, x: &[DVec3], particle: usize) -> DVec3 {
        let d = x[particle] - x[self.other as usize];
        let squared = d.norm_squared();
        if is_sound(squared) {
            let length = squared.sqrt();
            return d * (self.tension(length) * (1.0 / length));
        }
        let (direction, length) = degenerate_direction(d, self.spring, particle < self.other as usize);
        direction * self.tension(length)
    }

    /// The force on the other end, and α and w of H, where the squared length under- or overflows.
    #[cold]
    fn degenerate_pull(&self, d: DVec3, a: f64, first: bool) -> (Quad, f64, Quad) {
        let (direction, length) = degenerate_direction(d, self.spring, first);
        let k = (a * a * f64::from(self.k)).min(MOST_STIFFNESS);
        let alpha = if length > 0.0 {
            k * (1.0 - self.rest * (1.0 / length)).max(0.0)
        } else if self.rest > 0.0 {
            0.0
        } else {
            k
        };
        let direction = Quad::new(direction);
        (direction * self.tension(length), alpha, direction * (k - alpha).max(0.0).sqrt())
    }
}

/// Springs, eight at a time.
#[derive(Clone, Copy)]
struct Lanes {
    /// Squared lengths, K and R.
    squared: [f64; LANES],
    k: [f64; LANES],
    rest: [f64; LANES],
    /// Tension ÷ length, α of H, and |w| ÷ length.
    pull: [f64; LANES],
    alpha: [f64; LANES],
    w: [f64; LANES],
}

impl Lanes {
    /// Springs of length 1 without stiffness.
    const NONE: Self = Self {
        squared: [1.0; LANES],
        k: [0.0; LANES],
        rest: [0.0; LANES],
        pull: [0.0; LANES],
        alpha: [0.0; LANES],
        w: [0.0; LANES],
    };

    /// Computes forces and H for a stage of `a`.
    #[inline(always)]
    fn linearise(&mut self, a: f64) {
        let Self { squared, k, rest, pull, alpha, w } = self;
        for i in 0..LANES {
            let length = squared[i].sqrt();
            let inverse = 1.0 / length;
            let stiff = (a * a * k[i]).min(MOST_STIFFNESS);
            alpha[i] = stiff * (1.0 - rest[i] * inverse).max(0.0);
            pull[i] = k[i] * (length - rest[i]) * inverse;
            w[i] = (stiff - alpha[i]).max(0.0).sqrt() * inverse;
        }
    }
}

/// Adds the spring forces listed at `particle` to the forces of its cluster, which starts at the particle `first`.
/// The sum of a particle is complete once it and all earlier ones of the cluster have been processed.
#[inline(always)]
pub(super) fn pull([inside, across]: [&[Link]; 2], x: &[DVec3], particle: usize, first: usize, forces: &mut [DVec3]) {
    let mut sum = forces[particle - first];
    for link in inside {
        let force = link.force(x, particle);
        sum -= force;
        forces[link.other as usize - first] += force;
    }
    across.iter().for_each(|link| sum -= link.force(x, particle));
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

/// The force on the other end of a spring, with α of H in the fourth lane, and the products of w with itself: xx, xy, xz and
/// yy, yz, zz. Sums of these.
#[derive(Clone, Copy, Default)]
struct Pull([Quad; 3]);

impl Pull {
    #[inline(always)]
    fn new(pull: Quad, alpha: f64, w: Quad) -> Self {
        let [first, second] = [[0, 0, 0, 0], [1, 1, 2, 2]].map(|lanes| w.permuted(lanes));
        Self([pull.with_fourth(alpha), w * first, w.permuted([1, 2, 2, 2]) * second])
    }

    /// As the spring acts on this end.
    #[inline(always)]
    fn reversed(self) -> Self {
        let [pull, first, second] = self.0;
        Self([(pull * -1.0).with_fourth(pull.fourth()), first, second])
    }

    #[inline(always)]
    fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, other)| *sum += other);
    }

    fn sums(self) -> Sums {
        let [pull, first, second] = self.0;
        let (alpha, first, second) = (pull.fourth(), first.xyz(), second.xyz());
        let block = [first.x + alpha, first.y, first.z, second.x + alpha, second.y, second.z + alpha];
        Sums { pull: pull.xyz(), block, ..Sums::default() }
    }
}

kernel! {
    /// Sets `sums` to those of the springs of a cluster's `particles` at `x`, and sets the `records` of these springs, for a
    /// stage of `a`.
    pub(super) fn linearise(
        springs: (&Adjacency, &[Link]),
        records: RaggedSlice<'_, Record>,
        x: &[DVec3],
        a: f64,
        particles: Range<usize>,
        sums: &mut [Sums],
    ) = linearise_body;
}

#[inline(always)]
fn linearise_body(
    (adjacency, links): (&Adjacency, &[Link]),
    mut records: RaggedSlice<'_, Record>,
    x: &[DVec3],
    a: f64,
    particles: Range<usize>,
    sums: &mut [Sums],
) {
    let first = particles.start;
    let [begin, end] = [first, particles.end].map(|particle| adjacency.starts[particle] as usize);
    let mut lanes = vec![Lanes::NONE; (end - begin).div_ceil(LANES)];
    let mut at = 0;
    for (particle, [inside, across]) in particles.clone().zip(adjacency.each(particles.clone(), links)) {
        let own = x[particle];
        for link in inside.iter().chain(across) {
            let (lanes, lane) = (&mut lanes[at / LANES], at % LANES);
            lanes.squared[lane] = (own - x[link.other as usize]).norm_squared();
            (lanes.k[lane], lanes.rest[lane]) = (f64::from(link.k), link.rest);
            at += 1;
        }
    }
    lanes.iter_mut().for_each(|lanes| lanes.linearise(a));
    let mut pulls = vec![Pull::default(); sums.len()];
    at = 0;
    for ((particle, [inside, across]), records) in
        particles.clone().zip(adjacency.each(particles, links)).zip(records.iter_mut())
    {
        let own = x[particle];
        let mut pull = |link: &Link, record: &mut Record| {
            let (lanes, lane) = (&lanes[at / LANES], at % LANES);
            at += 1;
            let d = own - x[link.other as usize];
            let (pull, alpha, w) = if is_sound(lanes.squared[lane]) {
                let d = Quad::new(d);
                (d * lanes.pull[lane], lanes.alpha[lane], d * lanes.w[lane])
            } else {
                link.degenerate_pull(d, a, particle < link.other as usize)
            };
            *record = Record { stiffness: w.with_fourth(alpha).narrowed(), other: link.other };
            Pull::new(pull, alpha, w)
        };
        let mut sum = pulls[particle - first];
        let (records_inside, records_across) = records.split_at_mut(inside.len());
        for (link, record) in inside.iter().zip(records_inside) {
            let pull = pull(link, record);
            sum.add(&pull.reversed());
            pulls[link.other as usize - first].add(&pull);
        }
        for (link, record) in across.iter().zip(records_across) {
            sum.add(&pull(link, record).reversed());
        }
        pulls[particle - first] = sum;
    }
    sums.iter_mut().zip(pulls).for_each(|(sums, pull)| *sums = pull.sums());
}

/// Elastic energy of an intact spring with this length, joules.
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
    if is_sound(squared) { squared.sqrt() } else { degenerate_direction(d, 0, true).1 }
}

/// Distance between two particles, metres, and its rate of change, m/s.
#[inline(always)]
pub(super) fn drift(x: &[DVec3], v: &[DVec3], a: usize, b: usize) -> [f64; 2] {
    let length = distance(x, a, b);
    let rate = if length > 0.0 { (x[a] - x[b]).dot(&(v[a] - v[b])) / length } else { 0.0 };
    [length, rate]
}

kernel! {
    /// Potential within a stage of the springs listed at `particles`, each counted once, and of their dashpots, joules.
    pub(super) fn potential(adjacency: &Adjacency, links: &[Link], x: &[DVec3], particles: Range<usize>) -> f64
        = potential_body;
}

#[inline(always)]
fn potential_body(adjacency: &Adjacency, links: &[Link], x: &[DVec3], particles: Range<usize>) -> f64 {
    let mut sum = 0.0;
    for (particle, [inside, across]) in particles.clone().zip(adjacency.each(particles, links)) {
        let own = x[particle];
        let energy = |link: &Link| {
            let squared = (own - x[link.other as usize]).norm_squared();
            let length = if is_sound(squared) { squared.sqrt() } else { distance(x, particle, link.other as usize) };
            let strain = length - link.rest;
            f64::from(link.k) * strain * strain
        };
        let across = across.iter().filter(|link| particle < link.other as usize);
        sum += inside.iter().map(energy).sum::<f64>() + across.map(energy).sum::<f64>();
    }
    0.5 * sum
}
