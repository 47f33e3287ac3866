//! Cost of contact detection: `RAYON_NUM_THREADS=1 cargo bench --bench collision`.
//!
//! `-- 200 pin` runs 200 rounds of one case. A pin of 2,048 triangles rolls over a slab of dough with about 2,200
//! surface vertices, and the dough is tested against itself.

use bodies::collision::{BodySkin, CollisionScene, ContactParams, Ground, Obstacle, ObstaclePose};
use bodies::mass_spring::{ContactFinder, ContactQuery};
use cpu_time::ProcessTime;
use std::time::Duration;

const THICKNESS: f64 = 1e-3;
const FRAME: f64 = 1.0 / 24.0;

#[allow(clippy::disallowed_methods, reason = "a clock is what this bench reads")]
fn least(mut run: impl FnMut()) -> Duration {
    let rounds = std::env::args().nth(1).and_then(|word| word.parse().ok()).unwrap_or(200);
    let mut best = Duration::MAX;
    for _ in 0..rounds {
        let start = ProcessTime::now();
        run();
        best = best.min(start.elapsed());
    }
    best
}

fn main() {
    let (points, triangles) = slab(32);
    let skin = BodySkin::new(&points, &triangles, &[]).expect("the slab is sound");
    // Within the frame it sinks 5 mm, rotates by 10° and advances 9 mm.
    let (pin, faces) = pin(32, 31);
    let poses = [(0.0, 0.0, 0.009), (1.0, 0.175, -0.005)].map(|(share, turn, sink)| {
        let (sine, cosine) = libm::sincos(turn);
        let put = |[x, y, z]: [f64; 3]| [cosine * x - sine * y + 0.009 * share, sine * x + cosine * y + 0.08 + sink, z];
        ObstaclePose { share, positions: pin.iter().copied().map(put).collect() }
    });
    let obstacle = [Obstacle::new(&faces, &poses, FRAME, THICKNESS, 0.5).expect("the pin is sound")];
    let to: Vec<[f64; 3]> = points.iter().map(|[x, y, z]| [*x, y - 0.002, *z]).collect();
    let query = ContactQuery { from: &points, to: &to, times: [0.0, 1.0] };
    println!("{} vertices, {} triangles; pin of {}", points.len(), triangles.len(), faces.len());

    let params = ContactParams { thickness: THICKNESS, friction: 0.5 };
    let ground = Ground { up: [0.0, 1.0, 0.0], height: 0.0, thickness: THICKNESS, friction: 0.5 };
    let skins = [skin];
    let scenes = [
        ("pin", CollisionScene { skins: &skins, obstacles: &obstacle, ..CollisionScene::default() }),
        ("ground", CollisionScene { skins: &skins, ground: Some(ground), ..CollisionScene::default() }),
        ("itself", CollisionScene { skins: &skins, self_contact: Some(params), ..CollisionScene::default() }),
    ];
    let only = std::env::args().nth(2);
    for (name, scene) in scenes.into_iter().filter(|scene| only.as_ref().is_none_or(|only| only == scene.0)) {
        let mut out = Vec::new();
        let time = least(|| {
            out.clear();
            scene.find(&query, &mut out);
        });
        println!("{name}: {:.3} ms, {} contacts", time.as_secs_f64() * 1e3, out.len());
    }
}

/// A slab of 0.3 × 0.03 × 0.3 m, `n` squares a side.
fn slab(n: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let at = |k: u32| 0.3 * (f64::from(k) / f64::from(n) - 0.5);
    let side = n + 1;
    for y in [0.0, 0.03] {
        for z in 0..side {
            points.extend((0..side).map(|x| [at(x), y, at(z)]));
        }
    }
    let index = |top: u32, x: u32, z: u32| top * side * side + z * side + x;
    let mut square = |[a, b, c, d]: [u32; 4]| triangles.extend([[a, b, c], [a, c, d]]);
    for z in 0..n {
        for x in 0..n {
            square([index(1, x, z), index(1, x, z + 1), index(1, x + 1, z + 1), index(1, x + 1, z)]);
            square([index(0, x, z), index(0, x + 1, z), index(0, x + 1, z + 1), index(0, x, z + 1)]);
        }
    }
    for k in 0..n {
        square([index(0, k, n), index(0, k + 1, n), index(1, k + 1, n), index(1, k, n)]);
        square([index(0, k + 1, 0), index(0, k, 0), index(1, k, 0), index(1, k + 1, 0)]);
        square([index(0, n, k + 1), index(0, n, k), index(1, n, k), index(1, n, k + 1)]);
        square([index(0, 0, k), index(0, 0, k + 1), index(1, 0, k + 1), index(1, 0, k)]);
    }
    (points, triangles)
}

/// A cylinder of radius 5 cm and length 0.4 m along z: `around` × `along` squares and its two ends.
fn pin(around: u32, along: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for ring in 0..=along {
        for k in 0..around {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(around));
            points.push([0.05 * cosine, 0.05 * sine, 0.4 * (f64::from(ring) / f64::from(along) - 0.5)]);
        }
    }
    let index = |ring: u32, k: u32| ring * around + k % around;
    for ring in 0..along {
        for k in 0..around {
            let [a, b, c, d] = [index(ring, k), index(ring, k + 1), index(ring + 1, k + 1), index(ring + 1, k)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let middle = points.len() as u32;
    points.extend([[0.0, 0.0, -0.2], [0.0, 0.0, 0.2]]);
    for k in 0..around {
        triangles.push([middle, index(0, k + 1), index(0, k)]);
        triangles.push([middle + 1, index(along, k), index(along, k + 1)]);
    }
    (points, triangles)
}
