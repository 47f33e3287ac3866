//! Windows: nodes that depend on the current frame and some before it.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use engine::geometry::{Column, Owner};
use engine::time::Frame;

use crate::builder::{TestGraph, at, engine, keyed, row};
use crate::nodes::{CLOCK, DRIFT, FAIL, FOLLOW, MOVING, Probe, SOURCE};

/// A weak reference to an array of positions.
type Positions = Weak<Vec<[f32; 3]>>;

/// A window that reads a source with varying speed.
pub(crate) fn follow(last: i64, frames: i64) -> TestGraph {
    let mut graph = TestGraph::new(1, last);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).set("count", 3_i64).done();
    let speed = [(0.0, 0.0), (7.0, 1.0), (15.0, -2.0), (31.0, 3.0), (50.0, 0.5)];
    let moving = graph.add("moving", &DRIFT).keyed("speed", &speed).wire("points", a).done();
    graph.add("follow", &FOLLOW).set("frames", frames).set("rate", 0.3_f32).wire("points", moving).out();
    graph
}

fn nested(last: i64) -> TestGraph {
    let mut graph = follow(last, 6);
    graph.0.outputs.clear();
    let inner = engine::graph::Link { node: graph.index("follow"), port: 0 };
    graph.add("outer", &FOLLOW).set("frames", 13_i64).set("rate", 0.7_f32).wire("points", inner).out();
    graph
}

#[test]
fn an_exponential_filter_has_the_closed_form() {
    let mut graph = TestGraph::new(1, 12);
    let a = graph.add("a", &SOURCE).keyed("amount", &[(4.0, 0.0), (5.0, 1.0)]).done();
    graph.add("follow", &FOLLOW).set("frames", 8_i64).wire("points", a).out();
    let cooked = graph.cook(1..=12);
    let exact = [0.0, 0.0, 0.0, 0.0, 0.5, 0.75, 0.875, 0.9375, 0.96875, 0.984375, 0.9921875, 0.99609375];
    assert_eq!(cooked.xs(), exact);
}

#[test]
fn frames_do_not_depend_on_which_frames_are_requested() {
    for graph in [follow(70, 5), follow(70, 8), follow(70, 20), follow(70, 500), nested(70)] {
        let together = graph.cook(1..=70);
        for frame in [1, 2, 8, 9, 10, 16, 17, 33, 48, 49, 69, 70] {
            let alone = graph.cook([frame]);
            assert_eq!(alone.x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame}");
        }
        // One engine, frame by frame, backwards and with gaps.
        let engine = engine(1, 1 << 30);
        for frame in (1..=70).rev().step_by(3) {
            let alone = graph.cook_in(&engine, [frame]);
            assert_eq!(alone.x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame} backwards");
        }
        let sparse = graph.cook((1..=70).step_by(7));
        for frame in (1..=70).step_by(7) {
            assert_eq!(sparse.x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "every 7th, {frame}");
        }
    }
}

#[test]
fn before_the_scenes_start_a_window_is_constant() {
    let graph = nested(20);
    let cooked = graph.cook([-500, -1, 0, 1]);
    let first = cooked.x(1.0).to_bits();
    for frame in [-500.0, -1.0, 0.0] {
        assert_eq!(cooked.x(frame).to_bits(), first, "frame {frame}");
    }
}

#[test]
fn a_frame_costs_about_two_updates_and_its_input_is_cooked_once() {
    for frames in [3, 8, 50, 200] {
        let graph = follow(800, frames);
        let cooked = graph.cook(1..=800);
        let updates = cooked.cooks("follow");
        assert!(updates <= 1640, "a window of {frames}: {updates} updates for 800 frames");
        assert_eq!(cooked.cooks("moving"), 800, "a window of {frames}");
    }
    let graph = nested(400);
    let cooked = graph.cook(1..=400);
    assert_eq!(cooked.cooks("moving"), 400);
    assert!(cooked.cooks("follow") <= 820 && cooked.cooks("outer") <= 820);
}

#[test]
fn between_distant_frames_nothing_is_cooked() {
    let graph = follow(2000, 8);
    let cooked = graph.cook([10, 1990]);
    assert!(cooked.cooks("moving") <= 40, "{}", cooked.cooks("moving"));
    assert!(cooked.cooks("follow") <= 40, "{}", cooked.cooks("follow"));
}

#[test]
fn memory_does_not_depend_on_the_windows_length() {
    let most = [8, 800].map(|frames| {
        let alive: Arc<Mutex<(Vec<Positions>, usize)>> = Arc::default();
        let seen = alive.clone();
        let mut graph = TestGraph::new(1, 1000);
        let moving = graph.given("moving", move |frame| {
            let geometry = row(&[frame.number() as f32; 100]);
            let column = geometry.points().and_then(|points| points.table(Owner::Point).column("P"));
            let mut alive = alive.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(Column::F3(array)) = column {
                alive.0.push(Arc::downgrade(array));
            }
            alive.0.retain(|array| array.strong_count() > 0);
            alive.1 = alive.1.max(alive.0.len());
            geometry
        });
        graph.add("follow", &FOLLOW).set("frames", frames).wire("points", moving).out();
        let cooked = graph.cook(1..=1000);
        let most = seen.lock().unwrap_or_else(PoisonError::into_inner).1;
        (most, cooked.report.peak_bytes)
    });
    assert_eq!(most[0], most[1], "inputs alive at once, and bytes of results, for windows of 8 and 800 frames");
    assert!(most[0].0 <= 20, "{most:?}");
}

#[test]
fn between_frames_a_window_is_interpolated_by_a_cubic() {
    let graph = follow(40, 8);
    let whole = graph.cook(1..=40);
    let frames = [9.0, 9.25, 9.5, 10.0, 16.7, 39.5].map(at);
    let cooked = graph.cook_with(&engine(2, 1 << 30), &frames, None);
    for frame in [9.25, 9.5, 16.7, 39.5_f64] {
        // There is no frame after the scene's last, so the last is used twice.
        let near = [-1.0, 0.0, 1.0, 2.0].map(|k| f64::from(whole.x((frame.floor() + k).min(40.0))));
        let exact = cubic(near[0], near[1], near[2], near[3], frame.fract());
        assert!((f64::from(cooked.x(frame)) - exact).abs() < 1e-6, "frame {frame}: {} for {exact}", cooked.x(frame));
    }
    assert_eq!(cooked.x(9.0).to_bits(), whole.x(9.0).to_bits());
    assert_eq!(cooked.x(10.0).to_bits(), whole.x(10.0).to_bits());
    // Each frame requested alone has the same bits.
    for frame in frames {
        let alone = graph.cook_with(&engine(1, 1 << 30), &[frame], None);
        assert_eq!(alone.x(frame.number()).to_bits(), cooked.x(frame.number()).to_bits(), "frame {frame}");
    }
}

/// The cubic Hermite from `b` to `c` with Catmull–Rom slopes.
fn cubic(a: f64, b: f64, c: f64, d: f64, t: f64) -> f64 {
    let (from, to) = ((c - a) / 2.0, (d - b) / 2.0);
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * b + (t3 - 2.0 * t2 + t) * from + (3.0 * t2 - 2.0 * t3) * c + (t3 - t2) * to
}

/// What is interpolated is how far the points are from those they follow; the node corrects the result.
#[test]
fn between_frames_a_window_moves_the_input_that_it_follows() {
    let mut graph = follow(40, 8);
    let input = engine::graph::Link { node: graph.index("moving"), port: 0 };
    graph.add("mover", &MOVING).set("frames", 8_i64).set("rate", 0.3_f32).wire("points", input).out();
    graph.output(input);
    let frames = [9.0, 9.25, 16.5, 39.5].map(at);
    let cooked = graph.cook_with(&engine(2, 1 << 30), &frames, None);
    let whole = graph.cook(1..=40);
    let x = |cooked: &crate::builder::Cooked, output: usize, frame: f64| {
        f64::from(cooked.found[&(output, at(frame))].points().expect("points").positions()[0][0])
    };
    for frame in [9.25, 16.5, 39.5_f64] {
        let near = [-1.0, 0.0, 1.0, 2.0].map(|k| (frame.floor() + k).min(40.0));
        let [a, b, c, d] = near.map(|frame| x(&whole, 1, frame) - x(&whole, 2, frame));
        let moved_by = cubic(a, b, c, d, frame.fract());
        let found = x(&cooked, 1, frame);
        assert!((found - (x(&cooked, 2, frame) + moved_by + 10.0)).abs() < 1e-5, "frame {frame}: {found}");
    }
    assert_eq!(x(&cooked, 1, 9.0), x(&cooked, 0, 9.0), "a whole frame is what the node gives");
}

#[test]
fn interpolation_at_the_end_reads_nothing_after_the_scene() {
    let mut graph = TestGraph::new(1, 6);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let clock = graph.add("clock", &CLOCK).wire("points", a).done();
    // A sequence of files that ends with the scene.
    let sequence = graph.add("sequence", &FAIL).set("how", 3_i64).set("at", 7_i64).wire("points", clock).done();
    graph.add("follow", &FOLLOW).wire("points", sequence).out();
    let cooked = graph.cook_with(&engine(1, 1 << 30), &[5.5, 6.0].map(at), None);
    assert!(cooked.report.errors.is_empty(), "{:?}", cooked.report.errors);
}

#[test]
fn inputs_read_at_the_start_are_those_of_the_scenes_first_frame_for_all_anchors() {
    let mut graph = TestGraph::new(1, 40);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 100.0_f32).wire("points", a).done();
    graph.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", a).wire("anchor", clock).out();
    assert_eq!(graph.cook(1..=40).xs(), [-100.0; 40]);
    assert_eq!(graph.cook([30]).x(30.0), -100.0);
}

#[test]
fn a_window_that_reads_static_inputs_is_static() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 60);
    let a = graph.add("a", &SOURCE).set("amount", 4.0_f32).done();
    graph.add("follow", &FOLLOW).set("probe", probe.number()).wire("points", a).out();
    let cooked = graph.cook(1..=60);
    assert_eq!(cooked.xs(), [4.0; 60]);
    assert_eq!(probe.frames("start"), [1.0]);
    assert_eq!(probe.frames("step"), [0.0; 0]);
}

#[test]
fn with_an_animated_length_frames_do_not_depend_on_the_request() {
    let mut graph = follow(70, 8);
    let keys = [(1.0, 2.0), (30.0, 40.0), (60.0, 3.0)];
    let keys = keys.map(|(frame, length)| (frame, engine::param::Value::Int(length as i64))).to_vec();
    let keys = engine::param::Keyframes { keys, interpolation: numerics::ramp::Interpolation::Linear };
    graph = graph.with("follow", "frames", engine::param::Source::Keys(Arc::new(keys), engine::param::Shape::Int));
    let together = graph.cook(1..=70);
    for frame in [5, 24, 31, 32, 33, 57, 70] {
        assert_eq!(graph.cook([frame]).x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame}");
    }
    assert_eq!(together.cooks("moving"), 70);
}

#[test]
fn with_an_animated_length_each_step_contributes_by_its_own_length() {
    // Steps to frames up to 47 contribute 1/16 of a window each, those to 48 and later 1/4. For the anchor at 49 the
    // steps to 49 and 48 contribute 1/4 each and the eight steps to 47 … 40 the other half, so its state starts at 39.
    let frames = [(1.0, 16), (48.0, 4), (80.0, 4)];
    let keys = frames.map(|(frame, length)| (frame, engine::param::Value::Int(length))).to_vec();
    let keys = engine::param::Keyframes { keys, interpolation: numerics::ramp::Interpolation::Constant };
    let keys = engine::param::Source::Keys(Arc::new(keys), engine::param::Shape::Int);
    let starts = |frame: i64| {
        let probe = Probe::new();
        let graph = follow(80, 16).with("follow", "frames", keys.clone());
        let graph =
            graph.with("follow", "probe", engine::param::Source::Constant(engine::param::Value::Int(probe.number())));
        let _ = graph.cook([frame]);
        probe.frames("start")
    };
    // Anchors are 16 frames apart: at 1, 17, 33, 49.
    assert_eq!(starts(52), [39.0]);
    assert_eq!(starts(40), [17.0]);
    assert_eq!(starts(70), [61.0]);
}

#[test]
fn with_preroll_a_window_reads_frames_before_the_scene() {
    let with = |preroll: i64, frames: i64| {
        let mut graph = TestGraph::new(1, 20);
        let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
        let clock = graph.add("clock", &CLOCK).set("amount", 1.0_f32).wire("points", a).done();
        graph.add("follow", &FOLLOW).set("frames", frames).set("preroll", preroll).wire("points", clock).out();
        graph
    };
    // Each frame halves the distance to the frame number. Without preroll the first value is 1; from −1 on they are −1,
    // −½, ¼.
    assert_eq!(with(0, 8).cook([1]).x(1.0), 1.0);
    assert_eq!(with(2, 8).cook([1]).x(1.0), 0.25);
    assert_eq!(with(2, 8).cook([0]).x(0.0), -0.5);
    assert_eq!(with(2, 8).cook([-7]).x(-7.0), -1.0);
    // Preroll is limited by the length of the window.
    assert_eq!(with(2, 1).cook([1]).x(1.0), 0.5);
    let graph = with(5, 8);
    let together = graph.cook(-3..=20);
    for frame in [-3, 1, 9, 17] {
        assert_eq!(graph.cook([frame]).x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame}");
    }
}

#[test]
fn the_report_contains_the_length_of_a_window() {
    let cooked = follow(70, 20).cook(1..=70);
    let window = cooked.node("follow").window.expect("a window");
    assert_eq!((window.frames, window.every), (20, 20));
    let window = follow(70, 3).cook([1]).node("follow").window.expect("a window");
    assert_eq!((window.frames, window.every), (3, 8));
    assert_eq!(cooked.node("moving").window, None);
}

#[test]
fn a_failed_input_frame_affects_only_the_frames_that_depend_on_it() {
    let mut graph = TestGraph::new(1, 40);
    let a = graph.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (40.0, 39.0)]).done();
    let broken = graph.add("broken", &FAIL).set("how", 3_i64).set("at", 12_i64).wire("points", a).done();
    graph.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", broken).out();
    let cooked = graph.cook(1..=40);
    let delivered: Vec<f64> = cooked.found.keys().map(|(_, frame)| frame.number()).collect();
    // Anchors at 1, 9, 17: the state of frames 12…16 has read frame 12, that of frames from 17 on starts at 14.
    let expected: Vec<f64> = (1..=40).filter(|frame| !(12..=16).contains(frame)).map(f64::from).collect();
    assert_eq!(delivered, expected);
    assert_eq!(cooked.report.errors.len(), 1);
    assert_eq!(cooked.report.errors[0].2, 5, "affected frames");
    assert_eq!(cooked.report.errors[0].1.frame, Frame::whole(12));
}

#[test]
fn keyframed_rates_are_read_frame_by_frame() {
    let mut graph = TestGraph::new(1, 4);
    let a = graph.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (2.0, 1.0)]).done();
    graph.add("follow", &FOLLOW).source("rate", keyed(&[(2.0, 0.0), (4.0, 1.0)])).wire("points", a).out();
    assert_eq!(graph.cook(1..=4).xs(), [0.0, 0.0, 0.5, 1.0]);
}
