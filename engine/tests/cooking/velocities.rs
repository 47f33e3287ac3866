//! Velocities of outputs whose node does not compute any.

use engine::geometry::{Geometry, ID, Kind, V};
use engine::time::Frame;

use crate::builder::{Cooked, TestGraph, at, engine, row};
use crate::nodes::{ADD, BOUNCE, CLOCK, FOLLOW, SOURCE};

/// x = f².
fn squares() -> TestGraph {
    let mut graph = TestGraph::new(1, 10);
    let a = graph.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let clock = graph.add("clock", &CLOCK).keyed("amount", &[(0.0, 0.0), (20.0, 20.0)]).wire("points", a).done();
    graph.output(clock).v = true;
    graph
}

fn v(cooked: &Cooked, frame: f64) -> f32 {
    cooked.geometry(frame).points().and_then(|points| points.get(V)).expect("velocities")[0][0]
}

#[test]
fn velocities_are_central_differences_within_the_scene_and_one_sided_at_its_ends() {
    let cooked = squares().cook(1..=10);
    // d(f²)/df = 2f per frame, at 24 frames per second; one-sided: (1.5² − 1)/½ and (100 − 9.5²)/½.
    assert_eq!(v(&cooked, 5.0), 240.0);
    assert_eq!(v(&cooked, 1.0), 2.5 * 24.0);
    assert_eq!(v(&cooked, 10.0), 19.5 * 24.0);
    assert_eq!(cooked.x(5.0), 25.0);
}

#[test]
fn static_geometry_has_velocity_zero() {
    let mut graph = TestGraph::new(1, 4);
    let a = graph.add("a", &SOURCE).done();
    graph.output(a).v = true;
    let cooked = graph.cook(1..=4);
    assert_eq!([1.0, 2.0, 4.0].map(|frame| v(&cooked, frame)), [0.0; 3]);
}

#[test]
fn in_a_scene_of_one_frame_the_difference_is_forward() {
    let mut graph = squares();
    graph.0.scene.last = 1;
    assert_eq!(v(&graph.cook([1]), 1.0), 2.5 * 24.0);
}

#[test]
fn velocities_do_not_depend_on_which_frames_are_requested() {
    let mut graph = squares();
    graph.0.outputs.clear();
    let clock = engine::graph::Link { node: graph.index("clock"), port: 0 };
    let follow = graph.add("follow", &FOLLOW).wire("points", clock).done();
    graph.output(follow).v = true;
    let together = graph.cook(1..=10);
    for frame in [1.0, 2.0, 5.0, 9.0, 10.0] {
        let alone = graph.cook_with(&engine(1, 1 << 30), &[at(frame)], None);
        assert_eq!(v(&alone, frame).to_bits(), v(&together, frame).to_bits(), "frame {frame}");
    }
}

/// With this little memory a slice has one frame; what comes half a frame after it is kept for the next.
#[test]
fn what_a_velocity_reads_is_cooked_once() {
    // In quarters 0.75 and 10.25 are read, too.
    for (step, calls) in [(1.0, 19), (0.5, 19), (0.25, 39)] {
        let frames: Vec<Frame> = (0..).map(|k| at(1.0 + step * f64::from(k))).take_while(|f| *f <= at(10.0)).collect();
        let cooked = squares().cook_with(&engine(1, 2048), &frames, None);
        assert_eq!(cooked.cooks("clock"), calls, "every {step} frames");
        assert_eq!(v(&cooked, 5.0), 240.0);
    }
}

/// Symplectic Euler: x = 10 − g dt² n(n + 1)/2 after n steps, whose difference over two frames is −g dt (n + ½).
#[test]
fn what_comes_from_a_solver_has_the_difference_over_whole_frames() {
    for downstream in [false, true] {
        let mut graph = TestGraph::new(1, 25);
        let a = graph.add("a", &SOURCE).set("amount", 10.0_f32).done();
        let mut last = graph.add("bounce", &BOUNCE).set("samples", 1_i64).wire("points", a).done();
        if downstream {
            last = graph.add("add", &ADD).wire("points", last).done();
        }
        graph.output(last).v = true;
        let cooked = graph.cook(2..=24);
        for frame in 2..=24 {
            let exact = -9.81 / 24.0 * (f64::from(frame) - 0.5);
            let found = f64::from(v(&cooked, f64::from(frame)));
            assert!((found - exact).abs() < 1e-3, "frame {frame}: {found} for {exact}");
        }
        let end = graph.cook([25]);
        let one_sided = f64::from(end.x(25.0)) - f64::from(graph.cook([24]).x(24.0));
        assert!((f64::from(v(&end, 25.0)) - 24.0 * one_sided).abs() < 1e-3);
    }
}

/// Points that change at frame 3, with an output of velocities only.
fn changing(at: impl Fn(bool) -> Geometry + Send + Sync + 'static) -> Cooked {
    let mut graph = TestGraph::new(1, 5);
    let given = graph.given("given", move |frame| at(frame.number() >= 3.0));
    let add = graph.add("add", &ADD).wire("points", given).done();
    let output = graph.output(add);
    (output.v, output.attributes) = (true, Some(Vec::new()));
    graph.cook(1..=5)
}

#[test]
fn a_change_of_the_number_of_points_is_refused_only_at_that_frame() {
    let cooked = changing(|later| row(if later { &[0.0, 1.0, 2.0] } else { &[0.0, 1.0] }));
    let fact = "its points: 2 points half a frame before, 3 now and 3 after";
    let hint = "velocities need the same points at neighbouring frames; remove `v` from the output";
    assert_eq!(cooked.error(), format!("`add` (Add) at frame 3: {fact}; {hint}"));
    assert_eq!(cooked.found.keys().map(|(_, frame)| frame.number()).collect::<Vec<_>>(), [1.0, 2.0, 4.0, 5.0]);
}

#[test]
fn points_with_other_ids_are_not_the_same_points() {
    let with_ids = |ids: [i32; 2]| {
        let mut geometry = row(&[0.0, 1.0]);
        geometry.part_mut(Kind::Points).unwrap().set(ID, ids.to_vec()).unwrap();
        geometry
    };
    let cooked = changing(move |later| with_ids(if later { [2, 3] } else { [1, 2] }));
    assert!(cooked.error().contains("its points: other points or faces half a frame away"), "{}", cooked.error());
}
