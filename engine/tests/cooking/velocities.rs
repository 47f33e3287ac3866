//! Velocities of outputs, where the node has none of its own.

use engine::geometry::{Geometry, ID, Kind, V};

use crate::net::{Cooked, Net, at, engine, row};
use crate::nodes::{ADD, CLOCK, FOLLOW, SOURCE};

/// x = f².
fn squares() -> Net {
    let mut net = Net::new(1, 10);
    let a = net.add("a", &SOURCE).set("amount", 0.0_f32).done();
    let clock = net.add("clock", &CLOCK).keyed("amount", &[(0.0, 0.0), (20.0, 20.0)]).wire("points", a).done();
    net.output(clock).v = true;
    net
}

fn v(cooked: &Cooked, frame: f64) -> f32 {
    cooked.geometry(frame).points().and_then(|points| points.get(V)).expect("velocities")[0][0]
}

#[test]
fn velocities_are_central_within_the_scene_and_one_sided_at_its_ends() {
    let cooked = squares().cook(1..=10);
    // d(f²) = 2f a frame, 24 frames a second; one-sided: (1.5² − 1)/½ and (100 − 9.5²)/½.
    assert_eq!(v(&cooked, 5.0), 240.0);
    assert_eq!(v(&cooked, 1.0), 2.5 * 24.0);
    assert_eq!(v(&cooked, 10.0), 19.5 * 24.0);
    assert_eq!(cooked.x(5.0), 25.0);
}

#[test]
fn what_stands_still_has_no_velocity() {
    let mut net = Net::new(1, 4);
    let a = net.add("a", &SOURCE).done();
    net.output(a).v = true;
    let cooked = net.cook(1..=4);
    assert_eq!([1.0, 2.0, 4.0].map(|frame| v(&cooked, frame)), [0.0; 3]);
}

#[test]
fn a_scene_of_one_frame_looks_ahead() {
    let mut net = squares();
    net.0.scene.last = 1;
    assert_eq!(v(&net.cook([1]), 1.0), 2.5 * 24.0);
}

#[test]
fn velocities_alone_have_the_bits_they_have_among_others() {
    let mut net = squares();
    net.0.outputs.clear();
    let clock = engine::graph::Link { node: net.place("clock"), port: 0 };
    let follow = net.add("follow", &FOLLOW).wire("points", clock).done();
    net.output(follow).v = true;
    let together = net.cook(1..=10);
    for frame in [1.0, 2.0, 5.0, 9.0, 10.0] {
        let alone = net.cook_with(&engine(1, 1 << 30), &[at(frame)], None);
        assert_eq!(v(&alone, frame).to_bits(), v(&together, frame).to_bits(), "frame {frame}");
    }
}

/// Given points that change at frame 3, with velocities and nothing else.
fn changing(at: impl Fn(bool) -> Geometry + Send + Sync + 'static) -> Cooked {
    let mut net = Net::new(1, 5);
    let given = net.given("given", move |frame| at(frame.number() >= 3.0));
    let add = net.add("add", &ADD).wire("points", given).done();
    let output = net.output(add);
    (output.v, output.attributes) = (true, Some(Vec::new()));
    net.cook(1..=5)
}

#[test]
fn where_points_come_and_go_there_are_no_velocities_and_elsewhere_there_are() {
    let cooked = changing(|later| row(if later { &[0.0, 1.0, 2.0] } else { &[0.0, 1.0] }));
    let fact = "the points have 2 points half a frame before, 3 now and 3 after";
    let hint = "velocities need points that stay; leave out `v` of the output";
    assert_eq!(cooked.error(), format!("`add` (Add) at frame 3: {fact}; {hint}"));
    assert_eq!(cooked.found.keys().map(|(_, frame)| frame.number()).collect::<Vec<_>>(), [1.0, 2.0, 4.0, 5.0]);
}

#[test]
fn as_many_points_with_other_ids_are_not_the_same_points() {
    let with_ids = |ids: [i32; 2]| {
        let mut geometry = row(&[0.0, 1.0]);
        geometry.part_mut(Kind::Points).unwrap().set(ID, ids.to_vec()).unwrap();
        geometry
    };
    let cooked = changing(move |later| with_ids(if later { [2, 3] } else { [1, 2] }));
    assert!(cooked.error().contains("the points are not the same half a frame away"), "{}", cooked.error());
}
