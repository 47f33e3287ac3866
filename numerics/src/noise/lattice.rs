//! The cell of a point on the integer lattice, and random bits of lattice points.
//!
//! An f64 coordinate is split into an integer cell and an f32 fraction, so noise is as smooth 1,000 km from the origin as
//! near it. Limits: cells wrap after 2³²; a coordinate beyond
//! ±2⁵⁰ counts as ±2⁵⁰, and a NaN likewise.

use crate::lanes::LANES;
use crate::random::mix32;

/// A point on the lattice: its cell, and its fraction of the cell along each axis, 0..1.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub(super) cell: [u32; 3],
    pub(super) share: [f32; 3],
}

impl Point {
    /// The point at `coordinates`, counted in cells.
    #[inline(always)]
    pub(super) fn at(coordinates: [f64; 3]) -> Self {
        let [(i, x), (j, y), (k, z)] = coordinates.map(split);
        Self { cell: [i, j, k], share: [x, y, z] }
    }
}

impl Point {
    /// The point at `coordinates` within ±2²² cells, by f32 alone.
    #[inline(always)]
    pub(super) fn near(coordinates: [f32; 3]) -> Self {
        // As in `split`: the sum is rounded to an integer, which then stands in its low bits.
        const ROUND: f32 = 12_582_912.0;
        let split = |x: f32| {
            let rounded = x + ROUND;
            let nearest = rounded - ROUND;
            let above = nearest > x;
            let cell = rounded.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_sub(u32::from(above));
            (cell, x - nearest + if above { 1.0 } else { 0.0 })
        };
        let [(i, x), (j, y), (k, z)] = coordinates.map(split);
        Self { cell: [i, j, k], share: [x, y, z] }
    }
}

/// Sixteen [`Point`]s, an axis an array.
pub(super) struct Points {
    cell: [[u32; LANES]; 3],
    share: [[f32; LANES]; 3],
}

impl Points {
    /// The points at `scale` times `coordinates`.
    #[inline(always)]
    pub(super) fn at(coordinates: &[[f64; LANES]; 3], scale: f64) -> Self {
        let mut out = Self { cell: [[0; LANES]; 3], share: [[0.0; LANES]; 3] };
        for axis in 0..3 {
            for lane in 0..LANES {
                (out.cell[axis][lane], out.share[axis][lane]) = split(coordinates[axis][lane] * scale);
            }
        }
        out
    }

    /// The point of one lane.
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> Point {
        let [i, j, k] = &self.cell;
        let [x, y, z] = &self.share;
        Point { cell: [i[lane], j[lane], k[lane]], share: [x[lane], y[lane], z[lane]] }
    }
}

/// The cell of `x` and the fraction in it: 0..1, where 1 occurs only by rounding to f32.
#[inline(always)]
fn split(x: f64) -> (u32, f32) {
    const FARTHEST: f64 = (1u64 << 50) as f64;
    // Adding 1.5·2⁵² rounds to an integer, which then stands in the sum's low bits: `floor` is a
    // function call where vectors have no instruction for it.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let x = if x < FARTHEST { x } else { FARTHEST };
    let x = if x > -FARTHEST { x } else { -FARTHEST };
    let rounded = x + ROUND;
    let nearest = rounded - ROUND;
    let above = nearest > x;
    let cell = (rounded.to_bits() as u32).wrapping_sub(u32::from(above));
    let share = x - nearest + if above { 1.0 } else { 0.0 };
    (cell, share as f32)
}

/// Random bits of a cell's index along one axis; those of three axes, xored, go to [`point_bits`].
#[inline(always)]
pub(super) fn axis_bits(cell: u32, salt: u32) -> u32 {
    mix32(cell ^ salt)
}

/// 32 random bits of a lattice point. The axes' bits are well mixed, but with xor only the bits of the four points of a
/// square would cancel; one more product avoids that.
#[inline(always)]
pub(super) fn point_bits(axes: u32) -> u32 {
    let bits = (axes ^ (axes >> 16)).wrapping_mul(0x7feb_352d);
    bits ^ (bits >> 15)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_split_into_cell_and_fraction() {
        for (x, cell, share) in [
            (0.0, 0, 0.0),
            (0.25, 0, 0.25),
            (0.75, 0, 0.75),
            (2.5, 2, 0.5),
            (3.5, 3, 0.5),
            (-0.25, u32::MAX, 0.75),
            (-1.0, u32::MAX, 0.0),
            (-1.5, u32::MAX - 1, 0.5),
            (4_294_967_296.125, 0, 0.125),
            (1e9 + 0.625, 1_000_000_000, 0.625),
        ] {
            assert_eq!(split(x), (cell, share), "{x}");
        }
    }

    #[test]
    fn the_f32_split_agrees_with_f64() {
        for x in [0.0, 0.25, 0.75, 2.5, 3.5, -0.25, -1.0, -1.5, 4_000_000.5, -2_000_000.5] {
            let (near, at) = (Point::near([x, 0.5, -0.5]), Point::at([f64::from(x), 0.5, -0.5]));
            assert_eq!((near.cell, near.share), (at.cell, at.share), "{x}");
        }
    }

    #[test]
    fn extreme_coordinates_have_a_cell_and_a_fraction_too() {
        for x in [1e30, -1e30, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX, 1e15, -1e15] {
            assert!((0.0..=1.0).contains(&split(x).1), "{x}");
        }
    }
}
