//! What the surface of a liquid costs and how exact it is: `cargo run --release -p liquid --example surface_study [name]`.

#![allow(clippy::disallowed_methods, reason = "it measures time")]

use std::f64::consts::PI;
use std::time::Instant;

use liquid::extract::{Placement, extract};
use liquid::level_set::PhiView;
use liquid::rows::CellRows;
use numerics::vector::{Vec3, length, sub};
use rayon::ThreadPoolBuilder;

fn main() {
    let asked = std::env::args().nth(1);
    let all: [(&str, fn()); 1] = [("extract", extraction)];
    for (name, study) in all {
        if asked.as_deref().is_none_or(|asked| asked == name) {
            study();
        }
    }
}

/// The shortest time of five runs, in ms.
fn shortest(mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..5).map(time).fold(f64::INFINITY, f64::min)
}

type Shape<'a> = &'a dyn Fn(Vec3) -> f32;

/// A sphere and a torus as meshes: volume, and vertices a ms on one thread and on two.
fn extraction() {
    println!("shape      placement   vertices  volume     1 thread: ms, vertices/ms  2 threads: ms");
    for size in [64, 128] {
        let n = size as f32;
        let centre = [0.505 * n, 0.494 * n, 0.502 * n];
        let sphere = |p: Vec3| length(sub(p, centre)) - 0.35 * n;
        let torus = |p: Vec3| {
            let [x, y, z] = sub(p, centre);
            length([length([x, 0.0, z]) - 0.25 * n, y, 0.0]) - 0.1 * n
        };
        let side = f64::from(n);
        let volumes =
            [4.0 / 3.0 * PI * 0.35 * 0.35 * 0.35, 2.0 * PI * PI * 0.25 * 0.01].map(|share| share * side * side * side);
        let shapes: [(&str, Shape<'_>, f64); 2] = [("sphere", &sphere, volumes[0]), ("torus", &torus, volumes[1])];
        for (name, shape, exact) in shapes {
            for placement in [Placement::Mean, Placement::Projected] {
                let rows = CellRows::cuboid([0; 3], [size; 3]);
                let phi: Vec<f32> =
                    rows.iter().map(|cell| shape(cell.map(|n| n as f32 + 0.5)).clamp(-5.0, 5.0)).collect();
                let view = PhiView { rows: &rows, phi: &phi, outside: 5.0, low: [0; 3], high: [size; 3] };
                let mesh = extract(view, placement);
                let [one, two] = [1, 2].map(|threads| {
                    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                    pool.install(|| shortest(|| drop(extract(view, placement))))
                });
                let (vertices, error) = (mesh.points.len(), 100.0 * (mesh.volume() / exact - 1.0));
                let rate = vertices as f64 / one;
                let placement = format!("{placement:?}");
                println!(
                    "{name:6} {size:3} {placement:10} {vertices:9} {error:8.3} % {one:14.2} {rate:12.0} {two:14.2}"
                );
            }
        }
    }
}
