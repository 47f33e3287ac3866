//! `graphs/egg_crack`.

use crate::cooked::cook_file_with;
use crate::measure::{distance, points, volume};
use engine::geometry::Geometry;

/// Whether a point is inside a tet by more than the rounding of f32 positions.
fn holds(tet: [[f64; 3]; 4], p: &[f64; 3]) -> bool {
    let whole = volume(tet);
    (0..4).all(|k| {
        let mut part = tet;
        part[k] = *p;
        volume(part) / whole > 1e-4
    })
}

/// How many points of `inner` lie in tets of `body`.
fn inside(body: &[[f64; 3]], tets: &[[u32; 4]], inner: &[[f64; 3]]) -> usize {
    let boxed = |tet: &[u32; 4]| {
        let corners = tet.map(|corner| body[corner as usize]);
        let side = |pick: fn(f64, f64) -> f64| -> [f64; 3] {
            std::array::from_fn(|k| corners.iter().map(|corner| corner[k]).reduce(pick).unwrap())
        };
        (side(f64::min), side(f64::max), corners)
    };
    let boxed: Vec<_> = tets.iter().map(boxed).collect();
    let is_inside = |p: &[f64; 3]| {
        for (low, high, corners) in &boxed {
            // Written out: the test is compiled without optimisation, and most tets end here.
            if p[0] < low[0] || p[0] > high[0] || p[1] < low[1] || p[1] > high[1] || p[2] < low[2] || p[2] > high[2] {
                continue;
            }
            if holds(*corners, p) {
                return true;
            }
        }
        false
    };
    inner.iter().filter(|p| is_inside(p)).count()
}

#[test]
fn an_egg_drapes_over_the_rim_with_its_yolk_inside() {
    let coarse = [("outside.divisions", "8"), ("cavity.divisions", "5"), ("ball.divisions", "5")];
    let (frames, metrics) = cook_file_with("egg_crack", &["egg.tets", "white", "yolk", "pins", "bowl"], 60, &coarse);
    let [eggs, whites, yolks, pins] = [&frames[0], &frames[1], &frames[2], &frames[3]];
    let of = |geometry: &Geometry| geometry.tets().unwrap().tet_corners().to_vec();
    let (white_tets, yolk_tets) = (of(&whites[0]), of(&yolks[0]));
    let white = whites[0].tets().unwrap().point_count();
    let rest = points(&eggs[0]);
    let pin_at = |frame: usize| points_of_pins(&pins[frame - 1]);

    let (mut worst, mut held, mut overlap) = (0.0_f64, 0, 0);
    for frame in 1..=60 {
        let now = points(&eggs[frame - 1]);
        for (from, to) in pin_at(1).iter().zip(pin_at(frame)) {
            for (p, q) in rest.iter().zip(&now).filter(|(p, _)| distance(p, from) <= 0.006) {
                held += 1;
                worst = (0..3).map(|k| (q[k] - p[k] - (to[k] - from[k])).abs()).fold(worst, f64::max);
            }
        }
        let (own, other) = now.split_at(white);
        overlap += inside(own, &white_tets, other) + inside(other, &yolk_tets, own);
    }
    let last = points(&eggs[59]);
    let below = |side: fn(f64) -> bool| last[..white].iter().filter(|p| p[1] < -2e-3 && side(p[2])).count();
    let (inner, outer) = (below(|z| z < 0.095), below(|z| z > 0.1));
    let torn = metrics["egg"]["torn"].values().copied().fold(0.0, f64::max);
    println!(
        "egg_crack: {} pinned particles within {worst:.1e} m of their pins, {overlap} points of yolk and white in each other",
        held / 60
    );
    println!(
        "egg_crack, frame 60: {inner} particles of the white hang in the bowl, {outer} outside; {torn} springs torn"
    );
    assert!(held / 60 >= 2 && worst < 1e-7);
    assert_eq!(overlap, 0);
    assert!(inner >= 5 && outer >= 5);
    let caps = metrics["egg"]["caps_hit"].values().copied().fold(0.0, f64::max);
    assert_eq!(caps, 0.0, "no limit is noted while the egg is at rest");
}

fn points_of_pins(pins: &Geometry) -> Vec<[f64; 3]> {
    pins.points().unwrap().positions().iter().map(|p| p.map(f64::from)).collect()
}
