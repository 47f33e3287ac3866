//! Errors are caught, name node and frame, and affect only what depends on them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use engine::cook::{Delivered, Stopped};
use engine::error::ErrorKind;
use engine::plan::Request;

use crate::builder::{Cooked, TestGraph, bits, engine, keyed, row};
use crate::nodes::{ADD, BOUNCE, CLOCK, FAIL, FOLLOW, SOURCE};

/// A node that fails in the way `how` at frame 3 of 6, and one beside it that does not fail.
fn failing(how: i64) -> Cooked {
    let mut graph = TestGraph::new(1, 6);
    let a = graph.add("a", &SOURCE).set("count", 2_i64).done();
    let bad = graph.add("bad", &FAIL).set("how", how).wire("points", a).done();
    graph.add("after", &ADD).wire("points", bad).out();
    graph.add("sound", &CLOCK).wire("points", a).out();
    crate::builder::quietly(|| graph.cook(1..=6))
}

fn frames(cooked: &Cooked, output: usize) -> Vec<f64> {
    cooked.found.keys().filter(|(index, _)| *index == output).map(|(_, frame)| frame.number()).collect()
}

#[test]
fn an_error_names_node_and_frame_and_everything_else_is_cooked() {
    let hint = "this is a bug in convect; please report it with the graph";
    let cases = [
        (1, ErrorKind::Panic, format!("it failed unexpectedly: all is lost; {hint}")),
        (
            2,
            ErrorKind::NotFinite,
            "`P` of point 1 of the points is NaN or infinite; a param of the node is too large or too small, or a number \
             in its inputs"
                .into(),
        ),
        (3, ErrorKind::Refused, "there is no such frame; ask for another".into()),
        (4, ErrorKind::Contract, format!("it returns no `points`; {hint}")),
    ];
    for (how, kind, text) in cases {
        let cooked = failing(how);
        assert_eq!(cooked.error(), format!("`bad` (Fail) at frame 3: {text}"));
        assert_eq!(cooked.report.errors.len(), 1);
        assert_eq!((cooked.report.errors[0].0, cooked.report.errors[0].2), (0, 1), "one frame of the first output");
        assert_eq!(cooked.report.errors[0].1.error.kind, kind);
        assert_eq!(frames(&cooked, 0), [1.0, 2.0, 4.0, 5.0, 6.0]);
        assert_eq!(frames(&cooked, 1), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(cooked.cooks("bad"), 6, "the failed call is counted");
        assert_eq!(cooked.cooks("after"), 5, "not called without its input");
    }
}

#[test]
fn an_animated_param_is_refused_at_the_frame_at_which_it_becomes_illegal() {
    let mut graph = TestGraph::new(1, 10);
    let a = graph.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (10.0, 9.0)]).done();
    graph.add("follow", &FOLLOW).source("rate", keyed(&[(5.0, 0.5), (10.0, 1.5)])).wire("points", a).out();
    let cooked = graph.cook(1..=10);
    // `rate` is 0.9 at frame 7 and 1.1 at 8. Anchors are at 1 and 9, and the state of the segment from 9 passes through
    // 8.
    assert_eq!(frames(&cooked, 0), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    assert_eq!(cooked.error(), "`follow` (Follow) at frame 8: `rate` is 1.1; expected 0…1");
}

#[test]
fn a_solver_stops_at_the_frame_at_which_it_fails() {
    let mut graph = TestGraph::new(1, 10);
    let a = graph.add("a", &SOURCE).done();
    let bad = graph.add("bad", &FAIL).set("how", 3_i64).set("at", 5_i64).wire("points", a).done();
    graph.add("bounce", &BOUNCE).set("samples", 1_i64).wire("points", a).wire("push", bad).out();
    let cooked = graph.cook(1..=10);
    assert_eq!(frames(&cooked, 0), [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(cooked.report.errors[0].2, 6);
    assert_eq!(cooked.cooks("bounce"), 4, "one start and three steps");
}

#[test]
fn geometry_of_the_calling_program_is_checked_too() {
    let mut graph = TestGraph::new(1, 3);
    let given = graph.given("given", |frame| row(&[0.0, if frame.number() == 2.0 { f32::INFINITY } else { 1.0 }]));
    graph.add("add", &ADD).wire("points", given).out();
    let cooked = graph.cook(1..=3);
    assert_eq!(frames(&cooked, 0), [1.0, 3.0]);
    assert_eq!(cooked.error(), "`given` (given) at frame 2: `P` of point 1 of the points is NaN or infinite");
}

/// Stateless, window and solver nodes that read geometry which cancels the cook when frame `at` is requested.
fn cancelling(at: i64, cancel: &Arc<AtomicBool>) -> TestGraph {
    let mut graph = TestGraph::new(1, 200);
    let cancel = cancel.clone();
    let given = graph.given("given", move |frame| {
        if frame.floor_number() == at {
            cancel.store(true, Ordering::Relaxed);
        }
        row(&[frame.number() as f32 * 0.1, 2.0])
    });
    let follow = graph.add("follow", &FOLLOW).wire("points", given).done();
    graph.output(follow);
    graph.add("bounce", &BOUNCE).wire("points", given).wire("floor", follow).out();
    graph
}

#[test]
fn a_cancelled_cook_delivers_only_complete_frames() {
    let never = Arc::new(AtomicBool::new(false));
    let whole = cancelling(-1, &never).cook(1..=60).bits();
    for at in [1, 7, 16, 17, 31, 44] {
        let cancel = Arc::new(AtomicBool::new(false));
        let graph = cancelling(at, &cancel);
        let request = Request { outputs: vec![0, 1], frames: (1..=60).map(engine::time::Frame::whole).collect() };
        let mut found = Vec::new();
        let mut sink = |finished: &[Delivered]| -> Result<(), std::convert::Infallible> {
            found.extend(finished.iter().cloned());
            Ok(())
        };
        let report = engine(2, 1 << 30).cook(&graph.0, &request, None, &cancel, &mut sink);
        let report = report.unwrap_or_else(|stopped| panic!("{stopped:?}"));
        assert!(report.cancelled && report.errors.is_empty(), "cancelled at {at}: {:?}", report.errors);
        assert!(found.len() < 2 * at as usize, "cancelled at {at}: {}", found.len());
        for delivered in found {
            assert_eq!(whole[&(delivered.output, delivered.frame)], bits(&delivered.geometry));
        }
    }
}

#[test]
fn an_error_of_the_sink_ends_the_cook() {
    let graph = cancelling(-1, &Arc::default());
    let request = Request { outputs: vec![0], frames: (1..=60).map(engine::time::Frame::whole).collect() };
    let mut calls = 0;
    let mut sink = |_: &[Delivered]| {
        calls += 1;
        if calls == 2 { Err("the disk is full") } else { Ok(()) }
    };
    let stopped = engine(2, 1 << 30).cook(&graph.0, &request, None, &AtomicBool::new(false), &mut sink);
    assert!(matches!(stopped, Err(Stopped::Sink("the disk is full"))));
    assert_eq!(calls, 2);
}
