//! Small symmetric matrices, factored.

/// L·D·Lᵀ of a symmetric positive semidefinite matrix.
#[derive(Clone, Debug)]
pub(crate) struct DenseFactors {
    /// The rows of L below its diagonal of ones.
    lower: Vec<f64>,
    /// 1/D; 0 where a pivot is rounding alone, so that the solution has no share of what the matrix takes to 0.
    inverse_pivots: Vec<f64>,
}

/// Share of a diagonal entry below which a pivot is rounding alone.
const ROUNDING: f64 = 1e-6;

impl DenseFactors {
    /// Factors the matrix whose rows are in `rows`; what is above the diagonal is not read.
    pub(crate) fn new(mut rows: Vec<f64>, n: usize) -> Self {
        let inverse_pivots = factor(&mut rows, n);
        Self { lower: rows, inverse_pivots }
    }

    /// Replaces the right-hand side `x` by the solution.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let n = self.inverse_pivots.len();
        for row in 0..n {
            let known: f64 = (0..row).map(|column| self.lower[row * n + column] * x[column]).sum();
            x[row] -= known;
        }
        for (x, inverse) in x.iter_mut().zip(&self.inverse_pivots) {
            *x *= inverse;
        }
        for row in (0..n).rev() {
            let value = x[row];
            for column in 0..row {
                x[column] -= self.lower[row * n + column] * value;
            }
        }
    }
}

/// Replaces the entries below the diagonal by those of L; returns 1/D.
fn factor(rows: &mut [f64], n: usize) -> Vec<f64> {
    let mut inverse_pivots = vec![0.0; n];
    for row in 0..n {
        let (before, own) = rows.split_at_mut(row * n);
        let own = &mut own[..n];
        let diagonal = own[row];
        let mut pivot = diagonal;
        for column in 0..row {
            let other = &before[column * n..][..column];
            let known: f64 = (0..column).map(|k| own[k] * other[k]).sum();
            own[column] -= known;
        }
        for column in 0..row {
            let product = own[column];
            own[column] *= inverse_pivots[column];
            pivot -= product * own[column];
        }
        inverse_pivots[row] = if pivot > ROUNDING * diagonal { 1.0 / pivot } else { 0.0 };
    }
    inverse_pivots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_are_exact_and_without_a_share_of_the_null_space() {
        // 2 × the identity plus ones: x = (b − mean·3/5)/2 for n = 3.
        let n = 3;
        let rows = vec![3.0, 0.0, 0.0, 1.0, 3.0, 0.0, 1.0, 1.0, 3.0];
        let mut x = vec![1.0, 2.0, 6.0];
        DenseFactors::new(rows, n).solve(&mut x);
        assert!(x.iter().zip([-0.4, 0.1, 2.1]).all(|(x, e): (&f64, f64)| (x - e).abs() < 1e-14), "{x:?}");
        // A chain of two differences: known but for a constant.
        let chain = DenseFactors::new(vec![1.0, 0.0, 0.0, -1.0, 2.0, 0.0, 0.0, -1.0, 1.0], n);
        let mut x = vec![1.0, 0.0, -1.0];
        chain.solve(&mut x);
        assert!((x[0] - x[1] - 1.0).abs() < 1e-14 && (x[1] - x[2] - 1.0).abs() < 1e-14, "{x:?}");
    }
}
