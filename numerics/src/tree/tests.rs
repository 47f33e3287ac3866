//! Queries of the tree against going through all triangles one by one.

use super::*;
use crate::random::Key;
use crate::simd::Path;
use crate::vector::{DVec3, to_f64};

/// `count` triangles about `size` large in the unit box.
fn soup(seed: u64, count: u32, size: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let random = |triangle: u32, i: u64| Key::new(seed).of(u64::from(triangle)).of(i).f32();
    let corner = |triangle: u32, corner: u64| {
        [0, 1, 2].map(|axis| random(triangle, axis) + size * (random(triangle, 3 + 3 * corner + axis) - 0.5))
    };
    let points = (0..count).flat_map(|triangle| [0, 1, 2].map(|k| corner(triangle, k))).collect();
    (points, (0..count).map(|triangle| [0, 1, 2].map(|k| 3 * triangle + k)).collect())
}

/// Blades of grass: long, thin, many meeting in one point.
fn blades(count: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut points = vec![[0.5; 3]];
    let mut triangles = Vec::new();
    for blade in 0..count {
        let key = Key::new(3).of(u64::from(blade));
        let tip = [0, 1, 2].map(|axis| key.of(axis).f32());
        points.extend([tip, [tip[0] + 1e-4, tip[1], tip[2]]]);
        triangles.push([0, 2 * blade + 1, 2 * blade + 2]);
    }
    (points, triangles)
}

/// Distance of `p` to a triangle in f64: to the nearest of its three sides, or to its plane on the inside.
fn distance(corners: [Vec3; 3], p: Vec3) -> f64 {
    let [a, b, c] = corners.map(|corner| to_f64(corner) - to_f64(p));
    let side = |a: DVec3, b: DVec3| {
        let ab = b - a;
        let t = if ab.dot(&ab) > 0.0 { (-a.dot(&ab) / ab.dot(&ab)).clamp(0.0, 1.0) } else { 0.0 };
        (a + ab * t).norm()
    };
    let sides = side(a, b).min(side(b, c)).min(side(c, a));
    let normal = (b - a).cross(&(c - a));
    let turns = [(a, b), (b, c), (c, a)].map(|(a, b)| normal.dot(&a.cross(&b)));
    if normal.norm() > 0.0 && turns.iter().all(|turn| *turn >= 0.0) {
        return (normal.dot(&a).abs() / normal.norm()).min(sides);
    }
    sides
}

fn corners(points: &[Vec3], triangle: [u32; 3]) -> [Vec3; 3] {
    triangle.map(|point| points[point as usize])
}

/// Triangles whose own boxes meet `low`…`high`.
fn meeting(points: &[Vec3], triangles: &[[u32; 3]], low: Vec3, high: Vec3) -> Vec<u32> {
    let meets = |&triangle: &u32| {
        let corners = corners(points, triangles[triangle as usize]);
        (0..3).all(|axis| {
            let at = corners.map(|corner| corner[axis]);
            at.iter().all(|x| x.is_finite())
                && at.iter().copied().fold(f32::INFINITY, f32::min) <= high[axis]
                && at.iter().copied().fold(f32::NEG_INFINITY, f32::max) >= low[axis]
        })
    };
    (0..triangles.len() as u32).filter(meets).collect()
}

fn visited(tree: &TriangleTree, low: Vec3, high: Vec3) -> Vec<u32> {
    let mut found = Vec::new();
    tree.visit_box(low, high, |block, lanes| {
        found.extend((0..LANES).filter(|lane| lanes >> lane & 1 == 1).map(|lane| block.triangle[lane]));
    });
    found.sort_unstable();
    found
}

/// Compares boxes and nearest points with going through all triangles.
fn check(points: &[Vec3], triangles: &[[u32; 3]], tree: &TriangleTree) {
    for query in 0..200u64 {
        let key = Key::new(77).of(query);
        let p = [0, 1, 2].map(|axis| key.of(axis).f32() * 1.6 - 0.3);
        let size = key.of(3).f32() * 0.3;
        let (low, high) = (p, p.map(|x| x + size));
        assert_eq!(visited(tree, low, high), meeting(points, triangles, low, high));

        let distances: Vec<f64> = triangles.iter().map(|triangle| distance(corners(points, *triangle), p)).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let reach = key.of(4).f32() * 0.5;
        let Some(found) = tree.closest(p, reach) else {
            assert!(nearest > f64::from(reach) * (1.0 - 1e-6), "{nearest} is within {reach}");
            continue;
        };
        assert!((f64::from(found.distance) - nearest).abs() < 1e-6, "{} is not {nearest}", found.distance);
        assert!(distances[found.triangle as usize] - nearest < 1e-6);
        assert!(f64::from(found.distance) <= f64::from(reach) * (1.0 + 1e-6));
        let sum: f32 = found.weights.iter().sum();
        assert!((sum - 1.0).abs() < 3e-7 && found.weights.iter().all(|weight| *weight >= 0.0), "{:?}", found.weights);
        let corners = corners(points, triangles[found.triangle as usize]);
        for axis in 0..3 {
            let at: f32 = (0..3).map(|k| found.weights[k] * corners[k][axis]).sum();
            assert!((at - found.point[axis]).abs() < 1e-6);
            assert!((found.point[axis] - p[axis]).abs() <= found.distance * 1.000_001 + 1e-6);
        }
    }
}

#[test]
fn any_number_of_random_triangles_gives_what_brute_force_gives() {
    for count in [1, 2, 15, 16, 17, 255, 256, 257, 1000, 4097] {
        for size in [0.02, 0.5] {
            let (points, triangles) = soup(u64::from(count), count, size);
            check(&points, &triangles, &TriangleTree::build(&points, &triangles));
        }
    }
}

#[test]
fn slivers_segments_points_and_duplicates_give_what_brute_force_gives() {
    let (points, triangles) = blades(600);
    check(&points, &triangles, &TriangleTree::build(&points, &triangles));
    // Segments and points, and each of them twice.
    let (points, mut triangles) = soup(9, 300, 0.2);
    for (i, triangle) in triangles.iter_mut().enumerate() {
        triangle[2] = triangle[1];
        if i % 3 == 0 {
            triangle[1] = triangle[0];
            triangle[2] = triangle[0];
        }
    }
    triangles.extend(triangles.clone());
    check(&points, &triangles, &TriangleTree::build(&points, &triangles));
}

#[test]
fn equally_near_triangles_give_the_lowest_index() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let tree = TriangleTree::build(&points, &[[0, 1, 2]; 100]);
    let found = tree.closest([0.25, 0.25, 3.0], f32::INFINITY).unwrap();
    assert_eq!((found.triangle, found.weights, found.distance), (0, [0.5, 0.25, 0.25], 3.0));
    assert_eq!(found.point, [0.25, 0.25, 0.0]);
}

#[test]
fn an_empty_tree_finds_nothing() {
    let tree = TriangleTree::build(&[], &[]);
    assert!(tree.is_empty() && tree.blocks().is_empty());
    assert_eq!(tree.bounds(), ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]));
    assert_eq!(tree.closest([0.0; 3], f32::INFINITY), None);
    tree.visit_box([-1e30; 3], [1e30; 3], |_, _| panic!("there is nothing"));
    assert!(TriangleTree::default().is_empty());
}

#[test]
fn non_finite_triangles_are_left_out_until_a_refit_makes_them_finite() {
    let (sound, triangles) = soup(4, 500, 0.1);
    let mut broken = sound.clone();
    for triangle in (0..500).step_by(7) {
        broken[3 * triangle + triangle % 3][triangle % 2] = [f32::NAN, f32::INFINITY][triangle % 2];
    }
    let mut tree = TriangleTree::build(&broken, &triangles);
    assert_eq!((tree.left_out(), tree.is_empty()), (72, false));
    check_boxes(&broken, &triangles, &tree);
    tree.refit(&sound);
    assert_eq!(tree.left_out(), 0);
    check(&sound, &triangles, &tree);
    tree.refit(&vec![[f32::NAN; 3]; sound.len()]);
    assert!(tree.is_empty());
    assert_eq!(tree.closest([0.0; 3], f32::INFINITY), None);
}

fn check_boxes(points: &[Vec3], triangles: &[[u32; 3]], tree: &TriangleTree) {
    for query in 0..50u64 {
        let p = [0, 1, 2].map(|axis| Key::new(78).of(query).of(axis).f32());
        let high = p.map(|x| x + 0.2);
        assert_eq!(visited(tree, p, high), meeting(points, triangles, p, high));
        let found = tree.closest(p, f32::INFINITY).unwrap();
        assert!(
            found.distance.is_finite()
                && corners(points, triangles[found.triangle as usize]).as_flattened().iter().all(|x| x.is_finite())
        );
    }
}

#[test]
fn queries_that_are_nan_or_out_of_reach_find_nothing() {
    let (points, triangles) = soup(5, 100, 0.1);
    let tree = TriangleTree::build(&points, &triangles);
    assert_eq!(tree.closest([f32::NAN, 0.0, 0.0], f32::INFINITY), None);
    assert_eq!(tree.closest([0.5; 3], f32::NAN), None);
    assert_eq!(tree.closest([9.0; 3], 1.0), None);
    assert!(visited(&tree, [f32::NAN, 0.0, 0.0], [1.0; 3]).is_empty());
}

#[test]
fn a_refitted_tree_finds_what_a_new_one_finds() {
    let (points, triangles) = soup(6, 2000, 0.05);
    let mut tree = TriangleTree::build(&points, &triangles);
    let moved: Vec<Vec3> = points.iter().map(|[x, y, z]| [y * 0.7 + 0.2 * z, *x, 0.5 * z * z]).collect();
    tree.refit(&moved);
    check(&moved, &triangles, &tree);
    tree.refit(&points);
    assert_eq!(tree, TriangleTree::build(&points, &triangles));
}

#[test]
fn any_number_of_threads_builds_the_same_tree() {
    let (points, triangles) = soup(7, 10_000, 0.05);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| TriangleTree::build(&points, &triangles))
    };
    let alone = with(1);
    assert_eq!(with(2), alone);
    assert_eq!(with(7), alone);
}

#[test]
fn blocks_hold_each_triangle_once_and_blank_lanes_repeat_the_first() {
    let (points, triangles) = soup(8, 1003, 0.05);
    let tree = TriangleTree::build(&points, &triangles);
    let mut seen: Vec<u32> = tree.blocks().iter().flat_map(|block| block.triangle).filter(|i| *i != NONE).collect();
    seen.sort_unstable();
    assert!(seen.into_iter().eq(0..1003));
    let last = tree.blocks().last().unwrap();
    assert_eq!(last.triangle.iter().filter(|triangle| **triangle == NONE).count(), 5);
    assert_eq!(crate::lanes::get(&last.corners[1], 15), crate::lanes::get(&last.corners[1], 0));
}

#[test]
fn every_simd_path_finds_the_same_bits() {
    let (points, triangles) = soup(11, 3000, 0.1);
    let tree = TriangleTree::build(&points, &triangles);
    let key = |query: u64| Key::new(12).of(query);
    let from: Vec<Vec3> = (0..500).map(|query| [0, 1, 2].map(|axis| key(query).of(axis).f32() * 1.5 - 0.2)).collect();
    let narrow = tree.closest_each_on(Path::BASELINE, &from, 0.3);
    assert!(narrow.iter().any(Option::is_none) && narrow.iter().any(Option::is_some));
    for path in Path::all() {
        assert_eq!(tree.closest_each_on(path, &from, 0.3), narrow, "{}", path.name());
    }
}

#[test]
fn a_region_without_end_meets_every_triangle_and_nothing_else() {
    for count in [1, 17, 257, 5_000] {
        let (points, triangles) = soup(4, count, 0.1);
        let tree = TriangleTree::build(&points, &triangles);
        let region = Cuboid { low: [f32::NEG_INFINITY; 3], high: [f32::INFINITY; 3] };
        let found: u32 = tree.walk(region).map(|(_, lanes)| lanes.count_ones()).sum();
        assert_eq!(found, count);
        let nowhere = Cuboid { low: [f32::NAN; 3], high: [f32::NAN; 3] };
        assert_eq!(tree.walk(nowhere).count(), 0);
    }
}
