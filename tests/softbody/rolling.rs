//! `graphs/dough_rolling`.

use crate::cooked::cook_file_with;
use crate::measure::{points, volume_of};
use engine::geometry::Geometry;

/// Height of the dough in a strip across the position x of the pin's axis, metres above the ground.
fn height(dough: &Geometry, x: f64) -> f64 {
    let near = points(dough).into_iter().filter(|p| (p[0] - x).abs() < 0.012 && p[2].abs() < 0.03);
    near.map(|p| p[1]).fold(0.0, f64::max)
}

#[test]
fn dough_flattens_under_the_pin_swells_in_front_of_it_and_keeps_its_dent() {
    let coarse = [("block.divisions", "9"), ("fine_block.divisions", "27")];
    let (frames, metrics) = cook_file_with("dough_rolling", &["dough.surface", "dough.tets", "pin"], 96, &coarse);
    let [surface, tets, pins] = [&frames[0], &frames[1], &frames[2]];
    let start = height(&surface[0], 0.0);
    let axis = |frame: usize| {
        let all = points(&pins[frame - 1]);
        all.iter().map(|p| p[0]).sum::<f64>() / all.len() as f64
    };
    let under = height(&surface[25], axis(26)) / start;
    let ahead = |frame: usize| {
        points(&surface[frame - 1]).iter().filter(|p| p[0] > axis(frame) + 0.02).map(|p| p[1]).fold(0.0, f64::max)
    };
    let behind = |frame: usize| {
        points(&surface[frame - 1]).iter().filter(|p| p[0] < axis(frame) - 0.02).map(|p| p[1]).fold(0.0, f64::max)
    };
    let (front, back) = (ahead(26) / start, behind(26) / start);
    let x = axis(26);
    let dent = |frame: usize| height(&surface[0], x) - height(&surface[frame - 1], x);
    let kept = dent(96) / dent(82);
    let first = volume_of(&tets[0]);
    let off = tets.iter().map(|tets| (volume_of(tets) / first - 1.0).abs()).fold(0.0, f64::max);
    println!(
        "dough_rolling, frame 26: under the pin {:.0} % of the start's height, ahead {:.0} %, behind {:.0} %",
        100.0 * under,
        100.0 * front,
        100.0 * back
    );
    println!(
        "dough_rolling: {:.0} % of the dent of frame 82 is there at frame 96; volume within {:.2} %",
        100.0 * kept,
        100.0 * off
    );
    assert!(under <= 0.6 && front >= 1.05 && front > back && kept >= 0.8 && off <= 0.03);
    let most = |name: &str| metrics["dough"][name].values().copied().fold(0.0, f64::max);
    println!(
        "dough_rolling: deepest overlap {:.1} % of `thickness`, {} inverted tets at most, {} steps at most",
        most("deepest_overlap") / 2e-3 * 100.0,
        most("inverted_tets"),
        most("substeps_used")
    );
    assert!(most("deepest_overlap") < 2e-3, "no collider is penetrated");
    assert_eq!(most("caps_hit"), 0.0, "no limit is noted while the dough is at rest");
}
