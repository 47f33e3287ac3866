//! Closed forms and invariants of deformed grooms.

use super::*;
use crate::attach::RootPose;
use crate::guides::{GuideWeights, OrientedPoint, guide_weights};
use numerics::masked::Masked;
use numerics::random::Key;
use numerics::vector::{DQuat, DVec3, rotation, to_f32, to_f64};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

type Point = [f32; 3];

const UP: Point = [0.0, 1.0, 0.0];

/// Curves, root first.
#[derive(Clone)]
struct Curves {
    starts: Vec<u32>,
    points: Vec<Point>,
}

impl Curves {
    fn of(curves: &[Vec<Point>]) -> Self {
        let mut starts = vec![0];
        curves.iter().for_each(|curve| starts.push(starts[starts.len() - 1] + curve.len() as u32));
        Self { starts, points: curves.concat() }
    }

    fn roots(&self) -> Vec<Point> {
        self.starts[..self.starts.len() - 1].iter().map(|start| self.points[*start as usize]).collect()
    }

    fn moved(&self, to: impl Fn(DVec3) -> DVec3) -> Self {
        Self { points: self.points.iter().map(|p| to_f32(to(to_f64(*p)))).collect(), ..self.clone() }
    }
}

/// A curve from `root` whose segments of length `step` point up, turned about z by these angles.
fn bent(root: Point, step: f64, angles: &[f64]) -> Vec<Point> {
    let mut at = to_f64(root);
    let mut points = vec![root];
    for angle in angles {
        at += rotation(DVec3::z(), *angle) * DVec3::y() * step;
        points.push(to_f32(at));
    }
    points
}

fn oriented(roots: &[Point], normal: Point) -> Vec<OrientedPoint> {
    roots.iter().map(|root| OrientedPoint { position: *root, normal }).collect()
}

fn weights(guides: &Curves, hairs: &Curves, count: usize) -> GuideWeights {
    guide_weights(&oriented(&guides.roots(), UP), &oriented(&hairs.roots(), UP), count)
}

/// Hairs with roots at rest.
fn deformed(hairs: &Curves, guides: [&Curves; 2], weights: &GuideWeights, blend: f32) -> Vec<Point> {
    let segments = GuideSegments::of(&guides[0].starts, &guides[0].points);
    let turns = GuideTurns::new(&segments, &guides[0].starts, [&guides[0].points, &guides[1].points], None);
    let how = CurveDeform {
        guides: &HairGuides::of(weights, &segments, &hairs.starts, &hairs.points),
        turns: &turns,
        poses: None,
        blend: Masked::uniform(blend),
        keep_out: None,
    };
    deform_curves(&hairs.starts, &how, false).points
}

fn apart(a: &[Point], b: &[Point]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (to_f64(*a) - to_f64(*b)).amax()).fold(0.0, f64::max)
}

/// A number from −1 to 1.
fn random(k: u64) -> f32 {
    2.0 * Key::new(11).of(k).f32() - 1.0
}

/// Wavy hairs of 2 to 9 CVs all over a square of 1 m.
fn groom(count: u64, seed: u64) -> Curves {
    let hair = |hair: u64| {
        let at = |k: u64| 0.5 * random(1000 * seed + 100 * hair + k);
        let mut p = [at(0), 0.05 * at(1), at(2)];
        let mut points = vec![p];
        for k in 0..1 + hair % 8 {
            p = [p[0] + 0.04 * at(3 * k + 3), p[1] + 0.03 + 0.02 * at(3 * k + 4), p[2] + 0.04 * at(3 * k + 5)];
            points.push(p);
        }
        points
    };
    Curves::of(&(0..count).map(hair).collect::<Vec<_>>())
}

#[test]
fn guides_at_rest_change_no_bit() {
    let (hairs, guides) = (groom(300, 1), groom(40, 2));
    for count in [1, 3, 5] {
        let now = deformed(&hairs, [&guides, &guides], &weights(&guides, &hairs, count), 1.0);
        assert_eq!(now, hairs.points);
    }
    let poses = guide_poses(&guides.starts, &guides.points, &guides.points);
    assert!(poses.iter().all(|pose| pose.rotation == DQuat::identity() && pose.translation == DVec3::zeros()));
}

/// A hair turns as its guide does at the same fraction of its length: with as many segments each by its own angle, with one
/// segment by the mean of a guide's two.
#[test]
fn a_hair_turns_as_its_guide_does_along_its_length() {
    let angles = [0.2, 0.5, 1.1, 1.6];
    let guides = [bent([0.0; 3], 0.1, &[0.0; 4]), bent([0.0; 3], 0.1, &angles)].map(|guide| Curves::of(&[guide]));
    let root = [0.3, 0.0, 0.1];
    let hairs = Curves::of(&[bent(root, 0.02, &[0.0; 4])]);
    let now = deformed(&hairs, [&guides[0], &guides[1]], &weights(&guides[0], &hairs, 3), 1.0);
    assert!(apart(&now, &bent(root, 0.02, &angles)) < 1e-7);
    // A hair that leans by 0.4 ends 0.4 beyond.
    let leaning = Curves::of(&[bent(root, 0.02, &[0.4; 4])]);
    let now = deformed(&leaning, [&guides[0], &guides[1]], &weights(&guides[0], &leaning, 3), 1.0);
    assert!(apart(&now, &bent(root, 0.02, &angles.map(|angle| angle + 0.4))) < 1e-7);

    let guides = [bent([0.0; 3], 0.1, &[0.0; 2]), bent([0.0; 3], 0.1, &[0.4, 1.4])].map(|guide| Curves::of(&[guide]));
    let single = Curves::of(&[bent(root, 0.3, &[0.0])]);
    let now = deformed(&single, [&guides[0], &guides[1]], &weights(&guides[0], &single, 3), 1.0);
    assert!(apart(&now, &bent(root, 0.3, &[0.9])) < 1e-7);
}

#[test]
fn between_two_guides_a_hair_turns_by_their_mean() {
    let upright = |x: f32| bent([x, 0.0, 0.0], 0.1, &[0.0; 3]);
    let rest = Curves::of(&[upright(-0.2), upright(0.2)]);
    let hairs = Curves::of(&[upright(0.0)]);
    for (turns, mean) in [([1.2, -1.2], 0.0), ([FRAC_PI_2, 0.0], FRAC_PI_4), ([0.3, 0.9], 0.6)] {
        let guides = [-0.2, 0.2].iter().zip(turns).map(|(x, angle)| bent([*x, 0.0, 0.0], 0.1, &[angle; 3]));
        let now = Curves::of(&guides.collect::<Vec<_>>());
        let hair = deformed(&hairs, [&rest, &now], &weights(&rest, &hairs, 2), 1.0);
        assert!(apart(&hair, &bent([0.0; 3], 0.1, &[mean; 3])) < 1e-7, "{turns:?}");
        let half = deformed(&hairs, [&rest, &now], &weights(&rest, &hairs, 2), 0.5);
        assert!(apart(&half, &bent([0.0; 3], 0.1, &[0.5 * mean; 3])) < 1e-7, "{turns:?}");
    }
}

/// A guide wound up by more than half a revolution is not confused with one turned back: the hair half-way follows.
#[test]
fn turns_of_more_than_half_a_revolution_are_kept() {
    let upright = |x: f32| bent([x, 0.0, 0.0], 0.1, &[0.0; 4]);
    let rest = Curves::of(&[upright(-0.2), upright(0.2)]);
    let curl = [0.3 * PI, 0.7 * PI, 1.0 * PI, 1.4 * PI];
    let now = Curves::of(&[bent([-0.2, 0.0, 0.0], 0.1, &curl), bent([0.2, 0.0, 0.0], 0.1, &curl)]);
    let hairs = Curves::of(&[upright(0.0)]);
    let hair = deformed(&hairs, [&rest, &now], &weights(&rest, &hairs, 2), 0.5);
    assert!(apart(&hair, &bent([0.0; 3], 0.1, &curl.map(|angle| 0.5 * angle))) < 1e-7);
}

/// Guides that pass half a turn one after the other carry the hair between them past it: by the normalised weighted mean of
/// their rotations' quaternions, whose signs are those of turns that are nowhere far from each other. With `straight`
/// segments that do not turn before those that do.
#[test]
fn guides_pass_half_a_turn_one_by_one() {
    let roots: [Point; 3] = [[0.0; 3], [0.3, 0.0, 0.0], [0.0, 0.0, 0.2]];
    let guides = |angles: [f64; 3], straight: usize| {
        let guide = |k: usize| bent(roots[k], 0.1, &[&[0.0; 4][..straight], &[angles[k]; 4]].concat());
        Curves::of(&[0, 1, 2].map(guide))
    };
    let degrees = |angle: f64| angle * PI / 180.0;
    let root = [0.1, 0.0, 0.05];
    for straight in [0, 4] {
        let rest = guides([0.0; 3], straight);
        let weights = weights(&rest, &Curves::of(&[vec![root; 2]]), 3);
        assert!(weights.of(0).iter().all(|guide| guide.weight > 0.1), "all three count");
        let mean = |angles: [f64; 3]| {
            let parts = weights.of(0).iter().map(|guide| (f64::from(guide.weight), angles[guide.guide as usize]));
            let [w, z] = parts.fold([0.0, 0.0], |[w, z], (weight, angle)| {
                let (sine, cosine) = libm::sincos(0.5 * angle);
                [w + weight * cosine, z + weight * sine]
            });
            2.0 * libm::atan2(z, w)
        };
        // One CV more than segments that turn: in the middle of all others, guides have the turn of one segment.
        let hair = |angle: f64, lean: f64| {
            let angles: Vec<f64> = (0..straight + 4).map(|k| lean + if k < straight { 0.0 } else { angle }).collect();
            Curves::of(&[bent(root, 0.02, &angles)])
        };
        // Not by half a turn exactly, whose axis is not known.
        for angles in [[170.0, 179.99, 190.0], [190.0, 170.0, 181.0], [179.0, 185.0, 181.0], [240.0, 140.0, 181.0]] {
            let angles = angles.map(degrees);
            let now = deformed(&hair(0.0, 0.3), [&rest, &guides(angles, straight)], &weights, 1.0);
            let expected = hair(mean(angles), 0.3).points;
            assert!(apart(&now, &expected) < 1e-6, "{angles:?}: {now:?}, not {expected:?}");
        }
        for order in [[0.0, 10.0, 20.0], [20.0, 10.0, 0.0], [0.0, 60.0, 35.0]] {
            let frames = (0..400).map(|frame| order.map(|ahead| degrees(100.25 + 0.5 * f64::from(frame) + ahead)));
            for angles in frames.filter(|angles| angles.iter().all(|angle| *angle < degrees(260.0))) {
                let now = deformed(&hair(0.0, 0.3), [&rest, &guides(angles, straight)], &weights, 1.0);
                assert!(apart(&now, &hair(mean(angles), 0.3).points) < 1e-6, "{angles:?}");
            }
        }
    }
}

/// On the two sides of a parting guides lie down to the left and to the right: the hair between them stands, though the way
/// from one to the other is shorter through the skin.
#[test]
fn hairs_of_a_parting_stand() {
    let upright = |x: f32| bent([x, 0.0, 0.0], 0.1, &[0.0; 3]);
    let rest = Curves::of(&[upright(-0.2), upright(0.2)]);
    let hairs = Curves::of(&[upright(0.0)]);
    for degrees in [[80.0, -80.0], [91.0, -91.0], [115.0, -115.0], [140.0, -95.0], [100.0, -135.0_f64]] {
        let [left, right] = degrees.map(|angle| angle * PI / 180.0);
        let now = Curves::of(&[bent([-0.2, 0.0, 0.0], 0.1, &[left; 3]), bent([0.2, 0.0, 0.0], 0.1, &[right; 3])]);
        let hair = deformed(&hairs, [&rest, &now], &weights(&rest, &hairs, 2), 1.0);
        assert!(apart(&hair, &bent([0.0; 3], 0.1, &[0.5 * (left + right); 3])) < 1e-7, "{degrees:?}");
    }
}

/// Guides that lie down on a floor lay hairs down on a wall, too: turns are those in the frames of roots.
#[test]
fn turns_are_carried_from_frame_to_frame() {
    let rest = Curves::of(&[bent([0.0; 3], 0.1, &[0.0; 2])]);
    let now = Curves::of(&[bent([0.0; 3], 0.1, &[-FRAC_PI_2; 2])]);
    // The wall's normal is x; its hair stands along it, and about z all frames turn alike.
    let wall = Curves::of(&[bent([0.0; 3], 0.1, &[-FRAC_PI_2; 2])]);
    let on = |normal: Point| OrientedPoint { position: [0.0; 3], normal };
    let weights = guide_weights(&[on(UP)], &[on([1.0, 0.0, 0.0])], 1);
    let hair = deformed(&wall, [&rest, &now], &weights, 1.0);
    assert!(apart(&hair, &bent([0.0; 3], 0.1, &[-PI; 2])) < 1e-6);
    // Where the wall's normal is z, lying down along x stays lying down along x.
    let wall = Curves::of(&[vec![[0.0; 3], [0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]]);
    let weights = guide_weights(&[on(UP)], &[on([0.0, 0.0, 1.0])], 1);
    let hair = deformed(&wall, [&rest, &now], &weights, 1.0);
    assert!(apart(&hair, &[[0.0; 3], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]) < 1e-6);
}

/// The last CV of a curve turns as its last segment does, however long the curves beside it are.
#[test]
fn last_cvs_turn_with_their_segments() {
    let (hairs, rest, now) = (groom(40, 3), bent([0.0; 3], 0.1, &[0.0; 2]), bent([0.0; 3], 0.1, &[0.7; 2]));
    let guides = [rest, now].map(|guide| Curves::of(&[guide]));
    let weights = weights(&guides[0], &hairs, 1);
    let segments = GuideSegments::of(&guides[0].starts, &guides[0].points);
    let turns = GuideTurns::new(&segments, &guides[0].starts, [&guides[0].points, &guides[1].points], None);
    let guides = HairGuides::of(&weights, &segments, &hairs.starts, &hairs.points);
    let blend = Masked::uniform(1.0);
    let how = CurveDeform { guides: &guides, turns: &turns, poses: None, blend, keep_out: None };
    let turn = rotation(DVec3::z(), 0.7);
    for found in deform_curves(&hairs.starts, &how, true).rotations {
        assert!((found.coords - turn.coords).amax() < 1e-6, "{found:?}");
    }
}

#[test]
fn rigid_motion_of_the_guides_moves_hairs_rigidly() {
    let (hairs, guides) = (groom(200, 3), groom(30, 4));
    for (axis, angle) in [(DVec3::y(), 1.0), (DVec3::new(0.6, 0.0, 0.8), 2.5), (DVec3::x(), PI)] {
        let turn = rotation(axis, angle);
        let rigid = |p: DVec3| turn * p + DVec3::new(1.0, -2.0, 0.5);
        let now = guides.moved(rigid);
        let weights = weights(&guides, &hairs, 3);
        let guide_poses = guide_poses(&guides.starts, &guides.points, &now.points);
        let poses = carried_poses(&weights, &hairs.roots(), &guides.roots(), &guide_poses);
        let segments = GuideSegments::of(&guides.starts, &guides.points);
        let turns = GuideTurns::new(&segments, &guides.starts, [&guides.points, &now.points], Some(&guide_poses));
        let blend = Masked::uniform(1.0);
        let how = CurveDeform {
            guides: &HairGuides::of(&weights, &segments, &hairs.starts, &hairs.points),
            turns: &turns,
            poses: Some(&poses),
            blend,
            keep_out: None,
        };
        let deformed = deform_curves(&hairs.starts, &how, true);
        assert!(apart(&deformed.points, &hairs.moved(rigid).points) < 2e-6, "{axis:?}");
        let off = |found: &DQuat| (found.coords - turn.coords).amax().min((found.coords + turn.coords).amax());
        assert!(deformed.rotations.iter().all(|found| off(found) < 1e-5));
        assert_eq!(deformed.rotations.len(), hairs.points.len());
    }
}

/// Roots that are lifted off the skin lift hairs by the weighted mean, in the frames of the roots.
#[test]
fn offsets_of_roots_are_followed() {
    let rest = Curves::of(&[bent([-0.2, 0.0, 0.0], 0.1, &[0.0; 2]), bent([0.2, 0.0, 0.0], 0.1, &[0.0; 2])]);
    let now = rest.moved(|p| p + DVec3::new(0.0, 0.01, 0.0));
    let hairs = Curves::of(&[bent([0.0; 3], 0.1, &[0.3; 2])]);
    let hair = deformed(&hairs, [&rest, &now], &weights(&rest, &hairs, 2), 1.0);
    assert!(apart(&hair, &hairs.moved(|p| p + DVec3::new(0.0, 0.01, 0.0)).points) < 1e-8);
}

#[test]
fn lengths_are_kept_whatever_guides_do() {
    let (hairs, guides) = (groom(300, 5), groom(25, 6));
    let mut now = groom(25, 7);
    // Some guides fold onto themselves, some collapse, some turn round.
    for guide in 0..25 {
        let cvs = now.starts[guide] as usize..now.starts[guide + 1] as usize;
        let root = now.points[cvs.start];
        match guide % 4 {
            0 => now.points[cvs].fill(root),
            1 => now.points[cvs.start + 1..cvs.end].iter_mut().enumerate().for_each(|(k, p)| {
                *p = if k % 2 == 0 { [root[0], root[1] - 0.1, root[2]] } else { root };
            }),
            2 => {
                let rest = guides.points[cvs.clone()].to_vec();
                now.points[cvs].iter_mut().zip(rest).for_each(|(p, rest)| *p = rest.map(|x| -x));
            }
            _ => {}
        }
    }
    let segments = GuideSegments::of(&guides.starts, &guides.points);
    let turns = GuideTurns::new(&segments, &guides.starts, [&guides.points, &now.points], None);
    let of_hairs = HairGuides::of(&weights(&guides, &hairs, 3), &segments, &hairs.starts, &hairs.points);
    for blend in [1.0, 0.3] {
        let blend = Masked::uniform(blend);
        let how = CurveDeform { guides: &of_hairs, turns: &turns, poses: None, blend, keep_out: None };
        let deformed = deform_curves(&hairs.starts, &how, false);
        assert!(deformed.points.as_flattened().iter().all(|x| x.is_finite()));
        assert!(deformed.length_error < 1e-5, "{}", deformed.length_error);
    }
}

/// Rotations in f32 change a segment by a few of its roundings, whatever the size of the scene.
#[test]
fn a_turn_keeps_lengths_to_rounding_at_any_scale() {
    let (mut worst, mut off) = (0.0_f64, 0.0_f64);
    for k in 0..400 {
        let angle = |k: u64| 3.0 * f64::from(random(k));
        let guides =
            [[0.0; 2], [angle(3 * k), angle(3 * k + 1)]].map(|angles| Curves::of(&[bent([0.0; 3], 1.0, &angles)]));
        // One segment from the origin on, so that positions are as finely rounded as lengths.
        let hair = Curves::of(&[bent([0.0; 3], 1.0, &[angle(3 * k + 2)])]);
        let scaled = |curves: &Curves, scale: f32| Curves {
            points: curves.points.iter().map(|p| p.map(|x| scale * x)).collect(),
            ..curves.clone()
        };
        let end = |scale: f32| {
            let [rest, now, hair] = [&guides[0], &guides[1], &hair].map(|curves| scaled(curves, scale));
            let out = deformed(&hair, [&rest, &now], &weights(&rest, &hair, 1), 1.0);
            to_f64(out[1]) / f64::from(scale)
        };
        worst = worst.max((end(1.0).norm() / to_f64(hair.points[1]).norm() - 1.0).abs());
        off = [1e-30, 1e30].iter().fold(off, |off, scale| off.max((end(*scale) - end(1.0)).amax()));
    }
    assert!(worst < 4e-7, "{worst}");
    assert!(off < 1e-6, "{off}");
}

/// A hair that wanders over the skin changes its shape by little at each step, past every change of guides.
#[test]
fn there_are_no_seams_between_guides() {
    let guides = groom(60, 8);
    let now = guides.moved(|p| DVec3::new(p.x + 3.0 * p.y * (9.0 * p.z).abs().min(1.0), 0.4 * p.y, p.z));
    let hair = |k: u32| bent([-0.4 + 2e-4 * k as f32, 0.0, 0.13 - 1e-4 * k as f32], 0.05, &[0.1; 3]);
    let hairs = Curves::of(&(0..4000).map(hair).collect::<Vec<_>>());
    let out = deformed(&hairs, [&guides, &now], &weights(&guides, &hairs, 3), 1.0);
    let shape = |k: usize| {
        let cvs = &out[4 * k..4 * k + 4];
        [1, 2, 3].map(|cv| to_f64(cvs[cv]) - to_f64(cvs[0]))
    };
    let step = |k: usize| shape(k).iter().zip(shape(k + 1)).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let (largest, way) = (0..3999).map(step).fold((0.0_f64, 0.0), |(largest, sum), x| (largest.max(x), sum + x));
    // Hairs are 0.15 long, guides some 0.13 apart. A swap of guides would show as a step of several percent.
    assert!(way > 0.05, "the guides differ: {way}");
    assert!(largest < 2e-3, "{largest}");
}

#[test]
fn a_radius_fades_guides_out() {
    let post = |x: f32| OrientedPoint { position: [x, 0.0, 0.0], normal: UP };
    let (guides, hairs) = ([post(0.0)], [post(0.0), post(0.05), post(0.1), post(0.2)]);
    let weights = guide_weights(&guides, &hairs, 3).within(&guides, &hairs, 0.1);
    // (1 − ¼)² = 0.5625 by hand.
    let left: Vec<f32> = (0..4).map(|hair| weights.of(hair)[0].weight).collect();
    for (left, expected) in left.iter().zip([1.0, 0.5625, 0.0, 0.0]) {
        assert!((left - expected).abs() < 1e-6, "{left} {expected}");
    }
    // What is left of the weight turns a hair by about that share.
    let [rest, now] = [0.0, 0.02].map(|angle| Curves::of(&[bent([0.0; 3], 0.1, &[angle; 2])]));
    let hairs = Curves::of(&[0.0, 0.05, 0.1].map(|x| bent([x, 0.0, 0.0], 0.1, &[0.0; 2])));
    let out = deformed(&hairs, [&rest, &now], &weights, 1.0);
    for (hair, share) in out.chunks(3).zip([1.0, 0.5625, 0.0]) {
        assert!(apart(hair, &bent(hair[0], 0.1, &[0.02 * share; 2])) < 1e-6);
    }
}

#[test]
fn without_guides_or_segments_hairs_stay() {
    let hairs = Curves::of(&[vec![[1.0; 3]], bent([0.0; 3], 0.1, &[0.2; 2]), vec![[2.0; 3]; 3]]);
    let none = Curves::of(&[]);
    let weights_of_none = weights(&none, &hairs, 3);
    assert_eq!(deformed(&hairs, [&none, &none], &weights_of_none, 1.0), hairs.points);
    assert!(carried_poses(&weights_of_none, &hairs.roots(), &[], &[]).iter().all(|pose: &RootPose| !pose.lost));
    let dots = Curves::of(&[vec![[0.5; 3]], vec![[0.0; 3]; 2]]);
    assert_eq!(deformed(&hairs, [&dots, &dots], &weights(&dots, &hairs, 2), 1.0), hairs.points);
}
