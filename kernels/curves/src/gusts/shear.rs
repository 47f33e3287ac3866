//! The direction that gusts add to the wind: each blows to its own side.

use super::block::{Ball, ROWS, load, scale_of, scales};
use super::cull::{Bounds, Boxes, bounds_of};
use super::{BLOCK, Gusts, Prepared, TASK};
use numerics::lanes::{F32x16, LANES};
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::vector::Vec3;

/// Σ influence · `sides` over the spheres, at each point: what gusts add to a wind of length 1. Controls add nothing, and
/// the sum is not clamped. The masks of strength apply.
///
/// # Panics
/// If there are fewer sides than spheres, or the mask is shorter than `points`.
pub fn sideways(points: &[Vec3], gusts: &Gusts<'_>, sides: &[Vec3]) -> Vec<Vec3> {
    sideways_on(Path::chosen(), points, gusts, sides)
}

/// [`sideways()`] on a given SIMD path.
///
/// # Panics
/// As [`sideways()`].
pub fn sideways_on(path: Path, points: &[Vec3], gusts: &Gusts<'_>, sides: &[Vec3]) -> Vec<Vec3> {
    let gusts = Gusts { controls: &[], ..gusts.clone() };
    let prepared = Prepared::new(&gusts);
    let mut out = vec![[0.0; 3]; points.len()];
    let tasks = out.chunks_mut(TASK).zip(points.chunks(TASK));
    parallel::for_each(tasks, |task, (out, points)| {
        let near = prepared.near(path, points);
        if near.len() == 0 {
            return;
        }
        for (block, (points, out)) in points.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).enumerate() {
            let factors = gusts.masks.from(task * TASK + block * BLOCK).strength;
            block_sideways(path, &prepared, (&near, &bounds_of(path, points)), points, factors, sides, out);
        }
    });
    out
}

kernel! {
    fn block_sideways(
        prepared: &Prepared<'_>,
        near: (&Boxes, &Bounds),
        points: &[Vec3],
        factors: Option<&[f32]>,
        sides: &[Vec3],
        out: &mut [Vec3],
    ) -> () = body;
}

#[inline(always)]
fn body(
    prepared: &Prepared<'_>,
    (near, bounds): (&Boxes, &Bounds),
    points: &[Vec3],
    factors: Option<&[f32]>,
    sides: &[Vec3],
    out: &mut [Vec3],
) {
    let mut at = [[F32x16::splat(0.0); 3]; ROWS];
    load(points, points[0], &mut at);
    let scales = scales(factors, points.len());
    for first in (0..near.len()).step_by(LANES) {
        let met = near.meet(first, bounds);
        for lane in (0..LANES).filter(|lane| met[*lane] != 0) {
            let sphere = near.region(first + lane);
            let ball = Ball::of(&prepared.gusts.spheres[sphere], points[0]);
            for row in 0..points.len().div_ceil(LANES) {
                let Some(share) = ball.share(&at[row]) else { continue };
                let influence = prepared.falloff.eval(&share);
                let scale = scale_of(scales.as_ref(), row);
                for (lane, out) in out[row * LANES..].iter_mut().take(LANES).enumerate() {
                    let factor = match scale {
                        Some(scale) => scale.0[lane],
                        None => 1.0,
                    };
                    let influence = influence.0[lane] * ball.strength * factor;
                    let influence = if share.0[lane] < 1.0 { influence } else { 0.0 };
                    for axis in 0..3 {
                        out[axis] += influence * sides[sphere][axis];
                    }
                }
            }
        }
    }
}
