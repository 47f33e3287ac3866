//! Attributes that the family's nodes exchange.

use engine::prelude::*;

/// On points of a body: the corresponding point of the surface; −1 inside.
pub(crate) const SURFACE_POINT: Attr<i32> = Attr::point("surface_point");
/// On tets: the number of the connected body that the tet belongs to, from 0.
pub(crate) const BODY_NUMBER: Attr<i32> = Attr::element("body");
/// On tets of a body: 1 if the tet is too flat to have a meaningful volume, else 0.
pub(crate) const SLIVER: Attr<i32> = Attr::element("sliver");
/// On tets of a cage: the share of the tet that is inside the surface, by which its mass and stiffness are scaled.
pub(crate) const FILL: Attr<f32> = Attr::element("fill");

/// Of a goal: the frame at which the body reaches it.
pub(crate) const GOAL_FRAME: Attr<f32> = Attr::once("goal_frame");
/// Of a goal: how strongly the body is pulled, 1/s² (acceleration per distance).
pub(crate) const GOAL_STRENGTH: Attr<f32> = Attr::once("goal_strength");
/// On points of a goal: the share of that strength with which the particle is pulled; missing where all are pulled alike.
pub(crate) const GOAL_SHARE: Attr<f32> = Attr::point("goal_share");
/// Of a goal: the frame from which the body is pulled.
pub(crate) const GOAL_START: Attr<f32> = Attr::once("goal_start");
/// Of a goal: number of frames for which the body is held.
pub(crate) const GOAL_HOLD: Attr<f32> = Attr::once("goal_hold");

/// `goal_start` of a goal without limit: before the start of any scene, and exact in f32.
pub(crate) const ALWAYS: f32 = -1e9;

/// Of a pin: its radius at the start, metres.
pub(crate) const PIN_RADIUS: Attr<f32> = Attr::point("pin_radius");
/// Of a pin: how strongly it pulls, 1/s²; 0 holds exactly.
pub(crate) const PIN_STRENGTH: Attr<f32> = Attr::point("pin_strength");
/// Of a pin: the frame from which it releases its particles.
pub(crate) const PIN_RELEASE: Attr<f32> = Attr::point("pin_release");
