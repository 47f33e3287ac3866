//! Gusts and shelter: the envelope of the wind.

use curves::shield::{Collider, Shield, shield};
use engine::geometry::ENVELOPE;
use numerics::random::Key;
use numerics::shapes;

use super::Figure;
use crate::cooked::cook;

/// The largest error of the envelope of one CV that a gust passes. The gust starts 3 m upwind at frame 12 and moves at
/// 2 m/s, so its centre arrives at frame 48, and a radius of 1 m takes 12 frames; in between the envelope is 1 − t²(3 −
/// 2t) (W5: "1 at its centre, 0 at its boundary", and the default falloff).
fn gust_error() -> f64 {
    let nodes = r#"
        "cv": { "type": "Curve_In", "params": { "points": [[5, 0, 0]], "counts": [1] } },
        "gust": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "cv" }, "params": {
            "num_gusts": 1, "radius_range": [1, 1], "radius_noise_range": [0, 0], "speed_range": [2, 2],
            "start_frame_range": [12, 12], "life_range": [1000, 1000], "distance": 3 } }"#;
    let frames = cook(nodes, &["gust"], 96).remove(0);
    let error = |(frame, geometry): (usize, &engine::geometry::Geometry)| {
        let t = ((frame as f64 - 47.0).abs() / 12.0).min(1.0);
        (f64::from(geometry.curves().unwrap().get(ENVELOPE).unwrap()[0]) - (1.0 - t * t * (3.0 - 2.0 * t))).abs()
    };
    frames.iter().enumerate().map(error).fold(0.0, f64::max)
}

/// Number of CVs and frames with an envelope outside 0…1 while 300 gusts pass, and of all.
fn over_full() -> [usize; 2] {
    let nodes = r#"
        "fur": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]] } },
        "gusts": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "fur" },
                   "params": { "num_gusts": 300, "start_frame_range": [-20, 20], "base": 0.1 } }"#;
    let frames = cook(nodes, &["gusts"], 24).remove(0);
    let values: Vec<f32> =
        frames.iter().flat_map(|frame| frame.curves().unwrap().get(ENVELOPE).unwrap().to_vec()).collect();
    assert!(values.contains(&1.0) && values.iter().any(|x| *x < 0.5), "gusts come and go");
    [values.iter().filter(|x| !(0.0..=1.0).contains(*x)).count(), values.len()]
}

type Point = [f32; 3];

/// A sphere of radius 1, within 3e-4 of it.
fn sphere() -> (Vec<Point>, Vec<[u32; 3]>) {
    let mesh = shapes::sphere([2.0; 3], 64);
    (mesh.points.iter().map(|point| point.map(|x| x as f32)).collect(), mesh.triangles())
}

fn strewn(count: u64, half: f32) -> Vec<Point> {
    (0..count).map(|i| [0, 1, 2].map(|axis| Key::new(1).of(i).of(axis).between([-half, half]))).collect()
}

/// Number of wrong rays, among those clearly away from the silhouette.
///
/// A ray upwind along x from p meets the unit sphere where y² + z² < 1, at x ∓ √(1 − y² − z²).
fn wrong_rays((mesh, triangles): &(Vec<Point>, Vec<[u32; 3]>)) -> [usize; 2] {
    let points = strewn(2000, 2.5);
    let starts: Vec<u32> = (0..=points.len() as u32).collect();
    let (mut wrong, mut sure) = (0, 0);
    for offset in [0.2, 1.0, 3.0, 10.0, 100.0, 1e4] {
        let how = Shield {
            wind: [1.0, 0.0, 0.0],
            offset: offset.into(),
            distance: 0.0,
            falloff: 1.0,
            cone: 0.0,
            skin_gap: 0.0,
        };
        let found = shield(&starts, &points, &[Collider::of(mesh, triangles)], &how);
        for (point, found) in points.iter().zip(found) {
            let [x, y, z] = point.map(f64::from);
            let inside = 1.0 - y * y - z * z;
            let half = inside.max(0.0).sqrt();
            let distances = [x + half, x - half];
            let unsure =
                |distance: f64| distance.abs().min((distance - f64::from(offset)).abs()) < 2e-3 / half.max(1e-2);
            if inside.abs() < 2e-3 || distances.into_iter().any(unsure) {
                continue;
            }
            let met =
                inside > 0.0 && distances.iter().any(|distance| *distance > 0.0 && *distance <= f64::from(offset));
            sure += 1;
            wrong += usize::from(found != f32::from(u8::from(met)));
        }
    }
    [wrong, sure]
}

/// Number of curves of 7 CVs whose `shielded` is not a multiple of 1/7, and of those whose `shielded` changes if scene
/// and wind are mirrored.
fn odd_curves((mesh, triangles): &(Vec<Point>, Vec<[u32; 3]>)) -> [usize; 3] {
    let points = strewn(3500, 1.5);
    let starts: Vec<u32> = (0..=500).map(|curve| 7 * curve).collect();
    let mirrored = |points: &[Point]| points.iter().map(|[x, y, z]| [-x, *y, *z]).collect::<Vec<Point>>();
    let how =
        Shield { wind: [1.0, 0.2, -0.1], offset: 10.0.into(), distance: 0.0, falloff: 1.0, cone: 0.0, skin_gap: 0.0 };
    let back = Shield { wind: [-1.0, 0.2, -0.1], ..how };
    let shares = shield(&starts, &points, &[Collider::of(mesh, triangles)], &how);
    let others = shield(&starts, &mirrored(&points), &[Collider::of(&mirrored(mesh), triangles)], &back);
    let broken = shares.iter().filter(|share| (0..=7).all(|hits| **share != (f64::from(hits) / 7.0) as f32)).count();
    [broken, shares.iter().zip(&others).filter(|(a, b)| a != b).count(), shares.len()]
}

pub(super) fn figures() -> Vec<Figure> {
    let sphere = sphere();
    let ([over, values], [wrong, rays]) = (over_full(), wrong_rays(&sphere));
    let [broken, turned, curves] = odd_curves(&sphere);
    vec![
        Figure::error(
            "Curve_Wind_Gusts: envelope of a CV that a gust passes, 1 at its centre, 0 from its boundary on",
            gust_error(),
            1e-5,
            "",
        ),
        Figure::never("300 overlapping gusts: envelopes outside 0…1", over, values),
        Figure::never(
            "Curve_Wind_Shielding: wrong rays away from the silhouette of a sphere, offsets 0.2 to 1e4 m",
            wrong,
            rays,
        ),
        Figure::never(
            "values of `shielded` that are not a whole number of CVs ÷ the curve's number of CVs",
            broken,
            curves,
        ),
        Figure::never("values of `shielded` that change if scene and wind are mirrored", turned, curves),
    ]
}
