//! Contacts worked by hand, then against all pairs, then bodies that rest and are rolled on.

use super::surface::Surface;
use super::*;
use numerics::random::Key;

mod bodies;
mod hand;
mod missed;

fn pose(share: f64, positions: &[[f64; 3]]) -> Pose {
    Pose { share, positions: positions.to_vec() }
}

fn find(scene: &Scene<'_>, from: &[[f64; 3]], to: &[[f64; 3]], times: [f64; 2]) -> (Vec<Contact>, Found) {
    let mut out = Vec::new();
    let found = scene.search(&Query { from, to, times }, &mut out);
    (out, found)
}

fn random(seed: u64, index: u64) -> V3 {
    let key = Key::new(seed).of(index);
    V3::new(key.of(0).f64() - 0.5, key.of(1).f64() - 0.5, key.of(2).f64() - 0.5)
}

/// A box about the origin with these sides, facing outwards.
fn cuboid(size: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corner = |bits: u32| [0, 1, 2].map(|axis| size[axis] * (f64::from(bits >> axis & 1) - 0.5));
    let mut triangles = Vec::new();
    for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    ((0..8).map(corner).collect(), triangles)
}

/// A cylinder along z with `around` sides, facing outwards.
fn cylinder(around: u32, radius: f64, length: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for k in 0..around {
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(around));
        points.extend([-0.5, 0.5].map(|end| [radius * cosine, radius * sine, end * length]));
    }
    points.extend([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]]);
    for k in 0..around {
        let (a, b) = (2 * k, 2 * ((k + 1) % around));
        triangles.extend([[a, b, b + 1], [a, b + 1, a + 1], [2 * around, b, a], [2 * around + 1, a + 1, b + 1]]);
    }
    (points, triangles)
}

#[test]
fn what_tests_are_made_of_is_closed_and_faces_outwards() {
    for (points, triangles) in [cuboid([1.0, 2.0, 3.0]), cylinder(12, 1.0, 2.0)] {
        let surface = Surface::new(points.len(), &triangles);
        assert!(surface.closed);
        let at = Moment::of(&points);
        for face in 0..triangles.len() as u32 {
            assert!(surface.normal(&at, face).unwrap().dot(&surface.corners(&at, face)[0]) > 0.0);
        }
    }
}
