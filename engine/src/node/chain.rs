//! Nodes with a state that runs through time: windows (restarted at fixed anchors) and solvers (run from their start).

use std::any::Any;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Cook, FrameCx, Outputs, StepCx};
use crate::Result;
use crate::param::{Clock, Params};

/// A state that runs through whole frames, oldest first. Inputs of a frame are dropped once it is stepped over.
pub trait Chain: Send + Sync + Sized + 'static {
    /// The state at its first frame: as if everything had always been as it is there.
    ///
    /// # Errors
    /// Where the inputs there are refused.
    fn start(cx: &FrameCx) -> Result<Self>;

    /// Moves the state from the frame before to `cx.frame()`.
    ///
    /// # Errors
    /// Where an input is refused; the chain ends there.
    fn step(&mut self, cx: &StepCx) -> Result<()>;

    /// What comes out at `cx.frame()`, where the state stands.
    ///
    /// # Errors
    /// Where the result is refused.
    fn output(&self, cx: &FrameCx) -> Result<Outputs>;
}

/// A chain whose state can be written to a checkpoint and read back bit for bit.
pub trait Solver: Chain + Serialize + DeserializeOwned {}
impl<S: Chain + Serialize + DeserializeOwned> Solver for S {}

/// How much of the past a window hangs on, given its params at a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Past {
    /// Steps like the one to this frame after which nothing is left of what was before them; each leaves out its share.
    /// 0: this step forgets all.
    pub frames: u32,
    /// Frames before the scene's first at which the state may begin; read at the scene's first frame. 0: what was before
    /// the scene was as it is at its first frame.
    pub preroll: u32,
}

impl Past {
    /// That many frames, none before the scene's first.
    pub const fn frames(frames: u32) -> Self {
        Self { frames, preroll: 0 }
    }
}

/// A state of any type.
pub(crate) type StateBox = Box<dyn Any + Send + Sync>;

/// A chain's functions, its state's type erased.
#[derive(Clone, Copy)]
pub struct ChainFns {
    pub(crate) start: fn(&FrameCx) -> Result<StateBox>,
    pub(crate) step: fn(&mut StateBox, &StepCx) -> Result<()>,
    pub(crate) output: fn(&StateBox, &FrameCx) -> Result<Outputs>,
}

/// What a solver has besides.
#[derive(Clone, Copy)]
pub struct SolverFns {
    pub(crate) save: fn(&StateBox) -> Option<Vec<u8>>,
    pub(crate) load: fn(&[u8]) -> Option<StateBox>,
    pub(crate) start_frame: fn(&Params) -> Option<i64>,
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
                state.step(cx)
            },
            output: |state, cx| of::<S>(state).output(cx),
        }
    }
}

impl Cook {
    /// A window: frame f depends on at least as many frames before it as `past` says, and on no more than the engine's
    /// anchors add to that. The state starts that many frames before an anchor; anchors are fixed, so a frame's bits do
    /// not depend on which frames are asked. Where params are animated, each step counts by its own: one that would take
    /// n frames to forget all forgets an n-th.
    pub const fn window<S: Chain>(past: fn(&Params, Clock) -> Past) -> Self {
        Self::Window(ChainFns::of::<S>(), past)
    }

    /// A solver: runs from `start_frame(params)`, or the scene's first frame, in order, whatever frames are asked.
    pub const fn solver<S: Solver>(start_frame: fn(&Params) -> Option<i64>) -> Self {
        Self::Solver(
            ChainFns::of::<S>(),
            SolverFns {
                save: |state| postcard::to_stdvec(of::<S>(state)).ok(),
                load: |bytes| Some(Box::new(postcard::from_bytes::<S>(bytes).ok()?)),
                start_frame,
            },
        )
    }
}
