//! Smoothing by Chebyshev polynomials of D⁻¹A (Adams, Brezina, Hu and Tuminaro 2003).

/// A smoother that takes as much as a polynomial can from errors of some eigenvalues of D⁻¹A.
pub(crate) struct Chebyshev {
    /// The largest of these eigenvalues.
    pub largest: f64,
    /// Its ratio to the smallest.
    pub ratio: f64,
    /// Number of steps.
    pub degree: usize,
}

/// A step: the last one · `decay` + D⁻¹ · residual · `gain`.
#[derive(Clone, Copy)]
pub(crate) struct Weights {
    pub decay: f32,
    pub gain: f32,
}

impl Chebyshev {
    /// The weights of successive steps.
    pub(crate) fn steps(&self) -> impl Iterator<Item = Weights> {
        let smallest = self.largest / self.ratio;
        let (middle, half) = (0.5 * (self.largest + smallest), 0.5 * (self.largest - smallest));
        let mut rho = half / middle;
        (0..self.degree).map(move |step| {
            if step == 0 {
                return Weights { decay: 0.0, gain: (1.0 / middle) as f32 };
            }
            let before = rho;
            rho = 1.0 / (2.0 * middle / half - rho);
            Weights { decay: (rho * before) as f32, gain: (2.0 * rho / half) as f32 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of errors on the interval 1/T(middle ÷ half) is left at most, with the Chebyshev polynomial T of as many steps: from 1 to
    /// 10, 1/T₃(11/9) = 1/(4·(11/9)³ − 3·(11/9)) = 0.27499.
    #[test]
    fn no_polynomial_leaves_less() {
        let smoother = Chebyshev { largest: 2.0, ratio: 10.0, degree: 3 };
        let left = |eigenvalue: f64| {
            let (mut error, mut step) = (1.0, 0.0);
            for Weights { decay, gain } in smoother.steps() {
                step = f64::from(decay) * step - f64::from(gain) * eigenvalue * error;
                error += step;
            }
            f64::abs(error)
        };
        let most = (0..=1000).map(|n| left(0.2 + 1.8e-3 * f64::from(n))).fold(0.0, f64::max);
        assert!((most - 0.27499).abs() < 1e-5, "{most}");
        assert!((left(0.2) - most).abs() < 1e-6 && (left(2.0) - most).abs() < 1e-6);
    }
}
