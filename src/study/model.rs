//! What a search expects of settings that it has not cooked: their error and time, and how sure that is.
//!
//! Each knob adds to the error by itself, by a power of its step (its order, from what its node declares until the runs show
//! another); time is a product of powers. What runs differ from these powers is interpolated between them, as a Gaussian
//! process in the positions of values: near a run the expectation is that run, far from all runs it is the powers alone.

use super::knobs::Knob;

/// A number that is expected: its logarithm, and the deviation of that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected {
    pub(super) log: f64,
    pub(super) deviation: f64,
}

impl Expected {
    /// The probability that the number is at most this.
    pub(super) fn is_at_most(&self, most: f64) -> f64 {
        let deviations = (libm::log(most) - self.log) / self.deviation;
        0.5 * libm::erfc(-deviations / std::f64::consts::SQRT_2)
    }

    /// The number itself.
    pub(super) fn number(&self) -> f64 {
        libm::exp(self.log)
    }
}

/// A knob as the powers see it.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// For each value the logarithm of how many times finer than the first it is.
    pub(super) finer: Vec<f64>,
    /// The order to begin with.
    pub(super) order: f64,
}

impl Axis {
    /// Words, and numbers of both signs, count as if each halved the step.
    pub(super) fn of(knob: &Knob) -> Self {
        let steps: Option<Vec<f64>> = knob.values.iter().map(|value| knob.step_of(value)).collect();
        let finer = match steps {
            Some(steps) => steps.iter().map(|step| libm::log(steps[0] / step)).collect(),
            None => (0..knob.values.len()).map(|place| place as f64 * std::f64::consts::LN_2).collect(),
        };
        Self { finer, order: knob.accuracy.and_then(|accuracy| accuracy.order).unwrap_or(1.0) }
    }
}

/// How powers of steps make up a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Law {
    /// A sum of powers that fall.
    Error,
    /// A product of powers that rise.
    Time,
}

impl Law {
    /// How far a number is from its law before any run is near, as a deviation of logarithms.
    fn deviation(self) -> f64 {
        match self {
            Self::Error => 0.6,
            Self::Time => 0.25,
        }
    }

    /// The logarithm of the number: `numbers` holds a scale and a power for each axis.
    fn log(self, numbers: &[f64], axes: &[Axis], setting: &[usize]) -> f64 {
        let finer = |place: usize| axes[place].finer[setting[place]];
        let powers = numbers.chunks_exact(2).enumerate();
        match self {
            Self::Error => {
                let logs: Vec<f64> = powers.map(|(place, pair)| pair[0] - libm::exp(pair[1]) * finer(place)).collect();
                let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                most + libm::log(logs.iter().map(|log| libm::exp(log - most)).sum::<f64>())
            }
            Self::Time => powers.map(|(place, pair)| pair[0] + libm::exp(pair[1]) * finer(place)).sum(),
        }
    }
}

/// The law fitted to runs, and what they differ from it.
pub(super) struct Model<'a> {
    law: Law,
    axes: &'a [Axis],
    /// A scale and the logarithm of a power for each axis.
    numbers: Vec<f64>,
    settings: Vec<&'a [usize]>,
    /// The lower triangle of the covariance's Cholesky factor.
    factor: Vec<Vec<f64>>,
    /// The inverse of the covariance times the residuals.
    weights: Vec<f64>,
}

/// Values this many positions apart still have 1/e of a residual in common.
const REACH: f64 = 3.0;

/// Keeps the covariance of equal rows apart, as a share of its diagonal.
const NUGGET: f64 = 1e-4;

impl<'a> Model<'a> {
    /// Fits a law to settings and the numbers that were measured there, which are positive.
    pub(super) fn fit(law: Law, axes: &'a [Axis], runs: &[(&'a [usize], f64)]) -> Self {
        let logs: Vec<f64> = runs.iter().map(|(_, number)| libm::log(*number)).collect();
        let settings: Vec<&[usize]> = runs.iter().map(|(setting, _)| *setting).collect();
        let numbers = fitted(law, axes, &settings, &logs);
        let variance = law.deviation() * law.deviation();
        let mut factor: Vec<Vec<f64>> = Vec::new();
        for (row, setting) in settings.iter().enumerate() {
            let mut entries = Vec::with_capacity(row + 1);
            for column in 0..=row {
                let mut rest = variance * correlation(setting, settings[column]);
                if column == row {
                    rest += NUGGET * variance;
                }
                let other: &[f64] = factor.get(column).map_or(&[], Vec::as_slice);
                for k in 0..column {
                    rest -= entries[k] * if column == row { entries[k] } else { other[k] };
                }
                entries.push(if column == row { rest.max(1e-12).sqrt() } else { rest / other[column] });
            }
            factor.push(entries);
        }
        let residuals = settings.iter().zip(&logs).map(|(setting, log)| log - law.log(&numbers, axes, setting));
        let mut weights = solved_below(&factor, residuals.collect());
        for row in (0..factor.len()).rev() {
            let rest = weights[row] - (row + 1..factor.len()).map(|k| factor[k][row] * weights[k]).sum::<f64>();
            weights[row] = rest / factor[row][row];
        }
        Self { law, axes, numbers, settings, factor, weights }
    }

    /// What is expected of a setting.
    pub(super) fn expected(&self, setting: &[usize]) -> Expected {
        let variance = self.law.deviation() * self.law.deviation();
        let common: Vec<f64> = self.settings.iter().map(|known| variance * correlation(setting, known)).collect();
        let residual: f64 = common.iter().zip(&self.weights).map(|(a, b)| a * b).sum();
        let explained: f64 = solved_below(&self.factor, common).iter().map(|x| x * x).sum();
        let log = self.law.log(&self.numbers, self.axes, setting) + residual;
        Expected { log, deviation: (variance * (1.0 + NUGGET) - explained).max(1e-9).sqrt() }
    }
}

fn correlation(a: &[usize], b: &[usize]) -> f64 {
    let apart: usize = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).sum();
    libm::exp(-(apart as f64) / REACH)
}

/// Solves with the lower triangle.
fn solved_below(factor: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
    for (row, entries) in factor.iter().enumerate() {
        let rest = right[row] - (0..row).map(|k| entries[k] * right[k]).sum::<f64>();
        right[row] = rest / entries[row];
    }
    right
}

/// The scales and powers that fit best, not far from those to begin with: least squares by steps along one number after the
/// other, which halve.
fn fitted(law: Law, axes: &[Axis], settings: &[&[usize]], logs: &[f64]) -> Vec<f64> {
    let count = axes.len() as f64;
    let start = match law {
        // At the first values each knob has the same share.
        Law::Error => logs.iter().copied().fold(f64::NEG_INFINITY, f64::max) - libm::log(count),
        Law::Time => logs.iter().copied().fold(f64::INFINITY, f64::min) / count,
    };
    let power = |axis: &Axis| match law {
        Law::Error => libm::log(axis.order),
        Law::Time => libm::log(0.5),
    };
    let usual: Vec<f64> = axes.iter().flat_map(|axis| [start, power(axis)]).collect();
    // How far scales and powers are expected from where they begin.
    let far = match law {
        Law::Error => [3.0, 0.5],
        Law::Time => [10.0, 1.0],
    };
    let variance = law.deviation() * law.deviation();
    let misfit = |numbers: &[f64]| {
        let of_run = |(setting, log): (&&[usize], &f64)| {
            let residual = log - law.log(numbers, axes, setting);
            residual * residual / variance
        };
        let of_number = |(place, (x, usual)): (usize, (&f64, &f64))| {
            let share = (x - usual) / far[place % 2];
            share * share
        };
        let fit: f64 = settings.iter().zip(logs).map(of_run).sum();
        fit + numbers.iter().zip(&usual).enumerate().map(of_number).sum::<f64>()
    };
    let (mut numbers, mut step) = (usual.clone(), 1.0);
    let mut least = misfit(&numbers);
    const FINEST: f64 = 0.01;
    const MOST_ROUNDS: usize = 400;
    for _ in 0..MOST_ROUNDS {
        let mut has_improved = false;
        for place in 0..numbers.len() {
            for change in [step, -step] {
                let before = numbers[place];
                numbers[place] += change;
                let found = misfit(&numbers);
                if found < least {
                    (least, has_improved) = (found, true);
                } else {
                    numbers[place] = before;
                }
            }
        }
        if !has_improved {
            step /= 2.0;
            if step < FINEST {
                break;
            }
        }
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Vec<Axis> {
        let finer: Vec<f64> = (0..6).map(|k| f64::from(k) * std::f64::consts::LN_2).collect();
        vec![Axis { finer: finer.clone(), order: 1.0 }, Axis { finer, order: 2.0 }]
    }

    /// Errors of first and second order that add up.
    fn error([a, b]: [usize; 2]) -> f64 {
        libm::exp2(-(a as f64)) + 0.1 * libm::exp2(-2.0 * b as f64)
    }

    #[test]
    fn a_few_runs_show_what_the_others_err() {
        let axes = axes();
        let known = [[0, 0], [5, 5], [2, 2], [5, 0]];
        let runs: Vec<(&[usize], f64)> = known.iter().map(|setting| (&setting[..], error(*setting))).collect();
        let model = Model::fit(Law::Error, &axes, &runs);
        for (setting, number) in &runs {
            let expected = model.expected(setting);
            assert!((expected.number() / number - 1.0).abs() < 1e-3 && expected.deviation < 0.02, "{expected:?}");
        }
        for setting in [[1, 1], [3, 0], [4, 4], [0, 5]] {
            let expected = model.expected(&setting);
            let off = (expected.log - libm::log(error(setting))).abs();
            assert!(off < 2.0 * expected.deviation && off < 0.4, "{setting:?}: {expected:?} {}", error(setting));
        }
    }

    #[test]
    fn times_multiply() {
        let axes = axes();
        let ms = |[a, b]: [usize; 2]| libm::exp2(2.0 * a as f64 + 0.5 * b as f64);
        let known = [[0, 0], [5, 5], [2, 0]];
        let runs: Vec<(&[usize], f64)> = known.iter().map(|setting| (&setting[..], ms(*setting))).collect();
        let model = Model::fit(Law::Time, &axes, &runs);
        for setting in [[1, 1], [4, 2], [5, 0]] {
            let ratio = model.expected(&setting).number() / ms(setting);
            assert!((0.5..2.0).contains(&ratio), "{setting:?}: {ratio}");
        }
        assert!(model.expected(&[0, 5]).is_at_most(1e3) > 0.99 && model.expected(&[5, 5]).is_at_most(1e3) < 0.01);
    }
}
