//! The direction of the wind at each pivot: its own direction plus noise.

use super::curve_group::{CurveGroup, Curves, Unit};
use super::share::gather;
use super::{Bend, BendNoise};
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::vector::{self, Vec3};

/// Largest amplitude: the wind's own part is then below rounding, and squares are still far from overflow.
const LARGEST: f32 = 1e12;

/// The wind's direction at the CVs of sixteen curves.
pub(super) struct WindDirection<'a> {
    wind: [f32; 3],
    noise: Option<&'a BendNoise<'a>>,
    gusts: Option<&'a [[f32; 3]]>,
    /// Positions at which the roots sample the noise, at its origin and at the other one, in metres, one array for each
    /// axis.
    roots: [[[f64; LANES]; 3]; 2],
    /// Length of each lane's unit in metres.
    unit: &'a F32x16,
}

impl<'a> WindDirection<'a> {
    #[inline(always)]
    pub(super) fn new(bend: &'a Bend<'a>, group: &CurveGroup<'_>, curves: &Curves, unit: &'a Unit) -> Self {
        let noise = bend.noise.as_ref().filter(|noise| noise.amplitude.value.abs() > 0.0);
        let mut roots = [[[0.0; LANES]; 3]; 2];
        if let Some(noise) = noise {
            let at = curves.at(0);
            let last = group.starts.len() - 2;
            let mut own = [[0.0; 3]; LANES];
            for lane in 0..LANES {
                own[lane] = match noise.roots {
                    Some(roots) => roots[group.first + lane.min(last)],
                    None => group.points[at[lane]],
                };
            }
            place_roots(&own, &noise.origin, &mut roots[0]);
            if let Some((origin, _)) = &noise.other {
                place_roots(&own, origin, &mut roots[1]);
            }
        }
        Self { wind: bend.wind, noise, gusts: bend.gusts, roots, unit: &unit.from }
    }

    /// Whether it varies along a curve.
    #[inline(always)]
    pub(super) fn varies(&self) -> bool {
        let noise = self.noise.is_some_and(|noise| noise.waviness.value != 0.0 || noise.amplitude.mask.is_some());
        noise || self.gusts.is_some()
    }

    /// The direction at CVs at these arc lengths from their roots, with the indices `at`; of length 1…4.
    #[inline(always)]
    pub(super) fn at(&self, arc: &F32x16, at: &[usize; LANES]) -> Lanes<3> {
        let mut towards = self.wind.map(F32x16::splat);
        if self.noise.is_none() && self.gusts.is_none() {
            return towards;
        }
        if let Some(noise) = self.noise {
            let field = self.field(noise, arc, at);
            let amplitudes = amplitudes(noise, at);
            for lane in 0..LANES {
                let gust = vector::scale(get(&field, lane), amplitudes.0[lane]);
                let sum = vector::add(get(&towards, lane), gust);
                set(&mut towards, lane, sum);
            }
        }
        if let Some(gusts) = self.gusts {
            for lane in 0..LANES {
                let gust = gusts[at[lane]];
                for axis in 0..3 {
                    let gust = if gust[axis].is_nan() { 0.0 } else { gust[axis].clamp(-LARGEST, LARGEST) };
                    towards[axis].0[lane] += gust;
                }
            }
        }
        for lane in 0..LANES {
            let sum = get(&towards, lane);
            let unit = vector::power_of_two_to_one(vector::largest(sum)).0;
            set(&mut towards, lane, vector::scale(sum, unit));
        }
        towards
    }

    /// The value of the noise at CVs.
    #[inline(always)]
    fn field(&self, noise: &BendNoise<'_>, arc: &F32x16, at: &[usize; LANES]) -> Lanes<3> {
        let downwind = self.downwind(noise, arc, at);
        let (parts, weights) = match noise.other {
            Some((_, share)) => {
                let whole = ((1.0 - share) * (1.0 - share) + share * share).sqrt();
                (2, [(1.0 - share) / whole, share / whole])
            }
            None => (1, [1.0, 0.0]),
        };
        let mut field = [F32x16::splat(0.0); 3];
        for part in 0..parts {
            let mut points = [[0.0; LANES]; 3];
            for axis in 0..3 {
                for lane in 0..LANES {
                    points[axis][lane] = (self.roots[part][axis][lane] + downwind[axis][lane]) * noise.frequency;
                }
            }
            let own = noise.field.at_lanes(&points);
            if parts == 1 {
                return own;
            }
            for axis in 0..3 {
                for lane in 0..LANES {
                    let weighted = weights[part] * own[axis].0[lane];
                    // The first is not added to 0, which would lose the sign of its zeros.
                    field[axis].0[lane] = if part == 0 { weighted } else { field[axis].0[lane] + weighted };
                }
            }
        }
        field
    }

    /// By how much CVs sample the noise downwind of their roots, in metres along each axis.
    #[inline(always)]
    fn downwind(&self, noise: &BendNoise<'_>, arc: &F32x16, at: &[usize; LANES]) -> [[f64; LANES]; 3] {
        let mut lengths = [0.0; LANES];
        for lane in 0..LANES {
            lengths[lane] = f64::from(arc.0[lane]) * f64::from(self.unit.0[lane]);
        }
        let mut displacements = [[0.0; LANES]; 3];
        if noise.waviness.mask.is_none() {
            // Products that are the same on all lanes.
            for axis in 0..3 {
                let along = f64::from(self.wind[axis]) * f64::from(noise.waviness.value);
                for lane in 0..LANES {
                    displacements[axis][lane] = lengths[lane] * along;
                }
            }
            return displacements;
        }
        let waves = gather(noise.waviness.mask, at);
        for axis in 0..3 {
            for lane in 0..LANES {
                let along = f64::from(self.wind[axis]) * f64::from(noise.waviness.value * waves.0[lane]);
                displacements[axis][lane] = lengths[lane] * along;
            }
        }
        displacements
    }
}

/// Where roots sample the noise.
#[inline(always)]
fn place_roots(roots: &[Vec3; LANES], origin: &[f64; 3], placed: &mut [[f64; LANES]; 3]) {
    for axis in 0..3 {
        for lane in 0..LANES {
            placed[axis][lane] = f64::from(roots[lane][axis]) + origin[axis];
        }
    }
}

/// The noise's amplitude at CVs.
#[inline(always)]
fn amplitudes(noise: &BendNoise<'_>, at: &[usize; LANES]) -> F32x16 {
    let Some(mask) = noise.amplitude.mask else { return F32x16::splat(amplitude(noise.amplitude.value)) };
    let mut amplitudes = F32x16::splat(0.0);
    for lane in 0..LANES {
        amplitudes.0[lane] = amplitude(noise.amplitude.value * mask[at[lane]]);
    }
    amplitudes
}

/// A product as an amplitude; infinity times 0 is NaN and counts as 0.
#[inline(always)]
fn amplitude(product: f32) -> f32 {
    let amplitude = product.clamp(-LARGEST, LARGEST);
    if amplitude.is_nan() { 0.0 } else { amplitude }
}
