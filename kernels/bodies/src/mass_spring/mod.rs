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

mod adjacency;
mod assemble;
mod body;
mod cholesky;
mod coarse;
mod conjugate_gradients;
mod contact;
mod energy;
mod euler;
mod external;
mod frame;
mod galerkin;
mod momentum;
mod particle_order;
mod partition;
mod plastic;
mod predictor;
mod rank_one;
mod regions;
mod search;
mod springs;
mod stage;
mod state;
mod step;
mod system;
mod tet_springs;
mod volume;

pub use body::{BodyError, BodySpring, LIGHTEST, Material, Mesh, SHORTEST, SoftBody};
pub use contact::{Contact, ContactFinder, ContactQuery};
pub use external::{GoalSpring, Pin};
pub use frame::{BodySolver, FrameReport, Integrator, SolverFrame};
pub use plastic::{Plasticity, flow, reset, tear};
pub use state::State;

#[cfg(test)]
mod tests;
