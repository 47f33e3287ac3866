//! The rotation nearest to a matrix.
//!
//! The unit quaternion that maximises the trace of Rᵀ·A is the eigenvector of the largest eigenvalue of a symmetric
//! 4×4 matrix (Horn 1987). Its characteristic polynomial has real roots only, so Newton's method from above falls onto
//! the largest one and stops there (Theobald 2005); the eigenvector is a column of the adjugate.
//!
//! Promise: for a rotation times any positive scale, that rotation to 1e-14; smooth in the matrix, mirrored and flat
//! ones included, wherever there is one nearest rotation; none where there is not. Limit: a matrix of rank 1, or one
//! that mirrors and scales its two lesser axes alike, has a circle of equally near rotations.

use super::vectors::{Matrix, Quat, cross, dot};

/// Of the derivative of the characteristic polynomial at the root, the matrix of norm 1: 8·(σ₂+σ₃)(σ₁+σ₃)(σ₁+σ₂), 12
/// for a rotation and 0 where the nearest one is not unique. Here the rounding of f32 positions turns by about 0.01
/// radians; ten times farther on it is lost in what a skin does in a frame.
const AMBIGUOUS: f64 = 1e-4;

/// Steps of Newton's method: about 6 are used, and 40 near a double root.
const MOST_STEPS: usize = 64;

/// The turn R (x, y, z, w; w ≥ 0) that makes |A − R| least; none where several are about as near, or A is not finite.
pub fn nearest_rotation(a: &Matrix) -> Option<Quat> {
    let largest = a.as_flattened().iter().fold(0.0_f64, |most, x| if x.abs() <= most { most } else { x.abs() });
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    // First near 1, so that squares neither vanish nor overflow.
    let a = a.map(|row| row.map(|x| x / largest));
    let norm = a.as_flattened().iter().map(|x| x * x).sum::<f64>().sqrt();
    let a = a.map(|row| row.map(|x| x / norm));

    let cofactors = [cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])];
    let linear = -8.0 * dot(a[0], cofactors[0]);
    let constant = 1.0 - 4.0 * cofactors.as_flattened().iter().map(|x| x * x).sum::<f64>();
    let value = |x: f64| (x * x - 2.0) * x * x + linear * x + constant;
    let slope = |x: f64| (4.0 * x * x - 4.0) * x + linear;
    // No root lies above the sum of the singular values, which is at most √3 times the norm.
    let mut root = 3.0_f64.sqrt();
    for _ in 0..MOST_STEPS {
        let (up, along) = (value(root), slope(root));
        let next = root - up / along;
        if !(up > 0.0 && along > 0.0 && next < root) {
            break;
        }
        root = next;
    }
    (slope(root) > AMBIGUOUS).then(|| eigenvector(&horn(&a), root))
}

/// The matrix whose largest eigenvector is the rotation, as w, x, y, z.
fn horn([[xx, yx, zx], [xy, yy, zy], [xz, yz, zz]]: &Matrix) -> [[f64; 4]; 4] {
    [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]
}

/// The unit eigenvector of a single eigenvalue.
fn eigenvector(matrix: &[[f64; 4]; 4], value: f64) -> Quat {
    let mut less = *matrix;
    for (k, row) in less.iter_mut().enumerate() {
        row[k] -= value;
    }
    // The adjugate is the eigenvector times itself, up to a factor: the row of its largest diagonal has most digits.
    let diagonal = [0, 1, 2, 3].map(|k| cofactor(&less, k, k).abs());
    let row = (0..4).fold(0, |best, k| if diagonal[k] > diagonal[best] { k } else { best });
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| cofactor(&less, row, k));
    let length = (w * w + x * x + y * y + z * z).sqrt();
    let length = if w < 0.0 { -length } else { length };
    [x / length, y / length, z / length, w / length]
}

fn cofactor(matrix: &[[f64; 4]; 4], row: usize, column: usize) -> f64 {
    const OTHERS: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
    let [a, b, c] = OTHERS[row].map(|row| OTHERS[column].map(|column| matrix[row][column]));
    let minor = dot(a, cross(b, c));
    if (row + column).is_multiple_of(2) { minor } else { -minor }
}

#[cfg(test)]
mod tests {
    use super::super::vectors::{scale, turned};
    use super::*;
    use numerics::random::Key;

    fn matrix(q: Quat) -> Matrix {
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turned(q, axis));
        [0, 1, 2].map(|k| [x[k], y[k], z[k]])
    }

    fn times(a: &Matrix, b: &Matrix) -> Matrix {
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
    }

    fn apart(a: Quat, b: Quat) -> f64 {
        let sign = if (0..4).map(|k| a[k] * b[k]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        (0..4).map(|k| (a[k] - sign * b[k]).abs()).fold(0.0, f64::max)
    }

    fn about_z(angle: f64) -> Quat {
        [0.0, 0.0, libm::sin(angle / 2.0), libm::cos(angle / 2.0)]
    }

    fn some_turn(i: u64) -> Quat {
        let q: Quat = std::array::from_fn(|k| Key::new(3).of(i).of(k as u64).f64() - 0.5);
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        q.map(|x| x / length)
    }

    #[test]
    fn a_rotation_is_its_own_at_any_scale() {
        for i in 0..1000 {
            let q = some_turn(i);
            for size in [1.0, 1e-150, 1e150] {
                let found = nearest_rotation(&matrix(q).map(|row| row.map(|x| x * size))).unwrap();
                assert!(apart(found, q) < 1e-14, "{q:?} {found:?}");
            }
        }
        for half in [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.6, 0.8, 0.0]] {
            assert!(apart(nearest_rotation(&matrix(half)).unwrap(), half) < 1e-14);
        }
    }

    #[test]
    fn stretch_before_a_turn_changes_nothing_and_shear_turns_by_half() {
        // R·S with S symmetric and positive has R as its rotation, by definition of the polar decomposition.
        for i in 0..1000 {
            let (q, axes) = (some_turn(i), matrix(some_turn(i + 5000)));
            let stretch = [0, 1, 2].map(|k| Key::new(4).of(i).of(k).f64() + 1e-3);
            let transposed = [0, 1, 2].map(|r| [0, 1, 2].map(|c| axes[c][r]));
            let scaled: Matrix = [0, 1, 2].map(|k| scale(transposed[k as usize], stretch[k as usize]));
            let found = nearest_rotation(&times(&matrix(q), &times(&axes, &scaled))).unwrap();
            assert!(apart(found, q) < 1e-12, "{stretch:?}");
        }
        // Simple shear by k turns by −atan(k/2).
        let found = nearest_rotation(&[[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
        assert!(apart(found, about_z(-libm::atan(0.5))) < 1e-14);
    }

    #[test]
    fn flat_matrices_have_one_and_lines_have_none() {
        let q = some_turn(1);
        let flat = times(&matrix(q), &[[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]);
        assert!(apart(nearest_rotation(&flat).unwrap(), q) < 1e-14);
        for line in [0.0, 1e-6] {
            let line = times(&matrix(q), &[[2.0, 0.0, 0.0], [0.0, line, 0.0], [0.0, 0.0, 0.0]]);
            assert_eq!(nearest_rotation(&line), None);
        }
        // A mirror keeps what it must: the axis it flips is the one that counts least.
        let mirror = times(&matrix(q), &[[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, -1.0]]);
        assert!(apart(nearest_rotation(&mirror).unwrap(), q) < 1e-14);
        assert_eq!(nearest_rotation(&[[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), None);
    }

    #[test]
    fn what_is_no_number_has_no_rotation() {
        for x in [0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(nearest_rotation(&[[x; 3]; 3]), None);
        }
    }
}
