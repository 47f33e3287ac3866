//! Keys of results: a hash of exactly what a node reads, at the frames at which it reads it.
//!
//! The key of a chain's state includes the key of the previous frame's state: editing anything upstream invalidates its
//! checkpoints, and editing a key frame invalidates only what comes after it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::history::{gauss_points, history_start};
use super::segments::{Anchors, ChainSegment, LEAST_SPACING, Window, segment};
use super::{Moment, Plan, PlannedNode, Reads};
use crate::error::{CookError, Error, ErrorKind, Result};
use crate::graph::Body;
use crate::key::{ContentKey, Hasher};
use crate::node::{Cook, Node};
use crate::param::Params;
use crate::time::Frame;

/// What is known of a node at one frame before it cooks.
pub(crate) struct ResolvedFrame<'g> {
    pub(crate) reads: Reads<'g>,
    pub(crate) key: ContentKey,
}

type Resolved<'g> = std::result::Result<Arc<ResolvedFrame<'g>>, Arc<CookError>>;
type KeyOrError = std::result::Result<ContentKey, Arc<CookError>>;

/// Results whose keys must be found first: node and canonical frame.
type Missing = Vec<(usize, Frame)>;

/// Keys known of one node.
#[derive(Default)]
struct NodeKeys<'g> {
    /// By canonical frame.
    frames: BTreeMap<Frame, Resolved<'g>>,
    /// Of a chain's states: by segment, the last ones found.
    states: BTreeMap<ChainSegment, StateKeys>,
    /// Of what its integrands were from frame 0 on, frame by frame.
    history: Vec<ContentKey>,
    /// Of what its integrands were before frame 0.
    before: Option<ContentKey>,
    anchors: Option<Anchors>,
    /// What the next state reads, while the keys of that are being found.
    pending: Option<(Moment, Reads<'g>)>,
}

/// A result whose key is being found.
struct Task<'g> {
    node: usize,
    frame: Frame,
    /// What it reads, where that is known: from the second visit on.
    reads: Option<Reads<'g>>,
}

/// Keys of successive states. The last [`KEPT_STATES`] are remembered: a chain may start any number of frames back.
#[derive(Default)]
struct StateKeys {
    keys: VecDeque<KeyOrError>,
    /// How many were found before those remembered.
    before: usize,
}

/// Finds keys, and remembers those of the current slice.
pub(crate) struct Keys<'p, 'g> {
    plan: &'p Plan<'g>,
    /// Set when the cook is cancelled: a chain that starts far back has a key for every frame since.
    cancel: &'p AtomicBool,
    nodes: Vec<NodeKeys<'g>>,
    hasher: Hasher,
}

/// Frames that keys of segments are kept for after their end.
const KEPT_FRAMES: i64 = 4 * LEAST_SPACING;

/// Keys of a chain's states that are remembered; an earlier one is found again from the start.
const KEPT_STATES: usize = 1 << 14;

impl<'p, 'g> Keys<'p, 'g> {
    pub(crate) fn new(plan: &'p Plan<'g>, cancel: &'p AtomicBool) -> Self {
        let nodes = plan.graph.nodes.iter().map(|_| NodeKeys::default()).collect();
        Self { plan, cancel, nodes, hasher: Hasher::default() }
    }

    /// Forgets what belongs to the slice; keys of chains and of nodes that are the same at all frames stay.
    pub(crate) fn end_slice(&mut self) {
        for (keys, planned) in self.nodes.iter_mut().zip(&self.plan.nodes) {
            if planned.varies {
                keys.frames.clear();
            }
        }
    }

    /// Forgets the segments of windows that end well before `frame`, which nothing asks for any more.
    pub(crate) fn forget_before(&mut self, frame: i64) {
        for keys in &mut self.nodes {
            keys.states.retain(|segment, _| segment.until > frame - KEPT_FRAMES);
            keys.anchors.iter_mut().for_each(|anchors| anchors.forget_before(frame - KEPT_FRAMES));
        }
    }

    /// What is known of `node` at a canonical frame; for a window or solver, of its output.
    ///
    /// # Errors
    /// Where a param of the node, or of anything it reads, is refused.
    pub(crate) fn resolve(&mut self, node: usize, frame: Frame) -> Resolved<'g> {
        // A stack of its own, because a graph may be deeper than that of the thread.
        let mut tasks = vec![Task { node, frame, reads: None }];
        while let Some(Task { node, frame, reads }) = tasks.pop() {
            if self.nodes[node].frames.contains_key(&frame) {
                continue;
            }
            let resolved = match reads.map_or_else(|| self.plan.reads(node, self.moment(node, frame)), Ok) {
                Err(error) => Err(error),
                Ok(reads) => match self.find(node, frame, &reads) {
                    Ok(key) => key.map(|key| Arc::new(ResolvedFrame { reads, key })),
                    Err(missing) => {
                        tasks.push(Task { node, frame, reads: Some(reads) });
                        // In this order the first is found first.
                        let missing = missing.into_iter().rev();
                        tasks.extend(missing.map(|(node, frame)| Task { node, frame, reads: None }));
                        continue;
                    }
                },
            };
            self.nodes[node].frames.insert(frame, resolved);
        }
        self.nodes[node].frames[&frame].clone()
    }

    /// When a result at `frame` reads.
    fn moment(&self, node: usize, frame: Frame) -> Moment {
        match self.plan.graph.nodes[node].node() {
            Some(declared) if declared.cook.is_chain() => Moment::ChainOutput(frame),
            _ => Moment::Frame(frame),
        }
    }

    /// The key of a result that reads these, unless keys of them are missing.
    fn find(&mut self, node: usize, frame: Frame, reads: &Reads<'g>) -> std::result::Result<KeyOrError, Missing> {
        let plan = self.plan;
        let body = &plan.graph.nodes[node].body;
        match body {
            Body::Given { moves, .. } => {
                let hasher = self.hasher.tag(1).i64(plan.number as i64).i64(node as i64);
                hasher.i64(if *moves { frame.ticks() } else { 0 });
            }
            Body::Node { node: declared, .. } if declared.cook.is_chain() => {
                // Between whole frames an output is made of its neighbours each way.
                let mut states = Vec::new();
                for whole in plan.output_frames(frame).all().iter().copied() {
                    let state = match self.segment(node, whole) {
                        Ok(segment) => self.find_state_key(node, segment, whole.max(segment.start))?,
                        Err(error) => Err(error),
                    };
                    match state {
                        Ok(key) => states.push(key),
                        Err(error) => return Ok(Err(error)),
                    }
                }
                // And of the input that it follows there.
                let followed = match frame.is_whole() {
                    true => None,
                    false => match self.input_keys(reads)? {
                        Ok(inputs) => Some(inputs),
                        Err(error) => return Ok(Err(error)),
                    },
                };
                let hasher = self.hasher.tag(3).i64(frame.ticks());
                let hasher = states.into_iter().fold(hasher, Hasher::key);
                followed.into_iter().for_each(|inputs| inputs.hash(hasher));
            }
            Body::Node { .. } if let Some((near, _)) = plan.files_between(node, frame) => {
                let known = near.map(|whole| self.nodes[node].frames.get(&whole).cloned());
                let missing: Missing = near
                    .into_iter()
                    .zip(&known)
                    .filter(|(_, known)| known.is_none())
                    .map(|(at, _)| (node, at))
                    .collect();
                let [Some(before), Some(after)] = known else { return Err(missing) };
                match (before, after) {
                    (Ok(before), Ok(after)) if before.key == after.key => return Ok(Ok(before.key)),
                    (Ok(before), Ok(after)) => {
                        let within = frame.ticks() - frame.floor().ticks();
                        self.hasher.tag(9).i64(within).key(before.key).key(after.key);
                    }
                    (Err(error), _) | (_, Err(error)) => return Ok(Err(error)),
                }
            }
            Body::Node { node: declared, .. } => {
                let inputs = match self.input_keys(reads)? {
                    Ok(inputs) => inputs,
                    Err(error) => return Ok(Err(error)),
                };
                let clock = match declared.cook {
                    Cook::Frame { reads_clock, .. } if reads_clock(&reads.params) => {
                        match self.clock_key(node, declared, frame) {
                            Ok(key) => Some(key),
                            Err(error) => return Ok(Err(Arc::new(plan.error(node, frame, error)))),
                        }
                    }
                    _ => None,
                };
                let hasher = self.hasher.tag(2);
                hash_recipe(hasher, declared, &reads.params);
                if let Some(clock) = clock {
                    hasher.key(clock);
                }
                inputs.hash(hasher);
            }
        }
        Ok(Ok(self.finish_with_live(node)))
    }

    /// Completes a key by the attributes and outputs that are used of the node's result.
    fn finish_with_live(&mut self, node: usize) -> ContentKey {
        let PlannedNode { live, if_there, outputs_used, .. } = &self.plan.nodes[node];
        let names = live.as_deref().unwrap_or_default();
        let hasher = self.hasher.tag(u8::from(live.is_some())).i64(names.len() as i64);
        let hasher = names.iter().fold(hasher, |hasher, name| hasher.text(name)).i64(if_there.len() as i64);
        let hasher = if_there.iter().fold(hasher, |hasher, name| hasher.text(name));
        outputs_used.iter().fold(hasher, |hasher, is_used| hasher.i64(i64::from(*is_used))).finish()
    }

    /// Keys of all results that are read, or those that are missing.
    fn input_keys(&self, reads: &Reads<'g>) -> std::result::Result<InputKeysOrError, Missing> {
        let (mut keys, mut missing) = (Vec::new(), Missing::new());
        for input in &reads.inputs {
            for read in input.results(self.plan) {
                match self.nodes[read.node].frames.get(&read.frame) {
                    Some(Ok(resolved)) => keys.push((read.port, resolved.key)),
                    // Of several errors the first is reported, and what follows it need not be known.
                    Some(Err(error)) if missing.is_empty() => return Ok(Err(error.clone())),
                    Some(Err(_)) => return Err(missing),
                    None => missing.push((read.node, read.frame)),
                }
            }
            // Marks the end of a list, so that a wire moved from one input to the next changes the key.
            keys.push((usize::MAX, ContentKey::default()));
        }
        if missing.is_empty() { Ok(Ok(InputKeys(keys))) } else { Err(missing) }
    }

    /// A key of the frame, the scene's clock and origin, and the history of the node's integrands.
    fn clock_key(&mut self, node: usize, declared: &Node, frame: Frame) -> Result<ContentKey> {
        let scene = &self.plan.graph.scene;
        let resolver = &self.plan.nodes[node].resolver;
        let animated = declared.integrands[0].is_some() && resolver.history_is_animated();
        let history = match animated {
            true => Some(self.history_key(node, declared, frame)?),
            false => None,
        };
        let hasher = self.hasher.tag(4).i64(frame.ticks()).f64(scene.fps);
        scene.origin.iter().fold(hasher, |hasher, x| hasher.f64(*x));
        if let Some(history) = history {
            self.hasher.key(history);
        }
        Ok(self.hasher.finish())
    }

    /// A key of the integrands' values at the Gauss points of every integral that [`crate::node::FrameCx::integrals`] can
    /// give at `frame`: from the scene's start or frame 0, whichever is earlier, to `frame`. Chained frame by frame.
    fn history_key(&mut self, node: usize, declared: &Node, frame: Frame) -> Result<ContentKey> {
        let resolver = &self.plan.nodes[node].resolver;
        let value = |at: f64| -> Result<Vec<f64>> {
            let params = resolver.past(at)?;
            Ok(declared.integrands.iter().flatten().flat_map(|integrand| integrand(&params)).collect())
        };
        let over = |hasher: &mut Hasher, from: f64, to: f64| -> Result<()> {
            for x in gauss_points(from, to) {
                value(x)?.iter().fold(&mut *hasher, |hasher, x| hasher.f64(*x));
            }
            Ok(())
        };
        let cancel = self.cancel;
        let cancelled = || match cancel.load(Ordering::Relaxed) {
            true => Err(Error::new(ErrorKind::Cancelled, "the cook was cancelled")),
            false => Ok(()),
        };
        // A hasher of its own: params refused midway must not leave half a recipe in the shared one.
        let mut hasher = Hasher::default();
        let before = match self.nodes[node].before {
            Some(before) => before,
            None => {
                let since = history_start(&self.plan.graph.scene);
                value(since as f64)?.iter().fold(hasher.tag(5), |hasher, x| hasher.f64(*x));
                for k in since..0 {
                    cancelled()?;
                    over(&mut hasher, (k + 1) as f64, k as f64)?;
                }
                *self.nodes[node].before.insert(hasher.finish())
            }
        };
        let whole = frame.floor_number().max(0) as usize;
        let known = &mut self.nodes[node].history;
        if known.is_empty() {
            known.push(before);
        }
        while known.len() <= whole {
            cancelled()?;
            let k = known.len();
            hasher.tag(6).key(known[k - 1]);
            over(&mut hasher, (k - 1) as f64, k as f64)?;
            known.push(hasher.finish());
        }
        hasher.tag(8).key(known[whole]);
        if !frame.is_whole() {
            let from = if frame.ticks() < 0 { frame.ceil() } else { frame.floor() };
            over(&mut hasher, from.number(), frame.number())?;
        }
        Ok(hasher.finish())
    }

    /// The segment that gives the output of a window or solver at `frame`.
    ///
    /// # Errors
    /// Where a param is refused at a frame that decides where the state starts.
    pub(crate) fn segment(&mut self, node: usize, frame: i64) -> std::result::Result<ChainSegment, Arc<CookError>> {
        segment(self.plan, node, frame, &mut self.nodes[node].anchors)
    }

    /// How far back a window goes, once one of its frames was asked.
    pub(crate) fn window(&self, node: usize) -> Option<Window> {
        self.nodes[node].anchors.as_ref().map(|anchors| anchors.window)
    }

    /// The key of a chain's state at `frame`, which lies in the segment.
    ///
    /// # Errors
    /// Where a param is refused at that frame or an earlier one.
    pub(crate) fn state_key(&mut self, node: usize, segment: ChainSegment, frame: i64) -> KeyOrError {
        loop {
            match self.find_state_key(node, segment, frame) {
                Ok(key) => return key,
                Err(missing) => missing.into_iter().for_each(|(node, frame)| drop(self.resolve(node, frame))),
            }
        }
    }

    /// The key of a chain's state, unless keys of what it reads are missing.
    fn find_state_key(
        &mut self,
        node: usize,
        segment: ChainSegment,
        frame: i64,
    ) -> std::result::Result<KeyOrError, Missing> {
        let index = (frame - segment.start) as usize;
        loop {
            let known = self.nodes[node].states.entry(segment).or_default();
            if index < known.before {
                *known = StateKeys::default();
            }
            if let Some(key) = known.keys.get(index - known.before) {
                return Ok(key.clone());
            }
            let found = known.before + known.keys.len();
            let last = known.keys.back().cloned();
            let at = segment.start + found as i64;
            let key = match last {
                _ if self.cancel.load(Ordering::Relaxed) => return Ok(Err(self.cancelled(node, at))),
                Some(Err(error)) => Err(error),
                Some(Ok(before)) => self.next_state_key(node, Moment::ChainStep(at), Some(before))?,
                None => self.next_state_key(node, Moment::ChainStart(at), None)?,
            };
            let known = self.nodes[node].states.entry(segment).or_default();
            known.keys.push_back(key);
            if known.keys.len() > KEPT_STATES {
                known.keys.pop_front();
                known.before += 1;
            }
            if found % KEPT_STATES == KEPT_STATES - 1 {
                // What the states before read is not asked for again soon, and there may be any number of them.
                self.end_slice();
            }
        }
    }

    fn cancelled(&self, node: usize, frame: i64) -> Arc<CookError> {
        let error = Error::new(ErrorKind::Cancelled, "the cook was cancelled");
        Arc::new(self.plan.error(node, Frame::whole(frame), error))
    }

    fn next_state_key(
        &mut self,
        node: usize,
        moment: Moment,
        before: Option<ContentKey>,
    ) -> std::result::Result<KeyOrError, Missing> {
        let plan = self.plan;
        let Some(declared) = plan.graph.nodes[node].node() else { unreachable!("given geometry has no state") };
        let pending = self.nodes[node].pending.take().filter(|(at, _)| *at == moment);
        let reads = match pending.map_or_else(|| plan.reads(node, moment), |(_, reads)| Ok(reads)) {
            Ok(reads) => reads,
            Err(error) => return Ok(Err(error)),
        };
        let inputs = match self.input_keys(&reads) {
            Ok(Ok(inputs)) => inputs,
            Ok(Err(error)) => return Ok(Err(error)),
            Err(missing) => {
                self.nodes[node].pending = Some((moment, reads));
                return Err(missing);
            }
        };
        let clock = match self.clock_key(node, declared, moment.frame()) {
            Ok(clock) => clock,
            Err(error) => return Ok(Err(Arc::new(plan.error(node, moment.frame(), error)))),
        };
        let hasher = self.hasher.tag(7);
        if let Some(before) = before {
            hasher.key(before);
        }
        hash_recipe(hasher, declared, &reads.params);
        hasher.key(clock);
        inputs.hash(hasher);
        Ok(Ok(self.hasher.finish()))
    }
}

/// Keys of the results that a node reads, each with the output it comes from.
struct InputKeys(Vec<(usize, ContentKey)>);

type InputKeysOrError = std::result::Result<InputKeys, Arc<CookError>>;

impl InputKeys {
    fn hash(&self, hasher: &mut Hasher) {
        for (port, key) in &self.0 {
            hasher.i64(*port as i64).key(*key);
        }
    }
}

fn hash_recipe(hasher: &mut Hasher, declared: &Node, params: &Params) {
    hasher.text(declared.name).i64(i64::from(declared.version));
    for value in params.values.iter() {
        value.add_to(hasher);
    }
}
