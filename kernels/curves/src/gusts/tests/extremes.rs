//! Extremes: empty inputs, sizes at the ends of f32, ten thousand overlapping gusts.

use super::*;

#[test]
fn no_points_or_no_gusts_is_valid() {
    let falloff = smooth();
    assert_eq!(evaluate(&[], &only(&falloff, &[sphere([0.0; 3], 1.0)])), Influence { values: vec![], reached: 0 });
    let felt = evaluate(&hairs(3), &Gusts { base: 0.3, ..only(&falloff, &[]) });
    assert_eq!(felt, Influence { values: vec![0.3; 45], reached: 0 });
}

#[test]
fn radii_of_almost_0_reach_nothing() {
    let falloff = one();
    for radius in [0.0, f32::MIN_POSITIVE, -1.0, f32::NAN] {
        assert_eq!(evaluate(&[[0.0; 3]], &only(&falloff, &[sphere([0.0; 3], radius)])).values, [0.0], "{radius}");
    }
    assert_eq!(evaluate(&[[0.0; 3]], &only(&falloff, &[sphere([0.0; 3], SMALLEST)])).values, [1.0]);
    assert_eq!(evaluate(&[[0.0; 3]], &only(&falloff, &[Sphere { strength: 0.0, ..sphere([0.0; 3], 1.0) }])).reached, 0);
}

#[test]
fn any_finite_input_gives_values_from_0_to_1() {
    let sizes = [0.0, 1e-41, 1e-30, 1.0, 1e20, 3e38];
    let points: Vec<[f32; 3]> = sizes.iter().flat_map(|x| [[*x, -*x, 0.0], [-*x, 0.0, *x]]).collect();
    for falloff in [smooth(), Ramp::new(vec![[0.0, 1e30], [1.0, -1e30]], Interpolation::Linear).unwrap()] {
        for size in sizes.iter().map(|x| f64::from(*x)).chain([1e300]) {
            for noise in [0.0, 1.0] {
                let gust = Sphere { noise, ..sphere([size, 0.0, 0.0], size.min(3e38) as f32) };
                let axes = [[size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
                let controls = [ControlShape::Sphere, ControlShape::Cubes]
                    .map(|shape| Control::new(shape, [-size, 0.0, 0.0], axes, 1e30, falloff.clone(), f32::MAX));
                let gusts = Gusts {
                    base: 0.5,
                    falloff: &falloff,
                    spheres: &[gust, gust],
                    controls: &controls,
                    incoming: None,
                    masks: GustMasks::NONE,
                };
                assert!(evaluate(&points, &gusts).values.iter().all(|x| (0.0..=1.0).contains(x)), "{size} {noise}");
            }
        }
    }
}

#[test]
fn ten_thousand_overlapping_gusts_saturate_at_1() {
    let points = hairs(100);
    let falloff = smooth();
    let gusts: Vec<Sphere> = strewn(10_000, [1.0, 0.0, 1.0], 1.0)
        .iter()
        .map(|c| Sphere { noise: 0.2, ..sphere(c.map(f64::from), 5.0) })
        .collect();
    let felt = evaluate(&points, &only(&falloff, &gusts));
    assert_eq!((felt.values, felt.reached), (vec![1.0; points.len()], points.len()));
    // Weak ones, so that none of them may be skipped.
    let weak: Vec<Sphere> = gusts[..1000].iter().map(|gust| Sphere { strength: 1e-5, noise: 0.0, ..*gust }).collect();
    let felt = evaluate(&points, &only(&falloff, &weak));
    assert!(felt.values.iter().all(|x| (5e-3..1e-2).contains(x)));
}
