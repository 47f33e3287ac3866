//! A key hangs on exactly what its node reads, at the times at which it reads it.

use engine::graph::{Body, Scene};
use engine::key::ContentKey;
use engine::param::{ParamType, Source};
use engine::plan::result_keys;

use crate::net::{Net, at, keyed};
use crate::nodes::{ADD, BOUNCE, CLOCK, DRIFT, FOLLOW, FROM_START, SOURCE, SUM};

fn key(net: &Net, node: &str, frame: f64) -> ContentKey {
    result_keys(&net.0, node, &[at(frame)]).unwrap_or_else(|error| panic!("{error}"))[0]
}

fn constant<T: ParamType<Value = T>>(value: T) -> Source {
    Source::Constant(T::erase(value))
}

/// A row of the table: what is changed, and at which frames the key of which node changes by it.
struct Row {
    what: &'static str,
    node: &'static str,
    changed: Net,
    differs: &'static [f64],
    same: &'static [f64],
}

fn check(net: &Net, rows: Vec<Row>) {
    for Row { what, node, changed, differs, same } in rows {
        for (frames, differ) in [(differs, true), (same, false)] {
            for frame in frames {
                let equal = key(net, node, *frame) == key(&changed, node, *frame);
                assert_eq!(equal, !differ, "{what}: the key of `{node}` at frame {frame}");
            }
        }
    }
}

fn stateless() -> Net {
    let mut net = Net::new(1, 48);
    let a = net.add("a", &SOURCE).keyed("amount", &[(1.0, 0.0), (10.0, 9.0)]).done();
    let b = net.add("b", &ADD).wire("points", a).done();
    let c = net.add("c", &CLOCK).wire("points", b).done();
    net.add("d", &FROM_START).wire("points", c).wire("rest", a).out();
    net
}

#[test]
fn what_a_stateless_node_reads_at_a_frame_is_all_its_key_knows() {
    let net = stateless();
    let later = keyed(&[(1.0, 0.0), (10.0, 9.0), (20.0, 0.0)]);
    let earlier = keyed(&[(1.0, -9.0), (10.0, 9.0)]);
    let rows = vec![
        Row {
            what: "a key frame after f",
            node: "b",
            changed: net.clone().with("a", "amount", later),
            differs: &[10.5, 15.0, 40.0],
            same: &[-3.0, 1.0, 5.0, 10.0],
        },
        Row {
            what: "a key frame before f",
            node: "b",
            changed: net.clone().with("a", "amount", earlier.clone()),
            differs: &[-3.0, 1.0, 5.0],
            same: &[10.0, 40.0],
        },
        Row {
            what: "an input read at the start, as it is there",
            node: "d",
            changed: net.clone().with("a", "amount", earlier),
            differs: &[1.0, 10.0, 40.0],
            same: &[],
        },
        Row {
            what: "an input read at the start, as it is later",
            node: "d",
            changed: net.clone().with("a", "amount", keyed(&[(1.0, 0.0), (10.0, 9.0), (20.0, 0.0)])),
            differs: &[15.0],
            same: &[1.0, 10.0],
        },
        Row {
            what: "a param that another says is not read",
            node: "b",
            changed: net.clone().with("b", "more", constant(5.0_f32)),
            differs: &[],
            same: &[1.0, 10.0],
        },
        Row {
            what: "a param that nothing says is not read",
            node: "b",
            changed: net.clone().with("b", "amount", constant(5.0_f32)),
            differs: &[1.0, 10.0],
            same: &[],
        },
    ];
    check(&net, rows);
}

#[test]
fn a_param_counts_once_another_says_it_is_read() {
    let net = stateless().with("b", "twice", constant(true));
    let changed = net.clone().with("b", "more", constant(5.0_f32));
    assert_ne!(key(&net, "b", 1.0), key(&changed, "b", 1.0));
}

#[test]
fn frames_and_frame_rate_count_where_the_clock_is_read() {
    let net = stateless();
    let mut faster = net.clone();
    faster.0.scene = Scene { fps: 30.0, ..net.0.scene.clone() };
    assert_eq!(key(&net, "b", 12.0), key(&net, "b", 13.0), "held from frame 10 on");
    assert_ne!(key(&net, "c", 12.0), key(&net, "c", 13.0));
    assert_eq!(key(&net, "b", 12.0), key(&faster, "b", 12.0));
    assert_ne!(key(&net, "c", 12.0), key(&faster, "c", 12.0));
    let off = net.clone().with("c", "amount", constant(0.0_f32));
    let mut off_faster = off.clone();
    off_faster.0.scene.fps = 30.0;
    assert_eq!(key(&off, "c", 12.0), key(&off, "c", 13.0));
    assert_eq!(key(&off, "c", 12.0), key(&off_faster, "c", 12.0));
}

#[test]
fn a_nodes_id_and_place_do_not_count() {
    let mut net = Net::new(1, 3);
    let a = net.add("a", &SOURCE).done();
    net.add("one", &ADD).wire("points", a).out();
    net.add("two", &ADD).wire("points", a).out();
    assert_eq!(key(&net, "one", 2.0), key(&net, "two", 2.0));
}

#[test]
fn wires_count_in_their_order_and_by_their_input() {
    let net = |first: usize, second: usize| {
        let mut net = Net::new(1, 3);
        let sources = [1.0_f32, 2.0].map(|x| (if x < 2.0 { "a" } else { "b" }, x));
        let links = sources.map(|(id, x)| net.add(id, &SOURCE).set("amount", x).done());
        net.add("sum", &SUM).wire("points", links[first]).wire("points", links[second]).out();
        net
    };
    assert_ne!(key(&net(0, 1), "sum", 1.0), key(&net(1, 0), "sum", 1.0));
    let bounce = |input: &str| {
        let mut net = Net::new(1, 3);
        let a = net.add("a", &SOURCE).done();
        net.add("bounce", &BOUNCE).set("samples", 1_i64).wire("points", a).wire(input, a).out();
        net
    };
    assert_ne!(key(&bounce("floor"), "bounce", 1.0), key(&bounce("push"), "bounce", 1.0));
}

#[test]
fn the_past_of_an_integrand_counts_and_its_future_does_not() {
    let net = |first: i64, speed: &[(f64, f32)]| {
        let mut net = Net::new(first, 48);
        let a = net.add("a", &SOURCE).done();
        net.add("drift", &DRIFT).keyed("speed", speed).wire("points", a).out();
        net
    };
    let base = net(1, &[(0.0, 1.0), (10.0, 2.0), (20.0, 1.0)]);
    let rows = vec![
        Row {
            what: "the speed from frame 10 to 20",
            node: "drift",
            changed: net(1, &[(0.0, 1.0), (10.0, 2.0), (20.0, 3.0)]),
            differs: &[11.0, 15.5, 20.0, 40.0],
            same: &[0.0, 1.0, 10.0],
        },
        Row {
            what: "the speed before frame 10",
            node: "drift",
            changed: net(1, &[(0.0, 0.0), (10.0, 2.0), (20.0, 1.0)]),
            differs: &[0.0, 1.0, 9.5, 10.0, 40.0],
            same: &[],
        },
        Row {
            what: "the speed before time 0, and before the scene",
            node: "drift",
            changed: net(1, &[(-20.0, 5.0), (-1.0, 1.0), (0.0, 1.0), (10.0, 2.0), (20.0, 1.0)]),
            differs: &[],
            same: &[0.0, 1.0, 9.5, 10.0, 40.0],
        },
    ];
    check(&base, rows);
    // A scene that starts before time 0 has its past there.
    let early = net(-10, &[(-10.0, 1.0), (10.0, 2.0)]);
    let changed = net(-10, &[(-10.0, 1.0), (-5.0, 4.0), (0.0, 1.5), (10.0, 2.0)]);
    for frame in [-7.0, -2.5, 5.0] {
        assert_ne!(key(&early, "drift", frame), key(&changed, "drift", frame), "frame {frame}");
    }
}

#[test]
fn a_key_does_not_hang_on_which_frames_were_asked_before() {
    let mut net = Net::new(-8, 48);
    let a = net.add("a", &SOURCE).done();
    let drift = net.add("drift", &DRIFT).keyed("speed", &[(-8.0, 1.0), (10.0, 2.0)]).wire("points", a).done();
    let follow = net.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", drift).done();
    net.add("again", &FOLLOW).set("frames", 5_i64).wire("points", follow).out();
    let frames = [-5.0, -2.5, 0.0, 7.0, 3.0, 7.5, 30.25, 12.0].map(at);
    for node in ["drift", "follow", "again"] {
        let together = result_keys(&net.0, node, &frames).unwrap_or_else(|error| panic!("{error}"));
        for (frame, together) in frames.iter().zip(together) {
            assert_eq!(key(&net, node, frame.number()), together, "{node} at {frame}");
        }
    }
}

#[test]
fn a_window_counts_from_its_anchor_and_a_solver_from_its_start() {
    let mut net = Net::new(1, 48);
    // Keyed at every frame, so that one key more or less changes what lies beside it alone.
    let dent = |dent: i32| {
        let at = |frame: i32| (f64::from(frame), if frame == dent { -1.0 } else { frame as f32 });
        keyed(&(1..=40).map(at).collect::<Vec<_>>())
    };
    let a = net.add("a", &SOURCE).source("amount", dent(0)).done();
    let floor = net.add("floor", &SOURCE).source("amount", dent(0)).done();
    let follow = net.add("follow", &FOLLOW).set("frames", 3_i64).wire("points", a).done();
    let bounce = net.add("bounce", &BOUNCE).wire("points", a).wire("floor", floor).done();
    net.add("sum", &SUM).wire("points", follow).wire("points", bounce).out();
    // Anchors stand at 1, 9, 17, …; the state of 17…24 starts at 14.
    let rows = vec![
        Row {
            what: "an input before the window",
            node: "follow",
            changed: net.clone().with("a", "amount", dent(8)),
            differs: &[8.0, 13.0],
            same: &[1.0, 7.0, 17.0, 20.0, 24.0],
        },
        Row {
            what: "an input after the frame",
            node: "follow",
            changed: net.clone().with("a", "amount", dent(22)),
            differs: &[22.0, 23.0, 24.0],
            same: &[17.0, 20.0, 21.0],
        },
        Row {
            what: "an input that a solver reads at its start alone",
            node: "bounce",
            changed: net.clone().with("a", "amount", dent(8)),
            differs: &[],
            same: &[1.0, 8.0, 20.0],
        },
        Row {
            what: "an input that a solver reads within its steps",
            node: "bounce",
            changed: net.clone().with("floor", "amount", dent(11)),
            differs: &[11.0, 12.0, 40.0],
            same: &[1.0, 10.0],
        },
    ];
    check(&net, rows);
}

#[test]
fn a_solver_counts_its_samples_within_the_step_and_no_other_times() {
    let net = |samples: i64, floor: Source| {
        let mut net = Net::new(1, 9);
        let a = net.add("a", &SOURCE).done();
        let floor = net.add("floor", &SOURCE).source("amount", floor).done();
        net.add("bounce", &BOUNCE).set("samples", samples).wire("points", a).wire("floor", floor).out();
        net
    };
    let flat = || keyed(&[(1.0, 0.0), (9.0, 0.0), (10.0, 1.0)]);
    let spike = || keyed(&[(1.0, 0.0), (5.0, 0.0), (5.25, 1.0), (5.5, 0.0), (9.0, 0.0), (10.0, 1.0)]);
    for (samples, seen) in [(4, true), (2, false), (1, false)] {
        let differ = key(&net(samples, flat()), "bounce", 6.0) != key(&net(samples, spike()), "bounce", 6.0);
        assert_eq!(differ, seen, "{samples} samples a step");
    }
}

#[test]
fn a_nodes_version_counts() {
    static NEWER: engine::node::Node = engine::node::Node { version: 2, ..SOURCE_COPY };
    const SOURCE_COPY: engine::node::Node =
        engine::node::Node::new("Source", 1, "Points.", engine::node::Cook::Pure(|_| Ok(Default::default())));
    static OLDER: engine::node::Node = SOURCE_COPY;
    let net = |node: &'static engine::node::Node| {
        let mut net = Net::new(1, 1);
        net.add("a", node).done();
        let Body::Node { .. } = &net.0.nodes[0].body else { panic!("a node") };
        let link = engine::graph::Link { node: 0, port: 0 };
        net.output(link);
        net
    };
    assert_ne!(key(&net(&OLDER), "a", 1.0), key(&net(&NEWER), "a", 1.0));
}
