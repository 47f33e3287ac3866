//! Operations on vectors and linear colours that are not in `numerics::vector`.

use numerics::vector::{Vec3, add, largest, length, scale};

/// `a` scaled to length 1; `None` if it has no direction or no finite length.
pub(crate) fn unit(a: Vec3) -> Option<Vec3> {
    // Divided by the largest coordinate first, so that squares neither vanish nor overflow.
    let largest = largest(a);
    let near_one = a.map(|x| x / largest);
    // NaN if a coordinate is not finite, or all are 0.
    let length = length(near_one);
    (length > 0.0).then(|| near_one.map(|x| x / length))
}

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
    fn zero_and_nan_have_no_direction() {
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([f32::NAN, 1.0, 0.0]), None);
        assert_eq!(unit([1.0, f32::INFINITY, 0.0]), None);
    }
}
