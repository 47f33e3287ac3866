//! Velocities of outputs, where the node has none of its own.

use engine::geometry::V;

use crate::net::{Cooked, Net, at, engine};
use crate::nodes::{CLOCK, FOLLOW, SOURCE};

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
