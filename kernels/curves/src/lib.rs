//! Kernels that grow, attach, bend, swing and collide curves. Functions take and return plain slices; nothing here
//! depends on nodes or on the engine's geometry.
//!
//! As everywhere in [`numerics`], results have the same bits on any CPU and for any number of threads; that crate also
//! describes how a kernel is written.

#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod attach;
pub mod clumps;
pub mod collide;
pub mod deform;
pub mod guides;
pub mod gusts;
pub mod jiggle;
pub mod lattice;
pub mod scatter;
pub mod shield;
pub mod surface;
pub mod wind_bend;
