//! The geometry family: sources, and helpers that any scene needs.

pub mod attribute_expr;
pub mod curve_attach;
pub mod curve_in;
pub mod curve_interpolate;
pub mod curve_scatter;
pub mod lattice_deform;
pub mod merge;
pub mod mesh_in;
pub mod mesh_primitive;
pub mod point_in;
mod shared;
pub mod tet_in;
pub mod transform;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[
    &attribute_expr::NODE,
    &curve_attach::NODE,
    &curve_in::NODE,
    &curve_interpolate::NODE,
    &curve_scatter::NODE,
    &lattice_deform::NODE,
    &merge::NODE,
    &mesh_in::NODE,
    &mesh_primitive::NODE,
    &point_in::NODE,
    &tet_in::NODE,
    &transform::NODE,
];
