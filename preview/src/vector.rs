//! Operations on vectors and linear colours that are not in `numerics::vector`.

use numerics::vector::{Vec3, add, scale};

/// From `a` at 0 to `b` at 1.
pub(crate) fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    add(scale(a, 1.0 - t), scale(b, t))
}

/// Product of each coordinate: light on a colour.
pub(crate) fn times(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

pub(crate) fn finite(a: Vec3) -> bool {
    a.iter().all(|x| x.is_finite())
}
