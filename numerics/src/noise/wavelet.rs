//! Wavelet noise (Cook & DeRose 2005): an octave has almost no energy in the band of the next coarser one, so it neither
//! aliases nor adds to lower octaves.
//!
//! A periodic tile of random coefficients, less what survives downsampling and upsampling by 2, is evaluated by quadratic
//! B-splines (C¹). Limits: it repeats after [`TILE`] cells, and unlike gradient noise it is not 0 on the lattice. The last
//! step of the paper (adding the tile to itself, moved by an odd offset, to even out the variance) is left out: it would
//! return 4 % of the energy to the coarser octave.

use super::lattice::Point;
use crate::random::{Key, mix32};
use std::sync::LazyLock;

/// Cells along a side of the tile: a power of two, so that cells wrap with it.
pub(super) const TILE: usize = 64;

/// Brings the field's rms to gradient noise's 0.27.
const SCALE: f64 = 0.8615;

/// Three decorrelated components of mean 0 and rms 0.27.
pub(super) fn noise(point: Point, salt: u32) -> [f32; 3] {
    let tile = tile();
    let axis = |axis: usize| {
        let share = point.share[axis];
        // Three B-splines reach the point: the nearest ones.
        let right = share > 0.5;
        let t = if right { 1.5 - share } else { 0.5 - share };
        let [before, after] = [0.5 * t * t, 0.5 * (1.0 - t) * (1.0 - t)];
        // An even offset, whole cells of the coarser octave: an odd one would leave 4 % of the energy in that octave.
        let moved = mix32(salt.wrapping_add(axis as u32)) & !1;
        let middle = point.cell[axis].wrapping_add(u32::from(right)).wrapping_add(moved);
        let index = |step: u32| middle.wrapping_add(step).wrapping_sub(1) as usize % TILE;
        ([0, 1, 2].map(index), [before, 1.0 - before - after, after])
    };
    let [(i, u), (j, v), (k, w)] = [axis(0), axis(1), axis(2)];
    let mut sum = [0.0; 4];
    for c in 0..3 {
        for b in 0..3 {
            let line = (k[c] * TILE + j[b]) * TILE;
            for a in 0..3 {
                let weight = w[c] * v[b] * u[a];
                for (sum, value) in sum.iter_mut().zip(tile[line + i[a]]) {
                    *sum += weight * value;
                }
            }
        }
    }
    [sum[0], sum[1], sum[2]]
}

/// The coefficients, x fastest: three components and padding, for aligned reads. Computed on first use, on the calling
/// thread only (a pool's thread that waits here must not be given other work).
pub(super) fn tile() -> &'static [[f32; 4]] {
    static MADE: LazyLock<Vec<[f32; 4]>> = LazyLock::new(|| {
        let mut tile = vec![[0.0; 4]; TILE * TILE * TILE];
        for component in 0..3 {
            for (cell, value) in tile.iter_mut().zip(component_tile(component as u64)) {
                cell[component] = (value * SCALE) as f32;
            }
        }
        tile
    });
    &MADE
}

/// Random coefficients less their downsampled and upsampled copy.
fn component_tile(component: u64) -> Vec<f64> {
    let key = Key::new(component);
    let random: Vec<f64> = (0..TILE * TILE * TILE).map(|cell| bell(key.of(cell as u64))).collect();
    let mut coarse = random.clone();
    for stride in [1, TILE, TILE * TILE] {
        along(stride, &mut coarse, |line| *line = double(&halve(line)));
    }
    random.iter().zip(&coarse).map(|(value, coarse)| value - coarse).collect()
}

/// A bell-shaped number of mean 0 and variance 1: the sum of four uniform ones.
fn bell(key: Key) -> f64 {
    let bits = key.u64();
    let sum: u64 = (0..4).map(|part| (bits >> (16 * part)) & 0xffff).sum();
    // Four times variance 1/12; the mean of a sixteen-bit number is half of 65,535.
    (sum as f64 - 2.0 * 65_535.0) / 65_536.0 * 3f64.sqrt()
}

/// A line of the tile.
type Line = [f64; TILE];

/// Changes every line of `values` that runs along the axis of this stride.
fn along(stride: usize, values: &mut [f64], change: impl Fn(&mut Line)) {
    for start in 0..values.len() {
        if !(start / stride).is_multiple_of(TILE) {
            continue;
        }
        let mut line = [0.0; TILE];
        for (i, value) in line.iter_mut().enumerate() {
            *value = values[start + i * stride];
        }
        change(&mut line);
        for (i, value) in line.iter().enumerate() {
            values[start + i * stride] = *value;
        }
    }
}

/// Half of the analysis filter of quadratic B-spline wavelets, from its middle outwards.
const ANALYSIS: [f64; 16] = [
    0.655_340, 0.033_979, -0.243_780, -0.025_936, 0.103_311, 0.011_655, -0.044_412, -0.005_040, 0.019_120, 0.002_172,
    -0.008_233, -0.000_938, 0.003_546, 0.000_410, -0.001_528, 0.000_334,
];

/// Downsamples: the coarse coefficients that approximate a line best.
pub(super) fn halve(line: &Line) -> [f64; TILE / 2] {
    std::array::from_fn(|coarse| {
        let tap = |distance: usize| {
            let left = line[(2 * coarse + TILE - distance) % TILE];
            let right = line[(2 * coarse + 1 + distance) % TILE];
            ANALYSIS[distance] * (left + right)
        };
        (0..ANALYSIS.len()).map(tap).sum()
    })
}

/// Upsamples exactly: a quadratic B-spline is a sum of four of half its size.
fn double(coarse: &[f64; TILE / 2]) -> Line {
    std::array::from_fn(|fine| {
        let near = coarse[fine / 2];
        let other = if fine % 2 == 0 { fine / 2 + TILE / 2 - 1 } else { fine / 2 + 1 };
        0.75 * near + 0.25 * coarse[other % (TILE / 2)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn energy(values: &[f64]) -> f64 {
        values.iter().map(|value| value * value).sum()
    }

    #[test]
    fn downsampling_by_2_leaves_less_than_a_hundredth_of_the_energy() {
        for component in 0..3 {
            let mut values: Vec<f64> = tile().iter().map(|cell| f64::from(cell[component])).collect();
            let before = energy(&values);
            for stride in [1, TILE, TILE * TILE] {
                along(stride, &mut values, |line| *line = double(&halve(line)));
            }
            assert!(energy(&values) < 1e-2 * before, "{}", energy(&values) / before);
        }
    }

    #[test]
    fn halve_inverts_double() {
        let coarse = std::array::from_fn(|i| Key::new(3).of(i as u64).f64() - 0.5);
        let back = halve(&double(&coarse));
        for (a, b) in coarse.iter().zip(back) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }

    #[test]
    fn noise_is_continuous_across_cells_and_the_edge_of_the_tile() {
        for x in [0.0, 0.5, 1.0, 63.5, 64.0, -0.5] {
            let at = |x: f64| noise(Point::at([x, 0.3, 7.8]), 5);
            for (a, b) in at(x - 1e-6).into_iter().zip(at(x + 1e-6)) {
                assert!((a - b).abs() < 1e-5, "{x}: {a} {b}");
            }
        }
        assert_eq!(noise(Point::at([1.25, 2.5, 3.75]), 5), noise(Point::at([65.25, -61.5, 3.75]), 5));
    }
}
