//! The softbody family: dough and eggs (paper R).

mod shared;
mod softbody;
mod softbody_goal;
mod softbody_pin;
mod tetrahedralize;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[&softbody::NODE, &softbody_goal::NODE, &softbody_pin::NODE, &tetrahedralize::NODE];
