//! Soft bodies: what they do ([`soft`]) and what they meet ([`touch`]); plain slices in, plain slices out.
//!
//! A part of the numerics that compiles by itself: the kernels of the wind take minutes, and none of them is used here.
//! All that [`numerics`] promises holds: the same bits on any CPU and for any number of threads.

#![deny(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod soft;
pub mod touch;
