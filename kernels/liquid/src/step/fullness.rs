//! How full of liquid a cell is.

use crate::level_set::cubic::weights;

/// φ at the centres of the 5³ cells around a cell and of it, x fastest.
pub(super) type Neighbours = [f32; 125];

/// Parts of a cell along each axis.
const PARTS: usize = 4;

/// Depth of a cell's centre, in cells, from which on all of it is full, or empty.
const FAR: f32 = 1.0;

/// The share of a cell where φ < 0, by φ in the middle of 4³ parts of it, interpolated tricubically. Of a cell with an edge of a
/// block in its middle a quarter is full; this says a third, φ at the centre a half.
pub(super) fn fullness(phi: &Neighbours) -> f32 {
    let centre = phi[62];
    if centre.abs() > FAR {
        return if centre < 0.0 { 1.0 } else { 0.0 };
    }
    let weights = part_weights();
    let mut sum = 0.0;
    let along_z: [[f32; 25]; PARTS] = weights.map(|w| std::array::from_fn(|n| weighted(w, |k| phi[n + 25 * k])));
    for slice in along_z {
        let along_y: [[f32; 5]; PARTS] = weights.map(|w| std::array::from_fn(|n| weighted(w, |j| slice[n + 5 * j])));
        for row in along_y {
            for w in weights {
                sum += (0.5 - PARTS as f32 * weighted(w, |i| row[i])).clamp(0.0, 1.0);
            }
        }
    }
    sum / (PARTS * PARTS * PARTS) as f32
}

fn weighted(weights: [f32; 5], value: impl Fn(usize) -> f32) -> f32 {
    (0..5).map(|n| weights[n] * value(n)).sum()
}

/// Weights of five values for the middle of each part of the third one's cell.
fn part_weights() -> [[f32; 5]; PARTS] {
    std::array::from_fn(|part| {
        let at = (part as f32 + 0.5) / PARTS as f32 - 0.5;
        let (first, t) = if at < 0.0 { (0, 1.0 + at) } else { (1, at) };
        let [four, _] = weights(t);
        let mut five = [0.0; 5];
        five[first..first + 4].copy_from_slice(&four);
        five
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::vector::{add, length};

    /// φ around a cell whose centre is at 0.
    fn around(phi: impl Fn([f32; 3]) -> f32) -> Neighbours {
        std::array::from_fn(|n| phi([n % 5, n / 5 % 5, n / 25].map(|i| i as f32 - 2.0)))
    }

    fn near(a: f32, b: f32, by: f32) {
        assert!((a - b).abs() < by, "{a} {b}");
    }

    #[test]
    fn slabs_edges_and_corners_fill_their_share() {
        for at in [-0.4, -0.1, 0.0, 0.3] {
            near(fullness(&around(|p| p[1] - at)), 0.5 + at, 1e-3);
        }
        // An edge and a corner in the middle, and the end of a film of 0.3 cells there; the interpolation rounds them.
        near(fullness(&around(|p| p[0].max(p[1]))), 0.25, 0.09);
        near(fullness(&around(|p| p[0].max(p[1]).max(p[2]))), 0.125, 0.14);
        near(fullness(&around(|p| (p[1] + 0.2).max(p[0]))), 0.15, 0.07);
    }

    #[test]
    fn balls_fill_their_volume() {
        for (radius, by) in [(3.0_f32, 4e-3), (6.0, 1e-3)] {
            let mut sum = 0.0;
            for n in 0..20_i32.pow(3) {
                let cell = [n % 20, n / 20 % 20, n / 400].map(|i| (i - 10) as f32 + 0.3);
                sum += fullness(&around(|p| length(add(p, cell)) - radius));
            }
            let exact = 4.0 / 3.0 * std::f32::consts::PI * radius * radius * radius;
            near(sum / exact, 1.0, by);
        }
    }
}
