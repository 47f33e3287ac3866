//! Prints how long hairs take to follow a skin and to be mixed of guides: the minimum of interleaved runs.
//!
//! `cargo bench --bench attach`; threads by `RAYON_NUM_THREADS`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use curves::attach::{Binding, carry_curves};
use curves::guides::{Blend, Shapes, Stand, blend, mix};
use curves::scatter::{Spot, Surface};
use numerics::random::Key;
use numerics::shapes;
use std::time::Instant;

const ROUNDS: usize = 15;
const CVS: u32 = 5;

/// Roots on a ball by face, their normals, and straight curves on them.
struct Coat {
    spots: Vec<Spot>,
    roots: Vec<[f32; 3]>,
    normals: Vec<[f64; 3]>,
    starts: Vec<u32>,
    points: Vec<[f32; 3]>,
}

impl Coat {
    fn on(points: &[[f32; 3]], triangles: &[[u32; 3]], count: usize, seed: u64) -> Self {
        let mut spots = Surface::new(points, triangles).spread(count, Key::new(seed));
        spots.sort_by_key(|spot| spot.triangle);
        let at = |spot: &Spot| {
            let corners = triangles[spot.triangle as usize];
            spot.mix(corners.map(|corner| points[corner as usize].map(f64::from))).map(|x| x as f32)
        };
        let roots: Vec<[f32; 3]> = spots.iter().map(at).collect();
        let normals = Binding::on(points, triangles, &spots).normals();
        let curve = |(root, normal): (&[f32; 3], &[f64; 3])| {
            let (root, normal) = (*root, normal.map(|x| x as f32));
            (0..CVS).map(move |k| std::array::from_fn(|d| root[d] + 0.02 * k as f32 * normal[d]))
        };
        let points = roots.iter().zip(&normals).flat_map(curve).collect();
        let starts = (0..=roots.len() as u32).map(|curve| CVS * curve).collect();
        Self { spots, roots, normals, starts, points }
    }

    fn stands(&self) -> Vec<Stand> {
        let stand = |(at, normal): (&[f32; 3], &[f64; 3])| Stand { at: *at, normal: normal.map(|x| x as f32) };
        self.roots.iter().zip(&self.normals).map(stand).collect()
    }
}

fn main() {
    let ball = shapes::sphere([2.0; 3], 60);
    let skin: Vec<[f32; 3]> = ball.points.iter().map(|p| p.map(|x| x as f32)).collect();
    let bent: Vec<[f32; 3]> = skin.iter().map(|[x, y, z]| [x + 0.3 * y * z, y - 0.2 * x * x, 1.2 * z]).collect();
    let triangles = ball.triangles();
    let few = Coat::on(&skin, &triangles, 1_000, 1);
    let some = Coat::on(&skin, &triangles, 10_000, 2);
    let many = Coat::on(&skin, &triangles, 100_000, 3);
    println!("skin of {} triangles", triangles.len());

    let [guides, hairs, bound] = [&few, &many, &some].map(|coat| Binding::on(&skin, &triangles, &coat.spots));
    let mixed = mix(&few.stands(), &many.stands(), 3);
    let wide: Vec<[f64; 3]> = many.roots.iter().map(|root| root.map(f64::from)).collect();
    let poses = [hairs.carry(&bent), guides.carry(&bent)];
    let still = Blend { mix: &mixed, roots: &wide, poses: None };
    let moving = Blend { poses: Some((&poses[0], &poses[1])), ..still };
    let mix_of = |count| mix(&few.stands(), &many.stands(), count).hairs() as f64;
    let blend_of = |now: &Blend| blend(Shapes::new(&few.starts, &few.points, CVS as usize), now).length_error;
    let cases: [(&str, &dyn Fn() -> f64); 8] = [
        ("bind 10,000 roots", &|| Binding::nearest(&skin, &triangles, &some.roots).map_or(0.0, |b| b.farthest())),
        ("carry 10,000 × 5", &|| carry_curves(&some.starts, &some.points, &bound.carry(&bent)).length_error),
        ("carry 100,000 × 5", &|| carry_curves(&many.starts, &many.points, &hairs.carry(&bent)).length_error),
        ("100,000 shares of 1,000, 3 a hair", &|| mix_of(3)),
        ("100,000 shares of 1,000, 8 a hair", &|| mix_of(8)),
        ("100,000 × 5 mixed of 3, still skin", &|| blend_of(&still)),
        ("100,000 × 5 mixed of 3, moving skin", &|| blend_of(&moving)),
        ("poses of 100,000 roots", &|| hairs.carry(&bent).len() as f64),
    ];
    let mut best = [f64::INFINITY; 8];
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
        println!("{name:38}{:9.3} ms", best * 1e3);
    }
}
