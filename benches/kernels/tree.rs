//! Times of building and refitting a triangle tree and of finding nearest points: the minimum of several runs, one line
//! for each mesh.
//!
//! `cargo bench --bench tree`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use numerics::random::Key;
use numerics::shapes::sphere;
use numerics::simd::Path;
use numerics::tree::TriangleTree;
use numerics::vector;
use std::time::Instant;

const ROUNDS: usize = 20;

/// Milliseconds of the fastest of many runs.
fn fastest(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    best
}

fn main() {
    for n in [36, 112] {
        let mesh = sphere([2.0; 3], n);
        let points: Vec<[f32; 3]> = mesh.points.iter().map(|point| point.map(|x| x as f32)).collect();
        let triangles = mesh.triangles();
        let mut tree = TriangleTree::default();
        let build = fastest(|| tree = TriangleTree::build(&points, &triangles));
        let refit = fastest(|| tree.refit(&points));
        println!("{} triangles: build {build:.3} ms, refit {refit:.3} ms", triangles.len());
        let near = |i: u64| {
            let p = [0, 1, 2].map(|axis| Key::new(1).of(i).of(axis).f32() - 0.5);
            vector::scale(p, 1.02 / vector::length(p))
        };
        let from: Vec<[f32; 3]> = (0..50_000).map(near).collect();
        for path in Path::all() {
            let closest = fastest(|| assert!(tree.closest_each_on(path, &from, 0.1).iter().all(Option::is_some)));
            println!("  50,000 nearest points, 2 % of the radius outside, {:>8}: {closest:.3} ms", path.name());
        }
    }
}
