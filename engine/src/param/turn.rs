//! Rotations of params: degrees about x, then y, then z; between keys they rotate about a single axis.

use numerics::vector::{DQuat, DVec3, rotation, unit_quaternion};

use super::value::Value;

/// The unit quaternion of a rotation by `degrees` about x, then y, then z.
pub fn euler_to_turn(degrees: [f64; 3]) -> Value {
    Value::Turn(quaternion(degrees).coords.into())
}

/// Interpolates between two keyed rotations at `share`: about a fixed axis, at constant speed, along the shorter arc.
/// If the keys differ in only one of x, y, z, the angle itself is interpolated, so keys 0 and 720 make two full turns.
pub(super) fn between(from: [f64; 3], to: [f64; 3], share: f64) -> Value {
    let changed = (0..3).filter(|k| from[*k].to_bits() != to[*k].to_bits()).count();
    if changed <= 1 {
        return euler_to_turn(std::array::from_fn(|k| from[k] + (to[k] - from[k]) * share));
    }
    Value::Turn(slerp(quaternion(from), quaternion(to), share).coords.into())
}

fn quaternion(degrees: [f64; 3]) -> DQuat {
    // Whole turns are removed first, which is exact, so large angles are as precise as small ones.
    let [x, y, z] = degrees.map(|angle| (angle % 720.0) * (std::f64::consts::PI / 180.0));
    rotation(DVec3::z(), z) * (rotation(DVec3::y(), y) * rotation(DVec3::x(), x))
}

/// From `a` at 0 to `b` at 1. Not nalgebra's, which loses digits where the two nearly agree.
fn slerp(a: DQuat, b: DQuat, share: f64) -> DQuat {
    let (a, b) = (a.coords, b.coords);
    let b = if a.component_mul(&b).sum() < 0.0 { -b } else { b };
    // The angle from the chord keeps its digits.
    let chord = b - a;
    let angle = 2.0 * libm::asin((0.5 * chord.component_mul(&chord).sum().sqrt()).min(1.0));
    let (p, q) = if angle < 1e-9 {
        (1.0 - share, share)
    } else {
        let sine = libm::sin(angle);
        (libm::sin((1.0 - share) * angle) / sine, libm::sin(share * angle) / sine)
    };
    let mixed = a * p + b * q;
    unit_quaternion((mixed / mixed.component_mul(&mixed).sum().sqrt()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(value: Value, v: [f64; 3]) -> DVec3 {
        let Value::Turn(q) = value else { panic!("not a rotation") };
        unit_quaternion(q) * DVec3::from(v)
    }

    fn close(a: DVec3, b: [f64; 3]) -> bool {
        (a - DVec3::from(b)).norm() < 1e-12
    }

    #[test]
    fn turns_about_x_then_y_then_z() {
        // y → z about x; z → x about y.
        assert!(close(turned(euler_to_turn([90.0, 90.0, 0.0]), [0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]));
        assert!(close(turned(euler_to_turn([0.0, 0.0, 90.0]), [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]));
    }

    #[test]
    fn whole_turns_between_keys_are_made() {
        let quarter = between([0.0; 3], [0.0, 360.0, 0.0], 0.25);
        assert!(close(turned(quarter, [1.0, 0.0, 0.0]), [0.0, 0.0, -1.0]));
    }

    #[test]
    fn halfway_between_two_keys_lies_on_the_one_axis_that_joins_them() {
        // From no turn to 120° about (1,1,1): x → y → z → x. Halfway is 60° about the same axis, and (1,1,1) stays.
        let half = between([0.0; 3], [90.0, 0.0, 90.0], 0.5);
        let Value::Turn(q) = half else { panic!() };
        assert!((q[3] - libm::cos(std::f64::consts::PI / 6.0)).abs() < 1e-12);
    }
}
