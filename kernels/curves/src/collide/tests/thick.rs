//! Curves with a thickness.

use super::hairs::{floor, on};
use super::*;
use numerics::masked::Masked;
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
