//! Closed forms and symmetries.

use super::*;
use numerics::masked::Masked;
use numerics::noise::NoiseKind;
use std::f64::consts::PI;

/// A straight curve at an angle of `theta` to the wind (along x).
fn leaning(theta: f64) -> Vec3 {
    [libm::cos(theta) as f32, (0.6 * libm::sin(theta)) as f32, (0.8 * libm::sin(theta)) as f32]
}

const DOWNWIND: [f64; 3] = [1.0, 0.0, 0.0];

/// Checks a straight curve's segments against `law`, which gives a segment's angle from its number
/// and its middle's u.
fn check_angles(theta: f64, root: Vec3, segments: usize, with: &Bend<'_>, law: impl Fn(usize, f64) -> f64) {
    let groom = Groom::of(&[straight(root, leaning(theta), segments)]);
    let bent = groom.bend(with);
    let largest = bent.points.iter().map(|cv| vector::largest(*cv)).fold(0.0, f32::max);
    let tolerance = 2e-6 + 4.0 * ulp(largest) * segments as f64;
    for (k, angle) in angles(&bent.points, DOWNWIND).into_iter().enumerate() {
        let expected = law(k, (k as f64 + 0.5) / segments as f64);
        let error = (angle - expected).abs();
        assert!(error < tolerance, "θ₀ {theta}, segment {k} of {segments}: {angle}, not {expected}");
    }
    assert_kept(&groom, &bent);
}

#[test]
fn a_quarter_turn_at_once_lays_the_curve_along_the_wind() {
    let ramp = one();
    let groom = Groom::of(&[straight([0.0; 3], [0.0, 2.0, 0.0], 2)]);
    let bent = groom.bend(&Bend { rotate: 1.0.into(), ..plain(&ramp) });
    assert!(farthest(&bent.points, &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]) < 3e-7);
    assert!((f64::from(bent.max_angle) - PI / 2.0).abs() < 3e-7);
    assert!(bent.length_error < 2e-7);
}

#[test]
fn segment_k_of_a_straight_curve_ends_at_theta_0_times_1_minus_g_to_the_k() {
    let ramp = one();
    for theta in [1e-3, 0.3, 1.2, PI / 2.0, 2.7, 3.1] {
        for g in [0.05f32, 0.3, 0.5, 0.9, 1.0] {
            for segments in 1..=8 {
                let with = Bend { rotate: g.into(), ..plain(&ramp) };
                let left = 1.0 - f64::from(g);
                check_angles(theta, [0.0; 3], segments, &with, |k, _| theta * libm::pow(left, k as f64 + 1.0));
                check_angles(theta, [900.0, -7.0, 400.0], segments, &with, |k, _| {
                    theta * libm::pow(left, k as f64 + 1.0)
                });
            }
        }
    }
}

#[test]
fn a_negative_share_turns_away_and_one_above_1_past_the_wind() {
    let ramp = one();
    check_angles(1.0, [0.0; 3], 1, &Bend { rotate: (-0.5).into(), ..plain(&ramp) }, |_, _| 1.5);
    check_angles(1.0, [0.0; 3], 1, &Bend { rotate: 1.25.into(), ..plain(&ramp) }, |_, _| 0.25);
}

#[test]
fn ramp_mask_and_envelope_scale_the_share_at_the_pivot() {
    let keys = vec![[0.0, 1.0], [1.0, 0.5]];
    let ramp = Ramp::new(keys, Interpolation::Linear).unwrap();
    let (mask, envelope) = ([0.5, 1.0, 9.0], [1.0, 0.4, 9.0]);
    let with = Bend { rotate: Masked { value: 0.5, mask: Some(&mask) }, envelope: Some(&envelope), ..plain(&ramp) };
    // g is 0.5·1·0.5·1 at the root, and 0.5·0.75·1·0.4 in the middle.
    check_angles(1.0, [0.0; 3], 2, &with, |k, _| [0.75, 0.75 * 0.85][k]);
}

#[test]
fn resolution_free_angles_follow_the_middle_of_each_segment() {
    let ramp = one();
    for g in [0.1f32, 0.5, 0.9] {
        for segments in [1, 2, 4, 8, 32, 128, 1024] {
            let mode = BendMode::ResolutionFree { reference_segments: 4.0 };
            let with = Bend { rotate: g.into(), mode, ..plain(&ramp) };
            let left = 1.0 - f64::from(g);
            check_angles(1.5, [0.0; 3], segments, &with, |_, u| 1.5 * libm::pow(left, 4.0 * u));
        }
    }
}

#[test]
fn resolution_free_lies_along_the_wind_from_g_1_on() {
    let ramp = one();
    let mode = BendMode::ResolutionFree { reference_segments: 4.0 };
    for g in [1.0, 3.0] {
        check_angles(2.0, [0.0; 3], 5, &Bend { rotate: g.into(), mode, ..plain(&ramp) }, |_, _| 0.0);
    }
}

#[test]
fn resolution_free_tips_converge_with_order_2_and_are_within_a_hundredth_at_9_cvs() {
    let ramp = one();
    let mode = BendMode::ResolutionFree { reference_segments: 4.0 };
    for g in [0.3, 0.5, 0.7] {
        let tip = |segments| {
            let groom = Groom::of(&[straight([0.0; 3], leaning(2.0), segments)]);
            *groom.bend(&Bend { rotate: g.into(), mode, ..plain(&ramp) }).points.last().unwrap()
        };
        let finest = tip(1024);
        let error = |segments| distance(tip(segments), finest);
        assert!(error(8) < 1e-2, "g {g}: {}", error(8));
        for segments in [4, 8, 16] {
            let order = libm::log2(error(segments) / error(2 * segments));
            assert!((1.8..2.2).contains(&order), "g {g}, {segments} segments: order {order}");
        }
    }
}

#[test]
fn scene_and_wind_turned_moved_or_scaled_together_give_the_same_shape() {
    let ramp = Ramp::new(vec![[0.0, 0.3], [1.0, 1.0]], Interpolation::Smooth).unwrap();
    let groom = tangled(200, 12);
    let bent = groom.bend(&plain(&ramp)).points;

    let turn = {
        let (s, c) = numerics::trig::sin_cos(0.7);
        [0.48 * s, 0.6 * s, 0.64 * s, c]
    };
    let turned = |cv| vector::turned(turn, cv);
    let with = Bend { wind: turned([1.0, 0.0, 0.0]), ..plain(&ramp) };
    let expected: Vec<_> = bent.iter().map(|cv| turned(*cv)).collect();
    assert!(farthest(&groom.map(turned).bend(&with).points, &expected) < 1e-5);

    // Moved by powers of two, so that the input keeps its digits except those beyond 2⁻²¹.
    let moved = |cv| vector::add(cv, [8.0, -4.0, 16.0]);
    let expected: Vec<_> = bent.iter().map(|cv| moved(*cv)).collect();
    assert!(farthest(&groom.map(moved).bend(&plain(&ramp)).points, &expected) < 1e-5 + 4.0 * ulp(16.0));

    for factor in [1e-3, 1e3, 1e-6, 1e6] {
        let scaled = |cv| vector::scale(cv, factor);
        let expected: Vec<_> = bent.iter().map(|cv| scaled(*cv)).collect();
        let found = groom.map(scaled).bend(&plain(&ramp)).points;
        assert!(farthest(&found, &expected) < 1e-5 * f64::from(factor), "× {factor}");
    }
}

#[test]
fn scaling_by_a_power_of_two_is_exact() {
    let ramp = one();
    let groom = tangled(50, 12);
    let bent = groom.bend(&plain(&ramp)).points;
    for exponent in [-80, -10, 10, 80] {
        let factor = libm::exp2(f64::from(exponent)) as f32;
        let expected: Vec<_> = bent.iter().map(|cv| vector::scale(*cv, factor)).collect();
        let found = groom.map(|cv| vector::scale(cv, factor)).bend(&plain(&ramp)).points;
        assert_eq!(bits(&found), bits(&expected), "× 2^{exponent}");
    }
}

fn noisy(field: &numerics::noise::Field) -> BendNoise<'_> {
    BendNoise {
        field,
        amplitude: 0.8.into(),
        frequency: 1.0,
        waviness: 0.0.into(),
        origin: [0.0; 3],
        other: None,
        roots: None,
    }
}

#[test]
fn gradient_noise_has_no_effect_at_a_root_on_its_lattice() {
    let (ramp, field) = (one(), Field::new(NoiseKind::Perlin, 3, 0.5, 1));
    let with = Bend { noise: Some(noisy(&field)), ..plain(&ramp) };
    let at = |root| Groom::of(&[straight(root, [0.0, 1.0, 0.0], 4)]);
    let on = at([3.0, -2.0, 5.0]);
    assert_eq!(on.bend(&with), on.bend(&plain(&ramp)));
    let beside = at([3.4, -2.3, 5.2]);
    assert_ne!(beside.bend(&with), beside.bend(&plain(&ramp)));
}

#[test]
fn the_pattern_scrolls_downwind() {
    let (ramp, field) = (one(), Field::new(NoiseKind::Perlin, 2, 0.5, 1));
    // After 2 m of scroll the wind at a root is what it was 2 m upwind of it (dyadic: no rounding).
    let at = |x| Groom::of(&[straight([x, 0.25, 0.625], [0.0, 1.0, 0.0], 4)]);
    let shape = |groom: Groom, noise| {
        let bent = groom.bend(&Bend { noise: Some(noise), ..plain(&ramp) });
        bent.points.iter().map(|cv| vector::sub(*cv, groom.points[0])).collect::<Vec<_>>()
    };
    let scrolled = BendNoise { origin: [-2.0, 0.0, 0.0], ..noisy(&field) };
    let before = shape(at(0.375), noisy(&field));
    assert!(farthest(&shape(at(2.375), scrolled.clone()), &before) < 1e-6);
    assert!(farthest(&shape(at(0.375), scrolled), &before) > 1e-3);
}

#[test]
fn noise_is_sampled_at_the_given_roots() {
    let (ramp, field) = (one(), Field::new(NoiseKind::Billow, 2, 0.5, 1));
    let roots: Vec<_> = (0..20).map(|i| [0.3 * i as f32, 0.1, 0.7]).collect();
    let curves =
        |roots: &[Vec3]| Groom::of(&roots.iter().map(|root| straight(*root, [0.0, 1.0, 0.1], 3)).collect::<Vec<_>>());
    let own = curves(&roots).bend(&Bend { noise: Some(noisy(&field)), ..plain(&ramp) });
    let given = BendNoise { roots: Some(&roots), ..noisy(&field) };
    let moved: Vec<_> = roots.iter().map(|root| vector::add(*root, [4.0, 8.0, -2.0])).collect();
    let found = curves(&moved).bend(&Bend { noise: Some(given), ..plain(&ramp) });
    let back: Vec<_> = found.points.iter().map(|cv| vector::sub(*cv, [4.0, 8.0, -2.0])).collect();
    assert!(farthest(&back, &own.points) < 4e-6);
}

#[test]
fn waviness_varies_the_wind_down_the_curve() {
    let (ramp, field) = (one(), Field::new(NoiseKind::Perlin, 1, 0.5, 1));
    let groom = Groom::of(&[straight([0.3, 0.2, 0.1], [0.0, 4.0, 0.0], 6)]);
    let wavy = |waviness: f32| {
        let noise = BendNoise { waviness: waviness.into(), ..noisy(&field) };
        groom.bend(&Bend { noise: Some(noise), rotate: 1.0.into(), ..plain(&ramp) })
    };
    // With one direction for all pivots a straight curve at g = 1 stays straight.
    let (still, waves) = (wavy(0.0), wavy(1.0));
    let tip = |bent: &Bent| distance(bent.points[0], bent.points[6]);
    assert!((tip(&still) - 4.0).abs() < 1e-5);
    assert!(tip(&waves) < 3.99);
}

#[test]
fn blend_0_keeps_the_bits_1_turns_in_full_and_a_half_by_half() {
    let (ramp, groom) = (one(), tangled(100, 9));
    let full = groom.bend(&plain(&ramp));
    let with = |blend, mask| groom.bend(&Bend { blend: Masked { value: blend, mask }, ..plain(&ramp) });
    let ones = vec![1.0; groom.points.len()];
    let zeros = vec![0.0; groom.points.len()];
    assert_eq!(bits(&with(0.0, None).points), bits(&groom.points));
    assert_eq!(bits(&with(1.0, Some(&zeros)).points), bits(&groom.points));
    assert_eq!(with(1.0, Some(&ones)), full);
    assert_eq!(with(7.0, Some(&ones)), full);
    check_angles(1.0, [0.0; 3], 4, &Bend { blend: 0.5.into(), ..plain(&ramp) }, |k, _| {
        0.5 + 0.5 * libm::pow(0.5, k as f64 + 1.0)
    });
    assert_kept(&groom, &with(0.3, None));
}

#[test]
fn without_wind_curves_keep_their_bits() {
    let (ramp, zero) = (one(), Ramp::constant(0.0));
    let groom = tangled(100, 9);
    let calm: Vec<f32> = (0..groom.points.len()).map(|cv| if cv % 2 == 0 { 0.0 } else { -1.0 }).collect();
    for with in
        [Bend { rotate: 0.0.into(), ..plain(&ramp) }, plain(&zero), Bend { envelope: Some(&calm), ..plain(&ramp) }]
    {
        let bent = groom.bend(&with);
        assert_eq!(bits(&bent.points), bits(&groom.points));
        assert_eq!((bent.max_angle, bent.length_error), (0.0, 0.0));
    }
}

#[test]
fn gusts_add_to_the_direction_of_the_wind_at_each_cv() {
    // Wind along x and a gust along z of length 1 blow along the diagonal: with g 1 all segments lie along it. NaN counts
    // as 0.
    let (groom, ramp) = (Groom::of(&[straight([0.0; 3], [0.0, 1.0, 0.0], 4)]), one());
    let with = |gusts: &[Vec3]| groom.bend(&Bend { gusts: Some(gusts), rotate: 1.0.into(), ..plain(&ramp) });
    let diagonal = std::f64::consts::FRAC_1_SQRT_2;
    assert!(angles(&with(&[[0.0, 0.0, 1.0]; 5]).points, [diagonal, 0.0, diagonal]).iter().all(|angle| *angle < 2e-6));
    // One that blows at the third CV alone: the first two segments along x, the others along the diagonal.
    let mut once = [[f32::NAN, 0.0, 0.0]; 5];
    once[2] = [0.0, 0.0, 1.0];
    let bent = with(&once);
    assert!(angles(&bent.points, [1.0, 0.0, 0.0])[..2].iter().all(|angle| *angle < 2e-6));
    assert!(angles(&bent.points, [diagonal, 0.0, diagonal])[2] < 2e-6);
    assert_kept(&groom, &with(&[[f32::MAX, -f32::MAX, f32::INFINITY]; 5]));
    // No gust and a gust of 0 give the same bits, noise or not.
    let (groom, field) = (tangled(40, 9), Field::new(NoiseKind::Perlin, 2, 0.5, 3));
    let still = vec![[0.0; 3]; groom.points.len()];
    let noise = BendNoise { waviness: 1.0.into(), ..noisy(&field) };
    let with = Bend { noise: Some(noise), ..plain(&ramp) };
    assert_eq!(
        bits(&groom.bend(&Bend { gusts: Some(&still), ..with.clone() }).points),
        bits(&groom.bend(&with).points)
    );
}

#[test]
fn another_origin_is_blended_in_by_its_share() {
    let (groom, ramp) = (tangled(40, 9), one());
    let field = Field::new(NoiseKind::Perlin, 2, 0.5, 3);
    let bent =
        |origin, other| groom.bend(&Bend { noise: Some(BendNoise { origin, other, ..noisy(&field) }), ..plain(&ramp) });
    let (here, there) = ([0.0; 3], [3.5, 0.25, -1.0]);
    assert_eq!(bits(&bent(here, Some((there, 0.0))).points), bits(&bent(here, None).points));
    assert_eq!(bits(&bent(here, Some((there, 1.0))).points), bits(&bent(there, None).points));
    // In between the direction is wind + 0.8 · (a + b) ÷ √2, as the field itself gives it.
    let root = [0.3, -0.7, 0.9];
    let groom = Groom::of(&[straight(root, [0.0, 1.0, 0.0], 1)]);
    let noise = BendNoise { other: Some((there, 0.5)), ..noisy(&field) };
    let bent = groom.bend(&Bend { noise: Some(noise), rotate: 1.0.into(), ..plain(&ramp) });
    let [a, b] = [here, there].map(|origin: [f64; 3]| field.at([0, 1, 2].map(|k| f64::from(root[k]) + origin[k])));
    let towards = DVec3::from([0, 1, 2].map(|k| f64::from(a[k] + b[k]) * 0.8 * std::f64::consts::FRAC_1_SQRT_2));
    let towards = (DVec3::x() + towards).normalize();
    assert!(angles(&bent.points, towards.into())[0] < 4e-6);
}

#[test]
fn a_mask_scales_the_waviness_where_it_is() {
    let (groom, ramp) = (tangled(40, 9), one());
    let field = Field::new(NoiseKind::Perlin, 2, 0.5, 3);
    let bent = |value, mask| {
        let noise = BendNoise { waviness: Masked { value, mask }, ..noisy(&field) };
        bits(&groom.bend(&Bend { noise: Some(noise), ..plain(&ramp) }).points)
    };
    let (ones, halves) = (vec![1.0; groom.points.len()], vec![0.5; groom.points.len()]);
    assert_eq!(bent(2.0, Some(&ones)), bent(2.0, None));
    assert_eq!(bent(2.0, Some(&halves)), bent(1.0, None));
    assert_ne!(bent(2.0, None), bent(1.0, None));
}
