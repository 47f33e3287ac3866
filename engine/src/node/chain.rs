//! Nodes with a state that advances through time: windows (restarted at fixed anchors) and solvers (run from their
//! start).

use std::any::Any;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Cook, FrameCx, Outputs, StepCx};
use crate::Result;
use crate::param::{Clock, Params};

/// A state that advances through whole frames, oldest first. A frame's inputs are dropped once the state has passed it.
pub trait Chain: Send + Sync + Sized + 'static {
    /// The state at its first frame, as if everything had been at rest before.
    ///
    /// # Errors
    /// Where the inputs there are refused.
    fn start(cx: &FrameCx) -> Result<Self>;

    /// Advances the state from the previous frame to `cx.frame()`.
    ///
    /// # Errors
    /// Where an input is refused; the chain ends there.
    fn step(&mut self, cx: &StepCx) -> Result<()>;

    /// Advances the state to a frame at which the node is neutral ([`super::Node::neutral`]) and its output is its
    /// input: here a node discards its motion, so that it starts from rest afterwards. By default the same as
    /// [`Chain::step`].
    ///
    /// # Errors
    /// Where an input is refused; the chain ends there.
    fn step_neutral(&mut self, cx: &StepCx) -> Result<()> {
        self.step(cx)
    }

    /// The output at `cx.frame()`, the frame of the state.
    ///
    /// # Errors
    /// Where the result is refused.
    fn output(&self, cx: &FrameCx) -> Result<Outputs>;
}

/// A chain whose state can be written to a checkpoint and read back bit for bit.
pub trait Solver: Chain + Serialize + DeserializeOwned {}
impl<S: Chain + Serialize + DeserializeOwned> Solver for S {}

/// A window whose state is kept on disk, so that a cook that was interrupted need not warm it up again.
pub trait Resumable: Chain {
    /// What the inputs at the state's frame do not give.
    type Saved: Serialize + DeserializeOwned + Send + Sync + 'static;

    /// The state without what the inputs give.
    fn save(&self) -> Self::Saved;

    /// The state that was saved at `cx.frame()`, bit for bit. It is given the same inputs as [`Chain::start`].
    ///
    /// # Errors
    /// Where an input is refused.
    fn resume(saved: Self::Saved, cx: &FrameCx) -> Result<Self>;
}

/// How far back a window depends on the past, given its params at a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Past {
    /// The number of steps like the one to this frame after which nothing earlier has an effect; 0: this step alone
    /// determines the state.
    pub frames: u32,
    /// The number of frames before the scene's first frame from which the state may start; read at the scene's first
    /// frame. 0: before the scene everything was as at its first frame.
    pub preroll: u32,
}

impl Past {
    /// That many frames, without a preroll.
    pub const fn frames(frames: u32) -> Self {
        Self { frames, preroll: 0 }
    }
}

/// A state, its type erased.
pub(crate) type StateBox = Box<dyn Any + Send + Sync>;

/// A chain's functions, its state's type erased.
#[derive(Clone, Copy)]
pub struct ChainFns {
    pub(crate) start: fn(&FrameCx) -> Result<StateBox>,
    pub(crate) step: fn(&mut StateBox, &StepCx) -> Result<()>,
    pub(crate) output: fn(&StateBox, &FrameCx) -> Result<Outputs>,
    /// How its state is kept on disk, where it can be.
    pub(crate) saved: Option<SavedFns>,
}

/// How a state is written and read back.
#[derive(Clone, Copy)]
pub(crate) struct SavedFns {
    pub(crate) save: fn(&StateBox) -> Option<Vec<u8>>,
    pub(crate) load: fn(&[u8]) -> Option<StateBox>,
    /// Makes what was loaded a state, from the inputs at its frame; `None`: it is one.
    pub(crate) resume: Option<fn(StateBox, &FrameCx) -> Result<StateBox>>,
}

fn of<S: 'static>(state: &StateBox) -> &S {
    state.downcast_ref().expect("a chain's functions are all made for one state type")
}

impl ChainFns {
    const fn of<S: Chain>() -> Self {
        Self {
            start: |cx| Ok(Box::new(S::start(cx)?)),
            step: |state, cx| {
                let state: &mut S = state.downcast_mut().expect("a chain's functions are all made for one state type");
                if cx.is_neutral() { state.step_neutral(cx) } else { state.step(cx) }
            },
            output: |state, cx| match cx.is_neutral() {
                true => cx.node.pass_through(cx),
                false => of::<S>(state).output(cx),
            },
            saved: None,
        }
    }
}

impl Cook {
    /// A window: a frame depends on at least `past` frames before it, and on at most a fixed number more. The state
    /// starts that many frames before an anchor; anchors are fixed, so a frame's bits do not depend on which frames are
    /// requested. Where params are animated, a step whose `past` is n frames contributes 1/n.
    pub const fn window<S: Chain>(past: fn(&Params, Clock) -> Past) -> Self {
        Self::Window(ChainFns::of::<S>(), past)
    }

    /// A [`Cook::window`] whose state is kept on disk where warming it up again would take longer.
    pub const fn resumable_window<S: Resumable>(past: fn(&Params, Clock) -> Past) -> Self {
        let saved = SavedFns {
            save: |state| postcard::to_stdvec(&of::<S>(state).save()).ok(),
            load: |bytes| Some(Box::new(postcard::from_bytes::<S::Saved>(bytes).ok()?)),
            resume: Some(|saved, cx| {
                let saved = saved.downcast::<S::Saved>();
                Ok(Box::new(S::resume(*saved.expect("a chain's functions are all made for one state type"), cx)?))
            }),
        };
        Self::Window(ChainFns { saved: Some(saved), ..ChainFns::of::<S>() }, past)
    }

    /// A solver: it runs through all frames from `start_frame(params)`, or the scene's first frame, whichever are
    /// requested.
    pub const fn solver<S: Solver>(start_frame: fn(&Params) -> Option<i64>) -> Self {
        let saved = SavedFns {
            save: |state| postcard::to_stdvec(of::<S>(state)).ok(),
            load: |bytes| Some(Box::new(postcard::from_bytes::<S>(bytes).ok()?)),
            resume: None,
        };
        Self::Solver(ChainFns { saved: Some(saved), ..ChainFns::of::<S>() }, start_frame)
    }
}
