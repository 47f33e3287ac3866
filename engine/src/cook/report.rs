//! What a cook cost and what it published.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::tips::{EndTips, NodeEndTips};
use crate::error::CookError;
use crate::geometry::Name;
use crate::node::LeftOut;
use crate::note::Note;
use crate::plan::Window;
use crate::time::Frame;

/// One node's part in a cook.
#[derive(Clone, Debug, Default)]
pub struct NodeReport {
    /// Its id.
    pub id: Option<Name>,
    /// Its type.
    pub type_name: &'static str,
    /// `pure`, `frame`, `window`, `solver` or `given`.
    pub time: &'static str,
    /// Whether anything asked depends on it.
    pub needed: bool,
    /// Whether `bypass` is set, so that nothing reads it.
    pub bypassed: bool,
    /// Whether its result may change with the frame.
    pub varies: bool,
    /// Results cooked; steps of a window or solver.
    pub cooks: u64,
    /// Of a window: how far back it goes, and every how many frames its state starts anew.
    pub window: Option<Window>,
    /// Results taken from memory instead, and states of solvers from disk.
    pub from_cache: u64,
    /// Frames for which a finished frame on disk, that this node has a part in, was taken.
    pub from_disk: u64,
    /// Stages that could not matter.
    pub left_out: Vec<LeftOut>,
    /// What it says of itself; see [`crate::node::Node::explains`].
    pub explained: Vec<String>,
    /// Wall time.
    pub wall: Duration,
    /// CPU time of all threads.
    pub cpu: Duration,
    /// Greatest size of the arrays that one result added.
    pub peak_bytes: usize,
    /// Metrics by name and frame.
    pub metrics: BTreeMap<&'static str, BTreeMap<Frame, f64>>,
    /// The tips of its curves at the first and the last sample, if they are compared and the node varies.
    pub ends: Option<EndTips>,
}

/// What a cook cost and what it published.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// By node, in the order of the graph.
    pub nodes: Vec<NodeReport>,
    /// Frames delivered, by place of the output in the graph.
    pub delivered: BTreeMap<usize, u64>,
    /// Finished frames of outputs read from the disk cache.
    pub from_disk: u64,
    /// Errors by output; the first of each node, oldest frame first, with how many frames it spoiled.
    pub errors: Vec<(usize, Arc<CookError>, u64)>,
    /// Wall time of the whole cook, writing included.
    pub wall: Duration,
    /// CPU time of the whole cook.
    pub cpu: Duration,
    /// Wall time spent cooking, writing left out.
    pub cooking: Duration,
    /// Greatest size of all results held at once.
    pub peak_bytes: usize,
    /// Whether someone cancelled it.
    pub cancelled: bool,
    /// What a user should know although it is no error.
    pub notes: Vec<Note>,
}

impl Report {
    /// What neighbouring parts of the scene compare with this cook.
    pub fn end_tips(&self) -> NodeEndTips {
        let of = |node: &NodeReport| Some((node.id.as_ref()?.to_string(), node.ends.clone()?));
        NodeEndTips(self.nodes.iter().filter_map(of).collect())
    }
}
