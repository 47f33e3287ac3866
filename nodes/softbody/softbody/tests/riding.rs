//! Meshes that ride along: contacts act on them, not on the tets around them.

use super::*;
use bodies::tets::{CagedSurface, PolygonSurface};
use numerics::shapes::{Polygons, sphere};
use numerics::vector::{DVec3, to_f64};

const THICKNESS_HERE: f32 = 2e-3;

/// A ball of 0.2 m about a point, in a cage of tets a third of that long.
fn caged_ball(at: [f32; 3]) -> Geometry {
    let Polygons { points, .. } = sphere([0.2; 3], 6);
    let points: Vec<[f32; 3]> = points.iter().map(|p| std::array::from_fn(|k| p[k] as f32 + at[k])).collect();
    let triangles = sphere([0.2; 3], 6).triangles();
    let (starts, corners): (Vec<u32>, Vec<u32>) =
        ((0..=triangles.len() as u32).map(|face| 3 * face).collect(), triangles.as_flattened().to_vec());
    let surface = PolygonSurface { starts: &starts, corners: &corners, points: &points };
    let cage = CagedSurface::of(surface, 0.07, true).unwrap().fill();
    let mut tets = Component::tets(cage.tets.tets, cage.tets.points).unwrap();
    tets.set(FILL, cage.fill).unwrap();
    Geometry::from(tets).with(Component::mesh(vec![3; triangles.len()], corners, points).unwrap())
}

fn falling(bodies: Geometry) -> Bench {
    simulating(bodies).set(STIFFNESS, 3e4.into()).set(THICKNESS, THICKNESS_HERE).set(DAMPING, 0.05.into())
}

fn lowest(mesh: &[[f32; 3]]) -> f32 {
    mesh.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min)
}

fn highest(mesh: &[[f32; 3]]) -> f32 {
    mesh.iter().map(|p| p[1]).fold(f32::NEG_INFINITY, f32::max)
}

#[test]
fn a_caged_ball_rests_on_the_ball_and_not_on_its_cage() {
    let ball = caged_ball([0.0, 0.12, 0.0]);
    let cage = lowest(ball.tets().unwrap().positions());
    let frames = falling(ball).set(GROUND, true).frames([1, 24, 48]);
    assert!(cage < lowest(frames[0].mesh().positions()) - 10.0 * THICKNESS_HERE, "the cage reaches beyond the ball");
    for frame in &frames[1..] {
        let low = lowest(frame.mesh().positions());
        assert!(low > 0.0 && low < THICKNESS_HERE + 1e-3, "{low}, {:?}", frame.metrics);
        assert_eq!((frame.metrics["points_inside"], frame.metrics["inverted_tets"]), (0.0, 0.0));
        assert!(frame.metrics["deepest_overlap"] < f64::from(THICKNESS_HERE), "{:?}", frame.metrics);
        assert_eq!(frame.metrics["caps_hit"], 0.0);
    }
    assert!(frames[2].metrics["kinetic"] < 1e-6, "{:?}", frames[2].metrics);
}

/// Of a soft ball the mesh loses what its tets keep; the metric is that of the mesh, by the divergence theorem.
#[test]
fn the_volume_of_the_mesh_that_rides_along_is_measured() {
    let volume = |mesh: &Component| -> f64 {
        let cone = |[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| to_f64(mesh.positions()[*corner as usize]));
            a.dot(&b.cross(&c)) / 6.0
        };
        mesh.triangles().corners.iter().map(cone).sum()
    };
    let soft = falling(caged_ball([0.0, 0.11, 0.0])).set(STIFFNESS, 2e3.into()).set(GROUND, true).frames([1, 24]);
    let ratio = volume(soft[1].mesh()) / volume(soft[0].mesh());
    let metric = soft[1].metrics["carried_volume_ratio"];
    assert!((metric - ratio).abs() < 1e-5 && (0.5..0.97).contains(&ratio), "{metric} for {ratio}");
    assert!((soft[0].metrics["carried_volume_ratio"] - 1.0).abs() < 1e-6);
    let block = falling(block([2; 3], [0.0, 0.11, 0.0], [0.1; 3]).into()).frames([1]);
    assert_eq!(block[0].metrics["carried_volume_ratio"], 1.0, "nothing rides along");
}

/// The upper ball is on the axis of the lower.
#[test]
fn a_caged_ball_on_another_touches_the_ball() {
    let stack = falling(caged_ball([0.0, 0.101, 0.0])).input(BODIES, caged_ball([0.0, 0.306, 0.0]));
    let frames = stack.set(GROUND, true).set(FRICTION, 1.0.into()).frames([1, 12, 24]);
    let half = frames[0].mesh().point_count() / 2;
    for frame in &frames[1..] {
        let points = frame.mesh().positions();
        let gap = lowest(&points[half..]) - highest(&points[..half]);
        // Both are pressed flat, so the gap between the highest and the lowest point is that of the surfaces there.
        assert!(gap < THICKNESS_HERE + 1e-3 && frame.metrics["points_inside"] == 0.0, "{gap}, {:?}", frame.metrics);
        assert!(frame.metrics["deepest_overlap"] < f64::from(THICKNESS_HERE), "{:?}", frame.metrics);
        assert!((points[half][0] - points[0][0]).abs() < 0.05, "it did not roll off");
    }
}

/// A thin plate that stands in the way of a ball at 10 m/s.
#[test]
fn no_point_of_what_rides_along_goes_through_a_wall() {
    let wall = {
        let shape = numerics::shapes::block([0.01, 1.0, 1.0], [1; 3]);
        let points = shape.points.iter().map(|p| [p[0] as f32 + 0.3, p[1] as f32, p[2] as f32]).collect();
        let triangles = shape.triangles();
        Component::mesh(vec![3; triangles.len()], triangles.as_flattened().to_vec(), points).unwrap()
    };
    let thrown = falling(caged_ball([0.0; 3])).input(COLLIDERS, wall).set(GRAVITY, [0.0; 3]);
    for frame in thrown.set(INITIAL_VELOCITY, [10.0, 0.0, 0.0]).frames(1..=8) {
        let farthest = frame.mesh().positions().iter().map(|p| p[0]).fold(f32::NEG_INFINITY, f32::max);
        assert!(farthest < 0.295 && frame.metrics["points_inside"] == 0.0, "{farthest}, {:?}", frame.metrics);
    }
}

#[test]
fn what_rides_along_has_the_same_bits_on_any_number_of_threads() {
    let stack = || {
        let stack = falling(caged_ball([0.0, 0.101, 0.0])).input(BODIES, caged_ball([0.02, 0.306, 0.0]));
        stack.set(GROUND, true).set(SELF_COLLISION, true)
    };
    let bits = |threads: usize| -> Vec<[u32; 3]> {
        let frames = stack().threads(threads).frames([1, 6]);
        frames[1].mesh().positions().iter().map(|p| p.map(f32::to_bits)).collect()
    };
    assert!(bits(1) == bits(3));
}

/// A mesh that rides along with one of two bodies: the other has its own boundary.
#[test]
fn a_body_without_a_mesh_keeps_its_boundary() {
    let frames = falling(caged_ball([0.0, 0.11, 0.0])).input(BODIES, block([2; 3], [0.3, 0.01, 0.0], [0.1; 3]));
    let frames = frames.set(GROUND, true).frames([1, 24]);
    let boxed = frames[1].mesh().point_count() - 26;
    let low = lowest(&frames[1].mesh().positions()[boxed..]);
    assert!(low > 0.0 && low < THICKNESS_HERE, "{low}");
}

/// A sheet of two triangles above the middle of a cube rides along far from its boundary; turned over, nothing changes.
#[test]
fn a_sheet_in_a_block_is_what_the_block_stands_on() {
    let on = |turned: bool| {
        let corners = if turned { vec![0, 2, 1, 1, 2, 3] } else { vec![0, 1, 2, 1, 3, 2] };
        let places = [[0.02, 0.02], [0.08, 0.02], [0.02, 0.08], [0.08, 0.08]];
        let sheet = Component::mesh(vec![3; 2], corners, places.map(|[x, z]| [x, 0.05, z]).to_vec()).unwrap();
        let body = Geometry::from(cube()).with(sheet);
        let frames = falling(body).set(GROUND, true).set(GROUND_HEIGHT, 0.04).set(BOUNCE, 0.0).frames([1, 24]);
        assert_eq!(frames[0].metrics["started_inside"], 0.0, "what is below the sheet touches nothing");
        lowest(frames[1].mesh().positions())
    };
    for turned in [false, true] {
        let low = on(turned) - 0.04;
        assert!(low > 0.0 && low < THICKNESS_HERE, "{low}");
    }
}

/// The distance between centres of two balls that start inside each other by 50 mm, as their cages do by more.
#[test]
fn what_rides_along_is_pushed_apart_to_its_own_distance() {
    let pair = falling(caged_ball([0.0; 3])).input(BODIES, caged_ball([0.15, 0.0, 0.0])).set(GRAVITY, [0.0; 3]);
    let frames = pair.frames([1, 13, 14]);
    let centre = |points: &[[f32; 3]]| points.iter().map(|p| to_f64(*p)).sum::<DVec3>() / points.len() as f64;
    let points = frames[2].mesh().positions();
    let (first, second) = points.split_at(points.len() / 2);
    let apart = (centre(second) - centre(first)).norm();
    assert!(frames[0].metrics["started_in_bodies"] == 1.0, "{:?}", frames[0].metrics);
    assert!(apart > 0.19 && apart < 0.215 && frames[2].metrics["points_inside"] == 0.0, "{apart}");
}
