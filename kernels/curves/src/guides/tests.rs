//! Tests of hairs between guides.

use super::weights::{guide_weights_on, weights_of};
use super::*;
use crate::attach::{RootPose, attach_curves, rotate_vectors};
use nalgebra::{Quaternion, Unit};
use numerics::random::Key;
use numerics::simd::Path;
use numerics::vector::{DQuat, DVec3, IDENTITY, direction, to_f32, to_f64, turned};

type Point = [f32; 3];

const UP: Point = [0.0, 1.0, 0.0];

fn on_floor(x: f32, z: f32) -> OrientedPoint {
    OrientedPoint { position: [x, 0.0, z], normal: UP }
}

/// `count` positions on a floor of 1 by 1.
fn floor(count: u64, seed: u64) -> Vec<OrientedPoint> {
    let at = |i| {
        let key = Key::new(seed).of(i);
        on_floor(key.of(0).f32(), key.of(1).f32())
    };
    (0..count).map(at).collect()
}

/// `count` positions on a sphere of radius 1.
fn ball(count: u64, seed: u64) -> Vec<OrientedPoint> {
    let at = |i| {
        let key = Key::new(seed).of(i);
        let p = [0, 1, 2].map(|k| key.of(k).f64() + key.of(k + 3).f64() + key.of(k + 6).f64() - 1.5);
        let p = to_f32(direction(p.into()).unwrap());
        OrientedPoint { position: p, normal: p }
    };
    (0..count).map(at).collect()
}

/// Guides as long lists of points.
fn joined(guides: &[&[Point]]) -> (Vec<u32>, Vec<Point>) {
    let mut starts = vec![0];
    guides.iter().for_each(|guide| starts.push(starts[starts.len() - 1] + guide.len() as u32));
    (starts, guides.concat())
}

/// A bent curve of `cvs` CVs on each of `rooted`, about its normal.
fn grown(rooted: &[OrientedPoint], cvs: usize) -> (Vec<u32>, Vec<Point>) {
    let guide = |(i, point): (usize, &OrientedPoint)| -> Vec<Point> {
        let key = Key::new(77).of(i as u64);
        let lean: Point = std::array::from_fn(|k| 0.1 * key.of(k as u64).f32() - 0.05);
        let at = |k: usize| {
            let (k, d) = (k as f32 / (cvs - 1) as f32, 0.1 + 0.05 * key.of(5).f32());
            std::array::from_fn(|c| point.position[c] + k * d * point.normal[c] + k * k * lean[c])
        };
        (0..cvs).map(at).collect()
    };
    let guides: Vec<Vec<Point>> = rooted.iter().enumerate().map(guide).collect();
    joined(&guides.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

fn roots(points: &[OrientedPoint]) -> Vec<DVec3> {
    points.iter().map(|point| to_f64(point.position)).collect()
}

/// Hairs of `cvs` CVs from guides at rest.
fn hairs(guides: (&[u32], &[Point]), weights: &GuideWeights, hairs: &[OrientedPoint], cvs: usize) -> BlendedHairs {
    blend_hairs(
        ResampledGuides::new(guides.0, guides.1, cvs),
        &HairBlend { weights, roots: &roots(hairs), poses: None },
    )
}

fn arc_length(points: &[Point]) -> f64 {
    points.windows(2).map(|pair| (to_f64(pair[1]) - to_f64(pair[0])).norm()).sum()
}

fn close(a: &[Point], b: &[Point], within: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (to_f64(*a) - to_f64(*b)).norm() <= within)
}

#[test]
fn weights_are_those_of_franke_and_little() {
    // R = 4: ((4 − 1)/(4·1))² = 9/16 and ((4 − 2)/(4·2))² = 1/16.
    let found = weights_of(&[1.0, 2.0], Some(4.0));
    assert!((found[0] - 0.9).abs() < 1e-12 && (found[1] - 0.1).abs() < 1e-12);
    // The farthest is about to be replaced, and has weight 0.
    assert_eq!(weights_of(&[1.0, 4.0], Some(4.0)), [1.0, 0.0]);
    // No guide is left out: 1/d².
    let found = weights_of(&[1.0, 2.0], None);
    assert!((found[0] - 0.8).abs() < 1e-12 && (found[1] - 0.2).abs() < 1e-12);
    // At a guide, at two guides, and where all are equally far.
    assert_eq!(weights_of(&[0.0, 1.0, 2.0], Some(3.0)), [1.0, 0.0, 0.0]);
    assert_eq!(weights_of(&[0.0, 0.0, 2.0], Some(2.0)), [0.5, 0.5, 0.0]);
    assert_eq!(weights_of(&[2.0, 2.0], Some(2.0)), [0.5, 0.5]);
    // Squares neither vanish nor overflow.
    for unit in [1e-38_f32, 1e37] {
        let found = weights_of(&[unit, 2.0 * unit], Some(4.0 * unit));
        assert!((found[0] - 0.9).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn the_nearest_guides_are_those_of_an_exhaustive_search() {
    for (guides, asked) in [(floor(300, 1), floor(400, 2)), (ball(300, 1), ball(400, 2)), (ball(7, 3), ball(50, 4))] {
        let count = 5;
        let mixed = guide_weights(&guides, &asked, count);
        for (hair, point) in asked.iter().enumerate() {
            let apart = |guide: &OrientedPoint| {
                let cosine = to_f64(guide.normal).dot(&to_f64(point.normal)).clamp(-1.0, 1.0);
                (to_f64(guide.position) - to_f64(point.position)).norm() * (2.0 + 1e-3) / (1.0 + cosine + 1e-3)
            };
            let mut all: Vec<(f64, u32)> = guides.iter().map(apart).zip(0..).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let beyond = all[count].0;
            let share = |d: f64| (beyond - d) / (beyond * d);
            let raw = |d: f64| share(d) * share(d);
            let sum: f64 = all[..count].iter().map(|(d, _)| raw(*d)).sum();
            let shares = mixed.of(hair);
            assert_eq!(shares.len(), count);
            for (share, (distance, guide)) in shares.iter().zip(&all) {
                // Two that are equally far up to rounding may be exchanged.
                assert!(
                    share.guide == *guide || raw(*distance) / sum < 1e-4 || shares.iter().any(|s| s.guide == *guide)
                );
                let at = all.iter().find(|(_, guide)| *guide == share.guide).unwrap().0;
                assert!((f64::from(share.weight) - raw(at) / sum).abs() < 1e-4, "{share:?} {distance}");
            }
        }
    }
}

#[test]
fn weights_change_continuously_along_the_skin() {
    // Along a line through 400 guides, 5 cm apart, in steps of 20 µm: every share of every guide changes little, also
    // where guides are exchanged. With one guide it jumps, from 1 to 0.
    let guides = floor(400, 5);
    let line: Vec<OrientedPoint> =
        (0..40_000).map(|i| on_floor(0.1 + 2e-5 * i as f32, 0.3 + 1e-5 * i as f32)).collect();
    let most_step = |count: usize| {
        let mixed = guide_weights(&guides, &line, count);
        let share = |hair: usize, guide: u32| {
            mixed.of(hair).iter().find(|share| share.guide == guide).map_or(0.0, |share| share.weight)
        };
        let step = |hair: usize| {
            let either = mixed.of(hair).iter().chain(mixed.of(hair + 1)).map(|share| share.guide);
            either.map(|guide| (share(hair, guide) - share(hair + 1, guide)).abs()).fold(0.0, f32::max)
        };
        (0..line.len() - 1).map(step).fold(0.0, f32::max)
    };
    let steps = [1, 3, 4, 8].map(most_step);
    assert_eq!(steps[0], 1.0);
    assert!(steps[1..].iter().all(|step| *step < 0.02), "{steps:?}");
}

#[test]
fn the_other_side_of_a_thin_sheet_is_far_away() {
    // Guides on both sides, 1 mm apart, and hairs above: guides below are almost as close but must not contribute.
    let above = floor(50, 6);
    let below = above.iter().map(|point| OrientedPoint {
        position: [point.position[0], -1e-3, point.position[2]],
        normal: [0.0, -1.0, 0.0],
    });
    let guides: Vec<OrientedPoint> = above.iter().copied().chain(below).collect();
    let mixed = guide_weights(&guides, &floor(200, 7), 3);
    assert!((0..200).all(|hair| mixed.of(hair).iter().all(|share| share.guide < 50 || share.weight == 0.0)));
}

#[test]
fn a_hair_at_a_guides_root_equals_the_guide() {
    for rooted in [floor(200, 8), ball(200, 8)] {
        let (starts, points) = grown(&rooted, 6);
        for count in [1, 3, 200] {
            let found = hairs((&starts, &points), &guide_weights(&rooted, &rooted, count), &rooted, 6);
            assert!(close(&found.points, &points, 2e-7));
        }
    }
}

#[test]
fn a_hair_between_two_guides_has_their_mean_length_and_direction() {
    // 1 up and 2 along x: in the middle 1.5 along (2, 1, 0)/√5, as segments count by their length.
    let rooted = [on_floor(0.0, 0.0), on_floor(1.0, 0.0)];
    let (starts, points) = joined(&[&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]]);
    let middle = [on_floor(0.5, 0.0)];
    let found = hairs((&starts, &points), &guide_weights(&rooted, &middle, 2), &middle, 2);
    let [x, y] = [2.0, 1.0].map(|x: f64| (1.5 * x / 5.0_f64.sqrt()) as f32);
    assert!(close(&found.points, &[[0.5, 0.0, 0.0], [0.5 + x, y, 0.0]], 1e-7), "{found:?}");
    assert!(found.length_error < 1e-6);
    // A quarter of the arc_length: 1/d² gives 0.9 and 0.1.
    let quarter = [on_floor(0.25, 0.0)];
    let found = hairs((&starts, &points), &guide_weights(&rooted, &quarter, 2), &quarter, 2);
    assert!((arc_length(&found.points) - 1.1).abs() < 1e-6);
}

#[test]
fn guides_that_cancel_give_the_direction_of_the_largest_weight_and_keep_the_length() {
    let rooted = [on_floor(0.0, 0.0), on_floor(1.0, 0.0)];
    let (starts, points) = joined(&[&[[0.0; 3], [0.0, 0.0, 1.0]], &[[1.0, 0.0, 0.0], [1.0, 0.0, -1.0]]]);
    let middle = [on_floor(0.5, 0.0)];
    let found = hairs((&starts, &points), &guide_weights(&rooted, &middle, 2), &middle, 2);
    assert!(close(&found.points, &[[0.5, 0.0, 0.0], [0.5, 0.0, 1.0]], 1e-7), "{found:?}");
}

#[test]
fn hairs_have_the_blended_length_of_their_guides() {
    let (guides, asked) = (ball(100, 9), ball(1000, 10));
    let (starts, points) = grown(&guides, 5);
    let mixed = guide_weights(&guides, &asked, 4);
    for cvs in [2, 5, 9] {
        let found = hairs((&starts, &points), &mixed, &asked, cvs);
        for (hair, cvs) in found.points.chunks(cvs).enumerate() {
            let guide = |guide: u32| &points[starts[guide as usize] as usize..starts[guide as usize + 1] as usize];
            let expected: f64 =
                mixed.of(hair).iter().map(|share| f64::from(share.weight) * arc_length(guide(share.guide))).sum();
            assert!((arc_length(cvs) - expected).abs() < 2e-6, "{} is not {expected}", arc_length(cvs));
        }
        assert!(found.length_error < 2e-5, "{}", found.length_error);
    }
}

#[test]
fn a_guide_with_another_number_of_cvs_is_resampled_evenly() {
    // A corner at (0, 2, 0) after 2 of its 4 metres, its CVs uneven.
    let guide = [[0.0; 3], [0.0, 0.5, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 0.0]];
    let rooted = [on_floor(0.0, 0.0)];
    let mixed = guide_weights(&rooted, &rooted, 1);
    let cut = |cvs| hairs((&[0, 4], &guide), &mixed, &rooted, cvs).points;
    assert!(close(&cut(3), &[[0.0; 3], [0.0, 2.0, 0.0], [2.0, 2.0, 0.0]], 1e-6));
    assert!(close(&cut(5), &[[0.0; 3], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0], [2.0, 2.0, 0.0]], 1e-6));
    // Its own CVs are kept, however uneven.
    assert!(close(&cut(4), &guide, 1e-7));
    // As one segment it reaches from root to tip and has the length of the whole curve.
    let half = 4.0 / 2.0_f32.sqrt();
    assert!(close(&cut(2), &[[0.0; 3], [half, half, 0.0]], 1e-6));
    assert_eq!(cut(1), [[0.0; 3]]);
}

#[test]
fn on_a_ball_hairs_stand_at_the_angle_of_their_guides() {
    // With straight guides along the normal, every hair is along the normal.
    let (guides, asked) = (ball(60, 11), ball(500, 12));
    let lists: Vec<[Point; 3]> =
        guides.iter().map(|point| [1.0, 1.1, 1.2].map(|r: f32| point.position.map(|x| x * r))).collect();
    let (starts, points) = joined(&lists.iter().map(|guide| &guide[..]).collect::<Vec<_>>());
    let found = hairs((&starts, &points), &guide_weights(&guides, &asked, 4), &asked, 3);
    for (point, cvs) in asked.iter().zip(found.points.chunks(3)) {
        assert!((to_f64(cvs[2]) - to_f64(cvs[0])).cross(&to_f64(point.normal)).norm() < 1e-6);
    }
}

fn some_rotation(seed: u64) -> DQuat {
    let [x, y, z, w] = std::array::from_fn(|k| Key::new(seed).of(k as u64).f64() - 0.5);
    let q = Quaternion::new(w, x, y, z);
    Unit::new_unchecked(q / q.norm())
}

#[test]
fn hairs_of_attached_guides_equal_hairs_blended_at_rest_and_then_attached() {
    // Every root, of guides and of hairs, has its own rotation.
    let (guides, asked) = (ball(80, 13), ball(300, 14));
    let (starts, points) = grown(&guides, 5);
    let mixed = guide_weights(&guides, &asked, 4);
    let pose = |i: usize, seed: u64| {
        let translation = DVec3::from([0, 1, 2].map(|k| Key::new(seed).of(i as u64).of(k).f64()));
        RootPose { translation, rotation: some_rotation(seed + 100 + i as u64), lost: false }
    };
    let of_guides: Vec<RootPose> = (0..guides.len()).map(|i| pose(i, 1000)).collect();
    let of_hairs: Vec<RootPose> = (0..asked.len()).map(|i| pose(i, 2000)).collect();

    let at_rest = hairs((&starts, &points), &mixed, &asked, 5).points;
    let ends: Vec<u32> = (0..=asked.len() as u32).map(|hair| 5 * hair).collect();
    let expected = attach_curves(&ends, &at_rest, &of_hairs).points;

    let carried = attach_curves(&starts, &points, &of_guides).points;
    let now: Vec<DVec3> =
        roots(&asked).into_iter().zip(&of_hairs).map(|(root, pose)| root + pose.translation).collect();
    let blend_now = HairBlend { weights: &mixed, roots: &now, poses: Some((&of_hairs, &of_guides)) };
    let found = blend_hairs(ResampledGuides::new(&starts, &carried, 5), &blend_now);
    assert!(close(&found.points, &expected, 2e-6));

    // Vectors rotate as segments do.
    let vectors: Vec<Point> = (0..points.len()).map(|i| to_f32(pose(i, 3000).translation)).collect();
    let shapes = ResampledGuides::new(&starts, &points, 5);
    let still = HairBlend { weights: &mixed, roots: &roots(&asked), poses: None };
    let mut expected = still.vectors(&shapes, &vectors, CurveDomain::Point);
    rotate_vectors(&ends, &mut expected, &of_hairs);
    let mut moved = vectors.clone();
    rotate_vectors(&starts, &mut moved, &of_guides);
    assert!(close(&blend_now.vectors(&shapes, &moved, CurveDomain::Point), &expected, 2e-6));
}

#[test]
fn numbers_are_blended_and_other_values_come_from_the_largest_weight() {
    // Between two guides, a quarter of the arc_length: 0.9 and 0.1.
    let rooted = [on_floor(0.0, 0.0), on_floor(1.0, 0.0)];
    let (starts, points) =
        joined(&[&[[0.0; 3], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]], &[[1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]]);
    let asked = [on_floor(0.25, 0.0), on_floor(0.75, 0.0)];
    let mixed = guide_weights(&rooted, &asked, 2);
    let blend = HairBlend { weights: &mixed, roots: &roots(&asked), poses: None };
    let shapes = ResampledGuides::new(&starts, &points, 3);
    let close = |found: Vec<[f32; 1]>, expected: &[f32]| {
        found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a[0] - b).abs() < 1e-6 * b)
    };
    // The second guide's, 10 and 30 at its ends, is 20 in its middle.
    let by_cv = [[1.0], [2.0], [3.0], [10.0], [30.0]];
    assert!(close(blend.numbers(&shapes, &by_cv, CurveDomain::Point), &[1.9, 3.8, 5.7, 9.1, 18.2, 27.3]));
    assert!(close(blend.numbers(&shapes, &[[1.0], [2.0]], CurveDomain::Curve), &[1.1, 1.9]));
    assert_eq!(blend.heaviest(&shapes, CurveDomain::Curve), [0, 1]);
    assert_eq!(blend.heaviest(&shapes, CurveDomain::Point), [0, 1, 2, 3, 4, 4]);
    let turns = [IDENTITY, [0.0, 1.0, 0.0, 0.0]];
    assert_eq!(blend.orientations(&shapes, &turns, CurveDomain::Curve), turns);
}

#[test]
fn every_simd_path_and_number_of_threads_gives_the_same_bits() {
    let (guides, asked) = (ball(500, 15), ball(3000, 16));
    let (starts, points) = grown(&guides, 5);
    let run = |threads: usize, path: Path| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mixed = guide_weights_on(path, &guides, &asked, 5);
            let found = hairs((&starts, &points), &mixed, &asked, 4);
            (mixed, found)
        })
    };
    let expected = run(1, Path::BASELINE);
    for path in Path::all() {
        for threads in [1, 2, 7] {
            assert!(run(threads, path) == expected, "{} on {threads}", path.name());
        }
    }
}

#[test]
fn hairs_do_not_depend_on_their_order() {
    // The search radius of the previous hair must only be a guess.
    let (guides, asked) = (ball(300, 17), ball(500, 18));
    let back: Vec<OrientedPoint> = asked.iter().rev().copied().collect();
    let (there, back) = (guide_weights(&guides, &asked, 4), guide_weights(&guides, &back, 4));
    assert!((0..500).all(|hair| there.of(hair) == back.of(499 - hair)));
}

#[test]
fn there_may_be_fewer_guides_than_requested_or_none() {
    let asked = floor(10, 19);
    let two = guide_weights(&floor(2, 20), &asked, 5);
    assert!((0..10).all(|hair| two.of(hair).len() == 2));
    assert!((0..10).all(|hair| (two.of(hair).iter().map(|share| share.weight).sum::<f32>() - 1.0).abs() < 1e-6));
    assert_eq!(guide_weights(&[], &asked, 3).hairs(), 0);
    assert_eq!(guide_weights(&floor(2, 20), &[], 3).hairs(), 0);
    let none = HairBlend { weights: &guide_weights(&[], &[], 3), roots: &[], poses: None };
    assert!(blend_hairs(ResampledGuides::new(&[0], &[], 4), &none).points.is_empty());
    assert_eq!(guide_weights(&floor(100, 21), &asked, 1000).of(9).len(), MAX_GUIDES);
}

#[test]
fn unusual_roots_give_weights_of_sum_one_and_finite_hairs() {
    let same = vec![on_floor(0.5, 0.5); 40];
    let line: Vec<OrientedPoint> = (0..40).map(|i| on_floor(0.1 * i as f32, 0.0)).collect();
    let huge: Vec<OrientedPoint> = floor(40, 22)
        .iter()
        .map(|point| OrientedPoint { position: point.position.map(|x| 1e30 * x), ..*point })
        .collect();
    let tiny: Vec<OrientedPoint> = floor(40, 23)
        .iter()
        .map(|point| OrientedPoint { position: point.position.map(|x| 1e-30 * x), ..*point })
        .collect();
    let bare: Vec<OrientedPoint> =
        floor(40, 24).iter().map(|point| OrientedPoint { normal: [0.0; 3], ..*point }).collect();
    for guides in [same, line, huge, tiny, bare] {
        let asked: Vec<OrientedPoint> = guides.iter().chain(&floor(20, 25)).copied().collect();
        for count in [1, 3, 40] {
            let mixed = guide_weights(&guides, &asked, count);
            for hair in 0..asked.len() {
                let sum: f32 = mixed.of(hair).iter().map(|share| share.weight).sum();
                assert!((sum - 1.0).abs() < 1e-5, "{hair}: {:?}", mixed.of(hair));
            }
        }
        let (starts, points) = grown(&guides, 3);
        let found = hairs((&starts, &points), &guide_weights(&guides, &asked, 3), &asked, 3);
        assert!(found.points.as_flattened().iter().all(|x| x.is_finite()));
    }
}

#[test]
fn non_finite_roots_affect_only_their_own_hairs() {
    let mut guides = floor(50, 26);
    let mut asked = floor(50, 27);
    let expected = guide_weights(&guides[1..], &asked[1..], 3);
    guides[0].position = [f32::NAN; 3];
    asked[0].position = [f32::INFINITY, f32::NAN, 0.0];
    let found = guide_weights(&guides, &asked, 3);
    for hair in 1..50 {
        let same = |(a, b): (&GuideWeight, &GuideWeight)| a.guide == b.guide + 1 && (a.weight - b.weight).abs() < 1e-5;
        assert!(found.of(hair).iter().zip(expected.of(hair - 1)).all(same), "{hair}");
    }
}

#[test]
fn exactly_opposite_normals_have_a_rotation() {
    // The only guide is on the opposite side: the hair is the guide turned over.
    let guide = OrientedPoint { position: [0.0; 3], normal: [0.0, -1.0, 0.0] };
    let hair = [on_floor(0.0, 0.0)];
    let mixed = guide_weights(&[guide], &hair, 3);
    let found = turned(mixed.of(0)[0].rotation, [0.0, -1.0, 0.0]);
    assert!((to_f64(found) - DVec3::y()).norm() < 1e-7);
}
