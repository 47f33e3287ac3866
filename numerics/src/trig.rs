//! Transcendental functions of `f32` of our own: the same bits on every CPU, for one value or sixteen.
//!
//! Every function is branch-free plain arithmetic, so that loops over lanes are vectorised. Within 2 ulp of the true value
//! everywhere; sine and cosine only for |x| ≤ 2²⁰, beyond which they stay in [−1, 1] but lose their phase. NaN gives NaN; sine and cosine of ±inf are NaN. Angles in radians.
//! Polynomials: minimax (Remez) of the reduced function's relative error, or Taylor where f64 holds
//! many more digits than f32 shows.

use crate::lanes::{F32x16, LANES};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::f64::consts::{LN_2, LOG2_E};

/// Adding 1.5·2⁵² rounds to an integer, which then stands in the sum's low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// (sin x, cos x).
#[inline(always)]
pub fn sin_cos(x: f32) -> (f32, f32) {
    let (r, quarters) = reduce(x);
    quadrant(r, quarters)
}

/// [`sin_cos`] on every lane. Two loops: the first's f64 would halve the lanes of the second.
#[inline(always)]
pub fn sin_cos_lanes(x: &F32x16) -> (F32x16, F32x16) {
    let [mut r, mut sine, mut cosine] = [F32x16::splat(0.0); 3];
    let mut quarters = [0; LANES];
    for lane in 0..LANES {
        (r.0[lane], quarters[lane]) = reduce(x.0[lane]);
    }
    for lane in 0..LANES {
        (sine.0[lane], cosine.0[lane]) = quadrant(r.0[lane], quarters[lane]);
    }
    (sine, cosine)
}

/// Sine.
#[inline(always)]
pub fn sin(x: f32) -> f32 {
    sin_cos(x).0
}

/// Cosine.
#[inline(always)]
pub fn cos(x: f32) -> f32 {
    sin_cos(x).1
}

/// `x` less its nearest multiple of π/2, and that multiple's low bits.
///
/// π/2 is held in 33 + 53 bits: `quarters · HIGH` is exact for |x| ≤ 2²⁰, so even beside a zero of
/// the sine the difference is good to f32.
#[inline(always)]
fn reduce(x: f32) -> (f32, u32) {
    const HIGH: f64 = f64::from_bits(0x3ff9_21fb_5440_0000);
    const LOW: f64 = f64::from_bits(0x3dd0_b461_1a62_6331);
    const FARTHEST: f64 = 1e15;
    let x = f64::from(x);
    let rounded = x * std::f64::consts::FRAC_2_PI + ROUND;
    let quarters = rounded - ROUND;
    let r = (x - quarters * HIGH) - quarters * LOW;
    // Far out the difference is noise; a NaN or an infinity stays one.
    let r = if x.abs() > FARTHEST { x * 0.0 } else { r };
    let r = if r > 1.0 { 1.0 } else { r };
    let r = if r < -1.0 { -1.0 } else { r };
    (r as f32, rounded.to_bits() as u32)
}

/// (sin, cos) of `r + quarters·π/2` for |r| ≤ 1.
#[inline(always)]
fn quadrant(r: f32, quarters: u32) -> (f32, f32) {
    let (sine, cosine) = small_sin_cos(r);
    let swap = quarters & 1 != 0;
    let (s, c) = (if swap { cosine } else { sine }, if swap { sine } else { cosine });
    // Sine is negative in quarters 2 and 3, cosine in 1 and 2.
    let sine_sign = (quarters & 2) << 30;
    let cosine_sign = (quarters.wrapping_add(1) & 2) << 30;
    (f32::from_bits(s.to_bits() ^ sine_sign), f32::from_bits(c.to_bits() ^ cosine_sign))
}

/// (sin r, cos r) for |r| ≤ π/4.
#[inline(always)]
fn small_sin_cos(r: f32) -> (f32, f32) {
    let z = r * r;
    let sine = ((-1.951_528_3e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z;
    let cosine = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z;
    (r + r * sine, 1.0 - (0.5 * z - cosine))
}

/// The angle of (x, y) from the x axis, −π..π; 0 (or ±π) where both are zero, as IEEE asks.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (down, left) = (y.is_sign_negative(), x.is_sign_negative());
    // Two infinities point along a diagonal; otherwise a pair below 2⁻¹⁰⁰ is lifted, for its sum and
    // its ratio to be normal numbers.
    let (y, x) = (y.abs(), x.abs());
    let both_infinite = y == f32::INFINITY && x == f32::INFINITY;
    let (y, x) = if both_infinite { (1.0, 1.0) } else { (y, x) };
    let largest = if y > x { y } else { x };
    let scale = if largest < f32::from_bits(27 << 23) { f32::from_bits(227 << 23) } else { 1.0 };
    let scale = if largest > f32::from_bits(227 << 23) { f32::from_bits(27 << 23) } else { scale };
    let (y, x) = (y * scale, x * scale);

    // atan q = a + atan((q − tan a) / (1 + q·tan a)) with a = 0, π/4 or π/2.
    // Ratios from ½ to 2 take the middle: there y − x is exact.
    let (flat, steep) = (y <= 0.5 * x, x < 0.5 * y);
    let (top, bottom) = if flat { (y, x) } else { (y - x, y + x) };
    let (top, bottom) = if steep { (-x, y) } else { (top, bottom) };
    let base = if flat { 0.0 } else { FRAC_PI_4 };
    let base = if steep { FRAC_PI_2 } else { base };
    let base_low = if flat { 0.0 } else { PI_LOW * 0.25 };
    let base_low = if steep { PI_LOW * 0.5 } else { base_low };

    let t = if bottom > 0.0 { top / bottom } else { bottom };
    let z = t * t;
    let tail = (((-5.132_599e-2 * z + 1.016_001_6e-1) * z - 1.417_501_1e-1) * z + 1.999_422_7e-1) * z;
    let tail = (tail - 3.333_323_4e-1) * z;
    let rest = base_low + t * tail + t;
    let angle = base + rest;
    let angle = if left { (PI - base) + (PI_LOW - rest) } else { angle };
    let angle = if both_infinite && left { 0.75 * PI } else { angle };
    f32::from_bits(angle.to_bits() | (u32::from(down) << 31))
}

/// π less its `f32`.
const PI_LOW: f32 = -8.742_278e-8;

/// The angle, 0..π, whose cosine is `x`; NaN outside [−1, 1].
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    atan2(opposite(x), x)
}

/// The angle, −π/2..π/2, whose sine is `x`; NaN outside [−1, 1].
#[inline(always)]
pub fn asin(x: f32) -> f32 {
    atan2(x, opposite(x))
}

/// √(1 − x²), rounded once.
#[inline(always)]
fn opposite(x: f32) -> f32 {
    let x = f64::from(x);
    ((1.0 - x) * (1.0 + x)).sqrt() as f32
}

/// 2ˣ; infinite from 128 on, 0 below −150.
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    exp2_wide(f64::from(x)) as f32
}

/// 2ˣ − 1, good to its last digits where x is small.
#[inline(always)]
pub fn exp2_minus_1(x: f32) -> f32 {
    let (power, rest) = exp2_parts(f64::from(x));
    (power * rest + (power - 1.0)) as f32
}

/// eˣ; infinite above 88.72, 0 below −104.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    exp2_wide(f64::from(x) * LOG2_E) as f32
}

/// The logarithm to base 2; −inf at 0, NaN below.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    log2_wide(x) as f32
}

/// The natural logarithm; −inf at 0, NaN below.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    (log2_wide(x) * LN_2) as f32
}

/// xʸ for x ≥ 0; NaN below, whatever y. Anything to the 0 is 1, and 1 to anything.
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    exp2_wide(pow_exponent(x, y)) as f32
}

/// 1 − xʸ for x ≥ 0, good to its last digits where xʸ is near 1.
#[inline(always)]
pub fn one_minus_pow(x: f32, y: f32) -> f32 {
    let (power, rest) = exp2_parts(pow_exponent(x, y));
    -(power * rest + (power - 1.0)) as f32
}

/// y·log₂ x; 0 where xʸ is 1 by convention although one factor is infinite or NaN.
#[inline(always)]
fn pow_exponent(x: f32, y: f32) -> f64 {
    let exponent = f64::from(y) * log2_wide(x);
    if y == 0.0 || x == 1.0 { 0.0 } else { exponent }
}

/// 2ˣ within 1e-12 of itself.
#[inline(always)]
fn exp2_wide(x: f64) -> f64 {
    let (power, rest) = exp2_parts(x);
    power * rest + power
}

/// 2ˣ = power · (1 + rest), `power` a power of two, |rest| < 0.42.
#[inline(always)]
fn exp2_parts(x: f64) -> (f64, f64) {
    // Beyond, the f32 is 0 or infinite; the bounds keep the power's exponent a normal one.
    let x = if x > 400.0 { 400.0 } else { x };
    let x = if x < -400.0 { -400.0 } else { x };
    let rounded = x + ROUND;
    let power = f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52);
    let t = (x - (rounded - ROUND)) * LN_2;
    // eᵗ − 1 by Taylor's series: |t| ≤ 0.347, so what is left out is below 1e-12.
    let mut sum = 1.0 / 3_628_800.0;
    for factorial in [362_880.0, 40_320.0, 5_040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0] {
        sum = sum * t + 1.0 / factorial;
    }
    // A NaN has lost its exponent's bits.
    (if x.is_nan() { x } else { power }, sum * t)
}

/// log₂ x within 1e-12 of itself.
#[inline(always)]
fn log2_wide(x: f32) -> f64 {
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let wide = f64::from(x);
    // x = 2ᵉ·m with m in [√½, √2); e is read from the low bits that it takes in a large f64.
    let offset = wide.to_bits().wrapping_sub(SQRT_HALF);
    let e = offset.wrapping_add(1 << 62) >> 52;
    let m = f64::from_bits(wide.to_bits().wrapping_sub(e.wrapping_sub(1 << 10) << 52));
    let e = f64::from_bits(ROUND.to_bits() + e) - (ROUND + 1024.0);
    // ln m = 2·atanh s, s = (m − 1)/(m + 1): |s| < 0.172, so what is left out is below 1e-12.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut sum = 1.0 / 15.0;
    for odd in [13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = sum * z + 1.0 / odd;
    }
    let log = e + sum * s * (2.0 * LOG2_E);
    let log = if x == 0.0 { f64::NEG_INFINITY } else { log };
    let log = if x < 0.0 { f64::NAN } else { log };
    // Infinity and NaN are their own logarithms.
    if x == f32::INFINITY || x.is_nan() { wide } else { log }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Key;

    /// Distance of `got` from `exact` in units of the last place of an f32 there.
    fn ulps(got: f32, exact: f64) -> f64 {
        let rounded = exact as f32;
        if got == rounded || got.is_nan() && rounded.is_nan() {
            return 0.0;
        }
        let above = f32::from_bits(rounded.abs().to_bits() + 1);
        let ulp = f64::from(above) - f64::from(rounded.abs());
        if ulp.is_finite() { (f64::from(got) - exact).abs() / ulp } else { f64::INFINITY }
    }

    /// The worst of `got` against `exact` over about 2²¹ values from `low` to `high`, of even spacing
    /// in their bits: as many small ones as large ones.
    fn worst(low: f32, high: f32, got: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> f64 {
        let (first, last) = (low.to_bits(), high.to_bits());
        let stride = ((last - first) >> 21 | 1) as usize;
        let mut worst = 0.0;
        for bits in (first..=last).step_by(stride) {
            for x in [f32::from_bits(bits), -f32::from_bits(bits)] {
                let error = ulps(got(x), exact(f64::from(x)));
                worst = if error > worst { error } else { worst };
            }
        }
        worst
    }

    const NEAR: f32 = 8.0;
    const FAR: f32 = 1_048_576.0;

    #[test]
    fn sine_and_cosine_are_within_2_ulp_up_to_2_to_the_20() {
        for (low, high) in [(0.0, NEAR), (0.5, NEAR), (NEAR, FAR)] {
            assert!(worst(low, high, sin, libm::sin) < 2.0, "sin {low}..{high}");
            assert!(worst(low, high, cos, libm::cos) < 2.0, "cos {low}..{high}");
        }
        for quarters in 1..600_000u32 {
            // Beside their zeros, where the reduction cancels.
            let x = (f64::from(quarters) * std::f64::consts::FRAC_PI_2) as f32;
            assert!(ulps(sin(x), libm::sin(f64::from(x))) < 2.0, "sin {x}");
            assert!(ulps(cos(x), libm::cos(f64::from(x))) < 2.0, "cos {x}");
        }
    }

    #[test]
    fn sine_and_cosine_stay_in_range_far_out() {
        for bits in (FAR.to_bits()..f32::INFINITY.to_bits()).step_by(1001) {
            let (s, c) = sin_cos(f32::from_bits(bits));
            assert!(s.abs() <= 1.0 && c.abs() <= 1.0);
        }
        assert!(sin(f32::INFINITY).is_nan() && cos(f32::NEG_INFINITY).is_nan() && sin(f32::NAN).is_nan());
    }

    #[test]
    fn exact_values_are_exact() {
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert_eq!((exp2(0.0), exp2(10.0), exp2(-149.0)), (1.0, 1024.0, f32::from_bits(1)));
        assert_eq!((log2(1.0), log2(0.125), log2(f32::from_bits(1))), (0.0, -3.0, -149.0));
        assert_eq!((pow(3.0, 2.0), pow(0.0, 0.0), pow(0.0, 2.0), pow(0.0, -1.0)), (9.0, 1.0, 0.0, f32::INFINITY));
        assert_eq!((pow(f32::INFINITY, 0.0), pow(1.0, f32::INFINITY), pow(2.0, -1e30)), (1.0, 1.0, 0.0));
        assert_eq!((acos(1.0), acos(-1.0), acos(0.0), asin(1.0)), (0.0, PI, FRAC_PI_2, FRAC_PI_2));
        assert!(log2(-1.0).is_nan() && pow(-1.0, 2.0).is_nan() && acos(1.1).is_nan() && exp2(f32::NAN).is_nan());
        assert_eq!((log2(0.0), exp(f32::NEG_INFINITY), exp2(f32::INFINITY)), (f32::NEG_INFINITY, 0.0, f32::INFINITY));
    }

    #[test]
    fn exponentials_and_logarithms_are_within_2_ulp() {
        assert!(worst(0.0, 160.0, exp2, libm::exp2) < 2.0);
        assert!(worst(0.0, 110.0, exp, libm::exp) < 2.0);
        assert!(worst(0.0, 160.0, exp2_minus_1, |x| libm::expm1(x * LN_2)) < 2.0);
        assert!(worst(f32::from_bits(1), f32::MAX, log2, libm::log2) < 2.0);
        assert!(worst(f32::from_bits(1), f32::MAX, ln, libm::log) < 2.0);
        assert!(worst(0.99, 1.01, log2, libm::log2) < 2.0);
    }

    #[test]
    fn powers_are_within_2_ulp() {
        for i in 0..1_000_000 {
            let key = Key::new(1).of(i);
            let x = exp2(key.of(0).between([-20.0, 20.0]));
            let y = key.of(1).between([-7.0, 7.0]);
            let exact = libm::pow(f64::from(x), f64::from(y));
            assert!(ulps(pow(x, y), exact) < 2.0, "{x}^{y}");
            let (base, share) = (key.of(2).f32(), key.of(3).f32() * 0.01);
            let exact = -libm::expm1(libm::log(f64::from(base)) * f64::from(share));
            assert!(ulps(one_minus_pow(base, share), exact) < 2.0, "1 − {base}^{share}");
        }
    }

    #[test]
    fn inverse_functions_are_within_2_ulp() {
        assert!(worst(0.0, 1.0, acos, libm::acos) < 2.0);
        assert!(worst(0.0, 1.0, asin, libm::asin) < 2.0);
        assert!(worst(0.0, f32::MAX, |y| atan2(y, 1.0), libm::atan) < 2.0);
        for i in 0..2_000_000 {
            let key = Key::new(2).of(i);
            let [x, y] = [0, 1].map(|axis| {
                let size = exp2(key.of(axis).of(0).between([-60.0, 60.0]) * key.of(2).f32());
                if key.of(axis).of(1).f32() < 0.5 { size } else { -size }
            });
            let exact = libm::atan2(f64::from(y), f64::from(x));
            assert!(ulps(atan2(y, x), exact) < 2.0, "atan2({y}, {x})");
        }
    }

    #[test]
    fn atan2_of_zeros_infinities_and_denormals_is_what_ieee_asks() {
        let (inf, tiny) = (f32::INFINITY, f32::from_bits(3));
        let values = [0.0, -0.0, 1.0, -1.0, inf, -inf, tiny, -tiny, f32::MAX, -f32::MAX];
        for y in values {
            for x in values {
                let exact = libm::atan2(f64::from(y), f64::from(x));
                assert!(ulps(atan2(y, x), exact) < 2.0, "atan2({y}, {x})");
                assert_eq!(atan2(y, x).is_sign_negative(), y.is_sign_negative());
            }
            assert!(atan2(f32::NAN, y).is_nan() && atan2(y, f32::NAN).is_nan());
        }
    }
}
