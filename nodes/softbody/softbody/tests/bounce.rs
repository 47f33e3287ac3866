//! How high a cube that is dropped comes back, and what it loses.

use super::*;

/// A stiff, undamped cube of 0.1 m is dropped from 2 m: the height of its middle above where it lies, in each frame.
fn dropped(bounce: f32) -> Vec<f64> {
    const DROP: f32 = 2.0;
    let cube = block([2; 3], [0.0, DROP + 1e-3, 0.0], [0.1; 3]);
    let frames = simulating(cube)
        .set(GROUND, true)
        .set(STIFFNESS, 1e6.into())
        .set(DAMPING, 0.0.into())
        .set(FRICTION, 0.0.into())
        .set(BOUNCE, bounce)
        .frames(1..=28);
    let middle = |frame: &BenchResult| {
        let points = frame.mesh().positions();
        points.iter().map(|p| f64::from(p[1])).sum::<f64>() / points.len() as f64 - 0.051
    };
    frames.iter().map(middle).collect()
}

/// It falls for 15.3 frames. With a speed of b·√(2gh) it comes back to b²·h, up to what it moves between two frames. Up to
/// four steps after an impact are implicit Euler, which falls by ½gh² more than it should in each.
#[test]
fn a_dropped_cube_comes_back_to_the_height_that_bounce_gives() {
    for bounce in [0.0, 0.2, 0.3] {
        let heights = dropped(bounce);
        let apex = heights[17..].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let expected = 2.0 * f64::from(bounce) * f64::from(bounce);
        println!("bounce {bounce}: {apex:.4} m of {expected:.4} m");
        let (more, less) = (0.04 * expected + 1e-3, if bounce > 0.0 { 4.0 * 0.5 * G * H * H } else { 0.0 });
        assert!((-less - more..more).contains(&(apex - expected)), "{bounce}: {heights:?}");
    }
    let material = dropped(-1.0)[17..].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    println!("as the material lets it: {material:.4} m");
    assert!((0.19..0.8).contains(&material), "{material}");
}

/// The largest share of their energy that cubes lose in a frame, and impacts that were not followed.
fn lost(bench: Bench) -> (Option<f64>, f64) {
    let frames =
        bench.set(GROUND, true).set(STIFFNESS, 1e6.into()).set(INITIAL_VELOCITY, [0.0, -5.0, 0.0]).frames(1..=6);
    let most = |name: &str| frames.iter().filter_map(|frame| frame.metrics.get(name).copied()).reduce(f64::max);
    (most("lost_share"), most("uncut_impacts").unwrap())
}

#[test]
fn a_body_that_stops_dead_where_it_would_bounce_is_told_from_one_that_bounces() {
    let thrown = || simulating(block([2; 3], [0.0, 0.3, 0.0], [0.1; 3]));
    let (followed, uncut) = lost(thrown());
    assert!((0.1..0.9).contains(&followed.unwrap()) && uncut == 0.0, "{followed:?} {uncut}");
    for stopped in [thrown().set(SUBSTEPS, 1), thrown().set(INTEGRATOR, Stepping::Euler)] {
        assert!(lost(stopped).0.unwrap() > 0.95);
    }
    assert_eq!(lost(thrown().set(BOUNCE, 0.0)), (None, 0.0), "it is meant to");
}

/// Each of its steps takes so many Newton iterations that a frame cannot pay for its impacts.
#[test]
fn impacts_for_which_a_frame_has_no_iterations_left_are_counted() {
    let boxes = (0..25).map(|at| block([2; 3], [0.0, 0.001 + 0.101 * at as f32, 0.0], [0.1; 3]));
    let tower = boxes.fold(bench(&NODE), |bench, boxed| bench.input(BODIES, boxed));
    assert!(lost(tower).1 > 0.0);
}

#[test]
fn what_an_undamped_cube_loses_is_published() {
    let cube = block([2; 3], [0.0, 0.21, 0.0], [0.1; 3]);
    let frames = simulating(cube)
        .set(GROUND, true)
        .set(GRAVITY, [0.0; 3])
        .set(DAMPING, 0.0.into())
        .set(FRICTION, 0.0.into())
        .set(VOLUME, 0.0)
        .set(BOUNCE, 0.0)
        .set(INITIAL_VELOCITY, [0.0, -2.0, 0.0])
        .frames(1..=12);
    let lost: f64 = frames.iter().map(|frame| frame.metrics["energy_lost"]).sum();
    let last = &frames[11].metrics;
    // 1 kg at 2 m/s.
    let left = last["kinetic"] + last["elastic"];
    assert!((lost + left - 2.0).abs() < 1e-3 && left < 0.1, "{lost} J lost, {left} J left");
}

/// A cube that hits the ground at 45°: how fast it slides on, against that of 256 steps a frame.
#[test]
fn a_cube_that_hits_the_ground_obliquely_keeps_the_speed_that_short_steps_give() {
    let speed = |stiffness: f32, friction: f32, substeps: i64| {
        let cube = block([4; 3], [0.0, 0.05, 0.0], [0.1; 3]);
        let thrown = simulating(cube).set(GROUND, true).set(GRAVITY, [0.0; 3]).set(INITIAL_VELOCITY, [2.0, -2.0, 0.0]);
        let thrown = thrown.set(STIFFNESS, stiffness.into()).set(FRICTION, friction.into()).set(DAMPING, 1e-3.into());
        let frames = thrown.set(SELF_COLLISION, false).set(SUBSTEPS, substeps).frames([8, 10]);
        let mean = |frame: &BenchResult| {
            let points = frame.mesh().positions();
            points.iter().map(|p| f64::from(p[0])).sum::<f64>() / points.len() as f64
        };
        (mean(&frames[1]) - mean(&frames[0])) / (2.0 * H)
    };
    for stiffness in [1e5, 1e6, 1e7, 1e8] {
        for friction in [0.1, 0.3] {
            let [found, fine] = [0, 256].map(|substeps| speed(stiffness, friction, substeps));
            println!("E {stiffness:e} Pa, μ {friction}: {found:.3} m/s, with 256 steps {fine:.3}");
            assert!((found / fine - 1.0).abs() < 0.05, "E {stiffness}, μ {friction}: {found} for {fine} m/s");
        }
    }
}

/// Stiffer for its weight than doubles hold: it falls freely, and its springs never store more than a hundredth of the energy
/// of the fall. The same bits with the largest stiffness that counts.
#[test]
fn a_stiffness_beyond_what_doubles_hold_is_limited_and_said() {
    let fall = |stiffness: f32, density: f32| {
        let cube = block([3; 3], [0.0, 0.2, 0.0], [0.1; 3]);
        simulating(cube).set(GROUND, true).set(STIFFNESS, stiffness.into()).set(DENSITY, density.into()).frames(1..=24)
    };
    for density in [1e-6_f32, 1.0, 1e3] {
        let frames = fall(1e12, density);
        let energy = f64::from(density) * 1e-3 * G * 0.2;
        for (number, frame) in frames.iter().enumerate() {
            let [elastic, limited, substeps] =
                ["elastic", "stiffness_limited", "substeps_used"].map(|name| frame.metrics[name]);
            assert!(elastic < 0.01 * energy && limited == 64.0, "{density}, {number}: {elastic} of {energy} J");
            let fallen = 0.5 * G * (number as f64 * H) * (number as f64 * H);
            let height = frame.mesh().positions().iter().map(|p| f64::from(p[1])).fold(f64::INFINITY, f64::min);
            assert!(number > 4 || substeps > 1.0 || (height - 0.2 + fallen).abs() < 1e-6, "{density}, {number}");
        }
        let same = fall((1e8 * f64::from(density)) as f32, density);
        assert_eq!(same[23].metrics["stiffness_limited"], 0.0, "{density}");
        assert_eq!(same[23].mesh().positions(), frames[23].mesh().positions(), "{density}");
    }
}
