//! The numbers beside the pictures of docs/wind.md.

use engine::geometry::{Component, ENVELOPE, SHIELDED};
use numerics::vector::{self, DVec3, to_f64};

use crate::cooked::cook_file;
use crate::storm::{crossings, skin};

#[test]
fn figure_1_crosses_the_skin_only_without_collisions_and_is_calm_in_the_lee() {
    let outputs = ["wind", "collided", "lee_collided", "lee", "skin", "fur"];
    let (cooked, metrics) = cook_file("fig1", &outputs, 1);
    let part = |output: usize| -> &Component { cooked[output][0].curves().unwrap() };
    let body = skin(cooked[4][0].mesh().unwrap());
    let segments = part(0).point_count() - part(0).element_count();
    let [a, b, c] = [0, 1, 2].map(|output| crossings(part(output), &body));
    let unfreed =
        ["collided", "lee_collided"].map(|node| metrics[node]["unfreed_segments"].values().next().copied().unwrap());
    let shares = part(3).get(SHIELDED).unwrap();
    let sheltered = shares.iter().map(|share| f64::from(*share)).sum::<f64>() / shares.len() as f64;
    println!(
        "figure 1: of {segments} segments a) {a}, b) {b} ({} unfreed), c) {c} ({}) cross the skin; c) {:.1} % sheltered",
        unfreed[0],
        unfreed[1],
        100.0 * sheltered
    );
    assert!(a > segments / 10 && b as f64 <= unfreed[0] && c as f64 <= unfreed[1]);
    assert!((0.3..0.6).contains(&sheltered), "{sheltered}");

    // Mean displacement of tips by wind, exposed and in the lee.
    let moved = |output: usize| -> [f64; 2] {
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        for (cvs, share) in part(5).runs().ranges().zip(shares) {
            let [at, grown] = [output, 5].map(|output| part(output).positions()[cvs.end - 1]);
            let displacement = to_f64(vector::sub(at, grown)).norm();
            let kind = usize::from(*share > 0.9);
            sums[kind] += displacement;
            counts[kind] += 1.0;
        }
        [sums[0] / counts[0], sums[1] / counts[1]]
    };
    let ([free_b, lee_b], [free_c, lee_c]) = (moved(1), moved(2));
    println!("tips moved by wind, mean: b) {free_b:.4} m exposed, {lee_b:.4} in the lee; c) {free_c:.4}, {lee_c:.4}");
    assert!(lee_c < 0.1 * lee_b && free_c > 0.8 * free_b);
}

#[test]
fn figure_2_has_full_influence_at_the_controls_centre_and_none_beyond_its_boundary() {
    let (cooked, _) = cook_file("fig2", &["gusts"], 48);
    let (mut nearest, mut beyond) = ([f64::INFINITY, 0.0], 0.0_f32);
    let mut worst = 0.0_f64;
    for (frame, geometry) in cooked[0].iter().enumerate() {
        let share = frame as f64 / 47.0;
        let centre = DVec3::new(0.9 - 1.8 * share, 0.3 + 0.2 * share, 0.1);
        let curves = geometry.curves().unwrap();
        for (p, envelope) in curves.positions().iter().zip(curves.get(ENVELOPE).unwrap()) {
            let away = (to_f64(*p) - centre).norm() / 0.35;
            worst = worst.max((f64::from(*envelope) - (1.0 - away).max(0.0)).abs());
            if away >= 1.0 {
                beyond = beyond.max(*envelope);
            } else if away < nearest[0] {
                nearest = [away, f64::from(*envelope)];
            }
        }
    }
    println!(
        "figure 2: influence {:.4} at {:.4} of the radius, {beyond} beyond it; within {worst:.1e} of 1 − r everywhere",
        nearest[1], nearest[0]
    );
    assert!(worst < 1e-5 && beyond == 0.0, "{worst}");
}
