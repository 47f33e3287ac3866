//! Which settings are cooked: all of a small grid, else those that a search visits.

use super::bench::Stop;
use super::knobs::Knob;
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

/// How bad an error and a time are; the search looks for the least. Compared in order.
pub(super) type Score<'a> = &'a dyn Fn(f64, f64) -> [f64; 2];

/// Measures a setting: its error and time, `None` where it failed.
pub(super) type Measured<'a> = &'a mut dyn FnMut(&[usize]) -> Result<Option<(f64, f64)>, Stop>;

/// Settings of a grid up to which all are predicted.
const MOST_PREDICTED: usize = 1 << 20;

/// Predicted settings that are tried in a row without finding a better one.
const MOST_IN_VAIN: usize = 6;

/// Searches a grid: first along each knob with the others at their best, then the settings that these runs predict to be
/// best, one after the other. The prediction adds what each knob adds to the error, and multiplies by what it changes of the
/// time.
pub(super) fn search(knobs: &[Knob], score: Score<'_>, measure: Measured<'_>) -> Result<(), Stop> {
    let best = best(knobs);
    let Some(at_best) = measure(&best)? else { return Ok(()) };
    let mut left = MOST_RUNS - 1;
    let mut along = Vec::new();
    for (place, knob) in knobs.iter().enumerate() {
        let mut of_knob = vec![None; knob.values.len()];
        of_knob[knob.best()] = Some(at_best);
        for value in (0..knob.best()).rev().take(left.min(knob.best())) {
            let mut setting = best.clone();
            setting[place] = value;
            of_knob[value] = measure(&setting)?;
            left -= 1;
        }
        along.push(of_knob);
    }
    let predicted = |setting: &[usize]| -> Option<(f64, f64)> {
        let mut sum = at_best;
        for (of_knob, value) in along.iter().zip(setting) {
            let (error, ms) = of_knob[*value]?;
            sum = (sum.0 + error - at_best.0, sum.1 * ms / at_best.1);
        }
        Some((sum.0.max(0.0), sum.1))
    };
    let product = knobs.iter().try_fold(1_usize, |product, knob| product.checked_mul(knob.values.len()));
    if product.is_none_or(|product| product > MOST_PREDICTED) {
        return Ok(());
    }
    let is_known = |setting: &[usize]| setting.iter().zip(&best).filter(|(value, best)| value != best).count() < 2;
    let mut candidates: Vec<([f64; 2], Vec<usize>)> = grid(knobs)
        .into_iter()
        .filter(|setting| !is_known(setting))
        .filter_map(|setting| predicted(&setting).map(|(error, ms)| (score(error, ms), setting)))
        .collect();
    let order = |a: &[f64; 2], b: &[f64; 2]| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
    candidates.sort_by(|a, b| order(&a.0, &b.0));
    let known = along.iter().flatten().flatten().map(|(error, ms)| score(*error, *ms));
    let mut least = known.min_by(order).unwrap_or([f64::INFINITY; 2]);
    let mut in_vain = 0;
    for (expected, setting) in candidates.into_iter().take(left) {
        if order(&expected, &least).is_ge() || in_vain == MOST_IN_VAIN {
            break;
        }
        in_vain += 1;
        if let Some((error, ms)) = measure(&setting)? {
            let found = score(error, ms);
            if order(&found, &least).is_lt() {
                (least, in_vain) = (found, 0);
            }
        }
    }
    Ok(())
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
            Ok(Some((1.0 / (a * a) + 0.25 / (b * b), a * b)))
        };
        search(&knobs, &|error, ms| [(error - 0.07).max(0.0), ms], &mut measure).unwrap();
        assert!(measured.contains(&vec![4, 2]) && measured.len() < 25, "{measured:?}");
    }
}
