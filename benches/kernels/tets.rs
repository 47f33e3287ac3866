//! Cost of tetrahedralisation, the minimum of several runs: CPU time of one thread for Delaunay, CPU and wall time of
//! the whole program for surfaces, and quality measures of those.
//!
//! `cargo bench --bench tets`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use bodies::tets::grid::GridPoint;
use bodies::tets::{ClosedSurface, FillSettings, PolygonSurface, delaunay};
use cpu_time::{ProcessTime, ThreadTime};
use numerics::random::Key;
use numerics::vector::DVec3;
use std::time::Instant;

const ROUNDS: usize = 7;

fn random(n: u64) -> Vec<GridPoint> {
    (0..n).map(|k| [0, 1, 2].map(|axis| (Key::new(1).of(k).of(axis).u64() >> 40) as i32)).collect()
}

fn grid(n: i32) -> Vec<GridPoint> {
    (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n].map(|x| x * 1000)).collect()
}

/// Random points near a sphere.
fn sphere(n: u64) -> Vec<GridPoint> {
    let on_sphere = |k: u64| {
        // A sum of twelve uniform numbers is nearly normal, so the direction is nearly uniform.
        let sum = |axis: u64| (0..12).map(|j| Key::new(2).of(k).of(axis).of(j).f64()).sum::<f64>() - 6.0;
        let p = DVec3::from([0, 1, 2].map(sum));
        p.map(|x| (8_388_608.0 + 8_388_000.0 * x / p.norm()) as i32).into()
    };
    (0..n).map(on_sphere).collect()
}

/// Points and triangles.
type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// The triangles of an obj file of the example graphs.
fn load(name: &str) -> Mesh {
    let path = format!("{}/graphs/assets/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).expect("the asset is there");
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let first = words.next();
        let number = |word: Option<&str>| word.and_then(|word| word.split('/').next()?.parse::<f32>().ok());
        match first {
            Some("v") => points.push([0; 3].map(|_| number(words.next()).expect("a coordinate"))),
            Some("f") => triangles.push([0; 3].map(|_| number(words.next()).expect("a corner") as u32 - 1)),
            _ => {}
        }
    }
    (points, triangles)
}

/// Each triangle split in four.
fn subdivided((mut points, triangles): Mesh) -> Mesh {
    let mut middles = std::collections::BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let (p, q) = (points[a as usize], points[b as usize]);
            points.push([0, 1, 2].map(|k| 0.5 * (p[k] + q[k])));
            points.len() as u32 - 1
        })
    };
    let mut cut = Vec::new();
    for [a, b, c] in triangles {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        cut.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (points, cut)
}

fn main() {
    let cases = [
        ("random 5k", random(5_000)),
        ("random 20k", random(20_000)),
        ("random 50k", random(50_000)),
        ("grid 17³", grid(17)),
        ("grid 27³", grid(27)),
        ("sphere 5k", sphere(5_000)),
        ("sphere 20k", sphere(20_000)),
    ];
    for (name, points) in cases {
        let mut best = f64::INFINITY;
        let mut tets = 0;
        for _ in 0..ROUNDS {
            let start = ThreadTime::now();
            tets = delaunay(&points).tets.len();
            best = best.min(start.elapsed().as_secs_f64());
        }
        println!("{name:12} {:8.1} ms {tets:8} tets", best * 1e3);
    }
    let meshes = [
        ("blobby", load("blobby_4k_watertight.obj"), ROUNDS),
        ("bear", load("bear.obj"), 3),
        ("bear, subdivided", subdivided(load("bear.obj")), 1),
    ];
    for (name, (points, triangles), rounds) in &meshes {
        let starts: Vec<u32> = (0..=triangles.len() as u32).map(|k| 3 * k).collect();
        let surface = PolygonSurface { starts: &starts, corners: triangles.as_flattened(), points };
        for interior in [false, true] {
            let mut best = [f64::INFINITY; 2];
            let mut solid = None;
            for _ in 0..*rounds {
                let (cpu, wall) = (ProcessTime::now(), Instant::now());
                let closed = ClosedSurface::of(&surface, true).expect("the asset is closed");
                solid = Some(closed.fill(&FillSettings { spacing: 0.0, interior }).expect("there is room"));
                best = [best[0].min(cpu.elapsed().as_secs_f64()), best[1].min(wall.elapsed().as_secs_f64())];
            }
            let Some(solid) = solid else { continue };
            let [cpu, wall] = best.map(|seconds| seconds * 1e3);
            let (points, tets) = (solid.points.len(), solid.tets.len());
            println!("{name:17} {:7} triangles: CPU {cpu:8.1} ms, passed {wall:8.1} ms", triangles.len());
            println!("    {points} points, {tets} tets, {:?}", solid.measured);
        }
    }
}
