//! Runs: cooks a setting, measures its time, and its error against the reference.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use engine::clock::Stopwatch;
use engine::cook::{Delivered, Report, Stopped};
use engine::geometry::Geometry;
use engine::graph::{Catalogue, Fault, Graph, fault::code};
use engine::memory::Ceiling;
use engine::plan::Request;
use engine::time::Frame;

use super::knobs::{Knob, settings};
use super::norms::{self, Differences, Errors, Measure, Norm};
use crate::failure::{Exit, Failure};
use crate::load;
use crate::progress::Progress;

/// Why a study stops.
#[derive(Debug)]
pub(super) enum Stop {
    Failure(Failure),
    /// Ctrl-C.
    Interrupted,
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Self::Failure(failure)
    }
}

/// Everything that the runs of a study share.
pub(super) struct Subject<'a> {
    pub(super) catalogue: Catalogue,
    pub(super) bytes: &'a [u8],
    pub(super) path: &'a Path,
    /// What `--set` overrides in all runs, and what the knobs need.
    pub(super) fixed: Vec<(String, String)>,
    pub(super) request: Request,
    pub(super) norm: Norm,
    pub(super) threads: usize,
    pub(super) ceiling: Ceiling,
    pub(super) cancel: Arc<AtomicBool>,
    pub(super) progress: Progress,
    /// What the first run leaves out that has points or curves without counterpart in the reference.
    pub(super) unmatched: OnceLock<String>,
}

/// Time and memory of a run; times are milliseconds a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cost {
    pub(super) ms: f64,
    pub(super) cpu_ms: f64,
    pub(super) peak_bytes: usize,
    /// By node, in the order of the graph.
    pub(super) nodes: Vec<NodeCost>,
    /// How many times it was cooked.
    pub(super) repeats: u32,
}

/// What a node takes of a run.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NodeCost {
    pub(super) id: String,
    pub(super) ms: f64,
    pub(super) cpu_ms: f64,
    /// Greatest size of the arrays that one result added: the same in each run.
    pub(super) bytes: usize,
}

impl Cost {
    /// The least of both times.
    fn at_least(&mut self, other: &Self) {
        self.ms = self.ms.min(other.ms);
        self.cpu_ms = self.cpu_ms.min(other.cpu_ms);
        for (node, again) in self.nodes.iter_mut().zip(&other.nodes) {
            node.ms = node.ms.min(again.ms);
            node.cpu_ms = node.cpu_ms.min(again.cpu_ms);
        }
        self.repeats += 1;
    }
}

/// A setting that was cooked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    /// The index of each knob's value.
    pub(super) setting: Vec<usize>,
    /// Cost and error, or why it failed.
    pub(super) result: Result<(Cost, Errors), String>,
}

impl Run {
    pub(super) fn cost(&self) -> Option<&Cost> {
        self.result.as_ref().ok().map(|(cost, _)| cost)
    }

    pub(super) fn errors(&self) -> Option<&Errors> {
        self.result.as_ref().ok().map(|(_, errors)| errors)
    }
}

/// The result that runs are compared with.
#[derive(Default)]
pub(super) struct Reference {
    frames: BTreeMap<Frame, Arc<Geometry>>,
    metric: BTreeMap<Frame, f64>,
}

impl Reference {
    /// What the storage of results as f32 may change of an error: four units in the last place of the largest number that is
    /// compared. Of a volume, what moving the whole surface by that much would; nothing of a metric, which is not stored.
    pub(super) fn rounding(&self, measure: &Measure) -> f64 {
        self.frames.values().map(|geometry| measure.rounding(geometry)).fold(0.0, f64::max)
    }
}

/// What came of a cook.
pub(super) enum Cooked<T> {
    Done(T),
    /// Why it could not be cooked.
    Failed(String),
}

impl Subject<'_> {
    /// Refuses values that no graph may have there, before anything is cooked.
    ///
    /// # Errors
    /// If a knob has no such param, or a value is of another type than it.
    pub(super) fn check(&self, knobs: &[Knob]) -> Result<(), Failure> {
        for knob in knobs {
            for value in &knob.values {
                self.graph(&[(knob.key.clone(), value.clone())])?;
            }
        }
        Ok(())
    }

    /// The graph with these settings. A number outside a range is a failed run; a wrong name or a value of another type is a
    /// failure of the command.
    fn graph(&self, set: &[(String, String)]) -> Result<Cooked<Graph>, Failure> {
        let set: Vec<_> = self.fixed.iter().chain(set).cloned().collect();
        let faults = match load::loaded_with(self.catalogue, self.bytes, self.path, &settings(&set)) {
            Ok(graph) => return Ok(Cooked::Done(graph)),
            Err(faults) => faults,
        };
        match faults.iter().find(|fault| fault.set.is_none() || fault.code != code::ILLEGAL_VALUE) {
            Some(_) => {
                let mut failure = load::faulty(self.path, &faults);
                failure.lines.iter_mut().for_each(|line| *line = line.replacen("--set ", "--knob ", 1));
                Err(failure)
            }
            None => {
                // Without its position, which is in the value alone.
                let fault = faults.into_iter().next().map(|fault| Fault { line: 0, ..fault });
                Ok(Cooked::Failed(fault.map(|fault| fault.to_string()).unwrap_or_default()))
            }
        }
    }

    /// Cooks a setting, and hands its frames to `take`; the time of `take` is not counted.
    fn cook(
        &self,
        set: &[(String, String)],
        take: &mut (dyn FnMut(&Delivered) -> Result<(), Failure> + Send),
    ) -> Result<Cooked<(Cost, Report)>, Stop> {
        let graph = match self.graph(set)? {
            Cooked::Done(graph) => graph,
            Cooked::Failed(why) => return Ok(Cooked::Failed(why)),
        };
        // A new engine has nothing cooked but the sources, which the check reads: loading is not counted.
        let engine = load::engine(self.threads, self.ceiling)?;
        if let Some(fault) = engine.verify(&graph, Some(&self.request)).first() {
            return Ok(Cooked::Failed(fault.to_string()));
        }
        let mut taking = Duration::ZERO;
        let mut sink = |finished: &[Delivered]| -> Result<(), Failure> {
            let watch = Stopwatch::start();
            finished.iter().try_for_each(&mut *take)?;
            taking += watch.cpu();
            self.progress.add(finished.len() as u64);
            Ok(())
        };
        let report = match engine.cook(&graph, &self.request, None, &self.cancel, &mut sink) {
            Ok(report) => report,
            Err(Stopped::Asked(error)) => return Ok(Cooked::Failed(error.to_string())),
            Err(Stopped::Sink(failure)) => return Err(failure.into()),
        };
        if report.cancelled {
            return Err(Stop::Interrupted);
        }
        if let Some((_, error, _)) = report.errors.first() {
            return Ok(Cooked::Failed(error.to_string()));
        }
        Ok(Cooked::Done((self.cost(&graph, &report, taking), report)))
    }

    fn cost(&self, graph: &Graph, report: &Report, taking: Duration) -> Cost {
        let frames = self.request.frames.len().max(1) as f64;
        let ms = |time: Duration| time.as_secs_f64() * 1e3 / frames;
        // A still source was read before the cook.
        let is_loaded =
            |place: usize| graph.nodes[place].inputs().iter().all(Vec::is_empty) && !report.nodes[place].varies;
        let node = |(place, node): (usize, &engine::cook::NodeReport)| {
            let id = node.id.as_ref()?.to_string();
            let [wall, cpu] = [node.wall, node.cpu].map(|time| if is_loaded(place) { 0.0 } else { ms(time) });
            node.needed.then_some(NodeCost { id, ms: wall, cpu_ms: cpu, bytes: node.peak_bytes })
        };
        Cost {
            ms: ms(report.cooking),
            cpu_ms: ms(report.cpu.saturating_sub(taking)),
            peak_bytes: report.peak_bytes,
            nodes: report.nodes.iter().enumerate().filter_map(node).collect(),
            repeats: 1,
        }
    }

    /// Cooks the reference.
    pub(super) fn reference(&self, set: &[(String, String)]) -> Result<Cooked<Reference>, Stop> {
        let mut reference = Reference::default();
        let measure = &self.norm.measure;
        let mut take = |one: &Delivered| {
            reference.frames.insert(one.frame, Arc::new(measure.reads_of(&one.geometry)));
            Ok(())
        };
        match self.cook(set, &mut take)? {
            Cooked::Failed(why) => Ok(Cooked::Failed(why)),
            Cooked::Done((_, report)) => {
                reference.metric = self.metric(&report);
                Ok(Cooked::Done(reference))
            }
        }
    }

    /// Cooks a setting of the knobs and measures its error.
    pub(super) fn run(&self, knobs: &[Knob], setting: &[usize], reference: &Reference) -> Result<Run, Stop> {
        let mut differences = Differences::default();
        let measure = &self.norm.measure;
        let mut take = |one: &Delivered| {
            let Some(of_reference) = reference.frames.get(&one.frame) else { return Ok(()) };
            measure
                .compare(&one.geometry, of_reference, &mut differences)
                .map_err(|why| not_comparable(measure, one.frame, &why))
        };
        let cooked = self.cook(&set_of(knobs, setting), &mut take)?;
        let failed = |why: String| Run { setting: setting.to_vec(), result: Err(why) };
        let (cost, report) = match cooked {
            Cooked::Failed(why) => return Ok(failed(why)),
            Cooked::Done(done) => done,
        };
        if let Measure::Metric { node, metric } = measure {
            let own = self.metric(&report);
            if own.is_empty() {
                let line = format!("--norm: `{node}` published no `{metric}` in these frames");
                return Err(Failure::new(Exit::CommandLine, line).into());
            }
            let both = own.iter().filter_map(|(frame, value)| Some(value - reference.metric.get(frame)?));
            differences.extend(both.map(f64::abs));
        }
        let [unmatched, all] = differences.unmatched;
        if unmatched > 0 {
            let set: Vec<String> =
                set_of(knobs, setting).into_iter().map(|(key, value)| format!("{key}={value}")).collect();
            let _ = self.unmatched.set(format!(
                "only what both results have is compared, matched by its id: with {} that is {:.3} % of what they have",
                set.join(", "),
                100.0 * (all - unmatched) as f64 / all as f64
            ));
        }
        Ok(match Errors::of(differences) {
            Some(errors) => Run { setting: setting.to_vec(), result: Ok((cost, errors)) },
            None => failed("the output has nothing to compare in these frames".into()),
        })
    }

    /// Cooks a run once more, for its time.
    pub(super) fn repeat(&self, knobs: &[Knob], run: &mut Run) -> Result<(), Stop> {
        let Ok((cost, _)) = &mut run.result else { return Ok(()) };
        if let Cooked::Done((again, _)) = self.cook(&set_of(knobs, &run.setting), &mut |_| Ok(()))? {
            cost.at_least(&again);
        }
        Ok(())
    }

    /// The metric of the norm, by frame.
    fn metric(&self, report: &Report) -> BTreeMap<Frame, f64> {
        let Measure::Metric { node, metric } = &self.norm.measure else { return BTreeMap::new() };
        let found = report.nodes.iter().find(|found| found.id.as_ref().is_some_and(|id| **id == **node));
        found.and_then(|found| found.metrics.get(metric.as_str())).cloned().unwrap_or_default()
    }
}

/// The params of a setting.
pub(super) fn set_of(knobs: &[Knob], setting: &[usize]) -> Vec<(String, String)> {
    knobs.iter().zip(setting).map(|(knob, index)| (knob.key.clone(), knob.values[*index].clone())).collect()
}

/// Results that the norm cannot compare make the whole study useless, not only a run.
fn not_comparable(measure: &Measure, frame: Frame, why: &str) -> Failure {
    let hint = match measure {
        _ if why.starts_with(norms::NO_ATTRIBUTE) => "",
        Measure::Points | Measure::Attribute(_) => {
            "; where points come and go, use --norm surface, which measures distances between surfaces, or volume"
        }
        _ => "",
    };
    Failure::new(Exit::CommandLine, format!("--norm {}: at frame {frame} {why}{hint}", measure.name()))
}
