//! The geometry family: sources, and helpers that any scene needs.

mod attribute_expr;
mod attribute_transfer;
mod curve_attach;
mod curve_deform;
mod curve_in;
mod curve_interpolate;
mod curve_resample;
mod curve_scatter;
mod curve_trim;
mod lattice_deform;
mod merge;
mod mesh_in;
mod mesh_primitive;
mod point_in;
mod shared;
mod tet_in;
mod transform;
mod usd_in;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[
    &attribute_expr::NODE,
    &attribute_transfer::NODE,
    &curve_attach::NODE,
    &curve_deform::NODE,
    &curve_in::NODE,
    &curve_interpolate::NODE,
    &curve_resample::NODE,
    &curve_scatter::NODE,
    &curve_trim::NODE,
    &lattice_deform::NODE,
    &merge::NODE,
    &mesh_in::NODE,
    &mesh_primitive::NODE,
    &point_in::NODE,
    &tet_in::NODE,
    &transform::NODE,
    &usd_in::NODE,
];
