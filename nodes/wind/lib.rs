//! The wind family: wind on fur and grass (paper W).

mod curve_jiggle;
mod curve_wind;
mod curve_wind_collision;
mod curve_wind_gusts;
mod curve_wind_shielding;
mod gust_control;
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
