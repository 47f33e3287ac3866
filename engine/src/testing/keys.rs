//! Keys as a cook would find them, for tests of what they hang on.

use std::sync::Arc;

use crate::cook::CookError;
use crate::graph::Graph;
use crate::key::Key;
use crate::plan::{Keys, Plan, Request};
use crate::time::Frame;

/// Keys of a node's results at some frames, found one after the other, as a cook of all outputs would find them.
///
/// # Errors
/// Where a param is refused at one of the frames, or the request is.
///
/// # Panics
/// Where the graph has no node of that id.
pub fn keys(graph: &Graph, node: &str, frames: &[Frame]) -> Result<Vec<Key>, Arc<CookError>> {
    let place = graph.nodes.iter().position(|known| &*known.id == node);
    let place = place.unwrap_or_else(|| panic!("the graph has no node `{node}`"));
    let request = Request { outputs: (0..graph.outputs.len()).collect(), frames: frames.to_vec() };
    let plan = Plan::new(graph, &request, Arc::default())?;
    let mut keys = Keys::new(&plan);
    frames.iter().map(|frame| keys.spot(place, plan.canonical(place, *frame)).map(|spot| spot.key)).collect()
}
