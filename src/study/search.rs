//! Which settings are cooked: all of a small grid, else those that a search visits.

use super::bench::Stop;
use super::knobs::Knob;
use super::model::{Axis, Expected, Law, Model};
use super::outcome::Goal;

/// A grid with more settings is searched instead.
pub(super) const MOST_RUNS: usize = 64;

/// The same where one setting is asked for, which a search finds without the others.
const MOST_WITH_GOAL: usize = 8;

/// The number of settings of a grid; `None` if it is searched. All values of a single knob are cooked.
pub(super) fn grid_size(knobs: &[Knob], goal: Goal) -> Option<usize> {
    let most = if goal == Goal::None || knobs.len() < 2 { MOST_RUNS } else { MOST_WITH_GOAL };
    let product = knobs.iter().try_fold(1_usize, |product, knob| product.checked_mul(knob.values.len()));
    product.filter(|product| *product <= most)
}

/// The best value of every knob.
pub(super) fn best(knobs: &[Knob]) -> Vec<usize> {
    knobs.iter().map(Knob::best).collect()
}

/// All settings of a grid, coarsest first; the last knob varies fastest.
pub(super) fn grid(knobs: &[Knob]) -> Vec<Vec<usize>> {
    knobs.iter().fold(vec![Vec::new()], |settings, knob| {
        let extended = |setting: &Vec<usize>| {
            let setting = setting.clone();
            (0..knob.values.len()).map(move |value| setting.iter().copied().chain([value]).collect())
        };
        settings.iter().flat_map(extended).collect()
    })
}

/// What the search looks for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub(super) goal: Goal,
    /// Errors below it count as it.
    pub(super) floor: f64,
}

/// Error and time of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) error: f64,
    pub(super) ms: f64,
}

/// Measures a setting; `None` where it failed.
pub(super) type Measured<'a> = &'a mut dyn FnMut(&[usize]) -> Result<Option<Point>, Stop>;

/// Settings of a grid up to which all are predicted.
const MOST_PREDICTED: usize = 1 << 15;

/// The least gain that is worth another cook: the share of the time, or of the error, that it is expected to save.
const LEAST_GAIN: f64 = 0.01;

/// The same as a share of its price: what it adds to the time of all cooks so far.
const LEAST_OF_PRICE: f64 = 0.05;

/// Which share of its price is taken from the gain of a cook, to choose between several.
const PRICE: f64 = 3.0;

/// The share of what the whole grid would take beyond which a cook must be expected to save as large a share as the search has
/// then taken.
const MOST_OF_GRID: f64 = 0.25;

/// The same where the best setting, which has to be cooked, takes about as much by itself: this many times what it takes.
const MORE_THAN_BEST: f64 = 1.25;

/// How many deviations below its expectation the time of what was not cooked is taken for that share: three times in four it is
/// not less.
const DOUBT: f64 = 0.674;

/// Searches a grid for the cheapest setting within a tolerance, or the most accurate within a budget. The best setting is
/// cooked for the floor, the coarsest because it may do, and then one after the other the setting of which most is expected:
/// the chance that it meets the goal times what it would save. The search ends where no setting is worth a cook; once a quarter of
/// what the whole grid would take is spent, few are. Without a goal it goes along each knob with the others at their best.
pub(super) fn search(knobs: &[Knob], target: &dyn Fn() -> Target, measure: Measured<'_>) -> Result<(), Stop> {
    let best = best(knobs);
    let mut cooked = vec![(best.clone(), measure(&best)?)];
    let Target { goal, floor } = target();
    if goal == Goal::None {
        return along_each(knobs, &best, measure);
    }
    if matches!(goal, Goal::Tolerance(tolerance) if tolerance < floor) {
        // Nothing can be claimed, whatever is cooked.
        return Ok(());
    }
    let product = knobs.iter().try_fold(1_usize, |product, knob| product.checked_mul(knob.values.len()));
    if product.is_none_or(|product| product > MOST_PREDICTED) {
        return along_each(knobs, &best, measure);
    }
    let axes: Vec<Axis> = knobs.iter().map(Axis::of).collect();
    let grid = grid(knobs);
    let mut next = Some(vec![0; knobs.len()]);
    while let Some(setting) = next.filter(|_| cooked.len() < MOST_RUNS) {
        let found = measure(&setting)?;
        cooked.push((setting, found));
        next = most_promising(&grid, &axes, &cooked, target());
    }
    Ok(())
}

/// Measures the values of each knob with the others at their best, finest first.
fn along_each(knobs: &[Knob], best: &[usize], measure: Measured<'_>) -> Result<(), Stop> {
    let mut left = MOST_RUNS - 1;
    for (place, knob) in knobs.iter().enumerate() {
        for value in (0..knob.best()).rev().take(left.min(knob.best())) {
            let mut setting = best.to_vec();
            setting[place] = value;
            measure(&setting)?;
            left -= 1;
        }
    }
    Ok(())
}

/// The setting whose cook is expected to gain most; `None` if none is worth it.
fn most_promising(
    grid: &[Vec<usize>],
    axes: &[Axis],
    cooked: &[(Vec<usize>, Option<Point>)],
    Target { goal, floor }: Target,
) -> Option<Vec<usize>> {
    let done: Vec<(&[usize], Point)> =
        cooked.iter().filter_map(|(setting, point)| Some((&setting[..], (*point)?))).collect();
    // A logarithm needs a positive number.
    let number = |law: Law, point: &Point| match law {
        Law::Error => point.error.max(floor).max(f64::MIN_POSITIVE),
        Law::Time => point.ms.max(f64::MIN_POSITIVE),
    };
    let fitted = |law: Law| {
        let numbers = done.iter().map(|(setting, point)| (*setting, number(law, point)));
        Model::fit(law, axes, &numbers.collect::<Vec<_>>())
    };
    let (errors, times) = (fitted(Law::Error), fitted(Law::Time));
    let (bounded, most, saves, least) = match goal {
        Goal::Tolerance(tolerance) => (Law::Error, tolerance, Law::Time, 0.0),
        Goal::Budget(budget) => (Law::Time, budget, Law::Error, floor),
        Goal::None => return None,
    };
    let expected = |law: Law, setting: &[usize]| match law {
        Law::Error => errors.expected(setting),
        Law::Time => times.expected(setting),
    };
    let meets = |point: &Point| number(bounded, point) <= most;
    let found = done.iter().filter(|(_, point)| meets(point)).map(|(_, point)| number(saves, point));
    let found = found.fold(f64::INFINITY, f64::min);
    let gain = |setting: &[usize]| {
        let chance = expected(bounded, setting).is_at_most(most);
        // All of it where nothing was found.
        let saved = if found.is_finite() { 1.0 - expected(saves, setting).number().max(least) / found } else { 1.0 };
        chance * saved
    };
    let spent: f64 = done.iter().map(|(_, point)| point.ms).sum();
    let untried = grid.iter().filter(|setting| cooked.iter().all(|(known, _)| known != *setting));
    let untried: Vec<(&Vec<usize>, Expected)> = untried.map(|setting| (setting, times.expected(setting))).collect();
    let at_least = |time: &Expected| libm::exp(time.log - DOUBT * time.deviation);
    let whole: f64 = spent + untried.iter().map(|(_, time)| at_least(time)).sum::<f64>();
    // The best was cooked first.
    let of_best = cooked.first().and_then(|(_, point)| *point).map_or(0.0, |point| point.ms);
    let usual = (MOST_OF_GRID * whole).max(MORE_THAN_BEST * of_best);
    let worth = |setting: &[usize], time: &Expected| {
        let (gain, price) = (gain(setting), time.number() / spent);
        let share = (spent + time.number()) / usual;
        let least = if share > 1.0 { MOST_OF_GRID * share } else { LEAST_GAIN.max(LEAST_OF_PRICE * price) };
        (gain >= least).then_some(gain - PRICE * price)
    };
    let worthy = untried.iter().filter_map(|(setting, time)| Some((worth(setting, time)?, *setting)));
    worthy.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, setting)| setting.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knobs(counts: &[usize]) -> Vec<Knob> {
        let graph = engine::graph::Graph::default();
        let values = |count: &usize| (1..=*count).map(|value| value.to_string()).collect::<Vec<_>>().join(",");
        let knob = |count: &usize| Knob::new(&format!("a.b={}", values(count)).parse().unwrap(), &graph);
        counts.iter().map(knob).collect()
    }

    #[test]
    fn a_grid_has_every_setting_once_and_the_last_is_the_best() {
        let knobs = knobs(&[2, 3]);
        let grid = grid(&knobs);
        assert_eq!((grid.len(), grid_size(&knobs, Goal::Tolerance(1.0))), (6, Some(6)));
        assert_eq!((&grid[1], grid.last()), (&vec![0, 1], Some(&best(&knobs))));
        assert_eq!(grid_size(&self::knobs(&[13, 5]), Goal::None), None);
        assert_eq!(grid_size(&self::knobs(&[3, 3]), Goal::None), Some(9));
        assert_eq!(grid_size(&self::knobs(&[3, 3]), Goal::Budget(1.0)), None);
        assert_eq!(grid_size(&self::knobs(&[9]), Goal::Budget(1.0)), Some(9));
    }

    #[test]
    fn the_search_finds_the_cheapest_setting_within_a_tolerance_in_few_runs() {
        // Errors add up, times multiply: of 100 settings the cheapest within 0.07 is a = 5, b = 3.
        let knobs = knobs(&[10, 10]);
        let mut measured = Vec::new();
        let mut measure = |setting: &[usize]| {
            measured.push(setting.to_vec());
            let [a, b] = [setting[0] as f64 + 1.0, setting[1] as f64 + 1.0];
            Ok(Some(Point { error: 1.0 / (a * a) + 0.25 / (b * b), ms: a * b }))
        };
        let target = || Target { goal: Goal::Tolerance(0.07), floor: 0.0 };
        search(&knobs, &target, &mut measure).unwrap();
        assert!(measured.contains(&vec![4, 2]) && measured.len() < 16, "{measured:?}");
    }
}
