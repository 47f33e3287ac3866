//! Cooks what a slice demands, node by node, all frames of a node in parallel.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use numerics::parallel;

use super::demand::NodeDemand;
use super::{Outcome, Sweep};
use crate::clock::Stopwatch;
use crate::cook::call::{Call, Returned};
use crate::error::CookError;
use crate::geometry::Geometry;
use crate::graph::{Body, Link};
use crate::key::ContentKey;
use crate::node::{Cook, FrameCx, History, InputData, Node, Outputs};
use crate::plan::{Read, Reads, ResolvedFrame};
use crate::time::Frame;

/// Work shorter than this is not worth handing to another thread.
const WORTH_A_THREAD: Duration = Duration::from_micros(20);

impl<'g> Sweep<'_, 'g, '_> {
    /// Cooks what a slice of these frames demands, node by node. Returns the greatest size of results held at once.
    pub(super) fn cook_slice(&mut self, demand: Vec<NodeDemand<'g>>, targets: &[Read], frames: &[Frame]) -> usize {
        let plan = self.plan;
        let mut readers_left: Vec<usize> = (0..demand.len()).map(|node| plan.readers(node).count()).collect();
        for target in targets {
            readers_left[target.node] += 1;
        }
        self.slice_frames = demand.iter().map(|demand| demand.frames.len()).max().unwrap_or(0);
        let mut peak = 0;
        for (node, demand) in demand.into_iter().enumerate().filter(|(node, _)| plan.nodes[*node].needed) {
            if self.cancelled() {
                return peak;
            }
            if !demand.is_empty() {
                let watch = Stopwatch::start();
                let (cooked, moved) = (demand.frames.clone(), demand.frames_moved());
                self.cook_node(node, demand);
                self.record_masks(node, &cooked);
                self.save_window_states(node, moved, watch.wall());
                self.save_results(node, &cooked, watch.wall());
                let report = &mut self.nodes[node].report;
                report.wall += watch.wall();
                report.cpu += watch.cpu();
                self.note_misread(node);
            }
            self.record_tips(node, frames);
            self.keep(node);
            peak = peak.max(self.live_bytes);
            let held = self.live_bytes + self.engine.store(|store| store.bytes());
            self.report.peak_bytes = self.report.peak_bytes.max(held);
            for source in plan.dag.sources(node) {
                readers_left[source] -= 1;
                if readers_left[source] == 0 {
                    self.forget(source);
                }
            }
        }
        peak
    }

    fn cook_node(&mut self, node: usize, demand: NodeDemand<'g>) {
        let declared = match &self.plan.graph.nodes[node].body {
            Body::Given { at, .. } => {
                for frame in demand.frames {
                    let given = self.executor.given(&**at, frame);
                    let outcome = given.map_err(|error| Arc::new(self.plan.error(node, frame, error)));
                    self.nodes[node].results.insert(frame, outcome);
                    self.nodes[node].report.cooks += 1;
                }
                return;
            }
            Body::Node { node, .. } => *node,
        };
        match declared.cook {
            Cook::Pure(_) | Cook::Frame { .. } => {
                let (between, mut frames): (BTreeSet<Frame>, BTreeSet<Frame>) =
                    demand.frames.into_iter().partition(|frame| self.plan.files_between(node, *frame).is_some());
                let near = between.iter().filter_map(|frame| self.plan.files_between(node, *frame));
                let near: BTreeSet<Frame> = near.flat_map(|(near, _)| near).collect();
                frames.extend(near.into_iter().filter(|frame| self.is_missing(node, *frame)));
                self.cook_frames(node, declared, &frames, |cx| declared.cook_frame(cx));
                between.into_iter().for_each(|frame| self.go_between_files(node, frame));
            }
            Cook::Window(chain, _) => self.cook_chain(node, declared, chain, demand),
            Cook::Solver(chain, _) => self.cook_chain(node, declared, chain, demand),
        }
    }

    /// Cooks a pure or frame node: each key once, all in parallel.
    fn cook_frames(
        &mut self,
        node: usize,
        declared: &'static Node,
        frames: &BTreeSet<Frame>,
        cook: impl Fn(&FrameCx) -> crate::Result<Outputs> + Sync,
    ) {
        let mut jobs: Vec<(Frame, Arc<ResolvedFrame<'g>>)> = Vec::new();
        let mut keys: Vec<(Frame, ContentKey)> = Vec::new();
        for frame in frames {
            let Ok(resolved) = self.keys.resolve(node, *frame) else { continue };
            keys.push((*frame, resolved.key));
            if !jobs.iter().any(|(_, job)| job.key == resolved.key) {
                jobs.push((*frame, resolved));
            }
        }
        let this = &*self;
        // After a cancellation calls that are under way end, but none starts.
        let one = |(frame, resolved): &(Frame, Arc<ResolvedFrame<'g>>)| {
            let call = || (resolved.key, *frame, this.call(node, declared, *frame, &resolved.reads, &cook));
            (!this.cancelled()).then(call)
        };
        let watch = Stopwatch::start();
        let worth = self.nodes[node].call_time.saturating_mul(jobs.len() as u32) > WORTH_A_THREAD;
        let cooked: Vec<_> = match jobs.len() > 1 && worth {
            true => parallel::map(&jobs, |_, job| one(job)).into_iter().flatten().collect(),
            false => jobs.iter().filter_map(one).collect(),
        };
        self.nodes[node].call_time = watch.wall() / (jobs.len().max(1) as u32);
        let mut outcomes: Vec<(ContentKey, Frame, Outcome)> = Vec::with_capacity(cooked.len());
        for (key, frame, returned) in cooked {
            self.count_call(node, frame, returned.as_ref().err());
            outcomes.push((key, frame, self.record_result(node, frame, returned)));
        }
        for (frame, key) in keys {
            let Some((_, cooked_at, outcome)) = outcomes.iter().find(|(known, _, _)| *known == key) else { continue };
            self.nodes[node].results.insert(frame, outcome.clone());
            if *cooked_at != frame {
                let metrics = self.published(node, *cooked_at);
                self.publish(node, frame, &metrics);
            }
        }
    }

    /// Gives a source of numbered files its result between two whole frames, which have theirs.
    fn go_between_files(&mut self, node: usize, frame: Frame) {
        let Some((near, share)) = self.plan.files_between(node, frame) else { return };
        let found = near.map(|whole| self.nodes[node].results.get(&whole).cloned());
        let [Some(before), Some(after)] = found else { return };
        let outcome = before.and_then(|before| Ok(self.executor.between_files([&before, &after?], share)));
        self.nodes[node].results.insert(frame, outcome);
        let metrics = self.published(node, near[0]);
        self.publish(node, frame, &metrics);
    }

    /// Counts a call, unless an error upstream or at an earlier frame kept it from being made.
    pub(super) fn count_call(&mut self, node: usize, frame: Frame, error: Option<&Arc<CookError>>) {
        let own = |error: &Arc<CookError>| error.node == self.plan.graph.nodes[node].id && error.frame == frame;
        self.nodes[node].report.cooks += u64::from(error.is_none_or(own));
    }

    /// Records what a call returned.
    pub(super) fn record_result(
        &mut self,
        node: usize,
        frame: Frame,
        returned: Result<Returned, Arc<CookError>>,
    ) -> Outcome {
        let returned = returned?;
        let run = &mut self.nodes[node];
        run.report.peak_bytes = run.report.peak_bytes.max(returned.new_bytes);
        run.bytes += returned.new_bytes;
        self.live_bytes += returned.new_bytes;
        let room = self.engine.memory.saturating_sub(self.live_bytes);
        self.engine.store(|store| store.make_room(room));
        self.publish(node, frame, &returned.metrics);
        self.observed.unused.extend(returned.stripped);
        Ok(returned.cooked)
    }

    /// Calls a node for its outputs at a frame.
    pub(super) fn call(
        &self,
        node: usize,
        declared: &'static Node,
        frame: Frame,
        reads: &Reads<'_>,
        cook: &(impl Fn(&FrameCx) -> crate::Result<Outputs> + Sync),
    ) -> Result<Returned, Arc<CookError>> {
        let call = self.prepare(node, declared, frame, reads)?;
        let returned = self.executor.call(call, &|cx: &FrameCx<'_>| cook(cx));
        returned.map_err(|error| Arc::new(self.plan.error(node, frame, error)))
    }

    /// A call of a node with its params and the results it reads.
    pub(super) fn prepare<'a>(
        &'a self,
        node: usize,
        declared: &'static Node,
        frame: Frame,
        reads: &Reads<'_>,
    ) -> Result<Call<'a>, Arc<CookError>> {
        let mut inputs = Vec::with_capacity(reads.inputs.len());
        for input in &reads.inputs {
            let at = |frame: &Frame| self.fetch(input.links, *frame);
            let data = InputData {
                now: input.now.as_ref().map(at).transpose()?.unwrap_or_default(),
                start: input.start.as_ref().map(at).transpose()?.unwrap_or_default(),
                steps: input
                    .steps
                    .iter()
                    .map(|frame| at(frame).map(|wires| (*frame, wires)))
                    .collect::<Result<_, _>>()?,
            };
            inputs.push((input.name, data));
        }
        let scene = &self.plan.graph.scene;
        Ok(Call {
            node: declared,
            frame,
            params: reads.params.clone(),
            inputs,
            live: self.plan.nodes[node].live.as_deref(),
            if_there: &self.plan.nodes[node].if_there,
            outputs_used: &self.plan.nodes[node].outputs_used,
            cancel: self.cancel,
            clock: scene.clock(),
            origin: scene.origin,
            history: self.nodes[node].integrals.as_ref().map(|integrals| integrals as &dyn History),
            ceiling: self.engine.ceiling,
            held: self.live_bytes / self.slice_frames.max(1),
        })
    }

    /// The results at the other ends of some wires.
    fn fetch(&self, links: &[Link], frame: Frame) -> Result<Vec<Arc<Geometry>>, Arc<CookError>> {
        links.iter().map(|link| self.geometry(self.plan.read(*link, frame))).collect()
    }
}
