//! Tricubic interpolation (Catmull and Rom 1974) of 4³ values, with its gradient.

/// Values at the centres of 4³ cells, x fastest. The cube that is interpolated lies between the second and the third
/// along each axis.
pub(crate) type Block = [f32; 64];

/// |φ″| along an axis, ÷ cell, up to which φ is curved, and from which on it is creased, as in the middle of a film.
const CURVED: f32 = 0.75;
const CREASED: f32 = 1.0;

/// The share of a second difference of φ, ÷ cell, that is of a curved φ and not of a crease in it.
#[inline(always)]
pub(crate) fn curved(bend: f32) -> f32 {
    bend * ((CREASED - bend.abs()) / (CREASED - CURVED)).clamp(0.0, 1.0)
}

/// Weights of four values, and of the derivative, at `t` between the second and the third.
#[inline(always)]
pub(crate) fn weights(t: f32) -> [[f32; 4]; 2] {
    let (t2, t3) = (t * t, t * t * t);
    [
        [t2 - 0.5 * (t + t3), 1.0 - 2.5 * t2 + 1.5 * t3, 0.5 * t + 2.0 * t2 - 1.5 * t3, 0.5 * (t3 - t2)],
        [2.0 * t - 0.5 - 1.5 * t2, 4.5 * t2 - 5.0 * t, 0.5 + 4.0 * t - 4.5 * t2, 1.5 * t2 - t],
    ]
}

type Four = [f32; 4];

#[inline(always)]
fn weighted_rows(four: [Four; 4], weights: Four) -> Four {
    let [a, b, c, d] = four;
    std::array::from_fn(|n| (weights[0] * a[n] + weights[1] * b[n]) + (weights[2] * c[n] + weights[3] * d[n]))
}

#[inline(always)]
fn weighted(four: Four, weights: Four) -> f32 {
    (weights[0] * four[0] + weights[1] * four[1]) + (weights[2] * four[2] + weights[3] * four[3])
}

/// The value and the gradient at `at`, 0 to 1 along each axis within the cube.
#[inline(always)]
pub(crate) fn cubic(block: &Block, at: [f32; 3]) -> (f32, [f32; 3]) {
    let [[x, dx], [y, dy], [z, dz]] = at.map(weights);
    let row = |row: usize| -> Four { std::array::from_fn(|n| block[4 * row + n]) };
    let slices: [[Four; 4]; 4] = std::array::from_fn(|k| std::array::from_fn(|j| row(4 * k + j)));
    let along_y = slices.map(|rows| weighted_rows(rows, y));
    let across_y = slices.map(|rows| weighted_rows(rows, dy));
    let value = weighted_rows(along_y, z);
    let gradient =
        [weighted(value, dx), weighted(weighted_rows(across_y, z), x), weighted(weighted_rows(along_y, dz), x)];
    (weighted(value, x), gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_quadratics_are_exact() {
        let f = |x: f32, a: f32, b: f32| 0.3 + a * x + b * x * x;
        let slope = |x: f32, a: f32, b: f32| a + 2.0 * b * x;
        let at = |n: usize| n as f32 - 1.0;
        let block: Block =
            std::array::from_fn(|n| f(at(n % 4), 0.5, -0.2) * f(at(n / 4 % 4), -0.7, 0.1) * f(at(n / 16), 0.2, 0.4));
        for p in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.3, 0.8, 0.1]] {
            let [x, y, z] = [f(p[0], 0.5, -0.2), f(p[1], -0.7, 0.1), f(p[2], 0.2, 0.4)];
            let [dx, dy, dz] = [slope(p[0], 0.5, -0.2), slope(p[1], -0.7, 0.1), slope(p[2], 0.2, 0.4)];
            let (value, gradient) = cubic(&block, p);
            let expected = [x * y * z, dx * y * z, x * dy * z, x * y * dz];
            for (got, expected) in [value, gradient[0], gradient[1], gradient[2]].iter().zip(expected) {
                assert!((got - expected).abs() < 2e-6, "{got} {expected}");
            }
        }
    }
}
