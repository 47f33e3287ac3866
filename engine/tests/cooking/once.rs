//! Which nodes are cooked, and how often.

use engine::param::{Keyframes, ParamType, Source};
use engine::plan::Request;
use engine::time::Frame;
use numerics::ramp::Interpolation;
use std::sync::Arc;

use crate::builder::{TestGraph, at, engine, keyed, row};
use crate::nodes::{ADD, BOUNCE, CLOCK, FOLLOW, FROM_START, Probe, SOURCE, SUM};
use crate::windows::follow;

#[test]
fn a_node_that_no_output_depends_on_is_never_called() {
    let (needed, unneeded) = (Probe::new(), Probe::new());
    let mut graph = TestGraph::new(1, 3);
    let a = graph.add("a", &SOURCE).set("amount", 1.0_f32).done();
    graph.add("out", &ADD).set("amount", 2.0_f32).set("probe", needed.number()).wire("points", a).out();
    graph.add("aside", &ADD).set("probe", unneeded.number()).wire("points", a).done();
    let cooked = graph.cook(1..=3);
    assert_eq!(cooked.xs(), [3.0; 3]);
    assert_eq!((needed.count(), unneeded.count()), (1, 0));
    assert!(!cooked.node("aside").needed);
}

#[test]
fn an_illegal_param_that_no_output_depends_on_is_ignored() {
    let mut graph = TestGraph::new(1, 2);
    let a = graph.add("a", &SOURCE).out();
    graph.add("aside", &ADD).source("amount", keyed(&[(1.0, f32::INFINITY)])).wire("points", a).done();
    let cooked = graph.cook(1..=2);
    assert!(cooked.report.errors.is_empty());
    assert_eq!(cooked.xs(), [1.0; 2]);
}

#[test]
fn static_nodes_are_cooked_once_for_all_frames() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 100);
    let a = graph.add("a", &SOURCE).set("amount", 5.0_f32).set("probe", probe.number()).done();
    graph.add("b", &CLOCK).wire("points", a).out();
    let cooked = graph.cook(1..=100);
    assert_eq!(probe.count(), 1);
    assert_eq!(cooked.cooks("a"), 1);
    assert_eq!(cooked.cooks("b"), 100);
    assert_eq!(cooked.x(1.0), 6.0);
    assert_eq!(cooked.x(100.0), 105.0);
}

#[test]
fn a_frame_node_that_does_not_read_the_clock_is_static() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 20);
    let a = graph.add("a", &SOURCE).done();
    graph.add("b", &CLOCK).set("amount", 0.0_f32).set("probe", probe.number()).wire("points", a).out();
    let cooked = graph.cook(1..=20);
    assert_eq!(probe.count(), 1);
    assert_eq!(cooked.xs(), [1.0; 20]);
}

#[test]
fn frames_with_equal_params_are_cooked_once() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 100);
    let a = graph.add("a", &SOURCE).keyed("amount", &[(10.0, 0.0), (12.0, 2.0)]).set("probe", probe.number()).done();
    graph.add("b", &ADD).set("amount", 1.0_f32).wire("points", a).out();
    let cooked = graph.cook(1..=100);
    // 0 up to frame 10, 1 at 11, 2 from 12 on.
    assert_eq!(probe.count(), 3);
    assert_eq!(cooked.cooks("b"), 3);
    assert_eq!([1.0, 10.0, 11.0, 12.0, 100.0].map(|frame| cooked.x(frame)), [1.0, 1.0, 2.0, 3.0, 3.0]);
}

#[test]
fn a_value_that_recurs_within_a_slice_is_cooked_once() {
    let probe = Probe::new();
    let keys = (1..=8).map(|frame| (f64::from(frame), f32::erase((frame % 2) as f32))).collect();
    let keys = Keyframes { keys, interpolation: Interpolation::Constant };
    let mut graph = TestGraph::new(1, 8);
    let source = Source::Keys(Arc::new(keys), f32::shape());
    graph.add("a", &SOURCE).source("amount", source).set("probe", probe.number()).out();
    let cooked = graph.cook(1..=8);
    assert_eq!(cooked.xs(), [1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
    assert!(probe.count() <= 4, "{}", probe.count());
}

#[test]
fn static_results_are_kept_between_cooks() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 4);
    let a = graph.add("a", &SOURCE).set("probe", probe.number()).done();
    graph.add("b", &CLOCK).wire("points", a).out();
    let engine = engine(1, 1 << 30);
    let first = graph.cook_in(&engine, 1..=4);
    let second = graph.cook_in(&engine, 1..=4);
    assert_eq!(probe.count(), 1);
    assert_eq!(first.bits(), second.bits());
}

#[test]
fn geometry_of_the_calling_program_is_not_confused_between_graphs() {
    let engine = engine(1, 1 << 30);
    for x in 0..8_u8 {
        let x = f32::from(x);
        let mut graph = TestGraph::new(1, 1);
        let given = graph.still("given", row(&[x]));
        graph.add("b", &ADD).wire("points", given).out();
        assert_eq!(graph.cook_in(&engine, [1]).x(1.0), x + 1.0);
    }
}

#[test]
fn an_input_read_at_the_start_is_cooked_only_there() {
    let (rest, now) = (Probe::new(), Probe::new());
    let mut graph = TestGraph::new(3, 40);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let moving = graph.add("moving", &CLOCK).set("probe", now.number()).wire("points", a).done();
    let other = graph.add("other", &CLOCK).set("amount", 10.0_f32).set("probe", rest.number()).wire("points", a).done();
    graph.add("out", &FROM_START).wire("points", moving).wire("rest", other).out();
    let cooked = graph.cook(3..=40);
    assert_eq!(rest.frames("cook"), [3.0]);
    assert_eq!(now.count(), 38);
    assert_eq!((cooked.x(3.0), cooked.x(40.0)), (3.0 - 30.0, 40.0 - 30.0));
    // Also if the start itself is not requested.
    assert_eq!(graph.cook([7]).x(7.0), 7.0 - 30.0);
}

#[test]
fn wires_of_a_list_are_in_file_order_and_may_repeat_a_node() {
    let mut graph = TestGraph::new(1, 2);
    let a = graph.add("a", &SOURCE).set("amount", 1.0_f32).done();
    let b = graph.add("b", &CLOCK).set("amount", 10.0_f32).wire("points", a).done();
    graph.add("sum", &SUM).wire("points", a).wire("points", b).wire("points", a).out();
    assert_eq!(graph.cook(1..=2).xs(), [1.0 + 11.0 + 1.0, 1.0 + 21.0 + 1.0]);
}

#[test]
fn repeated_and_unordered_frames_are_cooked_once_and_delivered_in_order() {
    let probe = Probe::new();
    let mut graph = TestGraph::new(1, 9);
    let a = graph.add("a", &SOURCE).done();
    graph.add("b", &CLOCK).set("probe", probe.number()).wire("points", a).out();
    let cooked = graph.cook([5, 2, 9, 2, 5]);
    assert_eq!(cooked.xs(), [3.0, 6.0, 10.0]);
    let mut frames = probe.frames("cook");
    frames.sort_by(f64::total_cmp);
    assert_eq!(frames, [2.0, 5.0, 9.0]);
}

#[test]
fn stateless_graphs_cook_outside_the_scene_and_between_frames() {
    let mut graph = TestGraph::new(1, 4);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    graph.add("b", &CLOCK).wire("points", a).out();
    let frames = [-3.0, 0.0, 2.5, 99.0].map(crate::builder::at);
    let cooked = graph.cook_with(&engine(2, 1 << 30), &frames, None);
    assert_eq!(cooked.xs(), [-3.0, 0.0, 2.5, 99.0]);
}

/// Rehearses and cooks the first output of a graph, and compares how often each node was called.
fn assert_rehearsed(graph: &TestGraph, frames: &[Frame]) {
    let engine = engine(2, 1 << 30);
    let request = Request { outputs: vec![0], frames: frames.iter().copied().collect() };
    let rehearsed = engine.rehearse(&graph.0, &request).unwrap_or_else(|error| panic!("{error}"));
    let cooked = graph.cook_with(&engine, frames, None);
    for (rehearsed, cooked) in rehearsed.nodes.iter().zip(&cooked.report.nodes) {
        assert_eq!(rehearsed.cooks, cooked.cooks, "{:?} at {frames:?}", cooked.id);
    }
}

#[test]
fn a_rehearsal_counts_the_same_calls_as_a_cook() {
    let mut graph = TestGraph::new(1, 50);
    let a = graph.add("a", &SOURCE).done();
    let clock = graph.add("clock", &CLOCK).wire("points", a).done();
    let add = graph.add("add", &ADD).keyed("amount", &[(1.0, 0.0), (8.0, 1.0)]).wire("points", a).done();
    let follow = graph.add("follow", &FOLLOW).set("frames", 11_i64).wire("points", clock).done();
    let again = graph.add("again", &FOLLOW).set("frames", 5_i64).wire("points", follow).done();
    let start = graph.add("start", &FROM_START).wire("points", add).wire("rest", clock).done();
    let bounce = graph.add("bounce", &BOUNCE).wire("points", start).wire("floor", clock).done();
    graph.add("sum", &SUM).wire("points", again).wire("points", bounce).out();
    for frames in [(1..=50).collect(), vec![37], vec![20, 49], (-3..10).collect::<Vec<i64>>()] {
        assert_rehearsed(&graph, &frames.into_iter().map(Frame::whole).collect::<Vec<Frame>>());
    }
}

#[test]
fn a_rehearsal_counts_the_calls_for_samples_between_frames() {
    let graph = follow(50, 11);
    let halves = |frames: std::ops::Range<i64>| frames.map(|half| at(half as f64 / 2.0)).collect::<Vec<Frame>>();
    for frames in [halves(2..12), halves(41..60), vec![at(13.5)], [24.0, 24.75, 26.0].map(at).to_vec()] {
        assert_rehearsed(&graph, &frames);
    }
}
