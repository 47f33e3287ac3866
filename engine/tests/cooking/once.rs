//! What is cooked at all, and how often.

use engine::param::{Keyframes, ParamType, Source};
use engine::plan::Request;
use engine::time::Frame;
use numerics::ramp::Interpolation;
use std::sync::Arc;

use crate::net::{Net, engine, keyed, row};
use crate::nodes::{ADD, BOUNCE, CLOCK, FOLLOW, FROM_START, Probe, SOURCE, SUM};

#[test]
fn a_node_that_no_output_depends_on_is_never_called() {
    let (asked, unasked) = (Probe::new(), Probe::new());
    let mut net = Net::new(1, 3);
    let a = net.add("a", &SOURCE).set("amount", 1.0_f32).done();
    net.add("out", &ADD).set("amount", 2.0_f32).set("probe", asked.number()).wire("points", a).out();
    net.add("aside", &ADD).set("probe", unasked.number()).wire("points", a).done();
    let cooked = net.cook(1..=3);
    assert_eq!(cooked.xs(), [3.0; 3]);
    assert_eq!((asked.count(), unasked.count()), (1, 0));
    assert!(!cooked.node("aside").needed);
}

#[test]
fn a_broken_param_that_no_output_depends_on_is_not_looked_at() {
    let mut net = Net::new(1, 2);
    let a = net.add("a", &SOURCE).out();
    net.add("aside", &ADD).source("amount", keyed(&[(1.0, f32::INFINITY)])).wire("points", a).done();
    let cooked = net.cook(1..=2);
    assert!(cooked.report.errors.is_empty());
    assert_eq!(cooked.xs(), [1.0; 2]);
}

#[test]
fn what_stands_still_is_cooked_once_for_a_hundred_frames() {
    let probe = Probe::new();
    let mut net = Net::new(1, 100);
    let a = net.add("a", &SOURCE).set("amount", 5.0_f32).set("probe", probe.number()).done();
    net.add("b", &CLOCK).wire("points", a).out();
    let cooked = net.cook(1..=100);
    assert_eq!(probe.count(), 1);
    assert_eq!(cooked.cooks("a"), 1);
    assert_eq!(cooked.cooks("b"), 100);
    assert_eq!(cooked.x(1.0), 6.0);
    assert_eq!(cooked.x(100.0), 105.0);
}

#[test]
fn a_frame_node_that_says_it_does_not_read_the_clock_stands_still() {
    let probe = Probe::new();
    let mut net = Net::new(1, 20);
    let a = net.add("a", &SOURCE).done();
    net.add("b", &CLOCK).set("amount", 0.0_f32).set("probe", probe.number()).wire("points", a).out();
    let cooked = net.cook(1..=20);
    assert_eq!(probe.count(), 1);
    assert_eq!(cooked.xs(), [1.0; 20]);
}

#[test]
fn a_held_key_is_cooked_once_while_it_holds() {
    let probe = Probe::new();
    let mut net = Net::new(1, 100);
    let a = net.add("a", &SOURCE).keyed("amount", &[(10.0, 0.0), (12.0, 2.0)]).set("probe", probe.number()).done();
    net.add("b", &ADD).set("amount", 1.0_f32).wire("points", a).out();
    let cooked = net.cook(1..=100);
    // 0 up to frame 10, 1 at 11, 2 from 12 on.
    assert_eq!(probe.count(), 3);
    assert_eq!(cooked.cooks("b"), 3);
    assert_eq!([1.0, 10.0, 11.0, 12.0, 100.0].map(|frame| cooked.x(frame)), [1.0, 1.0, 2.0, 3.0, 3.0]);
}

#[test]
fn a_value_that_comes_back_within_a_slice_is_cooked_once_there() {
    let probe = Probe::new();
    let keys = (1..=8).map(|frame| (f64::from(frame), f32::erase((frame % 2) as f32))).collect();
    let keys = Keyframes { keys, interpolation: Interpolation::Constant };
    let mut net = Net::new(1, 8);
    let source = Source::Keys(Arc::new(keys), f32::shape());
    net.add("a", &SOURCE).source("amount", source).set("probe", probe.number()).out();
    let cooked = net.cook(1..=8);
    assert_eq!(cooked.xs(), [1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
    assert!(probe.count() <= 4, "{}", probe.count());
}

#[test]
fn an_engine_remembers_what_stood_still_from_cook_to_cook() {
    let probe = Probe::new();
    let mut net = Net::new(1, 4);
    let a = net.add("a", &SOURCE).set("probe", probe.number()).done();
    net.add("b", &CLOCK).wire("points", a).out();
    let engine = engine(1, 1 << 30);
    let first = net.cook_in(&engine, 1..=4);
    let second = net.cook_in(&engine, 1..=4);
    assert_eq!(probe.count(), 1);
    assert_eq!(first.bits(), second.bits());
}

#[test]
fn given_geometry_of_another_graph_is_never_mistaken_for_this_ones() {
    let engine = engine(1, 1 << 30);
    for x in 0..8_u8 {
        let x = f32::from(x);
        let mut net = Net::new(1, 1);
        let given = net.still("given", row(&[x]));
        net.add("b", &ADD).wire("points", given).out();
        assert_eq!(net.cook_in(&engine, [1]).x(1.0), x + 1.0);
    }
}

#[test]
fn an_input_read_at_the_start_is_cooked_there_alone() {
    let (rest, now) = (Probe::new(), Probe::new());
    let mut net = Net::new(3, 40);
    let a = net.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let moving = net.add("moving", &CLOCK).set("probe", now.number()).wire("points", a).done();
    let other = net.add("other", &CLOCK).set("amount", 10.0_f32).set("probe", rest.number()).wire("points", a).done();
    net.add("out", &FROM_START).wire("points", moving).wire("rest", other).out();
    let cooked = net.cook(3..=40);
    assert_eq!(rest.frames("cook"), [3.0]);
    assert_eq!(now.count(), 38);
    assert_eq!((cooked.x(3.0), cooked.x(40.0)), (3.0 - 30.0, 40.0 - 30.0));
    // Also where the start itself is not asked.
    assert_eq!(net.cook([7]).x(7.0), 7.0 - 30.0);
}

#[test]
fn wires_of_a_list_come_in_document_order_and_a_node_may_be_wired_twice() {
    let mut net = Net::new(1, 2);
    let a = net.add("a", &SOURCE).set("amount", 1.0_f32).done();
    let b = net.add("b", &CLOCK).set("amount", 10.0_f32).wire("points", a).done();
    net.add("sum", &SUM).wire("points", a).wire("points", b).wire("points", a).out();
    assert_eq!(net.cook(1..=2).xs(), [1.0 + 11.0 + 1.0, 1.0 + 21.0 + 1.0]);
}

#[test]
fn frames_asked_twice_or_in_any_order_are_cooked_once_and_delivered_oldest_first() {
    let probe = Probe::new();
    let mut net = Net::new(1, 9);
    let a = net.add("a", &SOURCE).done();
    net.add("b", &CLOCK).set("probe", probe.number()).wire("points", a).out();
    let cooked = net.cook([5, 2, 9, 2, 5]);
    assert_eq!(cooked.xs(), [3.0, 6.0, 10.0]);
    let mut frames = probe.frames("cook");
    frames.sort_by(f64::total_cmp);
    assert_eq!(frames, [2.0, 5.0, 9.0]);
}

#[test]
fn stateless_graphs_cook_outside_the_scene_and_between_frames() {
    let mut net = Net::new(1, 4);
    let a = net.add("a", &SOURCE).set("amount", 0.0_f32).done();
    net.add("b", &CLOCK).wire("points", a).out();
    let frames = [-3.0, 0.0, 2.5, 99.0].map(crate::net::at);
    let cooked = net.cook_with(&engine(2, 1 << 30), &frames, None);
    assert_eq!(cooked.xs(), [-3.0, 0.0, 2.5, 99.0]);
}

#[test]
fn a_rehearsal_counts_what_a_cook_does() {
    let mut net = Net::new(1, 50);
    let a = net.add("a", &SOURCE).done();
    let clock = net.add("clock", &CLOCK).wire("points", a).done();
    let add = net.add("add", &ADD).keyed("amount", &[(1.0, 0.0), (8.0, 1.0)]).wire("points", a).done();
    let follow = net.add("follow", &FOLLOW).set("frames", 11_i64).wire("points", clock).done();
    let again = net.add("again", &FOLLOW).set("frames", 5_i64).wire("points", follow).done();
    let start = net.add("start", &FROM_START).wire("points", add).wire("rest", clock).done();
    let bounce = net.add("bounce", &BOUNCE).wire("points", start).wire("floor", clock).done();
    net.add("sum", &SUM).wire("points", again).wire("points", bounce).out();
    for frames in [(1..=50).collect(), vec![37], vec![20, 49], (-3..10).collect::<Vec<i64>>()] {
        let engine = engine(2, 1 << 30);
        let request = Request { outputs: vec![0], frames: frames.iter().copied().map(Frame::whole).collect() };
        let rehearsed = engine.rehearse(&net.0, &request).unwrap_or_else(|error| panic!("{error}"));
        let cooked = net.cook_in(&engine, frames.iter().copied());
        for (rehearsed, cooked) in rehearsed.nodes.iter().zip(&cooked.report.nodes) {
            assert_eq!(rehearsed.cooks, cooked.cooks, "{:?} at {frames:?}", cooked.id);
        }
    }
}
