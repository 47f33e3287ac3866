//! Soft bodies: springs on the edges of tetrahedra, stepped implicitly (R1).
//!
//! Particles hang on springs and dashpots ([`Body`]); pressures keep their volume; gravity, goals, pins and contacts move
//! them. A frame is one step of TR-BDF2, its two stages one Newton iteration each, whose linear system conjugate gradients
//! solve on two levels without ever writing it out.
//!
//! Promise: bounded for any stiffness, mass and step, also from turned and crumpled shapes; order 2 in time where motion is
//! smooth; linear momentum kept to rounding, hard pins exact; without drive no energy gained; the same bits for any number
//! of threads and SIMD path, and after a state was written and read back. Limits: fast oscillation that a step cannot
//! resolve is damped; angular momentum is kept to the order of the method; f32 records hold forces to 1e-7 of the stiffest
//! spring at a particle. Everything is f64; metres, seconds, kilograms.

mod assemble;
mod body;
mod cg;
mod cholesky;
mod coarse;
mod contact;
mod drive;
mod edges;
mod energy;
mod euler;
mod frame;
mod galerkin;
mod guess;
mod hanging;
mod momentum;
mod order;
mod parts;
mod plastic;
mod regions;
mod rows;
mod search;
mod springs;
mod stage;
mod state;
mod step;
mod system;
mod volume;

pub use body::{Body, BodyError, LIGHTEST, Material, Mesh, SHORTEST, Spring};
pub use contact::{Contact, Contacts, Query};
pub use drive::{Goal, Pin};
pub use frame::{Frame, Integrator, Report, Solver};
pub use plastic::{Plasticity, flow, reset, tear};
pub use state::State;

#[cfg(test)]
mod tests;
