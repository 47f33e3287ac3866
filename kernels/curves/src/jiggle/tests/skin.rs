//! Oscillators carried along by the skin under their root.

use super::*;
use crate::attach::{RootPose, SkinBinding, attach_curves};
use numerics::vector::{DMat3, DQuat, DVec3, rotation, to_f32, to_f64};

/// A triangle, and a curve of four CVs on it.
const FACE: [Vec3; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.25], [0.0, 0.125, 1.0]];

fn curve(frame: u32) -> Vec<Vec3> {
    let sway = numerics::trig::sin_cos(0.9 * frame as f32).0;
    (0..4).map(|k| k as f32 / 4.0).map(|y| [0.25 + 0.3 * sway * y, y, 0.25 - 0.1 * sway * y * y]).collect()
}

/// A rigid motion: a rotation about a slanting axis and a translation, in f64.
fn moved(points: &[Vec3], angle: f64, by: [f64; 3]) -> Vec<Vec3> {
    let turn = rotation(DVec3::new(2.0, -1.0, 2.0) / 3.0, angle);
    points.iter().map(|p| to_f32(turn * to_f64(*p) + DVec3::from(by))).collect()
}

/// Roots on [`FACE`], which is at rest at `points`.
fn bound(points: &[Vec3], roots: &[Vec3]) -> SkinBinding {
    SkinBinding::to_closest(points, &[[0, 1, 2]], roots).unwrap()
}

/// The curves' offsets after `frames` frames, over a skin that moves by `motion`, or without a skin.
fn run(frames: u32, share: f64, skinned: bool, motion: impl Fn(u32) -> (f64, [f64; 3])) -> Vec<Vec3> {
    let at = |points: &[Vec3], frame: u32| {
        let (angle, by) = motion(frame);
        moved(points, angle, by)
    };
    let ramp = rising();
    let roots = bound(&at(&FACE, 0), &at(&curve(0), 0)[..1]);
    let mut before = roots.poses(&at(&FACE, 0));
    let mut jiggle = Jiggle::at_rest(&[0, 4], &at(&curve(0), 0), &at(&curve(0), 0));
    for frame in 1..=frames {
        let now = roots.poses(&at(&FACE, frame));
        let steps = RigidStep::all_between(&roots, &before, &now, share);
        let carries = skinned.then_some(&steps[..]);
        jiggle.step(&at(&curve(frame), frame), &spring(0.7, 0.15, &ramp, Drag::World), 1.0, carries);
        before = now;
    }
    jiggle.shape(1.0.into()).points
}

fn farthest(a: &[Vec3], b: &[Vec3]) -> f64 {
    let away = |(a, b): (&Vec3, &Vec3)| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).abs()).fold(0.0, f64::max);
    a.iter().zip(b).map(away).fold(0.0, f64::max)
}

/// Tumbling: up to a third of a turn a frame.
fn tumbling(frame: u32) -> (f64, [f64; 3]) {
    let t = f64::from(frame);
    (2.0 * libm::sin(0.8 * t) + 0.1 * t * t, [libm::sin(t), 0.3 * t, -0.5 * libm::cos(2.0 * t)])
}

#[test]
fn inheriting_all_motion_gives_the_swing_on_a_still_skin_moved_along() {
    for frames in [1, 3, 10, 40] {
        let still = run(frames, 1.0, true, |_| (0.0, [0.0; 3]));
        let (angle, by) = tumbling(frames);
        let expected = moved(&still, angle, by);
        let error = farthest(&run(frames, 1.0, true, tumbling), &expected);
        assert!(error < 4e-6, "frame {frames}: {error}");
    }
}

#[test]
fn rigid_motion_of_skin_and_curves_alone_leaves_no_swing() {
    // The curve is at rest relative to the skin, so all of its motion is the skin's.
    let rest = curve(0);
    let roots = bound(&FACE, &rest[..1]);
    let ramp = rising();
    let mut jiggle = Jiggle::at_rest(&[0, 4], &rest, &rest);
    let mut before = roots.poses(&FACE);
    for frame in 1..60 {
        let (angle, by) = tumbling(frame);
        let targets = moved(&rest, angle, by);
        let now = roots.poses(&moved(&FACE, angle, by));
        let steps = RigidStep::all_between(&roots, &before, &now, 1.0);
        jiggle.step(&targets, &spring(0.7, 0.15, &ramp, Drag::World), 1.0, Some(&steps));
        before = now;
        let ulps = 4.0 * 2e-6;
        assert!(farthest(&jiggle.shape(1.0.into()).points, &targets) < 1e-6 + ulps, "frame {frame}");
    }
}

#[test]
fn inheriting_no_motion_equals_having_no_skin_to_the_bit() {
    assert_eq!(bits(&run(20, 0.0, true, tumbling)), bits(&run(20, 1.0, false, tumbling)));
}

fn pose(rotation: DQuat, translation: [f64; 3]) -> RootPose {
    RootPose { translation: translation.into(), rotation, lost: false }
}

#[test]
fn a_fraction_of_a_motion_is_that_fraction_of_angle_and_translation() {
    let about_z = |angle: f64| rotation(DVec3::z(), angle);
    let root = DVec3::new(1.0, 0.0, 0.0);
    for angle in [0.1, 1.0, 3.1, -2.0] {
        let (from, to) = (pose(about_z(0.3), [0.0; 3]), pose(about_z(0.3 + angle), [1.0, 4.0, 0.0]));
        let step = RigidStep::between(root, &from, &to, 0.25);
        let (s, c) = libm::sincos(0.25 * angle);
        let expected = DMat3::new(c - 1.0, -s, 0.0, s, c - 1.0, 0.0, 0.0, 0.0, 0.0);
        assert!((step.change - expected).amax() < 1e-14, "{angle}: {step:?}");
        assert_eq!((step.about, step.shift), (root, DVec3::new(0.25, 1.0, 0.0)));
    }
    // Half a turn exactly, about each axis: half of it is a quarter turn, in either direction.
    for axis in 0..3 {
        let mut imaginary = [0.0; 3];
        imaginary[axis] = 1.0;
        let [x, y, z] = imaginary;
        let half_turn = DQuat::new_unchecked(nalgebra::Quaternion::new(0.0, x, y, z));
        let step = RigidStep::between(root, &pose(DQuat::identity(), [0.0; 3]), &pose(half_turn, [0.0; 3]), 0.5);
        for k in 0..3 {
            let expected = if k == axis { 0.0 } else { -1.0 };
            assert!((step.change[(k, k)] - expected).abs() < 1e-14, "{axis}: {step:?}");
        }
    }
    let here = pose(about_z(0.3), [5.0, 1e7, -3.0]);
    assert_eq!(RigidStep::between(root, &here, &here, 1.0), RigidStep::NONE);
}

#[test]
fn a_collapsed_skin_moves_its_curves_without_rotating_them() {
    let roots = bound(&FACE, &[[0.25; 3]]);
    let [whole, turned, flat] =
        [FACE.to_vec(), moved(&FACE, 1.0, [0.0; 3]), vec![[1.0; 3]; 3]].map(|skin| roots.poses(&skin)[0]);
    assert!(flat.lost && !turned.lost);
    let root = DVec3::repeat(0.25);
    // Steps into the collapse and out of it.
    for (from, to) in [(turned, flat), (flat, turned)] {
        let step = RigidStep::between(root, &from, &to, 1.0);
        assert_eq!((step.change, step.shift), (DMat3::zeros(), to.translation - from.translation));
    }
    assert_ne!(RigidStep::between(root, &whole, &turned, 1.0).change, DMat3::zeros());
}

/// A strip of `n` by 2 squares along x, 1 m wide and 4 long, twisted about x by `angle` a metre.
fn twisted_strip(n: u32, angle: f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let length = 4.0 / f64::from(n);
    let point = |row: u32, column: u32| {
        let (x, z) = (length * f64::from(row), 0.5 * (f64::from(column) - 1.0));
        let (s, c) = libm::sincos(angle * x);
        to_f32(DVec3::new(x, -s * z, c * z))
    };
    let points = (0..=n).flat_map(|row| (0..3).map(move |column| point(row, column))).collect();
    let squares = (0..n).flat_map(|row| (0..2).map(move |column| 3 * row + column));
    (points, squares.flat_map(|a| [[a, a + 1, a + 4], [a, a + 4, a + 3]]).collect())
}

#[test]
fn attached_and_jiggled_curves_have_the_same_frame_on_a_twisting_skin() {
    let (rest, triangles) = twisted_strip(9, 0.0);
    let roots: Vec<Vec3> = (0..300).map(|k| [0.1 + 0.0125 * k as f32, 0.01, -0.4 + 0.0025 * k as f32]).collect();
    let points: Vec<Vec3> = roots.iter().flat_map(|[x, y, z]| [[*x, *y, *z], [x + 0.02, y + 0.1, z - 0.03]]).collect();
    let starts: Vec<u32> = (0..=300).map(|curve| 2 * curve).collect();
    let binding = SkinBinding::to_closest(&rest, &triangles, &roots).unwrap();
    let mut carried: Vec<DVec3> = points.iter().map(|p| to_f64(*p)).collect();
    let mut before = binding.poses(&rest);
    for frame in 1..=20 {
        let now = binding.poses(&twisted_strip(9, 0.05 * f64::from(frame)).0);
        let steps = RigidStep::all_between(&binding, &before, &now, 1.0);
        for (k, p) in carried.iter_mut().enumerate() {
            let RigidStep { change, about, shift } = steps[k / 2];
            *p += change * (*p - about) + shift;
        }
        let attached = attach_curves(&starts, &points, &now).points;
        let carried: Vec<Vec3> = carried.iter().map(|p| to_f32(*p)).collect();
        assert!(farthest(&attached, &carried) < 1e-6, "frame {frame}: {}", farthest(&attached, &carried));
        before = now;
    }
    assert!(before.iter().any(|pose| pose.rotation.angle() > 2.0));
}

#[test]
fn inherited_motion_is_continuous_across_faces() {
    // From root to root 1 mm, over 18 squares and their diagonals, while the skin twists by a quarter a metre.
    let (rest, triangles) = twisted_strip(9, 0.0);
    let roots: Vec<Vec3> = (0..3800).map(|k| [0.1 + 0.001 * k as f32, 0.0, -0.45 + 0.00023 * k as f32]).collect();
    let binding = SkinBinding::to_closest(&rest, &triangles, &roots).unwrap();
    let [from, to] = [rest, twisted_strip(9, 1.57).0].map(|skin| binding.poses(&skin));
    let steps = RigidStep::all_between(&binding, &from, &to, 1.0);
    let jump = steps.windows(2).map(|pair| (pair[1].change - pair[0].change).norm()).fold(0.0, f64::max);
    // A millimetre of twist rotates by 1.6e-3 rad, which is √2 times that in the norm of the matrix. The frame of a
    // face alone would jump by a sixth of a quarter.
    assert!(jump < 3.0 * 1.57e-3 * 2.0_f64.sqrt(), "{jump}");
}
