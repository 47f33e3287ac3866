//! Vectors of three numbers as plain arrays: f32 where light is worked out, f64 where the camera is placed.
//!
//! Promise: plain multiply and add in a fixed order, so the same bits on every CPU. Limit: no operation checks for
//! overflow; callers drop what is not finite.

use std::ops::{Add, Div, Mul, Sub};

/// A position, direction or linear colour.
pub(crate) type V3 = [f32; 3];

/// What a coordinate can do.
pub(crate) trait Real:
    Copy + PartialOrd + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Nothing.
    const ZERO: Self;
    /// Correctly rounded on every CPU.
    fn root(self) -> Self;
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    fn root(self) -> Self {
        self.sqrt()
    }
}

pub(crate) fn add<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn sub<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale<T: Real>(a: [T; 3], s: T) -> [T; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

pub(crate) fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn length<T: Real>(a: [T; 3]) -> T {
    dot(a, a).root()
}

/// `a` at length 1; `None` where it has no direction or no finite length.
pub(crate) fn unit<T: Real>(a: [T; 3]) -> Option<[T; 3]> {
    // By the greatest coordinate first, so that squares neither vanish nor overflow.
    let size = |x: T| if x < T::ZERO { T::ZERO - x } else { x };
    let greatest = a.iter().fold(T::ZERO, |most, x| if size(*x) > most { size(*x) } else { most });
    let near_one = a.map(|x| x / greatest);
    // NaN where a coordinate is not finite, or all are 0.
    let length = length(near_one);
    (length > T::ZERO).then(|| near_one.map(|x| x / length))
}

pub(crate) fn mix(a: V3, b: V3, t: f32) -> V3 {
    add(scale(a, 1.0 - t), scale(b, t))
}

/// Product of each coordinate: light on a colour.
pub(crate) fn times(a: V3, b: V3) -> V3 {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

pub(crate) fn finite(a: V3) -> bool {
    a.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_has_length_one_at_any_scale() {
        for scale in [1e-30_f32, 1.0, 1e30] {
            let [x, y, z] = unit([3.0 * scale, 0.0, -4.0 * scale]).unwrap();
            assert!((x - 0.6).abs() < 1e-6 && y == 0.0 && (z + 0.8).abs() < 1e-6);
        }
    }

    #[test]
    fn nothing_and_nan_have_no_direction() {
        assert_eq!(unit([0.0_f32; 3]), None);
        assert_eq!(unit([f32::NAN, 1.0, 0.0]), None);
        assert_eq!(unit([f64::INFINITY, 1.0, 0.0]), None);
    }
}
