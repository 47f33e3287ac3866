//! Chains: states that start, step, put out and are saved along the way.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Advance, Outcome, Reading, Running, Sweep};
use crate::cook::store::Cooked;
use crate::cook::{CookError, between};
use crate::node::{ChainFns, FrameCx, Node, SolverFns, StateBox};
use crate::plan::Stretch;
use crate::time::Frame;

impl Sweep<'_, '_, '_> {
    /// Moves a chain along its stretches, and takes its outputs on the way.
    pub(super) fn move_chain(
        &mut self,
        node: usize,
        declared: &'static Node,
        chain: ChainFns,
        solver: Option<SolverFns>,
        advance: BTreeMap<Stretch, Advance>,
    ) {
        for (stretch, advance) in advance {
            let mut running = self.running[node].remove(&stretch);
            if let Some(at) = running.as_ref().map(|running| running.at).filter(|at| advance.outputs.contains(at)) {
                self.chain_output(node, declared, chain, running.as_ref(), at);
            }
            let next = running.as_ref().map_or(stretch.start, |running| running.at + 1);
            for frame in next..=advance.goal {
                if self.cancelled() {
                    return;
                }
                let state = match running.take() {
                    None => self.chain_start(node, declared, chain, frame),
                    Some(Running { state: Ok(state), .. }) => self.chain_step(node, declared, chain, frame, state),
                    Some(Running { state: Err(error), .. }) => Err(error),
                };
                self.count(node, Frame::whole(frame), state.as_ref().err());
                let state = match solver.filter(|_| self.reload) {
                    None => state,
                    Some(solver) => state.and_then(|state| self.reloaded(node, frame, solver, &state)),
                };
                self.save_state(node, stretch, frame, solver, state.as_ref().ok());
                running = Some(Running { at: frame, state, moved: self.slices });
                if advance.outputs.contains(&frame) {
                    self.chain_output(node, declared, chain, running.as_ref(), frame);
                }
            }
            if let Some(running) = running.filter(|running| running.at + 1 < stretch.until) {
                self.running[node].insert(stretch, running);
            }
        }
    }

    /// The state as a checkpoint would give it back.
    fn reloaded(
        &self,
        node: usize,
        frame: i64,
        solver: SolverFns,
        state: &StateBox,
    ) -> Result<StateBox, Arc<CookError>> {
        (solver.save)(state).and_then(|bytes| (solver.load)(&bytes)).ok_or_else(|| {
            let error = crate::Error::contract("its state cannot be written and read back");
            Arc::new(self.plan.error(node, Frame::whole(frame), error))
        })
    }

    pub(super) fn save_state(
        &mut self,
        node: usize,
        stretch: Stretch,
        frame: i64,
        solver: Option<SolverFns>,
        state: Option<&StateBox>,
    ) {
        let (Some(solver), Some(state)) = (solver, state) else { return };
        let Some(disk) = self.disk.as_mut() else { return };
        let Ok(key) = self.keys.state_key(node, stretch, frame) else { return };
        if let Some(bytes) = (solver.save)(state) {
            disk.save_checkpoint(&self.plan.graph.nodes[node].id, frame, key, &bytes);
        }
    }

    fn chain_start(
        &mut self,
        node: usize,
        declared: &'static Node,
        chain: ChainFns,
        frame: i64,
    ) -> Result<StateBox, Arc<CookError>> {
        let at = Frame::whole(frame);
        let fail = |error| Arc::new(self.plan.error(node, at, error));
        let params = self.plan.nodes[node].resolver.at(at).map_err(fail)?;
        if self.dry {
            return Ok(Box::new(()));
        }
        let inputs = self.inputs(node, declared, at, &params, Reading::Start)?;
        let (state, finished) =
            self.context(node, declared, at, &params, inputs).run(|cx| (chain.start)(cx)).map_err(fail)?;
        self.publish(node, at, &finished.metrics());
        Ok(state)
    }

    fn chain_step(
        &mut self,
        node: usize,
        declared: &'static Node,
        chain: ChainFns,
        frame: i64,
        mut state: StateBox,
    ) -> Result<StateBox, Arc<CookError>> {
        let at = Frame::whole(frame);
        let fail = |error| Arc::new(self.plan.error(node, at, error));
        let params = self.plan.nodes[node].resolver.at(at).map_err(fail)?;
        if self.dry {
            return Ok(state);
        }
        let inputs = self.inputs(node, declared, at, &params, Reading::Step)?;
        let call = self.context(node, declared, at, &params, inputs);
        let stepped = call.step(at.plus(-1), |cx| (chain.step)(&mut state, cx));
        let metrics = stepped.map_err(fail)?.metrics();
        self.publish(node, at, &metrics);
        Ok(state)
    }

    pub(super) fn chain_output(
        &mut self,
        node: usize,
        declared: &'static Node,
        chain: ChainFns,
        running: Option<&Running>,
        frame: i64,
    ) {
        let at = Frame::whole(frame);
        let state = running.expect("asked where a state stands").state.as_ref().map_err(Arc::clone);
        let returned = state.and_then(|state| {
            let fail = |error| Arc::new(self.plan.error(node, at, error));
            let params = self.plan.nodes[node].resolver.at(at).map_err(fail)?;
            self.call(node, declared, at, &params, &|cx: &FrameCx| (chain.output)(state, cx))
        });
        let outcome = self.take(node, at, returned);
        self.recent[node].insert(frame, outcome);
    }

    /// A chain's results at the frames that were asked, between whole frames too.
    pub(super) fn finish_chain(&mut self, node: usize, declared: &'static Node, need: &BTreeSet<Frame>) {
        for frame in need {
            let whole = |frame: i64, this: &mut Self| -> Outcome {
                let stretch = this.keys.stretch(node, frame)?;
                this.recent[node]
                    .get(&frame.max(stretch.start))
                    .expect("the chain was moved over every frame asked")
                    .clone()
            };
            let floor = frame.floor_number();
            let outcome = if frame.is_whole() {
                whole(floor, self)
            } else {
                let near = self.plan.neighbours(*frame).into_iter();
                let near: Result<Vec<Cooked>, _> = near.map(|frame| whole(frame, self)).collect();
                let share = (frame.ticks() - frame.floor().ticks()) as f32 / Frame::TICKS as f32;
                near.and_then(|near| match self.dry {
                    true => Ok(near[1].clone()),
                    false => between::between([&near[0], &near[1], &near[2], &near[3]], share, declared.mend_between)
                        .map_err(|error| Arc::new(self.plan.error(node, *frame, error))),
                })
            };
            self.results[node].insert(*frame, outcome);
        }
    }
}
