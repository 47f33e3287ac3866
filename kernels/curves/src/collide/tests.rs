//! First contact against a second closed form; written positions against a second crossing test.

use super::sector::Sector;
use super::*;
use numerics::random::Key;
use numerics::vector::{self, to_f64};

mod coherent;
mod freed;
mod hairs;
pub(super) mod kept;
mod raised;
mod sectors;
mod thick;

/// Whether the segment crosses the triangle, by solving for its point in the plane. Touching does not count.
fn crosses(a: &DVec3, b: &DVec3, [p, q, r]: &[DVec3; 3]) -> bool {
    let (e, f, along) = (q - p, r - p, b - a);
    let h = along.cross(&f);
    let det = e.dot(&h);
    if det == 0.0 {
        return false;
    }
    let s = a - p;
    let u = s.dot(&h) / det;
    let g = s.cross(&e);
    let v = along.dot(&g) / det;
    let t = f.dot(&g) / det;
    u > 0.0 && v > 0.0 && u + v < 1.0 && t > 0.0 && t < 1.0
}

/// A number in −1…1.
fn coordinate(key: Key) -> f64 {
    2.0 * f64::from(key.f32()) - 1.0
}

fn random_vector(key: Key) -> DVec3 {
    DVec3::new(coordinate(key.of(0)), coordinate(key.of(1)), coordinate(key.of(2)))
}

fn random_unit(key: Key) -> DVec3 {
    let v = random_vector(key);
    if v.norm() > 0.1 { v.normalize() } else { random_unit(key.of(9)) }
}
