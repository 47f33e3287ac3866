//! The keys a cook would find, without cooking.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::{Keys, Plan, Request};
use crate::error::CookError;
use crate::graph::Graph;
use crate::key::ContentKey;
use crate::time::Frame;

/// Keys of a node's results at `frames`, found in that order by one plan that asks for all outputs of the graph.
///
/// # Errors
/// Where a param is refused at one of the frames, or the request is.
///
/// # Panics
/// Where the graph has no node with the id `node`.
pub fn result_keys(graph: &Graph, node: &str, frames: &[Frame]) -> Result<Vec<ContentKey>, Arc<CookError>> {
    let index = graph.nodes.iter().position(|known| &*known.id == node);
    let index = index.unwrap_or_else(|| panic!("the graph has no node `{node}`"));
    let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: frames.to_vec().into() };
    let plan = Plan::new(graph, &request, Arc::default())?.keeping_all_outputs();
    let cancel = AtomicBool::new(false);
    let mut keys = Keys::new(&plan, &cancel);
    frames.iter().map(|frame| keys.resolve(index, plan.canonical(index, *frame)).map(|resolved| resolved.key)).collect()
}
