//! Gradient noise (Perlin 2002): 0 at every lattice point, C² across cells by the quintic fade.
//!
//! Gradients are the 12 edge directions of a cube, chosen by hashing the lattice point: without a table, so the only period
//! is that of cells, 2³². Three components use different bits of one hash.

use super::lattice::{Point, axis_bits, point_bits};
use crate::vector::lerp;

/// Three decorrelated components, each within ±1.04, of mean 0 and rms 0.27.
#[inline(always)]
pub(super) fn noise(point: Point, salt: u32) -> [f32; 3] {
    // Rotated bits of `salt` distinguish equal indices along different axes.
    let sides = |axis: usize| {
        let salt = salt.rotate_left(11 * axis as u32);
        [axis_bits(point.cell[axis], salt), axis_bits(point.cell[axis].wrapping_add(1), salt)]
    };
    let [x, y, z] = point.share;
    let cell = Cell { sides: [sides(0), sides(1), sides(2)], share: point.share, weights: [fade(x), fade(y), fade(z)] };
    lerp(cell.face(0), cell.face(1), cell.weights[2])
}

/// A cell of the lattice around a point: bits of its two sides along each axis, the point's fraction along each, faded too.
struct Cell {
    sides: [[u32; 2]; 3],
    share: [f32; 3],
    weights: [f32; 3],
}

// Not closures: one that is called in several places is a function of its own, compiled for the baseline.
impl Cell {
    #[inline(always)]
    fn face(&self, k: usize) -> [f32; 3] {
        lerp(self.edge(0, k), self.edge(1, k), self.weights[1])
    }

    #[inline(always)]
    fn edge(&self, j: usize, k: usize) -> [f32; 3] {
        lerp(self.corner(0, j, k), self.corner(1, j, k), self.weights[0])
    }

    #[inline(always)]
    fn corner(&self, i: usize, j: usize, k: usize) -> [f32; 3] {
        let ([hx, hy, hz], [x, y, z]) = (self.sides, self.share);
        let bits = point_bits(hx[i] ^ hy[j] ^ hz[k]);
        slopes(bits, [x - i as f32, y - j as f32, z - k as f32])
    }
}

/// 6t⁵ − 15t⁴ + 10t³: slope and curvature are 0 at both ends.
#[inline(always)]
fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// The ramps of a lattice point's three gradients at `d` from it: ten bits of `bits` each.
#[inline(always)]
fn slopes(bits: u32, d: [f32; 3]) -> [f32; 3] {
    [slope(bits, d), slope(bits >> 10, d), slope(bits >> 20, d)]
}

/// `d` along one of the 12 edges of a cube: eight bits choose the edge's plane, two its signs.
#[inline(always)]
fn slope(bits: u32, [x, y, z]: [f32; 3]) -> f32 {
    const THIRD: u32 = 86;
    let plane = bits & 0xff;
    let a = if plane < 2 * THIRD { x } else { y };
    let b = if plane < THIRD { y } else { z };
    let sign = |value: f32, shift: u32| f32::from_bits(value.to_bits() ^ ((bits << shift) & (1 << 31)));
    sign(a, 23) + sign(b, 22)
}
