//! The course of a study: the reference, the runs, their repetitions.

use std::cell::Cell;
use std::path::Path;

use engine::graph::Graph;

use super::bench::{Cooked, Cost, Reference, Run, Stop, Subject, set_of};
use super::direction::{self, End};
use super::knobs::Knob;
use super::norms::{Errors, Norm, Statistic};
use super::outcome::{Goal, Outcome};
use super::search::{self, Point, Target};
use super::store::{Store, Stored};
use crate::failure::Failure;

/// How often each setting is cooked, unless `--repeats` says it.
pub(super) const REPEATS: u32 = 3;

/// Without `--repeats`, a setting is cooked again while all its cooks take less than this, in milliseconds.
pub(super) const LONG: f64 = 6e3;

/// About how many settings a search cooks, and how many of them again.
const SEARCHED: usize = 8;
const NEAR_PICK: usize = 2;

/// What the knobs need besides: key, setting, and the knob's key.
pub(super) fn needs(knobs: &[Knob], graph: &Graph) -> Vec<(String, String, String)> {
    let is_knob = |key: &str| knobs.iter().any(|knob| knob.key == key);
    let need = |knob: &Knob| knob.unmet_need(graph).map(|(key, value)| (key, value, knob.key.clone()));
    let mut needs: Vec<_> = knobs.iter().filter_map(need).filter(|(key, _, _)| !is_knob(key)).collect();
    needs.dedup_by(|a, b| a.0 == b.0);
    needs
}

/// About how many cooks a study takes, for the progress.
pub(super) fn planned_runs(knobs: &[Knob], goal: Goal, repeats: u32) -> usize {
    let repeats = repeats as usize;
    let along_each = || 1 + knobs.iter().map(Knob::best).sum::<usize>();
    let cooks = match (search::grid_size(knobs, goal), goal) {
        (Some(size), _) => size * repeats,
        (None, Goal::None) => along_each().min(search::MOST_RUNS) * repeats,
        (None, _) => SEARCHED + NEAR_PICK * (repeats - 1),
    };
    // And the reference.
    1 + cooks
}

/// A study in progress.
pub(super) struct Study<'a> {
    subject: &'a Subject<'a>,
    knobs: Vec<Knob>,
    goal: Goal,
    repeats: Option<u32>,
    store: Store,
    stored: Stored,
    reference: Option<Reference>,
}

/// What a study found.
pub(super) struct Found {
    pub(super) knobs: Vec<Knob>,
    pub(super) stored: Stored,
}

impl Found {
    /// What was found in a norm; the caller names graph, output, unit, frames and goal.
    pub(super) fn outcome(self, norm: Norm) -> Outcome {
        let Self { knobs, stored } = self;
        Outcome {
            graph: String::new(),
            output: String::new(),
            norm,
            unit: "m",
            frames: Vec::new(),
            knobs,
            reference: stored.reference,
            why: stored.why,
            floor: stored.floor,
            is_beyond: stored.is_beyond,
            rounding: stored.rounding,
            runs: stored.runs,
            front: Vec::new(),
            pick: None,
            goal: Goal::None,
        }
    }
}

impl<'a> Study<'a> {
    pub(super) fn new(
        subject: &'a Subject<'a>,
        knobs: Vec<Knob>,
        goal: Goal,
        graph: &Graph,
        store: &Path,
        repeats: Option<u32>,
    ) -> Self {
        let store = Store::new(store.to_owned(), subject, &knobs, graph);
        let stored = Stored { reversed: vec![false; knobs.len()], ..Stored::default() };
        Self { subject, knobs, goal, repeats, store, stored, reference: None }
    }

    /// Takes the runs of an earlier study with the same key; whether there are any.
    pub(super) fn resume(&mut self) -> bool {
        let Some(stored) = self.store.load() else { return false };
        let fits = |run: &Run| {
            run.setting.len() == self.knobs.len()
                && run.setting.iter().zip(&self.knobs).all(|(value, knob)| *value < knob.values.len())
        };
        if stored.reversed.len() != self.knobs.len() || !stored.runs.iter().all(fits) {
            return false;
        }
        self.reverse(&stored.reversed);
        self.stored = stored;
        !self.stored.runs.is_empty()
    }

    /// The number of settings cooked so far.
    pub(super) fn runs(&self) -> usize {
        self.stored.runs.len()
    }

    fn reverse(&mut self, reversed: &[bool]) {
        for (knob, reversed) in self.knobs.iter_mut().zip(reversed) {
            if *reversed {
                knob.values.reverse();
            }
        }
    }

    /// Cooks what is missing; whether it was interrupted.
    ///
    /// # Errors
    /// If the graph, the norm or a file is wrong.
    pub(super) fn measure(&mut self) -> Result<bool, Failure> {
        match self.all_runs() {
            Ok(()) => Ok(false),
            Err(Stop::Interrupted) => Ok(true),
            Err(Stop::Failure(failure)) => Err(failure),
        }
    }

    fn all_runs(&mut self) -> Result<(), Stop> {
        // First, because it gives the floor.
        self.once(&search::best(&self.knobs))?;
        let reversed = self.reversed()?;
        if reversed.contains(&true) {
            // All errors were measured against the wrong end.
            self.reverse(&reversed);
            let all = self.stored.reversed.iter().zip(&reversed).map(|(before, now)| before | now).collect();
            self.stored = Stored { reversed: all, ..Stored::default() };
            self.reference = None;
        }
        self.settings()?;
        let is_searched = search::grid_size(&self.knobs, self.goal).is_none();
        for round in 1..self.repeats.unwrap_or(REPEATS) {
            for place in 0..self.stored.runs.len() {
                // A search asks for one setting: the times of those that it may be.
                let runs = &self.stored.runs;
                if !is_searched || self.goal.is_near(runs, place, self.statistic(), self.floor()) {
                    self.again(place, round)?;
                }
            }
        }
        Ok(())
    }

    /// Cooks a run that has no more than `round` cooks once more, unless that takes long and is more than was asked for.
    fn again(&mut self, place: usize, round: u32) -> Result<(), Stop> {
        let frames = self.subject.request.frames.len() as f64;
        let run = &mut self.stored.runs[place];
        let Some(cost) = run.cost() else { return Ok(()) };
        let is_asked = self.repeats.is_some_and(|asked| round < asked);
        let is_long = !is_asked && cost.ms * frames * f64::from(cost.repeats) > LONG;
        if cost.repeats <= round && !is_long {
            self.subject.repeat(&self.knobs, run)?;
            self.store.save(&self.stored, false)?;
        }
        Ok(())
    }

    /// Which of the knobs that were not reversed yet had their values given from fine to coarse.
    fn reversed(&mut self) -> Result<Vec<bool>, Stop> {
        let best = search::best(&self.knobs);
        let mut reversed = vec![false; self.knobs.len()];
        for place in 0..self.knobs.len() {
            let knob = &self.knobs[place];
            let is_known = knob.accuracy.is_some() || knob.numbers().is_none() || self.stored.reversed[place];
            if is_known || knob.values.len() < 2 {
                continue;
            }
            let mut first = best.clone();
            first[place] = 0;
            self.once(&first)?;
            let Some([fine, coarse]) = self.ends(place, &first) else { continue };
            reversed[place] = match direction::is_reversed(&fine, &coarse) {
                Some(is_reversed) => is_reversed,
                None => {
                    // One time alone may be twice what the next is, whatever was asked for.
                    for round in 1..self.repeats.unwrap_or(REPEATS).max(REPEATS) {
                        for setting in [&first, &best] {
                            if let Some(run) = self.stored.runs.iter().position(|run| run.setting == *setting) {
                                self.again(run, round)?;
                            }
                        }
                    }
                    self.ends(place, &first).is_some_and(|[first, last]| direction::takes_longer(&first, &last))
                }
            };
        }
        Ok(reversed)
    }

    /// What the runs of a knob's first and last value show, `first` and the best.
    fn ends(&self, place: usize, first: &[usize]) -> Option<[End; 2]> {
        let best = search::best(&self.knobs);
        let end = |setting: &[usize]| {
            let run = self.stored.runs.iter().find(|run| run.setting == setting)?;
            End::of(run, &self.knobs[place].node, self.stored.is_beyond)
        };
        Some([end(first)?, end(&best)?])
    }

    fn statistic(&self) -> Statistic {
        self.subject.norm.statistic
    }

    /// The floor of the statistic that counts; 0 where it is unknown.
    fn floor(&self) -> f64 {
        self.stored.floor.map_or(0.0, |floor| floor.get(self.statistic()))
    }

    /// Cooks each setting once.
    fn settings(&mut self) -> Result<(), Stop> {
        let best = search::best(&self.knobs);
        self.once(&best)?;
        let knobs = self.knobs.clone();
        if search::grid_size(&knobs, self.goal).is_some() {
            return search::grid(&knobs).iter().try_for_each(|setting| self.once(setting).map(|_| ()));
        }
        let (goal, statistic) = (self.goal, self.statistic());
        let floor = Cell::new(self.floor());
        let mut measure = |setting: &[usize]| {
            let run = self.once(setting)?;
            let point = |(cost, errors): &(Cost, Errors)| Point { error: errors.get(statistic), ms: goal.time(cost) };
            let point = run.result.as_ref().ok().map(point);
            floor.set(self.floor());
            Ok(point)
        };
        search::search(&knobs, &|| Target { goal, floor: floor.get() }, &mut measure)
    }

    /// The run of a setting, cooked unless it was already.
    fn once(&mut self, setting: &[usize]) -> Result<&Run, Stop> {
        let place = match self.stored.runs.iter().position(|run| run.setting == setting) {
            Some(place) => place,
            None => {
                self.make_reference()?;
                let Some(reference) = &self.reference else { return Err(Stop::Interrupted) };
                let run = self.subject.run(&self.knobs, setting, reference)?;
                if setting == search::best(&self.knobs) && self.stored.is_beyond {
                    self.stored.floor = run.errors().copied();
                }
                self.stored.runs.push(run);
                self.store.save(&self.stored, false)?;
                self.stored.runs.len() - 1
            }
        };
        Ok(&self.stored.runs[place])
    }

    /// Cooks the reference, unless that was done: an exact method, else one value beyond the best of each knob, else the
    /// best, else the finest setting that can be cooked.
    fn make_reference(&mut self) -> Result<(), Stop> {
        if self.reference.is_some() {
            return Ok(());
        }
        let knobs = &self.knobs;
        let is_knob = |key: &str| knobs.iter().any(|knob| knob.key == key);
        let mut set = set_of(knobs, &search::best(knobs));
        let (mut exact, mut beyond, mut without) = (Vec::new(), Vec::new(), Vec::new());
        for (knob, (_, value)) in knobs.iter().zip(&mut set) {
            if let Some((key, word)) = knob.exact().filter(|(key, _)| !is_knob(key)) {
                exact.push((key, word));
            } else if let Some(next) = knob.beyond() {
                beyond.push(format!("{} {next}", knob.key));
                *value = next;
            } else {
                without.push(knob.key.as_str());
            }
        }
        set.extend(exact.iter().cloned());
        let described = |pairs: &[(String, String)]| {
            pairs.iter().map(|(key, value)| format!("{key} {value}")).collect::<Vec<_>>().join(", ")
        };
        if !exact.is_empty() || !beyond.is_empty() {
            match self.subject.reference(&set)? {
                Cooked::Done(reference) => {
                    let is_exact = beyond.is_empty() && without.is_empty();
                    let measure = &self.subject.norm.measure;
                    let mut why = match is_exact {
                        true => format!("exact: {}; the floor is {}", described(&exact), measure.rounding_name()),
                        false => format!(
                            "one beyond the best setting: {}; the floor is the best setting's difference from it",
                            beyond
                                .iter()
                                .cloned()
                                .chain(exact.iter().map(|(key, word)| format!("{key} {word}")))
                                .collect::<Vec<_>>()
                                .join(", ")
                        ),
                    };
                    if !without.is_empty() {
                        why += &format!(" (nothing is beyond the best of {})", without.join(", "));
                    }
                    self.stored.is_beyond = !is_exact;
                    self.stored.rounding = reference.rounding(measure);
                    let rounding = self.stored.rounding;
                    self.stored.floor = is_exact.then_some(Errors { mean: rounding, p99: rounding, max: rounding });
                    (self.stored.reference, self.stored.why, self.reference) = (set, why, Some(reference));
                    return Ok(());
                }
                Cooked::Failed(failed) => return self.make_finest_reference(&format!("beyond it: {failed}")),
            }
        }
        self.make_finest_reference("nothing is beyond it")
    }

    /// Takes the finest setting that can be cooked.
    fn make_finest_reference(&mut self, reason: &str) -> Result<(), Stop> {
        (self.stored.is_beyond, self.stored.floor) = (false, None);
        let best = search::best(&self.knobs);
        let mut settings = match search::grid_size(&self.knobs, Goal::None) {
            Some(_) => search::grid(&self.knobs),
            None => vec![best.clone()],
        };
        settings.sort_by_key(|setting| best.iter().zip(setting).map(|(best, value)| best - value).sum::<usize>());
        let mut last = String::new();
        for setting in settings {
            let set = set_of(&self.knobs, &setting);
            match self.subject.reference(&set)? {
                Cooked::Done(reference) => {
                    let what = if setting == best {
                        "the best setting itself"
                    } else {
                        "the finest setting that can be cooked"
                    };
                    let why = format!("{what}, whose own error is unknown ({reason})");
                    (self.stored.reference, self.stored.why, self.reference) = (set, why, Some(reference));
                    return Ok(());
                }
                Cooked::Failed(why) => last = why,
            }
        }
        // Each run then fails for itself, and stays in the table with its reason.
        self.stored.why = format!("none: no setting could be cooked ({last})");
        self.reference = Some(Reference::default());
        Ok(())
    }

    /// Writes the runs, and returns them in the order of the grid.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn finish(mut self) -> Result<Found, Failure> {
        self.store.save(&self.stored, true)?;
        self.stored.runs.sort_by(|a, b| a.setting.cmp(&b.setting));
        Ok(Found { knobs: self.knobs, stored: self.stored })
    }
}
