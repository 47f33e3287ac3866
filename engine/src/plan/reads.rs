//! The read plan: at which frames a node reads its inputs, and which results a delivered frame is made of.
//!
//! This is the only place that knows. Keys hash these reads, the sweep demands their results and hands them to the call,
//! so what a key covers, what a slice cooks and what a node is given cannot differ.

use std::sync::Arc;

use super::Plan;
use crate::error::CookError;
use crate::geometry::V;
use crate::graph::{Body, Link};
use crate::node::{Cook, InputSpec, Node, Times};
use crate::param::Params;
use crate::time::Frame;

/// A moment at which a node reads its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moment {
    /// A pure or frame node is cooked at this frame.
    Frame(Frame),
    /// The state of a window or solver starts at this whole frame.
    ChainStart(i64),
    /// The state of a window or solver moves to this whole frame from the one before.
    ChainStep(i64),
    /// The output of a window or solver at this frame. Between whole frames it is made of the outputs at
    /// [`Plan::output_frames`] and of the input that the node follows, if any.
    ChainOutput(Frame),
}

impl Moment {
    /// The frame at which the node's params are taken.
    pub(crate) fn frame(self) -> Frame {
        match self {
            Self::Frame(frame) | Self::ChainOutput(frame) => frame,
            Self::ChainStart(frame) | Self::ChainStep(frame) => Frame::whole(frame),
        }
    }
}

/// One result that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Read {
    /// Index of the node read.
    pub(crate) node: usize,
    /// Which of its outputs.
    pub(crate) port: usize,
    /// The frame that its result is stored under: see [`Plan::canonical`].
    pub(crate) frame: Frame,
}

/// The whole frames that make up an output of a window or solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum OutputFrames {
    /// The state stands at the frame itself.
    Whole(i64),
    /// Between the second and the third, at this share of the way.
    Between([i64; 4], f32),
}

impl OutputFrames {
    pub(crate) fn all(&self) -> &[i64] {
        match self {
            Self::Whole(frame) => std::slice::from_ref(frame),
            Self::Between(frames, _) => frames,
        }
    }
}

/// What a node reads at one moment: its params then, and the frames of each input that it reads with them.
#[derive(Clone, Debug)]
pub(crate) struct Reads<'g> {
    pub(crate) params: Params,
    /// By input, in the order of the declaration.
    pub(crate) inputs: Vec<InputReads<'g>>,
}

/// Frames at which one input is read at one moment, the same for all its wires.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct InputReads<'g> {
    /// The input's name.
    pub(crate) name: &'static str,
    pub(crate) links: &'g [Link],
    /// For [`Times::now`].
    pub(crate) now: Option<Frame>,
    /// For [`Times::start`].
    pub(crate) start: Option<Frame>,
    /// For [`Times::steps`], oldest first.
    pub(crate) steps: Vec<Frame>,
}

/// Results that one delivered frame of an output is made of.
pub(crate) struct DeliveryReads {
    /// The frame itself.
    pub(crate) now: Read,
    /// Where velocities are differences: the results before and after, and the seconds between them.
    pub(crate) around: Option<([Read; 2], f64)>,
}

impl DeliveryReads {
    /// All of them.
    pub(crate) fn all(&self) -> impl Iterator<Item = Read> {
        std::iter::once(self.now).chain(self.around.into_iter().flat_map(|(around, _)| around))
    }
}

impl<'g> Plan<'g> {
    /// What `node` reads at a moment.
    ///
    /// # Errors
    /// Where a param is refused at that moment.
    pub(crate) fn reads(&self, node: usize, moment: Moment) -> Result<Reads<'g>, Arc<CookError>> {
        let frame = moment.frame();
        let params = self.nodes[node].resolver.at(frame);
        let params = params.map_err(|error| Arc::new(self.error(node, frame, error)))?;
        let inputs = match &self.graph.nodes[node].body {
            Body::Given { .. } => Vec::new(),
            Body::Node { node: declared, inputs, .. } => {
                let wired = declared.inputs.iter().map(|input| input.spec()).zip(inputs);
                let read = |(spec, links): (InputSpec, &'g Vec<Link>)| {
                    let (now, start, steps) = self.frames_read(&spec, &params, declared, links, moment);
                    InputReads { name: spec.name, links, now, start, steps }
                };
                wired.map(read).collect()
            }
        };
        Ok(Reads { params, inputs })
    }

    /// Frames for `now`, `start` and `steps` of an input.
    fn frames_read(
        &self,
        spec: &InputSpec,
        params: &Params,
        declared: &Node,
        links: &[Link],
        moment: Moment,
    ) -> (Option<Frame>, Option<Frame>, Vec<Frame>) {
        let (at, times) = (moment.frame(), (spec.times)(params));
        let now = times.now.then_some(at);
        let scene_start = self.graph.scene.start();
        match moment {
            Moment::Frame(_) => (now, times.start.then_some(scene_start), Vec::new()),
            Moment::ChainStart(_) => {
                // A solver's start is where its state starts. A window has many states: all share the scene's start.
                let start = if matches!(declared.cook, Cook::Window(..)) { scene_start } else { at };
                let steps = if times.steps > 0 { vec![at] } else { Vec::new() };
                (now, times.start.then_some(start), steps)
            }
            Moment::ChainStep(_) => {
                let steps = if times.steps > 0 { self.step_samples(links, times.steps, at) } else { Vec::new() };
                (now, None, steps)
            }
            Moment::ChainOutput(frame) => {
                let is_followed = declared.follows.is_some_and(|follows| follows.input == spec.name);
                (now.filter(|_| frame.is_whole() || is_followed), None, Vec::new())
            }
        }
    }

    /// Samples of an input within the step to `frame`, the frame before first. A solver and what depends on it are known
    /// at whole frames only.
    fn step_samples(&self, links: &[Link], steps: u8, frame: Frame) -> Vec<Frame> {
        let whole = links.iter().any(|link| self.nodes[link.node].has_solver);
        let steps = if whole { 1 } else { i64::from(steps) };
        let before = frame.plus(-1);
        (0..=steps).map(|k| before.plus_ticks(Frame::TICKS * k / steps)).collect()
    }

    /// The whole frames whose outputs make up the output of a window or solver at `frame`: itself, or two neighbours each
    /// way. For a frame inside the scene none lies past its end, where inputs may have nothing more to give.
    pub(crate) fn output_frames(&self, frame: Frame) -> OutputFrames {
        let floor = frame.floor_number();
        if frame.is_whole() {
            return OutputFrames::Whole(floor);
        }
        let last = self.graph.scene.last;
        let after = if floor < last { last.min(floor + 2) } else { floor + 2 };
        let share = (frame.ticks() - frame.floor().ticks()) as f32 / Frame::TICKS as f32;
        OutputFrames::Between([floor - 1, floor, floor + 1, after], share)
    }

    /// The two whole frames between which a source of numbered files goes at `frame`, and the share of the way; `None` at
    /// whole frames and past the scene, where there may be no further file.
    pub(crate) fn files_between(&self, node: usize, frame: Frame) -> Option<([Frame; 2], f32)> {
        let before = frame.floor();
        let is_between = !frame.is_whole() && before < self.graph.scene.end();
        let share = (frame.ticks() - before.ticks()) as f32 / Frame::TICKS as f32;
        (self.nodes[node].reads_sequence && is_between).then(|| ([before, before.plus(1)], share))
    }

    /// The frame whose result of `node` is read again at later frames: the only one where the node is the same at all
    /// frames, the scene's first where a reader looks back to it.
    pub(crate) fn reread_frame(&self, node: usize) -> Option<Frame> {
        let planned = &self.nodes[node];
        let constant =
            !planned.varies && (planned.requested || self.readers(node).any(|reader| self.nodes[reader].varies));
        (constant || planned.read_at_start).then(|| self.graph.scene.start())
    }

    /// The results that a delivered frame of an output is made of. Velocities that the node does not write itself are
    /// the difference over half a frame each way, or a whole one where it comes from a solver, which has no others;
    /// one-sided at the scene's ends.
    pub(crate) fn delivery(&self, output: usize, frame: Frame) -> DeliveryReads {
        let scene = &self.graph.scene;
        let from = self.graph.outputs[output].from;
        let around = self.velocity_frames(output, frame).map(|frames| {
            let [before, after] = frames;
            (frames.map(|at| self.read(from, at)), after.seconds(scene.fps) - before.seconds(scene.fps))
        });
        DeliveryReads { now: self.read(from, frame), around }
    }

    /// Of the results of `node` in a slice, up to `last`, the first that later frames may read, or have the key of.
    pub(crate) fn reread_since(&self, node: usize, last: Frame) -> Option<Frame> {
        let planned = &self.nodes[node];
        if planned.varies && self.gives_differences(node) {
            // What came half a frame after the slice's last frame comes half a frame before a later one, too.
            let next = self.request.frames.at_or_after(last.plus_ticks(1 - HALF))?;
            return Some(next.plus_ticks(-HALF));
        }
        (planned.varies && planned.may_hold).then_some(last)
    }

    /// Whether velocities of a requested output are differences of what `node` gives.
    fn gives_differences(&self, node: usize) -> bool {
        let mut outputs = self.request.outputs.iter().filter(|output| self.graph.outputs[**output].from.node == node);
        outputs.any(|output| self.velocity_frames(*output, self.graph.scene.start()).is_some())
    }

    /// The frames whose difference is an output's velocity at `frame`; `None` where it has none, or the node's own.
    fn velocity_frames(&self, output: usize, frame: Frame) -> Option<[Frame; 2]> {
        let scene = &self.graph.scene;
        let output = &self.graph.outputs[output];
        let node = output.from.node;
        let writes_v = |node: &Node| node.writes.iter().any(|attribute| attribute.spec().0 == V.name);
        let own = self.graph.nodes[node].node().is_some_and(writes_v);
        let ticks = if self.nodes[node].has_solver { Frame::TICKS } else { HALF };
        (output.v && !own).then(|| {
            let before = if frame == scene.start() { frame } else { frame.plus_ticks(-ticks) };
            let after = if frame == scene.end() && frame != scene.start() { frame } else { frame.plus_ticks(ticks) };
            [before, after]
        })
    }

    /// The frames at which `node`, upstream of an output, publishes metrics that belong to a delivered frame.
    pub(crate) fn measured_frames(&self, node: usize, output: usize, frame: Frame) -> Vec<Frame> {
        let around = self.velocity_frames(output, frame).into_iter().flatten();
        let mut frames: Vec<Frame> = std::iter::once(frame).chain(around).map(|at| self.canonical(node, at)).collect();
        frames.dedup();
        frames
    }

    /// The result at the other end of a wire at `frame`.
    pub(crate) fn read(&self, link: Link, frame: Frame) -> Read {
        Read { node: link.node, port: link.port, frame: self.canonical(link.node, frame) }
    }

    /// The frame that stands for `frame` in results and keys: the scene's first, where `node` is the same at all frames.
    pub(crate) fn canonical(&self, node: usize, frame: Frame) -> Frame {
        if self.nodes[node].varies { frame } else { self.graph.scene.start() }
    }
}

impl InputReads<'_> {
    /// The results read, wire by wire; of each wire now, at the start, then within the step. Keys depend on this order.
    pub(crate) fn results(&self, plan: &Plan<'_>) -> impl Iterator<Item = Read> {
        self.links.iter().flat_map(move |link| {
            let frames = self.now.iter().chain(&self.start).chain(&self.steps);
            frames.map(move |frame| plan.read(*link, *frame))
        })
    }
}

/// Half a frame.
const HALF: i64 = Frame::TICKS / 2;

/// Which parts of time an input's reads reach, whatever the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ReadSpan {
    /// Some frames move along with the node's own: what is read varies where the input does.
    pub(super) moves: bool,
    /// Some stay at the start: results there are asked for again and again.
    pub(super) start: bool,
}

/// By input of a node whose params at the scene's start are these. Where they are refused, the error comes out when that
/// frame is cooked; until then inputs count as read now.
pub(super) fn read_spans(declared: &Node, params: Option<&Params>) -> Vec<ReadSpan> {
    let span = |times: Times| ReadSpan { moves: times.now || times.steps > 0, start: times.start };
    let times = |input: &&dyn crate::node::InputDecl| params.map_or(Times::NOW, |params| (input.spec().times)(params));
    declared.inputs.iter().map(|input| span(times(input))).collect()
}

#[cfg(test)]
mod tests;
