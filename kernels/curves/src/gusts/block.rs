//! A block of points, sixteen at a time: the influences of all nearby regions, summed in order.

use super::cull::{Bounds, Boxes};
use super::{BLOCK, LUMPS, Prepared, Sphere, at_least_0};
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::noise;
use numerics::simd::kernel;
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};

/// The smallest fraction of a radius that noise leaves: with the boundary at the centre nothing would be inside.
const LEAST_LEFT: f32 = 1e-3;

/// Position of a sphere's centre on the noise lattice: no lattice point coincides with the ends of its axes.
const OFF_LATTICE: Vec3 = [0.37, 0.61, 0.13];

/// Groups of sixteen points in a block.
pub(super) const ROWS: usize = BLOCK / LANES;

kernel! { avx512
    /// Adds the influences of the regions of `near`, which may reach up to [`BLOCK`] points within `bounds`, times
    /// `factors` to `out`; returns how many points any influence reaches.
    pub(super) fn block_values(
        prepared: &Prepared<'_>,
        near: &Boxes,
        bounds: &Bounds,
        points: &[Vec3],
        factors: Option<&[f32]>,
        out: &mut [f32],
    ) -> usize = body;
}

#[inline(always)]
fn body(
    prepared: &Prepared<'_>,
    near: &Boxes,
    bounds: &Bounds,
    points: &[Vec3],
    factors: Option<&[f32]>,
    out: &mut [f32],
) -> usize {
    let spheres = prepared.gusts.spheres;
    let rows = points.len().div_ceil(LANES);
    let origin = points[0];
    let mut at = [[F32x16::splat(0.0); 3]; ROWS];
    let mut sums = [Sum { value: F32x16::splat(0.0), reached: [0; LANES] }; ROWS];
    let scales = scales(factors, points.len());
    let mut loaded = false;
    for first in (0..near.len()).step_by(LANES) {
        let met = near.meet(first, bounds);
        if met == [0; LANES] {
            continue;
        }
        if !loaded {
            load(points, origin, &mut at);
            for (out, sum) in out.chunks(LANES).zip(&mut sums) {
                sum.start(out);
            }
            loaded = true;
        }
        for lane in (0..LANES).filter(|lane| met[*lane] != 0) {
            let region = near.region(first + lane);
            match spheres.get(region) {
                Some(sphere) => {
                    let ball = Ball::of(sphere, origin);
                    for row in 0..rows {
                        if let Some(share) = ball.share(&at[row]) {
                            sums[row].add(
                                &share,
                                &prepared.falloff.eval(&share),
                                ball.strength,
                                scale_of(scales.as_ref(), row),
                            );
                        }
                    }
                }
                None => {
                    let index = region - spheres.len();
                    let local = prepared.gusts.controls[index].local(origin);
                    for row in 0..rows {
                        let share = local.share(&at[row]);
                        let influence = prepared.ramps[index].eval(&share);
                        let strength = prepared.gusts.controls[index].strength();
                        sums[row].add(&share, &influence, strength, scale_of(scales.as_ref(), row));
                    }
                }
            }
        }
        if prepared.only_adds && sums[..rows].iter().all(Sum::is_full) {
            break;
        }
    }
    if !loaded {
        return 0;
    }
    let mut reached = 0;
    for (out, sum) in out.chunks_mut(LANES).zip(&sums) {
        for (lane, out) in out.iter_mut().enumerate() {
            *out = clamped(sum.value.0[lane]);
            reached += sum.reached[lane] as usize;
        }
    }
    reached
}

/// The points relative to `origin`; the last one is repeated to fill its row.
#[inline(always)]
pub(super) fn load(points: &[Vec3], origin: Vec3, at: &mut [Lanes<3>; ROWS]) {
    for (points, at) in points.chunks(LANES).zip(at) {
        for lane in 0..LANES {
            set(at, lane, vector::sub(points[lane.min(points.len() - 1)], origin));
        }
    }
}

#[inline(always)]
pub(super) fn scale_of(scales: Option<&[F32x16; ROWS]>, row: usize) -> Option<&F32x16> {
    match scales {
        Some(scales) => Some(&scales[row]),
        None => None,
    }
}

/// The factors of a block's points in rows.
#[inline(always)]
pub(super) fn scales(factors: Option<&[f32]>, points: usize) -> Option<[F32x16; ROWS]> {
    let factors = factors?;
    let mut rows = [F32x16::splat(0.0); ROWS];
    for row in 0..points.div_ceil(LANES) {
        for lane in 0..LANES {
            rows[row].0[lane] = at_least_0(factors[(row * LANES + lane).min(points - 1)]);
        }
    }
    Some(rows)
}

/// Clamped to 0..1; NaN, the sum of opposite infinities, gives 0.
#[inline(always)]
fn clamped(value: f32) -> f32 {
    let value = if value > 0.0 { value } else { 0.0 };
    if value < 1.0 { value } else { 1.0 }
}

/// Sums of sixteen points so far.
#[derive(Clone, Copy)]
struct Sum {
    value: F32x16,
    /// 1 if any influence was added.
    reached: [u32; LANES],
}

impl Sum {
    /// Starts with these values; lanes without a point repeat the last.
    #[inline(always)]
    fn start(&mut self, values: &[f32]) {
        if values.len() == LANES {
            self.value.0.copy_from_slice(values);
            return;
        }
        for lane in 0..LANES {
            self.value.0[lane] = values[lane.min(values.len() - 1)];
        }
    }

    /// Adds `influence` × `strength` × `scale` if `share` lies within the boundary.
    #[inline(always)]
    fn add(&mut self, share: &F32x16, influence: &F32x16, strength: f32, scale: Option<&F32x16>) {
        for lane in 0..LANES {
            let influence = influence.0[lane] * strength;
            let influence = if share.0[lane] < 1.0 { influence } else { 0.0 };
            let influence = match scale {
                Some(scale) => influence * scale.0[lane],
                None => influence,
            };
            self.value.0[lane] += influence;
            self.reached[lane] |= u32::from(influence != 0.0);
        }
    }

    /// Whether all are 1 or more.
    #[inline(always)]
    fn is_full(&self) -> bool {
        let mut short = 0;
        for lane in 0..LANES {
            short |= u32::from(self.value.0[lane] < 1.0);
        }
        short == 0
    }
}

/// A sphere relative to a nearby point.
pub(super) struct Ball {
    centre: Vec3,
    /// One over the radius.
    inverse: f32,
    pub(super) strength: f32,
    noise: f32,
    salt: u32,
}

impl Ball {
    #[inline(always)]
    pub(super) fn of(sphere: &Sphere, origin: Vec3) -> Self {
        Self {
            centre: to_f32(DVec3::from(sphere.centre) - to_f64(origin)),
            inverse: 1.0 / sphere.radius,
            strength: sphere.strength,
            noise: sphere.noise,
            salt: sphere.salt,
        }
    }

    /// Distances of points, from the centre (0) to the boundary (1); `None` if all are outside.
    #[inline(always)]
    pub(super) fn share(&self, at: &Lanes<3>) -> Option<F32x16> {
        let mut away = [F32x16::splat(0.0); 3];
        let mut share = F32x16::splat(0.0);
        let mut inside = 0;
        for lane in 0..LANES {
            let d = vector::scale(vector::sub(get(at, lane), self.centre), self.inverse);
            set(&mut away, lane, d);
            let square = vector::dot(d, d);
            inside |= u32::from(square < 1.0);
            share.0[lane] = square;
        }
        if inside == 0 {
            return None;
        }
        for lane in 0..LANES {
            share.0[lane] = share.0[lane].sqrt();
        }
        if self.noise > 0.0 {
            self.dent(&away, &mut share);
        }
        Some(share)
    }

    /// Moves the boundary inwards by noise: rescales fractions of the radius to fractions of the remaining radius in
    /// that direction. The noise depends on the direction only, so the falloff along each ray from the centre stays
    /// monotonic.
    #[inline(always)]
    fn dent(&self, away: &Lanes<3>, share: &mut F32x16) {
        let mut cells = *away;
        for lane in 0..LANES {
            let length = share.0[lane];
            // Points outside are not used; far outside, their direction would overflow.
            let inside = length > 0.0 && length < 1.0;
            let inverse = LUMPS / if inside { length } else { 1.0 };
            for axis in 0..3 {
                let cell = away[axis].0[lane] * inverse + OFF_LATTICE[axis];
                cells[axis].0[lane] = if inside { cell } else { 0.0 };
            }
        }
        let noise = noise::bumps(self.salt, &cells);
        for lane in 0..LANES {
            let taken = clamped(0.5 + noise.0[lane]);
            let left = 1.0 - self.noise * taken;
            let left = if left > LEAST_LEFT { left } else { LEAST_LEFT };
            share.0[lane] /= left;
        }
    }
}
