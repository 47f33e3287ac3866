//! Shared by the tests of gusts: points, plain gusts to start from, and an f64 reference.

mod controls;
mod extremes;
mod living;
mod spheres;

use super::*;
use numerics::ramp::Interpolation;
use numerics::random::Key;
use numerics::vector;

/// The default: smooth from 1 to 0.
fn smooth() -> Ramp {
    Ramp::new(vec![[0.0, 1.0], [1.0, 0.0]], Interpolation::Smooth).unwrap()
}

fn one() -> Ramp {
    Ramp::constant(1.0)
}

fn sphere(centre: [f64; 3], radius: f32) -> Sphere {
    Sphere { centre, radius, strength: 1.0, noise: 0.0, salt: 77 }
}

fn only<'a>(falloff: &'a Ramp, spheres: &'a [Sphere]) -> Gusts<'a> {
    Gusts { base: 0.0, falloff, spheres, controls: &[], incoming: None, masks: GustMasks::NONE }
}

/// Random points in a cube of this half size about a centre.
fn strewn(count: u64, centre: [f32; 3], half: f32) -> Vec<[f32; 3]> {
    let point =
        |k: u64| [0, 1, 2].map(|axis| centre[axis as usize] + Key::new(3).of(k).of(axis).between([-half, half]));
    (0..count).map(point).collect()
}

/// Hairs of five CVs over a square of 2 m, in rows, so that neighbours in the list are neighbours.
fn hairs(rows: usize) -> Vec<[f32; 3]> {
    let step = 2.0 / rows as f32;
    let cv = move |i: usize, k: usize| [(i % rows) as f32 * step, 0.02 * k as f32, (i / rows) as f32 * step];
    (0..rows * rows).flat_map(|i| (0..5).map(move |k| cv(i, k))).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}
