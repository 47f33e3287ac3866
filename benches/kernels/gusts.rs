//! Times of evaluating gusts: the minimum of interleaved runs, one line for each case and SIMD path.
//!
//! `cargo bench --bench gusts`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use curves::gusts::{Control, ControlShape, Draw, GustMasks, Gusts, Plane, Sphere, evaluate_on};
use numerics::ramp::{Interpolation, Ramp};
use numerics::simd::Path;
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 100;

/// Hairs of `cvs` CVs in rows over a 2 m square, 0.1 m long.
fn groom(rows: usize, cvs: usize) -> Vec<[f32; 3]> {
    let step = 2.0 / rows as f32;
    let cv =
        move |i: usize, k: usize| [(i % rows) as f32 * step, 0.1 * k as f32 / cvs as f32, (i / rows) as f32 * step];
    (0..rows * rows).flat_map(|i| (0..cvs).map(move |k| cv(i, k))).collect()
}

/// Gusts passing over the groom, some of them already past it.
fn spheres(count: u32, radius: [f32; 2], noise: [f32; 2]) -> Vec<Sphere> {
    let draw = Draw {
        seed: 7,
        gusts: count,
        radius,
        noise,
        start: [0.0, 48.0],
        life: [96.0; 2],
        decay: [0.0; 2],
        repeat: 0.0,
        period: 0,
    };
    let plane = Plane::new([[0.0; 3], [2.0, 0.1, 2.0]], [1.0, 0.0, 0.0], 0.5, [0.0; 2]);
    let sphere = |gust: &curves::gusts::Gust| {
        let [x, y, z] = plane.at(gust.position);
        let travelled = (48.0 - gust.start) / 24.0 * (0.5 + gust.speed);
        Sphere {
            centre: [x + travelled, y, z],
            radius: gust.radius,
            strength: gust.strength,
            noise: gust.noise,
            salt: gust.salt,
        }
    };
    draw.at(48.0).gusts.iter().map(sphere).collect()
}

fn main() {
    let falloff = Ramp::new(vec![[0.0, 1.0], [1.0, 0.0]], Interpolation::Smooth).expect("the keys are in order");
    let axes = [[0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]];
    let control = |shape| Control::new(shape, [1.0, 0.0, 1.0], axes, 2.0, falloff.clone(), -0.5);
    let (small, large) = (groom(100, 5), groom(1000, 5));
    let both = [control(ControlShape::Sphere), control(ControlShape::Cubes)];
    let cases = [
        ("10,000 × 5, no gusts", &small, Vec::new(), &[][..]),
        ("10,000 × 5, 20 gusts, round", &small, spheres(20, [0.3, 0.6], [0.0; 2]), &[]),
        ("10,000 × 5, 20 gusts, noise", &small, spheres(20, [0.3, 0.6], [0.0, 0.3]), &[]),
        ("10,000 × 5, 20 gusts, 2 controls", &small, spheres(20, [0.3, 0.6], [0.0, 0.3]), &both),
        ("10,000 × 5, 10,000 small gusts", &small, spheres(10_000, [0.01, 0.02], [0.0, 0.3]), &[]),
        ("10,000 × 5, 10,000 over each other", &small, spheres(10_000, [3.0, 6.0], [0.0, 0.3]), &[]),
        ("1,000,000 × 5, 20 gusts, noise", &large, spheres(20, [0.3, 0.6], [0.0, 0.3]), &[]),
    ];
    for (name, points, spheres, controls) in &cases {
        let gusts = Gusts { base: 0.0, falloff: &falloff, spheres, controls, incoming: None, masks: GustMasks::NONE };
        let paths = Path::all();
        let mut best = vec![f64::INFINITY; paths.len()];
        let rounds = if points.len() > 1_000_000 { ROUNDS / 10 } else { ROUNDS };
        for _ in 0..rounds {
            for (path, best) in paths.iter().zip(&mut best) {
                let start = Instant::now();
                let felt = black_box(evaluate_on(*path, points, &gusts));
                *best = best.min(start.elapsed().as_secs_f64());
                assert_eq!(felt.values.len(), points.len());
            }
        }
        let reached = evaluate_on(Path::BASELINE, points, &gusts).reached;
        print!("{name:36}{:>8.1} % reached", 100.0 * reached as f64 / points.len() as f64);
        for (path, best) in paths.iter().zip(best) {
            print!("{:>9} {:8.3} ms", path.name(), best * 1e3);
        }
        println!();
    }
}
