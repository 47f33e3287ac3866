//! Soft bodies: tets that fill them ([`tets`]), shapes they are led to ([`goals`]), how they move ([`mass_spring`]) and
//! what they meet ([`collision`]); plain slices in, plain slices out; knows no node and no geometry.
//!
//! All that [`numerics`] promises holds: the same bits on any CPU and for any number of threads.

#![deny(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod collision;
pub mod embedding;
pub mod goals;
pub mod mass_spring;
pub mod tets;
