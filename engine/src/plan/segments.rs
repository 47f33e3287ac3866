//! Segments of windows and solvers: from where a state starts to the last frame that it is asked for.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Plan;
use crate::error::CookError;
use crate::node::{Cook, Past};
use crate::time::Frame;

/// Fewest frames from an anchor to the next. They are at least as far apart as the window is long, so that at most two
/// states run side by side and a frame costs two updates whatever the window's length.
pub(super) const LEAST_SPACING: i64 = 8;

/// The frames over which one state of a window or solver runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ChainSegment {
    /// Where the state starts.
    pub(crate) start: i64,
    /// First frame whose output it gives; `i64::MIN` for the first segment.
    pub(crate) from: i64,
    /// First frame whose output it does not give; `i64::MAX` for a solver.
    pub(crate) until: i64,
}

/// How far back a window goes, and how often a new state starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Frames before an anchor at which the state starts, or would if the scene did not start later; the most, where it
    /// changes with time.
    pub frames: i64,
    /// Frames from an anchor to the next.
    pub every: i64,
}

/// Where the states of one window start. Anchors are at fixed frames, so that a frame's bits do not depend on which frames
/// are asked.
pub(super) struct Anchors {
    pub(super) window: Window,
    /// No state starts before this frame.
    earliest: i64,
    /// By anchor: where its state starts.
    starts: BTreeMap<i64, i64>,
}

impl Anchors {
    pub(super) fn forget_before(&mut self, frame: i64) {
        let every = self.window.every;
        self.starts.retain(|anchor, _| anchor + every > frame);
    }
}

/// The segment that gives the output of a window or solver at `frame`; `anchors` are those known of the node so far.
///
/// # Errors
/// Where a param is refused at a frame that decides where the state starts.
///
/// # Panics
/// Where the node is neither a window nor a solver.
pub(super) fn segment(
    plan: &Plan<'_>,
    node: usize,
    frame: i64,
    anchors: &mut Option<Anchors>,
) -> Result<ChainSegment, Arc<CookError>> {
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
            let anchors = match anchors {
                Some(anchors) => anchors,
                none => {
                    let Past { frames, preroll } = past(first)?;
                    let frames = i64::from(frames);
                    let window = Window { frames, every: frames.max(LEAST_SPACING) };
                    none.insert(Anchors { window, earliest: first - i64::from(preroll), starts: BTreeMap::new() })
                }
            };
            let every = anchors.window.every;
            let anchor = first + (frame - first).max(0) / every * every;
            let start = match anchors.starts.get(&anchor) {
                Some(start) => *start,
                None if !resolver.is_animated() => (anchor - anchors.window.frames).max(anchors.earliest),
                None => forgotten(anchor, anchors.earliest, |frame| past(frame).map(|past| past.frames))?,
            };
            anchors.starts.insert(anchor, start);
            anchors.window.frames = anchors.window.frames.max(anchor - start);
            let from = if anchor == first { i64::MIN } else { anchor };
            Ok(ChainSegment { start, from, until: anchor + every })
        }
        Some(Cook::Solver(_, start_frame)) => {
            let start = start_frame(&at(first)?).unwrap_or(first);
            Ok(ChainSegment { start, from: i64::MIN, until: i64::MAX })
        }
        _ => unreachable!("only windows and solvers have segments"),
    }
}

/// The latest frame, but not before `earliest`, whose state no longer matters at `from`, where the step to a frame forgets
/// one part in `frames(frame)`.
fn forgotten<E>(from: i64, earliest: i64, frames: impl Fn(i64) -> Result<u32, E>) -> Result<i64, E> {
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
