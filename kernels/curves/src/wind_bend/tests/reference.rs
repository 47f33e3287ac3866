//! The paper's own procedure in f64, every later point moved at every pivot; and equal bits whatever
//! runs the kernel.

use super::*;
use numerics::masked::Masked;
use numerics::noise::Kind;

type Vec64 = [f64; 3];

fn dot(a: Vec64, b: Vec64) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec64, b: Vec64) -> Vec64 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `v` turned by `angle` about the unit vector `axis` (Rodrigues).
fn turned(v: Vec64, axis: Vec64, angle: f64) -> Vec64 {
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let (side, along) = (cross(axis, v), dot(axis, v));
    std::array::from_fn(|i| v[i] * cosine + side[i] * sine + axis[i] * along * (1.0 - cosine))
}

/// One curve bent as the paper says; `heading` gives the wind at an arc length.
fn paper(curve: &[Vec3], share: impl Fn(usize, f32) -> f64, heading: impl Fn(f64) -> Vec64) -> Vec<Vec3> {
    let mut points: Vec<Vec64> = curve.iter().map(|cv| cv.map(f64::from)).collect();
    let total = length(curve);
    for k in 0..curve.len() - 1 {
        let arc = length(&curve[..=k]);
        let tip = points[curve.len() - 1];
        let from: Vec64 = std::array::from_fn(|i| tip[i] - points[k][i]);
        let to = heading(arc);
        let normal = cross(from, to);
        let sine = dot(normal, normal).sqrt();
        let angle = libm::atan2(sine, dot(from, to)) * share(k, (arc / total) as f32);
        let pivot = points[k];
        for point in &mut points[k + 1..] {
            let arm = std::array::from_fn(|i| point[i] - pivot[i]);
            let arm = turned(arm, normal.map(|x| x / sine), angle);
            *point = std::array::from_fn(|i| pivot[i] + arm[i]);
        }
    }
    points.iter().map(|cv| cv.map(|x| x as f32)).collect()
}

#[test]
fn one_quaternion_down_the_curve_is_moving_all_later_points_at_every_pivot() {
    let ramp = Ramp::new(vec![[0.0, 0.2], [0.6, 1.0], [1.0, 0.7]], Interpolation::Linear).unwrap();
    let field = Field::new(Kind::Perlin, 2, 0.5, 5);
    let groom = tangled(300, 40);
    let envelope: Vec<f32> = (0..groom.points.len() as u64).map(|cv| Key::new(4).of(cv).f32()).collect();
    let wind = [0.48, -0.6, 0.64];
    let noise = BendNoise {
        field: &field,
        amplitude: 0.7,
        frequency: 3.0,
        waviness: 0.8,
        origin: [100.0, 7.0, -3.0],
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
            let heading = |arc: f64| {
                let wind = wind.map(f64::from);
                let Some(noise) = &with.noise else { return wind };
                let root = curve[0].map(f64::from);
                let at = std::array::from_fn(|i| {
                    (root[i] + noise.origin[i] + wind[i] * arc * f64::from(noise.waviness)) * noise.frequency
                });
                let gust = field.at(at);
                std::array::from_fn(|i| wind[i] + f64::from(noise.amplitude * gust[i]))
            };
            let expected = paper(curve, share, heading);
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
    for kind in [Kind::Perlin, Kind::Billow, Kind::Wavelet] {
        for mode in [Mode::Paper, Mode::ResolutionFree { reference_segments: 5.0 }] {
            let field = Field::new(kind, 2, 0.5, 5);
            let with = Bend {
                wind: [0.0, -1.0, 0.0],
                rotate: Masked { value: 0.5, mask: Some(&mask) },
                blend: Masked { value: 1.0, mask: Some(&mask) },
                mode,
                noise: Some(BendNoise {
                    field: &field,
                    amplitude: 0.7,
                    frequency: 3.0,
                    waviness: 0.8,
                    origin: [1e6, 0.0, 0.0],
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
fn a_curve_alone_has_the_bits_it_has_among_others() {
    let ramp = one();
    let groom = tangled(100, 30);
    let all = groom.bend(&plain(&ramp)).points;
    for ends in groom.starts.windows(2) {
        let range = ends[0] as usize..ends[1] as usize;
        let alone = Groom::of(&[groom.points[range.clone()].to_vec()]).bend(&plain(&ramp)).points;
        assert_eq!(bits(&alone), bits(&all[range]));
    }
}
