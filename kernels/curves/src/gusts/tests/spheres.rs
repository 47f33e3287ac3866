//! Spheres: hand-worked values, sums against f64, noise, culling, equal bits.

use super::*;

#[test]
fn influence_is_1_at_the_centre_0_at_the_boundary_and_a_smoothstep_between() {
    let points =
        [[2.0, 0.0, 0.0], [2.0, 0.25, 0.0], [2.0, 0.0, -0.5], [2.5, 0.0, 0.0], [3.0, 0.0, 0.0], [2.0, 1.1, 0.0]];
    let felt = evaluate(&points, &only(&smooth(), &[sphere([2.0, 0.0, 0.0], 1.0)]));
    // 1 − (3t² − 2t³) at t = ¼ is 1 − 0.15625.
    assert_eq!(felt.values, [1.0, 0.84375, 0.5, 0.5, 0.0, 0.0]);
    assert_eq!(felt.reached, 4);
}

#[test]
fn influences_add_to_the_base_and_are_clamped() {
    let falloff = Ramp::new(vec![[0.0, 0.5], [1.0, 0.5]], Interpolation::Linear).unwrap();
    let spheres = [sphere([0.0; 3], 1.0), sphere([1.0, 0.0, 0.0], 1.0), sphere([0.5, 0.0, 0.0], 0.25)];
    let points = [[-0.5, 0.0, 0.0], [0.1, 0.0, 0.0], [0.5, 0.0, 0.0], [9.0, 0.0, 0.0]];
    let with = |base| evaluate(&points, &Gusts { base, ..only(&falloff, &spheres) });
    assert_eq!(with(0.0).values, [0.5, 1.0, 1.0, 0.0]);
    assert_eq!(with(0.125).values, [0.625, 1.0, 1.0, 0.125]);
    assert_eq!((with(0.125).reached, with(1.0).values), (3, vec![1.0; 4]));
    let falloff = Ramp::constant(-0.75);
    let felt = evaluate(&points, &Gusts { base: 1.0, ..only(&falloff, &spheres) });
    assert_eq!(felt.values, [0.25, 0.0, 0.0, 1.0]);
}

#[test]
fn sums_match_f64_sums_over_all_spheres_despite_culling() {
    let points = hairs(40);
    let spheres: Vec<Sphere> = strewn(30, [1.0, 0.0, 1.0], 1.2)
        .iter()
        .enumerate()
        .map(|(k, c)| Sphere { strength: 0.1 + 0.02 * k as f32, ..sphere(c.map(f64::from), 0.1 + 0.03 * k as f32) })
        .collect();
    let felt = evaluate(&points, &only(&smooth(), &spheres));
    for (point, value) in points.iter().zip(&felt.values) {
        let sum: f64 = spheres
            .iter()
            .map(|sphere| {
                let square: f64 = (0..3).map(|k| f64::from(point[k]) - sphere.centre[k]).map(|d| d * d).sum();
                let t = (square.sqrt() / f64::from(sphere.radius)).min(1.0);
                f64::from(sphere.strength) * (1.0 - t * t * (3.0 - 2.0 * t))
            })
            .sum();
        assert!((f64::from(*value) - sum.min(1.0)).abs() < 2e-6, "{value} for {sum}");
    }
    assert!(felt.reached > 1000 && felt.reached < points.len());
}

#[test]
fn noise_keeps_the_centre_and_stays_within_the_sphere() {
    let points = strewn(20_000, [0.0; 3], 1.2);
    let falloff = smooth();
    let round = evaluate(&points, &only(&falloff, &[sphere([0.0; 3], 1.0)]));
    for noise in [0.1, 0.5, 1.0] {
        let dented = evaluate(&points, &only(&falloff, &[Sphere { noise, ..sphere([0.0; 3], 1.0) }]));
        for (dented, round) in dented.values.iter().zip(&round.values) {
            assert!(dented <= round, "noise did not shrink the gust: {dented} and {round}");
        }
        assert!(dented.reached > 0 && dented.reached < round.reached);
        // The boundary is at 1 − noise or farther.
        let least = 0.999 * (1.0 - noise);
        let inside = points.iter().zip(&dented.values).filter(|(p, _)| vector::length(**p) < least);
        assert!(inside.into_iter().all(|(_, value)| *value > 0.0));
        let centre = evaluate(&[[0.0; 3]], &only(&falloff, &[Sphere { noise, ..sphere([0.0; 3], 1.0) }]));
        assert_eq!(centre.values, [1.0]);
    }
}

#[test]
fn each_sphere_has_its_own_noise_which_moves_with_it() {
    let points = strewn(2000, [0.0; 3], 1.0);
    let moved: Vec<[f32; 3]> = points.iter().map(|p| [p[0] + 4.0, p[1], p[2]]).collect();
    let falloff = smooth();
    let at = |points: &[[f32; 3]], x: f64, salt: u32| {
        let with = Sphere { noise: 0.8, salt, ..sphere([x, 0.0, 0.0], 1.0) };
        evaluate(points, &only(&falloff, &[with])).values
    };
    let (here, there) = (at(&points, 0.0, 5), at(&moved, 4.0, 5));
    assert!(here.iter().zip(&there).all(|(a, b)| (a - b).abs() < 1e-5));
    assert_ne!(here, at(&points, 0.0, 6));
}

#[test]
fn incoming_values_scale_the_result_and_negative_or_nan_counts_as_0() {
    let incoming = [0.5, 2.0, -1.0, f32::NAN];
    let falloff = one();
    let spheres = [sphere([0.0; 3], 1.0)];
    let gusts = Gusts { base: 0.25, incoming: Some(&incoming), ..only(&falloff, &spheres) };
    assert_eq!(evaluate(&[[0.0; 3]; 4], &gusts).values, [0.5, 1.0, 0.0, 0.0], "at most 1");
    assert_eq!(evaluate(&[[5.0; 3]; 4], &gusts).values, [0.125, 0.5, 0.0, 0.0]);
}

#[test]
fn results_are_the_same_far_from_the_origin_and_at_any_scale() {
    let (points, falloff) = (strewn(500, [0.0; 3], 1.0), smooth());
    let gust = Sphere { noise: 0.5, ..sphere([0.25, 0.0, 0.0], 0.75) };
    let here = evaluate(&points, &only(&falloff, &[gust])).values;
    for scale in [1e-6_f32, 1e6] {
        let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x * scale)).collect();
        let gust = Sphere { centre: gust.centre.map(|x| x * f64::from(scale)), radius: gust.radius * scale, ..gust };
        let scaled = evaluate(&points, &only(&falloff, &[gust])).values;
        assert!(here.iter().zip(&scaled).all(|(a, b)| (a - b).abs() < 1e-5));
    }
    // 2⁻⁷ m of the grid at 100 km are whole numbers of ulp, so nothing is lost.
    let grid = |far: f32| -> Vec<[f32; 3]> { (0..300).map(|k| [far + (k as f32 - 150.0) / 128.0, 0.5, 0.0]).collect() };
    let near = evaluate(&grid(0.0), &only(&falloff, &[gust])).values;
    let gust = Sphere { centre: [100_000.25, 0.0, 0.0], ..gust };
    assert_eq!(bits(&evaluate(&grid(100_000.0), &only(&falloff, &[gust])).values), bits(&near));
}

#[test]
fn every_path_and_number_of_threads_gives_the_same_bits() {
    let points = hairs(60);
    let incoming: Vec<f32> = (0..points.len() as u64).map(|k| Key::new(9).of(k).f32()).collect();
    let spheres: Vec<Sphere> = strewn(40, [1.0, 0.0, 1.0], 1.2)
        .iter()
        .map(|c| Sphere { noise: 0.4, strength: 0.7, salt: c[0].to_bits(), ..sphere(c.map(f64::from), 0.3) })
        .collect();
    let axes = [[0.5, 0.1, 0.0], [0.0, 0.2, 0.0], [-0.1, 0.0, 0.4]];
    let controls = [ControlShape::Sphere, ControlShape::Cubes]
        .map(|shape| Control::new(shape, [1.0, 0.0, 0.5], axes, 1.5, smooth(), -0.4));
    let falloff = smooth();
    let gusts = Gusts {
        base: 0.1,
        falloff: &falloff,
        spheres: &spheres,
        controls: &controls,
        incoming: Some(&incoming),
        masks: GustMasks::NONE,
    };
    let expected = evaluate_on(Path::BASELINE, &points, &gusts);
    for path in Path::all() {
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| evaluate_on(path, &points, &gusts));
            assert_eq!(bits(&found.values), bits(&expected.values), "{} × {threads}", path.name());
            assert_eq!(found, expected);
        }
    }
}

#[test]
fn masks_scale_the_base_and_the_influences_of_single_points() {
    let (falloff, spheres) = (one(), [Sphere { strength: 0.25, ..sphere([0.0; 3], 1.0) }]);
    let (base, strength) = ([0.0, 1.0, 0.5, 9.0, f32::NAN, -1.0], [1.0, 0.0, 2.0, 0.5, -1.0, f32::INFINITY]);
    let masks = GustMasks { base: Some(&base), strength: Some(&strength) };
    let gusts = Gusts { base: 0.5, masks, ..only(&falloff, &spheres) };
    assert_eq!(evaluate(&[[0.0; 3]; 6], &gusts).values, [0.25, 0.5, 0.75, 1.0, 0.0, 1.0]);
    assert_eq!(evaluate(&[[5.0; 3]; 6], &gusts).values, [0.0, 0.5, 0.25, 1.0, 0.0, 0.0], "out of reach");
    // Masks of 1 change no bit, whatever is culled.
    let points = hairs(40);
    let ones = vec![1.0; points.len()];
    let masks = GustMasks { base: Some(&ones), strength: Some(&ones) };
    let spheres: Vec<Sphere> = strewn(20, [1.0, 0.0, 1.0], 1.2).iter().map(|c| sphere(c.map(f64::from), 0.3)).collect();
    let falloff = smooth();
    let plain = Gusts { base: 0.2, ..only(&falloff, &spheres) };
    assert_eq!(evaluate(&points, &Gusts { masks, ..plain.clone() }), evaluate(&points, &plain));
}

#[test]
fn gusts_blow_to_their_sides_by_their_influence() {
    let spheres = [Sphere { strength: 0.5, ..sphere([0.0; 3], 2.0) }, sphere([1.0, 0.0, 0.0], 2.0)];
    let falloff = Ramp::new(vec![[0.0, 1.0], [1.0, 0.0]], Interpolation::Linear).unwrap();
    let sides = [[0.0, 1.0, 0.0], [0.0, 0.0, -2.0]];
    // At x = 1: 0.5 · (1 − ½) of the first, all of the second; at −1 the second's boundary; at 9 nothing.
    let points = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [9.0, 0.0, 0.0]];
    let found = sideways(&points, &only(&falloff, &spheres), &sides);
    assert_eq!(found, [[0.0, 0.25, -2.0], [0.0, 0.25, 0.0], [0.0; 3]]);
    let strength = [2.0, -1.0, 1.0];
    let masks = GustMasks { strength: Some(&strength), base: None };
    let found = sideways(&points, &Gusts { masks, ..only(&falloff, &spheres) }, &sides);
    assert_eq!(found, [[0.0, 0.5, -4.0], [0.0; 3], [0.0; 3]]);
    let (points, sides) = (hairs(60), vec![[0.3, -0.4, 0.5]; 40]);
    let spheres: Vec<Sphere> = strewn(40, [1.0, 0.0, 1.0], 1.2)
        .iter()
        .map(|c| Sphere { noise: 0.4, salt: c[0].to_bits(), ..sphere(c.map(f64::from), 0.3) })
        .collect();
    let gusts = only(&falloff, &spheres);
    let expected = sideways_on(Path::BASELINE, &points, &gusts, &sides);
    for path in Path::all() {
        for threads in [1, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| sideways_on(path, &points, &gusts, &sides));
            assert!(found.as_flattened() == expected.as_flattened(), "{} × {threads}", path.name());
        }
    }
}

#[test]
fn points_on_one_side_of_all_gusts_are_told_apart_from_those_near_one() {
    let gusts = [[-2.0, -1.0, 0.0], [-1.0, 0.0, 1.0]];
    let all = |points: &[[f32; 3]]| all_beside(Path::chosen(), points, &gusts);
    let points = hairs(40);
    for axis in 0..3 {
        for side in [-30.0, 30.0] {
            let moved =
                |by: f32| points.iter().map(move |p| [0, 1, 2].map(|k| p[k] + if k == axis { by } else { 0.0 }));
            let far: Vec<[f32; 3]> = moved(side).collect();
            assert!(all(&far), "{axis} {side}");
            // The first, one of the groups of sixteen, one of the rest.
            for within in [0, 37, far.len() - 1] {
                let mut near = far.clone();
                near[within] = [-1.5, -0.5, 0.5];
                assert!(!all(&near), "{axis} {side} {within}");
            }
        }
    }
    assert!(all(&[]));
}
