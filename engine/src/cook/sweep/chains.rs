//! Chains: states that start, step, give outputs and are saved on the way.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::demand::{Advance, Arrival, ChainFrame, NodeDemand, ReadsOrError};
use super::{ChainState, Outcome, Sweep};
use crate::cook::interpolate::Followed;
use crate::error::CookError;
use crate::geometry::Geometry;
use crate::node::{ChainFns, Follows, FrameCx, Node, SavedFns, StateBox};
use crate::plan::{ChainSegment, OutputFrames, Reads};
use crate::time::Frame;

/// The output of a window or solver at a whole frame.
#[derive(Clone)]
pub(super) struct Recent {
    outcome: Outcome,
    /// The input whose points it moves, at that frame.
    followed: Option<Arc<Geometry>>,
}

/// A window or solver that is being cooked.
#[derive(Clone, Copy)]
struct ChainNode {
    index: usize,
    declared: &'static Node,
    chain: ChainFns,
}

impl<'g> Sweep<'_, 'g, '_> {
    /// Moves the states of a window or solver, and takes its outputs on the way.
    pub(super) fn cook_chain(
        &mut self,
        index: usize,
        declared: &'static Node,
        chain: ChainFns,
        demand: NodeDemand<'g>,
    ) {
        let node = ChainNode { index, declared, chain };
        for (segment, advance) in demand.segments {
            self.advance(node, segment, advance);
        }
        // A cancelled chain has not been at every frame.
        if !self.cancelled() {
            self.finish_chain(node, &demand.frames);
        }
    }

    fn advance(&mut self, node: ChainNode, segment: ChainSegment, advance: Advance<'g>) {
        let mut state = self.nodes[node.index].states.remove(&segment).map(|standing| (standing.at, standing.state));
        for ChainFrame { frame, arrival, output } in advance.frames {
            if self.cancelled() {
                return;
            }
            if let Some((arrival, reads)) = arrival {
                let arrived = self.arrive(node, frame, (arrival, reads), state.take().map(|(_, state)| state));
                if arrival != Arrival::Resume {
                    self.count_call(node.index, Frame::whole(frame), arrived.as_ref().err());
                    self.save_solver(node, segment, frame, arrived.as_ref().ok());
                }
                state = Some((frame, arrived));
            }
            if let (Some(reads), Some((_, state))) = (output, &state) {
                let followed =
                    reads.as_ref().ok().and_then(|reads| self.followed(node, Frame::whole(frame), reads)?.ok());
                let outcome = self.chain_output(node, frame, reads, state);
                self.nodes[node.index].recent.insert(frame, Recent { outcome, followed });
            }
        }
        if let Some((at, state)) = state.filter(|(at, _)| at + 1 < segment.until) {
            let moved = self.slices;
            self.nodes[node.index].states.insert(segment, ChainState { at, state, moved, is_saved: false });
        }
    }

    /// The state at a frame; `before` is that of the frame before.
    fn arrive(
        &mut self,
        node: ChainNode,
        frame: i64,
        (arrival, reads): (Arrival, ReadsOrError<'g>),
        before: Option<Result<StateBox, Arc<CookError>>>,
    ) -> Result<StateBox, Arc<CookError>> {
        let at = Frame::whole(frame);
        let before = before.transpose()?;
        let call = self.prepare(node.index, node.declared, at, &reads?)?;
        let arrived = match (before, node.chain.saved) {
            (None, _) => self.executor.start(call, node.chain),
            (Some(state), Some(saved)) if arrival == Arrival::Resume => {
                self.executor.resume(call, saved, state).map(|state| (state, Vec::new()))
            }
            (Some(mut state), _) => self.executor.step(call, node.chain, &mut state).map(|metrics| (state, metrics)),
        };
        // What is resumed is not written again, and a window that has just started need not be.
        let reloads = |saved: &SavedFns| arrival == Arrival::Step || saved.resume.is_none();
        let saved = node.chain.saved.filter(reloads);
        let arrived = arrived.and_then(|(state, metrics)| Ok((self.executor.reloaded(state, saved)?, metrics)));
        let (state, metrics) = arrived.map_err(|error| Arc::new(self.plan.error(node.index, at, error)))?;
        self.publish(node.index, at, &metrics);
        Ok(state)
    }

    /// Saves a solver's state: without it all frames before would be cooked again.
    fn save_solver(&mut self, node: ChainNode, segment: ChainSegment, frame: i64, state: Option<&StateBox>) {
        let Some(saved) = node.chain.saved.filter(|saved| saved.resume.is_none() && self.disk.is_some()) else {
            return;
        };
        if let Some(bytes) = state.and_then(|state| (saved.save)(state)) {
            self.save_state(node.index, segment, frame, saved, &bytes);
        }
    }

    fn chain_output(
        &mut self,
        node: ChainNode,
        frame: i64,
        reads: Result<Reads<'g>, Arc<CookError>>,
        state: &Result<StateBox, Arc<CookError>>,
    ) -> Outcome {
        let at = Frame::whole(frame);
        let state = state.as_ref().map_err(Arc::clone)?;
        let returned =
            self.call(node.index, node.declared, at, &reads?, &|cx: &FrameCx| (node.chain.output)(state, cx));
        self.record_result(node.index, at, returned)
    }

    /// A chain's results at the frames that were demanded, between whole frames too.
    fn finish_chain(&mut self, node: ChainNode, frames: &BTreeSet<Frame>) {
        for frame in frames {
            let outcome = match self.plan.output_frames(*frame) {
                OutputFrames::Whole(whole) => self.recent(node.index, whole).and_then(|recent| recent.outcome),
                OutputFrames::Between(near, share) => self.output_between(node, *frame, near, share),
            };
            self.nodes[node.index].results.insert(*frame, outcome);
        }
    }

    fn output_between(&mut self, node: ChainNode, frame: Frame, near: [i64; 4], share: f32) -> Outcome {
        let [a, b, c, d] = near.map(|whole| self.recent(node.index, whole));
        let near = [a?, b?, c?, d?];
        let resolved = self.keys.resolve(node.index, frame)?;
        let now = self.followed(node, frame, &resolved.reads).transpose()?;
        let of_followed = near.each_ref().map(|recent| recent.followed.as_deref());
        let followed = match (node.declared.follows, &now, of_followed) {
            (Some(Follows { restore, .. }), Some(now), [Some(a), Some(b), Some(c), Some(d)]) => {
                Some(Followed { now, near: [a, b, c, d], restore })
            }
            _ => None,
        };
        let [a, b, c, d] = near.each_ref().map(|recent| recent.outcome.as_ref().map_err(Arc::clone));
        let between = self.executor.interpolated([a?, b?, c?, d?], share, followed);
        between.map_err(|error| Arc::new(self.plan.error(node.index, frame, error)))
    }

    /// At a frame, the input whose points a window moves, where it declares one.
    fn followed(
        &self,
        node: ChainNode,
        frame: Frame,
        reads: &Reads<'g>,
    ) -> Option<Result<Arc<Geometry>, Arc<CookError>>> {
        let follows = node.declared.follows?;
        let input = reads.inputs.iter().find(|input| input.name == follows.input)?;
        Some(self.geometry(self.plan.read(*input.links.first()?, frame)))
    }

    /// The output at a whole frame; before the first state, that of its start.
    fn recent(&mut self, node: usize, frame: i64) -> Result<Recent, Arc<CookError>> {
        let segment = self.keys.segment(node, frame)?;
        let frame = frame.max(segment.start);
        let missing = || Err(self.not_cooked(node, Frame::whole(frame)));
        self.nodes[node].recent.get(&frame).cloned().map_or_else(missing, Ok)
    }
}
