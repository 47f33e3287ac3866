//! Interpolation between two samples, in the order of operations and the precision of USD, so that the bits are the same.

use super::half::nearest;
use super::layer::{Array, Value};

fn float(a: f32, b: f32, share: f64) -> f32 {
    ((1.0 - share) * f64::from(a) + share * f64::from(b)) as f32
}

fn row<const N: usize>(a: [f32; N], b: [f32; N], share: f64) -> [f32; N] {
    // Each part is rounded before they are added.
    let part = |x: f32, factor: f64| (f64::from(x) * factor) as f32;
    std::array::from_fn(|k| part(a[k], 1.0 - share) + part(b[k], share))
}

/// As [`row`], of halves: USD rounds each product and each sum to a half.
fn half_row<const N: usize>(a: [f32; N], b: [f32; N], share: f64) -> [f32; N] {
    let part = |x: f32, factor: f64| nearest(x * factor as f32);
    std::array::from_fn(|k| nearest(part(a[k], 1.0 - share) + part(b[k], share)))
}

fn double(a: f64, b: f64, share: f64) -> f64 {
    (1.0 - share) * a + share * b
}

/// Along the shorter arc between two unit quaternions.
fn quaternion(a: [f64; 4], b: [f64; 4], share: f64) -> [f64; 4] {
    let cosine = a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b);
    let (sign, cosine) = if cosine < 0.0 { (-1.0, -cosine) } else { (1.0, cosine) };
    let factors = if 1.0 - cosine > 1e-5 {
        let angle = libm::acos(cosine);
        let sine = libm::sin(angle);
        [libm::sin((1.0 - share) * angle) / sine, libm::sin(share * angle) / sine]
    } else {
        [1.0 - share, share]
    };
    std::array::from_fn(|k| factors[0] * a[k] + sign * factors[1] * b[k])
}

/// Numbers and quaternions are interpolated, everything else is held.
pub(super) fn values(lower: Value, upper: &Value, share: f64) -> Value {
    match (lower, upper) {
        (Value::Double(a), Value::Double(b)) => Value::Double(double(a, *b, share)),
        (Value::Numbers(a), Value::Numbers(b)) if a.len() == b.len() => {
            Value::Numbers(a.iter().zip(b).map(|(a, b)| double(*a, *b, share)).collect())
        }
        (Value::Quaternion(a), Value::Quaternion(b)) => Value::Quaternion(quaternion(a, *b, share)),
        (lower, _) => lower,
    }
}

/// Arrays of one type and length are interpolated, in the precision of halves if they are; all others are held.
pub(super) fn arrays(mut lower: Array, upper: &Array, share: f64, are_halves: bool) -> Array {
    if lower.len() != upper.len() {
        return lower;
    }
    fn rows<const N: usize>(a: &mut [[f32; N]], b: &[[f32; N]], share: f64, are_halves: bool) {
        let between = if are_halves { half_row } else { row };
        a.iter_mut().zip(b).for_each(|(a, b)| *a = between(*a, *b, share));
    }
    match (&mut lower, upper) {
        (Array::F1(a), Array::F1(b)) => {
            let rounded = |x: f32| if are_halves { nearest(x) } else { x };
            a.iter_mut().zip(b).for_each(|(a, b)| *a = rounded(float(*a, *b, share)));
        }
        (Array::F2(a), Array::F2(b)) => rows(a, b, share, are_halves),
        (Array::F3(a), Array::F3(b)) => rows(a, b, share, are_halves),
        (Array::F4(a), Array::F4(b)) => rows(a, b, share, are_halves),
        (Array::Doubles(a, width), Array::Doubles(b, other)) if width == other => {
            a.iter_mut().zip(b).for_each(|(a, b)| *a = double(*a, *b, share));
        }
        (Array::Quaternions(a), Array::Quaternions(b)) => {
            for (a, b) in a.iter_mut().zip(b) {
                *a = quaternion(a.map(f64::from), b.map(f64::from), share).map(|x| x as f32);
            }
        }
        _ => {}
    }
    lower
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_lerped_and_turns_go_the_shorter_way() {
        let found = values(Value::Numbers(vec![0.0, 2.0]), &Value::Numbers(vec![1.0, 4.0]), 0.25);
        assert_eq!(found, Value::Numbers(vec![0.25, 2.5]));
        let quarter = std::f64::consts::FRAC_1_SQRT_2;
        let half_way = quaternion([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -quarter, -quarter], 0.5);
        let eighth = [libm::sin(std::f64::consts::PI / 8.0), libm::cos(std::f64::consts::PI / 8.0)];
        assert!((half_way[2] - eighth[0]).abs() < 1e-15 && (half_way[3] - eighth[1]).abs() < 1e-15);
    }

    #[test]
    fn arrays_of_other_lengths_or_types_are_held() {
        let one = || Array::F1(vec![0.0, 1.0]);
        assert_eq!(arrays(one(), &Array::F1(vec![1.0, 2.0]), 0.5, false), Array::F1(vec![0.5, 1.5]));
        assert_eq!(arrays(one(), &Array::F1(vec![1.0]), 0.5, false), one());
        assert_eq!(arrays(one(), &Array::Doubles(vec![1.0, 2.0], 1), 0.5, false), one());
    }

    #[test]
    fn halves_are_rounded_as_usd_rounds_them() {
        // 1 + 2⁻¹⁰ is the half after 1. A quarter of the way to it rounds to 1; of a vector each product is rounded.
        let next = 1.0 + 1.0_f32 / 1024.0;
        let scalar = arrays(Array::F1(vec![1.0]), &Array::F1(vec![next]), 0.25, true);
        assert_eq!(scalar, Array::F1(vec![1.0]));
        let pair = arrays(Array::F2(vec![[-3.0, 1.0]]), &Array::F2(vec![[1.0, next]]), 0.75, true);
        assert_eq!(pair, Array::F2(vec![[0.0, next]]));
    }
}
