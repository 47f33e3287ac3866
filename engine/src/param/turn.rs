//! Rotations of params: degrees about x, then y, then z; between keys they rotate about a single axis.

use super::value::Value;

/// The unit quaternion of a rotation by `degrees` about x, then y, then z.
pub fn euler_to_turn(degrees: [f64; 3]) -> Value {
    Value::Turn(quaternion(degrees))
}

/// Interpolates between two keyed rotations at `share`: about a fixed axis, at constant speed, along the shorter arc.
/// If the keys differ in only one of x, y, z, the angle itself is interpolated, so keys 0 and 720 make two full turns.
pub(super) fn between(from: [f64; 3], to: [f64; 3], share: f64) -> Value {
    let changed = (0..3).filter(|k| from[*k].to_bits() != to[*k].to_bits()).count();
    if changed <= 1 {
        return euler_to_turn(std::array::from_fn(|k| from[k] + (to[k] - from[k]) * share));
    }
    Value::Turn(slerp(quaternion(from), quaternion(to), share))
}

fn quaternion(degrees: [f64; 3]) -> [f64; 4] {
    let [x, y, z] = degrees.map(|angle| {
        // Whole turns are taken off first: exact, and a large angle loses nothing.
        let half = (angle % 720.0) * (std::f64::consts::PI / 360.0);
        (libm::sin(half), libm::cos(half))
    });
    let about_x = [x.0, 0.0, 0.0, x.1];
    let about_y = [0.0, y.0, 0.0, y.1];
    let about_z = [0.0, 0.0, z.0, z.1];
    product(about_z, product(about_y, about_x))
}

/// First `b`, then `a`.
fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

fn slerp(a: [f64; 4], b: [f64; 4], share: f64) -> [f64; 4] {
    let dot = |a: [f64; 4], b: [f64; 4]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    let b = if dot(a, b) < 0.0 { b.map(|x| -x) } else { b };
    // The angle from the chord keeps its digits where the two nearly agree.
    let chord: [f64; 4] = std::array::from_fn(|k| b[k] - a[k]);
    let angle = 2.0 * libm::asin((0.5 * dot(chord, chord).sqrt()).min(1.0));
    let (p, q) = if angle < 1e-9 {
        (1.0 - share, share)
    } else {
        let sine = libm::sin(angle);
        (libm::sin((1.0 - share) * angle) / sine, libm::sin(share * angle) / sine)
    };
    let mixed: [f64; 4] = std::array::from_fn(|k| p * a[k] + q * b[k]);
    let length = dot(mixed, mixed).sqrt();
    mixed.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(value: Value, v: [f64; 3]) -> [f64; 3] {
        let Value::Turn(q) = value else { panic!("not a rotation") };
        let conjugate = [-q[0], -q[1], -q[2], q[3]];
        let [x, y, z, _] = product(product(q, [v[0], v[1], v[2], 0.0]), conjugate);
        [x, y, z]
    }

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|k| (a[k] - b[k]).abs() < 1e-12)
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
