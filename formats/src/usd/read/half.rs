//! Numbers of 16 bits.

/// The f32 of a half: all of them are exact.
pub(super) fn number(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let (exponent, fraction) = (u32::from(bits >> 10 & 0x1f), u32::from(bits & 0x3ff));
    match exponent {
        // Subnormal: a multiple of 2⁻²⁴.
        0 => {
            let size = fraction as f32 / 16_777_216.0;
            f32::from_bits(size.to_bits() | sign)
        }
        31 => f32::from_bits(sign | 0x7f80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (exponent + 112) << 23 | fraction << 13),
    }
}

/// The half nearest to `x`, as an f32; of two equally near ones the even one.
pub(super) fn nearest(x: f32) -> f32 {
    let size = x.abs();
    if size >= 65_520.0 || x.is_nan() {
        return if x.is_nan() { x } else { f32::INFINITY.copysign(x) };
    }
    // Adding and taking away a number of 13 more bits rounds to what is left: 11 bits, or multiples of 2⁻²⁴.
    let exponent = (size.to_bits() >> 23).max(113);
    let step = f32::from_bits((exponent + 13) << 23);
    (size + step - step).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::{nearest, number};

    #[test]
    fn halves_have_the_values_of_the_standard() {
        for (bits, expected) in [
            (0x0000, 0.0_f32),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65_504.0),
            (0x0001, 5.960_464_5e-8),
            (0x03ff, 6.097_555e-5),
            (0x0400, 6.103_515_6e-5),
            (0x3555, 0.333_251_95),
            (0x7c00, f32::INFINITY),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(number(bits).to_bits(), expected.to_bits(), "{bits:x}");
        }
        assert!(number(0x7e00).is_nan());
        assert_eq!(number(0x8000).to_bits(), (-0.0_f32).to_bits());
    }

    #[test]
    fn every_half_is_its_own_nearest_and_ties_go_to_the_even_one() {
        for bits in 0..0x7c00_u16 {
            let (here, next) = (number(bits), number(bits + 1));
            assert_eq!(nearest(-here).to_bits(), (-here).to_bits());
            if bits < 0x7bff {
                let middle = here + (next - here) / 2.0;
                assert_eq!(nearest(middle), if bits % 2 == 0 { here } else { next }, "{bits:x}");
                assert_eq!(nearest(f32::from_bits(middle.to_bits() + 1)), next, "{bits:x}");
            }
        }
        assert_eq!(nearest(65_519.0), 65_504.0);
        assert_eq!(nearest(-65_520.0), f32::NEG_INFINITY);
    }
}
