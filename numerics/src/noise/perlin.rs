//! Gradient noise (Perlin 2002): 0 at every lattice point, C² across cells by the quintic fade.
//!
//! Gradients are the 12 edge directions of a cube, chosen by hashing the lattice point: without a table, so the only period
//! is that of cells, 2³². Three components use different bits of one hash.

use super::lattice::{Point, axis_bits, point_bits};
use crate::vector::lerp;

/// Three decorrelated components, each within ±1.04, of mean 0 and rms 0.27.
#[inline(always)]
pub(super) fn noise(point: Point, salt: u32) -> [f32; 3] {
    let [x, y, z] = point.share;
    // Rotated bits of `salt` distinguish equal indices along different axes.
    let sides = |axis: usize| {
        let salt = salt.rotate_left(11 * axis as u32);
        [axis_bits(point.cell[axis], salt), axis_bits(point.cell[axis].wrapping_add(1), salt)]
    };
    let (hx, hy, hz) = (sides(0), sides(1), sides(2));
    let (u, v, w) = (fade(x), fade(y), fade(z));
    let corner = |i: usize, j: usize, k: usize| {
        let bits = point_bits(hx[i] ^ hy[j] ^ hz[k]);
        slopes(bits, [x - i as f32, y - j as f32, z - k as f32])
    };
    let edge = |j: usize, k: usize| lerp(corner(0, j, k), corner(1, j, k), u);
    let face = |k: usize| lerp(edge(0, k), edge(1, k), v);
    lerp(face(0), face(1), w)
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
