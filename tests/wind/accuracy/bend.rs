//! Straight curves in a wind without noise.

use curves::wind_bend::{Bend, BendMode, bend};
use numerics::ramp::Ramp;
use numerics::vector::to_f64;

use super::{Figure, storage};

type Point = [f32; 3];

const RESOLUTION_FREE: BendMode = BendMode::ResolutionFree { reference_segments: 4.0 };

/// A straight curve of length 1 at an angle of `theta` to x, bent by wind along x.
fn bent(root: Point, theta: f64, segments: usize, g: f32, mode: BendMode) -> Vec<Point> {
    let along = [libm::cos(theta), 0.6 * libm::sin(theta), 0.8 * libm::sin(theta)];
    let cv = |k: usize| std::array::from_fn(|d| root[d] + (along[d] * k as f64 / segments as f64) as f32);
    let points: Vec<Point> = (0..=segments).map(cv).collect();
    let ramp = Ramp::constant(1.0);
    let with = Bend {
        wind: [1.0, 0.0, 0.0],
        rotate: g.into(),
        envelope: None,
        ramp: &ramp,
        mode,
        blend: 1.0.into(),
        noise: None,
        gusts: None,
    };
    bend(&[0, segments as u32 + 1], &points, &with).points
}

fn angle_to_x(ends: &[Point]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| f64::from(ends[1][k]) - f64::from(ends[0][k]));
    libm::atan2((y * y + z * z).sqrt(), x)
}

/// Errors of segments' angles, each with the rotation that rounding of stored positions may cause; `law` gives the
/// remaining fraction of the angle from the segment's number and the u of its middle.
fn angle_errors(root: Point, segments: usize, mode: BendMode, law: impl Fn(f64, usize, f64) -> f64) -> Vec<[f64; 2]> {
    let mut errors = Vec::new();
    for theta in [1e-3, 0.3, 1.2, 1.5, 2.7, 3.1] {
        for g in [0.05_f32, 0.3, 0.5, 0.9] {
            let points = bent(root, theta, segments, g, mode);
            let storage = storage(&points) * segments as f64;
            errors.extend(points.windows(2).enumerate().map(|(k, ends)| {
                let left = law(1.0 - f64::from(g), k, (k as f64 + 0.5) / segments as f64);
                [(angle_to_x(ends) - theta * left).abs(), storage]
            }));
        }
    }
    errors
}

/// Distance of the tip from that of the finest curve, of length 1.
fn tip_error(segments: usize, g: f32) -> f64 {
    let tip = |segments| *bent([0.0; 3], 2.0, segments, g, RESOLUTION_FREE).last().unwrap();
    let (tip, finest) = (tip(segments), tip(1024));
    (to_f64(tip) - to_f64(finest)).norm()
}

pub(super) fn figures() -> Vec<Figure> {
    let counts = [2, 4, 8, 32, 128];
    // W2: every pivot turns the rest of a straight curve by g times the remaining angle.
    let paper = |root: Point| {
        (1..=8).flat_map(move |n| angle_errors(root, n, BendMode::Paper, |left, k, _| libm::pow(left, k as f64 + 1.0)))
    };
    let free = |root: Point| {
        counts
            .into_iter()
            .flat_map(move |n| angle_errors(root, n, RESOLUTION_FREE, |left, _, u| libm::pow(left, 4.0 * u)))
    };
    let far = [900.0, -7.0, 400.0];
    let shares = [0.3, 0.5, 0.7];
    let orders = shares.map(|g| {
        let order = |pair: &[usize]| {
            let finer = pair[1] as f64 / pair[0] as f64;
            libm::log(tip_error(pair[0], g) / tip_error(pair[1], g)) / libm::log(finer)
        };
        counts.windows(2).map(order).collect::<Vec<_>>()
    });
    let at_9_cvs = shares.map(|g| tip_error(8, g)).into_iter().fold(0.0, f64::max);
    vec![
        Figure::stored(
            "Curve_Wind: angle θ₀(1−g)^k of segment k of a straight curve, 1 to 8 segments",
            paper([0.0; 3]),
            2e-6,
            " rad",
        ),
        Figure::stored("the same a kilometre from the origin", paper(far), 2e-6, " rad"),
        Figure::stored(
            "`resolution_free`: angle θ₀(1−g)^(u·n) in the middle of every segment, 3 to 129 CVs",
            free([0.0; 3]),
            2e-6,
            " rad",
        ),
        Figure::stored("the same a kilometre from the origin", free(far), 2e-6, " rad"),
        Figure::within("order of convergence of its tip, 3 to 129 CVs", &orders.concat(), [1.7, 2.3]),
        Figure::error("error of its tip at 9 CVs", at_9_cvs, 1e-2, " L"),
    ]
}
