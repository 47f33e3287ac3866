//! Windows: nodes that hang on this frame and some before it.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use engine::geometry::{Column, Owner};
use engine::time::Frame;

use crate::net::{Net, at, engine, keyed, row};
use crate::nodes::{CLOCK, DRIFT, FAIL, FOLLOW, MENDED, Probe, SOURCE};

/// An array of positions that someone else may have dropped.
type Positions = Weak<Vec<[f32; 3]>>;

/// A window over a source that wobbles.
fn follow(last: i64, frames: i64) -> Net {
    let mut net = Net::new(1, last);
    let a = net.add("a", &SOURCE).set("amount", 0.0_f32).set("count", 3_i64).done();
    let speed = [(0.0, 0.0), (7.0, 1.0), (15.0, -2.0), (31.0, 3.0), (50.0, 0.5)];
    let moving = net.add("moving", &DRIFT).keyed("speed", &speed).wire("points", a).done();
    net.add("follow", &FOLLOW).set("frames", frames).set("rate", 0.3_f32).wire("points", moving).out();
    net
}

fn nested(last: i64) -> Net {
    let mut net = follow(last, 6);
    net.0.outputs.clear();
    let inner = engine::graph::Link { node: net.place("follow"), port: 0 };
    net.add("outer", &FOLLOW).set("frames", 13_i64).set("rate", 0.7_f32).wire("points", inner).out();
    net
}

#[test]
fn an_exponential_filter_is_worked_by_hand() {
    let mut net = Net::new(1, 12);
    let a = net.add("a", &SOURCE).keyed("amount", &[(4.0, 0.0), (5.0, 1.0)]).done();
    net.add("follow", &FOLLOW).set("frames", 8_i64).wire("points", a).out();
    let cooked = net.cook(1..=12);
    let exact = [0.0, 0.0, 0.0, 0.0, 0.5, 0.75, 0.875, 0.9375, 0.96875, 0.984375, 0.9921875, 0.99609375];
    assert_eq!(cooked.xs(), exact);
}

#[test]
fn any_frame_alone_has_the_bits_it_has_in_order() {
    for net in [follow(70, 5), follow(70, 8), follow(70, 20), follow(70, 500), nested(70)] {
        let together = net.cook(1..=70);
        for frame in [1, 2, 8, 9, 10, 16, 17, 33, 48, 49, 69, 70] {
            let alone = net.cook([frame]);
            assert_eq!(alone.x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame}");
        }
        // One engine, frame after frame, backwards and with gaps.
        let engine = engine(1, 1 << 30);
        for frame in (1..=70).rev().step_by(3) {
            let alone = net.cook_in(&engine, [frame]);
            assert_eq!(alone.x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame} backwards");
        }
        let sparse = net.cook((1..=70).step_by(7));
        for frame in (1..=70).step_by(7) {
            assert_eq!(sparse.x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "every 7th, {frame}");
        }
    }
}

#[test]
fn before_the_scenes_start_all_is_as_at_its_start() {
    let net = nested(20);
    let cooked = net.cook([-500, -1, 0, 1]);
    let first = cooked.x(1.0).to_bits();
    for frame in [-500.0, -1.0, 0.0] {
        assert_eq!(cooked.x(frame).to_bits(), first, "frame {frame}");
    }
}

#[test]
fn a_frame_costs_about_two_updates_and_its_input_is_cooked_once() {
    for frames in [3, 8, 50, 200] {
        let net = follow(800, frames);
        let cooked = net.cook(1..=800);
        let updates = cooked.cooks("follow");
        assert!(updates <= 1640, "a window of {frames}: {updates} updates for 800 frames");
        assert_eq!(cooked.cooks("moving"), 800, "a window of {frames}");
    }
    let net = nested(400);
    let cooked = net.cook(1..=400);
    assert_eq!(cooked.cooks("moving"), 400);
    assert!(cooked.cooks("follow") <= 820 && cooked.cooks("outer") <= 820);
}

#[test]
fn frames_far_apart_do_not_move_what_lies_between() {
    let net = follow(2000, 8);
    let cooked = net.cook([10, 1990]);
    assert!(cooked.cooks("moving") <= 40, "{}", cooked.cooks("moving"));
    assert!(cooked.cooks("follow") <= 40, "{}", cooked.cooks("follow"));
}

#[test]
fn memory_does_not_hang_on_the_windows_length() {
    let most = [8, 800].map(|frames| {
        let alive: Arc<Mutex<(Vec<Positions>, usize)>> = Arc::default();
        let seen = alive.clone();
        let mut net = Net::new(1, 1000);
        let moving = net.given("moving", move |frame| {
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
        net.add("follow", &FOLLOW).set("frames", frames).wire("points", moving).out();
        let cooked = net.cook(1..=1000);
        let most = seen.lock().unwrap_or_else(PoisonError::into_inner).1;
        (most, cooked.report.peak_bytes)
    });
    assert_eq!(most[0], most[1], "inputs alive at once, and bytes of results, for windows of 8 and 800 frames");
    assert!(most[0].0 <= 20, "{most:?}");
}

#[test]
fn between_frames_a_window_runs_along_a_cubic_through_its_neighbours() {
    let net = follow(40, 8);
    let whole = net.cook(1..=40);
    let frames = [9.0, 9.25, 9.5, 10.0, 16.7, 39.5].map(at);
    let cooked = net.cook_with(&engine(2, 1 << 30), &frames, None);
    let cubic = |a: f64, b: f64, c: f64, d: f64, t: f64| {
        let (from, to) = ((c - a) / 2.0, (d - b) / 2.0);
        let (t2, t3) = (t * t, t * t * t);
        (2.0 * t3 - 3.0 * t2 + 1.0) * b + (t3 - 2.0 * t2 + t) * from + (3.0 * t2 - 2.0 * t3) * c + (t3 - t2) * to
    };
    for frame in [9.25, 9.5, 16.7, 39.5_f64] {
        // Past the scene's end there is nothing: the last frame stands for the one after it.
        let near = [-1.0, 0.0, 1.0, 2.0].map(|k| f64::from(whole.x((frame.floor() + k).min(40.0))));
        let exact = cubic(near[0], near[1], near[2], near[3], frame.fract());
        assert!((f64::from(cooked.x(frame)) - exact).abs() < 1e-6, "frame {frame}: {} for {exact}", cooked.x(frame));
    }
    assert_eq!(cooked.x(9.0).to_bits(), whole.x(9.0).to_bits());
    assert_eq!(cooked.x(10.0).to_bits(), whole.x(10.0).to_bits());
    // Each alone has the same bits.
    for frame in frames {
        let alone = net.cook_with(&engine(1, 1 << 30), &[frame], None);
        assert_eq!(alone.x(frame.number()).to_bits(), cooked.x(frame.number()).to_bits(), "frame {frame}");
    }
}

#[test]
fn what_a_window_keeps_is_mended_between_frames_and_only_there() {
    let mut net = follow(40, 8);
    let moving = engine::graph::Link { node: net.place("moving"), port: 0 };
    net.add("mended", &MENDED).set("frames", 8_i64).set("rate", 0.3_f32).wire("points", moving).out();
    let frames = [9.0, 9.25, 16.5, 39.5].map(at);
    let cooked = net.cook_with(&engine(2, 1 << 30), &frames, None);
    let whole = net.cook(1..=40);
    let x =
        |net: &crate::net::Cooked, frame: f64| net.found[&(1, at(frame))].points().expect("points").positions()[0][0];
    for frame in [9.25, 16.5, 39.5_f64] {
        let [from, to] = [frame.floor(), frame.floor() + 1.0].map(|frame| x(&whole, frame));
        assert_eq!(x(&cooked, frame), from + (to - from) * frame.fract() as f32, "frame {frame}");
        assert_ne!(x(&cooked, frame), cooked.x(frame), "frame {frame}");
    }
    assert_eq!(x(&cooked, 9.0), cooked.x(9.0));
}

#[test]
fn between_the_last_frames_nothing_past_the_scene_is_asked() {
    let mut net = Net::new(1, 6);
    let a = net.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let clock = net.add("clock", &CLOCK).wire("points", a).done();
    // A sequence of files that ends with the scene.
    let sequence = net.add("sequence", &FAIL).set("how", 3_i64).set("at", 7_i64).wire("points", clock).done();
    net.add("follow", &FOLLOW).wire("points", sequence).out();
    let cooked = net.cook_with(&engine(1, 1 << 30), &[5.5, 6.0].map(at), None);
    assert!(cooked.report.errors.is_empty(), "{:?}", cooked.report.errors);
}

#[test]
fn what_a_window_reads_at_the_start_is_the_scenes_first_frame_wherever_its_anchors_are() {
    let mut net = Net::new(1, 40);
    let a = net.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let clock = net.add("clock", &CLOCK).set("amount", 100.0_f32).wire("points", a).done();
    net.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", a).wire("anchor", clock).out();
    assert_eq!(net.cook(1..=40).xs(), [-100.0; 40]);
    assert_eq!(net.cook([30]).x(30.0), -100.0);
}

#[test]
fn a_window_over_what_stands_still_stands_still() {
    let probe = Probe::new();
    let mut net = Net::new(1, 60);
    let a = net.add("a", &SOURCE).set("amount", 4.0_f32).done();
    net.add("follow", &FOLLOW).set("probe", probe.number()).wire("points", a).out();
    let cooked = net.cook(1..=60);
    assert_eq!(cooked.xs(), [4.0; 60]);
    assert_eq!(probe.frames("start"), [1.0]);
    assert_eq!(probe.frames("step"), [0.0; 0]);
}

#[test]
fn an_animated_window_length_keeps_the_bits() {
    let mut net = follow(70, 8);
    let keys = [(1.0, 2.0), (30.0, 40.0), (60.0, 3.0)];
    let keys = keys.map(|(frame, length)| (frame, engine::param::Value::Int(length as i64))).to_vec();
    let keys = engine::param::Keyframes { keys, interpolation: numerics::ramp::Interpolation::Linear };
    net = net.with("follow", "frames", engine::param::Source::Keys(Arc::new(keys), engine::param::Shape::Int));
    let together = net.cook(1..=70);
    for frame in [5, 24, 31, 32, 33, 57, 70] {
        assert_eq!(net.cook([frame]).x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame}");
    }
    assert_eq!(together.cooks("moving"), 70);
}

#[test]
fn a_window_goes_back_until_each_step_by_its_own_length_has_forgotten_its_share() {
    // Steps up to frame 47 forget a 16th each, those to 48 and later ones a quarter. The anchor at 49 forgets a quarter by
    // each of the steps to 49 and 48, and the other half by the eight steps to 47 … 40: it starts at 39.
    let frames = [(1.0, 16), (48.0, 4), (80.0, 4)];
    let keys = frames.map(|(frame, length)| (frame, engine::param::Value::Int(length))).to_vec();
    let keys = engine::param::Keyframes { keys, interpolation: numerics::ramp::Interpolation::Constant };
    let keys = engine::param::Source::Keys(Arc::new(keys), engine::param::Shape::Int);
    let starts = |asked: i64| {
        let probe = Probe::new();
        let net = follow(80, 16).with("follow", "frames", keys.clone());
        let net =
            net.with("follow", "probe", engine::param::Source::Constant(engine::param::Value::Int(probe.number())));
        let _ = net.cook([asked]);
        probe.frames("start")
    };
    // Anchors stand every 16 frames: at 1, 17, 33, 49.
    assert_eq!(starts(52), [39.0]);
    assert_eq!(starts(40), [17.0]);
    assert_eq!(starts(70), [61.0]);
}

#[test]
fn preroll_lets_a_window_see_frames_before_the_scene() {
    let with = |preroll: i64, frames: i64| {
        let mut net = Net::new(1, 20);
        let a = net.add("a", &SOURCE).set("amount", 0.0_f32).done();
        let clock = net.add("clock", &CLOCK).set("amount", 1.0_f32).wire("points", a).done();
        net.add("follow", &FOLLOW).set("frames", frames).set("preroll", preroll).wire("points", clock).out();
        net
    };
    // Halfway to the frame's number a frame, from rest: 1 at once; from −1 on: −1, −½, ¼.
    assert_eq!(with(0, 8).cook([1]).x(1.0), 1.0);
    assert_eq!(with(2, 8).cook([1]).x(1.0), 0.25);
    assert_eq!(with(2, 8).cook([0]).x(0.0), -0.5);
    assert_eq!(with(2, 8).cook([-7]).x(-7.0), -1.0);
    // No further back than the window.
    assert_eq!(with(2, 1).cook([1]).x(1.0), 0.5);
    let net = with(5, 8);
    let together = net.cook(-3..=20);
    for frame in [-3, 1, 9, 17] {
        assert_eq!(net.cook([frame]).x(frame as f64).to_bits(), together.x(frame as f64).to_bits(), "frame {frame}");
    }
}

#[test]
fn the_report_says_how_far_back_a_window_goes() {
    let cooked = follow(70, 20).cook(1..=70);
    let window = cooked.node("follow").window.expect("a window");
    assert_eq!((window.frames, window.every), (20, 20));
    let window = follow(70, 3).cook([1]).node("follow").window.expect("a window");
    assert_eq!((window.frames, window.every), (3, 8));
    assert_eq!(cooked.node("moving").window, None);
}

#[test]
fn a_lost_input_frame_spoils_the_frames_that_hang_on_it_and_no_more() {
    let mut net = Net::new(1, 40);
    let a = net.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (40.0, 39.0)]).done();
    let broken = net.add("broken", &FAIL).set("how", 3_i64).set("at", 12_i64).wire("points", a).done();
    net.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", broken).out();
    let cooked = net.cook(1..=40);
    let there: Vec<f64> = cooked.found.keys().map(|(_, frame)| frame.number()).collect();
    // Anchors at 1, 9, 17: what answers for 12…16 has seen frame 12, what answers for 17 on starts at 14.
    let expected: Vec<f64> = (1..=40).filter(|frame| !(12..=16).contains(frame)).map(f64::from).collect();
    assert_eq!(there, expected);
    assert_eq!(cooked.report.errors.len(), 1);
    assert_eq!(cooked.report.errors[0].2, 5, "frames spoiled");
    assert_eq!(cooked.report.errors[0].1.frame, Frame::whole(12));
}

#[test]
fn keyed_rates_are_read_frame_by_frame() {
    let mut net = Net::new(1, 4);
    let a = net.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (2.0, 1.0)]).done();
    net.add("follow", &FOLLOW).source("rate", keyed(&[(2.0, 0.0), (4.0, 1.0)])).wire("points", a).out();
    assert_eq!(net.cook(1..=4).xs(), [0.0, 0.0, 0.5, 1.0]);
}
