//! `rand` and `noise` of expressions: functions of numbers and of the scene's seed.
//!
//! Promise: pure functions of seed and arguments. Limit: `rand` depends on every bit of its arguments, so `rand(x)` of
//! an animated `x` flickers; use it with an index.

use numerics::noise::noise3;
use numerics::random::Key;

/// A random number in [0, 1), determined by a pair of numbers.
pub(super) fn rand(seed: f64, a: f64, b: f64) -> f64 {
    Key::new(bits(seed)).of(bits(a)).of(bits(b)).f64()
}

/// Gradient noise, about −1…1 with mean 0; NaN if a coordinate is not finite.
pub(super) fn noise(seed: f64, at: [f64; 3]) -> f64 {
    if !at.iter().all(|x| x.is_finite()) {
        return f64::NAN;
    }
    f64::from(noise3(Key::new(bits(seed)).u32(), at))
}

/// The bits of a number; 0 and −0 have the same.
fn bits(a: f64) -> u64 {
    (a + 0.0).to_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_of_zero_does_not_matter() {
        assert_eq!(rand(1.0, 0.0, 0.0), rand(1.0, -0.0, -0.0));
    }

    #[test]
    fn seed_and_both_arguments_matter() {
        let numbers = [rand(1.0, 2.0, 3.0), rand(2.0, 2.0, 3.0), rand(1.0, 3.0, 2.0), rand(1.0, 2.0, 0.0)];
        for (k, x) in numbers.iter().enumerate() {
            assert!((0.0..1.0).contains(x));
            assert!(!numbers[..k].contains(x));
        }
    }

    #[test]
    fn noise_depends_on_position_and_seed_and_is_bounded() {
        let mut largest = 0.0f64;
        for k in 0..1000 {
            let at = [0.37 * f64::from(k), 0.21 * f64::from(k), 0.5];
            largest = largest.max(noise(7.0, at).abs());
        }
        assert!((0.2..1.5).contains(&largest), "{largest}");
        assert_ne!(noise(7.0, [0.3, 0.4, 0.5]), noise(8.0, [0.3, 0.4, 0.5]));
        assert_eq!(noise(7.0, [3.0, -1.0, 1e6]), 0.0);
        assert!(noise(7.0, [f64::INFINITY, 0.0, 0.0]).is_nan());
    }
}
