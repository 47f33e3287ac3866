//! A key depends on exactly what its node reads, at the times at which it is read.

use engine::graph::{Body, Scene};
use engine::key::ContentKey;
use engine::param::{ParamType, Source};
use engine::plan::result_keys;

use crate::builder::{TestGraph, at, keyed};
use crate::nodes::{ADD, BOUNCE, CLOCK, DRIFT, FOLLOW, FROM_START, SOURCE, SUM};

fn key(graph: &TestGraph, node: &str, frame: f64) -> ContentKey {
    result_keys(&graph.0, node, &[at(frame)]).unwrap_or_else(|error| panic!("{error}"))[0]
}

fn constant<T: ParamType<Value = T>>(value: T) -> Source {
    Source::Constant(T::erase(value))
}

/// A row of the table: a change, and the frames at which it does or does not change the key of a node.
struct Row {
    what: &'static str,
    node: &'static str,
    changed: TestGraph,
    differs: &'static [f64],
    same: &'static [f64],
}

fn check(graph: &TestGraph, rows: Vec<Row>) {
    for Row { what, node, changed, differs, same } in rows {
        for (frames, differ) in [(differs, true), (same, false)] {
            for frame in frames {
                let equal = key(graph, node, *frame) == key(&changed, node, *frame);
                assert_eq!(equal, !differ, "{what}: the key of `{node}` at frame {frame}");
            }
        }
    }
}

fn stateless() -> TestGraph {
    let mut graph = TestGraph::new(1, 48);
    let a = graph.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (10.0, 9.0)]).done();
    let b = graph.add("b", &ADD).wire("points", a).done();
    let c = graph.add("c", &CLOCK).wire("points", b).done();
    graph.add("d", &FROM_START).wire("points", c).wire("rest", a).out();
    graph
}

#[test]
fn the_key_of_a_stateless_node_depends_only_on_what_it_reads_at_that_frame() {
    let graph = stateless();
    let later = keyed(&[(1.0, 0.0), (10.0, 9.0), (20.0, 0.0)]);
    let earlier = keyed(&[(1.0, -9.0), (10.0, 9.0)]);
    let rows = vec![
        Row {
            what: "a keyframe after the frame",
            node: "b",
            changed: graph.clone().with("a", "amount", later),
            differs: &[10.5, 15.0, 40.0],
            same: &[-3.0, 1.0, 5.0, 10.0],
        },
        Row {
            what: "a keyframe before the frame",
            node: "b",
            changed: graph.clone().with("a", "amount", earlier.clone()),
            differs: &[-3.0, 1.0, 5.0],
            same: &[10.0, 40.0],
        },
        Row {
            what: "an input that is read at the start, changed at the start",
            node: "d",
            changed: graph.clone().with("a", "amount", earlier),
            differs: &[1.0, 10.0, 40.0],
            same: &[],
        },
        Row {
            what: "an input that is read at the start, changed later",
            node: "d",
            changed: graph.clone().with("a", "amount", keyed(&[(1.0, 0.0), (10.0, 9.0), (20.0, 0.0)])),
            differs: &[15.0],
            same: &[1.0, 10.0],
        },
        Row {
            what: "a param that is not read because of another",
            node: "b",
            changed: graph.clone().with("b", "more", constant(5.0_f32)),
            differs: &[],
            same: &[1.0, 10.0],
        },
        Row {
            what: "a param that is read",
            node: "b",
            changed: graph.clone().with("b", "amount", constant(5.0_f32)),
            differs: &[1.0, 10.0],
            same: &[],
        },
    ];
    check(&graph, rows);
}

#[test]
fn a_param_matters_when_another_makes_it_read() {
    let graph = stateless().with("b", "twice", constant(true));
    let changed = graph.clone().with("b", "more", constant(5.0_f32));
    assert_ne!(key(&graph, "b", 1.0), key(&changed, "b", 1.0));
}

#[test]
fn frames_and_frame_rate_matter_only_if_the_clock_is_read() {
    let graph = stateless();
    let mut faster = graph.clone();
    faster.0.scene = Scene { fps: 30.0, ..graph.0.scene.clone() };
    assert_eq!(key(&graph, "b", 12.0), key(&graph, "b", 13.0), "constant from frame 10 on");
    assert_ne!(key(&graph, "c", 12.0), key(&graph, "c", 13.0));
    assert_eq!(key(&graph, "b", 12.0), key(&faster, "b", 12.0));
    assert_ne!(key(&graph, "c", 12.0), key(&faster, "c", 12.0));
    let off = graph.clone().with("c", "amount", constant(0.0_f32));
    let mut off_faster = off.clone();
    off_faster.0.scene.fps = 30.0;
    assert_eq!(key(&off, "c", 12.0), key(&off, "c", 13.0));
    assert_eq!(key(&off, "c", 12.0), key(&off_faster, "c", 12.0));
}

#[test]
fn a_nodes_id_and_index_do_not_matter() {
    let mut graph = TestGraph::new(1, 3);
    let a = graph.add("a", &SOURCE).done();
    graph.add("one", &ADD).wire("points", a).out();
    graph.add("two", &ADD).wire("points", a).out();
    assert_eq!(key(&graph, "one", 2.0), key(&graph, "two", 2.0));
}

#[test]
fn the_order_and_the_input_of_wires_matter() {
    let graph = |first: usize, second: usize| {
        let mut graph = TestGraph::new(1, 3);
        let sources = [1.0_f32, 2.0].map(|x| (if x < 2.0 { "a" } else { "b" }, x));
        let links = sources.map(|(id, x)| graph.add(id, &SOURCE).set("amount", x).done());
        graph.add("sum", &SUM).wire("points", links[first]).wire("points", links[second]).out();
        graph
    };
    assert_ne!(key(&graph(0, 1), "sum", 1.0), key(&graph(1, 0), "sum", 1.0));
    let bounce = |input: &str| {
        let mut graph = TestGraph::new(1, 3);
        let a = graph.add("a", &SOURCE).done();
        graph.add("bounce", &BOUNCE).set("samples", 1_i64).wire("points", a).wire(input, a).out();
        graph
    };
    assert_ne!(key(&bounce("floor"), "bounce", 1.0), key(&bounce("push"), "bounce", 1.0));
}

#[test]
fn the_past_of_an_integrand_matters_and_its_future_does_not() {
    let graph = |first: i64, speed: &[(f64, f32)]| {
        let mut graph = TestGraph::new(first, 48);
        let a = graph.add("a", &SOURCE).done();
        graph.add("drift", &DRIFT).keyed("speed", speed).wire("points", a).out();
        graph
    };
    let base = graph(1, &[(0.0, 1.0), (10.0, 2.0), (20.0, 1.0)]);
    let rows = vec![
        Row {
            what: "the speed from frame 10 to 20",
            node: "drift",
            changed: graph(1, &[(0.0, 1.0), (10.0, 2.0), (20.0, 3.0)]),
            differs: &[11.0, 15.5, 20.0, 40.0],
            same: &[0.0, 1.0, 10.0],
        },
        Row {
            what: "the speed before frame 10",
            node: "drift",
            changed: graph(1, &[(0.0, 0.0), (10.0, 2.0), (20.0, 1.0)]),
            differs: &[0.0, 1.0, 9.5, 10.0, 40.0],
            same: &[],
        },
        Row {
            what: "the speed before time 0, and before the scene",
            node: "drift",
            changed: graph(1, &[(-20.0, 5.0), (-1.0, 1.0), (0.0, 1.0), (10.0, 2.0), (20.0, 1.0)]),
            differs: &[],
            same: &[0.0, 1.0, 9.5, 10.0, 40.0],
        },
    ];
    check(&base, rows);
    // In a scene that starts before time 0, the past starts there.
    let early = graph(-10, &[(-10.0, 1.0), (10.0, 2.0)]);
    let changed = graph(-10, &[(-10.0, 1.0), (-5.0, 4.0), (0.0, 1.5), (10.0, 2.0)]);
    for frame in [-7.0, -2.5, 5.0] {
        assert_ne!(key(&early, "drift", frame), key(&changed, "drift", frame), "frame {frame}");
    }
}

#[test]
fn a_key_does_not_depend_on_previous_requests() {
    let mut graph = TestGraph::new(-8, 48);
    let a = graph.add("a", &SOURCE).done();
    let drift = graph.add("drift", &DRIFT).keyed("speed", &[(-8.0, 1.0), (10.0, 2.0)]).wire("points", a).done();
    let follow = graph.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", drift).done();
    graph.add("again", &FOLLOW).set("frames", 5_i64).wire("points", follow).out();
    let frames = [-5.0, -2.5, 0.0, 7.0, 3.0, 7.5, 30.25, 12.0].map(at);
    for node in ["drift", "follow", "again"] {
        let together = result_keys(&graph.0, node, &frames).unwrap_or_else(|error| panic!("{error}"));
        for (frame, together) in frames.iter().zip(together) {
            assert_eq!(key(&graph, node, frame.number()), together, "{node} at {frame}");
        }
    }
}

#[test]
fn a_window_depends_on_inputs_since_its_anchor_and_a_solver_since_its_start() {
    let mut graph = TestGraph::new(1, 48);
    // Keyframed at every frame, so that changing one key has only a local effect.
    let dent = |dent: i32| {
        let at = |frame: i32| (f64::from(frame), if frame == dent { -1.0 } else { frame as f32 });
        keyed(&(1..=40).map(at).collect::<Vec<_>>())
    };
    let a = graph.add("a", &SOURCE).source("amount", dent(0)).done();
    let floor = graph.add("floor", &SOURCE).source("amount", dent(0)).done();
    let follow = graph.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", a).done();
    let bounce = graph.add("bounce", &BOUNCE).wire("points", a).wire("floor", floor).done();
    graph.add("sum", &SUM).wire("points", follow).wire("points", bounce).out();
    // Anchors are at 1, 9, 17, …; the state of segment 17…24 starts at 14.
    let rows = vec![
        Row {
            what: "an input before the window",
            node: "follow",
            changed: graph.clone().with("a", "amount", dent(8)),
            differs: &[8.0, 13.0],
            same: &[1.0, 7.0, 17.0, 20.0, 24.0],
        },
        Row {
            what: "an input after the frame",
            node: "follow",
            changed: graph.clone().with("a", "amount", dent(22)),
            differs: &[22.0, 23.0, 24.0],
            same: &[17.0, 20.0, 21.0],
        },
        Row {
            what: "an input that a solver reads only at its start",
            node: "bounce",
            changed: graph.clone().with("a", "amount", dent(8)),
            differs: &[],
            same: &[1.0, 8.0, 20.0],
        },
        Row {
            what: "an input that a solver reads within its steps",
            node: "bounce",
            changed: graph.clone().with("floor", "amount", dent(11)),
            differs: &[11.0, 12.0, 40.0],
            same: &[1.0, 10.0],
        },
    ];
    check(&graph, rows);
}

#[test]
fn a_solver_depends_only_on_the_times_that_it_samples() {
    let graph = |samples: i64, floor: Source| {
        let mut graph = TestGraph::new(1, 9);
        let a = graph.add("a", &SOURCE).done();
        let floor = graph.add("floor", &SOURCE).source("amount", floor).done();
        graph.add("bounce", &BOUNCE).set("samples", samples).wire("points", a).wire("floor", floor).out();
        graph
    };
    let flat = || keyed(&[(1.0, 0.0), (9.0, 0.0), (10.0, 1.0)]);
    let spike = || keyed(&[(1.0, 0.0), (5.0, 0.0), (5.25, 1.0), (5.5, 0.0), (9.0, 0.0), (10.0, 1.0)]);
    for (samples, seen) in [(4, true), (2, false), (1, false)] {
        let differ = key(&graph(samples, flat()), "bounce", 6.0) != key(&graph(samples, spike()), "bounce", 6.0);
        assert_eq!(differ, seen, "{samples} samples per step");
    }
}

#[test]
fn a_nodes_version_matters() {
    static NEWER: engine::node::Node = engine::node::Node { version: 2, ..SOURCE_COPY };
    const SOURCE_COPY: engine::node::Node =
        engine::node::Node::new("Source", 1, "Points.", engine::node::Cook::Pure(|_| Ok(Default::default())));
    static OLDER: engine::node::Node = SOURCE_COPY;
    let graph = |node: &'static engine::node::Node| {
        let mut graph = TestGraph::new(1, 1);
        graph.add("a", node).done();
        let Body::Node { .. } = &graph.0.nodes[0].body else { panic!("a node") };
        let link = engine::graph::Link { node: 0, port: 0 };
        graph.output(link);
        graph
    };
    assert_ne!(key(&graph(&OLDER), "a", 1.0), key(&graph(&NEWER), "a", 1.0));
}
