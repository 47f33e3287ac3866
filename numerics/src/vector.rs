//! Three-vectors and rotations: one definition for each precision in the whole workspace.
//!
//! `f32`, for geometry and lanes: plain arrays and branch-free functions, for one value or inside a loop over lanes; a
//! quaternion is `[x, y, z, w]`, with w the cosine. `f64`, where precision matters: nalgebra's types under short names,
//! whose `dot`, `cross` and `norm` sum in the order of the axes; [`rotation`] is here because nalgebra's uses the
//! platform's sine. Right-handed.
//!
//! Limit: squares may overflow or vanish. In `f32` lengths between 1e-18 and 1e18 are safe; scale others by
//! [`power_of_two_to_one`] first, which is exact. [`direction`] is safe for any length.

use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector2, Vector3};

/// x, y, z in `f64`: metres unless said otherwise.
pub type DVec3 = Vector3<f64>;

/// Two numbers that are summed together, in `f64`.
pub type DVec2 = Vector2<f64>;

/// Rows and columns in `f64`.
pub type DMat3 = Matrix3<f64>;

/// A rotation in `f64`.
pub type DQuat = UnitQuaternion<f64>;

/// `v` in `f64`, exactly.
#[inline(always)]
pub fn to_f64(v: Vec3) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}

/// `v` rounded to `f32`.
#[inline(always)]
pub fn to_f32(v: DVec3) -> Vec3 {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// The unit vector along `v`, for any length; `None` where it is zero or not finite.
pub fn direction(v: DVec3) -> Option<DVec3> {
    let near_one = v / v.amax();
    // NaN where a component is not finite, or all are 0.
    let length = near_one.norm();
    (length > 0.0).then(|| near_one / length)
}

/// The rotation by `radians` about `axis`, a unit vector; the same bits on any platform.
pub fn rotation(axis: DVec3, radians: f64) -> DQuat {
    let (sine, cosine) = libm::sincos(0.5 * radians);
    Unit::new_unchecked(Quaternion::from_parts(cosine, axis * sine))
}

/// The rotation of the unit quaternion x, y, z, w.
pub fn unit_quaternion(q: [f64; 4]) -> DQuat {
    Unit::new_unchecked(Quaternion::from(q))
}

/// x, y, z.
pub type Vec3 = [f32; 3];

/// x, y, z, w with x² + y² + z² + w² = 1.
pub type Quat = [f32; 4];

/// The identity rotation.
pub const IDENTITY: Quat = [0.0, 0.0, 0.0, 1.0];

/// a + b.
#[inline(always)]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[inline(always)]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a · s.
#[inline(always)]
pub fn scale(a: Vec3, s: f32) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + t·(b − a).
#[inline(always)]
pub fn lerp(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

/// The scalar product.
#[inline(always)]
pub fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
#[inline(always)]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The length.
#[inline(always)]
pub fn length(a: Vec3) -> f32 {
    dot(a, a).sqrt()
}

/// The unit vector along `a`, for any length; `None` where it is zero or not finite.
pub fn unit(a: Vec3) -> Option<Vec3> {
    let largest = largest(a);
    let near_one = a.map(|x| x / largest);
    let length = length(near_one);
    (length > 0.0).then(|| near_one.map(|x| x / length))
}

/// The largest magnitude of a component.
#[inline(always)]
pub fn largest(a: Vec3) -> f32 {
    let [x, y, z] = [a[0].abs(), a[1].abs(), a[2].abs()];
    let xy = if x > y { x } else { y };
    if xy > z { xy } else { z }
}

/// Whether no coordinate is NaN or infinite.
#[inline(always)]
pub fn are_finite(points: &[Vec3]) -> bool {
    // Without a branch between them, which the compiler would not vectorise.
    points.as_flattened().iter().fold(true, |finite, x| finite & x.is_finite())
}

/// The power of two that scales a `magnitude` ≥ 0 to 1…2 (denormals to less than 1, magnitudes above 2¹²⁶ to at most 4),
/// and its inverse, both exact.
#[inline(always)]
pub fn power_of_two_to_one(magnitude: f32) -> (f32, f32) {
    let exponent = magnitude.to_bits() >> 23;
    let exponent = if exponent < 1 { 1 } else { exponent };
    let exponent = if exponent > 253 { 253 } else { exponent };
    (f32::from_bits((254 - exponent) << 23), f32::from_bits(exponent << 23))
}

/// The rotation `b` followed by `a`, renormalised to first order: over any number of compositions the length stays 1 up to
/// rounding.
#[inline(always)]
pub fn compose(a: Quat, b: Quat) -> Quat {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    let x = aw * bx + bw * ax + (ay * bz - az * by);
    let y = aw * by + bw * ay + (az * bx - ax * bz);
    let z = aw * bz + bw * az + (ax * by - ay * bx);
    let w = aw * bw - (ax * bx + ay * by + az * bz);
    let unit = 1.5 - 0.5 * (x * x + y * y + z * z + w * w);
    [x * unit, y * unit, z * unit, w * unit]
}

/// The rotated vector less `v`: exactly 0 for the identity.
#[inline(always)]
pub fn moved(q: Quat, v: Vec3) -> Vec3 {
    let axis = [q[0], q[1], q[2]];
    let once = cross(axis, v);
    let once = add(once, once);
    add(scale(once, q[3]), cross(axis, once))
}

/// `v` rotated by `q`.
#[inline(always)]
pub fn turned(q: Quat, v: Vec3) -> Vec3 {
    add(v, moved(q, v))
}

/// A unit vector perpendicular to `v` (not zero), near the world axis that `v` is least along.
pub fn perpendicular(v: Vec3) -> Vec3 {
    let v = scale(v, power_of_two_to_one(largest(v)).0);
    let [x, y, z] = v.map(f32::abs);
    let away = if x <= y && x <= z {
        [1.0, 0.0, 0.0]
    } else if y <= z {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    };
    let side = cross(v, cross(away, v));
    scale(side, 1.0 / length(side))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z_brings_x_to_y() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let quarter = [0.0, 0.0, half, half];
        let [x, y, z] = turned(quarter, [1.0, 0.0, 0.0]);
        assert!(x.abs() < 1e-7 && (y - 1.0).abs() < 1e-7 && z == 0.0);
        let [x, y, _] = turned(compose(quarter, quarter), [1.0, 0.0, 0.0]);
        assert!((x + 1.0).abs() < 5e-7 && y.abs() < 5e-7);
    }

    #[test]
    fn first_b_then_a() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let (about_x, about_z) = ([half, 0.0, 0.0, half], [0.0, 0.0, half, half]);
        // About x: y → z. Then about z: z stays.
        let [x, y, z] = turned(compose(about_z, about_x), [0.0, 1.0, 0.0]);
        assert!(x.abs() < 2e-7 && y.abs() < 2e-7 && (z - 1.0).abs() < 2e-7);
        assert_eq!(moved(IDENTITY, [0.3, -0.7, 1e20]), [0.0; 3]);
    }

    #[test]
    fn a_million_compositions_keep_the_length() {
        let step = crate::trig::sin_cos(0.3);
        let turn = [0.6 * step.0, 0.0, 0.8 * step.0, step.1];
        let mut q = IDENTITY;
        for _ in 0..1_000_000 {
            q = compose(turn, q);
        }
        let squares: f32 = q.iter().map(|x| x * x).sum();
        assert!((squares - 1.0).abs() < 5e-7, "{squares}");
    }

    #[test]
    fn powers_of_two_are_exact_inverses_at_any_magnitude() {
        for magnitude in [0.0, f32::from_bits(1), 1e-38, 1e-30, 0.7, 1.0, 3.0, 1e30, f32::MAX] {
            let (to, from) = power_of_two_to_one(magnitude);
            assert_eq!(to * from, 1.0);
            let brought = magnitude * to;
            assert!(brought < 4.1 && (brought >= 1.0 || magnitude < 1.2e-38), "{magnitude}");
        }
    }

    #[test]
    fn perpendicular_is_a_unit_vector_at_a_right_angle() {
        for v in [[1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [1e-30, 1e-30, 1e-30], [3e30, -1e30, 2e30]] {
            let side = perpendicular(v);
            let along = dot(side, scale(v, power_of_two_to_one(largest(v)).0));
            assert!((length(side) - 1.0).abs() < 1e-6 && along.abs() < 1e-6, "{v:?} {side:?}");
        }
    }

    #[test]
    fn unit_works_at_any_length_but_zero() {
        for size in [1e-30, 1.0, 1e30] {
            let [x, y, z] = unit([3.0 * size, 0.0, -4.0 * size]).unwrap();
            assert!((x - 0.6).abs() < 1e-6 && y == 0.0 && (z + 0.8).abs() < 1e-6, "{size}");
        }
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([f32::NAN, 1.0, 0.0]), None);
        assert_eq!(unit([1.0, f32::INFINITY, 0.0]), None);
    }

    #[test]
    fn direction_works_at_any_length_but_zero() {
        for size in [1e-300, 1.0, 1e300] {
            let along = direction(DVec3::new(3.0 * size, 0.0, -4.0 * size)).unwrap();
            assert!((along - DVec3::new(0.6, 0.0, -0.8)).norm() < 1e-15, "{size} {along}");
        }
        assert_eq!(direction(DVec3::zeros()), None);
        assert_eq!(direction(DVec3::new(f64::INFINITY, 1.0, 0.0)), None);
        assert_eq!(direction(DVec3::new(1.0, f64::NAN, 0.0)), None);
    }

    #[test]
    fn a_third_of_a_turn_about_the_diagonal_brings_x_to_y() {
        let diagonal = direction(DVec3::new(1.0, 1.0, 1.0)).unwrap();
        let turned = rotation(diagonal, std::f64::consts::TAU / 3.0) * DVec3::x();
        assert!((turned - DVec3::y()).norm() < 1e-15, "{turned}");
        assert_eq!(to_f32(to_f64([0.1, -2.0, 3e-40])), [0.1, -2.0, 3e-40]);
    }
}
