//! Keys of results: a hash of exactly what a node reads, at the times at which it reads it.
//!
//! A chain's key at a frame hangs on its key at the frame before, so editing anything upstream invalidates its
//! checkpoints by itself, and editing a key frame invalidates only what comes after it.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Plan;
use crate::cook::{CookError, gauss_points, history_start};
use crate::error::Result;
use crate::graph::{Body, Link};
use crate::key::{Hasher, Key};
use crate::node::{Cook, Node, Past, Times};
use crate::param::Params;
use crate::time::Frame;

/// What is known of a node at one frame before it cooks.
pub(crate) struct Spot {
    pub(crate) params: Option<Params>,
    /// When each input is read.
    pub(crate) times: Vec<Times>,
    pub(crate) key: Key,
}

type Known = std::result::Result<Arc<Spot>, Arc<CookError>>;
type KeyOrError = std::result::Result<Key, Arc<CookError>>;

/// Frames from an anchor to the next. At least as long as the window, so that two states at most run side by side and a
/// frame costs two updates whatever the window's length.
pub(crate) const LEAST_BLOCK: i64 = 8;

/// One stretch of a chain: from where its state starts to the last frame it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Stretch {
    /// Where the state starts.
    pub(crate) start: i64,
    /// First frame it answers for.
    pub(crate) from: i64,
    /// First frame it does not answer for; `i64::MAX` for a solver.
    pub(crate) until: i64,
}

/// How far back a window goes, and how often its state starts anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Frames before an anchor at which the state starts, or would if the scene did not start later; at most, where that
    /// changes with time.
    pub frames: i64,
    /// Frames from an anchor to the next.
    pub every: i64,
}

/// Where a window's states start.
struct Anchors {
    window: Window,
    /// Before this frame none starts.
    earliest: i64,
    /// By anchor: where its state starts.
    starts: BTreeMap<i64, i64>,
}

/// Finds keys, and remembers those of the slice at hand.
pub(crate) struct Keys<'p, 'g> {
    plan: &'p Plan<'g>,
    spots: Vec<BTreeMap<Frame, Known>>,
    /// Keys of a chain's states: by stretch, from its start on.
    chains: Vec<BTreeMap<Stretch, Vec<KeyOrError>>>,
    /// Keys of what a node's integrands were: from time 0 on, frame by frame, and before it as a whole.
    histories: Vec<Vec<Key>>,
    before: Vec<Option<Key>>,
    windows: Vec<Option<Anchors>>,
    hasher: Hasher,
}

impl<'p, 'g> Keys<'p, 'g> {
    pub(crate) fn new(plan: &'p Plan<'g>) -> Self {
        let nodes = plan.graph.nodes.len();
        Self {
            plan,
            spots: (0..nodes).map(|_| BTreeMap::new()).collect(),
            chains: (0..nodes).map(|_| BTreeMap::new()).collect(),
            histories: vec![Vec::new(); nodes],
            before: vec![None; nodes],
            windows: (0..nodes).map(|_| None).collect(),
            hasher: Hasher::default(),
        }
    }

    /// Forgets what belongs to the slice; keys of chains and of nodes that stand still stay.
    pub(crate) fn end_slice(&mut self) {
        for (spots, planned) in self.spots.iter_mut().zip(&self.plan.nodes) {
            if planned.varies {
                spots.clear();
            }
        }
    }

    /// Forgets the stretches of windows that end before `frame`, which nothing asks for any more.
    pub(crate) fn forget_before(&mut self, frame: i64) {
        for chains in &mut self.chains {
            chains.retain(|stretch, _| stretch.until > frame - 4 * LEAST_BLOCK);
        }
        for anchors in self.windows.iter_mut().flatten() {
            let every = anchors.window.every;
            anchors.starts.retain(|from, _| from + every > frame - 4 * LEAST_BLOCK);
        }
    }

    /// What is known of `node` at `frame` (canonical); for a chain at a whole frame, the key of its output.
    pub(crate) fn spot(&mut self, node: usize, frame: Frame) -> Known {
        if let Some(known) = self.spots[node].get(&frame) {
            return known.clone();
        }
        let known = self.find(node, frame);
        self.spots[node].insert(frame, known.clone());
        known
    }

    fn find(&mut self, node: usize, frame: Frame) -> Known {
        let plan = self.plan;
        let live = &plan.nodes[node].live;
        let hash_live = |hasher: &mut Hasher| {
            let names = live.as_deref().unwrap_or_default();
            let hasher = hasher.tag(u8::from(live.is_some())).i64(names.len() as i64);
            names.iter().fold(hasher, |hasher, name| hasher.text(name));
        };
        let (declared, links) = match &plan.graph.nodes[node].body {
            Body::Given { moves, .. } => {
                let hasher = self.hasher.tag(1).i64(plan.number as i64).i64(node as i64);
                hasher.i64(if *moves { frame.ticks() } else { 0 });
                hash_live(&mut self.hasher);
                return Ok(Arc::new(Spot { params: None, times: Vec::new(), key: self.hasher.finish() }));
            }
            Body::Node { node, inputs, .. } => (*node, inputs),
        };
        let fail = |error| Arc::new(plan.error(node, frame, error));
        let params = plan.nodes[node].resolver.at(frame).map_err(fail)?;
        let times: Vec<Times> = declared.inputs.iter().map(|input| (input.spec().times)(&params)).collect();
        let key = if matches!(declared.cook, Cook::Pure(_) | Cook::Frame { .. }) {
            let mut wires = Vec::new();
            for (times, links) in times.iter().zip(links) {
                for link in links {
                    if times.now {
                        wires.push((link.port, self.key_of(link.node, frame)?));
                    }
                    if times.start {
                        wires.push((link.port, self.key_of(link.node, plan.graph.scene.start())?));
                    }
                }
                // Marks the end of a list, so that wires do not move from one input to the next unseen.
                wires.push((usize::MAX, Key::default()));
            }
            let clock = match declared.cook {
                Cook::Frame { reads_clock, .. } => {
                    reads_clock(&params).then(|| self.clock_key(node, declared, frame)).transpose().map_err(fail)?
                }
                _ => None,
            };
            let hasher = self.hasher.tag(2);
            hash_recipe(hasher, declared, &params);
            if let Some(clock) = clock {
                hasher.key(clock);
            }
            for (port, key) in wires {
                hasher.i64(port as i64).key(key);
            }
            hash_live(&mut self.hasher);
            self.hasher.finish()
        } else {
            // Between frames a window's output hangs on its neighbours each way.
            let mut states = Vec::new();
            for near in plan.neighbours(frame) {
                let stretch = self.stretch(node, near)?;
                states.push(self.state_key(node, stretch, near.max(stretch.start))?);
            }
            let hasher = self.hasher.tag(3).i64(frame.ticks());
            states.into_iter().fold(hasher, Hasher::key);
            hash_live(&mut self.hasher);
            self.hasher.finish()
        };
        Ok(Arc::new(Spot { params: Some(params), times, key }))
    }

    fn key_of(&mut self, node: usize, frame: Frame) -> KeyOrError {
        self.spot(node, self.plan.canonical(node, frame)).map(|spot| spot.key)
    }

    /// The frame, the scene's clock and origin, and what the integrands have seen since time 0.
    fn clock_key(&mut self, node: usize, declared: &Node, frame: Frame) -> Result<Key> {
        let scene = &self.plan.graph.scene;
        let resolver = &self.plan.nodes[node].resolver;
        let animated = declared.integrands[0].is_some() && resolver.history_is_animated();
        let seen = match animated {
            true => Some(self.history_key(node, declared, frame)?),
            false => None,
        };
        let hasher = self.hasher.tag(4).i64(frame.ticks()).f64(scene.fps);
        scene.origin.iter().fold(hasher, |hasher, x| hasher.f64(*x));
        if let Some(seen) = seen {
            self.hasher.key(seen);
        }
        Ok(self.hasher.finish())
    }

    /// A key of the integrands' values at the Gauss points of all that [`crate::node::FrameCx::integrals`] may be asked at
    /// `frame`: from the scene's start or time 0, whichever is earlier, to `frame`. Chained frame by frame.
    fn history_key(&mut self, node: usize, declared: &Node, frame: Frame) -> Result<Key> {
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
        // Of its own: an integrand that is refused midway must not leave half a recipe behind.
        let mut hasher = Hasher::default();
        let before = match self.before[node] {
            Some(before) => before,
            None => {
                let since = history_start(&self.plan.graph.scene);
                value(since as f64)?.iter().fold(hasher.tag(5), |hasher, x| hasher.f64(*x));
                for k in since..0 {
                    over(&mut hasher, (k + 1) as f64, k as f64)?;
                }
                *self.before[node].insert(hasher.finish())
            }
        };
        let whole = frame.floor_number().max(0) as usize;
        let known = &mut self.histories[node];
        if known.is_empty() {
            known.push(before);
        }
        while known.len() <= whole {
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

    /// The stretch that answers for `frame` of a window or solver.
    pub(crate) fn stretch(&mut self, node: usize, frame: i64) -> std::result::Result<Stretch, Arc<CookError>> {
        let plan = self.plan;
        let first = plan.graph.scene.first;
        let resolver = &plan.nodes[node].resolver;
        let at = |frame: i64| {
            let frame = Frame::whole(frame);
            resolver.at(frame).map_err(|error| Arc::new(plan.error(node, frame, error)))
        };
        match plan.graph.nodes[node].node().map(|declared| declared.cook) {
            Some(Cook::Window(_, past)) => {
                let clock = plan.graph.scene.clock();
                let past = |frame: i64| at(frame).map(|params| past(&params, clock));
                let anchors = match &mut self.windows[node] {
                    Some(anchors) => anchors,
                    none => {
                        let Past { frames, preroll } = past(first)?;
                        let frames = i64::from(frames);
                        let window = Window { frames, every: frames.max(LEAST_BLOCK) };
                        none.insert(Anchors { window, earliest: first - i64::from(preroll), starts: BTreeMap::new() })
                    }
                };
                let every = anchors.window.every;
                let from = first + (frame - first).max(0) / every * every;
                let start = match anchors.starts.get(&from) {
                    Some(start) => *start,
                    None if !resolver.is_animated() => (from - anchors.window.frames).max(anchors.earliest),
                    None => forgotten(from, anchors.earliest, |frame| past(frame).map(|past| past.frames))?,
                };
                anchors.starts.insert(from, start);
                anchors.window.frames = anchors.window.frames.max(from - start);
                let answers_from = if from == first { i64::MIN } else { from };
                Ok(Stretch { start, from: answers_from, until: from + every })
            }
            Some(Cook::Solver(_, solver)) => {
                let start = (solver.start_frame)(&at(first)?).unwrap_or(first);
                Ok(Stretch { start, from: i64::MIN, until: i64::MAX })
            }
            _ => unreachable!("only windows and solvers have stretches"),
        }
    }

    /// How far back a window goes, once one of its frames was asked.
    pub(crate) fn window(&self, node: usize) -> Option<Window> {
        self.windows[node].as_ref().map(|anchors| anchors.window)
    }

    /// The key of a chain's state at `frame`, which lies in the stretch.
    pub(crate) fn state_key(&mut self, node: usize, stretch: Stretch, frame: i64) -> KeyOrError {
        let index = (frame - stretch.start) as usize;
        loop {
            let known = self.chains[node].entry(stretch).or_default();
            if let Some(key) = known.get(index) {
                return key.clone();
            }
            let before = known.last().cloned();
            let at = stretch.start + known.len() as i64;
            let key = match before {
                Some(Err(error)) => Err(error),
                Some(Ok(before)) => self.advance_key(node, at, Some(before)),
                None => self.advance_key(node, at, None),
            };
            self.chains[node].entry(stretch).or_default().push(key);
        }
    }

    fn advance_key(&mut self, node: usize, frame: i64, before: Option<Key>) -> KeyOrError {
        let plan = self.plan;
        let at = Frame::whole(frame);
        let Body::Node { node: declared, inputs, .. } = &plan.graph.nodes[node].body else {
            unreachable!("given geometry is no chain")
        };
        let fail = |error| Arc::new(plan.error(node, at, error));
        let params = plan.nodes[node].resolver.at(at).map_err(fail)?;
        let mut wires = Vec::new();
        for (input, links) in declared.inputs.iter().zip(inputs) {
            let times = (input.spec().times)(&params);
            for link in links {
                if times.now {
                    wires.push((link.port, self.key_of(link.node, at)?));
                }
                if times.start && before.is_none() {
                    wires.push((link.port, self.key_of(link.node, plan.start_of(declared, at))?));
                }
                if times.steps > 0 {
                    let samples = match before {
                        Some(_) => plan.step_samples(links, times.steps, at),
                        None => vec![at],
                    };
                    for sample in samples {
                        wires.push((link.port, self.key_of(link.node, sample)?));
                    }
                }
            }
            wires.push((usize::MAX, Key::default()));
        }
        let clock = self.clock_key(node, declared, at).map_err(fail)?;
        let hasher = self.hasher.tag(7);
        if let Some(before) = before {
            hasher.key(before);
        }
        hash_recipe(hasher, declared, &params);
        hasher.key(clock);
        for (port, key) in wires {
            hasher.i64(port as i64).key(key);
        }
        Ok(self.hasher.finish())
    }
}

/// The latest frame not before `earliest` of which nothing is left at `from`, where the step to a frame forgets one part
/// in `frames(frame)`.
fn forgotten<E>(
    from: i64,
    earliest: i64,
    frames: impl Fn(i64) -> std::result::Result<u32, E>,
) -> std::result::Result<i64, E> {
    // A sum of n parts of 1/n may miss 1 by its rounding.
    const ALL: f64 = 1.0 - 1e-9;
    let (mut start, mut share) = (from, 0.0);
    while start > earliest && share < ALL {
        let frames = frames(start)?;
        if frames == 0 {
            break;
        }
        share += 1.0 / f64::from(frames);
        start -= 1;
    }
    Ok(start)
}

impl Plan<'_> {
    /// The times at which a solver's step to `frame` samples an input, the frame before first. What a solver is part of
    /// is known at whole frames only.
    pub(crate) fn step_samples(&self, links: &[Link], steps: u8, frame: Frame) -> Vec<Frame> {
        let whole = links.iter().any(|link| self.nodes[link.node].has_solver);
        let steps = if whole { 1 } else { i64::from(steps) };
        let before = frame.plus(-1);
        (0..=steps).map(|k| before.plus_ticks(Frame::TICKS * k / steps)).collect()
    }
}

fn hash_recipe(hasher: &mut Hasher, declared: &Node, params: &Params) {
    hasher.text(declared.name).i64(i64::from(declared.version));
    for value in params.values.iter() {
        value.add_to(hasher);
    }
}
