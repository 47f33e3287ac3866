//! The paper's own procedure in f64, which moves every later point at every pivot; and equal bits on all SIMD paths and
//! numbers of threads.

use super::*;
use numerics::masked::Masked;
use numerics::noise::NoiseKind;
use numerics::vector::{DVec3, to_f32};

/// `v` rotated by `angle` about the unit vector `axis` (Rodrigues).
fn rotated(v: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let (sine, cosine) = libm::sincos(angle);
    v * cosine + axis.cross(&v) * sine + axis * (axis.dot(&v) * (1.0 - cosine))
}

/// One curve bent as in the paper; `wind` gives the wind's direction at an arc length.
fn paper(curve: &[Vec3], share: impl Fn(usize, f32) -> f64, wind: impl Fn(f64) -> DVec3) -> Vec<Vec3> {
    let mut points: Vec<DVec3> = curve.iter().map(|cv| to_f64(*cv)).collect();
    let total = length(curve);
    for k in 0..curve.len() - 1 {
        let arc = length(&curve[..=k]);
        let pivot = points[k];
        let (from, to) = (points[curve.len() - 1] - pivot, wind(arc));
        let normal = from.cross(&to);
        let sine = normal.norm();
        let angle = libm::atan2(sine, from.dot(&to)) * share(k, (arc / total) as f32);
        for point in &mut points[k + 1..] {
            *point = pivot + rotated(*point - pivot, normal / sine, angle);
        }
    }
    points.into_iter().map(to_f32).collect()
}

#[test]
fn one_accumulated_quaternion_equals_moving_all_later_points_at_every_pivot() {
    let ramp = Ramp::new(vec![[0.0, 0.2], [0.6, 1.0], [1.0, 0.7]], Interpolation::Linear).unwrap();
    let field = Field::new(NoiseKind::Perlin, 2, 0.5, 5);
    let groom = tangled(300, 40);
    let envelope: Vec<f32> = (0..groom.points.len() as u64).map(|cv| Key::new(4).of(cv).f32()).collect();
    let wind = [0.48, -0.6, 0.64];
    let noise = BendNoise {
        field: &field,
        amplitude: 0.7.into(),
        frequency: 3.0,
        waviness: 0.8.into(),
        origin: [100.0, 7.0, -3.0],
        other: None,
        roots: None,
    };
    for noise in [None, Some(noise)] {
        let with = Bend { wind, envelope: Some(&envelope), noise, ..plain(&ramp) };
        let bent = groom.bend(&with);
        assert_kept(&groom, &bent);
        for ends in groom.starts.windows(2) {
            let (start, end) = (ends[0] as usize, ends[1] as usize);
            let curve = &groom.points[start..end];
            let share = |k, u| f64::from(0.5 * ramp.eval(u) * envelope[start + k]);
            let wind_at = |arc: f64| {
                let wind = to_f64(wind);
                let Some(noise) = &with.noise else { return wind };
                let displacement = wind * (arc * f64::from(noise.waviness.value));
                let at = (to_f64(curve[0]) + DVec3::from(noise.origin) + displacement) * noise.frequency;
                wind + to_f64(vector::scale(field.at(at.into()), noise.amplitude.value))
            };
            let expected = paper(curve, share, wind_at);
            let error = farthest(&bent.points[start..end], &expected);
            assert!(error < 1e-5 * length(curve).max(0.1), "{} CVs: {error}", curve.len());
        }
    }
}

#[test]
fn every_path_and_number_of_threads_gives_the_same_bits() {
    let ramp = Ramp::new(vec![[0.0, 0.2], [1.0, 1.0]], Interpolation::Smooth).unwrap();
    let groom = tangled(3000, 17);
    let mask: Vec<f32> = (0..groom.points.len() as u64).map(|cv| Key::new(8).of(cv).f32()).collect();
    for kind in [NoiseKind::Perlin, NoiseKind::Billow, NoiseKind::Wavelet] {
        for mode in [BendMode::Paper, BendMode::ResolutionFree { reference_segments: 5.0 }] {
            let field = Field::new(kind, 2, 0.5, 5);
            let with = Bend {
                wind: [0.0, -1.0, 0.0],
                rotate: Masked { value: 0.5, mask: Some(&mask) },
                blend: Masked { value: 1.0, mask: Some(&mask) },
                mode,
                noise: Some(BendNoise {
                    field: &field,
                    amplitude: 0.7.into(),
                    frequency: 3.0,
                    waviness: 0.8.into(),
                    origin: [1e6, 0.0, 0.0],
                    other: None,
                    roots: None,
                }),
                ..plain(&ramp)
            };
            let expected = bend_on(Path::BASELINE, &groom.starts, &groom.points, &with);
            for path in Path::all() {
                for threads in [1, 2, 7] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    let found = pool.install(|| bend_on(path, &groom.starts, &groom.points, &with));
                    assert_eq!(bits(&found.points), bits(&expected.points), "{} × {threads}", path.name());
                    assert_eq!(found, expected);
                }
            }
        }
    }
}

#[test]
fn a_curve_s_bits_do_not_depend_on_other_curves() {
    let ramp = one();
    let groom = tangled(100, 30);
    let all = groom.bend(&plain(&ramp)).points;
    for ends in groom.starts.windows(2) {
        let range = ends[0] as usize..ends[1] as usize;
        let alone = Groom::of(&[groom.points[range.clone()].to_vec()]).bend(&plain(&ramp)).points;
        assert_eq!(bits(&alone), bits(&all[range]));
    }
}
