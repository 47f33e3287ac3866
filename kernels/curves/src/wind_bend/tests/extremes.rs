//! Stiff, empty and extreme input: finite output, kept lengths, no panic.

use super::*;
use numerics::masked::Masked;
use numerics::noise::NoiseKind;
use std::f64::consts::PI;

#[test]
fn no_curves_empty_curves_and_curves_of_one_cv_pass_through() {
    let ramp = one();
    assert!(bend(&[], &[], &plain(&ramp)).points.is_empty());
    assert!(bend(&[0], &[], &plain(&ramp)).points.is_empty());
    assert!(bend(&[0, 0, 0], &[], &plain(&ramp)).points.is_empty());
    let mut curves = vec![Vec::new(), vec![[-0.0, 2.0, 3.0]], Vec::new()];
    curves.push(straight([1.0; 3], [0.0, 1.0, 0.0], 3));
    let groom = Groom::of(&curves);
    let bent = groom.bend(&plain(&ramp));
    assert_eq!(bits(&bent.points[..2]), bits(&groom.points[..2]));
    assert_ne!(bent.points[2], groom.points[2]);
    assert_kept(&groom, &bent);
}

#[test]
fn equal_cvs_act_as_one_and_a_curve_of_no_length_stays() {
    let ramp = one();
    let plain_curve = straight([1.0, 0.0, 0.0], [0.2, 1.0, 0.0], 4);
    let mut doubled = plain_curve.clone();
    doubled.insert(2, plain_curve[2]);
    let groom = Groom::of(&[plain_curve, doubled, vec![[3.0, 4.0, 5.0]; 6]]);
    for mode in [BendMode::Paper, BendMode::ResolutionFree { reference_segments: 4.0 }] {
        let bent = groom.bend(&Bend { mode, ..plain(&ramp) });
        let mut single = bent.points[5..11].to_vec();
        assert_eq!(single.remove(2), single[2]);
        assert!(farthest(&single, &bent.points[..5]) < 1e-6, "{mode:?}");
        assert_eq!(bits(&bent.points[11..]), bits(&groom.points[11..]));
        assert_kept(&groom, &bent);
    }
}

#[test]
fn a_closed_curve_whose_tip_is_its_root_is_finite() {
    let ramp = one();
    let square = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
    let groom = Groom::of(&[square]);
    assert_kept(&groom, &groom.bend(&plain(&ramp)));
}

#[test]
fn wind_along_a_curve_leaves_it_and_wind_against_it_turns_it_over() {
    let ramp = one();
    let along = Groom::of(&[straight([0.0; 3], [1.0, 0.0, 0.0], 4)]);
    assert_eq!(bits(&along.bend(&plain(&ramp)).points), bits(&along.points));
    for direction in [[-1.0, 0.0, 0.0], [-1.0, 1e-7, 0.0], [-1.0, 0.0, -3e-6]] {
        let against = Groom::of(&[straight([0.0; 3], direction, 4)]);
        let bent = against.bend(&plain(&ramp));
        assert_kept(&against, &bent);
        for (k, angle) in angles(&bent.points, [1.0, 0.0, 0.0]).into_iter().enumerate() {
            let expected = PI * libm::pow(0.5, k as f64 + 1.0);
            assert!((angle - expected).abs() < 5e-6, "{direction:?}, segment {k}: {angle}");
        }
    }
}

#[test]
fn against_the_wind_a_curve_turns_in_the_plane_it_bends_in() {
    let ramp = one();
    // Root to tip against the wind, bulging towards +y: turned about +z or −z, so z stays 0.
    for side in [1.0, -1.0] {
        let arc = vec![[0.0; 3], [-0.3, 0.2 * side, 0.0], [-0.7, 0.2 * side, 0.0], [-1.0, 0.0, 0.0]];
        let bent = Groom::of(&[arc]).bend(&plain(&ramp));
        assert!(bent.points.iter().all(|cv| cv[2].abs() < 1e-6), "{:?}", bent.points);
        // It continues in the sense of its own bend, over the side opposite to its bulge.
        assert!(bent.points[3][1] * side < -0.3, "{:?}", bent.points);
    }
}

#[test]
fn wind_turning_by_half_a_circle_is_finite_at_every_step() {
    let ramp = one();
    let groom = tangled(64, 9);
    for step in 0..=360 {
        let (sine, cosine) = numerics::trig::sin_cos(step as f32 * (std::f32::consts::PI / 180.0));
        assert_kept(&groom, &groom.bend(&Bend { wind: [cosine, 0.0, sine], ..plain(&ramp) }));
    }
    let still = groom.bend(&Bend { wind: [0.0; 3], ..plain(&ramp) });
    assert_eq!(bits(&still.points), bits(&groom.points));
}

#[test]
fn lengths_hold_from_2_to_10_000_cvs() {
    let ramp = one();
    let field = Field::new(NoiseKind::Perlin, 2, 0.5, 5);
    for cvs in [2, 3, 10, 100, 1000, 10_000] {
        let curl = |cv: usize| {
            let u = cv as f64 / (cvs - 1) as f64;
            [libm::cos(9.0 * u) as f32, (2.0 * u) as f32, libm::sin(9.0 * u) as f32]
        };
        let straight_too = straight([0.1, 0.2, 0.3], [0.1, 1.0, 0.1], cvs - 1);
        let groom = Groom::of(&[(0..cvs).map(curl).collect(), straight_too]);
        for mode in [BendMode::Paper, BendMode::ResolutionFree { reference_segments: 4.0 }] {
            for rotate in [1e-3, 0.1, 1.0, 2.0] {
                let noise = Some(BendNoise {
                    field: &field,
                    amplitude: 1.0.into(),
                    frequency: 2.0,
                    waviness: 1.0.into(),
                    origin: [0.0; 3],
                    other: None,
                    roots: None,
                });
                let bent = groom.bend(&Bend { mode, rotate: rotate.into(), noise, ..plain(&ramp) });
                assert_kept(&groom, &bent);
                let whole = [0, cvs].map(|start| {
                    let curve = start..start + cvs;
                    let before = length(&groom.points[curve.clone()]);
                    (length(&bent.points[curve]) - before).abs() / before
                });
                let worst = whole[0].max(whole[1]);
                assert!(worst < 1e-5, "{cvs} CVs, {mode:?}, g {rotate}: {worst}");
                assert!(bent.length_error < 1e-5, "{cvs} CVs: {}", bent.length_error);
            }
        }
    }
}

#[test]
fn denormal_tiny_and_huge_scenes_are_finite() {
    let ramp = one();
    let groom = tangled(64, 9);
    for factor in [1e-44, 1e-38, 1e-30, 1e-6, 1e6, 1e30, 1e36] {
        let scaled = groom.map(|cv| vector::scale(cv, factor));
        let bent = scaled.bend(&plain(&ramp));
        assert_kept(&scaled, &bent);
    }
}

#[test]
fn ten_thousand_kilometres_from_the_origin_only_storage_loses_precision() {
    let ramp = one();
    let groom = tangled(64, 9).map(|cv| vector::add(cv, [1e7, -1e7, 1e7]));
    assert_kept(&groom, &groom.bend(&plain(&ramp)));
}

#[test]
fn envelopes_below_0_and_nan_count_as_0_and_above_1_bend_more() {
    let ramp = one();
    let groom = Groom::of(&[straight([0.0; 3], [0.0, 1.0, 0.0], 2)]);
    let with = |envelope: &[f32]| groom.bend(&Bend { envelope: Some(envelope), ..plain(&ramp) });
    for none in [-1.0, f32::NAN, f32::NEG_INFINITY, 0.0] {
        assert_eq!(bits(&with(&[none; 3]).points), bits(&groom.points), "{none}");
    }
    let [first, _] = angles(&with(&[1.5; 3]).points, [1.0, 0.0, 0.0])[..] else { panic!() };
    assert!((first - 0.25 * PI / 2.0).abs() < 1e-6);
    for much in [1e9, f32::MAX, f32::INFINITY] {
        assert_kept(&groom, &with(&[much; 3]));
    }
}

#[test]
fn extreme_parameters_give_finite_results() {
    let field = Field::new(NoiseKind::Billow, 16, 1.0, 5);
    let groom = tangled(32, 9);
    let zeros = vec![0.0; groom.points.len()];
    for ramp in [one(), Ramp::constant(1e30), Ramp::constant(-1e30)] {
        for rotate in [f32::MAX, -f32::MAX, 1e-40, -1.0, 3.0] {
            for (amplitude, frequency) in [(f32::MAX, 1e300), (1e-40, 1e-300), (-5.0, f64::MAX)] {
                for mode in [BendMode::Paper, BendMode::ResolutionFree { reference_segments: 1e30 }] {
                    let waviness = frequency as f32;
                    let origin = [frequency, 0.0, 0.0];
                    let noise = BendNoise {
                        field: &field,
                        amplitude: amplitude.into(),
                        frequency,
                        waviness: waviness.into(),
                        origin,
                        other: None,
                        roots: None,
                    };
                    let with = Bend { rotate: rotate.into(), mode, noise: Some(noise), ..plain(&ramp) };
                    assert_kept(&groom, &groom.bend(&with));
                    let masked = groom.bend(&Bend { rotate: Masked { value: rotate, mask: Some(&zeros) }, ..with });
                    assert!(bits(&masked.points) == bits(&groom.points), "g {rotate}, {mode:?}");
                }
            }
        }
    }
}

#[test]
fn nan_in_one_curve_neither_panics_nor_touches_the_others() {
    let ramp = one();
    let clean = tangled(40, 9);
    let mut dirty = clean.map(|cv| cv);
    let hit = clean.starts[7] as usize..clean.starts[8] as usize;
    dirty.points[hit.start] = [f32::NAN, f32::INFINITY, 0.0];
    let (clean, dirty) = (clean.bend(&plain(&ramp)), dirty.bend(&plain(&ramp)));
    for cv in (0..clean.points.len()).filter(|cv| !hit.contains(cv)) {
        assert_eq!(clean.points[cv].map(f32::to_bits), dirty.points[cv].map(f32::to_bits));
    }
}

#[test]
fn ten_thousand_pivots_against_the_wind_take_linear_time() {
    // Each pivot turns so little that all of them stay opposite to the wind; each needs the curve's axis.
    let ramp = one();
    let curve = straight([0.0; 3], [-1.0, 0.0, 0.0], 10_000);
    let groom = Groom::of(&vec![curve; 32]);
    let bent = groom.bend(&Bend { rotate: 1e-15.into(), ..plain(&ramp) });
    assert_kept(&groom, &bent);
}
