//! The fluid family: viscous liquids, directed by sources, sinks, colliders and gravity (paper R).

mod fluid_sink;
mod fluid_source;
mod fluid_surface;
mod fluidsolve;
mod shared;
mod surface_tag;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] =
    &[&fluid_sink::NODE, &fluidsolve::NODE, &fluid_source::NODE, &fluid_surface::NODE, &surface_tag::NODE];
