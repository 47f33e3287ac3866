//! What a sweep does where a node is to be called: a cook calls it, a rehearsal only pretends.

use std::sync::Arc;

use crate::cook::call::{Call, Returned, check_finite};
use crate::cook::interpolate::{Followed, between_files, interpolated};
use crate::cook::store::{Cooked, Metrics};
use crate::cook::types::completed;
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::node::{ChainFns, FrameCx, Outputs, SavedFns, StateBox};
use crate::time::Frame;

/// How a sweep carries out calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::cook) enum Executor {
    /// Calls nodes.
    Cook,
    /// Calls nodes for a check of a graph: what each source cost is remembered for the cook that follows.
    Check,
    /// Calls nodes for geometry without rows; their results get every attribute that they may have.
    Types,
    /// Calls no node: every result is empty, and nothing is delivered.
    Rehearsal,
    /// Calls nodes, and serialises and reads back every state that can be saved after each step.
    Reload,
}

impl Executor {
    /// Whether finished frames come out.
    pub(super) fn delivers(self) -> bool {
        self != Self::Rehearsal
    }

    /// Whether costs are remembered for the cook that follows.
    pub(super) fn remembers_costs(self) -> bool {
        self == Self::Check
    }

    /// Geometry that the program gives, refused where it is not finite, so that no node need check.
    pub(super) fn given(self, at: &(dyn Fn(Frame) -> Geometry + Send + Sync), frame: Frame) -> Result<Cooked> {
        if self == Self::Rehearsal {
            return Ok(Arc::from([Arc::default()]));
        }
        let geometry = at(frame);
        check_finite(&geometry, &[])?;
        Ok(Arc::from([Arc::new(geometry)]))
    }

    /// A node's outputs at a frame.
    pub(super) fn call<'a>(
        self,
        call: Call<'a>,
        cook: &(impl Fn(&FrameCx<'a>) -> Result<Outputs> + ?Sized),
    ) -> Result<Returned> {
        if self == Self::Rehearsal {
            let cooked = call.node.outputs.iter().map(|_| Arc::new(Geometry::default())).collect();
            return Ok(Returned { cooked, metrics: Vec::new(), new_bytes: 0, stripped: Vec::new() });
        }
        let (node, inputs) = (call.node, if self == Self::Types { call.inputs.clone() } else { Vec::new() });
        let (outputs, finished) = call.run(cook)?;
        let mut returned = finished.check(outputs)?;
        if self == Self::Types {
            returned.cooked = completed(node, &inputs, returned.cooked);
        }
        Ok(returned)
    }

    /// The state of a window or solver at its first frame, and what was published there.
    pub(super) fn start(self, call: Call<'_>, chain: ChainFns) -> Result<(StateBox, Metrics)> {
        if self == Self::Rehearsal {
            return Ok((Box::new(()), Vec::new()));
        }
        let (state, finished) = call.run(|cx| (chain.start)(cx))?;
        Ok((state, finished.metrics()))
    }

    /// Moves a state from the frame before to that of the call; returns what was published there.
    pub(super) fn step(self, call: Call<'_>, chain: ChainFns, state: &mut StateBox) -> Result<Metrics> {
        if self == Self::Rehearsal {
            return Ok(Vec::new());
        }
        Ok(call.step(|cx| (chain.step)(state, cx))?.metrics())
    }

    /// Makes what was loaded a state.
    pub(super) fn resume(self, call: Call<'_>, saved: SavedFns, state: StateBox) -> Result<StateBox> {
        match saved.resume {
            Some(resume) => Ok(call.run(|cx| resume(state, cx))?.0),
            None => Ok(state),
        }
    }

    /// Whether every state is written and read back after each step.
    pub(super) fn reloads(self) -> bool {
        self == Self::Reload
    }

    /// A state written and read back, where this executor does so; a window's is then to be resumed.
    pub(super) fn reloaded(self, state: StateBox, saved: Option<SavedFns>) -> Result<StateBox> {
        match saved.filter(|_| self.reloads()) {
            None => Ok(state),
            Some(saved) => (saved.save)(&state)
                .and_then(|bytes| (saved.load)(&bytes))
                .ok_or_else(|| Error::contract("its state cannot be written and read back")),
        }
    }

    /// The outputs of a source of numbered files `share` of the way from one whole frame to the next.
    pub(super) fn between_files(self, near: [&Cooked; 2], share: f32) -> Cooked {
        match self {
            Self::Rehearsal => near[0].clone(),
            Self::Cook | Self::Check | Self::Types | Self::Reload => between_files(near, share),
        }
    }

    /// The outputs of a window `share` of the way from `near[1]` to `near[2]`.
    pub(super) fn interpolated(self, near: [&Cooked; 4], share: f32, followed: Option<Followed<'_>>) -> Result<Cooked> {
        match self {
            Self::Rehearsal => Ok(near[1].clone()),
            Self::Cook | Self::Check | Self::Types | Self::Reload => interpolated(near, share, followed),
        }
    }
}
