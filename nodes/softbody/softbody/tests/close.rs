//! What starts closer than `thickness`, or is when `thickness` grows: moved away evenly, without energy from nothing.

use super::*;

const GAP: f32 = 0.01;

pub(super) fn sheet() -> Component {
    let points = vec![[-0.5, 0.0, -0.5], [-0.5, 0.0, 0.6], [0.6, 0.0, 0.6], [0.6, 0.0, -0.5]];
    Component::mesh(vec![4], vec![0, 1, 2, 3], points).unwrap()
}

pub(super) fn lowest(frame: &BenchResult) -> f64 {
    frame.mesh().positions().iter().map(|p| f64::from(p[1])).fold(f64::INFINITY, f64::min)
}

/// A cube of 1 kg without gravity, exactly on something: it rises by a twelfth of `thickness` a frame, at 20 mm/s, and
/// has ½ m v² = 0.2 mJ; contacts give way by up to a tenth of `thickness`.
#[test]
fn a_body_exactly_on_something_is_moved_off_evenly_in_twelve_frames() {
    let still = || simulating(cube()).set(GRAVITY, [0.0; 3]).set(THICKNESS, GAP).set(STIFFNESS, 5e4.into());
    let speed = f64::from(GAP) / (12.0 * H);
    for (what, bench) in [
        ("ground", still().set(GROUND, true)),
        ("half of thickness below the ground", still().set(GROUND, true).set(GROUND_HEIGHT, 0.5 * GAP)),
        ("closed", still().input(COLLIDERS, solid([-0.1, -0.3, -0.1], 0.3))),
        ("open", still().input(COLLIDERS, sheet())),
    ] {
        let sunk = if what.starts_with("half") { 0.5 * f64::from(GAP) } else { 0.0 };
        let missing = f64::from(GAP) + sunk;
        let speed = speed * missing / f64::from(GAP);
        for (over, frame) in bench.frames(1..=20).iter().enumerate() {
            let (low, even) = (lowest(frame) - sunk, missing * (over as f64).min(12.0) / 12.0 - sunk);
            println!("{what} {over}: {low:.5} {even:.5} {:.2e} J", frame.metrics["kinetic"]);
            assert!(low > even - 1.5e-3 && (over > 12 || low < even + 1.5e-3), "{what} {over}: {low} {even}");
            assert!(frame.metrics["kinetic"] <= 4.0 * 0.5 * speed * speed, "{what} {over}: {:?}", frame.metrics);
            assert_eq!(frame.metrics["deepest_penetration"], 0.0, "{what} {over}");
            assert!(
                over < 13 || frame.metrics["deepest_overlap"] < 0.15 * missing,
                "{what} {over}: {:?}",
                frame.metrics
            );
        }
    }
}

/// With gravity it rises and stays: at most by `thickness`, and what 25 mm/s throws it. Its energy is that of 1 kg at that
/// speed and what it loses as it sags under its weight, (ρg)²h⁵ ÷ 6E.
#[test]
fn a_body_that_is_placed_on_something_does_not_jump() {
    for stiffness in [5e3_f32, 5e4, 1e6] {
        for gap in [1e-3, GAP] {
            for open in [false, true] {
                let placed = simulating(cube()).set(THICKNESS, gap).set(STIFFNESS, stiffness.into());
                let placed = if open { placed.input(COLLIDERS, sheet()) } else { placed.set(GROUND, true) };
                let frames = placed.frames(1..=24);
                let heights: Vec<f64> = frames.iter().map(lowest).collect();
                let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let most = frames.iter().map(|frame| frame.metrics["kinetic"]).fold(0.0, f64::max);
                let caps: f64 = frames.iter().map(|frame| frame.metrics["caps_hit"]).sum();
                println!("E {stiffness}, {gap} m, open {open}: {highest:.5} m, {most:.2e} J, caps hit {caps}");
                let weight = 1000.0 * G;
                let sagging = weight * weight * 1e-5 / (6.0 * f64::from(stiffness));
                assert!(highest < f64::from(gap) + 2e-4 && heights[23] > 0.0, "{heights:?}");
                assert!(most < 5e-4 + sagging && caps == 0.0, "{most} {sagging} {caps}");
            }
        }
    }
}

#[test]
fn bodies_that_touch_at_the_start_come_apart_evenly() {
    let second = block([3, 2, 2], [0.1, 0.0, 0.0], [0.1; 3]);
    let two = simulating(cube()).input(BODIES, second).set(GRAVITY, [0.0; 3]).set(THICKNESS, GAP);
    let first = cube().point_count() - 1;
    for (over, frame) in two.frames(1..=20).iter().enumerate() {
        let at = |points: &[[f32; 3]]| points.iter().map(|p| f64::from(p[0])).collect::<Vec<f64>>();
        let [own, other] = [at(&frame.mesh().positions()[..first]), at(&frame.mesh().positions()[first..])];
        let apart = other.into_iter().fold(f64::INFINITY, f64::min) - own.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let even = f64::from(GAP) * (over as f64).min(12.0) / 12.0;
        assert!(apart > even - 1.5e-3 && (over > 12 || apart < even + 1.5e-3), "{over}: {apart} {even}");
    }
}

/// It has lain on the ground for 12 frames when `thickness` jumps from 1 to 10 mm, or grows for four frames.
#[test]
fn a_thickness_that_grows_lifts_bodies_evenly() {
    for last in [14.0, 17.0] {
        let lying = simulating(block([2; 3], [0.0, 1e-3, 0.0], [0.1; 3])).set(GROUND, true).set(STIFFNESS, 5e4.into());
        let frames = lying.keyed(THICKNESS, &[(1.0, 1e-3), (13.0, 1e-3), (last, GAP)]).frames(1..=40);
        let heights: Vec<f64> = frames.iter().map(lowest).collect();
        let fastest = heights.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        println!("{last}: {heights:?}");
        assert!(highest < f64::from(GAP) + 1e-3 && heights[39] > 0.8 * f64::from(GAP), "{heights:?}");
        assert!(fastest < 1.5 * 9e-3 / 12.0, "{fastest}");
    }
}
