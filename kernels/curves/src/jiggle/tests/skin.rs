//! Oscillators carried along by the face under their root.

use super::*;

/// A triangle, and a curve of four CVs upon it.
const FACE: [Vec3; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.25], [0.0, 0.125, 1.0]];

fn curve(frame: u32) -> Vec<Vec3> {
    let sway = numerics::trig::sin_cos(0.9 * frame as f32).0;
    (0..4).map(|k| k as f32 / 4.0).map(|y| [0.25 + 0.3 * sway * y, y, 0.25 - 0.1 * sway * y * y]).collect()
}

/// A rigid motion: rotation about a slanting axis and a way, in f64.
fn moved(points: &[Vec3], angle: f64, way: [f64; 3]) -> Vec<Vec3> {
    let (s, c) = libm::sincos(angle);
    let n = [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0];
    let turned = |p: [f64; 3]| -> [f64; 3] {
        let along = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
        let side = closest::cross(n, p);
        std::array::from_fn(|k| p[k] * c + side[k] * s + n[k] * along * (1.0 - c) + way[k])
    };
    points.iter().map(|p| turned(p.map(f64::from)).map(|x| x as f32)).collect()
}

/// The curves' offsets after `frames` frames, over a skin that moves as `motion` says, or none.
fn run(frames: u32, share: f64, skinned: bool, motion: impl Fn(u32) -> (f64, [f64; 3])) -> Vec<Vec3> {
    let at = |points: &[Vec3], frame: u32| {
        let (angle, way) = motion(frame);
        moved(points, angle, way)
    };
    let ramp = rising();
    let roots = Roots::bind(&[0, 3], &[0, 1, 2], &at(&FACE, 0), &at(&curve(0), 0)[..1]).unwrap();
    let mut before = roots.frames(&at(&FACE, 0));
    let mut jiggle = Jiggle::at_rest(&[0, 4], &at(&curve(0), 0), &at(&curve(0), 0));
    for frame in 1..=frames {
        let now = roots.frames(&at(&FACE, frame));
        let carry = [Carry::between(&before[0], &now[0], share)];
        let carries = skinned.then_some(&carry[..]);
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
fn with_all_motion_inherited_a_swing_on_a_tumbling_skin_is_the_swing_on_a_still_one_moved_along() {
    for frames in [1, 3, 10, 40] {
        let still = run(frames, 1.0, true, |_| (0.0, [0.0; 3]));
        let (angle, way) = tumbling(frames);
        let expected = moved(&still, angle, way);
        let error = farthest(&run(frames, 1.0, true, tumbling), &expected);
        assert!(error < 4e-6, "frame {frames}: {error}");
    }
}

#[test]
fn rigid_motion_of_skin_and_curves_alone_leaves_no_swing() {
    // The curve is its own at rest, so all it does is the skin's.
    let rest = curve(0);
    let roots = Roots::bind(&[0, 3], &[0, 1, 2], &FACE, &rest[..1]).unwrap();
    let ramp = rising();
    let mut jiggle = Jiggle::at_rest(&[0, 4], &rest, &rest);
    let mut before = roots.frames(&FACE);
    for frame in 1..60 {
        let (angle, way) = tumbling(frame);
        let targets = moved(&rest, angle, way);
        let now = roots.frames(&moved(&FACE, angle, way));
        let carry = [Carry::between(&before[0], &now[0], 1.0)];
        jiggle.step(&targets, &spring(0.7, 0.15, &ramp, Drag::World), 1.0, Some(&carry));
        before = now;
        let ulps = 4.0 * 2e-6;
        assert!(farthest(&jiggle.shape(1.0.into()).points, &targets) < 1e-6 + ulps, "frame {frame}");
    }
}

#[test]
fn with_none_inherited_it_swings_as_in_the_world_to_the_bit() {
    assert_eq!(bits(&run(20, 0.0, true, tumbling)), bits(&run(20, 1.0, false, tumbling)));
}

#[test]
fn a_share_of_a_motion_is_that_share_of_angle_and_way() {
    let frame = |angle: f64, origin: [f64; 3]| {
        let (s, c) = libm::sincos(angle);
        Frame { axes: [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], origin }
    };
    for angle in [0.1, 1.0, 3.1, -2.0] {
        let carry = Carry::between(&frame(0.3, [1.0, 0.0, 0.0]), &frame(0.3 + angle, [2.0, 4.0, 0.0]), 0.25);
        let (s, c) = libm::sincos(0.25 * angle);
        let expected = [[c - 1.0, -s, 0.0], [s, c - 1.0, 0.0], [0.0; 3]];
        for (found, expected) in carry.change.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-14, "{angle}: {carry:?}");
        }
        assert_eq!((carry.about, carry.shift), ([1.0, 0.0, 0.0], [0.25, 1.0, 0.0]));
    }
    // Half a turn exactly, about each axis: half of it is a quarter, whichever way round.
    for axis in 0..3 {
        let turned = std::array::from_fn(|k| {
            std::array::from_fn(|i| {
                if i != k {
                    0.0
                } else if k == axis {
                    1.0
                } else {
                    -1.0
                }
            })
        });
        let still = frame(0.0, [0.0; 3]);
        let carry = Carry::between(&still, &Frame { axes: turned, origin: [0.0; 3] }, 0.5);
        for k in 0..3 {
            let expected = if k == axis { 0.0 } else { -1.0 };
            assert!((carry.change[k][k] - expected).abs() < 1e-14, "{axis}: {carry:?}");
        }
    }
    let here = frame(0.3, [5.0, 1e7, -3.0]);
    assert_eq!(Carry::between(&here, &here, 1.0), Carry::NONE);
}

#[test]
fn a_face_that_loses_its_area_keeps_its_frame_at_rest() {
    let roots = Roots::bind(&[0, 3], &[0, 1, 2], &FACE, &[[0.25; 3]]).unwrap();
    let flat = roots.frames(&[[1.0; 3]; 3]);
    assert_eq!(flat[0].axes, roots.frames(&FACE)[0].axes);
    assert!((0..3).all(|k| (flat[0].origin[k] - 1.0).abs() < 1e-12));
    assert!(Roots::bind(&[0, 3], &[0, 0, 1], &FACE, &[[0.0; 3]]).is_none());
    assert!(Roots::bind(&[0], &[], &[], &[[0.0; 3]]).is_none());
    // A quad is a fan of two triangles.
    let quad = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let roots = Roots::bind(&[0, 4], &[0, 1, 2, 3], &quad, &[[0.1, 0.9, 0.3]]).unwrap();
    let found = roots.frames(&quad)[0].origin;
    assert!((found[0] - 0.1).abs() < 1e-7 && (found[1] - 0.9).abs() < 1e-7 && found[2] == 0.0);
}
