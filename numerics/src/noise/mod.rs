//! Noise fields: three decorrelated smooth random components at every point of space.
//!
//! Octaves of gradient noise, billow or wavelet noise; each of mean 0. The sum of octaves is divided by the root of the sum
//! of its squared weights, so its rms (0.27) does not depend on their number. Coordinates are f64, counted in cells of the first octave. Octave n has 2ⁿ
//! cells a cell and no offset: gradient noise of any number of octaves is 0 on the first's lattice.
//! The same bits one point or sixteen at a time.

mod lattice;
mod perlin;
mod wavelet;

use crate::lanes::{F32x16, LANES, Lanes, get, set};
use crate::random::Key;
use lattice::{Point, Points};

/// The kind of noise of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseKind {
    /// Gradient noise: 0 on the lattice, C².
    Perlin,
    /// The absolute value of gradient noise, less its mean: rounded lumps with creases between them.
    Billow,
    /// Wavelet noise: each octave is band-limited; C¹.
    Wavelet,
}

/// Most octaves of a field.
pub const MAX_OCTAVES: usize = 16;

/// A noise field: kind, octaves, seed.
#[derive(Clone, Debug)]
pub struct Field {
    kind: NoiseKind,
    octaves: Vec<Octave>,
}

#[derive(Clone, Copy, Debug)]
struct Octave {
    salt: u32,
    /// Cells a cell of the first octave.
    scale: f64,
    weight: f32,
}

/// Billow's mean before recentring: E|gradient noise|.
const BILLOW_MEAN: f32 = 0.22;

/// Brings billow's rms to 0.27 as well.
const BILLOW_SCALE: f32 = 1.725;

impl Field {
    /// A field of 1…16 `octaves` (clamped), each `roughness` times the previous one (clamped to 0..1, NaN counts as 0).
    pub fn new(kind: NoiseKind, octaves: u32, roughness: f32, seed: u64) -> Self {
        let roughness = f64::from(if roughness > 0.0 { roughness.min(1.0) } else { 0.0 });
        let wanted = (octaves as usize).clamp(1, MAX_OCTAVES);
        let weights: Vec<f64> = std::iter::successors(Some(1.0), |weight| Some(weight * roughness))
            .take(wanted)
            .take_while(|weight| *weight > 0.0)
            .collect();
        let norm = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
        let octave = |(n, weight): (usize, &f64)| Octave {
            salt: Key::new(seed).of(n as u64).u32(),
            scale: (1u64 << n) as f64,
            weight: (weight / norm) as f32,
        };
        Self { kind, octaves: weights.iter().enumerate().map(octave).collect() }
    }

    /// The three components at `point`, counted in cells of the first octave. Finite for any point.
    pub fn at(&self, point: [f64; 3]) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for octave in &self.octaves {
            let point = Point::at(point.map(|x| x * octave.scale));
            octave.add(octave.noise(self.kind, point), &mut sum);
        }
        sum
    }

    /// [`Field::at`] on every lane; an axis an array.
    #[inline(always)]
    pub fn at_lanes(&self, points: &[[f64; LANES]; 3]) -> Lanes<3> {
        let mut sum = [F32x16::splat(0.0); 3];
        for octave in &self.octaves {
            let points = Points::at(points, octave.scale);
            // One loop for each kind: a branch inside a loop would prevent its vectorisation.
            match self.kind {
                NoiseKind::Perlin => octave.add_lanes(NoiseKind::Perlin, &points, &mut sum),
                NoiseKind::Billow => octave.add_lanes(NoiseKind::Billow, &points, &mut sum),
                NoiseKind::Wavelet => octave.add_lanes(NoiseKind::Wavelet, &points, &mut sum),
            }
        }
        sum
    }
}

impl Octave {
    #[inline(always)]
    fn noise(&self, kind: NoiseKind, point: Point) -> [f32; 3] {
        match kind {
            NoiseKind::Perlin => perlin::noise(point, self.salt),
            NoiseKind::Billow => {
                perlin::noise(point, self.salt).map(|value| BILLOW_SCALE * (value.abs() - BILLOW_MEAN))
            }
            NoiseKind::Wavelet => wavelet::noise(point, self.salt),
        }
    }

    #[inline(always)]
    fn add(&self, noise: [f32; 3], sum: &mut [f32; 3]) {
        for axis in 0..3 {
            sum[axis] += self.weight * noise[axis];
        }
    }

    #[inline(always)]
    fn add_lanes(&self, kind: NoiseKind, points: &Points, sum: &mut Lanes<3>) {
        for lane in 0..LANES {
            let mut value = get(sum, lane);
            self.add(self.noise(kind, points.lane(lane)), &mut value);
            set(sum, lane, value);
        }
    }
}

/// One octave of scalar gradient noise, −1.04..1.04, at `point` counted in cells; 0 on the lattice.
/// The `noise` of expressions.
pub fn noise3(seed: u32, point: [f64; 3]) -> f32 {
    perlin::noise(Point::at(point), Key::new(u64::from(seed)).u32())[0]
}

/// One octave of scalar gradient noise on sixteen points, counted in cells, within ±2²² of them: that
/// of [`noise3`] but for the rounding of f32.
#[inline(always)]
pub fn bumps(salt: u32, points: &Lanes<3>) -> F32x16 {
    let mut out = F32x16::splat(0.0);
    for lane in 0..LANES {
        out.0[lane] = perlin::noise(Point::near(get(points, lane)), salt)[0];
    }
    out
}

#[cfg(test)]
mod tests;
