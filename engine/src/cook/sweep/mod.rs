//! The sweep: see the module above for the idea.

mod chains;
mod close;
mod metrics;
mod notes;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rayon::prelude::*;

use super::call::{Call, Returned};
use super::history::Integrals;
use super::store::Cooked;
use super::warnings;
use super::{CookError, Delivered, DiskCache, Engine, NodeReport, Report, Sink, Stopped, deliver};
use crate::clock::Stopwatch;
use crate::geometry::Geometry;
use crate::graph::{Body, Link};
use crate::key::{Hasher, Key};
use crate::node::{Cook, FrameCx, History, InputData, Node, Outputs, StateBox};
use crate::param::Params;
use crate::plan::{Keys, Plan, Stretch};
use crate::time::Frame;
use notes::Asked;

/// A result, or what spoiled it.
type Outcome = Result<Cooked, Arc<CookError>>;

/// Frames a chain moves in one slice at most, and frames a slice spans where there are chains.
const LONGEST: i64 = 16;

/// Frames of a slice at most.
const MOST_FRAMES: usize = 16;

/// Bytes of results a slice should hold: a few times a core's cache, so that a node finds its input there.
const SLICE_BYTES: usize = 16 << 20;

/// Work shorter than this is not worth handing to another thread.
const WORTH_A_THREAD: Duration = Duration::from_micros(20);

/// A chain's state, standing at a frame.
struct Running {
    at: i64,
    state: Result<StateBox, Arc<CookError>>,
    /// The slice that moved it last.
    moved: u64,
}

/// What a slice needs of a chain's stretch.
#[derive(Default)]
struct Advance {
    /// Whole frames whose output is needed.
    outputs: BTreeSet<i64>,
    /// Last frame to move to.
    goal: i64,
    /// Frame the state stands at; `None`: it must start.
    from: Option<i64>,
}

/// What a slice needs.
struct Slice {
    /// By node: frames, canonical, that nobody has yet.
    need: Vec<BTreeSet<Frame>>,
    /// By node: what its chain must do.
    advance: Vec<BTreeMap<Stretch, Advance>>,
}

/// What a chain must reach for the sake of later slices.
struct Silent {
    node: usize,
    stretch: Stretch,
    goal: i64,
}

pub(super) struct Sweep<'p, 'g, 'e> {
    engine: &'e Engine,
    plan: &'p Plan<'g>,
    disk: Option<&'e mut DiskCache>,
    cancel: &'e AtomicBool,
    /// Whether this is a rehearsal, in which no node is called.
    dry: bool,
    /// Whether this cook only looks at sources, for a cook that follows.
    pub(super) verifying: bool,
    /// Whether states are written and read back after every step.
    pub(super) reload: bool,
    keys: Keys<'p, 'g>,
    results: Vec<BTreeMap<Frame, Outcome>>,
    running: Vec<BTreeMap<Stretch, Running>>,
    /// Slices cooked so far.
    slices: u64,
    /// By chain: its last whole frames' outputs, which samples between frames ask for again.
    recent: Vec<BTreeMap<i64, Outcome>>,
    integrals: Vec<Option<Integrals<'p>>>,
    /// By node: mean wall time of a call.
    pace: Vec<Duration>,
    /// By node: key of the result kept because it may hold.
    held: Vec<Option<Key>>,
    /// Keys of results this cook has made or found.
    own: BTreeSet<Key>,
    report: Report,
    /// What outputs ask for and what there is, for notes.
    asked: Asked,
    /// Bytes of the slice's results, by node and in all.
    node_bytes: Vec<usize>,
    live_bytes: usize,
    /// Most bytes one frame of a slice took.
    frame_bytes: usize,
}

impl<'p, 'g, 'e> Sweep<'p, 'g, 'e> {
    pub(super) fn new(
        engine: &'e Engine,
        plan: &'p Plan<'g>,
        disk: Option<&'e mut DiskCache>,
        cancel: &'e AtomicBool,
        dry: bool,
    ) -> Self {
        let count = plan.graph.nodes.len();
        // Geometry that a program gives has a key in this plan alone, so nothing of it may outlive the cook.
        let given = plan.graph.nodes.iter().any(|node| matches!(node.body, Body::Given { .. }));
        let disk = disk.filter(|_| !given && !dry);
        let maps = || (0..count).map(|_| BTreeMap::new()).collect::<Vec<_>>();
        let nodes = plan.graph.nodes.iter().zip(&plan.nodes).enumerate().map(|(place, (node, planned))| NodeReport {
            id: Some(node.id.clone()),
            type_name: node.type_name(),
            time: node.node().map_or("given", |node| node.cook.word()),
            needed: planned.needed,
            varies: planned.varies,
            left_out: if planned.needed { plan.left_out(place) } else { Vec::new() },
            ..NodeReport::default()
        });
        let integrals = plan.graph.nodes.iter().zip(&plan.nodes).map(|(node, planned)| {
            let declared = node.node().filter(|node| node.integrands[0].is_some());
            declared.map(|node| Integrals::new(&planned.resolver, node, &plan.graph.scene))
        });
        let integrals = integrals.collect();
        let report = Report { nodes: nodes.collect(), ..Report::default() };
        Self {
            engine,
            plan,
            disk,
            cancel,
            dry,
            verifying: false,
            reload: false,
            keys: Keys::new(plan),
            results: (0..count).map(|_| BTreeMap::new()).collect(),
            running: (0..count).map(|_| BTreeMap::new()).collect(),
            slices: 0,
            recent: maps(),
            integrals,
            pace: vec![Duration::MAX; count],
            held: vec![None; count],
            own: BTreeSet::new(),
            asked: Asked::of(plan),
            report,
            node_bytes: vec![0; count],
            live_bytes: 0,
            frame_bytes: 0,
        }
    }

    pub(super) fn run<E: Send>(mut self, sink: &mut Sink<'_, E>) -> Result<Report, Stopped<E>> {
        let watch = Stopwatch::start();
        let frames = self.plan.request.frames.clone();
        let chains = self
            .plan
            .graph
            .nodes
            .iter()
            .zip(&self.plan.nodes)
            .any(|(node, planned)| planned.needed && node.node().is_some_and(|node| node.cook.is_chain()));
        let mut rest = frames.as_slice();
        while let Some(first) = rest.first() {
            let most = self.slice_length();
            let fits = |frame: &&Frame| !chains || frame.ticks() - first.ticks() < LONGEST * Frame::TICKS;
            let count = rest.iter().take(most).take_while(fits).count();
            let (slice, later) = rest.split_at(count);
            rest = later;
            let cooking = Stopwatch::start();
            let finished = self.slice(slice);
            self.report.cooking += cooking.wall();
            if self.cancelled() {
                self.report.cancelled = true;
                break;
            }
            sink(&finished).map_err(Stopped::Sink)?;
            for delivered in &finished {
                *self.report.delivered.entry(delivered.output).or_default() += 1;
            }
            self.keys.forget_before(slice[0].floor_number());
        }
        for (node, report) in self.report.nodes.iter_mut().enumerate() {
            report.window = self.keys.window(node);
        }
        self.report.notes.extend(self.disk.iter().flat_map(|disk| disk.notes()).cloned());
        self.note_unseen();
        for (node, report) in self.plan.graph.nodes.iter().zip(&self.report.nodes) {
            let declared = node.node().map_or(&[][..], |declared| declared.metrics);
            let notes = warnings::notes(&node.id, report.type_name, declared, &report.metrics);
            self.report.notes.extend(notes);
        }
        self.report.wall = watch.wall();
        self.report.cpu = watch.cpu();
        Ok(self.report)
    }

    fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// As many frames as fit the cache, and the memory asked for.
    fn slice_length(&self) -> usize {
        if self.dry {
            return MOST_FRAMES;
        }
        // The first frame shows how much one takes.
        if self.frame_bytes == 0 && self.report.delivered.is_empty() {
            return 1;
        }
        let threads = rayon::current_num_threads();
        let bytes = self.frame_bytes.max(1);
        let most = (self.engine.memory / 2 / bytes).clamp(1, MOST_FRAMES);
        (SLICE_BYTES / bytes).clamp(threads.min(most), most)
    }

    /// Cooks some frames of all outputs.
    fn slice(&mut self, frames: &[Frame]) -> Vec<Delivered> {
        let mut finished = Vec::new();
        let mut asked: Vec<(usize, Frame, Option<Key>)> = Vec::new();
        let mut targets: Vec<(usize, Frame)> = Vec::new();
        let plan = self.plan;
        for frame in frames {
            // What a frame on disk stands for, each node once.
            let mut stood_for: BTreeSet<usize> = BTreeSet::new();
            for place in &plan.request.outputs {
                let key = self.disk.is_some().then(|| self.output_key(*place, *frame)).flatten();
                let found = key.and_then(|key| self.disk.as_ref().and_then(|disk| disk.frame(key)));
                match found {
                    Some((geometry, metrics)) => {
                        self.report.from_disk += 1;
                        self.publish_kept(*place, *frame, &metrics);
                        stood_for.extend(plan.ancestors(plan.graph.outputs[*place].from.node));
                        finished.push(Delivered { output: *place, frame: *frame, geometry: Arc::new(geometry) });
                    }
                    None => {
                        asked.push((*place, *frame, key));
                        targets.extend(self.samples(*place, *frame).into_iter().map(|at| self.canonical(*place, at)));
                    }
                }
            }
            stood_for.into_iter().for_each(|node| self.report.nodes[node].from_disk += 1);
        }
        self.run_up(&targets);
        let slice = self.close(&targets, &[], Reach::Whole);
        let peak = self.cook_slice(slice, &targets);
        if self.cancelled() {
            return finished;
        }
        self.frame_bytes = self.frame_bytes.max(peak / frames.len().max(1));
        if !self.dry {
            let made: Vec<_> = asked.par_iter().map(|(place, frame, _)| self.delivery(*place, *frame)).collect();
            for ((place, frame, key), result) in asked.into_iter().zip(made) {
                match result {
                    Ok(geometry) => {
                        if let Some(key) = key {
                            let metrics = self.metrics_to_keep(place, frame);
                            if let Some(disk) = self.disk.as_mut() {
                                disk.save_frame(key, &geometry, &metrics);
                            }
                        }
                        finished.push(Delivered { output: place, frame, geometry });
                    }
                    Err(error) => self.note_error(place, error),
                }
            }
        }
        finished.sort_by_key(|delivered| (delivered.frame, delivered.output));
        finished.iter().for_each(|delivered| self.see(delivered));
        self.end_slice();
        self.forget_windows_left_behind();
        finished
    }

    fn note_error(&mut self, output: usize, error: Arc<CookError>) {
        let known =
            self.report.errors.iter_mut().find(|(place, known, _)| *place == output && known.node == error.node);
        match known {
            Some((_, _, frames)) => *frames += 1,
            None => self.report.errors.push((output, error, 1)),
        }
    }

    fn canonical(&self, output: usize, frame: Frame) -> (usize, Frame) {
        let node = self.plan.graph.outputs[output].from.node;
        (node, self.plan.canonical(node, frame))
    }

    /// The times at which an output's node must be known for a frame.
    fn samples(&self, output: usize, frame: Frame) -> Vec<Frame> {
        let mut samples = vec![frame];
        if self.output_differs(output) {
            samples.extend(deliver::velocity_samples(&self.plan.graph.scene, frame));
        }
        samples
    }

    fn output_differs(&self, output: usize) -> bool {
        let output = &self.plan.graph.outputs[output];
        let node = output.from.node;
        deliver::differs(output, self.plan.graph.nodes[node].node(), self.plan.nodes[node].has_solver)
    }

    /// The key of a finished frame; `None` where a param is refused there.
    fn output_key(&mut self, output: usize, frame: Frame) -> Option<Key> {
        let graph = self.plan.graph;
        let asked = &graph.outputs[output];
        let mut hasher = Hasher::default();
        hasher.tag(20).i64(asked.from.port as i64).i64(i64::from(asked.v));
        let names = asked.attributes.as_deref().unwrap_or_default();
        hasher.i64(i64::from(asked.attributes.is_some())).i64(names.len() as i64);
        names.iter().fold(&mut hasher, |hasher, name| hasher.text(name));
        for at in self.samples(output, frame) {
            let (node, at) = self.canonical(output, at);
            hasher.key(self.keys.spot(node, at).ok()?.key).f64(graph.scene.fps);
        }
        Some(hasher.finish())
    }

    /// What an output delivers at a frame, from the results of the slice.
    fn delivery(&self, place: usize, frame: Frame) -> Result<Arc<Geometry>, Arc<CookError>> {
        let output = &self.plan.graph.outputs[place];
        let at = |frame: Frame| -> Result<Arc<Geometry>, Arc<CookError>> {
            let (node, frame) = self.canonical(place, frame);
            let outcome = self.results[node].get(&frame).expect("the slice asked for every target");
            outcome.as_ref().map(|cooked| cooked[output.from.port].clone()).map_err(Arc::clone)
        };
        let geometry = at(frame)?;
        let around = match self.output_differs(place) {
            false => None,
            true => {
                let [before, after] = deliver::velocity_samples(&self.plan.graph.scene, frame);
                let fps = self.plan.graph.scene.fps;
                Some(([at(before)?, at(after)?], after.seconds(fps) - before.seconds(fps)))
            }
        };
        let around = around.as_ref().map(|([before, after], seconds)| ([&**before, &**after], *seconds));
        let finished = deliver::finish(output, &geometry, around);
        finished.map(Arc::new).map_err(|error| Arc::new(self.plan.error(output.from.node, frame, error)))
    }

    /// Moves chains that are far behind, a slice at a time, without keeping what they put out on the way.
    fn run_up(&mut self, targets: &[(usize, Frame)]) {
        loop {
            let slice = self.close(targets, &[], Reach::Near);
            let mut behind: Vec<Silent> = Vec::new();
            let mut begins = Vec::new();
            for (node, stretches) in slice.advance.iter().enumerate() {
                for (stretch, advance) in stretches {
                    let from = advance.from.unwrap_or(stretch.start - 1);
                    let silent = advance.outputs.first().map_or(advance.goal, |first| first - 1);
                    let goal = silent.min(from + LONGEST);
                    if advance.goal - from > LONGEST && goal > from && goal >= stretch.start {
                        behind.push(Silent { node, stretch: *stretch, goal });
                        begins.push(from);
                    }
                }
            }
            let Some(until) = behind.iter().map(|silent| silent.goal).min() else { return };
            let silent: Vec<Silent> = behind
                .into_iter()
                .zip(begins)
                .filter(|(_, from)| *from < until)
                .map(|(silent, _)| Silent { goal: until.max(silent.stretch.start), ..silent })
                .collect();
            self.forget_results();
            let slice = self.close(&[], &silent, Reach::Whole);
            self.cook_slice(slice, &[]);
            self.end_slice();
            if self.cancelled() {
                return;
            }
        }
    }

    /// Cooks what a slice needs, node by node. Returns the greatest size of results held at once.
    fn cook_slice(&mut self, slice: Slice, targets: &[(usize, Frame)]) -> usize {
        let plan = self.plan;
        let mut left: Vec<usize> = plan.nodes.iter().map(|planned| planned.readers.len()).collect();
        for (node, _) in targets {
            left[*node] += 1;
        }
        let mut peak = 0;
        let Slice { need, advance } = slice;
        for (node, (need, advance)) in need.into_iter().zip(advance).enumerate() {
            if !plan.nodes[node].needed {
                continue;
            }
            if self.cancelled() {
                return peak;
            }
            if !need.is_empty() || !advance.is_empty() {
                let watch = Stopwatch::start();
                self.cook_node(node, need, advance);
                let report = &mut self.report.nodes[node];
                report.wall += watch.wall();
                report.cpu += watch.cpu();
                self.note_misread(node);
            }
            self.keep(node);
            peak = peak.max(self.live_bytes);
            self.report.peak_bytes =
                self.report.peak_bytes.max(self.live_bytes + self.engine.store(|store| store.bytes()));
            let mut sources: Vec<usize> =
                plan.graph.nodes[node].inputs().iter().flatten().map(|link| link.node).collect();
            sources.sort_unstable();
            sources.dedup();
            for source in sources {
                left[source] -= 1;
                if left[source] == 0 {
                    self.forget(source);
                }
            }
        }
        peak
    }

    fn cook_node(&mut self, node: usize, need: BTreeSet<Frame>, advance: BTreeMap<Stretch, Advance>) {
        let declared = match &self.plan.graph.nodes[node].body {
            Body::Given { at, .. } => {
                for frame in need {
                    let outcome = match self.dry {
                        true => Ok(Arc::from([Arc::default()])),
                        false => self.given(node, frame, at(frame)),
                    };
                    self.results[node].insert(frame, outcome);
                    self.report.nodes[node].cooks += 1;
                }
                return;
            }
            Body::Node { node, .. } => *node,
        };
        match declared.cook {
            Cook::Pure(_) | Cook::Frame { .. } => {
                self.cook_frames(node, declared, &need, |cx| declared.cook_frame(cx));
            }
            Cook::Window(chain, _) => self.move_chain(node, declared, chain, None, advance),
            Cook::Solver(chain, solver) => self.move_chain(node, declared, chain, Some(solver), advance),
        }
        // Cancelled on its way, a chain has not been everywhere.
        if declared.cook.is_chain() && !self.cancelled() {
            self.finish_chain(node, declared, &need);
        }
    }

    /// What a program gave, refused where it is not finite: no node need ask.
    fn given(&self, node: usize, frame: Frame, geometry: Geometry) -> Outcome {
        match super::call::check_finite(&geometry, &[]) {
            Ok(()) => Ok(Arc::from([Arc::new(geometry)])),
            Err(error) => Err(Arc::new(self.plan.error(node, frame, error))),
        }
    }

    /// Cooks a pure or frame node: each key once, all in parallel.
    fn cook_frames(
        &mut self,
        node: usize,
        declared: &'static Node,
        need: &BTreeSet<Frame>,
        cook: impl Fn(&FrameCx) -> crate::Result<Outputs> + Sync,
    ) {
        let mut jobs: Vec<(Key, Frame, Params)> = Vec::new();
        let mut keys: Vec<(Frame, Key)> = Vec::new();
        for frame in need {
            let Ok(spot) = self.keys.spot(node, *frame) else { continue };
            let params = spot.params.clone().expect("a declared node has params");
            if !jobs.iter().any(|(key, _, _)| *key == spot.key) {
                jobs.push((spot.key, *frame, params));
            }
            keys.push((*frame, spot.key));
        }
        let this = &*self;
        let one = |(key, frame, params): &(Key, Frame, Params)| {
            (*key, *frame, this.call(node, declared, *frame, params, &cook))
        };
        let watch = Stopwatch::start();
        let worth = self.pace[node].saturating_mul(jobs.len() as u32) > WORTH_A_THREAD;
        let mut cooked: Vec<_> = match jobs.len() > 1 && worth {
            true => jobs.par_iter().map(one).collect(),
            false => jobs.iter().map(one).collect(),
        };
        self.pace[node] = watch.wall() / (jobs.len().max(1) as u32);
        let mut outcomes: Vec<(Key, Frame, Outcome)> = Vec::with_capacity(cooked.len());
        for (key, frame, returned) in cooked.drain(..) {
            self.count(node, frame, returned.as_ref().err());
            outcomes.push((key, frame, self.take(node, frame, returned)));
        }
        for (frame, key) in keys {
            let Some((_, cooked_at, outcome)) = outcomes.iter().find(|(known, _, _)| *known == key) else { continue };
            self.results[node].insert(frame, outcome.clone());
            if *cooked_at != frame {
                let metrics = self.published(node, *cooked_at);
                self.publish(node, frame, &metrics);
            }
        }
    }

    /// Counts a call, unless an error upstream or of an earlier frame kept it from being made.
    fn count(&mut self, node: usize, frame: Frame, error: Option<&Arc<CookError>>) {
        let own = |error: &Arc<CookError>| error.node == self.plan.graph.nodes[node].id && error.frame == frame;
        self.report.nodes[node].cooks += u64::from(error.is_none_or(own));
    }

    /// Books what a call returned.
    fn take(&mut self, node: usize, frame: Frame, returned: Result<Returned, Arc<CookError>>) -> Outcome {
        let returned = returned?;
        let report = &mut self.report.nodes[node];
        report.peak_bytes = report.peak_bytes.max(returned.new_bytes);
        self.live_bytes += returned.new_bytes;
        self.node_bytes[node] += returned.new_bytes;
        self.publish(node, frame, &returned.metrics);
        self.asked.there.extend(returned.stripped);
        Ok(returned.cooked)
    }

    /// Calls a node for its outputs at a frame.
    fn call(
        &self,
        node: usize,
        declared: &'static Node,
        frame: Frame,
        params: &Params,
        cook: &(impl Fn(&FrameCx) -> crate::Result<Outputs> + Sync),
    ) -> Result<Returned, Arc<CookError>> {
        if self.dry {
            let cooked = declared.outputs.iter().map(|_| Arc::new(Geometry::default())).collect();
            return Ok(Returned { cooked, metrics: Vec::new(), new_bytes: 0, stripped: Vec::new() });
        }
        let inputs = self.inputs(node, declared, frame, params, Reading::Frame)?;
        let work = |cx: &FrameCx<'_>| cook(cx);
        let called = self.context(node, declared, frame, params, inputs).run(work);
        let checked = called.and_then(|(outputs, finished)| finished.check(outputs));
        checked.map_err(|error| Arc::new(self.plan.error(node, frame, error)))
    }

    /// What comes in through each input of a node.
    fn inputs(
        &self,
        node: usize,
        declared: &'static Node,
        frame: Frame,
        params: &Params,
        reading: Reading,
    ) -> Result<Vec<(&'static str, InputData)>, Arc<CookError>> {
        let start = match reading {
            Reading::Start => self.plan.start_of(declared, frame),
            Reading::Step | Reading::Frame => self.plan.graph.scene.start(),
        };
        let mut inputs = Vec::with_capacity(declared.inputs.len());
        for (place, input) in declared.inputs.iter().enumerate() {
            let spec = input.spec();
            let times = (spec.times)(params);
            let links = self.plan.links(node, place);
            let mut data = InputData::default();
            if times.now {
                data.now = self.wires(links, frame)?;
            }
            if times.start && matches!(reading, Reading::Start | Reading::Frame) && !self.is_chain(declared, reading) {
                data.start = self.wires(links, start)?;
            }
            if times.steps > 0 {
                let samples = match reading {
                    Reading::Step => self.plan.step_samples(links, times.steps, frame),
                    Reading::Start => vec![frame],
                    Reading::Frame => Vec::new(),
                };
                for sample in samples {
                    data.steps.push((sample, self.wires(links, sample)?));
                }
            }
            inputs.push((spec.name, data));
        }
        Ok(inputs)
    }

    /// Whether this reads for the output of a chain, which has seen its start long ago.
    fn is_chain(&self, declared: &Node, reading: Reading) -> bool {
        reading == Reading::Frame && declared.cook.is_chain()
    }

    fn wires(&self, links: &[Link], frame: Frame) -> Result<Vec<Arc<Geometry>>, Arc<CookError>> {
        let wire = |link: &Link| {
            let frame = self.plan.canonical(link.node, frame);
            let outcome = self.results[link.node].get(&frame).expect("the slice asked for every input");
            outcome.as_ref().map(|cooked| cooked[link.port].clone()).map_err(Arc::clone)
        };
        links.iter().map(wire).collect()
    }

    /// Keeps results that later slices will ask for again.
    fn keep(&mut self, node: usize) {
        let planned = &self.plan.nodes[node];
        let start = self.plan.graph.scene.start();
        let asked = || self.plan.request.outputs.iter().any(|place| self.plan.graph.outputs[*place].from.node == node);
        let still =
            !planned.varies && (asked() || planned.readers.iter().any(|reader| self.plan.nodes[*reader].varies));
        if (still || planned.read_at_start)
            && let Some(Ok(cooked)) = self.results[node].get(&start)
            && let Ok(spot) = self.keys.spot(node, start)
        {
            self.own.insert(spot.key);
            if self.verifying {
                self.engine.note_verified(spot.key, &self.report.nodes[node]);
            }
            let metrics = self.published(node, start);
            self.engine.store(|store| {
                if !store.contains(spot.key) {
                    store.keep(spot.key, cooked, metrics)
                }
            });
        }
        if planned.varies
            && planned.may_hold
            && let Some((frame, Ok(cooked))) = self.results[node].last_key_value()
            && let Ok(spot) = self.keys.spot(node, *frame)
            && self.held[node] != Some(spot.key)
        {
            self.own.insert(spot.key);
            let before = self.held[node].replace(spot.key);
            if let Some(before) = before {
                self.own.remove(&before);
            }
            let metrics = self.published(node, *frame);
            self.engine.store(|store| {
                before.into_iter().for_each(|key| store.drop(key));
                store.keep(spot.key, cooked, metrics);
            });
        }
    }

    fn forget(&mut self, node: usize) {
        self.results[node].clear();
        self.live_bytes -= std::mem::take(&mut self.node_bytes[node]);
    }

    fn forget_results(&mut self) {
        (0..self.results.len()).for_each(|node| self.forget(node));
    }

    /// Drops the states of windows that this slice did not move: what is asked lies beyond them.
    fn forget_windows_left_behind(&mut self) {
        for running in &mut self.running {
            running.retain(|stretch, running| stretch.until == i64::MAX || running.moved == self.slices);
        }
        self.slices += 1;
    }

    fn end_slice(&mut self) {
        self.forget_results();
        self.keys.end_slice();
        self.plan.files.release();
        for recent in &mut self.recent {
            while recent.len() > KEPT_NEIGHBOURS {
                recent.pop_first();
            }
        }
    }

    fn context<'a>(
        &'a self,
        node: usize,
        declared: &'static Node,
        frame: Frame,
        params: &Params,
        inputs: Vec<(&'static str, InputData)>,
    ) -> Call<'a> {
        let scene = &self.plan.graph.scene;
        Call {
            node: declared,
            frame,
            params: params.clone(),
            inputs,
            live: self.plan.nodes[node].live.as_deref(),
            cancel: self.cancel,
            clock: scene.clock(),
            origin: scene.origin,
            history: self.integrals[node].as_ref().map(|integrals| integrals as &dyn History),
        }
    }
}

/// Whole frames that a sample between frames may ask of a chain again.
const KEPT_NEIGHBOURS: usize = 4;

/// How far ahead of a chain that is far behind its inputs are asked for.
#[derive(Clone, Copy, PartialEq)]
enum Reach {
    /// All the way.
    Whole,
    /// As far as a slice moves it: enough to see which chains must move first.
    Near,
}

/// For which moment a node's inputs are gathered.
#[derive(Clone, Copy, PartialEq)]
enum Reading {
    /// A pure or frame node's cook, or a chain's output.
    Frame,
    /// A chain's start.
    Start,
    /// A chain's step.
    Step,
}
