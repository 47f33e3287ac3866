//! Curves that turns leave crossing something.

use super::hair::Hair;
use super::kept::{Fur, bodies, burr};
use super::*;
use numerics::vector::to_f32;

/// The number of segments of each curve that cross the mesh.
fn crossings_of_each(fur: &Fur, points: &[Vec3]) -> Vec<i32> {
    let corners: Vec<_> = fur.mesh.1.iter().map(|t| t.map(|corner| to_f64(fur.mesh.0[corner as usize]))).collect();
    let bounds: Vec<_> = corners.iter().map(|[a, b, c]| (a.inf(b).inf(c), a.sup(b).sup(c))).collect();
    let crosses_any = |a: DVec3, b: DVec3| {
        let (low, high) = (a.inf(&b), a.sup(&b));
        let near =
            |(least, most): &(DVec3, DVec3)| (0..3).all(|axis| low[axis] <= most[axis] && least[axis] <= high[axis]);
        corners.iter().zip(&bounds).any(|(corners, bounds)| near(bounds) && crosses(&a, &b, corners))
    };
    let count = |ends: &[u32]| {
        let segments = points[ends[0] as usize..ends[1] as usize].windows(2);
        segments.filter(|pair| crosses_any(to_f64(pair[0]), to_f64(pair[1]))).count() as i32
    };
    fur.starts.windows(2).map(count).collect()
}

/// Whether each curve, its root lifted, crosses nothing at rest.
fn free_where_lifted(fur: &Fur, kept: &AtRest) -> Vec<bool> {
    let lifted = |(curve, ends): (usize, &[u32])| {
        let cvs = fur.rest[ends[0] as usize..ends[1] as usize].iter();
        cvs.map(|cv| to_f32(to_f64(*cv) + kept.shift(curve))).collect::<Vec<_>>()
    };
    let lifted: Vec<Vec3> = fur.starts.windows(2).enumerate().flat_map(lifted).collect();
    crossings_of_each(fur, &lifted).iter().map(|count| *count == 0).collect()
}

#[test]
fn what_is_free_at_rest_is_free_in_any_wind() {
    let mut blended = 0;
    let bodies = bodies().into_iter().filter(|(name, _)| *name != "broken");
    for (name, fur) in bodies.chain([("short", burr(4000, 0.2)), ("long", burr(4000, 0.6))]) {
        let fur = fur.raised(1e-3);
        let tree = TriangleTree::build(&fur.mesh.0, &fur.mesh.1);
        let obstacles = [&tree];
        let normals = normals(&fur.mesh.0, &fur.mesh.1);
        let skin = Some(SkinSurface { tree: &tree, triangles: &fur.mesh.1, normals: &normals });
        let settings = [(ContactMethod::Exact, 0.0), (ContactMethod::Steps(8), 0.0), (ContactMethod::Exact, 1.0)];
        for (method, coherence) in settings {
            let skin = skin.filter(|_| coherence > 0.0);
            let how = Collide { method, skin, coherence: coherence.into(), ..hairs::on(&obstacles) };
            let out = collide(&fur.starts, &fur.rest, &fur.goal, &how);
            let crossings = crossings_of_each(&fur, &out.points);
            let free = free_where_lifted(&fur, &at_rest(&fur.starts, &fur.rest, &how));
            assert!(free.iter().filter(|free| **free).count() > free.len() / 4, "{name}");
            for curve in 0..free.len() {
                assert!(crossings[curve] <= out.crossings[curve], "{name}, {method:?}, {curve}");
                assert!(!free[curve] || out.crossings[curve] == 0, "{name}, {method:?}, {curve}");
            }
            let sum: u64 = out.crossings.iter().map(|count| *count as u64).sum();
            assert_eq!(out.blended.iter().map(|blended| *blended as u64).sum::<u64>(), out.blended_to_rest, "{name}");
            assert_eq!((sum, out.unfreed_segments), (out.crossings_left, out.crossings_left), "{name}");
            let lengths = hairs::worst_length(&fur.starts, &fur.goal, &out.points);
            assert!(lengths < 2e-6 && out.length_error < 2e-6, "{name}: {lengths}");
            blended += out.blended_to_rest;
        }
    }
    assert!(blended > 10, "{blended}");
}

#[test]
fn a_curve_is_blended_to_its_first_free_pose_towards_rest() {
    // Upright at a height of 0.1 over a floor, and turned by 135°: it reaches the floor at 90° + asin 0.1.
    let (points, triangles) = hairs::floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    let how = hairs::on(&obstacles);
    let (rest, goal) = ([[0.0, 0.1, 0.0], [0.0, 1.1, 0.0]], [[0.0, 0.1, 0.0], [1.0, 0.1, 0.0]]);
    let down = DVec3::new(1.0, -1.0, 0.0).normalize();
    let mut out = goal;
    assert!(hair(&rest, &goal, &mut out).fall_back(&how, &[down]));
    let turned = |tip: Vec3| libm::atan2(f64::from(tip[0]), f64::from(tip[1]) - 0.1);
    let share = turned(out[1]) / 135_f64.to_radians();
    let most = (90_f64.to_radians() + libm::asin(0.1)) / 135_f64.to_radians();
    assert!(share <= most && share > most - 1.0 / 512.0, "{share}, {most}");
    // Where rest crosses too, nothing is done.
    let rest = [[0.0, 0.1, 0.0], [0.0, -0.9, 0.0]];
    let mut out = goal;
    assert!(!hair(&rest, &goal, &mut out).fall_back(&how, &[down]));
    assert_eq!(out, goal);
}

/// A curve without a half-space that is not displaced.
fn hair<'a>(rest: &'a [Vec3], goal: &'a [Vec3], out: &'a mut [Vec3]) -> Hair<'a> {
    Hair { first: 0, shift: DVec3::zeros(), half_space: None, around: None, rest, goal, out }
}
