//! Kernels that grow, carry, bend, swing and collide curves: plain slices in, plain slices out; knows no node and no
//! geometry.
//!
//! All that [`numerics`] promises holds: the same bits on any CPU and for any number of threads. How a kernel is written
//! is said there.

#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod attach;
pub mod collide;
pub mod guides;
pub mod gusts;
pub mod jiggle;
pub mod lattice;
pub mod scatter;
pub mod shield;
pub mod surface;
pub mod wind_bend;
