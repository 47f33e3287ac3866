//! Whole curves: lengths, roots, masks, determinism.

use super::*;
use numerics::masked::Masked;
use numerics::vector;

fn distance(a: Vec3, b: Vec3) -> f64 {
    (to_f64(a) - to_f64(b)).norm()
}

/// Spacing of f32 positions of this size.
fn ulp(points: &[Vec3]) -> f64 {
    let largest = points.iter().map(|point| vector::largest(*point)).fold(0.0, f32::max);
    f64::from(f32::from_bits(largest.to_bits() + 1)) - f64::from(largest)
}

/// Checks that segments are as long as their targets' to 1e-5 of the curve and 4 ulp, and that roots have the same
/// bits.
fn assert_kept(starts: &[u32], targets: &[Vec3], found: &[Vec3]) {
    for ends in starts.windows(2) {
        let curve = ends[0] as usize..ends[1] as usize;
        let (targets, found) = (&targets[curve.clone()], &found[curve]);
        let length: f64 = targets.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        for (a, b) in targets.windows(2).zip(found.windows(2)) {
            let change = (distance(a[0], a[1]) - distance(b[0], b[1])).abs();
            assert!(change <= 1e-5 * length + 4.0 * ulp(targets).max(ulp(found)), "a segment changed by {change}");
        }
        assert_eq!(bits(&targets[..targets.len().min(1)]), bits(&found[..found.len().min(1)]));
    }
}

fn swung(path: Path, most: u64, frames: u32) -> Vec<JiggledCurves> {
    let ramp = rising();
    let (starts, first) = wobbling(700, most, 0.0);
    let mut jiggle = Jiggle::at_rest(&starts, &first, &first);
    let frames = (1..=frames).map(|frame| {
        let targets = wobbling(700, most, frame as f32).1;
        jiggle.step_on(path, &targets, &spring(0.6, 0.2, &ramp, Drag::World), 1.0, None);
        let shaped = jiggle.shape_on(path, 1.0.into());
        assert_kept(&starts, &targets, &shaped.points);
        shaped
    });
    frames.collect()
}

#[test]
fn lengths_and_roots_are_kept_and_every_path_and_number_of_threads_has_the_same_bits() {
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let expected = pool(1).install(|| swung(Path::BASELINE, 9, 12));
    assert!(expected[11].max_offset > 0.01);
    for path in Path::all() {
        for threads in [1, 2, 7] {
            assert!(pool(threads).install(|| swung(path, 9, 12)) == expected, "{path:?} on {threads} threads");
        }
    }
}

#[test]
fn a_swing_that_was_saved_goes_on_bit_for_bit() {
    let ramp = rising();
    let (starts, first) = wobbling(100, 9, 0.0);
    let mut whole = Jiggle::at_rest(&starts, &first, &first);
    let mut resumed = whole.clone();
    for frame in 1..=6 {
        let targets = wobbling(100, 9, frame as f32).1;
        for jiggle in [&mut whole, &mut resumed] {
            jiggle.step(&targets, &spring(0.6, 0.2, &ramp, Drag::World), 1.0, None);
        }
        let swing = resumed.swing();
        resumed = Jiggle::swinging(&starts, &first, &targets, &swing).unwrap();
        let [a, b] = [&whole, &resumed].map(|jiggle| jiggle.shape(1.0.into()));
        assert!(a == b && bits(&a.points) == bits(&b.points) && a.max_offset > 0.0, "frame {frame}");
        assert!(Jiggle::swinging(&starts, &first, &targets, &swing[1..]).is_none());
        assert!(Jiggle::swinging(&starts, &first, &targets, &[swing, vec![0.0; 16]].concat()).is_none());
    }
}

#[test]
fn lengths_are_restored_root_to_tip_by_hand() {
    // Both segments of length 1 upwards; the free CVs are pushed by 1 and by 1 along x. Segment 1 points to (1, 1): it
    // ends at (√½, √½). Segment 2 stays upright and starts there.
    let points = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let mut jiggle = Jiggle::at_rest(&[0, 3], &points, &points);
    for cv in 1..3 {
        jiggle.batches[0].states[cv].offset[0].0[0] = 1.0;
    }
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let shaped = jiggle.shape(1.0.into());
    let expected = [[0.0; 3], [half, half, 0.0], [half, half + 1.0, 0.0]];
    assert!(shaped.points.iter().zip(expected).all(|(a, b)| distance(*a, b) < 2e-7), "{shaped:?}");
    let far = 2.0 - f64::sqrt(2.0);
    assert!((shaped.max_offset - far.sqrt()).abs() < 1e-12);
    // Half of the push: (½, 1) ÷ √1.25. A mask of ½ gives the same, and 0 the same bits.
    let half = jiggle.shape(0.5.into());
    assert!((half.points[1][0] - 0.5 / 1.25_f32.sqrt()).abs() < 1e-7);
    assert_eq!(jiggle.shape(Masked { value: 1.0, mask: Some(&[0.5; 3]) }), half);
    assert_eq!(
        jiggle.shape(Masked { value: 0.25, mask: Some(&[9.0; 3]) }).points,
        jiggle.shape(1.0.into()).points,
        "the masked blend is clamped to 1"
    );
    assert_eq!(jiggle.shape(Masked { value: 1.0, mask: Some(&[0.0, -1.0, 0.0]) }).points, points);
    // Lengths are not fed back into the state.
    assert_eq!(jiggle.batches[0].states[1].offset[0].0[0], 1.0);
}

#[test]
fn still_curves_keep_their_bits() {
    let (starts, points) = wobbling(60, 9, 3.0);
    let points: Vec<Vec3> = points.iter().map(|p| [p[0], -0.0, p[2]]).collect();
    let ramp = soft();
    let mut jiggle = Jiggle::at_rest(&starts, &points, &points);
    for _ in 0..50 {
        jiggle.step(&points, &spring(0.3, 0.1, &ramp, Drag::World), 1.0, Some(&vec![RigidStep::NONE; 60]));
    }
    let shaped = jiggle.shape(0.7.into());
    assert_eq!(bits(&shaped.points), bits(&points));
    assert_eq!(shaped.max_offset, 0.0);
}

#[test]
fn a_ramp_of_zero_follows_exactly_and_half_of_it_doubles_the_frequency() {
    let points = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 2.0, 0.0]];
    let run = |ramp: &Ramp, phase: f64| {
        let mut jiggle = Jiggle::at_rest(&[0, 3], &points(0.0), &points(0.0));
        for x in [1.0, 2.0, 1.5, -1.0] {
            jiggle.step(&points(x), &spring(phase, 0.3, ramp, Drag::World), 1.0, None);
        }
        [1, 2].map(|cv| jiggle.batches[0].states[cv].offset[0].0[0])
    };
    assert_eq!(run(&Ramp::constant(0.0), 0.8), [0.0; 2]);
    assert_eq!(run(&Ramp::constant(-1.0), 0.8), [0.0; 2]);
    // Middle of the curve: ramp ½, so ω doubles.
    assert_eq!(run(&rising(), 0.8)[0], run(&soft(), 1.6)[0]);
    assert_eq!(run(&rising(), 0.8)[1], run(&soft(), 0.8)[1]);
}

#[test]
fn masks_scale_frequency_and_damping_from_a_quarter_to_four() {
    let run = |phase: f64, zeta: f64, masks: [Option<f32>; 2]| {
        let ramp = soft();
        let [frequency, damping] = masks.map(|mask| mask.map(|mask| [1.0, mask]));
        let mut jiggle = Jiggle::at_rest(&ONE, &at(0.0), &at(0.0));
        for x in [1.0, 2.0, 1.5, -1.0] {
            let plain = spring(phase, zeta, &ramp, Drag::World);
            let spring = Spring {
                frequency: Masked { mask: frequency.as_ref().map(|mask| &mask[..]), ..plain.frequency },
                damping: Masked { mask: damping.as_ref().map(|mask| &mask[..]), ..plain.damping },
                ..plain
            };
            jiggle.step(&at(x), &spring, 1.0, None);
        }
        free(&jiggle)
    };
    assert_eq!(run(0.8, 0.4, [Some(0.5), None]), run(0.4, 0.4, [None; 2]));
    assert_eq!(run(0.8, 0.4, [None, Some(2.0)]), run(0.8, 0.8, [None; 2]));
    assert_eq!(run(0.8, 0.4, [Some(0.0), None]), run(0.2, 0.4, [None; 2]));
    assert_eq!(run(0.8, 0.4, [Some(-3.0), Some(1e9)]), run(0.2, 1.6, [None; 2]));
}

#[test]
fn a_spring_may_change_between_steps() {
    let ramp = soft();
    let run = |phases: [f64; 3]| {
        let mut jiggle = Jiggle::at_rest(&ONE, &at(0.0), &at(0.0));
        for (phase, x) in phases.iter().zip([1.0, 2.0, 0.0]) {
            jiggle.step(&at(x), &spring(*phase, 0.3, &ramp, Drag::Target), 1.0, None);
        }
        free(&jiggle)
    };
    assert_ne!(run([0.5, 0.5, 0.5]), run([0.5, 0.5, 0.9]));
    assert_ne!(run([0.5, 0.9, 0.5]), run([0.5, 0.5, 0.5]));
}

#[test]
fn curves_without_length_without_cvs_and_of_ten_thousand_cvs_work() {
    let ramp = rising();
    let long: Vec<Vec3> = (0..10_000).map(|k| [0.0, k as f32 * 1e-4, 0.0]).collect();
    let mut points = vec![[1.0; 3], [2.0; 3], [2.0; 3], [3.0; 3], [3.0; 3], [3.0; 3]];
    points.extend(&long);
    let starts = [0, 0, 1, 3, 6, 6, 10_006];
    let mut jiggle = Jiggle::at_rest(&starts, &points, &points);
    for frame in 1..9 {
        let targets: Vec<Vec3> = points.iter().map(|p| [p[0] + 0.1 * frame as f32 * p[1], p[1], p[2]]).collect();
        jiggle.step(&targets, &spring(0.5, 0.05, &ramp, Drag::World), 1.0, None);
        assert_kept(&starts, &targets, &jiggle.shape(1.0.into()).points);
    }
    let mut none = Jiggle::at_rest(&[0], &[], &[]);
    none.step(&[], &spring(0.5, 0.05, &ramp, Drag::World), 1.0, None);
    assert_eq!(none.shape(1.0.into()), JiggledCurves { points: vec![], max_offset: 0.0 });
    let mut none = Jiggle::at_rest(&[], &[], &[]);
    none.step(&[], &spring(0.5, 0.05, &ramp, Drag::World), 1.0, None);
}

#[test]
fn scaling_by_a_power_of_two_is_exact() {
    let ramp = rising();
    let run = |scale: f32| {
        let frame = |frame: f32| wobbling(40, 6, frame).1.iter().map(|p| p.map(|x| x * scale)).collect::<Vec<_>>();
        let mut jiggle = Jiggle::at_rest(&wobbling(40, 6, 0.0).0, &frame(0.0), &frame(0.0));
        for k in 1..9 {
            jiggle.step(&frame(k as f32), &spring(0.6, 0.2, &ramp, Drag::World), 1.0, None);
        }
        jiggle.shape(1.0.into()).points.iter().map(|p| p.map(|x| x / scale)).collect::<Vec<_>>()
    };
    let expected = bits(&run(1.0));
    for power in [-60, -20, 20, 60] {
        let scale = f32::from_bits(((127 + power) as u32) << 23);
        assert_eq!(bits(&run(scale)), expected, "2^{power}");
    }
}

#[test]
fn segments_take_the_lengths_of_a_shape_and_keep_their_directions() {
    let starts = [0, 3, 3, 4];
    let shape = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [1.5, 1.0, 0.0], [5.0; 3]];
    let bent = [[0.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, 1.5, 0.5], [4.0; 3]];
    let mut points = bent;
    with_lengths_of(&shape, &starts, &mut points);
    assert!((distance(points[0], points[1]) - 1.5).abs() < 1e-6 && (distance(points[1], points[2]) - 1.0).abs() < 1e-6);
    assert!((points[1][1] / points[1][0] - 2.0).abs() < 1e-6);
    assert_eq!([points[0], points[3]], [bent[0], bent[3]]);
    let mut same = shape;
    with_lengths_of(&shape, &starts, &mut same);
    assert_eq!(same, shape);
}

#[test]
fn curves_of_a_clump_swing_as_their_mean_curve_does() {
    // Three curves of one clump whose tips are pulled by 0.1, 0.2 and 0.6 m, and a fourth alone. As springs are linear, the
    // mean of the swings is the swing of a curve pulled by 0.3 m.
    let curve = |x: f32, pull: f32| (0..5).map(move |k| [x + pull * k as f32 * 0.25, 0.25 * k as f32, 0.0]);
    let pulls = [0.1, 0.2, 0.6, 0.3];
    let groom = |pulled: bool| -> Vec<Vec3> {
        (0..4).flat_map(|i| curve(i as f32, if pulled { pulls[i] } else { 0.0 })).collect()
    };
    let (starts, rest, softness) = ([0, 5, 10, 15, 20], groom(false), rising());
    let mut jiggle = Jiggle::at_rest(&starts, &rest, &rest);
    for _ in 0..7 {
        jiggle.step(&groom(true), &spring(0.4, 0.3, &softness, Drag::Target), 1.0, None);
    }
    let offsets = |jiggle: &Jiggle, share: f32, clumps: &Clumps| {
        let mut offsets = vec![DVec3::zeros(); 20];
        for (curves, step, state) in jiggle.batches.iter().flat_map(CurveBatch::steps) {
            curves
                .cvs(step)
                .for_each(|(lane, cv)| offsets[cv] = [0, 1, 2].map(|axis| state.offset[axis].0[lane]).into());
        }
        gather::gathered(&starts, &jiggle.along, &offsets, clumps, share.into())
    };
    let clumps = Clumps::of_ids(&[4, 4, 4, -1]);
    let (own, together, half) =
        (offsets(&jiggle, 0.0, &clumps), offsets(&jiggle, 1.0, &clumps), offsets(&jiggle, 0.5, &clumps));
    assert!(own[19].norm() > 0.01);
    for cv in 0..20 {
        let expected = if cv < 15 { own[15 + cv % 5] } else { own[cv] };
        assert!((together[cv] - expected).norm() < 1e-6, "{cv}");
        assert!((half[cv] - 0.5 * (own[cv] + expected)).norm() < 1e-6, "{cv}");
    }
    let (all, alone) = (Masked::uniform(1.0), Clumps::of_ids(&[-1; 4]));
    assert_eq!(bits(&jiggle.shape_clumped(all, &clumps, 0.0.into()).points), bits(&jiggle.shape(all).points));
    assert_eq!(bits(&jiggle.shape_clumped(all, &alone, all).points), bits(&jiggle.shape(all).points));
    let shaped = jiggle.shape_clumped(all, &clumps, all).points;
    for curve in shaped.chunks(5) {
        let pulled = curve.windows(2).map(|ends| numerics::vector::length(numerics::vector::sub(ends[1], ends[0])));
        let pull = pulls[(curve[0][0]) as usize];
        assert!(pulled.into_iter().all(|length| (length - 0.25 * (1.0 + pull * pull).sqrt()).abs() < 1e-6));
    }
}

#[test]
fn curves_of_other_cvs_meet_in_their_clump_by_fractions_of_their_length() {
    // Offsets 2u and 4u of curves of 3 and 5 CVs: the mean is 3u.
    let (starts, along) = ([0, 3, 8, 10], [0.0, 0.5, 1.0, 0.0, 0.25, 0.5, 0.75, 1.0, 0.0, 0.0]);
    let offset = |cv: usize| DVec3::x() * f64::from(along[cv]) * if cv < 3 { 2.0 } else { 4.0 };
    let offsets: Vec<DVec3> = (0..10).map(offset).collect();
    let mask = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, f32::NAN, 1.0, 1.0];
    let share = Masked { value: 1.0, mask: Some(&mask[..]) };
    let found = gather::gathered(&starts, &along, &offsets, &Clumps::of_ids(&[0, 0, 0]), share);
    for (cv, found) in found.iter().enumerate() {
        let expected = if cv == 7 { 4.0 } else { 3.0 } * f64::from(along[cv]);
        assert!((found.x - expected).abs() < 1e-7, "{cv}: {found}");
    }
}
