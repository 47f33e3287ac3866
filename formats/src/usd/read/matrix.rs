//! Matrices of row vectors: a point is a row that is multiplied from the left, as USD has it.

use std::array::from_fn;

/// Four rows; the last is the translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Matrix(pub(super) [[f64; 4]; 4]);

impl Matrix {
    pub(super) const IDENTITY: Self =
        Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);

    /// This, then `after`.
    pub(super) fn then(&self, after: &Self) -> Self {
        let entry = |row: &[f64; 4], k: usize| (0..4).fold(0.0, |sum, j| sum + row[j] * after.0[j][k]);
        Self(self.0.map(|row| from_fn(|k| entry(&row, k))))
    }

    /// Row by row.
    pub(super) fn of_numbers(numbers: &[f64]) -> Option<Self> {
        let numbers: &[f64; 16] = numbers.try_into().ok()?;
        Some(Self(from_fn(|i| from_fn(|k| numbers[4 * i + k]))))
    }

    pub(super) fn translation(by: [f64; 3]) -> Self {
        let mut matrix = Self::IDENTITY;
        matrix.0[3][..3].copy_from_slice(&by);
        matrix
    }

    pub(super) fn scaling(by: [f64; 3]) -> Self {
        let mut matrix = Self::IDENTITY;
        (0..3).for_each(|k| matrix.0[k][k] = by[k]);
        matrix
    }

    /// A rotation about one of the axes, degrees, counter-clockwise as seen from its end.
    pub(super) fn rotation(axis: usize, degrees: f64) -> Self {
        let radians = degrees * (std::f64::consts::PI / 180.0);
        let (sine, cosine) = (libm::sin(radians), libm::cos(radians));
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut matrix = Self::IDENTITY;
        matrix.0[a][a] = cosine;
        matrix.0[a][b] = sine;
        matrix.0[b][a] = -sine;
        matrix.0[b][b] = cosine;
        matrix
    }

    /// The rotation of a unit quaternion x, y, z, w.
    pub(super) fn orientation([x, y, z, w]: [f64; 4]) -> Self {
        Self([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (z * x - y * w), 0.0],
            [2.0 * (x * y - z * w), 1.0 - 2.0 * (z * z + x * x), 2.0 * (y * z + x * w), 0.0],
            [2.0 * (z * x + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (y * y + x * x), 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ])
    }

    /// The inverse; `None` if there is none.
    pub(super) fn inverse(&self) -> Option<Self> {
        let mut rows: [[f64; 8]; 4] =
            from_fn(|i| from_fn(|k| if k < 4 { self.0[i][k] } else { f64::from(u8::from(k == i + 4)) }));
        for column in 0..4 {
            let pivot = (column..4).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))?;
            rows.swap(column, pivot);
            let diagonal = rows[column][column];
            if diagonal.abs() < f64::MIN_POSITIVE || !diagonal.is_finite() {
                return None;
            }
            rows[column] = rows[column].map(|x| x / diagonal);
            let row = rows[column];
            for (_, other) in rows.iter_mut().enumerate().filter(|(i, _)| *i != column) {
                let factor = other[column];
                for (x, y) in other.iter_mut().zip(row) {
                    *x -= factor * y;
                }
            }
        }
        Some(Self(rows.map(|row| from_fn(|k| row[k + 4]))))
    }

    fn product(&self, row: [f64; 3], k: usize) -> f64 {
        row.iter().zip(&self.0).fold(0.0, |sum, (x, of)| sum + x * of[k])
    }

    /// Where a point goes.
    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let moved: [f64; 3] = from_fn(|k| self.product(p, k) + self.0[3][k]);
        let w = self.product(p, 3) + self.0[3][3];
        if w == 1.0 || w == 0.0 { moved } else { moved.map(|x| x / w) }
    }

    /// What becomes of a direction with its length.
    pub(super) fn vector(&self, v: [f64; 3]) -> [f64; 3] {
        from_fn(|k| self.product(v, k))
    }

    /// What normals are multiplied by before they are made unit again: the transposed inverse, here of cofactors, which
    /// exists also where the inverse does not.
    pub(super) fn of_normals(&self) -> Self {
        let m = &self.0;
        let minor = |i: usize, k: usize| {
            let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3);
            m[a][c] * m[b][d] - m[a][d] * m[b][c]
        };
        let sign = if self.determinant() < 0.0 { -1.0 } else { 1.0 };
        let mut matrix = Self::IDENTITY;
        for i in 0..3 {
            for k in 0..3 {
                matrix.0[i][k] = sign * minor(i, k);
            }
        }
        matrix
    }

    /// Of the three axes: negative if it mirrors.
    pub(super) fn determinant(&self) -> f64 {
        let m = &self.0;
        let cofactor = |k: usize| {
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            m[1][a] * m[2][b] - m[1][b] * m[2][a]
        };
        (0..3).fold(0.0, |sum, k| sum + m[0][k] * cofactor(k))
    }

    /// By how much lengths grow, on average over directions.
    pub(super) fn size(&self) -> f64 {
        libm::cbrt(self.determinant().abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn turns_go_from_each_axis_to_the_next() {
        for axis in 0..3 {
            let unit = |k: usize| from_fn(|j| f64::from(u8::from(j == k % 3)));
            assert!(close(Matrix::rotation(axis, 90.0).point(unit(axis + 1)), unit(axis + 2)), "{axis}");
        }
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turn = Matrix::orientation([0.0, 0.0, half, half]);
        assert!(close(turn.point([1.0, 0.0, 0.0]), Matrix::rotation(2, 90.0).point([1.0, 0.0, 0.0])));
    }

    #[test]
    fn an_inverse_undoes_and_a_flat_matrix_has_none() {
        let matrix = Matrix::scaling([2.0, -1.0, 4.0])
            .then(&Matrix::rotation(0, 30.0))
            .then(&Matrix::translation([1.0, 2.0, 3.0]));
        let back = matrix.inverse().unwrap();
        assert!(close(back.point(matrix.point([5.0, 6.0, 7.0])), [5.0, 6.0, 7.0]));
        assert!((matrix.determinant() + 8.0).abs() < 1e-12 && (matrix.size() - 2.0).abs() < 1e-12);
        assert_eq!(Matrix::scaling([1.0, 0.0, 1.0]).inverse(), None);
    }

    #[test]
    fn normals_stay_at_right_angles() {
        let matrix = Matrix::scaling([1.0, 4.0, 1.0]).then(&Matrix::rotation(2, 20.0));
        let along = matrix.vector([1.0, 1.0, 0.0]);
        let normal = matrix.of_normals().vector([1.0, -1.0, 0.0]);
        assert!(along.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>().abs() < 1e-12);
        let mirrored = Matrix::scaling([-1.0, 1.0, 1.0]).of_normals().vector([0.0, 1.0, 0.0]);
        assert_eq!(mirrored, [0.0, 1.0, 0.0]);
    }
}
