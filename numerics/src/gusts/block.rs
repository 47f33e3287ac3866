//! A block of points, sixteen at a time: the influence of each region near by, summed in order.

use super::control::{Control, Local};
use super::{LUMPS, Scene, Sphere};
use crate::lanes::{F32x16, LANES, Lanes, get, set};
use crate::noise::Field;
use crate::simd::kernel;
use crate::vec3::{self, Vec3};

/// The least share of a radius that noise leaves: a boundary at the centre itself has no inside.
const LEAST_LEFT: f32 = 1e-3;

/// The regions near a block, as seen from one of its points.
#[derive(Default)]
pub(super) struct Near {
    /// The point that all is relative to.
    origin: Vec3,
    spheres: Vec<Ball>,
    controls: Vec<(usize, Local)>,
}

/// A sphere near by.
struct Ball {
    centre: Vec3,
    /// One over the radius.
    inverse: f32,
    strength: f32,
    noise: f32,
    offset: [f64; 3],
}

impl Near {
    /// The `regions` of a scene, seen from `origin`.
    pub(super) fn gather(&mut self, scene: &Scene<'_>, regions: Vec<u32>, origin: Vec3) {
        self.origin = origin;
        self.spheres.clear();
        self.controls.clear();
        for region in regions {
            match scene.gusts.spheres.get(region as usize) {
                Some(sphere) => self.spheres.push(Ball::of(sphere, origin)),
                None => {
                    let place = region as usize - scene.gusts.spheres.len();
                    self.controls.push((place, scene.gusts.controls[place].local(origin)));
                }
            }
        }
    }
}

impl Ball {
    fn of(sphere: &Sphere, origin: Vec3) -> Self {
        Self {
            centre: std::array::from_fn(|axis| (sphere.centre[axis] - f64::from(origin[axis])) as f32),
            inverse: 1.0 / sphere.radius,
            strength: sphere.strength,
            noise: sphere.noise,
            offset: sphere.offset,
        }
    }
}

kernel! {
    /// Writes what `points` get to `out`, as many; gives how many of them something reaches.
    pub(super) fn block_values(scene: &Scene<'_>, near: &Near, points: &[Vec3], out: &mut [f32]) -> usize = body;
}

#[inline(always)]
fn body(scene: &Scene<'_>, near: &Near, points: &[Vec3], out: &mut [f32]) -> usize {
    let base = scene.gusts.base;
    if near.spheres.is_empty() && near.controls.is_empty() {
        out.fill(clamped(base));
        return 0;
    }
    let mut reached = 0;
    for (points, out) in points.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let mut at = [F32x16::splat(0.0); 3];
        for lane in 0..LANES {
            set(&mut at, lane, vec3::sub(points[lane.min(points.len() - 1)], near.origin));
        }
        let mut sum = Sum { value: F32x16::splat(base), reached: [0; LANES] };
        for ball in &near.spheres {
            let Some(share) = ball.share(&at, scene.field) else { continue };
            sum.add(&share, &scene.gusts.falloff.eval_lanes(&share), ball.strength);
            if scene.only_adds && sum.is_full() {
                break;
            }
        }
        for (place, local) in &near.controls {
            let control: &Control = &scene.gusts.controls[*place];
            let share = local.share(&at);
            sum.add(&share, &control.ramp().eval_lanes(&share), control.strength());
        }
        for (lane, out) in out.iter_mut().enumerate() {
            *out = clamped(sum.value.0[lane]);
            reached += sum.reached[lane] as usize;
        }
    }
    reached
}

/// Within 0..1; 0 where opposite infinities met.
#[inline(always)]
fn clamped(value: f32) -> f32 {
    let value = if value > 0.0 { value } else { 0.0 };
    if value < 1.0 { value } else { 1.0 }
}

/// What sixteen points have so far.
struct Sum {
    value: F32x16,
    /// 1 where something was added.
    reached: [u32; LANES],
}

impl Sum {
    /// Adds `influence` × `strength` where `share` lies within the boundary.
    #[inline(always)]
    fn add(&mut self, share: &F32x16, influence: &F32x16, strength: f32) {
        for lane in 0..LANES {
            let inside = share.0[lane] < 1.0;
            let influence = if inside { influence.0[lane] * strength } else { 0.0 };
            self.value.0[lane] += influence;
            self.reached[lane] |= u32::from(influence != 0.0);
        }
    }

    /// Whether all have 1 or more.
    #[inline(always)]
    fn is_full(&self) -> bool {
        let mut short = 0;
        for lane in 0..LANES {
            short |= u32::from(self.value.0[lane] < 1.0);
        }
        short == 0
    }
}

impl Ball {
    /// How far points are from the centre (0) to the boundary (1); `None` where all are outside.
    #[inline(always)]
    fn share(&self, at: &Lanes<3>, field: &Field) -> Option<F32x16> {
        let mut away = [F32x16::splat(0.0); 3];
        let mut square = F32x16::splat(0.0);
        for lane in 0..LANES {
            let d = vec3::scale(vec3::sub(get(at, lane), self.centre), self.inverse);
            set(&mut away, lane, d);
            square.0[lane] = vec3::dot(d, d);
        }
        let mut inside = 0;
        for lane in 0..LANES {
            inside |= u32::from(square.0[lane] < 1.0);
        }
        if inside == 0 {
            return None;
        }
        let mut share = square;
        for lane in 0..LANES {
            share.0[lane] = square.0[lane].sqrt();
        }
        if self.noise > 0.0 {
            self.dent(&away, &mut share, field);
        }
        Some(share)
    }

    /// Moves the boundary inwards by noise: from a share of the radius to one of what noise leaves of
    /// it in that direction. The noise depends on the direction alone, so each ray from the centre
    /// falls off once, and the centre stays the centre.
    #[inline(always)]
    fn dent(&self, away: &Lanes<3>, share: &mut F32x16, field: &Field) {
        let mut cells = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let length = share.0[lane];
            let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
            // Far outside, squares overflow; any direction will do.
            let inverse = if length < 1.0 { inverse } else { 0.0 };
            let direction = vec3::scale(get(away, lane), inverse);
            for axis in 0..3 {
                let direction = if length < 1.0 { direction[axis] } else { 0.0 };
                cells[axis][lane] = self.offset[axis] + f64::from(direction) * LUMPS;
            }
        }
        let noise = &field.at_lanes(&cells)[0];
        for lane in 0..LANES {
            let taken = clamped(0.5 + noise.0[lane]);
            let left = 1.0 - self.noise * taken;
            let left = if left > LEAST_LEFT { left } else { LEAST_LEFT };
            share.0[lane] /= left;
        }
    }
}
