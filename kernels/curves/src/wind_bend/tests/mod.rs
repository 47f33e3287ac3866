//! Shared by the tests of bending: curves, a plain bend, and measurements of results.

mod extremes;
mod laws;
mod reference;

use super::*;
use numerics::ramp::Interpolation;
use numerics::random::Key;
use numerics::vector::{self, DVec3, Vec3, to_f64};

/// Curves, with their CVs in one list.
struct Groom {
    starts: Vec<u32>,
    points: Vec<Vec3>,
}

impl Groom {
    fn of(curves: &[Vec<Vec3>]) -> Self {
        let mut starts = vec![0];
        for curve in curves {
            starts.push(starts[starts.len() - 1] + curve.len() as u32);
        }
        Self { starts, points: curves.concat() }
    }

    fn bend(&self, with: &Bend<'_>) -> Bent {
        bend(&self.starts, &self.points, with)
    }

    /// The groom with all CVs mapped.
    fn map(&self, change: impl Fn(Vec3) -> Vec3) -> Self {
        Self { starts: self.starts.clone(), points: self.points.iter().map(|cv| change(*cv)).collect() }
    }
}

/// A straight curve from `root` along `direction`, whose length is the curve's.
fn straight(root: Vec3, direction: Vec3, segments: usize) -> Vec<Vec3> {
    let cv = |k| vector::add(root, vector::scale(direction, k as f32 / segments as f32));
    (0..=segments).map(cv).collect()
}

/// Curves of 1…`most` CVs about 1 m long with random bends, up to 3 m from the origin.
fn tangled(curves: u64, most: u64) -> Groom {
    let curve = |i: u64| {
        let key = Key::new(11).of(i);
        let cvs = 1 + key.of(0).u64() % most;
        let mut at = [1, 2, 3].map(|axis| key.of(axis).between([-3.0, 3.0]));
        let mut direction = [0.3, 1.0, -0.2];
        (0..cvs)
            .map(|cv| {
                let before = at;
                let turn = [0, 1, 2].map(|axis| key.of(4).of(cv).of(axis).between([-0.5, 0.5]));
                direction = vector::add(direction, turn);
                at = vector::add(at, vector::scale(direction, 1.0 / cvs as f32));
                before
            })
            .collect()
    };
    Groom::of(&(0..curves).map(curve).collect::<Vec<_>>())
}

/// Half of the angle at every pivot, wind along x, nothing else.
fn plain(ramp: &Ramp) -> Bend<'_> {
    Bend {
        wind: [1.0, 0.0, 0.0],
        rotate: 0.5.into(),
        envelope: None,
        ramp,
        mode: BendMode::Paper,
        blend: 1.0.into(),
        noise: None,
        gusts: None,
    }
}

fn one() -> Ramp {
    Ramp::constant(1.0)
}

fn bits(points: &[Vec3]) -> Vec<[u32; 3]> {
    points.iter().map(|point| point.map(f32::to_bits)).collect()
}

/// Angles of the segments of one curve to `direction`, from their f64 differences.
fn angles(points: &[Vec3], direction: [f64; 3]) -> Vec<f64> {
    let direction = DVec3::from(direction);
    let angle = |pair: &[Vec3]| {
        let segment = to_f64(pair[1]) - to_f64(pair[0]);
        libm::atan2(segment.cross(&direction).norm(), segment.dot(&direction))
    };
    points.windows(2).map(angle).collect()
}

fn distance(a: Vec3, b: Vec3) -> f64 {
    (to_f64(a) - to_f64(b)).norm()
}

fn farthest(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max)
}

fn length(points: &[Vec3]) -> f64 {
    points.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

/// Spacing of f32 numbers of this size.
fn ulp(largest: f32) -> f64 {
    f64::from(f32::from_bits(largest.to_bits() + 1)) - f64::from(largest)
}

/// Roots keep their bits, all is finite, and segments and curves keep their lengths within 1e-5 of the curve's and 4
/// ulp of the positions.
fn assert_kept(groom: &Groom, bent: &Bent) {
    assert!(bent.max_angle.is_finite() && bent.length_error.is_finite());
    for ends in groom.starts.windows(2) {
        let curve = ends[0] as usize..ends[1] as usize;
        let (before, after) = (&groom.points[curve.clone()], &bent.points[curve]);
        let largest = before.iter().chain(after).map(|cv| vector::largest(*cv)).fold(0.0, f32::max);
        assert!(largest.is_finite() && after.iter().flatten().all(|x| x.is_finite()));
        let tolerance = 1e-5 * length(before) + 4.0 * ulp(largest);
        for (before, after) in before.windows(2).zip(after.windows(2)) {
            let change = distance(before[0], before[1]) - distance(after[0], after[1]);
            assert!(change.abs() <= tolerance, "a segment changed by {change}");
        }
        assert_eq!(bits(&before[..before.len().min(1)]), bits(&after[..after.len().min(1)]));
    }
}
