//! What starts inside something: counted, said, and pushed out.

use super::close::{lowest, sheet};
use super::*;
use numerics::vector::length;

pub(super) fn solid(low: [f32; 3], size: f32) -> Component {
    let cube = block([1; 3], low, [size; 3]);
    let faces = bodies::tets::boundary(cube.tet_corners(), cube.positions());
    let corners: Vec<u32> = faces.iter().flat_map(|face| face.corners).collect();
    Component::mesh(vec![3; faces.len()], corners, cube.positions().to_vec()).unwrap()
}

#[test]
fn particles_that_start_inside_something_are_counted_at_every_frame() {
    let inside = |bench: Bench| {
        let frames = bench.frames([1, 2, 3]);
        assert_eq!(frames[1].metrics["started_inside"], frames[2].metrics["started_inside"]);
        frames[2].metrics["started_inside"]
    };
    let at = |low: [f32; 3]| inside(simulating(cube()).input(COLLIDERS, solid(low, 0.2)));
    assert_eq!(at([0.03, -0.05, -0.05]), 18.0, "all but the nine particles on the face at x = 0");
    assert_eq!((at([0.1, 0.0, 0.0]), at([0.0995, 0.0, 0.0])), (0.0, 0.0), "closer than `thickness` is touching");
    let mut open = solid([-0.05; 3], 0.2);
    assert_eq!(inside(simulating(cube()).input(COLLIDERS, open.clone())), 27.0);
    let Topology::Mesh(faces) = open.topology() else { panic!("a mesh has faces") };
    open = Component::mesh(vec![3; 11], faces.corners[3..].to_vec(), open.positions().to_vec()).unwrap();
    assert_eq!(inside(simulating(cube()).input(COLLIDERS, open)), 0.0, "an open collider has no inside");
    assert_eq!(inside(simulating(cube()).set(GROUND, true).set(GROUND_HEIGHT, 0.05)), 9.0);
    assert_eq!(inside(simulating(cube()).set(GROUND, true)), 0.0);
    let two = |x: f32| simulating(cube()).input(BODIES, block([2; 3], [x, 0.01, 0.01], [0.1; 3]));
    // Of each, the four corners that lie in the other one, and what is between them.
    assert!((8.0..=20.0).contains(&inside(two(0.06))), "{}", inside(two(0.06)));
    assert_eq!((inside(two(0.2)), inside(two(0.06).set(BODY_COLLISION, false))), (0.0, 0.0));
}

/// The cube beside a solid, beside the same with its faces turned round, and within that, which is a room.
#[test]
fn a_collider_with_faces_that_point_inwards_is_said_where_bodies_are_outside_it() {
    let cook = |low: [f32; 3], turned: bool| {
        let mut other = solid(low, 0.5);
        if turned {
            let corners = other.faces().unwrap().corners.iter().rev().copied().collect();
            other = Component::mesh(vec![3; 12], corners, other.positions().to_vec()).unwrap();
        }
        simulating(cube()).input(COLLIDERS, solid([5.0; 3], 0.1)).input(COLLIDERS, other).frames([1, 8])
    };
    let said = |frame: &BenchResult| ["inward_colliders", "inward_colliders_wire"].map(|name| frame.metrics[name]);
    let rooms = |low: [f32; 3], turned: bool| cook(low, turned).iter().map(said).collect::<Vec<_>>();
    assert_eq!(rooms([0.3, -0.2, -0.2], false), [[0.0, -1.0]; 2], "solid");
    assert_eq!(rooms([0.3, -0.2, -0.2], true), [[1.0, 1.0]; 2], "a room beside the cube");
    assert_eq!(rooms([0.05, -0.2, -0.2], true), [[1.0, 1.0]; 2], "half of the cube is in it");
    assert_eq!(rooms([-0.2; 3], true), [[0.0, -1.0]; 2], "a room around the cube");
    // The cube falls by 0.4 m in that time: onto the solid, and into the room.
    let [on, into] = [false, true].map(|turned| lowest(&cook([-0.2, -0.6, -0.2], turned)[1]));
    assert!(on > -0.101 && into < -0.3, "{on} {into}");
}

/// A solid of a profile in x and y, given counter-clockwise, from z −0.2 to 0.3 m, with its faces turned round.
fn room(profile: &[[f32; 2]], caps: &[[u32; 4]]) -> Component {
    let count = profile.len() as u32;
    let points = [-0.2, 0.3].iter().flat_map(|z| profile.iter().map(|[x, y]| [*x, *y, *z])).collect();
    let walls = (0..count).map(|k| [k + count, (k + 1) % count + count, (k + 1) % count, k]);
    let floors = caps.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c, *d], [d + count, c + count, b + count, a + count]]);
    let corners: Vec<u32> = walls.chain(floors).flatten().collect();
    Component::mesh(vec![4; corners.len() / 4], corners, points).unwrap()
}

/// The cube, of 0.1 m from the origin, where an L-shaped room has no inside, in its longer arm, across its inner wall, and
/// with a face on that wall.
#[test]
fn a_room_is_what_its_faces_enclose() {
    let beside = |[x, y]: [f32; 2]| {
        let l = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.0], [0.0, 0.0], [0.0, 0.6], [-0.3, 0.6]];
        let room = room(&l.map(|[u, v]| [u + x, v + y]), &[[0, 1, 2, 3], [0, 3, 4, 5]]);
        let frame = simulating(cube()).input(COLLIDERS, room).frames([1]).remove(0);
        assert_eq!(frame.metrics["started_inside"], 0.0, "{x} {y}: a room has no inside that bodies are pushed out of");
        frame.metrics["inward_colliders"]
    };
    assert_eq!(beside([-0.05, -0.05]), 1.0, "in a corner of its bounds, beyond its faces");
    assert_eq!((beside([0.2, -0.2]), beside([-0.15, 0.2])), (0.0, 0.0), "in either arm");
    assert_eq!(beside([0.05, -0.2]), 1.0, "half of the cube is outside");
    assert_eq!((beside([0.1, -0.2]), beside([0.0995, -0.2])), (0.0, 0.0), "at the wall, within `thickness`");
    assert_eq!(beside([0.095, -0.2]), 1.0, "farther out than `thickness`");
}

/// Notes come in the order of the metrics.
#[test]
fn the_note_on_a_room_comes_before_the_one_on_what_went_through_its_faces() {
    let place = |name: &str| NODE.metrics.iter().position(|metric| metric.name == name).unwrap();
    assert!(place("inward_colliders") < place("deepest_penetration"));
}

/// Bars of 0.1 × 0.1 × 0.5 m through each other's middle, with cells of 0.1 m: all points lie on the other's faces or outside.
#[test]
fn bars_that_start_crossed_are_said_from_the_first_frame() {
    let bar = |cells: [usize; 3], size: [f32; 3]| block(cells, size.map(|size| -0.5 * size), size);
    let crossed = |away: f32| {
        let mut second = bar([1, 1, 5], [0.1, 0.1, 0.5]);
        let moved = second.positions().iter().map(|[x, y, z]| [*x, *y + away, *z]).collect();
        second.set(P, moved).unwrap();
        let bench = simulating(bar([5, 1, 1], [0.5, 0.1, 0.1])).input(BODIES, second).set(GRAVITY, [0.0; 3]);
        bench.frames([1, 2]).iter().map(|frame| frame.metrics["started_crossing"]).collect::<Vec<_>>()
    };
    assert_eq!(crossed(0.0), [1.0, 1.0]);
    assert_eq!(crossed(0.1), [0.0, 0.0], "one lies on the other");
}

/// Two cubes of 0.1 m, the second 50 mm inside the first along x. They keep 1 mm, so each moves 51/24 mm a frame.
#[test]
fn bodies_that_start_inside_each_other_come_apart_evenly_in_twelve_frames() {
    let second = || block([3, 2, 2], [0.05, 0.0, 0.0], [0.1; 3]);
    let frames = simulating(cube()).input(BODIES, second()).set(GRAVITY, [0.0; 3]).frames(1..=24);
    // All particles of the first but the middle one are points of its surface.
    let first = cube().point_count() - 1;
    let reach = |frame: &BenchResult, axis: usize, of: std::ops::Range<usize>| {
        let points = &frame.mesh().positions()[of];
        let along = points.iter().map(|p| f64::from(p[axis]));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    assert!((frames[0].metrics["deepest_overlap"] - 0.051).abs() < 1e-6, "{:?}", frames[0].metrics);
    // Inside are one of the first, in the middle of its face, and two of the second. All others lie on faces of the other
    // body: the nine of the face at x = 0.1; and nine each at x = 0.05 and 0.083.
    assert_eq!((frames[0].metrics["points_inside"], frames[0].metrics["started_inside"]), (3.0, 27.0));
    for (over, frame) in frames.iter().enumerate() {
        let all = frame.mesh().point_count();
        let apart = reach(frame, 0, first..all)[0] - reach(frame, 0, 0..first)[1];
        let even = -0.05 + 0.051 * (over as f64).min(12.0) / 12.0;
        // Contacts give way by up to 1 mm, and nothing slows bodies that are pushed.
        assert!(apart > even - 1e-3 && (over > 12 || apart < even + 2e-3), "{over}: {apart} {even}");
        for axis in [1, 2] {
            let [low, high] = reach(frame, axis, 0..all);
            assert!(low.abs() < 1e-3 && (high - 0.1).abs() < 1e-3, "{over}: no shear, {low} {high}");
        }
        assert_eq!(frame.metrics["deepest_penetration"], 0.0, "{over}: {:?}", frame.metrics);
    }
    assert_eq!(frames[13].metrics["points_inside"], 0.0, "{:?}", frames[13].metrics);
    assert!((frames[13].metrics["volume_ratio"] - 1.0).abs() < 0.01);
}

#[test]
fn a_body_that_starts_in_a_collider_or_the_ground_is_pushed_out_evenly() {
    let still = |bench: Bench| bench.set(GRAVITY, [0.0; 3]).set(STIFFNESS, 1e5.into()).frames(1..=16);
    // Its lower 30 mm are in the box, or below the ground.
    for bench in [
        simulating(cube()).input(COLLIDERS, solid([-0.1, -0.27, -0.1], 0.3)),
        simulating(cube()).set(GROUND, true).set(GROUND_HEIGHT, 0.03),
    ] {
        for (over, frame) in still(bench).iter().enumerate() {
            let low = frame.mesh().positions().iter().map(|p| f64::from(p[1])).fold(f64::INFINITY, f64::min);
            let even = 0.031 * (over as f64).min(12.0) / 12.0;
            assert!(low > even - 1.2e-3 && (over > 12 || low < even + 1.2e-3), "{over}: {low} {even}");
            assert!(over <= 12 || frame.metrics["deepest_overlap"] <= 1e-3, "{over}: {:?}", frame.metrics);
        }
    }
}

/// A ball of tets of a radius about a point, from the same grid of cubes as [`block`].
fn ball(count: usize, radius: f32, at: [f32; 3]) -> Component {
    let mut ball = block([count; 3], [-1.0; 3], [2.0; 3]);
    let round = |p: &[f32; 3]| {
        let most = p.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        let length = length(*p);
        let scale = if length > 0.0 { radius * most / length } else { 0.0 };
        std::array::from_fn(|k| at[k] + scale * p[k])
    };
    let points = ball.positions().iter().map(round).collect();
    ball.set(P, points).unwrap();
    ball
}

/// A ball wholly inside a larger one, off its centre and at it; one of which half is inside, and a box of which half is.
#[test]
fn a_body_that_starts_in_the_middle_of_another_comes_out_in_twelve_frames() {
    let big = || ball(6, 0.2, [0.0; 3]);
    for (what, small) in [
        ("deep inside", ball(4, 0.05, [0.06, 0.02, 0.0])),
        ("at the same centre", ball(4, 0.05, [0.0; 3])),
        ("half inside", ball(4, 0.1, [0.15, 0.0, 0.02])),
        ("half of a box", block([4; 3], [0.1, -0.05, -0.05], [0.1; 3])),
    ] {
        let bench = simulating(big()).input(BODIES, small).set(GRAVITY, [0.0; 3]).set(STIFFNESS, 1e4.into());
        let frames = bench.frames(1..=16);
        let start = &frames[0].metrics;
        assert!(start["started_inside"] > 20.0 && start["started_in_bodies"] == 1.0, "{what}: {start:?}");
        let wires = [start["started_in_bodies_wire"], start["started_in_bodies_other"]];
        assert_eq!((wires, start["started_in_colliders"]), ([0.0, 1.0], 0.0), "{what}");
        let depths: Vec<f64> = frames.iter().map(|frame| frame.metrics["deepest_overlap"]).collect();
        let even = depths.windows(2).take(11).all(|pair| pair[1] < pair[0] + 1e-3);
        assert!(depths[0] > 0.05 && even, "{what}: evenly, {depths:?}");
        assert_eq!(frames[12].metrics["not_pushed_out"], 0.0, "{what}");
        for frame in &frames[12..] {
            let metrics = &frame.metrics;
            assert_eq!(metrics["points_inside"], 0.0, "{what}: {metrics:?}");
            assert!(metrics["inverted_tets"] == 0.0 && (metrics["volume_ratio"] - 1.0).abs() < 0.01, "{what}");
        }
    }
}

/// Pins hold all particles of both bodies, so nothing can be pushed apart.
#[test]
fn what_cannot_be_pushed_out_is_counted_after_twelve_frames() {
    let second = || block([2; 3], [0.05, 0.01, 0.01], [0.1; 3]);
    let held = [cube(), second()].iter().flat_map(|body| body.positions().to_vec()).collect();
    let frames = simulating(cube()).input(BODIES, second()).input(PINS, pins(held, 1e-3)).frames(1..=15);
    for (over, frame) in frames.iter().enumerate() {
        let metrics = &frame.metrics;
        assert!(metrics["points_inside"] > 3.0 && metrics["deepest_penetration"] == 0.0, "{over}: {metrics:?}");
        let expected = (over >= 12).then_some(metrics["points_inside"]);
        assert_eq!(metrics.get("not_pushed_out").copied(), expected, "{over}: {metrics:?}");
    }
    let apart = simulating(cube()).set(GRAVITY, [0.0; 3]).frames(1..=15);
    assert!(apart.iter().all(|frame| !frame.metrics.contains_key("not_pushed_out")));
}

/// A plate of 0.2 m that starts 1.4 mm inside a cube, as a rolling pin may in its dough, and goes on pressing by 2 mm a
/// frame: what it did not start in meets it like any other collider.
#[test]
fn a_collider_that_starts_in_a_body_may_go_on_pressing() {
    let press = |frame: Frame| {
        let pressed = 0.0014 + 0.002 * (frame.number() - 1.0).min(8.0) as f32;
        solid([-0.05, 0.1 - pressed, -0.05], 0.2).into()
    };
    let bench = simulating(cube()).set(GROUND, true).set(STIFFNESS, 3e4.into()).moving(COLLIDERS, press);
    let frames = bench.frames(1..=16);
    assert_eq!(frames[0].metrics["started_in_colliders"], 1.0);
    for (over, frame) in frames.iter().enumerate().skip(1) {
        let metrics = &frame.metrics;
        assert!(metrics["deepest_overlap"] < 2.4e-3 && metrics["caps_hit"] == 0.0, "{over}: {metrics:?}");
        assert!(over < 12 || metrics["points_inside"] == 0.0, "{over}: {metrics:?}");
        assert!(metrics["newton"] < 30.0 && metrics["inverted_tets"] == 0.0, "{over}: {metrics:?}");
    }
}

/// Default settings, cubes that fall 1.5 m onto a sheet of one face: no point of them is ever below it.
#[test]
fn a_body_that_falls_on_an_open_collider_stays_above_it() {
    for (count, thickness) in [(2, 1e-3), (3, 1e-3), (3, 1e-5)] {
        let cube = block([count; 3], [0.0, 1.5, 0.0], [0.2; 3]);
        let frames = simulating(cube).input(COLLIDERS, sheet()).set(THICKNESS, thickness).frames(1..=24);
        for (over, frame) in frames.iter().enumerate() {
            assert!(lowest(frame) > -1e-7, "{count} {thickness} {over}: {} {:?}", lowest(frame), frame.metrics);
        }
    }
}
