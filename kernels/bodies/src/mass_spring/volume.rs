//! What keeps a body's volume: a pressure in each region, and a push against tetrahedra that are about to turn over.
//!
//! Region: ½κ(V − V₀)²/V₀ and a fourth power, so that lost volume is fought by κ against the springs' own bulk modulus, and
//! much of it much harder: cheap where there is little to fight. Tetrahedron: below
//! [`THIN`] of its volume ½μ(THIN·V₀ − V)²/V₀, which pushes on through flat and inside out, where springs pull either way.
//! Both are made linear by their gradient alone (Gauss–Newton), so they never make the system indefinite.

use super::body::{SoftBody, volume};
use super::partition::{Partition, RaggedSlice};
use numerics::vector::DVec3;

/// Bulk modulus of the springs themselves ÷ E: their Poisson ratio is a quarter.
const SPRINGS: f64 = 2.0 / 3.0;
/// Share of the springs' loss that is left where all of a small one is fought: what conjugate gradients do nearly level.
const LEFT: f64 = 0.1;
/// Share of a region's volume that is fought twice as hard as a small one, and where hardness grows no more (114 times).
const SLIGHT: f64 = 0.0065;
const MUCH: f64 = 0.04;
/// Volume ÷ volume at rest below which a tetrahedron is pushed open.
const THIN: f64 = 0.3;
/// Volume ÷ volume at rest below which it is watched within a step. One that gets thin from above has to be seen and watched
/// too, as it would begin the next step with energy from nowhere.
const WATCHED: f64 = 0.7;
/// μ ÷ E where all lost volume is fought: springs alone pull a mirrored tetrahedron back into its mirror image with less.
const OPENING: f64 = 16.0;

/// The terms of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Volumes {
    /// κ ÷ V₀ of each region.
    stiffness: Vec<f64>,
    /// V₀.
    rest: Vec<f64>,
    /// Share fought.
    share: f64,
    /// Regions in parts.
    partition: Option<Partition>,
    /// How each region's volume changes with its particles.
    pub(super) gradients: Vec<DVec3>,
    /// Pressure each region has, Pa.
    pub(super) pressures: Vec<f64>,
    /// How each region's pressure grows with its volume within the stage, Pa/m³.
    slopes: Vec<f64>,
    /// The stage's a, seconds, and the volumes it comes from: dashpots count (V − those)/a, as springs do.
    a: f64,
    before: Vec<f64>,
    /// What they stored when last measured, and what their dashpots count in a line search, joules.
    pub(super) stored: f64,
    pub(super) damped: f64,
}

/// A tetrahedron that is thin or turned over.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThinTet {
    pub(super) corners: [u32; 4],
    /// How its volume changes with its corners.
    pub(super) gradient: [DVec3; 4],
    /// μ ÷ V₀, and what that opens it with, Pa.
    pub(super) stiffness: f64,
    pub(super) pressure: f64,
    pub(super) energy: f64,
}

impl Volumes {
    /// Fights `share` of what tetrahedra lose of `rest`, their volumes.
    pub(super) fn new(body: &SoftBody, share: f64, rest: &[f64]) -> Self {
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        let regions = &body.regions;
        if share == 0.0 || regions.len() == 0 {
            return Self::default();
        }
        let partition = regions.partition();
        let rest_sums = regions.sums(|tet| rest[tet]);
        let factor = SPRINGS * share / (1.0 - share + LEFT * share);
        let stiffness = regions.energy.iter().zip(&rest_sums).map(|(energy, volume)| {
            let k = factor * energy / (volume * volume);
            if k.is_finite() { k } else { 0.0 }
        });
        Self {
            stiffness: stiffness.collect(),
            rest: rest_sums,
            share,
            partition: Some(partition),
            gradients: vec![DVec3::zeros(); regions.particles.len()],
            pressures: vec![0.0; regions.len()],
            slopes: vec![0.0; regions.len()],
            a: f64::INFINITY,
            before: vec![0.0; regions.len()],
            stored: 0.0,
            damped: 0.0,
        }
    }

    /// Whether nothing is fought.
    pub(super) fn is_off(&self) -> bool {
        self.partition.is_none()
    }

    /// The volume of each region with particles at `x`.
    pub(super) fn at(&self, body: &SoftBody, x: &[DVec3]) -> Vec<f64> {
        self.drift(body, x, &[]).into_iter().map(|[volume, _]| volume).collect()
    }

    /// That, and how fast it changes, m³/s; all still where there is no `v`.
    pub(super) fn drift(&self, body: &SoftBody, x: &[DVec3], v: &[DVec3]) -> Vec<[f64; 2]> {
        let regions = &body.regions;
        let mut out = vec![[0.0; 2]; self.before.len()];
        if let Some(partition) = &self.partition {
            partition.for_each(&mut out[..], |part, out: &mut [[f64; 2]]| {
                let mut gradient = Vec::new();
                for (region, out) in partition.range(part).zip(out) {
                    let particles = regions.of(region);
                    gradient.resize(particles.len(), DVec3::zeros());
                    let volume = regions.measure(region, x, &mut gradient);
                    let pace = |(g, particle): (&DVec3, &u32)| v.get(*particle as usize).map_or(0.0, |v| g.dot(v));
                    *out = [volume, gradient.iter().zip(particles).map(pace).sum()];
                }
            });
        }
        out
    }

    /// Begins a stage of `a` whose volumes come from those `before`.
    pub(super) fn begin(&mut self, a: f64, before: Vec<f64>) {
        (self.a, self.before) = (a, before);
    }

    /// Measures pressures, gradients and energies.
    pub(super) fn measure(&mut self, body: &SoftBody, x: &[DVec3]) {
        let Some(partition) = &self.partition else { return };
        let (regions, stiffness, rest, before, a) = (&body.regions, &self.stiffness, &self.rest, &self.before, self.a);
        let gradients = RaggedSlice::new(&regions.starts, &mut self.gradients);
        let out = (&mut self.pressures[..], &mut self.slopes[..], gradients);
        let sums = partition.map(out, |part, (pressures, slopes, mut gradients)| {
            let (mut stored, mut damped) = (0.0, 0.0);
            let regions_here = partition.range(part).zip(pressures).zip(slopes).zip(gradients.iter_mut());
            for (((region, pressure), slope), mine) in regions_here {
                let volume = regions.measure(region, x, mine);
                let k = stiffness[region];
                let (push, steep, energy) = stiffened(volume - rest[region], rest[region]);
                let (dashed, more) = (k * regions.damping[region] / a, volume - before[region]);
                *pressure = k * push + dashed * more;
                *slope = k * steep + dashed;
                stored += k * energy;
                damped += 0.5 * dashed * more * more;
            }
            (stored, damped)
        });
        (self.stored, self.damped) = sums.into_iter().fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
    }

    /// What each region resists for steps of `a`, where last measured.
    pub(super) fn weights(&self, a: f64) -> Vec<f64> {
        self.slopes.iter().map(|slope| slope * a * a).collect()
    }

    /// Those of the `watched` tetrahedra that are thin.
    pub(super) fn thin_tets(&self, body: &SoftBody, x: &[DVec3], rest: &[f64], watched: &[u32]) -> Vec<ThinTet> {
        if self.is_off() {
            return Vec::new();
        }
        let of = |tet: &u32| {
            let tet = *tet as usize;
            let corners = body.tets[tet];
            let at = corners.map(|corner| x[corner as usize]);
            let left = THIN * rest[tet] - volume(at);
            let stiffness = OPENING * self.share * body.moduli[tet] / rest[tet].max(f64::MIN_POSITIVE);
            let pressure = stiffness * left;
            let thin = ThinTet { corners, gradient: opening(at), stiffness, pressure, energy: 0.5 * pressure * left };
            (left > 0.0 && thin.energy.is_finite()).then_some(thin)
        };
        watched.iter().filter_map(of).collect()
    }
}

/// What a lost (or won) volume is fought with, ÷ κ/V₀: the volume itself near rest, more and more from [`SLIGHT`] on, in a
/// straight line again from [`MUCH`] on. Its slope, and its integral.
fn stiffened(lost: f64, rest: f64) -> (f64, f64, f64) {
    let soft = 1.0 / (SLIGHT * rest * SLIGHT * rest);
    let curved = |lost: f64| {
        let square = lost * lost * soft;
        (lost * (1.0 + square), 1.0 + 3.0 * square, lost * lost * (0.5 + 0.25 * square))
    };
    let edge = MUCH * rest;
    if rest <= 0.0 {
        return (0.0, 0.0, 0.0);
    }
    if lost.abs() <= edge {
        return curved(lost);
    }
    let (push, slope, energy) = curved(edge);
    let more = lost.abs() - edge;
    ((push + slope * more).copysign(lost), slope, energy + push * more + 0.5 * slope * more * more)
}

/// How a tetrahedron's volume changes with each corner.
pub(super) fn opening([a, b, c, d]: [DVec3; 4]) -> [DVec3; 4] {
    let (ab, ac, ad) = (b - a, c - a, d - a);
    let [b, c, d] = [ac.cross(&ad) / 6.0, ad.cross(&ab) / 6.0, ab.cross(&ac) / 6.0];
    [-(b + c + d), b, c, d]
}

/// The tetrahedra of a body, looked over once a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Inventory {
    /// How many are inside out.
    pub(super) inverted: u32,
    /// All volume ÷ all at rest.
    pub(super) ratio: f64,
    /// Those that may be thin before the next look.
    pub(super) watched: Vec<u32>,
}

impl Inventory {
    /// With particles at `x`.
    pub(super) fn new(body: &SoftBody, x: &[DVec3], rest: &[f64]) -> Self {
        let partition = body.tet_partition.map((), |part, ()| {
            let (mut inverted, mut now, mut before, mut watched) = (0, 0.0, 0.0, Vec::new());
            for tet in body.tet_partition.range(part) {
                let volume = volume(body.tets[tet].map(|corner| x[corner as usize]));
                inverted += u32::from(volume < 0.0);
                if volume <= WATCHED * rest[tet] {
                    watched.push(tet as u32);
                }
                now += volume;
                before += rest[tet];
            }
            (inverted, now, before, watched)
        });
        let (mut all, mut now, mut before) = (Self::default(), 0.0, 0.0);
        for (inverted, volume, rest, watched) in partition {
            all.inverted += inverted;
            all.watched.extend(watched);
            now += volume;
            before += rest;
        }
        all.ratio = if before > 0.0 { now / before } else { 1.0 };
        all
    }

    /// Watches those too that turn out thin in `later`, of `rest` and with particles at `x`, and says whether there are such.
    pub(super) fn watch(&mut self, later: &Self, body: &SoftBody, x: &[DVec3], rest: &[f64]) -> bool {
        let thin = |tet: &&u32| {
            let at = **tet as usize;
            let left = volume(body.tets[at].map(|corner| x[corner as usize]));
            left < THIN * rest[at] && self.watched.binary_search(*tet).is_err()
        };
        let missed: Vec<u32> = later.watched.iter().filter(thin).copied().collect();
        if missed.is_empty() {
            return false;
        }
        self.watched.extend(missed);
        self.watched.sort_unstable();
        true
    }
}
