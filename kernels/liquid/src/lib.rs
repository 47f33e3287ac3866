//! Liquids on a sparse grid: cells stored row by row ([`rows`]) and loops over them ([`stencil`]), the pressure that
//! keeps a liquid's volume ([`pressure`]), pressure and viscosity together ([`viscosity`]), the surface as a level set
//! ([`level_set`]) made exact by markers ([`markers`], together [`marked`]) and as a mesh ([`extract`]), velocity on faces ([`velocity`]),
//! meshes as sources and colliders ([`shape`]), the volume of each piece and of each liquid in it kept ([`volumes`]), points that it
//! carries ([`carried`]), their values at other points ([`tag`]), and all of it moved frame by frame ([`step`]). Functions take
//! and return plain slices; nothing here depends on nodes or on the engine's geometry.
//!
//! As everywhere in [`numerics`], results have the same bits on any CPU and for any number of threads.

#![allow(clippy::needless_range_loop, reason = "a loop over cells reads and writes many arrays")]

// Test surfaces are shared with examples, which know the crate by its name.
#[cfg(test)]
extern crate self as liquid;

pub mod carried;
mod chebyshev;
mod dense;
pub mod extract;
pub mod fields;
mod grids;
pub mod level_set;
pub mod marked;
pub mod markers;
pub mod open_share;
pub mod pressure;
pub mod rows;
mod sets;
pub mod shape;
pub mod stencil;
pub mod step;
pub mod tag;
mod transfer;
pub mod velocity;
pub mod viscosity;
pub mod volumes;
