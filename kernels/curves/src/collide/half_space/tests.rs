//! Turns that a half-space frees, against the sweep through the trees that they save.

use super::super::crossing::first_crossing_in;
use super::super::segment_turn::Nearby;
use super::super::turn_axes::TurnAxes;
use super::super::{ContactMethod, SkinSurface};
use super::*;
use numerics::masked::Masked;
use numerics::random::Key;
use numerics::tree::TriangleTree;

fn number(key: Key, low: f64, high: f64) -> f64 {
    low + (high - low) * key.f64()
}

/// A direction with this slope.
fn sloping(key: Key, slope: f64) -> DVec3 {
    let (sine, cosine) = libm::sincos(number(key, 0.0, std::f64::consts::TAU));
    let side = (1.0 - slope * slope).max(0.0).sqrt();
    DVec3::new(side * cosine, side * sine, slope)
}

/// A skin of triangles whose corners lie in a disc of radius 1 at heights 0 or a little less, times `size`.
fn bumps(key: Key, size: f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corner = |k: u64| {
        let key = key.of(k);
        let low = number(key.of(0), 0.0, 1.0);
        let at = sloping(key.of(1), 0.0) * number(key.of(2), 0.0, 1.0);
        DVec3::new(at.x, at.y, if k.is_multiple_of(2) { 0.0 } else { -0.3 * low * low * low })
    };
    let mut points = vec![DVec3::new(-0.1, -0.1, 0.0), DVec3::new(0.1, -0.1, 0.0), DVec3::new(0.0, 0.1, 0.0)];
    points.extend((0..60).map(corner));
    (points.iter().map(|p| to_f32(p * size)).collect(), (0..21).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect())
}

#[test]
fn what_a_half_space_frees_the_trees_free_too() {
    let (mut freed, mut swept) = ([0; 2], 0);
    for body in 0..60 {
        let key = Key::new(11).of(body);
        let size = [1.0, 1e-5, 1e6][body as usize % 3];
        let (points, triangles) = bumps(key.of(0), size);
        let tree = TriangleTree::build(&points, &triangles);
        let normals = vec![[0.0, 0.0, 1.0]; points.len()];
        let skin = SkinSurface { tree: &tree, triangles: &triangles, normals: &normals };
        let gap = size * [0.0, 1e-4, 1e-2][body as usize / 3 % 3];
        let how = Collide {
            obstacles: &[&tree],
            skin: Some(skin),
            method: ContactMethod::Exact,
            coherence: 0.0.into(),
            gap: gap.into(),
            offset_root: 0.0.into(),
            offset_scale: None,
            loft: 0.0.into(),
            at_rest: None,
            blend: Masked::uniform(1.0),
            width: Masked::uniform(0.0),
        };
        let root = DVec3::z() * (size * number(key.of(1), 0.0, 2e-4));
        let tip = root + DVec3::z() * size;
        let half_space = HalfSpace::of(&[to_f32(root), to_f32(tip)], &DVec3::zeros(), 0.1 * size, gap, &how);
        let mut nearby = Nearby::default();
        for case in 0..3000 {
            let key = key.of(2).of(case);
            // From just above the skin, or from higher with directions that graze it.
            let from_high = case % 2 == 1;
            let high = if from_high { number(key.of(0), 0.0, 0.5) } else { number(key.of(0), 0.0, 3e-4) };
            let length = size * number(key.of(1), 0.05, 0.5);
            let pivot =
                root + sloping(key.of(2), 0.0) * (size * number(key.of(3), 0.0, 0.4)) + DVec3::z() * (size * high);
            let slope = |key: Key| {
                let least = if from_high { -high * size / length } else { -1e-3 };
                number(key, least.max(-1.0), if case % 3 == 0 { 1.0 } else { (least + 0.02).min(1.0) })
            };
            let from = sloping(key.of(4), slope(key.of(5)));
            let to = match case % 5 {
                0 => DVec3::new(-from.x, -from.y, from.z),
                1 => -from,
                2 => (from + sloping(key.of(6), 0.0) * 1e-9).normalize(),
                _ => sloping(key.of(6), slope(key.of(7))),
            };
            let mut axes = TurnAxes::default();
            axes.push(from);
            let segment = Segment {
                pivot,
                from,
                to,
                axes: &axes,
                before: DVec3::zeros(),
                length,
                half: if case % 4 == 0 { size * number(key.of(8), 0.0, 0.02) } else { 0.0 },
                is_round: case % 4 == 0,
                gap,
                inner: 0.0,
                rounding: 1.2e-7 * (size + length),
            };
            swept += 1;
            if !half_space.frees(&root, &segment) {
                continue;
            }
            freed[usize::from(from_high)] += 1;
            for method in [ContactMethod::Exact, ContactMethod::Steps(7)] {
                let turned = segment.turn(method, how.obstacles, &mut nearby);
                assert!(!turned.met && turned.direction == to, "body {body}, case {case}: {segment:?} {half_space:?}");
            }
            let crossing = first_crossing_in(how.obstacles, segment.start(&to), segment.end(&to));
            assert_eq!(crossing, None, "body {body}, case {case}");
        }
    }
    assert!(freed.iter().all(|freed| *freed > swept / 50), "{freed:?} of {swept}");
}

#[test]
fn rise_is_the_highest_corner_in_reach() {
    let points =
        vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.0, 0.1], [0.3, 0.0, 0.0], [0.2, 0.1, 0.0]];
    let far: Vec<Vec3> = points.iter().map(|[x, y, z]| [x + 9.0, *y, z + 5.0]).collect();
    let points: Vec<Vec3> = points.into_iter().chain(far).collect();
    let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
    let tree = TriangleTree::build(&points, &triangles);
    let normals = vec![[0.0, 0.0, 1.0]; points.len()];
    let how = Collide {
        obstacles: &[&tree],
        skin: Some(SkinSurface { tree: &tree, triangles: &triangles, normals: &normals }),
        method: ContactMethod::Exact,
        coherence: 0.0.into(),
        gap: 1e-4.into(),
        offset_root: 0.0.into(),
        offset_scale: None,
        loft: 0.0.into(),
        at_rest: None,
        blend: Masked::uniform(1.0),
        width: Masked::uniform(0.0),
    };
    let rise = |length: f32| {
        HalfSpace::of(&[[0.0; 3], [0.0, 0.0, length]], &DVec3::zeros(), 0.0, 1e-4, &how).rises[SHELLS - 1]
    };
    assert!(rise(0.15).abs() < 1e-6, "{}", rise(0.15));
    assert!((rise(0.5) - 0.1).abs() < 1e-6, "{}", rise(0.5));
    // Near the root only what is near it counts.
    let near = HalfSpace::of(&[[0.0; 3], [0.0, 0.0, 0.5]], &DVec3::zeros(), 0.0, 1e-4, &how);
    assert!(near.rises[0].abs() < 1e-6 && near.rises.is_sorted() && near.reaches.is_sorted(), "{near:?}");
    // A bump higher than the curve is long: nothing is freed as far out.
    let low = HalfSpace::of(&[[0.15, 0.0, 0.0], [0.15, 0.0, 0.09]], &DVec3::zeros(), 0.0, 1e-4, &how);
    assert_eq!(low.reaches[SHELLS - 1], 0.0);
}
