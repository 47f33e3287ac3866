//! The direction of the wind at each pivot: its own direction plus noise.

use super::curve_group::{CurveGroup, Curves, Unit};
use super::share::gather;
use super::{Bend, BendNoise};
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::vector;

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
            let other = match noise.other {
                Some((origin, _)) => origin,
                None => noise.origin,
            };
            for lane in 0..LANES {
                let root = match noise.roots {
                    Some(roots) => roots[group.first + lane.min(last)],
                    None => group.points[at[lane]],
                };
                for axis in 0..3 {
                    roots[0][axis][lane] = f64::from(root[axis]) + noise.origin[axis];
                    roots[1][axis][lane] = f64::from(root[axis]) + other[axis];
                }
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
            let factors = gather(noise.amplitude.mask, at);
            for lane in 0..LANES {
                let amplitude = (noise.amplitude.value * factors.0[lane]).clamp(-LARGEST, LARGEST);
                // Infinity times 0 is NaN and counts as 0.
                let amplitude = if amplitude.is_nan() { 0.0 } else { amplitude };
                let gust = vector::scale(get(&field, lane), amplitude);
                let sum = vector::add(get(&towards, lane), gust);
                set(&mut towards, lane, sum);
            }
        }
        for lane in 0..LANES {
            let mut sum = get(&towards, lane);
            if let Some(gusts) = self.gusts {
                for axis in 0..3 {
                    let gust = gusts[at[lane]][axis];
                    sum[axis] += if gust.is_nan() { 0.0 } else { gust.clamp(-LARGEST, LARGEST) };
                }
            }
            let unit = vector::power_of_two_to_one(vector::largest(sum)).0;
            set(&mut towards, lane, vector::scale(sum, unit));
        }
        towards
    }

    /// The value of the noise at CVs.
    #[inline(always)]
    fn field(&self, noise: &BendNoise<'_>, arc: &F32x16, at: &[usize; LANES]) -> Lanes<3> {
        let waves = gather(noise.waviness.mask, at);
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
                    let along = f64::from(self.wind[axis]) * f64::from(noise.waviness.value * waves.0[lane]);
                    let displacement = f64::from(arc.0[lane]) * f64::from(self.unit.0[lane]) * along;
                    points[axis][lane] = (self.roots[part][axis][lane] + displacement) * noise.frequency;
                }
            }
            let own = noise.field.at_lanes(&points);
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
}
