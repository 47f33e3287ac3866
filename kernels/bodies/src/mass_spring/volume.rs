//! Volume preservation: a pressure in each region, and a barrier against inversion of single tetrahedra.
//!
//! A region has the energy ½κ(V − V₀)²/V₀ plus a fourth-order term: κ acts against the bulk modulus of the springs,
//! and large changes of volume are resisted much more, at little cost where there are none. A tetrahedron below
//! [`THIN`] of its volume has ½μ(THIN·V₀ − V)²/V₀ and a term of fourth order too, which acts through the flat state and
//! beyond, where springs pull either way. Both are linearised by their gradient alone (Gauss–Newton), which keeps the
//! system positive semi-definite.

use super::body::{SoftBody, volume};
use super::stage::FrameContext;
use numerics::partition::{Partition, RaggedSlice};
use numerics::vector::{DVec2, DVec3};

/// Bulk modulus of the springs ÷ E: their Poisson ratio is a quarter.
const SPRINGS: f64 = 2.0 / 3.0;
/// Fraction of the volume change of bare springs that remains at full strength, for small changes: conjugate
/// gradients then converge almost as fast as without.
const REMAINING: f64 = 0.1;
/// Relative volume change at which resistance has doubled, and at which it stops growing (114 times).
const STIFFENING: f64 = 0.0065;
const STIFFENING_END: f64 = 0.04;
/// Volume ÷ rest volume below which the barrier acts on a tetrahedron.
const THIN: f64 = 0.3;
/// Volume lost beyond that, relative to the rest volume, at which the barrier has doubled. At no volume it is ten times as
/// strong as at first: goals and hands press harder than E. With 13 times, smashed dough gains energy.
const THIN_STIFFENING: f64 = THIN / 3.0;
/// Volume ÷ rest volume below which a tetrahedron is watched during a step. One that becomes thin within a step has
/// to be watched too, or the next step would start with spurious energy.
const WATCHED: f64 = 0.7;
/// μ ÷ E at full strength: with less, springs alone would pull an inverted tetrahedron into its mirror image.
const OPENING: f64 = 16.0;

/// Volume terms of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Volumes {
    /// κ ÷ V₀ of each region.
    stiffness: Vec<f64>,
    /// Rest volume V₀ of each region.
    rest: Vec<f64>,
    /// Strength of volume preservation, 0…1.
    share: f64,
    /// Regions in fixed parts.
    partition: Option<Partition>,
    /// Gradient of each region's volume with respect to its particles.
    pub(super) gradients: Vec<DVec3>,
    /// Pressure of each region, Pa.
    pub(super) pressures: Vec<f64>,
    /// Change of each region's volume from its rest volume, m³, and its dashpot's part of the slope, Pa/m³.
    changes: Vec<[f64; 2]>,
    /// Elastic pressure, Pa, and its derivative, with which each region enters the linear system, and the difference of
    /// that pressure from the current one.
    tangents: Vec<[f64; 2]>,
    pub(super) offsets: Vec<f64>,
    /// Elastic pressure of each region that the last linear system predicts, Pa; empty before the first.
    pub(super) predicted: Vec<f64>,
    /// Step coefficient of the stage, seconds, and volumes at its start: dashpots act on (V − those)/a, as for
    /// springs.
    pub(super) a: f64,
    pub(super) before: Vec<f64>,
    /// Stored energy when last measured, and the potential of the dashpots in a line search, joules.
    pub(super) stored: f64,
    pub(super) damped: f64,
}

/// A tetrahedron that is thin or inverted.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThinTet {
    pub(super) corners: [u32; 4],
    /// Gradient of its volume with respect to its corners.
    pub(super) gradient: [DVec3; 4],
    /// μ ÷ V₀, and the pressure that opens it, Pa.
    pub(super) stiffness: f64,
    pub(super) pressure: f64,
    /// Difference of the pressure around which it was linearised from the current one, Pa.
    pub(super) offset: f64,
    pub(super) energy: f64,
    pub(super) tet: u32,
    /// Its stiffness where it begins to be thin, Pa/m³, what it has to gain to be that, and its rest volume, m³.
    opening: f64,
    left: f64,
    rest: f64,
}

impl ThinTet {
    /// Linearises the pressure at an `expected` one.
    pub(super) fn linearise(&mut self, expected: f64) {
        let before = self.pressure;
        if let Some((push, slope)) = tangent(expected / self.opening, self.left, self.rest, [THIN_STIFFENING, THIN]) {
            (self.pressure, self.stiffness) = (self.opening * push, self.opening * slope);
        }
        self.offset = self.pressure - before;
    }

    /// Pressure that the linearisation predicts after a fraction `share` of the step `dx`, Pa.
    pub(super) fn predicted(&self, dx: &[DVec3], share: f64) -> f64 {
        let gains = self.corners.iter().zip(&self.gradient).map(|(corner, g)| g.dot(&dx[*corner as usize]));
        (self.pressure - self.stiffness * share * gains.sum::<f64>()).max(0.0)
    }
}

impl Volumes {
    /// Volume preservation of strength `share`, for tetrahedra with the volumes `rest`.
    pub(super) fn new(body: &SoftBody, share: f64, rest: &[f64]) -> Self {
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        let regions = &body.regions;
        if share == 0.0 || regions.len() == 0 {
            return Self::default();
        }
        let partition = regions.partition();
        let rest_sums = regions.sums(|tet| rest[tet]);
        let factor = SPRINGS * share / (1.0 - share + REMAINING * share);
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
            changes: vec![[0.0; 2]; regions.len()],
            tangents: vec![[0.0; 2]; regions.len()],
            offsets: vec![0.0; regions.len()],
            a: f64::INFINITY,
            before: vec![0.0; regions.len()],
            ..Self::default()
        }
    }

    /// Whether volume is not preserved.
    pub(super) fn is_disabled(&self) -> bool {
        self.partition.is_none()
    }

    /// Volume of each region with particles at `x`.
    pub(super) fn at(&self, body: &SoftBody, x: &[DVec3]) -> Vec<f64> {
        self.drift(body, x, &[]).into_iter().map(|[volume, _]| volume).collect()
    }

    /// Volume of each region and its rate of change, m³/s, which is 0 if `v` is empty.
    pub(super) fn drift(&self, body: &SoftBody, x: &[DVec3], v: &[DVec3]) -> Vec<[f64; 2]> {
        let regions = &body.regions;
        let mut out = vec![[0.0; 2]; self.before.len()];
        if let Some(partition) = &self.partition {
            partition.for_each(&mut out[..], |part, out: &mut [[f64; 2]]| {
                let (mut corners, mut gradient) = (Vec::new(), Vec::new());
                for (region, out) in partition.range(part).zip(out) {
                    let particles = regions.of(region);
                    gradient.resize(particles.len(), DVec3::zeros());
                    let volume = regions.measure(region, x, &mut corners, &mut gradient);
                    let rate = |(g, particle): (&DVec3, &u32)| v.get(*particle as usize).map_or(0.0, |v| g.dot(v));
                    *out = [volume, gradient.iter().zip(particles).map(rate).sum()];
                }
            });
        }
        out
    }

    /// Measures pressures, gradients and energies.
    pub(super) fn measure(&mut self, body: &SoftBody, x: &[DVec3]) {
        let Some(partition) = &self.partition else { return };
        let (regions, stiffness, rest, before, a) = (&body.regions, &self.stiffness, &self.rest, &self.before, self.a);
        let gradients = RaggedSlice::new(&regions.starts, &mut self.gradients);
        let out = (&mut self.pressures[..], &mut self.changes[..], gradients);
        let sums = partition.sum(out, |part, (pressures, changes, mut gradients)| {
            let (mut sums, mut corners) = (DVec2::zeros(), Vec::new());
            let regions_here = partition.range(part).zip(pressures).zip(changes).zip(gradients.iter_mut());
            for (((region, pressure), change), mine) in regions_here {
                let volume = regions.measure(region, x, &mut corners, mine);
                let k = stiffness[region];
                let (push, _, energy) = stiffened(volume - rest[region], rest[region], [STIFFENING, STIFFENING_END]);
                let (dashed, more) = (k * regions.damping[region] / a, volume - before[region]);
                *change = [volume - rest[region], dashed];
                *pressure = k * push + dashed * more;
                sums += DVec2::new(k * energy, 0.5 * dashed * more * more);
            }
            sums
        });
        (self.stored, self.damped) = (sums.x, sums.y);
    }

    /// Energy that the regions' dashpots take in a step of `h` seconds at the rate last measured, joules.
    pub(super) fn dissipated(&self, h: f64) -> f64 {
        if self.a > 0.0 { 2.0 * self.damped * h / self.a } else { 0.0 }
    }

    /// Linearises the elastic pressures, as last measured, at the predicted ones, if there are any.
    pub(super) fn linearise(&mut self) {
        for (region, [change, _]) in self.changes.iter().enumerate() {
            let (k, rest, range) = (self.stiffness[region], self.rest[region], [STIFFENING, STIFFENING_END]);
            let (now, slope, _) = stiffened(*change, rest, range);
            let predicted = self.predicted.get(region).and_then(|expected| tangent(expected / k, *change, rest, range));
            let (push, slope) = predicted.unwrap_or((now, slope));
            self.offsets[region] = k * (push - now);
            self.tangents[region] = [k * push, k * slope];
        }
    }

    /// Predicts the elastic pressures after a step `dx`, with the gradients as last measured.
    pub(super) fn predict(&mut self, body: &SoftBody, dx: &[DVec3]) {
        let Some(partition) = &self.partition else { return };
        let (regions, gradients, tangents) = (&body.regions, &self.gradients, &self.tangents);
        self.predicted.resize(tangents.len(), 0.0);
        partition.for_each(&mut self.predicted[..], |part, out: &mut [f64]| {
            for (region, out) in partition.range(part).zip(out) {
                let mine = &gradients[regions.starts[region] as usize..];
                let gains = regions.of(region).iter().zip(mine).map(|(particle, g)| g.dot(&dx[*particle as usize]));
                *out = tangents[region][0] + tangents[region][1] * gains.sum::<f64>();
            }
        });
    }

    /// Reduces the predictions to those of a fraction `share` of the step.
    pub(super) fn shorten_predicted(&mut self, share: f64) {
        for (predicted, [push, _]) in self.predicted.iter_mut().zip(&self.tangents) {
            *predicted = push + (*predicted - push) * share;
        }
    }

    /// Weight of each region's rank-one term in a stage of `a`, as last linearised.
    pub(super) fn weights(&self, a: f64) -> Vec<f64> {
        let known = self.tangents.iter().zip(&self.changes);
        known.map(|([_, slope], [_, dashed])| (slope + dashed) * a * a).collect()
    }

    /// Energy that is stored in regions, as last measured, and in thin tetrahedra, joules.
    pub(super) fn energy(&self, context: &FrameContext<'_>, x: &[DVec3], watched: &[u32]) -> [f64; 2] {
        let thin = self.thin_tets(context.body, x, context.volumes, watched);
        [self.stored, thin.iter().map(|thin| thin.energy).sum()]
    }

    /// The thin ones among the `watched` tetrahedra.
    pub(super) fn thin_tets(&self, body: &SoftBody, x: &[DVec3], rest: &[f64], watched: &[u32]) -> Vec<ThinTet> {
        if self.is_disabled() {
            return Vec::new();
        }
        let of = |tet: &u32| {
            let tet = *tet as usize;
            let corners = body.tets[tet];
            let at = corners.map(|corner| x[corner as usize]);
            let left = THIN * rest[tet] - volume(at);
            let stiffness = OPENING * self.share * body.moduli[tet] / rest[tet].max(f64::MIN_POSITIVE);
            let (push, slope, energy) = barrier(left, rest[tet]);
            let thin = ThinTet {
                tet: tet as u32,
                opening: stiffness,
                left,
                rest: rest[tet],
                corners,
                gradient: opening(at),
                stiffness: stiffness * slope,
                pressure: stiffness * push,
                offset: 0.0,
                energy: stiffness * energy,
            };
            (left > 0.0 && thin.energy.is_finite()).then_some(thin)
        };
        watched.iter().filter_map(of).collect()
    }
}

/// Resistance to a `change` of volume, relative to that to small ones: linear at first, twice as much at the change
/// `doubled` ÷ `rest`, linear again from `end` on. Returns the value, its derivative and its integral.
fn stiffened(change: f64, rest: f64, [doubled, end]: [f64; 2]) -> (f64, f64, f64) {
    let soft = 1.0 / (doubled * rest * doubled * rest);
    let curved = |change: f64| {
        let square = change * change * soft;
        (change * (1.0 + square), 1.0 + 3.0 * square, change * change * (0.5 + 0.25 * square))
    };
    let end = end * rest;
    if rest <= 0.0 {
        return (0.0, 0.0, 0.0);
    }
    if change.abs() <= end {
        return curved(change);
    }
    let (push, slope, energy) = continued(curved(end), change.abs() - end);
    (push.copysign(change), slope, energy)
}

/// A force with its derivative and its integral, continued linearly for `more`.
pub(super) fn continued((push, slope, energy): (f64, f64, f64), more: f64) -> (f64, f64, f64) {
    (push + slope * more, slope, energy + push * more + 0.5 * slope * more * more)
}

/// The tangent to [`stiffened`] where it resists with `expected`: its value and its derivative at `change`. `None` where that is
/// no smaller change, and where resistance no longer grows. Where resistance is `expected` to have the other sign, the
/// tangent is that at rest.
fn tangent(expected: f64, change: f64, rest: f64, [doubled, end]: [f64; 2]) -> Option<(f64, f64)> {
    let soft = 1.0 / (doubled * rest * doubled * rest);
    let expected = if expected * change > 0.0 { expected.abs() } else { 0.0 };
    // The root of at·(1 + soft·at²) = expected.
    let scale = (3.0 * soft).sqrt();
    let at = 2.0 / scale * libm::sinh(libm::asinh(1.5 * scale * expected) / 3.0);
    let slope = 1.0 + 3.0 * soft * at * at;
    (at < change.abs().min(end * rest)).then(|| ((expected + slope * (change.abs() - at)).copysign(change), slope))
}

/// The barrier of a tetrahedron that has `left` to gain until it is no longer thin, likewise. Once inverted it is resisted
/// as at first, so that one that is far inside out stores little energy.
fn barrier(left: f64, rest: f64) -> (f64, f64, f64) {
    let inverted = (left - THIN * rest).max(0.0);
    let (push, slope, energy) = stiffened(left - inverted, rest, [THIN_STIFFENING, THIN]);
    let slope = if inverted > 0.0 { 1.0 } else { slope };
    continued((push, slope, energy), inverted)
}

/// Gradient of a tetrahedron's volume with respect to each corner.
pub(super) fn opening([a, b, c, d]: [DVec3; 4]) -> [DVec3; 4] {
    let (ab, ac, ad) = (b - a, c - a, d - a);
    let [b, c, d] = [ac.cross(&ad) / 6.0, ad.cross(&ab) / 6.0, ab.cross(&ac) / 6.0];
    [-(b + c + d), b, c, d]
}

/// State of all tetrahedra, evaluated once a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Inventory {
    /// Number of inverted ones.
    pub(super) inverted: u32,
    /// Total volume ÷ total rest volume.
    pub(super) ratio: f64,
    /// Those that may become thin before the next evaluation.
    pub(super) watched: Vec<u32>,
}

impl Inventory {
    /// Evaluated at the positions `x`.
    pub(super) fn new(body: &SoftBody, x: &[DVec3], rest: &[f64]) -> Self {
        let parts = body.tet_partition.map((), |part, ()| {
            let tets = body.tet_partition.range(part);
            let now = body.tets[tets.clone()].iter().map(|tet| volume(tet.map(|corner| x[corner as usize])));
            let volumes: Vec<f64> = now.collect();
            let watched = tets.clone().zip(&volumes).filter(|(tet, volume)| **volume <= WATCHED * rest[*tet]);
            let watched: Vec<u32> = watched.map(|(tet, _)| tet as u32).collect();
            let inverted = volumes.iter().filter(|volume| **volume < 0.0).count() as u32;
            (inverted, volumes.iter().sum::<f64>(), rest[tets].iter().sum::<f64>(), watched)
        });
        let (mut all, mut now, mut before) = (Self::default(), 0.0, 0.0);
        for (inverted, volume, rest, watched) in parts {
            all.inverted += inverted;
            all.watched.extend(watched);
            now += volume;
            before += rest;
        }
        all.ratio = if before > 0.0 { now / before } else { 1.0 };
        all
    }

    /// Also watches the tetrahedra that are thin at `x` according to the `later` evaluation; returns whether there
    /// are any new ones.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tangent_touches_the_curve_where_it_has_the_expected_value() {
        let (rest, range) = (2.0, [0.1, 0.4]);
        for sign in [1.0, -1.0] {
            let (now, _, _) = stiffened(sign * 0.7, rest, range);
            for at in [0.0, 0.01, 0.2, 0.6] {
                let (expected, steep, _) = stiffened(sign * at, rest, range);
                let (push, slope) = tangent(expected, sign * 0.7, rest, range).unwrap();
                assert!((slope / steep - 1.0).abs() < 1e-12, "{at}");
                assert!((push - expected - slope * sign * (0.7 - at)).abs() < 1e-12 * push.abs(), "{at}");
                assert!(push.abs() < now.abs() && push * now > 0.0, "the curve grows faster");
                let opposite = tangent(-expected, sign * 0.7, rest, range).unwrap();
                assert_eq!(opposite, (sign * 0.7, 1.0), "no resistance is expected on this side");
            }
            // No smaller change, and beyond the curved part.
            let [(larger, _, _), (far, _, _)] = [0.75, 0.9].map(|change| stiffened(sign * change, rest, range));
            assert_eq!(tangent(larger, sign * 0.7, rest, range), None);
            assert_eq!(tangent(far, sign * 1.2, rest, range), None);
        }
        assert_eq!(tangent(0.0, 0.5, 0.0, range), None, "nothing to resist");
    }
}
