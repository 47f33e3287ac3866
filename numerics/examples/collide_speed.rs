//! How long collision takes: `cargo run --release -p numerics --example collide_speed`.
//!
//! Fur on a sphere of 20,480 triangles, its curves bent by wind across it.

use cpu_time::ProcessTime;
use numerics::bend::{Bend, Mode, bend};
use numerics::collide::{Collide, Collided, Method, Scaled, Skin, collide, normals};
use numerics::ramp::Ramp;
use numerics::tree::TriangleTree;
use numerics::vec3::{Vec3, add, length, scale};
use std::time::Duration;

/// Rounds of each case, and how many cases: `collide_speed 1 1` is a run to profile.
fn arg(k: usize, default: usize) -> usize {
    std::env::args().nth(k).and_then(|word| word.parse().ok()).unwrap_or(default)
}

#[allow(clippy::disallowed_methods, reason = "a clock is what this example reads")]
fn least(mut run: impl FnMut() -> Collided) -> (Duration, Collided) {
    let mut best: Option<(Duration, Collided)> = None;
    for _ in 0..arg(1, 9) {
        let start = ProcessTime::now();
        let result = run();
        let time = start.elapsed();
        if best.as_ref().is_none_or(|(least, _)| time < *least) {
            best = Some((time, result));
        }
    }
    best.expect("there are rounds")
}

fn main() {
    let (points, triangles) = icosphere(5);
    let tree = TriangleTree::build(&points, &triangles);
    let normals = normals(&points, &triangles);
    let skin = Skin { tree: &tree, triangles: &triangles, normals: &normals };
    for (curves, cvs) in [(10_000, 5), (10_000, 32), (100_000, 5)].into_iter().take(arg(2, 3)) {
        let rest = fur(curves, cvs);
        let starts: Vec<u32> = (0..=curves as u32).map(|k| k * cvs as u32).collect();
        let ramp = Ramp::constant(1.0);
        let wind = Bend {
            wind: [1.0, 0.0, 0.0],
            rotate: 0.5,
            rotate_mask: None,
            envelope: None,
            ramp: &ramp,
            mode: Mode::ResolutionFree { reference_segments: 4.0 },
            blend: 1.0,
            blend_mask: None,
            noise: None,
        };
        let goal = bend(&starts, &rest, &wind).points;
        for method in [Method::Exact, Method::Steps(10)].into_iter().take(arg(2, 2)) {
            let how = Collide {
                obstacles: &[&tree],
                skin: Some(skin),
                method,
                gap: 1e-4,
                offset_root: 1e-4,
                offset_scale: None,
                blend: Scaled { value: 1.0, mask: None },
                width: Scaled { value: 0.0, mask: None },
            };
            let (time, out) = least(|| collide(&starts, &rest, &goal, &how));
            println!(
                "{curves} × {cvs} {method:?}: {:.2} ms, {} contacts, {} unfreed, {} started inside",
                time.as_secs_f64() * 1e3,
                out.contacts,
                out.unfreed_segments,
                out.started_inside
            );
        }
    }
}

/// Upright curves of a tenth of the radius, spread evenly.
fn fur(curves: usize, cvs: usize) -> Vec<Vec3> {
    let golden = 2.399_963;
    (0..curves)
        .flat_map(|k| {
            let y = 1.0 - 2.0 * (k as f64 + 0.5) / curves as f64;
            let (sine, cosine) = libm::sincos(golden * k as f64);
            let side = (1.0 - y * y).sqrt();
            let up = [(cosine * side) as f32, y as f32, (sine * side) as f32];
            (0..cvs).map(move |cv| scale(up, 1.0 + 0.1 * cv as f32 / (cvs - 1) as f32))
        })
        .collect()
}

/// A unit sphere of 20·4ⁿ triangles.
fn icosphere(times: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (a, b) = (0.525_731_1, 0.850_650_8);
    let mut points = vec![
        [-a, b, 0.0],
        [a, b, 0.0],
        [-a, -b, 0.0],
        [a, -b, 0.0],
        [0.0, -a, b],
        [0.0, a, b],
        [0.0, -a, -b],
        [0.0, a, -b],
        [b, 0.0, -a],
        [b, 0.0, a],
        [-b, 0.0, -a],
        [-b, 0.0, a],
    ];
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..times {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = add(points[a as usize], points[b as usize]);
                points.push(scale(sum, 1.0 / length(sum)));
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (points, triangles)
}
