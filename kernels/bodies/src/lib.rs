//! Soft bodies: filling a closed surface with tets ([`tets`]), goal shapes ([`goals`]), the mass-spring solver
//! ([`mass_spring`]), contact detection ([`collision`]) and surfaces carried by tets ([`embedding`]). Functions take
//! and return plain slices; nothing here depends on nodes or on the engine's geometry.
//!
//! As everywhere in [`numerics`], results have the same bits on any CPU and for any number of threads.

#![allow(clippy::needless_range_loop, reason = "a loop over lanes reads and writes many arrays")]

pub mod collision;
pub mod embedding;
pub mod goals;
pub mod mass_spring;
pub mod tets;
