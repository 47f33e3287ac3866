//! Vectors of three `f32` and unit quaternions, as plain arrays and branch-free functions, for one
//! value or inside a loop over lanes. Right-handed; a quaternion is `[x, y, z, w]`, w its cosine.
//!
//! Limit: squares are taken as they come. Lengths between 1e-18 and 1e18 are safe; a caller with
//! others brings them there by [`power_of_two_to_one`] first, which changes no digit.

/// x, y, z.
pub type Vec3 = [f32; 3];

/// x, y, z, w with x² + y² + z² + w² = 1.
pub type Quat = [f32; 4];

/// No turn.
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

/// The largest magnitude of a component.
#[inline(always)]
pub fn largest(a: Vec3) -> f32 {
    let [x, y, z] = [a[0].abs(), a[1].abs(), a[2].abs()];
    let xy = if x > y { x } else { y };
    if xy > z { xy } else { z }
}

/// The power of two that brings a `magnitude` ≥ 0 to 1…2 (a denormal one below 1, one above 2¹²⁶ to
/// at most 4), and its inverse, both exact.
#[inline(always)]
pub fn power_of_two_to_one(magnitude: f32) -> (f32, f32) {
    let exponent = magnitude.to_bits() >> 23;
    let exponent = if exponent < 1 { 1 } else { exponent };
    let exponent = if exponent > 253 { 253 } else { exponent };
    (f32::from_bits((254 - exponent) << 23), f32::from_bits(exponent << 23))
}

/// First `b`, then `a`, brought back to length 1 to first order: over any number of turns the length
/// stays within rounding of 1 if it began there.
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

/// How far the turn `q` moves the end of `v`: the turned vector less `v`, exactly 0 for no turn.
#[inline(always)]
pub fn moved(q: Quat, v: Vec3) -> Vec3 {
    let axis = [q[0], q[1], q[2]];
    let once = cross(axis, v);
    let once = add(once, once);
    add(scale(once, q[3]), cross(axis, once))
}

/// `v` turned by `q`.
#[inline(always)]
pub fn turned(q: Quat, v: Vec3) -> Vec3 {
    add(v, moved(q, v))
}

/// A unit vector perpendicular to `v` (not zero), towards the world axis that `v` is least along.
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
    fn a_million_turns_keep_the_length() {
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
}
