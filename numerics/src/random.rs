//! Counter-based random numbers: a pure function of a seed and of indices, with no state to advance.
//!
//! `Key::new(seed).of(gust).of(RADIUS).f32()` is the same number in any order of evaluation and on any thread. A key is
//! 64 bits; every step is SplitMix64's finaliser (Steele, Lea & Flood
//! 2014), so single-bit changes of the seed or of any index change half of the result's bits.
//! Limit: for pictures, not for cryptography; two of n keys collide by chance once n nears 2³².

/// Golden ratio × 2⁶⁴: SplitMix64's increment, which keeps neighbouring indices far apart.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A node in the tree of random numbers: read a number from it or descend to a child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(u64);

impl Key {
    /// The root of a seed's tree.
    #[inline]
    pub const fn new(seed: u64) -> Self {
        Self(mix64(seed ^ GOLDEN))
    }

    /// The child at `index`; `of(a).of(b)` and `of(b).of(a)` are unrelated.
    #[inline]
    pub const fn of(self, index: u64) -> Self {
        Self(mix64(self.0.wrapping_add(index.wrapping_add(1).wrapping_mul(GOLDEN))))
    }

    /// 64 uniform bits.
    #[inline]
    pub const fn u64(self) -> u64 {
        // One more round: the returned bits are not the state that children start from.
        mix64(self.0 ^ GOLDEN.rotate_left(32))
    }

    /// 32 uniform bits.
    #[inline]
    pub const fn u32(self) -> u32 {
        (self.u64() >> 32) as u32
    }

    /// Uniform in [0, 1), a multiple of 2⁻²⁴.
    #[inline]
    pub fn f32(self) -> f32 {
        (self.u64() >> 40) as f32 * (1.0 / (1u32 << 24) as f32)
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³.
    #[inline]
    pub fn f64(self) -> f64 {
        (self.u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform between `low` and `high`; `low` itself where the two are equal.
    #[inline]
    pub fn between(self, [low, high]: [f32; 2]) -> f32 {
        let share = self.f32();
        // Rounding may carry the upper end of a wide range past `high` by one ulp.
        if low <= high {
            (low + (high - low) * share).clamp(low, high)
        } else {
            (low + (high - low) * share).clamp(high, low)
        }
    }
}

/// SplitMix64's finaliser: a bijection of 64 bits.
#[inline]
const fn mix64(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// A bijection of 32 bits for lattices (Wellons 2018, "lowbias32": bias 0.174), where 64-bit
/// products would halve the lanes of a vector.
#[inline(always)]
pub const fn mix32(mut bits: u32) -> u32 {
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x846c_a68b);
    bits ^ (bits >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: u64 = 1 << 16;

    #[test]
    fn numbers_never_change_between_versions() {
        // SplitMix64 seeded with 0 gives 0xe220a8397b1dcdaf first: the published test vector.
        assert_eq!(mix64(GOLDEN), 0xe220_a839_7b1d_cdaf);
        assert_eq!(Key::new(0), Key(0xe220_a839_7b1d_cdaf));
    }

    #[test]
    fn order_of_indices_matters_and_numbers_repeat() {
        let key = Key::new(7);
        assert_eq!(key.of(1).of(2).u64(), Key::new(7).of(1).of(2).u64());
        assert_ne!(key.of(1).of(2).u64(), key.of(2).of(1).u64());
        assert_ne!(key.of(0).u64(), key.u64());
        assert_ne!(Key::new(7).u64(), Key::new(8).u64());
    }

    #[test]
    fn mean_and_variance_are_those_of_a_uniform_number() {
        for seed in [0, 1, u64::MAX] {
            let (mut sum, mut squares) = (0.0, 0.0);
            for index in 0..N {
                let x = Key::new(seed).of(index).f64();
                assert!((0.0..1.0).contains(&x));
                sum += x;
                squares += x * x;
            }
            let (mean, square) = (sum / N as f64, squares / N as f64);
            // Five standard deviations of the mean of N uniform numbers: 5·√(1/12)/√N = 5.6e-3.
            assert!((mean - 0.5).abs() < 5.7e-3, "mean {mean}");
            assert!((square - mean * mean - 1.0 / 12.0).abs() < 2e-3);
        }
    }

    #[test]
    fn f32_fills_256_boxes_evenly() {
        let mut boxes = [0.0; 256];
        for index in 0..N {
            boxes[(Key::new(3).of(index).f32() * 256.0) as usize] += 1.0;
        }
        let expected = N as f64 / 256.0;
        let chi: f64 = boxes.iter().map(|n: &f64| (n - expected) * (n - expected) / expected).sum();
        // 255 degrees of freedom: mean 255, deviation 22.6; five deviations each way.
        assert!((142.0..368.0).contains(&chi), "chi² {chi}");
    }

    #[test]
    fn neighbours_in_index_and_seed_are_uncorrelated() {
        let centred = |seed: u64, index: u64| Key::new(seed).of(index).f64() - 0.5;
        let (mut along, mut across) = (0.0, 0.0);
        for index in 0..N {
            along += centred(5, index) * centred(5, index + 1);
            across += centred(5, index) * centred(6, index);
        }
        // Variance 1/12 each, so five deviations of the correlation are 5/√N = 0.0195.
        assert!((along * 12.0 / N as f64).abs() < 0.0195);
        assert!((across * 12.0 / N as f64).abs() < 0.0195);
    }

    #[test]
    fn one_bit_in_flips_half_of_the_bits_out() {
        let flipped = |change: &dyn Fn(u32, u64) -> u32| {
            let total: u32 = (0..64).flat_map(|bit| (0..256).map(move |i| change(bit, i))).sum();
            f64::from(total) / (64.0 * 256.0)
        };
        let index = flipped(&|bit, i| (Key::new(1).of(i).u64() ^ Key::new(1).of(i ^ (1 << bit)).u64()).count_ones());
        let seed = flipped(&|bit, i| (Key::new(i).of(9).u64() ^ Key::new(i ^ (1 << bit)).of(9).u64()).count_ones());
        let lattice = flipped(&|bit, i| (mix32(i as u32) ^ mix32(i as u32 ^ (1 << (bit % 32)))).count_ones());
        assert!((index - 32.0).abs() < 0.3 && (seed - 32.0).abs() < 0.3, "{index} {seed}");
        assert!((lattice - 16.0).abs() < 0.3, "{lattice}");
    }

    #[test]
    fn between_stays_within_its_ends_in_either_order() {
        for index in 0..1000 {
            let key = Key::new(1).of(index);
            assert_eq!(key.between([2.5, 2.5]), 2.5);
            assert!((0.1..=0.3).contains(&key.between([0.1, 0.3])));
            assert!((0.1..=0.3).contains(&key.between([0.3, 0.1])));
        }
    }
}
