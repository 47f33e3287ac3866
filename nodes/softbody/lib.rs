//! The softbody family: dough and eggs (paper R).

pub mod tetrahedralize;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[&tetrahedralize::NODE];
