//! Attributes by which the family's nodes speak with each other.

use engine::prelude::*;

/// On a body's points: the surface's point that each one is; −1 inside.
pub(crate) const SURFACE_POINT: Attr<i32> = Attr::point("surface_point");
/// On a body's tets: 1 where one is too flat for its volume to mean anything, else 0.
pub(crate) const SLIVER: Attr<i32> = Attr::element("sliver");

/// On a goal: the frame at which the body shall be there.
pub(crate) const GOAL_FRAME: Attr<f32> = Attr::once("goal_frame");
/// How hard it is pulled there, 1/s²: acceleration by distance.
pub(crate) const GOAL_STRENGTH: Attr<f32> = Attr::once("goal_strength");
/// How many frames it is held there.
pub(crate) const GOAL_HOLD: Attr<f32> = Attr::once("goal_hold");

/// On a pin: how far it reaches at the start, metres.
pub(crate) const PIN_RADIUS: Attr<f32> = Attr::point("pin_radius");
/// How hard it pulls, 1/s²; 0 holds exactly.
pub(crate) const PIN_STRENGTH: Attr<f32> = Attr::point("pin_strength");
/// The frame from which it lets go.
pub(crate) const PIN_RELEASE: Attr<f32> = Attr::point("pin_release");
