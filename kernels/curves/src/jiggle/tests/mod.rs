//! Shared by the jiggle's tests: a spring to start from, targets, curves.

mod curves;
mod oscillator;
mod skin;

use super::*;
use numerics::ramp::Interpolation;
use numerics::random::Key;

fn soft() -> Ramp {
    Ramp::constant(1.0)
}

fn rising() -> Ramp {
    Ramp::new(vec![[0.0, 0.0], [1.0, 1.0]], Interpolation::Linear).unwrap()
}

/// ω·dt = `phase` in steps of a second.
fn spring(phase: f64, damping: f64, softness: &Ramp, drag: Drag) -> Spring<'_> {
    Spring { frequency: (phase / (2.0 * PI)).into(), damping: damping.into(), softness, drag }
}

/// Two CVs; the second is free where softness is 1.
const ONE: [u32; 2] = [0, 2];

/// A curve of two CVs whose second is at `x` along x.
fn at(x: f32) -> [Vec3; 2] {
    [[0.0, 0.0, 0.0], [x, 1.0, 0.0]]
}

/// Position along x of the second CV, before lengths are restored.
fn free(jiggle: &Jiggle) -> f64 {
    let state = &jiggle.batches[0].states[1];
    f64::from(state.target[0].0[0]) + state.offset[0].0[0]
}

/// Curves of 1…`most` CVs, up to 3 m from the origin, that wobble with time.
fn wobbling(curves: u64, most: u64, time: f32) -> (Vec<u32>, Vec<Vec3>) {
    let mut starts = vec![0];
    let mut points = Vec::new();
    for curve in 0..curves {
        let key = Key::new(5).of(curve);
        let root: Vec3 = std::array::from_fn(|k| key.of(k as u64).between([-3.0, 3.0]));
        let cvs = key.of(9).u64() % (most + 1);
        for cv in 0..cvs {
            let bend = numerics::trig::sin_cos(time * 0.7 + cv as f32 * 0.3 + root[0]).0;
            points.push([root[0] + 0.05 * cv as f32 * bend, root[1] + 0.1 * cv as f32, root[2] + 0.02 * bend]);
        }
        starts.push(points.len() as u32);
    }
    (starts, points)
}

fn bits(points: &[Vec3]) -> Vec<[u32; 3]> {
    points.iter().map(|point| point.map(f32::to_bits)).collect()
}
