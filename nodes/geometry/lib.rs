//! The geometry family: sources, and helpers that any scene needs.

pub mod curve_in;
pub mod mesh_in;
pub mod point_in;
mod shared;
pub mod tet_in;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[&curve_in::NODE, &mesh_in::NODE, &point_in::NODE, &tet_in::NODE];
