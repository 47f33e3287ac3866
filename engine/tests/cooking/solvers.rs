//! Solvers: nodes that depend on their own state at the previous frame.

use crate::builder::{TestGraph, at, engine};
use crate::nodes::{ADD, BOUNCE, CLOCK, FOLLOW, Probe, SOURCE};

fn bounce(probe: &Probe) -> TestGraph {
    let mut graph = TestGraph::new(1, 40);
    let a = graph.add("a", &SOURCE).set("amount", 1.0_f32).set("count", 3_i64).done();
    let floor = graph.add("floor", &SOURCE).keyed("amount", &[(1.0, 0.0), (20.0, 0.5), (40.0, 0.0)]).done();
    graph.add("bounce", &BOUNCE).set("probe", probe.number()).wire("points", a).wire("floor", floor).out();
    graph
}

#[test]
fn free_fall_has_the_closed_form() {
    let mut graph = TestGraph::new(1, 25);
    let a = graph.add("a", &SOURCE).set("amount", 10.0_f32).done();
    graph.add("bounce", &BOUNCE).set("samples", 1_i64).wire("points", a).out();
    let cooked = graph.cook(1..=25);
    // Symplectic Euler: x = 10 − g dt² n(n+1)/2.
    for frame in 1..=25 {
        let n = f64::from(frame - 1);
        let exact = 10.0 - 9.81 * n * (n + 1.0) / (2.0 * 24.0 * 24.0);
        let x = f64::from(cooked.x(f64::from(frame)));
        assert!((x - exact).abs() < 1e-5, "frame {frame}: {x} for {exact}");
    }
}

#[test]
fn a_solver_runs_once_from_its_start_for_any_requested_frames() {
    let all = bounce(&Probe::new()).cook(1..=40);
    for frames in [vec![40], vec![3, 10], vec![39, 40], vec![20, 5, 20]] {
        let probe = Probe::new();
        let last = *frames.iter().max().unwrap_or(&1);
        let cooked = bounce(&probe).cook(frames.iter().copied());
        assert_eq!(probe.frames("start"), [1.0]);
        assert_eq!(probe.frames("step"), (2..=last).map(|frame| frame as f64).collect::<Vec<_>>());
        let mut requested: Vec<f64> = frames.iter().map(|frame| *frame as f64).collect();
        requested.sort_by(f64::total_cmp);
        requested.dedup();
        assert_eq!(probe.frames("output"), requested, "only requested frames are output");
        for frame in requested {
            assert_eq!(cooked.x(frame).to_bits(), all.x(frame).to_bits(), "frame {frame} of {frames:?}");
        }
    }
}

#[test]
fn before_its_start_a_solver_outputs_its_initial_state() {
    let probe = Probe::new();
    let graph =
        bounce(&probe).with("bounce", "start_frame", engine::param::Source::Constant(engine::param::Value::Int(10)));
    let cooked = graph.cook([-5, 1, 9, 10, 11]);
    assert_eq!(cooked.xs()[..4], [1.0; 4]);
    assert!(cooked.x(11.0) < 1.0);
    assert_eq!((probe.frames("start"), probe.frames("step")), (vec![10.0], vec![11.0]));
    // A solver that starts before the scene runs up to it.
    let probe = Probe::new();
    let graph =
        bounce(&probe).with("bounce", "start_frame", engine::param::Source::Constant(engine::param::Value::Int(-3)));
    graph.cook([1]);
    assert_eq!((probe.frames("start"), probe.frames("step")), (vec![-3.0], vec![-2.0, -1.0, 0.0, 1.0]));
}

#[test]
fn frames_before_the_start_are_output_also_after_all_others() {
    let graph = bounce(&Probe::new());
    let engine = engine(2, 1 << 30);
    let later = graph.cook_in(&engine, 20..=30);
    let early = graph.cook_in(&engine, [-2, 1, 7]);
    let all = graph.cook(1..=30);
    assert_eq!(early.x(7.0).to_bits(), all.x(7.0).to_bits());
    assert_eq!(later.x(25.0).to_bits(), all.x(25.0).to_bits());
    assert_eq!(early.x(-2.0), 1.0);
}

#[test]
fn a_step_samples_its_inputs_at_the_declared_times() {
    for (samples, expected) in [(1, vec![2.0, 3.0]), (2, vec![2.0, 2.5, 3.0]), (4, vec![2.0, 2.25, 2.5, 2.75, 3.0])] {
        let probe = Probe::new();
        let samples = engine::param::Source::Constant(engine::param::Value::Int(samples));
        bounce(&probe).with("bounce", "samples", samples).cook(1..=5);
        let step = probe.calls().into_iter().find(|call| call.part == "step" && call.frame == Some(3.0));
        assert_eq!(step.map(|call| call.samples), Some(expected));
    }
}

#[test]
fn inputs_from_a_solver_are_sampled_at_whole_frames_only() {
    let (under, over) = (Probe::new(), Probe::new());
    let mut graph = bounce(&under);
    graph.0.outputs.clear();
    let inner = engine::graph::Link { node: graph.index("bounce"), port: 0 };
    let between = graph.add("between", &ADD).set("amount", -0.3_f32).wire("points", inner).done();
    let start = graph.add("start", &SOURCE).set("amount", 3.0_f32).done();
    graph.add("top", &BOUNCE).set("probe", over.number()).wire("points", start).wire("floor", between).out();
    let cooked = graph.cook(1..=20);
    assert!(cooked.report.errors.is_empty());
    let step = over.calls().into_iter().find(|call| call.part == "step" && call.frame == Some(3.0));
    assert_eq!(step.map(|call| call.samples), Some(vec![2.0, 3.0]));
    assert_eq!(under.frames("step").len(), 19);
}

#[test]
fn inputs_from_a_window_are_sampled_between_frames() {
    let mut graph = TestGraph::new(1, 12);
    let zero = graph.add("zero", &SOURCE).set("amount", 0.0_f32).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 0.1_f32).wire("points", zero).done();
    let follow = graph.add("follow", &FOLLOW).wire("points", clock).done();
    let start = graph.add("start", &SOURCE).set("amount", 1.0_f32).done();
    graph.add("bounce", &BOUNCE).wire("points", start).wire("floor", follow).out();
    let together = graph.cook(1..=12);
    assert!(together.report.errors.is_empty(), "{:?}", together.report.errors);
    assert_eq!(graph.cook([12]).x(12.0).to_bits(), together.x(12.0).to_bits());
    assert_eq!(graph.cook_in(&engine(7, 0), [12]).x(12.0).to_bits(), together.x(12.0).to_bits());
}

#[test]
fn an_input_read_at_the_start_is_cooked_only_there() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 30);
    let zero = graph.add("zero", &SOURCE).set("amount", 2.0_f32).done();
    let clock = graph.add("clock", &CLOCK).set("probe", probe.number()).wire("points", zero).done();
    graph.add("bounce", &BOUNCE).wire("points", clock).out();
    let cooked = graph.cook(1..=30);
    assert_eq!(probe.frames("cook"), [1.0]);
    assert_eq!(cooked.x(1.0), 3.0);
}

#[test]
fn an_input_read_at_each_frame_acts_at_each_frame() {
    let mut graph = TestGraph::new(1, 5);
    let zero = graph.add("zero", &SOURCE).set("amount", 0.0_f32).done();
    let clock = graph.add("clock", &CLOCK).wire("points", zero).done();
    let bounce = graph.add("bounce", &BOUNCE).set("gravity", 0.0_f32).wire("points", zero).wire("push", clock);
    bounce.out();
    assert_eq!(graph.cook(1..=5).xs(), [0.0, 2.0, 5.0, 9.0, 14.0]);
}

#[test]
fn fractional_frames_of_a_solver_and_of_nodes_that_read_it_are_refused() {
    let mut graph = bounce(&Probe::new());
    let from = engine::graph::Link { node: graph.index("bounce"), port: 0 };
    graph.0.outputs.clear();
    graph.add("add", &ADD).wire("points", from).out();
    let request = engine::plan::Request { outputs: vec![0], frames: vec![at(3.0), at(4.5)].into() };
    let error = engine(1, 1 << 20).plan(&graph.0, &request).map(drop).unwrap_err().to_string();
    let expected = "`add` (Add) at frame 4.5: output `add` comes from a solver, which has only whole frames; \
                    request whole frames";
    assert_eq!(error, expected);
}

#[test]
fn a_late_frame_alone_costs_about_as_much_as_all_frames() {
    let mut graph = TestGraph::new(1, 4000);
    let zero = graph.add("zero", &SOURCE).set("amount", 0.0_f32).done();
    let clock = graph.add("clock", &CLOCK).set("amount", 1e-6_f32).wire("points", zero).done();
    let follow = graph.add("follow", &FOLLOW).set("frames", 100_i64).wire("points", clock).done();
    graph.add("bounce", &BOUNCE).set("gravity", 0.0_f32).wire("points", zero).wire("push", follow).out();
    let alone = graph.cook([4000]);
    let together = graph.cook(1..=4000);
    assert_eq!(alone.x(4000.0).to_bits(), together.x(4000.0).to_bits());
    assert_eq!((alone.cooks("bounce"), alone.cooks("clock")), (4000, 4000));
    assert!(alone.report.peak_bytes <= 2 * together.report.peak_bytes);
    let (alone, together) = (alone.report.cooking, together.report.cooking);
    assert!(alone < together * 3, "{alone:?} alone, {together:?} together");
}
