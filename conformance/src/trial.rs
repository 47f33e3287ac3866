//! A trial: a node cooked with certain params and inputs, and the outcome.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use crate::bench::{Bench, bench};
use crate::panics::quietly;
use crate::samples::{self, Dress, Form};
use engine::cook::{Delivered, Engine, Settings, Stopped};
use engine::error::ErrorKind;
use engine::geometry::{ColumnType, Geometry, Kind, Name, Owner, P, Topology};
use engine::graph::{Graph, Scene};
use engine::key::{ContentKey, Hasher};
use engine::node::{Arity, AttrNames, Carries, Cook, InputSpec, LeftOut, Needs, Node, Output};
use engine::param::{ParamSpec, Params, Source, Value};
use engine::plan::{Plan, Request};
use engine::time::Frame;

/// Sets values that the suite cannot invent, such as files and code.
pub(crate) type Prepare = Arc<dyn Fn(Bench) -> Bench + Send + Sync>;

/// The node under test, and its declaration.
pub(crate) struct Subject {
    pub(crate) node: &'static Node,
    pub(crate) specs: Vec<ParamSpec>,
    pub(crate) inputs: Vec<InputSpec>,
    pub(crate) samples: Vec<Prepare>,
    reads: Vec<(String, Owner, ColumnType)>,
    /// Hashes of outcomes by trial; see [`Subject::hash`].
    hashes: Mutex<BTreeMap<String, ContentKey>>,
}

/// How inputs change with time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// They do not change, and the engine knows.
    Still,
    /// They move.
    Moving,
    /// They do not change, but the engine does not know.
    Unknown,
}

/// The params and inputs of one trial.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub(crate) settings: Vec<Source>,
    /// Index of the prepared sample, if there are any.
    pub(crate) sample: usize,
    /// For each input the seed of each wire.
    pub(crate) wires: Vec<Vec<u64>>,
    pub(crate) form: Form,
    /// Seed of the attributes that the node declares to read.
    pub(crate) declared: Option<u64>,
    /// Seed of those that it does not.
    pub(crate) others: Option<u64>,
    /// The attribute that is removed.
    pub(crate) without: Option<String>,
    /// The input whose wires are empty.
    pub(crate) empty: Option<usize>,
    /// Chooses the components of inputs that take any; see [`samples::kinds`].
    pub(crate) any: usize,
    pub(crate) motion: Motion,
    pub(crate) first: i64,
}

impl Trial {
    /// The same with another value of one param.
    pub(crate) fn with(&self, param: usize, value: Value) -> Self {
        let mut trial = self.clone();
        trial.settings[param] = Source::Constant(value);
        trial
    }

    /// The same with other positions of one input's points.
    pub(crate) fn reseeded(&self, input: usize) -> Self {
        let mut trial = self.clone();
        trial.wires[input].iter_mut().for_each(|seed| *seed += 1_000);
        trial
    }
}

/// The outcome of a trial.
pub(crate) struct Outcome {
    pub(crate) found: BTreeMap<(usize, Frame), Arc<Geometry>>,
    /// The first error of each node, by output.
    pub(crate) errors: Vec<(usize, ErrorKind, String)>,
    pub(crate) metrics: BTreeMap<&'static str, BTreeMap<Frame, f64>>,
    /// Metrics that were NaN or infinite; the report has a note instead of the value.
    pub(crate) undefined_metrics: Vec<&'static str>,
    /// The params that were read.
    pub(crate) read: Vec<bool>,
    pub(crate) left_out: Vec<LeftOut>,
    /// Attributes read and written, if they depend on params.
    pub(crate) names: Option<[AttrNames; 2]>,
    /// The geometry of each wire; moving inputs had other positions.
    pub(crate) given: Vec<Vec<Geometry>>,
}

/// Calls `cook` with an engine of that number of threads, which no other trial uses meanwhile.
fn with_engine<T>(threads: usize, cook: impl FnOnce(&Engine) -> T) -> T {
    static IDLE: Mutex<Vec<(usize, Engine)>> = Mutex::new(Vec::new());
    let idle = || IDLE.lock().unwrap_or_else(PoisonError::into_inner);
    let take = || {
        let mut idle = idle();
        let found = idle.iter().position(|(count, _)| *count == threads)?;
        Some(idle.swap_remove(found).1)
    };
    // Without a cache, so that no trial finds results of an earlier one.
    let settings = Settings { threads, memory: 0, ..Settings::default() };
    let engine = take().unwrap_or_else(|| Engine::new(&settings).expect("the system starts a few threads"));
    let result = cook(&engine);
    idle().push((threads, engine));
    result
}

impl Subject {
    pub(crate) fn new(node: &'static Node, samples: Vec<Prepare>) -> Self {
        let (specs, inputs, reads) = (node.param_specs(), node.input_specs(), samples::described(node.reads));
        Self { node, specs, inputs, samples, reads, hashes: Mutex::default() }
    }

    /// The frames that are cooked, chosen by how the node depends on time.
    pub(crate) fn frames(&self) -> Vec<Frame> {
        let frames: &[f64] = match self.node.cook {
            Cook::Pure(_) => &[1.0],
            Cook::Frame { .. } => &[1.0, 2.5, 30.0],
            Cook::Window(..) => &[1.0, 3.0, 12.0],
            Cook::Solver(..) => &[1.0, 2.0, 3.0],
        };
        frames.iter().map(|frame| Frame::exactly(*frame).expect("these frames are whole ticks")).collect()
    }

    /// Whether the node depends on time.
    pub(crate) fn is_timed(&self) -> bool {
        !matches!(self.node.cook, Cook::Pure(_))
    }

    /// Default params; every input wired, lists with `many` wires.
    pub(crate) fn defaults(&self, many: usize) -> Trial {
        let wires = |(place, input): (usize, &InputSpec)| {
            let count = if let Arity::Many { least } = input.arity { many.max(least) } else { 1 };
            (0..count).map(|wire| (place * 10 + wire) as u64).collect()
        };
        Trial {
            settings: self.specs.iter().map(|spec| self.unset(spec)).collect(),
            sample: 0,
            wires: self.inputs.iter().enumerate().map(wires).collect(),
            form: Form::Small,
            declared: Some(1),
            others: Some(1),
            without: None,
            empty: None,
            any: 0,
            motion: if self.is_timed() { Motion::Moving } else { Motion::Still },
            first: 1,
        }
    }

    fn unset(&self, spec: &ParamSpec) -> Source {
        match spec.facts.unset {
            engine::param::Unset::CurrentFrame => Source::CurrentFrame,
            engine::param::Unset::CurrentTime => Source::CurrentTime,
            engine::param::Unset::SceneStart => Source::Constant(Value::Int(1)),
            engine::param::Unset::Default => Source::Constant(spec.default.clone()),
        }
    }

    /// The indices of the params that a prepared sample sets.
    pub(crate) fn prepared(&self, sample: usize) -> Vec<usize> {
        let Some(prepare) = self.samples.get(sample) else { return Vec::new() };
        let (before, after) = (bench(self.node), prepare(bench(self.node)));
        let differs =
            |place: &usize| format!("{:?}", before.sources()[*place]) != format!("{:?}", after.sources()[*place]);
        (0..self.specs.len()).filter(differs).collect()
    }

    fn graph(&self, trial: &Trial) -> (Graph, Vec<Vec<Geometry>>) {
        let mut bench =
            bench(self.node).scene(Scene { first: trial.first, last: trial.first + 47, ..Scene::default() });
        for (spec, source) in self.specs.iter().zip(&trial.settings) {
            bench = bench.source(spec.name, source.clone());
        }
        if let Some(prepare) = self.samples.get(trial.sample) {
            bench = prepare(bench);
        }
        let dress = Dress { declared: trial.declared, others: trial.others, reads: &self.reads };
        let mut given = Vec::new();
        for (place, (input, seeds)) in self.inputs.iter().zip(&trial.wires).enumerate() {
            let kinds = samples::kinds(input.needs, trial.any);
            let form = if trial.empty == Some(place) { Form::Empty } else { trial.form };
            let mut wires: Vec<Geometry> =
                seeds.iter().map(|seed| samples::geometry(&kinds, form, *seed, dress)).collect();
            if let Some(name) = &trial.without {
                wires.iter_mut().for_each(|geometry| take_away(geometry, name));
            }
            for geometry in &wires {
                let (geometry, motion) = (geometry.clone(), trial.motion);
                let at = move |frame: Frame| {
                    if motion == Motion::Moving { moved(&geometry, frame) } else { geometry.clone() }
                };
                bench = bench.wire(input.name, Arc::new(at), motion != Motion::Still);
            }
            given.push(wires);
        }
        (bench.graph(), given)
    }

    /// The source of a component that passes through: the input that the output is like, otherwise the first single
    /// input with
    /// such a component.
    pub(crate) fn source<'o>(&self, outcome: &'o Outcome, output: &Output, kind: Kind) -> Option<&'o Geometry> {
        let index = match output.carries {
            Carries::Like(name) => self.inputs.iter().position(|input| input.name == name)?,
            Carries::Kinds(_) => self.inputs.iter().position(|input| {
                input.arity == Arity::One && (input.needs == Needs::Kind(kind) || input.needs == Needs::Any)
            })?,
            Carries::Union(_) => return None,
        };
        outcome.given[index].first()
    }

    /// The stages that the node reports as left out in a trial, without cooking it; none if params are refused.
    pub(crate) fn left_out(&self, trial: &Trial) -> Vec<LeftOut> {
        let (graph, _) = self.graph(trial);
        let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: self.frames().into() };
        let stages = || Some(Plan::new(&graph, &request, Arc::default()).ok()?.left_out(graph.nodes.len() - 1));
        quietly(|| catch_unwind(AssertUnwindSafe(stages))).ok().flatten().unwrap_or_default()
    }

    /// The params of a trial at the start of the scene; `None` if they are refused.
    pub(crate) fn params(&self, trial: &Trial) -> Option<Params> {
        let (graph, _) = self.graph(trial);
        let request = Request::everything(&graph);
        let plan = quietly(|| catch_unwind(AssertUnwindSafe(|| Plan::new(&graph, &request, Arc::default()))));
        plan.ok()?.ok()?.params(graph.nodes.len() - 1, graph.scene.start()).ok()
    }

    /// Cooks a trial at some frames.
    pub(crate) fn run(&self, trial: &Trial, frames: &[Frame]) -> Outcome {
        self.run_on(1, false, trial, frames)
    }

    /// Remembers the outcome of a trial at [`Subject::frames`] for [`Subject::hash`].
    pub(crate) fn remember(&self, trial: &Trial, outcome: &Outcome) {
        self.hashes.lock().unwrap_or_else(PoisonError::into_inner).insert(format!("{trial:?}"), outcome.whole());
    }

    /// The hash of the results and errors of a trial at [`Subject::frames`], which cooks each trial once. For checks of
    /// what changes a result; that the same trial has the same result is checked by `determinism`.
    pub(crate) fn hash(&self, trial: &Trial) -> ContentKey {
        let known = self.hashes.lock().unwrap_or_else(PoisonError::into_inner).get(&format!("{trial:?}")).copied();
        known.unwrap_or_else(|| {
            let outcome = self.run(trial, &self.frames());
            self.remember(trial, &outcome);
            outcome.whole()
        })
    }

    pub(crate) fn run_on(&self, threads: usize, reload: bool, trial: &Trial, frames: &[Frame]) -> Outcome {
        let (graph, given) = self.graph(trial);
        let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: frames.to_vec().into() };
        let mut found = BTreeMap::new();
        let mut sink = |finished: &[Delivered]| -> Result<(), std::convert::Infallible> {
            found.extend(finished.iter().map(|one| ((one.output, one.frame), one.geometry.clone())));
            Ok(())
        };
        let mut outcome = Outcome {
            found: BTreeMap::new(),
            errors: Vec::new(),
            metrics: BTreeMap::new(),
            undefined_metrics: Vec::new(),
            read: vec![false; self.specs.len()],
            left_out: Vec::new(),
            names: None,
            given,
        };
        let cooked = quietly(|| {
            catch_unwind(AssertUnwindSafe(|| {
                let plan = Plan::new(&graph, &request, Arc::default()).map_err(Stopped::Asked)?;
                let report = with_engine(threads, |engine| engine.cook_plan(&plan, reload, &mut sink))?;
                let params = plan.params(graph.nodes.len() - 1, graph.scene.start()).ok();
                let was_read = |index: usize| params.as_ref().is_some_and(|params| params.was_read(index));
                let read: Vec<bool> = (0..self.specs.len()).map(was_read).collect();
                let names = params.as_ref().and_then(|params| Some((self.node.attributes?)(params)));
                Ok::<_, Stopped<std::convert::Infallible>>((report, read, names))
            }))
        });
        match cooked {
            Err(panic) => {
                let said = panic.downcast_ref::<String>().cloned();
                let said = said.or_else(|| panic.downcast_ref::<&str>().map(|said| (*said).to_owned()));
                let said = format!("while it was planned: {}", said.unwrap_or_default());
                outcome.errors.push((0, ErrorKind::Panic, said));
            }
            Ok(Err(Stopped::Asked(error))) => {
                outcome.errors.push((0, error.error.kind, error.error.to_string()));
            }
            Ok(Err(stopped)) => outcome.errors.push((0, ErrorKind::Contract, format!("{stopped:?}"))),
            Ok(Ok((report, read, names))) => {
                let errors = report.errors.iter();
                outcome
                    .errors
                    .extend(errors.map(|(place, error, _)| (*place, error.error.kind, error.error.to_string())));
                let metrics = self.node.metrics.iter().map(|metric| metric.name);
                let says_so = |name: &str| {
                    report
                        .notes
                        .iter()
                        .any(|note| note.kind == name && note.text.contains(&format!("reports no `{name}`")))
                };
                outcome.undefined_metrics = metrics.filter(|name| says_so(name)).collect();
                outcome.read = read;
                outcome.names = names;
                if let Some(node) = report.nodes.into_iter().last() {
                    outcome.left_out = node.left_out;
                    outcome.metrics = node.metrics;
                }
            }
        }
        outcome.found = found;
        outcome
    }
}

fn take_away(geometry: &mut Geometry, name: &str) {
    for kind in Kind::ALL {
        let Some(part) = geometry.part_mut(kind) else { continue };
        Owner::ALL.iter().for_each(|owner| drop(part.remove(*owner, name)));
    }
}

/// The geometry at a frame: it drifts along x and grows.
fn moved(geometry: &Geometry, frame: Frame) -> Geometry {
    let mut geometry = geometry.clone();
    let (drift, growth) = (0.002 * frame.number() as f32, 1.0 + 0.003 * frame.number() as f32);
    for kind in [Kind::Curves, Kind::Mesh, Kind::Points, Kind::Tets] {
        let Some(part) = geometry.part_mut(kind) else { continue };
        for p in part.edit(P).into_iter().flatten() {
            *p = [p[0] * growth + drift, p[1] * growth, p[2]];
        }
    }
    geometry
}

impl Outcome {
    /// A hash of all results and errors, without the attributes that `ignore` names.
    pub(crate) fn digest(&self, ignore: &dyn Fn(&str) -> bool) -> ContentKey {
        let mut key = Hasher::default();
        for ((output, frame), geometry) in &self.found {
            hash_geometry(key.i64(*output as i64).i64(frame.ticks()), geometry, ignore);
        }
        for (output, _, error) in &self.errors {
            key.i64(*output as i64).text(error);
        }
        for (name, values) in &self.metrics {
            key.text(name);
            for (frame, value) in values {
                key.i64(frame.ticks()).bytes(&value.to_bits().to_le_bytes());
            }
        }
        key.finish()
    }

    /// A hash of all results and errors.
    pub(crate) fn whole(&self) -> ContentKey {
        self.digest(&|_| false)
    }

    /// A hash of the results at one frame, or of the errors if there are none.
    pub(crate) fn at(&self, frame: Frame) -> ContentKey {
        let mut key = Hasher::default();
        let mut there = false;
        for ((output, _), geometry) in self.found.iter().filter(|((_, at), _)| *at == frame) {
            there = true;
            hash_geometry(key.i64(*output as i64), geometry, &|_| false);
        }
        for (output, kind, _) in self.errors.iter().filter(|_| !there) {
            key.i64(*output as i64).i64(*kind as i64);
        }
        key.finish()
    }

    /// Whether all frames of all outputs were delivered.
    pub(crate) fn is_whole(&self) -> bool {
        self.errors.is_empty()
    }
}

fn hash_geometry(key: &mut Hasher, geometry: &Geometry, ignore: &dyn Fn(&str) -> bool) {
    for part in geometry.parts() {
        key.tag(part.kind() as u8).i64(part.point_count() as i64).i64(part.element_count() as i64);
        match part.topology() {
            Topology::Curves(runs) => hash_words(key, runs.starts()),
            Topology::Mesh(faces) => {
                hash_words(key, faces.runs.starts());
                hash_words(key, &faces.corners);
            }
            Topology::Tets(tets) => hash_words(key, tets.as_flattened()),
            Topology::Points => {}
        }
        for (owner, name, column) in part.columns().filter(|(_, name, _)| !ignore(name)) {
            key.tag(owner as u8).text(name).tag(column.kind() as u8).bytes(&column.to_bytes());
        }
    }
    if let Some(volume) = geometry.volume() {
        for grid in [volume.level_grid(), volume.velocity_grid()] {
            hash_words(key, &grid.size);
            grid.origin.iter().chain([&grid.cell]).for_each(|x| _ = key.bytes(&x.to_le_bytes()));
        }
        for (_, field) in volume.fields() {
            key.bytes(&field.background().to_le_bytes());
            field.blocks().for_each(|(block, _)| hash_words(key, &block));
            field.values().iter().for_each(|x| _ = key.bytes(&x.to_le_bytes()));
        }
        for (name, column) in volume.once().iter().filter(|(name, _)| !ignore(name)) {
            key.text(name).bytes(&column.to_bytes());
        }
    }
}

fn hash_words(key: &mut Hasher, words: &[u32]) {
    for word in words {
        key.bytes(&word.to_le_bytes());
    }
}

/// The attributes that mask params.
pub(crate) fn masks(settings: &[Source]) -> impl Iterator<Item = &Name> {
    settings.iter().filter_map(|source| match source {
        Source::Masked(_, attribute) | Source::Constant(Value::Masked(_, Some(attribute))) => Some(attribute),
        _ => None,
    })
}
