//! Curves with a thickness.

use super::hairs::{floor, on};
use super::*;
use numerics::masked::Masked;
use numerics::random::Key;
use numerics::vector::to_f32;

/// A hair of 0.2 m that stands at height 0.012 over the floor, and its shape when blown along `wind`: each segment turned by
/// nine tenths of the remaining angle.
fn hair(cvs: usize, wind: DVec3) -> [Vec<Vec3>; 2] {
    let step = 0.2 / (cvs - 1) as f64;
    let (mut goal, mut at, mut direction) = (Vec::new(), DVec3::new(0.0, 0.012, 0.0), DVec3::y());
    for _ in 0..cvs {
        goal.push(to_f32(at));
        direction = (direction * 0.1 + wind.normalize() * 0.9).normalize();
        at += direction * step;
    }
    let rest = (0..cvs).map(|k| to_f32(DVec3::new(0.0, 0.012 + step * k as f64, 0.0))).collect();
    [rest, goal]
}

const WINDS: [[f64; 3]; 4] = [[1.0, -1.0, 0.0], [0.3, -1.0, 0.1], [1.0, 0.0, 0.0], [1.0, -0.2, 0.4]];

/// A wall of two triangles at x = 0.1, facing the hair.
fn wall() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let points = vec![[0.1, -9.0, -9.0], [0.1, 9.0, -9.0], [0.1, 9.0, 9.0], [0.1, -9.0, 9.0]];
    (points, vec![[0, 1, 2], [0, 2, 3]])
}

/// A hair of diameter 0.02 ends everywhere at least 0.01 from a floor or a wall that it is blown at. In the corner between
/// them, where no turn may be free of both, it crosses neither.
#[test]
fn half_the_thickness_is_kept_from_what_a_hair_meets() {
    let trees = [floor(), wall()].map(|(points, triangles)| TriangleTree::build(&points, &triangles));
    for method in [ContactMethod::Exact, ContactMethod::Steps(64)] {
        for (cvs, wind) in [2, 5, 17].into_iter().flat_map(|cvs| WINDS.map(|wind| (cvs, DVec3::from(wind)))) {
            let [rest, goal] = hair(cvs, wind);
            for obstacles in [&[&trees[0]][..], &[&trees[1]], &[&trees[0], &trees[1]]] {
                let how = Collide { method, width: Masked::uniform(0.02), offset_root: 0.0.into(), ..on(obstacles) };
                let out = collide(&[0, cvs as u32], &rest, &goal, &how);
                let away = |p: &Vec3| if std::ptr::eq(obstacles[0], &raw const trees[1]) { 0.1 - p[0] } else { p[1] };
                let away = |p: &Vec3| if obstacles.len() == 2 { p[1].min(0.1 - p[0]) } else { away(p) };
                let nearest = out.points.iter().map(away).fold(f32::INFINITY, f32::min);
                let least = if obstacles.len() == 1 { 0.01 - 2e-6 } else { 0.0 };
                assert!(nearest > least, "{method:?}, {cvs} CVs, {wind:?}: {nearest}");
                assert_eq!(out.crossings_left, 0);
                // It is not merely left standing.
                let moved = vector::length(vector::sub(out.points[cvs - 1], rest[cvs - 1]));
                assert!(moved > 0.03, "{method:?}, {cvs} CVs, {wind:?}: {moved}");
            }
        }
    }
}

/// From a root on the floor a thick hair rises until its end is as far away as it is thick.
#[test]
fn a_thick_hair_rises_from_a_root_on_the_floor() {
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    for cvs in [5, 17] {
        let [rest, goal] = hair(cvs, DVec3::new(1.0, -1.0, 0.0)).map(|mut points| {
            points.iter_mut().for_each(|point| point[1] -= 0.0119);
            points
        });
        let how = Collide { width: Masked::uniform(0.004), offset_root: 0.0.into(), ..on(&obstacles) };
        let out = collide(&[0, cvs as u32], &rest, &goal, &how);
        let nearest = out.points[1..].iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
        assert!(nearest > 0.002 - 2e-6 && nearest < 0.004, "{cvs} CVs: {nearest}");
    }
}

/// Hairs that rise from roots in all directions by up to 50° from `up` of each, and their shapes in a wind.
fn blown(count: u64, cvs: usize, root: impl Fn(Key) -> [DVec3; 2]) -> (Vec<u32>, Vec<Vec3>, Vec<Vec3>) {
    let (mut rest, mut goal) = (Vec::new(), Vec::new());
    let wind = DVec3::new(1.0, -0.8, 0.3).normalize();
    for hair in 0..count {
        let key = Key::new(11).of(hair);
        let [at, up] = root(key);
        let aside = super::super::perpendicular(&up, &DVec3::new(0.3, 0.7, 0.2));
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * key.of(10).f64());
        let aside = aside * cosine + up.cross(&aside) * sine;
        let (tilt, step) = (0.2 + 0.7 * key.of(11).f64(), 0.008 + 0.01 * key.of(12).f64());
        let [mut standing, mut bent] = [at; 2];
        for k in 0..cvs {
            rest.push(to_f32(standing));
            goal.push(to_f32(bent));
            let (sine, cosine) = libm::sincos(tilt + 0.1 * k as f64);
            let direction = up * cosine + aside * sine;
            standing += direction * step;
            bent += (direction * 0.3 + wind).normalize() * step;
        }
    }
    ((0..=count).map(|hair| hair as u32 * cvs as u32).collect(), rest, goal)
}

/// From roots farther than half a width from a plane or a sphere, no axis comes nearer than half a width: by closed form,
/// with every method and at several widths.
#[test]
fn random_hairs_keep_half_their_width_from_a_plane_and_a_sphere() {
    let bodies = [floor(), super::hairs::sphere(24)];
    for (body, (points, triangles)) in bodies.iter().enumerate() {
        let tree = TriangleTree::build(points, triangles);
        let obstacles = [&tree];
        let (starts, rest, goal) = blown(250, 6, |key| {
            let [u, v, w] = [0, 1, 2].map(|k| 2.0 * key.of(k).f64() - 1.0);
            let up = DVec3::new(u, v, w).normalize();
            if body == 0 { [DVec3::new(u, 0.0062, v), DVec3::y()] } else { [up * 1.0062, up] }
        });
        // In f64, by sampling the axis densely against all faces near the hair for the sphere; a plane's distance is y.
        let corners: Vec<[DVec3; 3]> = triangles
            .iter()
            .map(|corners| corners.map(|corner| numerics::vector::to_f64(points[corner as usize])))
            .collect();
        let away = |p: &DVec3| {
            if body == 0 {
                return p.y;
            }
            let of = |corners: &[DVec3; 3]| numerics::closest_point::ClosestPoint::on(0, *p, *corners).distance;
            corners.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        for method in [ContactMethod::Exact, ContactMethod::Steps(16)] {
            for width in [0.0005, 0.002, 0.006, 0.012] {
                let how = Collide { method, width: Masked::uniform(width), offset_root: 1e-4.into(), ..on(&obstacles) };
                let out = collide(&starts, &rest, &goal, &how);
                let mut least = f64::INFINITY;
                for cvs in starts.windows(2).map(|ends| &out.points[ends[0] as usize..ends[1] as usize]) {
                    for ends in cvs.windows(2).map(|ends| [ends[0], ends[1]].map(numerics::vector::to_f64)) {
                        let parts = if body == 0 { 1 } else { 4 };
                        for part in 1..=parts {
                            least = least.min(away(&ends[0].lerp(&ends[1], f64::from(part) / f64::from(parts))));
                        }
                    }
                }
                let half = 0.5 * f64::from(width);
                assert!(least > half * 0.9999, "body {body}, {method:?}, width {width}: {least}");
                assert_eq!((out.too_near, out.near_roots, out.crossings_left), (0, 0, 0), "{method:?}, width {width}");
                assert!(out.contacts > 300, "{} contacts", out.contacts);
                // They lie as low as they may.
                assert!(method != ContactMethod::Exact || least < half + 3e-4, "width {width}: {least}");
            }
        }
    }
}

/// Where roots are nearer than half a width, that is counted, and ends rise to it.
#[test]
fn roots_nearer_than_half_a_width_are_counted() {
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    for height in [0.0, 1e-4, 0.0019, 0.0021] {
        let (starts, rest, goal) = blown(300, 5, |key| {
            let [u, v] = [0, 1].map(|k| 2.0 * key.of(k).f64() - 1.0);
            [DVec3::new(u, height, v), DVec3::y()]
        });
        let how = Collide { width: Masked::uniform(0.004), offset_root: 0.0.into(), ..on(&obstacles) };
        let out = collide(&starts, &rest, &goal, &how);
        assert_eq!((out.near_roots, out.too_near), (if height < 0.002 { 300 } else { 0 }, 0), "{height}");
        let least =
            (0..out.points.len()).filter(|cv| cv % 5 > 0).map(|cv| out.points[cv][1]).fold(f32::INFINITY, f32::min);
        assert!(least > 0.002 * 0.9999, "{height}: {least}");
    }
}

/// What ends nearer after having been that far away is counted: hairs that `blend` takes back towards a floor.
#[test]
fn axes_nearer_than_half_a_width_are_counted() {
    let (points, triangles) = floor();
    let tree = TriangleTree::build(&points, &triangles);
    let obstacles = [&tree];
    let (starts, rest, goal) = blown(300, 5, |key| {
        let [u, v] = [0, 1].map(|k| 2.0 * key.of(k).f64() - 1.0);
        [DVec3::new(u, 0.0025, v), DVec3::y()]
    });
    let how = Collide {
        width: Masked::uniform(0.004),
        offset_root: 0.0.into(),
        blend: Masked::uniform(0.5),
        ..on(&obstacles)
    };
    let out = collide(&starts, &rest, &goal, &how);
    let (mut too_near, mut missing) = (0, 0.0_f64);
    for cvs in starts.windows(2).map(|ends| &out.points[ends[0] as usize..ends[1] as usize]) {
        for ends in cvs.windows(2) {
            let height = ends[0][1].min(ends[1][1]);
            let crosses = ends[0][1].max(ends[1][1]) > 0.0 && height < 0.0;
            let nearest = if crosses { 0.0 } else { f64::from(ends[0][1].abs().min(ends[1][1].abs())) };
            too_near += u64::from(nearest < 0.002 * 0.999);
            missing = missing.max(1.0 - nearest / 0.002);
        }
    }
    assert!(too_near > 50, "{too_near}");
    assert_eq!((out.near_roots, out.too_near), (0, too_near));
    assert!((out.missing_width - missing).abs() < 1e-3, "{} {missing}", out.missing_width);
}
