//! Tests of curves bound to a skin.

use super::*;
use crate::scatter::ScatterSurface;
use crate::surface::SurfacePoint;
use numerics::random::Key;
use numerics::shapes;
use numerics::vector::{DQuat, DVec3, direction, rotation, to_f32, to_f64};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

type Point = [f32; 3];

/// A skin of triangles.
struct Skin {
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
}

impl Skin {
    fn of(shape: &shapes::Polygons) -> Self {
        Self { points: shape.points.iter().map(|p| p.map(|x| x as f32)).collect(), triangles: shape.triangles() }
    }

    /// `n` by `n` squares of size 1 in x and z, each cut along the diagonal from its lowest corner, facing up.
    fn grid(n: u32) -> Self {
        let row = n + 1;
        let points = (0..row * row).map(|i| [(i / row) as f32, 0.0, (i % row) as f32]).collect();
        let square = |i: u32| {
            let a = i / n * row + i % n;
            [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]
        };
        Self { points, triangles: (0..n * n).flat_map(square).collect() }
    }

    fn moved(&self, to: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Point> {
        self.points.iter().map(|p| to(to_f64(*p).into()).map(|x| x as f32)).collect()
    }

    fn bind(&self, roots: &[Point]) -> SkinBinding {
        SkinBinding::to_closest(&self.points, &self.triangles, roots).unwrap()
    }

    /// Points on the grid, lifted by up to `lift`.
    fn roots(&self, count: usize, lift: f32) -> Vec<Point> {
        let points = ScatterSurface::new(&self.points, &self.triangles).spread(count, Key::new(5));
        let normals = SkinBinding::to_surface(&self.points, &self.triangles, &points).normals();
        let root = |(i, (point, normal)): (usize, (&SurfacePoint, DVec3))| {
            let lift = f64::from(lift * Key::new(6).of(i as u64).f32());
            to_f32(point.position(&self.points, &self.triangles) + normal * lift)
        };
        points.iter().zip(normals).enumerate().map(root).collect()
    }
}

/// Bent curves of 5 CVs from `roots`, 0.1 long, and the start of each.
fn curves(roots: &[Point]) -> (Vec<u32>, Vec<Point>) {
    let cv = |(i, root): (usize, &Point)| {
        let key = Key::new(9).of(i as u64);
        let slope: [f32; 3] = std::array::from_fn(|k| 0.1 * key.of(k as u64).f32() - 0.05);
        let root = *root;
        (0..5).map(move |k| std::array::from_fn(|d| root[d] + 0.25 * k as f32 * slope[d] + 0.002 * (k * k * d) as f32))
    };
    let starts = (0..=roots.len() as u32).map(|curve| 5 * curve).collect();
    (starts, roots.iter().enumerate().flat_map(cv).collect())
}

fn about(axis: [f64; 3], angle: f64) -> DQuat {
    rotation(direction(axis.into()).unwrap(), angle)
}

/// `p` rotated.
fn rotated(q: DQuat, p: [f64; 3]) -> [f64; 3] {
    (q * DVec3::from(p)).into()
}

/// Radians between two rotations.
fn between(a: DQuat, b: DQuat) -> f64 {
    let q = a * b.inverse();
    2.0 * libm::atan2(q.vector().norm(), q.w.abs())
}

fn farthest(a: &[Point], b: &[Point]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (to_f64(*a) - to_f64(*b)).norm()).fold(0.0, f64::max)
}

/// Change of a length by rounding to f32 alone, relative to its curve's: 4 ulp, as for every length in this crate.
fn rounding(starts: &[u32], points: &[Point]) -> f64 {
    let size = points.iter().fold(0.0, |most: f32, p| most.max(numerics::vector::largest(*p)));
    let whole = |pair: &[u32]| {
        let curve = &points[pair[0] as usize..pair[1] as usize];
        curve.windows(2).map(|pair| (to_f64(pair[1]) - to_f64(pair[0])).norm()).sum::<f64>()
    };
    let shortest = starts.windows(2).map(whole).fold(f64::INFINITY, f64::min);
    4.0 * f64::from(size.next_up() - size) / shortest
}

const UP: [f64; 3] = [0.0, 1.0, 0.0];

#[test]
fn a_rigid_skin_moves_its_curves_rigidly() {
    let skin = Skin::of(&shapes::torus([2.0, 0.6, 2.0], 12));
    let roots = skin.roots(400, 0.05);
    let (starts, points) = curves(&roots);
    let binding = skin.bind(&roots);
    for (turn, shift) in [(about(UP, 0.0), [1.0, 2.0, 3.0]), (about([1.0, -2.0, 0.5], 2.5), [0.3, -0.2, 0.1])] {
        let rigid = |p: [f64; 3]| (turn * DVec3::from(p) + DVec3::from(shift)).into();
        let poses = binding.poses(&skin.moved(rigid));
        let carried = attach_curves(&starts, &points, &poses);
        let expected: Vec<Point> = points.iter().map(|p| rigid(to_f64(*p).into()).map(|x: f64| x as f32)).collect();
        // The tolerance is 1e-6 of a scene of size 4: f32 has a spacing of 2e-7 there.
        let worst = farthest(&carried.points, &expected);
        assert!(worst < 1e-6, "{worst}");
        assert!(poses.iter().all(|pose| between(pose.rotation, turn) < 2e-6 && !pose.lost));
        assert!(carried.length_error < rounding(&starts, &carried.points), "{}", carried.length_error);
    }
}

#[test]
fn a_still_skin_moves_nothing() {
    let skin = Skin::of(&shapes::sphere([1.0; 3], 9));
    let roots = skin.roots(100, 0.02);
    let (starts, points) = curves(&roots);
    let carried = attach_curves(&starts, &points, &skin.bind(&roots).poses(&skin.points));
    assert!(farthest(&carried.points, &points) < 1e-7);
}

#[test]
fn scale_moves_roots_and_rotates_nothing() {
    let skin = Skin::of(&shapes::sphere([2.0; 3], 9));
    let roots = skin.roots(200, 0.1);
    let (starts, points) = curves(&roots);
    for size in [0.5, 3.0] {
        let poses = skin.bind(&roots).poses(&skin.moved(|p| p.map(|x| size * x)));
        assert!(poses.iter().all(|pose| between(pose.rotation, DQuat::identity()) < 1e-6));
        let carried = attach_curves(&starts, &points, &poses);
        assert!(carried.length_error < rounding(&starts, &carried.points));
    }
    // A root 0.25 above a floor keeps that height; its foot at (1.5, 0, 0.5) moves by twice itself.
    let floor = Skin::grid(2);
    let pose = floor.bind(&[[1.5, 0.25, 0.5]]).poses(&floor.moved(|p| p.map(|x| 3.0 * x)))[0];
    assert!((pose.translation - DVec3::new(3.0, 0.0, 1.0)).norm() < 1e-12, "{pose:?}");
}

#[test]
fn stretch_along_the_skin_rotates_nothing_and_shear_rotates_by_half() {
    let floor = Skin::grid(4);
    let bound = floor.bind(&floor.roots(50, 0.1));
    let stretched = bound.poses(&floor.moved(|[x, y, z]| [5.0 * x, y, 0.2 * z]));
    assert!(stretched.iter().all(|pose| between(pose.rotation, DQuat::identity()) < 1e-6));
    // x += k·z. In the plane, the nearest rotation is by atan(k/2) about y, from z to x.
    let sheared = bound.poses(&floor.moved(|[x, y, z]| [x + z, y, z]));
    assert!(sheared.iter().all(|pose| between(pose.rotation, about(UP, libm::atan(0.5))) < 1e-6));
}

#[test]
fn a_twisted_cylinder_rotates_curves_about_its_axis_and_in_its_surface() {
    // (r, θ, y) → (r, θ + 2y, y), r = 0.5: along the surface a shear by r·2 = 1, which rotates by atan(1/2) about the
    // normal, after a rotation by 2y about the axis.
    let twist = |n: usize| {
        let skin = Skin::of(&shapes::cylinder([1.0, 2.0, 1.0], n));
        let roots: Vec<Point> = skin.roots(2000, 0.0).into_iter().filter(|p| p[1].abs() < 0.7).collect();
        let now = skin.moved(|p| rotated(about(UP, 2.0 * p[1]), p));
        let poses = skin.bind(&roots).poses(&now);
        let error = |(root, pose): (&Point, &RootPose)| {
            let out = [f64::from(root[0]), 0.0, f64::from(root[2])];
            if DVec3::from(out).norm() < 0.45 {
                return 0.0;
            }
            let spun = about(UP, 2.0 * f64::from(root[1]));
            let sheared = about(out, libm::atan(0.5));
            between(pose.rotation, spun * sheared).min(between(pose.rotation, spun * sheared.inverse()))
        };
        roots.iter().zip(&poses).map(error).fold(0.0, f64::max)
    };
    let (coarse, fine) = (twist(8), twist(32));
    assert!(fine < 0.02 && fine < 0.5 * coarse, "{coarse} {fine}");
}

/// The part right of x = 2, folded up about that line.
fn folded([x, y, z]: [f64; 3], angle: f64) -> [f64; 3] {
    if x <= 2.0 {
        return [x, y, z];
    }
    let out = rotated(about([0.0, 0.0, 1.0], angle), [x - 2.0, y, 0.0]);
    [2.0 + out[0], out[1], z]
}

#[test]
fn a_fold_rotates_curves_by_half_on_the_edge_and_smoothly_beside_it() {
    // A point on the edge has three triangles of equal area on either side: (I + R)/2, a rotation by 45°. From there to
    // the next point, where it is R, the matrix is interpolated linearly: in the middle I/4 + 3R/4, a rotation by
    // atan(3).
    let floor = Skin::grid(4);
    let roots: Vec<Point> = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5].map(|x| [x, 0.0, 2.0]).to_vec();
    let poses = floor.bind(&roots).poses(&floor.moved(|p| folded(p, FRAC_PI_2)));
    let angles = [0.0, 0.0, libm::atan(1.0 / 3.0), FRAC_PI_4, libm::atan(3.0), FRAC_PI_2, FRAC_PI_2];
    for (pose, angle) in poses.iter().zip(angles) {
        assert!(between(pose.rotation, about([0.0, 0.0, 1.0], angle)) < 1e-6, "{angle}: {pose:?}");
    }
}

#[test]
fn neighbours_rotate_alike_across_every_edge() {
    // From root to root, 1e-3 of a face apart, the rotation changes by at most a few times 90° × 1e-3.
    let floor = Skin::grid(4);
    let line: Vec<Point> = (0..4000).map(|i| [1e-3 * i as f32, 0.0, 0.37 + 0.8e-3 * i as f32]).collect();
    let poses = floor.bind(&line).poses(&floor.moved(|p| folded(p, FRAC_PI_2)));
    let most = poses.windows(2).map(|pair| between(pair[0].rotation, pair[1].rotation)).fold(0.0, f64::max);
    assert!(most < 3e-3, "{most}");
    // Continuity in time: a thousandth of the fold changes no rotation by more than three times that.
    let bound = floor.bind(&line[..3000]);
    let at = |step: u32| bound.poses(&floor.moved(|p| folded(p, 2.5 * f64::from(step) / 1000.0)));
    for step in [0, 1, 300, 627, 628, 900] {
        let change = |(a, b): (RootPose, RootPose)| between(a.rotation, b.rotation);
        let most = at(step).into_iter().zip(at(step + 1)).map(change).fold(0.0, f64::max);
        assert!(most < 3.0 * 2.5e-3, "{step}: {most}");
    }
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_result() {
    let skin = Skin::of(&shapes::torus([2.0, 0.6, 2.0], 8));
    let bent = |[x, y, z]: [f64; 3]| [x + 0.3 * y * z, y - 0.2 * x * x, 1.5 * z];
    let mirror = |p: &Point| [-p[0], p[1], p[2]];
    let roots = skin.roots(200, 0.05);
    let (starts, points) = curves(&roots);
    let expected = attach_curves(&starts, &points, &skin.bind(&roots).poses(&skin.moved(bent)));
    let now: Vec<Point> = skin.moved(bent).iter().map(mirror).collect();
    let points: Vec<Point> = points.iter().map(mirror).collect();
    let roots: Vec<Point> = roots.iter().map(mirror).collect();
    // With faces reversed, so that outside stays outside, and without.
    for order in [[0, 1, 2], [0, 2, 1]] {
        let triangles = skin.triangles.iter().map(|corners| order.map(|k| corners[k])).collect();
        let mirrored = Skin { points: skin.points.iter().map(mirror).collect(), triangles };
        let carried = attach_curves(&starts, &points, &mirrored.bind(&roots).poses(&now));
        let back: Vec<Point> = carried.points.iter().map(mirror).collect();
        assert!(farthest(&back, &expected.points) < 1e-6);
    }
}

#[test]
fn results_do_not_depend_on_the_scale_of_the_scene() {
    let skin = Skin::of(&shapes::sphere([1.0; 3], 8));
    let bent = |[x, y, z]: [f64; 3]| [x + 0.5 * y * z, y - 0.3 * x, 1.2 * z];
    let roots = skin.roots(100, 0.05);
    let expected = skin.bind(&roots).poses(&skin.moved(bent));
    // 2⁻⁶⁰, 2⁻²⁰, 2²⁰ and 2¹⁰⁰.
    for size in [1.0 / f32::from_bits(187 << 23), 1.0 / 1_048_576.0, 1_048_576.0, f32::from_bits(227 << 23)] {
        let sized = |points: &[Point]| points.iter().map(|p| p.map(|x| x * size)).collect::<Vec<_>>();
        let large = Skin { points: sized(&skin.points), triangles: skin.triangles.clone() };
        let poses = large.bind(&sized(&roots)).poses(&sized(&skin.moved(bent)));
        for (pose, expected) in poses.iter().zip(&expected) {
            assert!(between(pose.rotation, expected.rotation) < 1e-6, "{size}");
            assert!((pose.translation / f64::from(size) - expected.translation).norm() < 1e-6, "{size}");
        }
    }
}

#[test]
fn curves_on_a_face_without_area_follow_its_neighbours() {
    // One point of the grid coincides with another: two triangles are lines, at rest or now.
    let flat = |mut skin: Skin| {
        skin.points[12] = skin.points[11];
        skin
    };
    let turn = about([0.3, 1.0, 0.2], 1.0);
    let floor = flat(Skin::grid(4));
    let roots: Vec<Point> = (0..40).map(|i| [0.1 * i as f32, 0.01, 0.09 * i as f32]).collect();
    for pose in floor.bind(&roots).poses(&floor.moved(|p| rotated(turn, p))) {
        assert!(between(pose.rotation, turn) < 2e-6 && !pose.lost);
    }
    let whole = Skin::grid(4);
    for pose in whole.bind(&roots).poses(&floor.points) {
        assert!(!pose.lost && between(pose.rotation, DQuat::identity()) < 0.8, "{pose:?}");
    }
}

#[test]
fn a_collapsed_skin_moves_its_curves_without_rotating_them() {
    let floor = Skin::grid(2);
    let roots = [[0.5, 0.0, 0.5], [1.5, 0.25, 1.0]];
    let bound = floor.bind(&roots);
    let (starts, points) = curves(&roots);
    let to_nothing: fn([f64; 3]) -> [f64; 3] = |_| [7.0, 8.0, 9.0];
    let to_a_line: fn([f64; 3]) -> [f64; 3] = |[x, _, _]| [x, 0.0, 0.0];
    for (to, expected) in [(to_nothing, [6.5, 8.0, 8.5]), (to_a_line, [0.0, 0.0, -0.5])] {
        let poses = bound.poses(&floor.moved(to));
        assert!(poses.iter().all(|pose| pose.lost && pose.rotation == DQuat::identity()));
        assert_eq!(poses[0].translation, DVec3::from(expected));
        let carried = attach_curves(&starts, &points, &poses);
        assert!(carried.length_error < rounding(&starts, &carried.points));
    }
}

#[test]
fn a_skin_turned_inside_out_rotates_its_curves_inwards() {
    // Mirrored at its plane: the normal rotates by half a turn about some axis in the floor.
    let floor = Skin::grid(2);
    for pose in floor.bind(&floor.roots(10, 0.0)).poses(&floor.moved(|[x, y, z]| [-x, y, 0.9 * z])) {
        assert!(!pose.lost && (pose.rotation * DVec3::y()).y < -0.999, "{pose:?}");
    }
}

#[test]
fn non_finite_points_affect_only_roots_near_them() {
    let floor = Skin::grid(4);
    let roots: Vec<Point> = vec![[0.2, 0.0, 0.1], [3.8, 0.0, 3.9], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0]];
    let bound = floor.bind(&roots);
    let mut now = floor.points.clone();
    now[24] = [f32::NAN, f32::INFINITY, 0.0];
    let poses = bound.poses(&now);
    assert_eq!((poses[0].translation, poses[0].lost, poses[1].lost), (DVec3::zeros(), false, true));
    let holed = Skin { points: now, triangles: floor.triangles.clone() };
    let poses = holed.bind(&roots[..1]).poses(&floor.points);
    assert_eq!((poses[0].translation, poses[0].lost), (DVec3::zeros(), false));
    let (starts, points) = curves(&roots);
    let _ = attach_curves(&starts, &points, &bound.poses(&floor.points));
}

#[test]
fn far_roots_are_bound_and_their_distance_is_reported() {
    let floor = Skin::grid(4);
    let bound = floor.bind(&[[2.0, 0.0, 2.0], [2.0, 30.0, 2.0], [2.5, -40.0, 1.0]]);
    assert_eq!(bound.max_distance(), 40.0);
    // They rotate with the skin beneath them as if on poles.
    let poses = bound.poses(&floor.moved(|p| rotated(about([0.0, 0.0, 1.0], FRAC_PI_2), p)));
    let at = |root: [f64; 3], pose: &RootPose| DVec3::from(root) + pose.translation;
    assert!((at([2.0, 30.0, 2.0], &poses[1]) - DVec3::new(-30.0, 2.0, 2.0)).norm() < 1e-5);
    assert!(floor.bind(&[[1e30, 1e30, 0.0]]).poses(&floor.points)[0].translation == DVec3::zeros());
}

#[test]
fn empty_inputs_are_valid() {
    let floor = Skin::grid(1);
    assert!(floor.bind(&[]).poses(&floor.points).is_empty());
    assert!(SkinBinding::to_closest(&[], &[], &[]).is_some());
    assert!(SkinBinding::to_closest(&floor.points, &[], &[[0.0; 3]]).is_none());
    let carried = attach_curves(&[0], &[], &[]);
    assert!(carried.points.is_empty() && carried.length_error == 0.0);
}

#[test]
fn vectors_and_orientations_rotate_with_their_curves() {
    let quarter =
        RootPose { translation: DVec3::repeat(5.0), rotation: about([0.0, 0.0, 1.0], FRAC_PI_2), lost: false };
    let still = RootPose { translation: DVec3::repeat(1.0), rotation: DQuat::identity(), lost: false };
    let mut vectors = [[1.0, 0.0, 2.0]; 3];
    rotate_vectors(&[0, 2, 3], &mut vectors, &[quarter, still]);
    assert!(farthest(&vectors, &[[0.0, 1.0, 2.0], [0.0, 1.0, 2.0], [1.0, 0.0, 2.0]]) < 1e-6);
    // A quarter turn about z after a quarter turn about x.
    let half = (SQRT_2 / 2.0) as f32;
    let mut turns = [[half, 0.0, 0.0, half]; 2];
    rotate_orientations(&[0, 1, 2], &mut turns, &[quarter, still]);
    for (found, expected) in turns[0].iter().zip([0.5, 0.5, 0.5, 0.5]) {
        assert!((found - expected).abs() < 1e-6);
    }
    assert_eq!(turns[1], [half, 0.0, 0.0, half]);
}

#[test]
fn every_number_of_threads_gives_the_same_bits() {
    let skin = Skin::of(&shapes::sphere([2.0; 3], 24));
    let bent = skin.moved(|[x, y, z]| [x + 0.3 * y * z, y - 0.2 * x * x, 1.5 * z]);
    let roots = skin.roots(6000, 0.05);
    let (starts, points) = curves(&roots);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| attach_curves(&starts, &points, &skin.bind(&roots).poses(&bent)))
    };
    let expected = run(1);
    assert!(expected == run(2) && expected == run(7));
}

#[test]
fn normals_point_outward_and_bend_smoothly() {
    let skin = Skin::of(&shapes::sphere([2.0; 3], 24));
    let roots = skin.roots(500, 0.0);
    for (root, normal) in roots.iter().zip(skin.bind(&roots).normals()) {
        assert!(direction(to_f64(*root)).unwrap().cross(&normal).norm() < 0.02 && (normal.norm() - 1.0).abs() < 1e-12);
    }
}
