//! Prints how long it takes to bind roots to a skin, to move curves with it and to mix hairs from guides: the minimum of interleaved runs.
//!
//! `cargo bench --bench attach`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use curves::attach::{SkinBinding, attach_curves};
use curves::guides::{HairBlend, OrientedPoint, ResampledGuides, blend_hairs, guide_weights};
use curves::scatter::ScatterSurface;
use curves::surface::SurfacePoint;
use numerics::random::Key;
use numerics::shapes;
use numerics::vector::{DVec3, to_f32, to_f64};
use std::time::Instant;

const ROUNDS: usize = 15;
const CVS: u32 = 5;

/// Roots on a mesh in the order of its faces, their normals, and straight curves on them.
struct Coat {
    points_on: Vec<SurfacePoint>,
    roots: Vec<[f32; 3]>,
    normals: Vec<DVec3>,
    starts: Vec<u32>,
    points: Vec<[f32; 3]>,
}

impl Coat {
    fn on(skin: &Mesh, count: usize, seed: u64) -> Self {
        let (points, triangles) = (&skin.points[..], &skin.triangles[..]);
        let mut points_on = ScatterSurface::new(points, triangles).spread(count, Key::new(seed));
        points_on.sort_by_key(|point| point.triangle);
        let roots: Vec<[f32; 3]> = points_on.iter().map(|point| to_f32(point.position(points, triangles))).collect();
        let normals = SkinBinding::to_surface(points, triangles, &points_on).normals();
        let curve = |(root, normal): (&[f32; 3], &DVec3)| {
            let (root, normal) = (to_f64(*root), *normal);
            (0..CVS).map(move |k| to_f32(root + normal * (0.02 * f64::from(k))))
        };
        let points = roots.iter().zip(&normals).flat_map(curve).collect();
        let starts = (0..=roots.len() as u32).map(|curve| CVS * curve).collect();
        Self { points_on, roots, normals, starts, points }
    }

    fn oriented(&self) -> Vec<OrientedPoint> {
        let oriented = |(root, normal): (&[f32; 3], &DVec3)| OrientedPoint { position: *root, normal: to_f32(*normal) };
        self.roots.iter().zip(&self.normals).map(oriented).collect()
    }
}

/// A triangle mesh.
struct Mesh {
    points: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The example scenes' bear.
    fn bear() -> Self {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/assets/bear.obj");
        let text = std::fs::read_to_string(file).expect("the example assets are in the repository");
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => {
                    let mut next = || words.next().and_then(|word| word.parse().ok()).expect("three coordinates");
                    points.push([next(), next(), next()]);
                }
                Some("f") => {
                    let index = |word: &str| word.split('/').next()?.parse::<u32>().ok().map(|index| index - 1);
                    let face: Vec<u32> = words.map(|word| index(word).expect("an index")).collect();
                    triangles.extend(face.windows(2).skip(1).map(|edge| [face[0], edge[0], edge[1]]));
                }
                _ => {}
            }
        }
        Self { points, triangles }
    }

    fn sphere() -> Self {
        let sphere = shapes::sphere([2.0; 3], 60);
        Self { points: sphere.points.iter().map(|p| p.map(|x| x as f32)).collect(), triangles: sphere.triangles() }
    }
}

/// Binds roots.
fn bind(skin: &Mesh, coat: &Coat) -> f64 {
    SkinBinding::to_closest(&skin.points, &skin.triangles, &coat.roots).map_or(0.0, |binding| binding.max_distance())
}

fn main() {
    let (bear, skin) = (Mesh::bear(), Mesh::sphere());
    let bent: Vec<[f32; 3]> = skin.points.iter().map(|[x, y, z]| [x + 0.3 * y * z, y - 0.2 * x * x, 1.2 * z]).collect();
    let few = Coat::on(&skin, 1_000, 1);
    let some = Coat::on(&skin, 10_000, 2);
    let many = Coat::on(&skin, 100_000, 3);
    let fur = Coat::on(&bear, 10_000, 4);
    println!("skin of {} triangles, bear of {}", skin.triangles.len(), bear.triangles.len());

    let [guides, hairs, bound] =
        [&few, &many, &some].map(|coat| SkinBinding::to_surface(&skin.points, &skin.triangles, &coat.points_on));
    let weights = guide_weights(&few.oriented(), &many.oriented(), 3);
    let roots: Vec<DVec3> = many.roots.iter().map(|root| to_f64(*root)).collect();
    let poses = [hairs.poses(&bent), guides.poses(&bent)];
    let still = HairBlend { weights: &weights, roots: &roots, poses: None };
    let moving = HairBlend { poses: Some((&poses[0], &poses[1])), ..still };
    let weigh = |count| guide_weights(&few.oriented(), &many.oriented(), count).hairs() as f64;
    let blend =
        |now: &HairBlend| blend_hairs(ResampledGuides::new(&few.starts, &few.points, CVS as usize), now).length_error;
    let cases: [(&str, &dyn Fn() -> f64); 10] = [
        ("bind 10,000 roots to the bear", &|| bind(&bear, &fur)),
        ("bind 10,000 roots to the sphere", &|| bind(&skin, &some)),
        ("bind 100,000 roots to the sphere", &|| bind(&skin, &many)),
        ("attach 10,000 × 5", &|| attach_curves(&some.starts, &some.points, &bound.poses(&bent)).length_error),
        ("attach 100,000 × 5", &|| attach_curves(&many.starts, &many.points, &hairs.poses(&bent)).length_error),
        ("weigh 1,000 guides for 100,000, 3 a hair", &|| weigh(3)),
        ("weigh 1,000 guides for 100,000, 8 a hair", &|| weigh(8)),
        ("100,000 × 5 mixed from 3, still skin", &|| blend(&still)),
        ("100,000 × 5 mixed from 3, moving skin", &|| blend(&moving)),
        ("poses of 100,000 roots", &|| hairs.poses(&bent).len() as f64),
    ];
    let mut best = [f64::INFINITY; 10];
    let mut checked = 0.0;
    for _ in 0..ROUNDS {
        for ((_, case), best) in cases.iter().zip(&mut best) {
            let start = Instant::now();
            checked += case();
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    assert!(checked.is_finite());
    for ((name, _), best) in cases.iter().zip(best) {
        println!("{name:41}{:9.3} ms", best * 1e3);
    }
}
