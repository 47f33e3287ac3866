//! The force of the springs on each particle, and its derivative: what a spring's ends do to each other.
//!
//! Each end of a spring computes it for itself, from the same numbers with the sign turned, so both forces add up to zero in
//! every bit, and a particle needs only its own slot.
//!
//! Source: H = αI + (a²k + ac − α)nnᵀ, α = a²k·max(0, 1 − L₀/l), Baraff & Witkin 1998 with what makes H indefinite left
//! out: positive semi-definite for every length.

use super::V3;
use super::body::Body;
use super::parts::Several;
use numerics::random::Key;

/// Largest a²k a record holds: α, β and products with displacements stay far inside of f32.
const STIFFEST: f64 = 1e24;

/// Half of H that one end sees: Hd = αd + w(w·d), d its displacement against the other end's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(super) struct Record {
    pub(super) other: u32,
    pub(super) alpha: f32,
    pub(super) w: [f32; 3],
}

/// Where the particles are, and how fast.
#[derive(Clone, Copy)]
pub(super) struct Motion<'a> {
    pub(super) x: &'a [V3],
    pub(super) v: &'a [V3],
}

/// Lengths at rest, a spring, and which springs are torn; none where empty.
#[derive(Clone, Copy)]
pub(super) struct Rest<'a> {
    pub(super) lengths: &'a [f64],
    pub(super) torn: &'a [bool],
}

impl Rest<'_> {
    #[inline(always)]
    pub(super) fn holds(&self, spring: u32) -> bool {
        !self.torn.get(spring as usize).copied().unwrap_or(false)
    }
}

/// A spring as one end sees it, with all that its force hangs on: read in order, once a look.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Link {
    other: u32,
    spring: u32,
    k: f32,
    c: f32,
    rest: f64,
}

/// The springs at each particle, as in [`Body::hung`]; torn ones neither pull nor resist.
pub(super) fn links(body: &Body, rest: &Rest<'_>, out: &mut Vec<Link>) {
    out.resize(body.hung.len(), Link::default());
    let links = Several::new(&body.starts, out);
    body.order.clusters.each(links, |cluster, mut links| {
        for (place, links) in body.order.clusters.range(cluster).zip(links.iter_mut()) {
            let hung = &body.hung[body.starts[place] as usize..body.starts[place + 1] as usize];
            for (link, hung) in links.iter_mut().zip(hung) {
                let at = hung.spring as usize;
                let holds = if rest.holds(hung.spring) { 1.0 } else { 0.0 };
                *link = Link {
                    other: hung.other,
                    spring: hung.spring,
                    k: body.stiffness[at] as f32 * holds,
                    c: body.damping[at] as f32 * holds,
                    rest: rest.lengths[at],
                };
            }
        }
    });
}

/// Which particles no spring holds; empty where each has one.
pub(super) fn alone(body: &Body, links: &[Link], out: &mut Vec<bool>) {
    let of = |ends: &[u32]| links[ends[0] as usize..ends[1] as usize].iter().all(|link| link.k == 0.0);
    out.clear();
    out.extend(body.starts.windows(2).map(of));
    if !out.contains(&true) {
        out.clear();
    }
}

/// A spring seen from one end: the way there from the other, its length, and 1 ÷ that.
#[derive(Clone, Copy)]
struct Seen {
    way: V3,
    length: f64,
    inverse: f64,
}

impl Seen {
    #[inline(always)]
    fn from(link: &Link, place: usize, x: &[V3]) -> Self {
        let d = x[place] - x[link.other as usize];
        let squared = d.norm_squared();
        // Outside of these a square has lost its digits, or the length is none.
        if squared > 1e-280 && squared < 1e280 {
            let length = squared.sqrt();
            let inverse = 1.0 / length;
            Self { way: d * inverse, length, inverse }
        } else {
            let (way, length) = unusual(d, link.spring, place < link.other as usize);
            Self { way, length, inverse: 1.0 / length }
        }
    }

    /// What pulls the ends together, newtons.
    #[inline(always)]
    fn tension(&self, link: &Link, dv: V3) -> f64 {
        f64::from(link.k) * (self.length - link.rest) + f64::from(link.c) * self.way.dot(&dv)
    }
}

/// A direction for ends that are in the same place (any: each spring's own, so that doubled particles part), or whose
/// distance squared is beyond numbers.
#[cold]
fn unusual(d: V3, spring: u32, first: bool) -> (V3, f64) {
    if d != V3::zeros() {
        let size = d.amax();
        let scaled = d / size;
        return (scaled.normalize(), size * scaled.norm());
    }
    let key = Key::new(u64::from(spring));
    let component = |axis: u64| 2.0 * key.of(axis).f64() - 1.0;
    let way = V3::new(component(0), component(1), component(2)).try_normalize(1e-3).unwrap_or_else(V3::x);
    (if first { way } else { -way }, 0.0)
}

/// The force of its springs on the particle at `place`, newtons.
#[inline(always)]
pub(super) fn force(links: &[Link], motion: &Motion<'_>, place: usize) -> V3 {
    let mut sum = V3::zeros();
    for link in links {
        let seen = Seen::from(link, place, motion.x);
        sum -= seen.way * seen.tension(link, motion.v[place] - motion.v[link.other as usize]);
    }
    sum
}

/// The force, the records of the particle's springs for steps of `a`, and the sum of their H.
#[inline(always)]
pub(super) fn linearise(
    links: &[Link],
    motion: &Motion<'_>,
    a: f64,
    place: usize,
    records: &mut [Record],
) -> (V3, [f64; 6]) {
    let (mut sum, mut block) = (V3::zeros(), [0.0; 6]);
    for (link, record) in links.iter().zip(records) {
        let seen = Seen::from(link, place, motion.x);
        sum -= seen.way * seen.tension(link, motion.v[place] - motion.v[link.other as usize]);
        let k = (a * a * f64::from(link.k)).min(STIFFEST);
        let along = (k + a * f64::from(link.c)).min(2.0 * STIFFEST);
        let alpha = if seen.length > 0.0 {
            k * (1.0 - link.rest * seen.inverse).max(0.0)
        } else if link.rest > 0.0 {
            0.0
        } else {
            k
        };
        let w = seen.way * (along - alpha).max(0.0).sqrt();
        *record = Record { other: link.other, alpha: alpha as f32, w: [w.x as f32, w.y as f32, w.z as f32] };
        block[0] += alpha + w.x * w.x;
        block[1] += w.x * w.y;
        block[2] += w.x * w.z;
        block[3] += alpha + w.y * w.y;
        block[4] += w.y * w.z;
        block[5] += alpha + w.z * w.z;
    }
    (sum, block)
}

/// The energy that spring `at` holds, joules.
#[inline(always)]
pub(super) fn energy(body: &Body, rest: &Rest<'_>, x: &[V3], at: usize) -> f64 {
    if !rest.holds(at as u32) {
        return 0.0;
    }
    let strain = length(body, x, at) - rest.lengths[at];
    0.5 * body.stiffness[at] * strain * strain
}

/// How long spring `at` is, metres.
#[inline(always)]
pub(super) fn length(body: &Body, x: &[V3], at: usize) -> f64 {
    let [a, b] = body.ends[at];
    let d = x[a as usize] - x[b as usize];
    let squared = d.norm_squared();
    if squared > 1e-280 && squared < 1e280 { squared.sqrt() } else { unusual(d, 0, true).1 }
}

/// What a line search counts the dashpot of spring `at` as, where `v` changes by 1/a of what `x` does.
#[inline(always)]
pub(super) fn dissipation(body: &Body, rest: &Rest<'_>, x: &[V3], v: &[V3], at: usize, a: f64) -> f64 {
    let [first, second] = body.ends[at].map(|end| end as usize);
    let d = x[first] - x[second];
    let squared = d.norm_squared();
    if squared == 0.0 || !rest.holds(at as u32) {
        return 0.0;
    }
    let pace = d.dot(&(v[first] - v[second]));
    0.5 * a * body.damping[at] * pace * pace / squared
}
