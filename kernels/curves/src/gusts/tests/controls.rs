//! Controls: distances worked out by hand, their own spaces, flat controls, outlines.

use super::*;

const UNIT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn linear(keys: &[[f32; 2]]) -> Ramp {
    Ramp::new(keys.to_vec(), Interpolation::Linear).unwrap()
}

/// A ramp that shows the distance itself: 1 − distance inside, 0 outside.
fn felt(control: Control, points: &[[f32; 3]]) -> Vec<f32> {
    let falloff = one();
    evaluate(
        points,
        &Gusts {
            base: 0.0,
            falloff: &falloff,
            spheres: &[],
            controls: &[control],
            incoming: None,
            masks: GustMasks::NONE,
        },
    )
    .values
}

#[test]
fn the_share_in_a_sphere_is_0_at_its_centre_and_1_at_its_boundary() {
    let axes = UNIT.map(|axis| axis.map(|x| 2.0 * x));
    let control =
        Control::new(ControlShape::Sphere, [1.0, 0.0, 0.0], axes, 9.0, linear(&[[0.0, 1.0], [1.0, 0.0]]), 1.0);
    let points = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, -1.5, 0.0], [1.0, 0.0, 2.0], [1.0, 0.0, 2.5]];
    assert_eq!(felt(control, &points), [1.0, 0.5, 0.25, 0.0, 0.0]);
}

#[test]
fn the_share_in_cubes_is_a_half_at_the_inner_and_1_at_the_outer_boundary() {
    let control =
        |outer| Control::new(ControlShape::Cubes, [0.0; 3], UNIT, outer, linear(&[[0.0, 1.0], [1.0, 0.0]]), 1.0);
    let points = [[0.0; 3], [0.5, 0.1, -0.2], [0.3, -1.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 3.0], [0.0, 3.1, 0.0]];
    // Outer 3: m = 0, ½, 1, 2, 3, 3.1; shares 0, ¼, ½, ¾, 1, beyond.
    assert_eq!(felt(control(3.0), &points), [1.0, 0.75, 0.5, 0.25, 0.0, 0.0]);
    // Outer 1 and less: nothing beyond the inner cube.
    for outer in [1.0, 0.2, f64::NAN] {
        assert_eq!(felt(control(outer), &points), [1.0, 0.75, 0.5, 0.0, 0.0, 0.0]);
    }
}

#[test]
fn shares_are_measured_in_the_controls_own_space() {
    // Turned by 90° about z, three times as long along its own x, sheared.
    let axes = [[0.0, 3.0, 0.0], [-1.0, 0.5, 0.0], [0.0, 0.0, 0.5]];
    let control = |shape| Control::new(shape, [1.0, 2.0, 3.0], axes, 2.0, linear(&[[0.0, 1.0], [1.0, 0.0]]), 1.0);
    let own = [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, -0.5], [0.25, 0.25, 0.5]];
    let points = own.map(|q: [f64; 3]| {
        let at = |k: usize| [1.0, 2.0, 3.0][k] + (0..3).map(|axis| q[axis] * axes[axis][k]).sum::<f64>();
        [0, 1, 2].map(|k| at(k) as f32)
    });
    let close = |a: Vec<f32>, b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    let corner = 1.0 - 0.375_f32.sqrt();
    assert!(close(felt(control(ControlShape::Sphere), &points), [0.5, 0.5, 0.5, corner]));
    assert!(close(felt(control(ControlShape::Cubes), &points), [0.75, 0.75, 0.75, 0.75]));
}

#[test]
fn negative_strengths_subtract_and_sums_follow_the_list_order() {
    let falloff = one();
    let control = |strength| Control::new(ControlShape::Sphere, [0.0; 3], UNIT, 2.0, one(), strength);
    let with = |controls: &[Control]| {
        let gusts =
            Gusts { base: 0.75, falloff: &falloff, spheres: &[], controls, incoming: None, masks: GustMasks::NONE };
        evaluate(&[[0.5, 0.0, 0.0]], &gusts).values[0]
    };
    assert_eq!(with(&[control(-0.5)]), 0.25);
    assert_eq!(with(&[control(-2.0)]), 0.0);
    assert_eq!(with(&[control(3.0), control(-3.5)]), 0.25, "sums are clamped at the end alone");
    assert_eq!(with(&[control(0.0)]), 0.75);
    assert!(control(1.0).only_adds() && !control(-1.0).only_adds());
}

#[test]
fn a_control_without_volume_reaches_nothing() {
    let flat = [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]], [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.3, 0.0]]];
    let broken = [[[f64::NAN, 0.0, 0.0], UNIT[1], UNIT[2]], [[f64::INFINITY, 0.0, 0.0], UNIT[1], UNIT[2]]];
    for axes in flat.into_iter().chain(broken).chain([[[0.0; 3]; 3]]) {
        for shape in [ControlShape::Sphere, ControlShape::Cubes] {
            let control = Control::new(shape, [0.0; 3], axes, 2.0, one(), 1.0);
            assert_eq!(felt(control, &[[0.0; 3], [0.1, 0.1, 0.0]]), [0.0, 0.0], "{axes:?}");
        }
    }
    // A thin control is not flat.
    let thin = [UNIT[0], UNIT[1], [0.0, 0.0, 1e-9]];
    assert_eq!(felt(Control::new(ControlShape::Sphere, [0.0; 3], thin, 2.0, one(), 1.0), &[[0.0; 3]]), [1.0]);
}

#[test]
fn culling_never_loses_a_point() {
    let points = hairs(50);
    let axes = [[0.4, 0.3, 0.0], [-0.3, 0.4, 0.1], [0.05, 0.0, 0.6]];
    for shape in [ControlShape::Sphere, ControlShape::Cubes] {
        let control = Control::new(shape, [1.1, 0.0, 0.9], axes, 1.7, one(), 1.0);
        let together = felt(control.clone(), &points);
        let alone: Vec<f32> = points.iter().flat_map(|p| felt(control.clone(), &[*p])).collect();
        assert_eq!(together, alone);
        assert!(together.contains(&1.0) && together.contains(&0.0));
    }
}

#[test]
fn an_outline_begins_with_its_centre_and_axes_and_lies_on_its_boundaries() {
    for (shape, outer) in [(ControlShape::Sphere, 2.0), (ControlShape::Cubes, 2.0), (ControlShape::Cubes, 1.0)] {
        for least in [0, 1000] {
            let points = outline(shape, [[outer; 3]; 2], least);
            assert_eq!(points[..AXIS_ROWS], [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            assert!(points.len() >= least);
            for p in &points[AXIS_ROWS..] {
                let size = match shape {
                    ControlShape::Sphere => vector::length(*p),
                    ControlShape::Cubes => p.iter().fold(0.0_f32, |most, x| most.max(x.abs())),
                };
                assert!(
                    [1.0, if shape == ControlShape::Cubes { outer as f32 } else { 1.0 }]
                        .iter()
                        .any(|b| (size - b).abs() < 1e-6)
                );
            }
        }
    }
}

#[test]
fn the_outline_of_a_free_outer_box_has_its_corners() {
    let points = outline(ControlShape::Cubes, [[2.0, 1.0, 3.0], [1.5, 4.0, 1.0]], 0);
    let corner = |k: usize| [[-2.0, 1.5], [-1.0, 4.0], [-3.0, 1.0]].map(|ends: [f32; 2]| ends[k]);
    let ends = |pick: fn(f32, f32) -> f32| {
        let start = points[AXIS_ROWS];
        points[AXIS_ROWS..].iter().fold(start, |so_far, p| [0, 1, 2].map(|k| pick(so_far[k], p[k])))
    };
    assert_eq!((ends(f32::min), ends(f32::max)), (corner(0), corner(1)));
}

#[test]
fn a_box_of_equal_sides_has_the_bits_of_an_outer_cube_and_culling_reaches_all_of_any() {
    let axes = [[0.3, 0.4, 0.0], [-0.4, 0.3, 0.1], [0.0, -0.1, 0.5]];
    let cubes =
        |outer| Control::new(ControlShape::Cubes, [1.1, 0.0, 0.9], axes, outer, linear(&[[0.0, 1.0], [1.0, 0.0]]), 1.0);
    let points: Vec<[f32; 3]> =
        (0..4096).map(|k| [k % 16, k / 16 % 16, k / 256].map(|x| 0.25 * x as f32 - 1.0)).collect();
    let same = felt(cubes(1.0).within_box([2.5; 3], [2.5; 3]), &points);
    assert!(same == felt(cubes(2.5), &points));
    assert!(same.iter().any(|x| *x > 0.0));
    let free = Control::new(ControlShape::Cubes, [1.1, 0.0, 0.9], axes, 1.0, one(), 1.0);
    let free = free.within_box([1.0, 2.0, 3.0], [3.0, 1.5, 1.0]);
    let alone: Vec<f32> = points.iter().flat_map(|p| felt(free.clone(), &[*p])).collect();
    assert!(felt(free, &points) == alone && alone.contains(&1.0));
}
