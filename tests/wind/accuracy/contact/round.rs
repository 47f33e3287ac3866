//! Flat and round shapes: first contact in closed form.

use super::*;
use numerics::shapes::icosphere;

/// A floor: the tip is at h + A·cos(φ − ψ), A and ψ those of u and v along y.
pub(super) fn floor() -> Case {
    let points = vec![[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]];
    let first = |turn: &Turn| {
        let height = turn.pivot[1];
        let (reach, at) = (libm::hypot(turn.u[1], turn.v[1]), libm::atan2(turn.v[1], turn.u[1]));
        let share = height / reach;
        Some(match () {
            () if height + turn.u[1] < 0.01 => return None,
            () if share > 1.001 => First::Never,
            () if share > 0.999 => First::Grazes,
            () => First::At([at + libm::acos(-share); 2]),
        })
    };
    let pivot = |key: Key| DVec3::new(0.3, 0.02 + 0.9 * key.of(1).f64(), -0.2);
    Case { points, triangles: vec![[0, 1, 2], [0, 2, 3]], turns: turns(4000, 1, pivot, first) }
}

/// The angle at which a segment of length 1 first meets a circle of radius `r` about `centre`, in the plane of the
/// turn: with its side or with its tip. None if it does not; NaN if that is uncertain.
fn meets_circle(centre: [f64; 2], r: f64) -> Option<f64> {
    let (away, at) = (libm::hypot(centre[0], centre[1]), libm::atan2(centre[1], centre[0]));
    let short = away - r - 1.0;
    if short.abs() < 0.02 {
        return Some(f64::NAN);
    }
    if short > 0.0 {
        return None;
    }
    let aside = match away * away - r * r <= 1.0 {
        true => libm::asin(r / away),
        false => libm::acos((away * away + 1.0 - r * r) / (2.0 * away)),
    };
    // Blocked between at − aside and at + aside.
    let start = (at - aside).rem_euclid(TAU);
    Some(if start > TAU - 2.0 * aside - 0.02 || start < 0.02 { f64::NAN } else { start })
}

/// A sphere: the plane of the turn cuts it in a circle.
pub(super) fn sphere() -> Case {
    let mesh = icosphere(1.0, 7);
    let triangles = mesh.triangles();
    let face_centre = |corners: &[u32; 3]| {
        let third = |corner: &u32| DVec3::from(mesh.points[*corner as usize]) * (1.0 / 3.0);
        corners.iter().fold(DVec3::zeros(), |sum, corner| sum + third(corner)).norm()
    };
    // No point of a face is nearer to the centre than the face's own centre.
    let inner = triangles.iter().map(face_centre).fold(1.0, f64::min) - 1e-6;
    let first = |turn: &Turn| {
        let centre = [-turn.pivot.dot(&turn.u), -turn.pivot.dot(&turn.v)];
        let square = |r: f64| r * r - turn.pivot.dot(&turn.pivot) + centre[0] * centre[0] + centre[1] * centre[1];
        Some(match square(1.0) {
            outside if outside < -0.02 => First::Never,
            near if near < 0.2 => First::Grazes,
            _ => match [1.0, inner].map(|r| meets_circle(centre, square(r).sqrt())) {
                [Some(low), Some(high)] if low.is_finite() && high.is_finite() => First::At([low, high]),
                [None, None] => First::Never,
                _ => First::Grazes,
            },
        })
    };
    let pivot = |key: Key| random_unit(key) * (1.15 + 0.8 * key.of(5).f64());
    let points = mesh.points.iter().map(|point| to_f32((*point).into())).collect();
    Case { points, triangles, turns: turns(3000, 2, pivot, first) }
}

/// A cylinder of radius ¼ about z, touched by the segment's side: its line touches it where (p × d)² = r²·d² across z,
/// a quadratic form in the sine and cosine of φ.
pub(super) fn cylinder() -> Case {
    const RADIUS: f64 = 0.25;
    const SIDES: u32 = 2048;
    let ring = |k: u32, z: f64| {
        let (s, c) = libm::sincos(TAU * f64::from(k) / f64::from(SIDES));
        to_f32(DVec3::new(RADIUS * c, RADIUS * s, z))
    };
    let points = (0..SIDES).flat_map(|k| [ring(k, -3.0), ring(k, 3.0)]).collect();
    let side = |k: u32| {
        let (a, b) = (2 * k, 2 * ((k + 1) % SIDES));
        [[a, b, b + 1], [a, b + 1, a + 1]]
    };
    let touches = |turn: &Turn, r: f64| -> Option<f64> {
        let [p, u, v] = [turn.pivot, turn.u, turn.v].map(|x| [x[0], x[1]]);
        let turned = |d: [f64; 2]| p[0] * d[1] - p[1] * d[0];
        let flat = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let (a, e) = (turned(u) * turned(u) - r * r * flat(u, u), turned(v) * turned(v) - r * r * flat(v, v));
        let b = 2.0 * (turned(u) * turned(v) - r * r * flat(u, v));
        // (a + e)/2 + (a − e)/2 · cos 2φ + b/2 · sin 2φ = 0.
        let (size, at) = (libm::hypot(a - e, b), libm::atan2(b, a - e));
        let share = -(a + e) / size;
        if share.abs() > 0.98 {
            return Some(f64::NAN);
        }
        let roots = [1.0, -1.0].into_iter().flat_map(|sign| {
            let root = 0.5 * (at + sign * libm::acos(share));
            [root.rem_euclid(TAU), (root + PI).rem_euclid(TAU)]
        });
        // The roots are those of the infinite line: those behind the pivot do not count, and beyond the tip this test
        // does not apply.
        let ahead = roots.filter_map(|root| {
            let d = turn.direction(root);
            let distance = -flat(p, [d[0], d[1]]) / flat([d[0], d[1]], [d[0], d[1]]);
            (distance > 0.0).then_some((root, distance))
        });
        let (root, distance) = ahead.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(if distance < 0.95 { root } else { f64::NAN })
    };
    let first = |turn: &Turn| {
        let (p, d) = (turn.pivot, turn.u);
        let size = d[0] * d[0] + d[1] * d[1];
        let ahead = -(p[0] * d[0] + p[1] * d[1]) > 0.0;
        if ahead && (p[0] * d[1] - p[1] * d[0]).abs() < (RADIUS + 0.02) * size.sqrt() {
            return None;
        }
        match [RADIUS, RADIUS * libm::cos(PI / f64::from(SIDES))].map(|r| touches(turn, r)) {
            [Some(low), Some(high)] if low.is_finite() && high.is_finite() => Some(First::At([low, high])),
            [None, None] => Some(First::Never),
            _ => None,
        }
    };
    let pivot = |key: Key| {
        let (s, c) = libm::sincos(TAU * key.of(1).f64());
        let away = 0.3 + 0.3 * key.of(2).f64();
        DVec3::new(away * c, away * s, key.of(3).f64() - 0.5)
    };
    let triangles = (0..SIDES).flat_map(side).collect();
    Case { points, triangles, turns: turns(6000, 3, pivot, first) }
}
