//! Demand: from the targets of a slice upstream, every result that must be there and is not.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::warm_up::WarmUp;
use super::{MOST_CHAIN_FRAMES, Sweep};
use crate::error::CookError;
use crate::node::Cook;
use crate::plan::{ChainSegment, Moment, Read, Reads};
use crate::time::Frame;

/// What a slice needs of one node.
#[derive(Default)]
pub(super) struct NodeDemand<'g> {
    /// Canonical frames whose result is missing.
    pub(super) frames: BTreeSet<Frame>,
    /// What its states must do, where it is a window or solver.
    pub(super) segments: BTreeMap<ChainSegment, Advance<'g>>,
}

impl NodeDemand<'_> {
    pub(super) fn is_empty(&self) -> bool {
        self.frames.is_empty() && self.segments.is_empty()
    }

    /// How many frames its states pass.
    pub(super) fn frames_moved(&self) -> usize {
        let moved = |advance: &Advance<'_>| advance.frames.iter().filter(|frame| frame.arrival.is_some()).count();
        self.segments.values().map(moved).max().unwrap_or(0)
    }
}

/// What a slice needs of one state.
#[derive(Default)]
pub(super) struct Advance<'g> {
    /// Whole frames whose output is needed.
    pub(super) outputs: BTreeSet<i64>,
    /// Last frame to move to.
    pub(super) goal: i64,
    /// Frame the state stands at; `None`: it must start.
    pub(super) from: Option<i64>,
    /// What is done on the way, oldest first, with what is read for it.
    pub(super) frames: Vec<ChainFrame<'g>>,
}

/// Reads of a moment, or the error of a param that is refused then.
pub(super) type ReadsOrError<'g> = Result<Reads<'g>, Arc<CookError>>;

/// What a state does at one whole frame.
pub(super) struct ChainFrame<'g> {
    pub(super) frame: i64,
    /// How the state gets here, and what is read for that; `None`: it stands here already.
    pub(super) arrival: Option<(Arrival, ReadsOrError<'g>)>,
    /// What its output reads, where that is needed.
    pub(super) output: Option<ReadsOrError<'g>>,
}

/// How a state gets to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// It starts there.
    Start,
    /// It was saved there, and is given its inputs.
    Resume,
    /// It moves there from the frame before.
    Step,
}

/// How far ahead the inputs of a chain that is far behind are demanded.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Lookahead {
    /// All the way.
    Whole,
    /// As far as a slice moves it: enough to see which chains must move first.
    Near,
}

impl<'g> Sweep<'_, 'g, '_> {
    /// From targets and warm-ups upstream: what each node must cook.
    pub(super) fn collect_demand(
        &mut self,
        targets: &[Read],
        warm_ups: &[WarmUp],
        lookahead: Lookahead,
    ) -> Vec<NodeDemand<'g>> {
        let count = self.nodes.len();
        let mut demand: Vec<NodeDemand<'g>> = (0..count).map(|_| NodeDemand::default()).collect();
        for target in targets {
            demand[target.node].frames.insert(target.frame);
        }
        for WarmUp { node, segment, goal } in warm_ups {
            demand[*node].segments.insert(*segment, Advance { goal: *goal, ..Advance::default() });
        }
        for node in (0..count).rev() {
            let mut own = std::mem::take(&mut demand[node]);
            own.frames.retain(|frame| self.is_missing(node, *frame));
            match self.plan.graph.nodes[node].node().map(|declared| declared.cook) {
                None => {}
                Some(Cook::Pure(_) | Cook::Frame { .. }) => {
                    for frame in &own.frames {
                        if let Ok(resolved) = self.keys.resolve(node, *frame) {
                            self.demand_reads(&mut demand, &resolved.reads);
                        }
                    }
                }
                Some(Cook::Window(..) | Cook::Solver(..)) => {
                    for frame in own.frames.iter().filter(|frame| !frame.is_whole()) {
                        if let Ok(resolved) = self.keys.resolve(node, *frame) {
                            self.demand_reads(&mut demand, &resolved.reads);
                        }
                    }
                    self.find_segments(node, &mut own);
                    self.demand_of_chain(&mut demand, node, &mut own.segments, lookahead);
                }
            }
            demand[node] = own;
        }
        demand
    }

    /// Adds the results that are read to the demand of the nodes they come from.
    fn demand_reads(&self, demand: &mut [NodeDemand<'g>], reads: &Reads<'_>) {
        for read in reads.inputs.iter().flat_map(|input| input.results(self.plan)) {
            demand[read.node].frames.insert(read.frame);
        }
    }

    /// The segments that give the outputs of a chain at the frames demanded.
    fn find_segments(&mut self, node: usize, own: &mut NodeDemand<'g>) {
        let outputs: Vec<_> = own.frames.iter().map(|frame| self.plan.output_frames(*frame)).collect();
        for whole in outputs.iter().flat_map(|frames| frames.all()).copied() {
            // A refused param made the key an error too: such a frame is not missing.
            let Ok(segment) = self.keys.segment(node, whole) else { continue };
            let whole = whole.max(segment.start);
            if self.nodes[node].recent.contains_key(&whole) {
                continue;
            }
            let advance = own.segments.entry(segment).or_default();
            advance.outputs.insert(whole);
            advance.goal = if advance.outputs.len() == 1 { whole } else { advance.goal.max(whole) };
        }
    }

    /// Plans how the states of a chain move, and demands what they read on the way.
    fn demand_of_chain(
        &mut self,
        demand: &mut [NodeDemand<'g>],
        node: usize,
        segments: &mut BTreeMap<ChainSegment, Advance<'g>>,
        lookahead: Lookahead,
    ) {
        for (segment, advance) in segments.iter_mut() {
            let first = advance.outputs.first().copied().unwrap_or(advance.goal);
            self.find_state(node, *segment, first);
            advance.from = self.nodes[node].states.get(segment).map(|state| state.at);
        }
        self.advance_alongside(node, segments);
        let plan = self.plan;
        for (segment, advance) in segments {
            let next = advance.from.map_or(segment.start, |at| at + 1);
            let last = match lookahead {
                Lookahead::Whole => advance.goal,
                Lookahead::Near => advance.goal.min(next.saturating_add(MOST_CHAIN_FRAMES)),
            };
            let is_saved = self.nodes[node].states.get(segment).is_some_and(|state| state.is_saved);
            let stands_at = advance.from.filter(|at| is_saved || advance.outputs.contains(at));
            for frame in stands_at.into_iter().chain(next..=last) {
                let arrivals: &[Arrival] = match frame {
                    _ if frame < next && is_saved => &[Arrival::Resume],
                    _ if frame < next => &[],
                    _ if frame == segment.start => &[Arrival::Start],
                    _ if self.reloads_windows(node) => &[Arrival::Step, Arrival::Resume],
                    _ => &[Arrival::Step],
                };
                for arrival in arrivals {
                    let moment = match arrival {
                        Arrival::Start | Arrival::Resume => Moment::ChainStart(frame),
                        Arrival::Step => Moment::ChainStep(frame),
                    };
                    let reads = plan.reads(node, moment);
                    if let Ok(reads) = &reads {
                        self.demand_reads(demand, reads);
                    }
                    advance.frames.push(ChainFrame { frame, arrival: Some((*arrival, reads)), output: None });
                }
                if advance.outputs.contains(&frame) {
                    let reads = plan.reads(node, Moment::ChainOutput(Frame::whole(frame)));
                    if let Ok(reads) = &reads {
                        self.demand_reads(demand, reads);
                    }
                    advance.frames.push(ChainFrame { frame, arrival: None, output: Some(reads) });
                }
            }
        }
    }

    /// Lets the states of a window that later frames will ask for move alongside those asked now: what they read is at
    /// hand, and would have to be cooked again later.
    fn advance_alongside(&mut self, node: usize, segments: &mut BTreeMap<ChainSegment, Advance<'g>>) {
        let next = |segment: ChainSegment, from: Option<i64>| from.map_or(segment.start, |at| at + 1);
        let low = segments.iter().map(|(segment, advance)| next(*segment, advance.from)).min();
        let high = segments.values().map(|advance| advance.goal).max();
        let until = segments.keys().map(|segment| segment.until).max();
        let (Some(low), Some(high), Some(mut until)) = (low, high, until) else { return };
        while until < i64::MAX
            && self.plan.nodes[node].varies
            && let Ok(segment) = self.keys.segment(node, until)
            && segment.start <= high
            && self.is_asked_later(node, segment)
        {
            self.find_state_at(node, segment, low - 1);
            let from = self.nodes[node].states.get(&segment).map(|state| state.at);
            if (low..=high).contains(&next(segment, from)) {
                segments.insert(segment, Advance { goal: high, from, ..Advance::default() });
            }
            until = segment.until;
        }
    }

    /// Whether a frame of the request lies in the segment, or beyond it where a chain will pass through.
    fn is_asked_later(&self, node: usize, segment: ChainSegment) -> bool {
        let frames = &self.plan.request.frames;
        // The first segment starts before all frames.
        let first = match segment.from {
            i64::MIN => frames.first(),
            from => frames.at_or_after(Frame::whole(from)),
        };
        first.is_some_and(|frame| self.plan.nodes[node].feeds_chain || frame.floor_number() < segment.until)
    }
}
