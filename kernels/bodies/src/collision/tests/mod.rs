//! Contacts worked out by hand, then compared with brute force, then bodies at rest and under a rolling pin.

use super::*;
use numerics::random::Key;
use numerics::shapes;

mod bodies;
mod caught;
mod hand;
mod overlap;
mod soft;
mod tunnelling;

fn pose(share: f64, positions: &[[f64; 3]]) -> ObstaclePose {
    ObstaclePose { share, positions: positions.to_vec() }
}

fn find(scene: &CollisionScene<'_>, from: &[[f64; 3]], to: &[[f64; 3]], times: [f64; 2]) -> Vec<Contact> {
    let mut out = Vec::new();
    scene.find(&ContactQuery { from, to, times }, &mut out);
    out
}

fn random(seed: u64, index: u64) -> DVec3 {
    let key = Key::new(seed).of(index);
    DVec3::new(key.of(0).f64() - 0.5, key.of(1).f64() - 0.5, key.of(2).f64() - 0.5)
}

/// A box centred on the origin, facing outwards.
fn cuboid(size: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let shape = shapes::block(size, [1; 3]);
    (shape.points.clone(), shape.triangles())
}

/// A cylinder along z with `n` sides a quadrant, facing outwards.
fn cylinder(n: usize, radius: f64, length: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let shape = shapes::cylinder([2.0 * radius, length, 2.0 * radius], n);
    (shape.points.iter().map(|[x, y, z]| [*x, -z, *y]).collect(), shape.triangles())
}
