//! Times of shielding, including the trees of the colliders: the minimum of several runs, one line for each case and SIMD
//! path.
//!
//! `cargo bench --bench shield`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use curves::shield::{Collider, Shield, shield_on};
use numerics::random::Key;
use numerics::shapes::sphere;
use numerics::simd::Path;
use numerics::vector;
use std::time::Instant;

const ROUNDS: usize = 20;

fn main() {
    let mesh = sphere([2.0; 3], 36);
    let points: Vec<[f32; 3]> = mesh.points.iter().map(|point| point.map(|x| x as f32)).collect();
    let triangles = mesh.triangles();
    println!("{} triangles", triangles.len());
    for (curves, cvs, cone) in [(10_000, 5, 0.0), (10_000, 32, 0.0), (100_000, 5, 0.0), (10_000, 5, 0.1)] {
        // Hairs a tenth of the radius long, at random positions.
        let cv = |curve: u32, cv: u32| {
            let p = [0, 1, 2].map(|axis| Key::new(1).of(u64::from(curve)).of(axis).f32() - 0.5);
            vector::scale(p, (1.0 + 0.1 * cv as f32 / (cvs - 1) as f32) / vector::length(p))
        };
        let starts: Vec<u32> = (0..=curves).map(|curve| curve * cvs).collect();
        let groom: Vec<[f32; 3]> = (0..curves).flat_map(|curve| (0..cvs).map(move |k| cv(curve, k))).collect();
        let shield =
            Shield { wind: [1.0, 0.2, 0.3], offset: 10.0.into(), distance: 0.0, falloff: 1.0, cone, skin_gap: 0.0 };
        let colliders = [Collider::of(&points, &triangles)];
        print!("{curves:>7} × {cvs:>2}, cone {cone:<3} rad");
        for path in Path::all() {
            let mut best = f64::INFINITY;
            for _ in 0..ROUNDS {
                let start = Instant::now();
                let shares = shield_on(path, &starts, &groom, &colliders, &shield);
                best = best.min(start.elapsed().as_secs_f64());
                assert!(shares.contains(&1.0));
            }
            print!("{:>9} {:8.3} ms", path.name(), best * 1e3);
        }
        println!();
    }
}
