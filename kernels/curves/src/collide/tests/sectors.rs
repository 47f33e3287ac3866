//! One sector and one triangle.

use super::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};

fn sector(u: DVec3, v: DVec3, reach: f64) -> Sector {
    Sector { pivot: DVec3::zeros(), u, v, n: u.cross(&v), reach, inner: 0.0, half: 0.0, capsule: None, back: 0.0 }
}

fn first(sector: &Sector, corners: &[DVec3; 3]) -> Option<f64> {
    let mut least = None;
    sector.blocked_by(corners, |blocked| {
        let angle = if blocked.lo <= 0.0 && blocked.hi >= 0.0 { 0.0 } else { blocked.lo };
        if angle >= 0.0 {
            least = Some(least.map_or(angle, |least: f64| least.min(angle)));
        }
    });
    least
}

/// First contact by its two kinds of event: the tip's circle meets the triangle's plane inside of it, or one of its
/// edges meets the sector's plane within reach. Angles 0…π.
fn first_by_events(sector: &Sector, corners: &[DVec3; 3]) -> Option<f64> {
    let mut angles = Vec::new();
    let [p, q, r] = corners;
    let normal = (q - p).cross(&(r - p));
    let inside = |x: &DVec3| {
        let side = |a: &DVec3, b: &DVec3| normal.dot(&(b - a).cross(&(x - a)));
        side(p, q) >= 0.0 && side(q, r) >= 0.0 && side(r, p) >= 0.0
    };
    // normal · (reach (u cos φ + v sin φ) − p) = 0.
    let (a, b) = (sector.reach * normal.dot(&sector.u), sector.reach * normal.dot(&sector.v));
    let share = normal.dot(p) / libm::hypot(a, b);
    if share.abs() <= 1.0 {
        let middle = libm::atan2(b, a);
        for angle in [middle - libm::acos(share), middle + libm::acos(share)] {
            let angle = angle.rem_euclid(2.0 * PI);
            let tip = (sector.u * libm::cos(angle) + sector.v * libm::sin(angle)) * sector.reach;
            if angle <= PI && inside(&tip) {
                angles.push(angle);
            }
        }
    }
    for (a, b) in [(p, q), (q, r), (r, p)] {
        let (above, below) = (sector.n.dot(a), sector.n.dot(b));
        if above * below < 0.0 {
            let x = a + (b - a) * (above / (above - below));
            let angle = libm::atan2(sector.v.dot(&x), sector.u.dot(&x));
            if x.norm() <= sector.reach && angle >= 0.0 {
                angles.push(angle);
            }
        }
    }
    // Anything it crosses at the start is met at once.
    if crosses(&DVec3::zeros(), &(sector.u * sector.reach), corners) {
        angles.push(0.0);
    }
    angles.into_iter().reduce(f64::min)
}

#[test]
fn a_level_segment_meets_a_floor_at_the_arcsine_of_its_height() {
    // Pivot half a length over the floor: sin φ = ½.
    let floor = [DVec3::new(-9.0, -0.5, -9.0), DVec3::new(-9.0, -0.5, 9.0), DVec3::new(20.0, -0.5, 0.0)];
    let down = sector(DVec3::x(), -DVec3::y(), 1.0);
    assert!((first(&down, &floor).unwrap() - FRAC_PI_6).abs() < 1e-12);
    assert_eq!(first(&sector(DVec3::x(), DVec3::y(), 1.0), &floor), Some(PI + FRAC_PI_6).filter(|angle| *angle <= PI));
    assert_eq!(first(&sector(DVec3::x(), -DVec3::y(), 0.4), &floor), None);
}

#[test]
fn a_needle_is_met_at_its_angle() {
    // An upright sliver at 30° from the start, at half the radius.
    let at = DVec3::new(0.5 * libm::cos(FRAC_PI_6), 0.5 * libm::sin(FRAC_PI_6), 0.0);
    let needle = [at + DVec3::new(0.0, 0.0, -1.0), at + DVec3::new(1e-7, 0.0, 1.0), at + DVec3::new(0.0, 1e-7, 1.0)];
    let found = first(&sector(DVec3::x(), DVec3::y(), 1.0), &needle).unwrap();
    assert!((found - FRAC_PI_6).abs() < 1e-6, "{found}");
}

#[test]
fn a_million_random_turns_meet_triangles_at_the_angle_of_the_first_event() {
    let (mut met, mut missed) = (0, 0);
    for k in 0..1_000_000 {
        let key = Key::new(11).of(k);
        let u = random_unit(key.of(0));
        let Some(v) = (random_unit(key.of(1)) - u * u.dot(&random_unit(key.of(1)))).try_normalize(0.01) else {
            continue;
        };
        let mut corners = [2, 3, 4].map(|corner| random_vector(key.of(corner)));
        match k % 4 {
            // A needle, and a blade, and one almost in the sector's plane.
            1 => corners[1] = corners[0] + random_vector(key.of(5)) * 1e-3,
            2 => corners[2] = corners[0] + (corners[1] - corners[0]) * 0.5 + random_vector(key.of(5)) * 1e-4,
            3 => {
                let n = u.cross(&v);
                corners = corners.map(|corner| corner - n * (n.dot(&corner) * 0.999));
            }
            _ => {}
        }
        let sector = sector(u, v, 0.9);
        // Beyond half a turn the two use different definitions.
        let found = first(&sector, &corners).filter(|angle| *angle < PI - 1e-9);
        let expected = first_by_events(&sector, &corners).filter(|angle| *angle < PI - 1e-9);
        match (found, expected) {
            (Some(a), Some(b)) => {
                met += 1;
                assert!((a - b).abs() < 1e-6, "{k}: {a} {b}");
            }
            (None, None) => missed += 1,
            _ => {
                // A grazing contact: a slightly larger or smaller reach decides.
                let with = |reach: f64| first(&Sector { reach, ..sector }, &corners);
                let (less, more) = (with(0.9 - 1e-6), with(0.9 + 1e-6));
                assert!(
                    less.is_none() != more.is_none() || found.or(expected).unwrap() < 1e-6,
                    "{k}: {found:?} {expected:?}"
                );
            }
        }
    }
    assert!(met > 100_000 && missed > 100_000, "{met} met, {missed} missed");
}

#[test]
fn a_thick_segment_is_stopped_beside_its_plane() {
    // The plane of the turn passes at a distance of 0.01 from a sheet that stands across it farther out.
    let beside = [DVec3::new(0.5, 0.5, 0.01), DVec3::new(0.6, 0.4, 0.5), DVec3::new(0.4, 0.6, 0.5)];
    let thin = sector(DVec3::x(), DVec3::y(), 1.0);
    assert_eq!(first(&thin, &beside), None);
    let thick = Sector { half: 0.02, ..thin };
    let found = first(&thick, &beside).unwrap();
    // At 45° and a radius of 0.707, less the angle of half its thickness there.
    assert!((found - (FRAC_PI_2 / 2.0 - 0.02 / 0.707)).abs() < 0.01, "{found}");
}
