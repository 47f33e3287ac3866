//! Statistics of noise fields over many cells.

use super::*;
use crate::vector::DVec3;

const KINDS: [NoiseKind; 3] = [NoiseKind::Perlin, NoiseKind::Billow, NoiseKind::Wavelet];

/// Sum over many random points of what `of` gives, divided by their number.
fn average(of: impl Fn([f64; 3]) -> f64) -> f64 {
    const POINTS: u64 = 200_000;
    let point = |i| [0, 1, 2].map(|axis| Key::new(99).of(i).of(axis).f64() * 1_000.0 - 500.0);
    (0..POINTS).map(|i| of(point(i))).sum::<f64>() / POINTS as f64
}

fn squared(value: f32) -> f64 {
    f64::from(value) * f64::from(value)
}

/// Correlation between component `a` and component `b` a `distance` further.
fn correlation(field: &Field, a: usize, b: usize, distance: [f64; 3]) -> f64 {
    let moved = |p: [f64; 3]| (DVec3::from(p) + DVec3::from(distance)).into();
    let product = average(|p| f64::from(field.at(p)[a]) * f64::from(field.at(moved(p))[b]));
    let squares = [a, b].map(|c| average(|p| squared(field.at(p)[c])));
    product / (squares[0] * squares[1]).sqrt()
}

#[test]
fn every_kind_has_mean_0_and_rms_0_27_at_any_number_of_octaves() {
    for kind in KINDS {
        for (octaves, roughness) in [(1, 0.5), (2, 0.5), (5, 0.9)] {
            let field = Field::new(kind, octaves, roughness, 1);
            for component in 0..3 {
                let mean = average(|p| f64::from(field.at(p)[component]));
                let rms = average(|p| squared(field.at(p)[component])).sqrt();
                assert!(mean.abs() < 0.01, "{kind:?} × {octaves}: mean {mean}");
                assert!((0.25..0.29).contains(&rms), "{kind:?} × {octaves}: rms {rms}");
            }
        }
    }
}

#[test]
fn components_seeds_and_points_2_cells_apart_are_uncorrelated() {
    for kind in [NoiseKind::Perlin, NoiseKind::Billow] {
        let field = Field::new(kind, 1, 0.5, 3);
        for distance in [[2.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 3.0], [4.0, 4.0, -4.0]] {
            let found = correlation(&field, 0, 0, distance);
            assert!(found.abs() < 0.05, "{kind:?} {distance:?}: {found}");
        }
    }
    for kind in KINDS {
        let field = Field::new(kind, 1, 0.5, 3);
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let found = correlation(&field, a, b, [0.0; 3]);
            assert!(found.abs() < 0.05, "{kind:?} components {a}, {b}: {found}");
        }
        let other = Field::new(kind, 1, 0.5, 4);
        let product = average(|p| f64::from(field.at(p)[0]) * f64::from(other.at(p)[0]));
        assert!(product.abs() < 0.05 * 0.27 * 0.27, "{kind:?} seeds: {product}");
    }
}

#[test]
fn mirrored_and_swapped_points_are_uncorrelated() {
    // A hash that mixes the axes weakly shows itself here.
    let field = Field::new(NoiseKind::Perlin, 1, 0.5, 3);
    let value = |p| f64::from(field.at(p)[0]);
    let images: [fn([f64; 3]) -> [f64; 3]; 3] = [|[x, y, z]| [y, x, z], |[x, y, z]| [z, y, x], |[x, y, z]| [-x, y, z]];
    for image in images {
        let product = average(|p| value(p) * value(image(p)));
        assert!(product.abs() < 0.05 * 0.27 * 0.27, "{product}");
    }
}

#[test]
fn gradient_noise_is_0_exactly_on_the_lattice_in_any_octave() {
    let field = Field::new(NoiseKind::Perlin, 6, 0.7, 8);
    for i in -20..20 {
        let cell = [f64::from(i), f64::from(3 * i), f64::from(1_000_000 - i)];
        assert_eq!(field.at(cell), [0.0; 3]);
        assert_eq!(noise3(5, cell), 0.0);
        assert_ne!(noise3(5, cell.map(|x| x + 0.3)), 0.0);
    }
}

/// Mean third difference over `step` squared across faces of cells: falls like `step` where the
/// second derivative is whole, stays where it jumps.
fn third_difference(kind: NoiseKind, step: f64) -> f64 {
    let field = Field::new(kind, 1, 0.5, 8);
    let over = |i: u64| {
        let across = [1, 2].map(|axis| Key::new(4).of(i).of(axis).f64() * 30.0);
        // Wavelet's pieces meet halfway between lattice points.
        let face = i as f64 + if kind == NoiseKind::Wavelet { 0.5 } else { 0.0 };
        let at = |x: f64| f64::from(field.at([face + x * step, across[0], across[1]])[0]);
        (at(1.5) - 3.0 * at(0.5) + 3.0 * at(-0.5) - at(-1.5)).abs() / (step * step)
    };
    (0..2000).map(over).sum()
}

#[test]
fn gradient_noise_is_c2_across_faces_and_wavelet_noise_c1_only() {
    let fall = |kind| third_difference(kind, 0.04) / third_difference(kind, 0.01);
    assert!(fall(NoiseKind::Perlin) > 3.5, "{}", fall(NoiseKind::Perlin));
    assert!(fall(NoiseKind::Wavelet) < 1.5, "{}", fall(NoiseKind::Wavelet));
}

#[test]
fn noise_is_as_smooth_far_from_the_origin_as_near_it() {
    for kind in KINDS {
        let field = Field::new(kind, 2, 0.5, 8);
        for far in [1e3, 1e6, 1e9] {
            for i in 0..1000 {
                let at = |x: f64| field.at([far + 0.013 * f64::from(i) + x, -far + 0.2, 0.4]);
                for (a, b) in at(0.0).into_iter().zip(at(1e-4)) {
                    assert!((a - b).abs() < 2e-3, "{kind:?} at {far}: {a} {b}");
                }
            }
        }
        for absurd in [1e18, -1e30, f64::MAX, f64::INFINITY, f64::NAN] {
            let values = field.at([absurd, 0.3, absurd]);
            assert!(values.iter().all(|value| value.abs() < 4.0), "{kind:?} at {absurd}");
        }
    }
}

#[test]
fn lanes_give_the_bits_of_one_point() {
    for kind in KINDS {
        let field = Field::new(kind, 3, 0.6, 2);
        let points =
            [0, 1, 2].map(|axis| std::array::from_fn(|lane| Key::new(5).of(axis).of(lane as u64).f64() * 1e4 - 5e3));
        let [x, y, z] = field.at_lanes(&points);
        for lane in 0..LANES {
            let one = field.at([points[0][lane], points[1][lane], points[2][lane]]);
            assert_eq!([x.0[lane], y.0[lane], z.0[lane]].map(f32::to_bits), one.map(f32::to_bits));
        }
    }
}

#[test]
fn roughness_0_is_one_octave_and_out_of_range_numbers_are_clamped() {
    let point = [0.3, 1.7, -2.2];
    let one = Field::new(NoiseKind::Perlin, 1, 0.5, 2).at(point);
    assert_eq!(Field::new(NoiseKind::Perlin, 7, 0.0, 2).at(point), one);
    assert_eq!(Field::new(NoiseKind::Perlin, 7, f32::NAN, 2).at(point), one);
    assert_eq!(Field::new(NoiseKind::Perlin, 0, 0.5, 2).at(point), one);
    let most = Field::new(NoiseKind::Perlin, u32::MAX, 3.0, 2);
    assert_eq!(most.at(point), Field::new(NoiseKind::Perlin, 16, 1.0, 2).at(point));
}

#[test]
fn noise3_is_bounded_and_seeded() {
    let largest = average(|p| f64::from(noise3(1, p).abs() > 1.04));
    assert_eq!(largest, 0.0);
    assert_ne!(noise3(1, [0.5, 0.25, 0.125]), noise3(2, [0.5, 0.25, 0.125]));
}
