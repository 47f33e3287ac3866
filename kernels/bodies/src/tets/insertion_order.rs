//! Biased randomised insertion order (Amenta, Choi & Rote 2003): rounds of doubling size drawn at random, each sorted
//! along the Morton curve. Walks to the next point are short, and no input is slow.

use super::grid::{GridPoint, SIDE};
use numerics::random::Key;

/// An arbitrary constant.
const SEED: u64 = 0x7e75;

/// Indices of all points in insertion order, which depends only on the points.
pub(super) fn insertion_order(points: &[GridPoint]) -> Vec<u32> {
    let rounds = u64::from(usize::BITS - points.len().leading_zeros());
    let key = |(index, point): (usize, &GridPoint)| {
        // Half of all points come in the last round, a quarter in the one before, and so on.
        let later = u64::from(Key::new(SEED).of(index as u64).u64().trailing_zeros()).min(rounds);
        u128::from(rounds - later) << 96 | u128::from(morton(*point)) << 32 | index as u128
    };
    let mut keys: Vec<u128> = points.iter().enumerate().map(key).collect();
    keys.sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Morton code of the 21 highest bits of each coordinate.
fn morton(point: GridPoint) -> u64 {
    let [x, y, z] = point.map(|x| spread(x.min(SIDE - 1) as u64 >> 3));
    x | y << 1 | z << 2
}

/// The 21 low bits, two zeros after each.
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_codes_interleave_bits() {
        assert_eq!(morton([8, 0, 0]), 0b001);
        assert_eq!(morton([8, 16, 24]), 0b110_101);
        assert_eq!(morton([SIDE; 3]), (1 << 63) - 1);
    }

    #[test]
    fn every_point_comes_once_and_half_in_the_last_round() {
        let points: Vec<GridPoint> = (0..1000).map(|k| [k, 0, 0]).collect();
        let order = insertion_order(&points);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..1000));
        let rising = order.windows(2).rev().take_while(|pair| pair[0] < pair[1]).count();
        assert!((400..600).contains(&rising), "the last round is half of all, along the curve: {rising}");
    }
}
