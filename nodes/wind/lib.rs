//! The wind family: wind on fur and grass (paper W).

pub mod curve_jiggle;
pub mod curve_wind;
pub mod curve_wind_collision;
pub mod curve_wind_gusts;
pub mod curve_wind_shielding;
pub mod gust_control;
mod shared;

use engine::node::Node;

/// The family's nodes, by name.
pub static NODES: &[&Node] = &[
    &curve_jiggle::NODE,
    &curve_wind::NODE,
    &curve_wind_collision::NODE,
    &curve_wind_gusts::NODE,
    &curve_wind_shielding::NODE,
    &gust_control::NODE,
];
