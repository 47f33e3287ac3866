//! The softbody family: dough and eggs (paper R).

mod shared;
pub mod softbody;
pub mod softbody_goal;
pub mod softbody_pin;
pub mod tetrahedralize;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[&softbody::NODE, &softbody_goal::NODE, &softbody_pin::NODE, &tetrahedralize::NODE];
