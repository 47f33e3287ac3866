//! Turns with coherence.

use super::hairs::{floor, fur, on, sphere};
use super::*;
use numerics::vector::to_f32;

/// A hair of length 1 from (0, 0.1, 0), upright at rest, collided with a floor at height 0 and `others`, at coherence 1.
fn over_floor(goal: DVec3, others: &[&TriangleTree]) -> Collided {
    let (points, triangles) = floor();
    let (tree, normals) = (TriangleTree::build(&points, &triangles), normals(&points, &triangles));
    let skin = SkinSurface { tree: &tree, triangles: &triangles, normals: &normals };
    let obstacles: Vec<&TriangleTree> = std::iter::once(&tree).chain(others.iter().copied()).collect();
    let how = Collide { skin: Some(skin), coherence: 1.0.into(), offset_root: 0.0.into(), ..on(&obstacles) };
    let root = DVec3::new(0.0, 0.1, 0.0);
    let rest = [to_f32(root), to_f32(root + DVec3::y())];
    collide(&[0, 2], &rest, &[rest[0], to_f32(root + goal.normalize())], &how)
}

#[test]
fn ends_stay_two_gaps_over_a_floor_and_wind_straight_down_leaves_them_upright() {
    // The lowest that is allowed: sin φ = 0.1 − 2 gaps. What is a little lower is led there, and no farther.
    let lowest = libm::asin(0.1 - 2e-4);
    for below in [1e-3, 1e-2] {
        let (sine, cosine) = libm::sincos(lowest + below);
        let out = over_floor(DVec3::new(cosine, -sine, 0.0), &[]);
        let height = f64::from(out.points[1][1]);
        assert!((2e-4 - 1e-6..2e-4 + 3.0 * below).contains(&height), "{below}: {height}");
        assert_eq!((out.contacts, out.unfreed_segments), (0, 0));
    }
    // Above that a goal keeps its bits.
    let goal = DVec3::new(1.0, -0.09, 0.0);
    let expected = to_f32(DVec3::new(0.0, 0.1, 0.0) + goal.normalize());
    assert_eq!(over_floor(goal, &[]).points[1], expected);
    // Straight down: room below makes it lean, but it stays upright, and which way it leans does not flip.
    let down = |x: f64| over_floor(DVec3::new(x, -1.0, 0.0), &[]).points[1];
    let sides = [down(-1e-6), down(1e-6)].map(to_f64);
    assert!(sides[0].y > 0.9 && (sides[0] - sides[1]).norm() < 1e-4, "{sides:?}");
}

/// Wind that bends a hair more and more into the floor makes an arch of it. If each segment used all room below it, they
/// would go up and down in turns.
#[test]
fn hairs_do_not_zigzag() {
    let (points, triangles) = floor();
    let (tree, normals) = (TriangleTree::build(&points, &triangles), normals(&points, &triangles));
    let skin = SkinSurface { tree: &tree, triangles: &triangles, normals: &normals };
    let obstacles = [&tree];
    let how = Collide { skin: Some(skin), coherence: 1.0.into(), ..on(&obstacles) };
    let hair = |directions: [f64; 6]| -> Vec<Vec3> {
        let mut at = DVec3::new(0.1, 0.0, 0.2);
        let step = |degrees: f64| {
            let (sine, cosine) = libm::sincos(degrees.to_radians());
            DVec3::new(cosine, sine, 0.0) * 0.1
        };
        let later = directions.map(|degrees| {
            at += step(degrees);
            to_f32(at)
        });
        std::iter::once([0.1, 0.0, 0.2]).chain(later).collect()
    };
    let rest = hair([80.0; 6]);
    for deepest in (40..90).step_by(5).map(f64::from) {
        let goal = hair([0.1, 0.5, 0.7, 0.9, 1.0, 1.0].map(|share| -share * deepest));
        let out = collide(&[0, 7], &rest, &goal, &how).points;
        let rises: Vec<bool> = out.windows(2).map(|ends| ends[1][1] > ends[0][1]).collect();
        assert!(out[1..].iter().all(|cv| cv[1] > 0.0), "{deepest}: {out:?}");
        assert!(rises[0] && rises.windows(2).filter(|two| two[0] != two[1]).count() <= 1, "{deepest}: {rises:?}");
    }
}

#[test]
fn obstacles_besides_the_skin_are_not_passed() {
    // A sheet across the way at 45°, well over the floor, and below it the goal, which is free.
    let at = |radius: f64, z: f64| -> Vec3 {
        let side = radius * std::f64::consts::FRAC_1_SQRT_2;
        to_f32(DVec3::new(side, 0.1 + side, z))
    };
    let sheet = [at(0.4, -1.0), at(0.8, -1.0), at(0.8, 1.0), at(0.4, 1.0)];
    let tree = TriangleTree::build(&sheet, &[[0, 1, 2], [0, 2, 3]]);
    let goal = DVec3::new(1.0, 0.3, 0.0);
    assert_eq!(over_floor(goal, &[]).contacts, 0);
    let out = over_floor(goal, &[&tree]);
    let [x, y, _] = out.points[1].map(f64::from);
    // One gap of arc short of the sheet's outer edge.
    let angle = libm::atan2(x, y - 0.1);
    assert_eq!(out.contacts, 1);
    assert!((std::f64::consts::FRAC_PI_4 - 3e-4..std::f64::consts::FRAC_PI_4).contains(&angle), "{angle}");
}

#[test]
fn no_tip_on_a_sphere_jumps_in_wind_that_turns_by_a_degree() {
    let mesh = sphere(24);
    let (tree, normals) = (TriangleTree::build(&mesh.0, &mesh.1), normals(&mesh.0, &mesh.1));
    let obstacles = [&tree];
    let skin = SkinSurface { tree: &tree, triangles: &mesh.1, normals: &normals };
    let wind = |degrees: f64| {
        let (sine, cosine) = libm::sincos(degrees.to_radians());
        DVec3::new(cosine, 0.1, sine).normalize()
    };
    let jumps = |coherence: f64| {
        let mut jumps = 0;
        for degrees in (0..360).step_by(20).map(f64::from) {
            let tips = [degrees, degrees + 1.0].map(|degrees| {
                let (starts, rest, goal) = fur(1000, 6, 0.3, wind(degrees));
                let how = Collide { skin: Some(skin), coherence: coherence.into(), ..on(&obstacles) };
                let out = collide(&starts, &rest, &goal, &how);
                assert_eq!(out.crossings_left, 0);
                out.points.iter().skip(5).step_by(6).map(|tip| to_f64(*tip)).collect::<Vec<_>>()
            });
            jumps += tips[0].iter().zip(&tips[1]).filter(|(a, b)| (*a - *b).norm() > 0.25 * 0.3).count();
        }
        jumps
    };
    let (plain, coherent) = (jumps(0.0), jumps(1.0));
    assert!(plain > 5 && coherent == 0, "{plain}, {coherent}");
}
