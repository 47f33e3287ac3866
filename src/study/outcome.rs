//! What a study found: runs, floor, front, pick, slopes; and as JSON.

use serde_json::{Map, Value, json};

use super::bench::{Cost, Run, set_of};
use super::knobs::{self, Knob};
use super::norms::{Errors, Norm, Statistic};

/// What the pick is to satisfy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    /// The cheapest with an error of at most this.
    Tolerance(f64),
    /// The most accurate that takes at most this, in milliseconds a frame.
    Budget(f64),
    None,
}

impl Goal {
    /// The time by which settings are ranked, in milliseconds a frame: that of all processors for the cheapest, which other
    /// work on the machine lengthens least; that of the clock for a budget.
    pub(super) fn time(self, cost: &Cost) -> f64 {
        if matches!(self, Self::Tolerance(_)) { cost.cpu_ms } else { cost.ms }
    }

    /// Whether a run may be the one that is asked for, once times are known better.
    pub(super) fn is_near(self, runs: &[Run], place: usize, statistic: Statistic, floor: f64) -> bool {
        const NEAR: f64 = 1.5;
        let point = |run: &Run| {
            let (cost, errors) = run.result.as_ref().ok()?;
            Some((errors.get(statistic).max(floor), self.time(cost)))
        };
        let Some((error, time)) = point(&runs[place]) else { return false };
        let done = runs.iter().filter_map(point);
        match self {
            Self::Tolerance(tolerance) => {
                let within = done.filter(|(error, _)| *error <= tolerance).map(|(_, time)| time);
                error <= tolerance && time <= NEAR * within.fold(f64::INFINITY, f64::min)
            }
            Self::Budget(budget) => {
                let within = done.filter(|(_, time)| *time <= budget).map(|(error, _)| error);
                time <= NEAR * budget && error <= within.fold(f64::INFINITY, f64::min)
            }
            Self::None => true,
        }
    }
}

/// Of settings that take up to this many times as long as the cheapest, the most accurate is picked: times are not known
/// better, errors are.
const AS_CHEAP: f64 = 1.1;

/// A finished study, or one that was interrupted.
pub(super) struct Outcome {
    pub(super) graph: String,
    pub(super) output: String,
    pub(super) norm: Norm,
    pub(super) unit: &'static str,
    pub(super) frames: Vec<Value>,
    pub(super) knobs: Vec<Knob>,
    pub(super) reference: Vec<(String, String)>,
    /// What the reference is, in words.
    pub(super) why: String,
    /// `None` where it is not known.
    pub(super) floor: Option<Errors>,
    /// Whether the reference is a setting beyond the best, which converges as the runs do.
    pub(super) is_beyond: bool,
    /// What the storage of positions may change of an error.
    pub(super) rounding: f64,
    /// In the order of the grid.
    pub(super) runs: Vec<Run>,
    pub(super) front: Vec<usize>,
    pub(super) pick: Option<usize>,
    pub(super) goal: Goal,
}

/// A measured order of convergence.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Slope {
    pub(super) knob: String,
    pub(super) measured: f64,
    pub(super) declared: Option<f64>,
}

impl Slope {
    /// In words; an order that is clearly lower than declared is said to be.
    pub(super) fn describe(&self) -> String {
        const CLEARLY: f64 = 0.5;
        let declared = self.declared.map(|order| {
            let lower = if self.measured < order - CLEARLY { ": lower than declared" } else { "" };
            format!(", declared {}{lower}", crate::numbers::short(order))
        });
        format!("{:.2} measured{}", self.measured, declared.unwrap_or_default())
    }
}

impl Outcome {
    /// The error that the tolerance bounds, as it is; `None` for a failed run.
    pub(super) fn error(&self, run: usize) -> Option<f64> {
        self.runs[run].errors().map(|errors| errors.get(self.norm.statistic))
    }

    /// The floor of that error; 0 where it is unknown.
    pub(super) fn floor(&self) -> f64 {
        self.floor.map_or(0.0, |floor| floor.get(self.norm.statistic))
    }

    /// The time of a run in milliseconds a frame; `None` for a failed one.
    pub(super) fn ms(&self, run: usize) -> Option<f64> {
        self.runs[run].cost().map(|cost| cost.ms)
    }

    /// Finds the front and the pick. Errors below the floor count as the floor.
    pub(super) fn judge(&mut self) {
        let floor = self.floor();
        let mut done: Vec<(usize, f64, f64)> =
            (0..self.runs.len()).filter_map(|run| Some((run, self.ms(run)?, self.error(run)?.max(floor)))).collect();
        done.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)));
        let mut least = f64::INFINITY;
        self.front = Vec::new();
        for (run, _, error) in &done {
            if *error < least {
                least = *error;
                self.front.push(*run);
            }
        }
        let most_accurate =
            |a: &&(usize, f64, f64), b: &&(usize, f64, f64)| a.2.total_cmp(&b.2).then(a.1.total_cmp(&b.1));
        self.pick = match self.goal {
            Goal::Tolerance(tolerance) if self.floor.is_some() && tolerance < floor => None,
            Goal::Tolerance(tolerance) => {
                let time = |run: usize| self.runs[run].cost().map_or(f64::INFINITY, |cost| self.goal.time(cost));
                let within: Vec<_> = done.iter().filter(|(_, _, error)| *error <= tolerance).collect();
                let least = within.iter().map(|one| time(one.0)).fold(f64::INFINITY, f64::min);
                let as_cheap = within.into_iter().filter(|one| time(one.0) <= AS_CHEAP * least);
                as_cheap.min_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0))).map(|one| one.0)
            }
            Goal::Budget(budget) => {
                done.iter().filter(|(_, ms, _)| *ms <= budget).min_by(most_accurate).map(|one| one.0)
            }
            Goal::None => None,
        };
    }

    /// The run with the least error, of equal ones the fastest.
    pub(super) fn most_accurate(&self) -> Option<usize> {
        self.front.last().copied()
    }

    /// The runs along a knob with the others at their best, coarsest first.
    pub(super) fn along(&self, place: usize) -> Vec<usize> {
        let best: Vec<usize> = self.knobs.iter().map(Knob::best).collect();
        let is_along = |run: &&Run| (0..best.len()).all(|other| other == place || run.setting[other] == best[other]);
        let mut along: Vec<usize> =
            self.runs.iter().enumerate().filter(|(_, run)| is_along(run)).map(|(index, _)| index).collect();
        along.sort_by_key(|run| self.runs[*run].setting[place]);
        along
    }

    /// The measured order of each numeric knob, where enough of its errors are above the floor.
    pub(super) fn slopes(&self) -> Vec<Slope> {
        let of = |(place, knob): (usize, &Knob)| {
            let least = self.floor().max(self.rounding);
            let point = |run: usize| {
                let error = self.error(run).filter(|error| *error > 0.0 && *error >= least)?;
                Some((knob.step_of(&knob.values[self.runs[run].setting[place]])?, error))
            };
            let points: Vec<(f64, f64)> = self.along(place).into_iter().filter_map(point).collect();
            let beyond = self.reference.iter().find(|(key, _)| *key == knob.key).filter(|_| self.is_beyond);
            let beyond = beyond.and_then(|(_, value)| knob.step_of(value)).unwrap_or(0.0);
            let measured = order(&points, beyond)?;
            let declared = knob.accuracy.and_then(|accuracy| accuracy.order);
            Some(Slope { knob: knob.key.clone(), measured, declared })
        };
        self.knobs.iter().enumerate().filter_map(of).collect()
    }

    /// Plain words where the maximum, or every statistic, does not converge: the two nearest references, which are the best
    /// setting and what it is measured against, differ by about as much as coarser settings do.
    pub(super) fn chaos(&self) -> Option<String> {
        let best: Vec<usize> = self.knobs.iter().map(Knob::best).collect();
        let at_best = self.floor.and(self.runs.iter().find(|run| run.setting == best))?.errors()?;
        // The worst of the runs that are one value coarser along one knob.
        let steps = |run: &Run| run.setting.iter().zip(&best).map(|(value, best)| best - value).sum::<usize>();
        let near = self.runs.iter().filter(|run| steps(run) == 1).filter_map(Run::errors);
        let near = near.copied().reduce(|a, b| Errors {
            mean: a.mean.max(b.mean),
            p99: a.p99.max(b.p99),
            max: a.max.max(b.max),
        })?;
        let show = |error: f64| format!("{} {}", super::table::brief(error), self.unit).trim_end().to_owned();
        if at_best.mean > 0.8 * near.mean && at_best.max > 0.8 * near.max && at_best.mean > 4.0 * self.rounding {
            return Some(format!(
                "errors do not fall: the two nearest references differ by {} on average, about as much as the next coarser \
                 setting; the scene is chaotic at these settings, or the knobs do not control its error",
                show(at_best.mean)
            ));
        }
        (at_best.max > 0.5 * near.max && at_best.max > 20.0 * at_best.mean && at_best.max > 20.0 * self.rounding).then(|| {
            format!(
                "the maximum is chaotic: the two nearest references differ by {} at the worst point but by {} on average, and \
                 finer settings do not lower the maximum, as where a contact is made or missed; judge by the mean or p99",
                show(at_best.max),
                show(at_best.mean)
            )
        })
    }

    /// The settings of a run as JSON.
    fn settings(&self, run: &Run) -> Value {
        pairs_to_json(&set_of(&self.knobs, &run.setting))
    }

    /// As `--json` writes it.
    pub(super) fn to_json(&self) -> Value {
        let run = |run: &Run| match &run.result {
            Ok((cost, errors)) => json!({
                "settings": self.settings(run), "error": errors.to_json(), "ms": cost.ms, "cpu_ms": cost.cpu_ms,
                "peak_bytes": cost.peak_bytes,
                "nodes": cost.nodes.iter().map(|node| (node.id.clone(), json!(node.ms))).collect::<Map<String, Value>>(),
                "failed": null,
            }),
            Err(why) => json!({
                "settings": self.settings(run), "error": null, "ms": null, "cpu_ms": null, "peak_bytes": null, "nodes": {},
                "failed": why,
            }),
        };
        json!({
            "study": 1,
            "graph": self.graph,
            "output": self.output,
            "norm": self.norm.measure.name(),
            "unit": self.unit,
            "frames": self.frames,
            "knobs": self.knobs.iter().map(|knob| &knob.key).collect::<Vec<_>>(),
            "reference": {"settings": pairs_to_json(&self.reference), "why": self.why},
            "floor": self.floor.map_or_else(|| json!({"mean": null, "p99": null, "max": null}), Errors::to_json),
            "runs": self.runs.iter().map(run).collect::<Vec<_>>(),
            "front": self.front,
            "pick": self.pick,
        })
    }
}

fn pairs_to_json(pairs: &[(String, String)]) -> Value {
    pairs.iter().map(|(key, value)| (key.clone(), knobs::to_json(value))).collect::<Map<String, Value>>().into()
}

/// The order p of errors C·|hᵖ − bᵖ| at steps h, where b is the step of the reference: 0 for an exact one. Least squares of
/// the logarithms, so that each point counts the same. `None` for fewer than three points, or if no order fits.
pub(super) fn order(points: &[(f64, f64)], beyond: f64) -> Option<f64> {
    if points.len() < 3 {
        return None;
    }
    let count = points.len() as f64;
    let misfit = |p: f64| {
        let residuals = points.iter().map(|(step, error)| {
            // Relative to the step of the reference, so that no power underflows.
            let power = match beyond > 0.0 {
                true => (libm::pow(step / beyond, p) - 1.0).abs(),
                false => libm::pow(*step, p),
            };
            libm::log(*error) - libm::log(power)
        });
        let residuals: Vec<f64> = residuals.collect();
        let mean = residuals.iter().sum::<f64>() / count;
        residuals.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>()
    };
    const FINEST: f64 = 0.01;
    let tried = (1..=1000).map(|k| f64::from(k) * FINEST);
    let scored = tried.map(|p| (p, misfit(p))).filter(|(_, misfit)| misfit.is_finite());
    let (p, misfit) = scored.min_by(|a, b| a.1.total_cmp(&b.1))?;
    // Within a factor of 2 of the line, in the root mean square; at the end of the range there is no order.
    let is_line = (misfit / count).sqrt() < std::f64::consts::LN_2;
    (is_line && p > 2.0 * FINEST && p < 9.9).then_some(p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_of_first_order_that_declares_second_is_caught() {
        let points: Vec<(f64, f64)> = [1.0, 0.5, 0.25].iter().map(|h| (*h, 2.0 * (h - 0.125))).collect();
        let slope = |declared| Slope { knob: "a.b".into(), measured: order(&points, 0.125).unwrap(), declared };
        assert_eq!(slope(Some(2.0)).describe(), "1.00 measured, declared 2: lower than declared");
        assert_eq!(slope(Some(1.0)).describe(), "1.00 measured, declared 1");
    }

    #[test]
    fn an_order_is_found_against_an_exact_reference_and_one_beyond() {
        for p in [0.5_f64, 1.0, 2.0, 4.0] {
            let steps = [1.0, 0.5, 0.25, 0.125];
            let against = |beyond: f64| -> Vec<(f64, f64)> {
                let power = |h: f64| if h == 0.0 { 0.0 } else { libm::pow(h, p) };
                steps.iter().map(|h| (*h, 3.0 * (power(*h) - power(beyond)))).collect()
            };
            for beyond in [0.0, 0.0625] {
                let found = order(&against(beyond), beyond).unwrap();
                assert!((found - p).abs() < 0.011, "{p}: {found} against {beyond}");
            }
        }
        assert_eq!(order(&[(1.0, 1.0), (0.5, 0.5)], 0.0), None);
        assert_eq!(
            order(&[(1.0, 1.0), (0.5, 1.0), (0.25, 1.0)], 0.0),
            None,
            "an error that does not fall has no order"
        );
    }
}
