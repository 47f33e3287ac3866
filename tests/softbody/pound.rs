//! `graphs/dough_pound`: the conflict between a pressing hand and a goal shape that paper R describes.

use crate::cooked::cook_file;
use crate::measure::{distance, points};
use engine::geometry::Attr;

/// Longest side of the dough, metres.
const SIZE: f64 = 0.16;
/// When the first goal is due, and when it lets go.
const GOAL: usize = 24;
const LATER: usize = 36;

#[test]
fn goals_on_the_interior_keep_the_dent_that_goals_on_all_particles_remove() {
    let outputs = ["inside.tets", "everywhere.tets", "free.tets", "bun", "body", "hand"];
    let (frames, metrics) = cook_file("dough_pound", &outputs, LATER as i64);
    let at = |output: usize, frame: usize| points(&frames[output][frame - 1]);
    let body = frames[4][0].tets().unwrap();
    let skin = frames[4][0].mesh().unwrap().point_count();
    let core = body.get(Attr::<f32>::point("core")).unwrap();
    let (goal, rest) = (at(3, GOAL), at(4, 1));
    let mean = |output: usize, frame: usize| {
        let all = at(output, frame);
        let deep: Vec<usize> = (skin..all.len()).filter(|k| core[*k] > 0.5).collect();
        deep.iter().map(|k| distance(&all[*k], &goal[*k])).sum::<f64>() / deep.len() as f64 / SIZE
    };
    // Particles under the hand: on the upper surface, within 2.5 cm of its lowest point.
    let hand = at(5, 16);
    let tip = hand.iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
    let under: Vec<usize> = (0..skin)
        .filter(|k| rest[*k][1] > 0.052 && libm::hypot(rest[*k][0] - tip[0], rest[*k][2] - tip[2]) < 0.025)
        .collect();
    let dent = |output: usize, frame: usize| {
        let all = at(output, frame);
        under.iter().map(|k| distance(&all[*k], &goal[*k])).fold(0.0, f64::max) / SIZE
    };
    println!(
        "dough_pound, share of the body's size       core off the goal   dent off the goal, frame {GOAL}, {LATER}"
    );
    for (output, name) in ["goals inside", "goals on all", "no goals"].iter().enumerate() {
        let [off, first, later] = [mean(output, GOAL), dent(output, GOAL), dent(output, LATER)].map(|x| 100.0 * x);
        println!("{name:<42} {off:>8.2} % {first:>20.2} % {later:>9.2} %");
    }
    assert!(mean(0, GOAL) < 0.02 && dent(0, GOAL) > 0.05);
    assert!(dent(1, LATER) < dent(0, GOAL) / 3.0);
    assert!(mean(2, GOAL) > 2.0 * mean(0, GOAL), "without goals the core has another shape");
    for name in ["inside", "everywhere", "free"] {
        let deepest = metrics[name]["deepest_overlap"].values().copied().fold(0.0, f64::max);
        assert!(deepest < 2e-3, "{name}: no collider is penetrated, {deepest}");
        let inverted = metrics[name]["inverted_tets"].values().copied().fold(0.0, f64::max);
        assert_eq!(inverted, 0.0, "{name}: no tet is turned inside out");
    }
}
