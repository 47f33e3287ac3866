//! The sweep: goes through the frames of a request in slices, oldest first; see the module above for the idea.
//!
//! For each slice, `demand` finds what must be there and is not, `warm_up` moves windows and solvers that are far behind,
//! `nodes` and `chains` cook node by node, `retention` keeps what later slices read and drops the rest.

mod chains;
mod coarse;
mod demand;
mod executor;
mod jumps;
mod masks;
mod metrics;
mod nodes;
mod notes;
mod results;
mod retention;
mod states;
mod warm_up;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use numerics::parallel;

use super::store::Cooked;
use super::{Delivered, DiskCache, Engine, NodeReport, Report, Sink, Stopped, deliver};
use crate::clock::Stopwatch;
use crate::error::{CookError, Error};
use crate::geometry::Geometry;
use crate::graph::Body;
use crate::key::{ContentKey, Hasher};
use crate::node::StateBox;
use crate::note::{Note, kind};
use crate::plan::{ChainSegment, Integrals, Keys, Plan, Read};
use crate::time::Frame;
use chains::Recent;
use demand::Lookahead;
pub(super) use executor::Executor;
use jumps::Jumps;
use masks::Masks;
use notes::Observed;
use results::OnDisk;

/// A result, or the error that spoiled it.
type Outcome = Result<Cooked, Arc<CookError>>;

/// A finished frame that must be cooked: its output, its frame, and its key where there is a disk cache.
type Missing = (usize, Frame, Option<ContentKey>);

/// Most frames that a chain moves in one slice, and that a slice spans where there are chains.
const MOST_CHAIN_FRAMES: i64 = 16;

/// Most frames of a slice.
const MOST_FRAMES: usize = 16;

/// How long a slice should take at most where there is a disk cache: what a killed cook loses, as the frames of a slice
/// are finished together. Without one nothing would be gained, and frames that share half a frame cook it twice.
const SLICE_TIME: Duration = Duration::from_millis(250);

/// The share of the time spent so far, one part in this, that a slice should take at most where there is a disk cache.
const SLICE_SHARE: u32 = 16;

/// Bytes of results a slice should hold: a few times a core's cache, so that a node finds its input there.
const SLICE_BYTES: usize = 16 << 20;

/// The same where there is a solver: a step goes through more memory than any cache holds, so results of the frames before
/// are not found there.
const SOLVER_SLICE_BYTES: usize = 4 << 20;

/// The state of a window or solver after a frame.
struct ChainState {
    at: i64,
    state: Result<StateBox, Arc<CookError>>,
    /// The slice that moved it last.
    moved: u64,
    /// Whether it is as it was read from disk, to be given its inputs.
    is_saved: bool,
}

/// What a sweep holds of one node.
struct NodeRun<'p> {
    /// Results of the current slice, by canonical frame.
    results: BTreeMap<Frame, Outcome>,
    /// Bytes that these results added.
    bytes: usize,
    /// States of a window or solver, from which later slices go on.
    states: BTreeMap<ChainSegment, ChainState>,
    /// Outputs of a window or solver at the last whole frames, which samples between frames read again.
    recent: BTreeMap<i64, Recent>,
    integrals: Option<Integrals<'p>>,
    on_disk: OnDisk,
    /// Mean wall time of a call in the last slice.
    call_time: Duration,
    /// Keys of results that are kept because later frames may have the same, or read them.
    held: BTreeMap<Frame, ContentKey>,
    /// Key of the result that is the same at all frames, or read at the start, if it is kept.
    reread: Option<ContentKey>,
    masks: Masks,
    /// Metrics that were not finite at some frame.
    left_out_metrics: BTreeSet<&'static str>,
    jumps: Jumps,
    report: NodeReport,
}

/// A cook that is under way.
pub(super) struct Sweep<'p, 'g, 'e> {
    engine: &'e Engine,
    plan: &'p Plan<'g>,
    executor: Executor,
    disk: Option<&'e mut DiskCache>,
    /// Nodes whose results are made and kept, instead of the outputs; empty: the outputs.
    until: Vec<usize>,
    /// Whether no later cook has this plan.
    ends_plan: bool,
    cancel: &'p AtomicBool,
    keys: Keys<'p, 'g>,
    nodes: Vec<NodeRun<'p>>,
    /// Slices cooked so far.
    slices: u64,
    /// Keys of results that this cook has made or found.
    own: BTreeSet<ContentKey>,
    observed: Observed,
    /// Bytes of all results of the slice.
    live_bytes: usize,
    /// Most frames of the slice that a node cooks.
    slice_frames: usize,
    /// Most bytes that one frame of a slice took.
    frame_bytes: usize,
    /// Time that a frame of the last slice took; `None` before one was cooked.
    frame_time: Option<Duration>,
    report: Report,
}

impl<'p> NodeRun<'p> {
    fn new(plan: &'p Plan<'_>, index: usize, cancel: &'p AtomicBool) -> Self {
        let (node, planned) = (&plan.graph.nodes[index], &plan.nodes[index]);
        let integrates = node.node().filter(|declared| declared.integrands[0].is_some());
        Self {
            results: BTreeMap::new(),
            bytes: 0,
            states: BTreeMap::new(),
            recent: BTreeMap::new(),
            integrals: integrates.map(|node| Integrals::new(&planned.resolver, node, &plan.graph.scene, cancel)),
            on_disk: OnDisk::default(),
            call_time: Duration::MAX,
            held: BTreeMap::new(),
            reread: None,
            masks: Masks::new(),
            left_out_metrics: BTreeSet::new(),
            jumps: Jumps::default(),
            report: NodeReport {
                id: Some(node.id.clone()),
                type_name: node.type_name(),
                time: node.node().map_or("given", |node| node.cook.word()),
                needed: planned.needed,
                bypassed: plan.graph.bypassed.contains(&node.id),
                varies: planned.varies,
                left_out: if planned.needed { plan.left_out(index) } else { Vec::new() },
                explained: if planned.needed { plan.explained(index) } else { Vec::new() },
                ..NodeReport::default()
            },
        }
    }
}

impl<'p, 'g, 'e> Sweep<'p, 'g, 'e> {
    pub(super) fn new(
        engine: &'e Engine,
        plan: &'p Plan<'g>,
        executor: Executor,
        disk: Option<&'e mut DiskCache>,
        cancel: &'p AtomicBool,
    ) -> Self {
        // The key of given geometry is of this plan alone, so nothing made of it may outlive the cook.
        let given = plan.graph.nodes.iter().any(|node| matches!(node.body, Body::Given { .. }));
        Self {
            engine,
            plan,
            executor,
            disk: disk.filter(|_| !given),
            until: Vec::new(),
            ends_plan: false,
            cancel,
            keys: Keys::new(plan, cancel),
            nodes: (0..plan.graph.nodes.len()).map(|index| NodeRun::new(plan, index, cancel)).collect(),
            slices: 0,
            own: BTreeSet::new(),
            observed: Observed::of(plan),
            live_bytes: 0,
            slice_frames: 0,
            frame_bytes: 0,
            frame_time: None,
            report: Report { notes: plan.graph.notes.clone(), ..Report::default() },
        }
    }

    /// Makes the results of these nodes and keeps them on disk, whatever they cost, and delivers nothing.
    pub(super) fn until(mut self, nodes: &[usize]) -> Self {
        self.until = nodes.to_vec();
        self
    }

    /// Keeps nothing that only a later cook of the same plan would find: nobody has the plan afterwards.
    pub(super) fn ending_the_plan(mut self) -> Self {
        self.ends_plan = true;
        self
    }

    pub(super) fn run<E: Send>(mut self, sink: &mut Sink<'_, E>) -> Result<Report, Stopped<E>> {
        let watch = Stopwatch::start();
        let cooked = self.cook_slices(sink);
        if self.ends_plan {
            self.forget_given();
        }
        cooked?;
        let disk = self.disk.iter().flat_map(|disk| disk.notes());
        self.report.notes.extend(disk.map(|text| Note::new(kind::CACHE, text)));
        self.note_frames_outside();
        self.note_missing_attributes();
        self.note_empty_outputs();
        self.note_coarse_positions();
        self.note_zero_masks();
        self.note_masks_outside();
        self.report_jumps();
        self.note_warnings();
        let window = |(index, run): (usize, NodeRun<'_>)| NodeReport { window: self.keys.window(index), ..run.report };
        self.report.nodes = self.nodes.into_iter().enumerate().map(window).collect();
        self.report.wall = watch.wall();
        self.report.cpu = watch.cpu();
        Ok(self.report)
    }

    fn cook_slices<E: Send>(&mut self, sink: &mut Sink<'_, E>) -> Result<(), Stopped<E>> {
        let plan = self.plan;
        let chains = plan
            .graph
            .nodes
            .iter()
            .zip(&plan.nodes)
            .any(|(node, planned)| planned.needed && node.node().is_some_and(|declared| declared.cook.is_chain()));
        let (mut next, mut before) = (0, None);
        while let Some(first) = plan.request.frames.get(next) {
            let fits = |frame: &Frame| !chains || frame.ticks() - first.ticks() < MOST_CHAIN_FRAMES * Frame::TICKS;
            let frames = (next..next + self.slice_length()).map_while(|index| plan.request.frames.get(index));
            let slice: Vec<Frame> = frames.take_while(fits).collect();
            next += slice.len();
            let cooking = Stopwatch::start();
            let finished = self.slice(&slice);
            self.compare_tips(before, &slice);
            before = slice.last().copied();
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
        Ok(())
    }

    fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// As many frames as fit a core's cache, and the memory asked for.
    fn slice_length(&self) -> usize {
        if !self.executor.delivers() {
            return MOST_FRAMES;
        }
        // The first frame shows how much one takes. A sample between frames reads whole frames on both sides of it, which
        // lie behind a chain that has been at the first frame.
        if self.frame_bytes == 0 && self.report.delivered.is_empty() {
            let frames = &self.plan.request.frames;
            let second = frames.get(0).zip(frames.get(1));
            return if second.is_some_and(|(first, second)| second.ticks() - first.ticks() < Frame::TICKS) {
                2
            } else {
                1
            };
        }
        let threads = rayon::current_num_threads();
        let bytes = self.frame_bytes.max(1);
        let most = (self.engine.memory / 2 / bytes).clamp(1, MOST_FRAMES);
        let in_time = match (&self.disk, self.frame_time) {
            (None, _) => usize::MAX,
            (Some(_), None) => 0,
            (Some(_), Some(time)) => {
                let most = SLICE_TIME.min(self.report.cooking / SLICE_SHARE);
                (most.as_nanos() / time.as_nanos().max(1)) as usize
            }
        };
        let has_solver = self.plan.nodes.iter().any(|planned| planned.needed && planned.has_solver);
        let wanted = if has_solver { SOLVER_SLICE_BYTES } else { SLICE_BYTES };
        (wanted / bytes).min(in_time).clamp(threads.min(most), most)
    }

    /// Cooks some frames of all outputs of the request.
    fn slice(&mut self, frames: &[Frame]) -> Vec<Delivered> {
        let watch = Stopwatch::start();
        let (mut finished, missing) = match self.until.is_empty() {
            true => self.find_on_disk(frames),
            false => (Vec::new(), Vec::new()),
        };
        let reads =
            missing.iter().flat_map(|(output, frame, _)| self.plan.delivery(*output, *frame).all().collect::<Vec<_>>());
        let targets: Vec<Read> = reads.chain(self.reads_until(frames)).collect();
        self.warm_up_chains(&targets);
        let demand = self.collect_demand(&targets, &[], Lookahead::Whole);
        let peak = self.cook_slice(demand, &targets, frames);
        if self.cancelled() {
            return finished;
        }
        self.frame_bytes = self.frame_bytes.max(peak / frames.len().max(1));
        self.record_errors_until(&targets);
        let of_nodes = frames.iter().filter(|_| !self.until.is_empty()).copied();
        let mut cooked: Vec<Frame> = missing.iter().map(|(_, frame, _)| *frame).chain(of_nodes).collect();
        cooked.dedup();
        if !cooked.is_empty() {
            self.frame_time = Some(watch.wall() / cooked.len() as u32);
        }
        if self.executor.delivers() {
            self.finish_outputs(missing, &mut finished);
        }
        finished.sort_by_key(|delivered| (delivered.frame, delivered.output));
        finished.iter().for_each(|delivered| self.observed.record(delivered));
        self.end_slice();
        self.forget_windows_left_behind();
        finished
    }

    /// Finished frames that are on disk; and output, frame and key of those that must be cooked.
    fn find_on_disk(&mut self, frames: &[Frame]) -> (Vec<Delivered>, Vec<Missing>) {
        let plan = self.plan;
        let (mut finished, mut missing) = (Vec::new(), Vec::new());
        for frame in frames {
            // Nodes that a frame on disk saves from cooking, each once.
            let mut saved: BTreeSet<usize> = BTreeSet::new();
            for output in &plan.request.outputs {
                let key = self.disk.is_some().then(|| self.output_key(*output, *frame)).flatten();
                let found = key.and_then(|key| self.disk.as_mut().and_then(|disk| disk.frame(key)));
                match found {
                    Some((geometry, metrics)) => {
                        self.report.from_disk += 1;
                        self.publish_kept(*output, *frame, &metrics);
                        let from = plan.graph.outputs[*output].from;
                        if from.port == 0 {
                            self.record_tips_of(from.node, *frame, &geometry);
                        }
                        saved.extend(plan.ancestors(from.node));
                        finished.push(Delivered { output: *output, frame: *frame, geometry: Arc::new(geometry) });
                    }
                    None => missing.push((*output, *frame, key)),
                }
            }
            saved.into_iter().for_each(|node| self.nodes[node].report.from_disk += 1);
        }
        (finished, missing)
    }

    /// Delivers the frames that were cooked, and saves them to disk.
    fn finish_outputs(&mut self, cooked: Vec<Missing>, finished: &mut Vec<Delivered>) {
        let made = parallel::map(&cooked, |_, (output, frame, _)| self.delivered(*output, *frame));
        for ((output, frame, key), result) in cooked.into_iter().zip(made) {
            match result {
                Ok(geometry) => {
                    if let Some(key) = key {
                        let metrics = self.metrics_to_keep(output, frame);
                        if let Some(disk) = self.disk.as_mut() {
                            disk.save_frame(key, &geometry, &metrics);
                        }
                    }
                    finished.push(Delivered { output, frame, geometry });
                }
                Err(error) => self.record_error(output, error),
            }
        }
    }

    fn record_error(&mut self, output: usize, error: Arc<CookError>) {
        let known = self.report.errors.iter_mut().find(|(of, known, _)| *of == output && known.node == error.node);
        match known {
            Some((_, _, frames)) => *frames += 1,
            None => self.report.errors.push((output, error, 1)),
        }
    }

    /// The key of a finished frame; `None` where a param is refused there.
    fn output_key(&mut self, output: usize, frame: Frame) -> Option<ContentKey> {
        let plan = self.plan;
        let asked = &plan.graph.outputs[output];
        let mut hasher = Hasher::default();
        hasher.tag(20).i64(asked.from.port as i64).i64(i64::from(asked.v));
        let names = asked.attributes.as_deref().unwrap_or_default();
        hasher.i64(i64::from(asked.attributes.is_some())).i64(names.len() as i64);
        names.iter().fold(&mut hasher, |hasher, name| hasher.text(name));
        for read in plan.delivery(output, frame).all() {
            hasher.key(self.keys.resolve(read.node, read.frame).ok()?.key).f64(plan.graph.scene.fps);
        }
        Some(hasher.finish())
    }

    /// What an output delivers at a frame, from the results of the slice.
    fn delivered(&self, output: usize, frame: Frame) -> Result<Arc<Geometry>, Arc<CookError>> {
        let reads = self.plan.delivery(output, frame);
        let geometry = self.geometry(reads.now)?;
        let output = &self.plan.graph.outputs[output];
        let of_solver = self.plan.nodes[output.from.node].has_solver;
        let around = reads.around.map(|(results, seconds)| -> Result<_, Arc<CookError>> {
            let [before, after] = results.map(|read| self.geometry(read));
            Ok(deliver::Around { results: [before?, after?], seconds, of_solver })
        });
        let finished = deliver::finish(output, &geometry, around.transpose()?.as_ref());
        finished.map(Arc::new).map_err(|error| Arc::new(self.plan.error(output.from.node, frame, error)))
    }

    /// The geometry of a result that was demanded.
    fn geometry(&self, read: Read) -> Result<Arc<Geometry>, Arc<CookError>> {
        match self.nodes[read.node].results.get(&read.frame) {
            Some(Ok(cooked)) => Ok(cooked[read.port].clone()),
            Some(Err(error)) => Err(error.clone()),
            None => Err(self.not_cooked(read.node, read.frame)),
        }
    }

    /// The error of a result that was dropped before its last reader: a fault of the engine.
    fn not_cooked(&self, node: usize, frame: Frame) -> Arc<CookError> {
        Arc::new(self.plan.error(node, frame, Error::contract("the engine read its result without having cooked it")))
    }
}
