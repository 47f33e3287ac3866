//! Times of bending curves: the minimum of interleaved runs, one line for each case and SIMD path.
//!
//! `cargo bench --bench wind_bend`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use curves::wind_bend::{Bend, BendMode, BendNoise, bend_on};
use numerics::noise::{Field, NoiseKind};
use numerics::ramp::{Interpolation, Ramp};
use numerics::random::Key;
use numerics::simd::Path;
use std::time::Instant;

const ROUNDS: usize = 30;

/// Curves of `cvs` CVs over a 2 m square, 0.1 m long and slightly bent.
fn groom(curves: u32, cvs: u32) -> (Vec<u32>, Vec<[f32; 3]>) {
    let point = |curve: u32, cv: u32| {
        let key = Key::new(1).of(u64::from(curve));
        let u = cv as f32 / (cvs - 1) as f32;
        let [x, z] = [key.of(0).f32() * 2.0, key.of(1).f32() * 2.0];
        [x + 0.02 * u * u, 0.1 * u, z + 0.01 * u]
    };
    let starts = (0..=curves).map(|curve| curve * cvs).collect();
    (starts, (0..curves).flat_map(|curve| (0..cvs).map(move |cv| point(curve, cv))).collect())
}

fn main() {
    let ramp = Ramp::new(vec![[0.0, 0.2], [1.0, 1.0]], Interpolation::Linear).expect("the keys are in order");
    let fields = [NoiseKind::Perlin, NoiseKind::Billow, NoiseKind::Wavelet].map(|kind| Field::new(kind, 2, 0.5, 7));
    let noise = |kind: usize, waviness: f32| {
        Some(BendNoise {
            field: &fields[kind],
            amplitude: 0.5.into(),
            frequency: 2.0,
            waviness: waviness.into(),
            origin: [0.3, 0.0, 0.0],
            other: None,
            roots: None,
        })
    };
    let paper = BendMode::Paper;
    let free = BendMode::ResolutionFree { reference_segments: 4.0 };
    let small = groom(10_275, 5);
    let long = groom(10_275, 32);
    let large = groom(1_000_000, 5);
    let cases = [
        ("10,275 × 5, no noise", &small, None, paper),
        ("10,275 × 5, perlin 2 octaves", &small, noise(0, 0.0), paper),
        ("10,275 × 5, perlin, waviness 1", &small, noise(0, 1.0), paper),
        ("10,275 × 5, perlin, resolution free", &small, noise(0, 0.0), free),
        ("10,275 × 5, billow, waviness 1", &small, noise(1, 1.0), paper),
        ("10,275 × 5, wavelet, waviness 1", &small, noise(2, 1.0), paper),
        ("10,275 × 32, perlin, waviness 1", &long, noise(0, 1.0), paper),
        ("1,000,000 × 5, perlin, waviness 1", &large, noise(0, 1.0), paper),
    ];
    for (name, (starts, points), noise, mode) in &cases {
        let bend = Bend {
            wind: [1.0, 0.0, 0.0],
            rotate: 0.5.into(),
            envelope: None,
            ramp: &ramp,
            mode: *mode,
            blend: 1.0.into(),
            noise: noise.clone(),
            gusts: None,
        };
        let paths = Path::all();
        let mut best = vec![f64::INFINITY; paths.len()];
        let rounds = if points.len() > 1_000_000 { ROUNDS / 5 } else { ROUNDS };
        for _ in 0..rounds {
            for (path, best) in paths.iter().zip(&mut best) {
                let start = Instant::now();
                let bent = bend_on(*path, starts, points, &bend);
                *best = best.min(start.elapsed().as_secs_f64());
                assert!(bent.length_error < 1e-5);
            }
        }
        print!("{name:38}");
        for (path, best) in paths.iter().zip(best) {
            print!("{:>9} {:8.3} ms", path.name(), best * 1e3);
        }
        println!();
    }
}
