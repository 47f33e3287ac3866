//! Sixteen numbers side by side: the data of one step of a kernel, one element a lane.
//!
//! A kernel is written as scalar, branch-free functions, and as loops over [`LANES`] that call
//! them; inside a function of [`crate::simd`] the compiler vectorises such a loop to the path's width. So one value and
//! sixteen are computed by the same code, and their bits are the same.

use crate::vector::DVec3;

/// Elements handled side by side, on every path.
pub const LANES: usize = 16;

/// Sixteen `f32`, aligned as the widest vector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct F32x16(pub [f32; LANES]);

impl F32x16 {
    /// The same value on every lane.
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The value that `of` gives for each lane.
    #[inline(always)]
    pub fn from_fn(of: impl Fn(usize) -> f32) -> Self {
        let mut out = Self::splat(0.0);
        for lane in 0..LANES {
            out.0[lane] = of(lane);
        }
        out
    }

    /// The lesser of each lane; `other`'s where one is NaN.
    #[inline(always)]
    pub fn least(&self, other: &Self) -> Self {
        let mut out = *other;
        for lane in 0..LANES {
            out.0[lane] = if self.0[lane] < other.0[lane] { self.0[lane] } else { other.0[lane] };
        }
        out
    }

    /// The larger of each lane; `other`'s where one is NaN.
    #[inline(always)]
    pub fn most(&self, other: &Self) -> Self {
        let mut out = *other;
        for lane in 0..LANES {
            out.0[lane] = if self.0[lane] > other.0[lane] { self.0[lane] } else { other.0[lane] };
        }
        out
    }
}

/// Sixteen `f64`, aligned as the widest vector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct F64x16(pub [f64; LANES]);

impl F64x16 {
    /// 0 on every lane.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// The value that `of` gives for each lane.
    #[inline(always)]
    pub fn from_fn(of: impl Fn(usize) -> f64) -> Self {
        let mut out = Self::ZERO;
        for lane in 0..LANES {
            out.0[lane] = of(lane);
        }
        out
    }
}

/// A vector or quaternion a lane, stored by component.
pub type Lanes<const N: usize> = [F32x16; N];

/// The vector of one lane.
#[inline(always)]
pub fn get<const N: usize>(lanes: &Lanes<N>, lane: usize) -> [f32; N] {
    let mut out = [0.0; N];
    for component in 0..N {
        out[component] = lanes[component].0[lane];
    }
    out
}

/// Replaces the vector of one lane.
#[inline(always)]
pub fn set<const N: usize>(lanes: &mut Lanes<N>, lane: usize, value: [f32; N]) {
    for component in 0..N {
        lanes[component].0[lane] = value[component];
    }
}

/// The vector of one lane.
#[inline(always)]
pub fn get_f64(lanes: &[F64x16; 3], lane: usize) -> DVec3 {
    DVec3::new(lanes[0].0[lane], lanes[1].0[lane], lanes[2].0[lane])
}

/// Replaces the vector of one lane.
#[inline(always)]
pub fn set_f64(lanes: &mut [F64x16; 3], lane: usize, value: DVec3) {
    for axis in 0..3 {
        lanes[axis].0[lane] = value[axis];
    }
}
