//! Mass-spring bodies on tetrahedral meshes, integrated implicitly (paper R1).
//!
//! Particles are joined by springs with dashpots ([`SoftBody`]); pressures preserve volume; gravity, goals, pins and
//! contacts act on particles. By default a frame is one step of TR-BDF2 with one Newton iteration for each of its two
//! stages. The linear systems are solved matrix-free by conjugate gradients with a two-level preconditioner.
//!
//! Inside the solver a *particle* is an index in the solver's own order (see [`numerics::cluster_order`]); *the caller's indices*
//! are those of the input. A *piece* is a connected component of the spring graph, a *cluster* a compact
//! part of a piece.
//!
//! Guarantees: bounded for any stiffness, mass and step size, also from inverted or crumpled states; second order in
//! time where the motion is smooth; linear momentum conserved to rounding; hard pins exact; no energy gain without
//! external driving; the same bits for any number of threads and SIMD path, and after a state was saved and restored.
//! Limits: oscillations faster than a step can resolve are damped; angular momentum is conserved to the order of the
//! method; spring stiffnesses are stored in f32, so forces are accurate to 1e-7 of the stiffest spring at a particle.
//! Everything else is f64, in metres, seconds, kilograms.

mod assemble;
mod balance;
mod body;
mod bounce;
mod closing;
mod coarse;
mod conjugate_gradients;
mod contact;
mod energy;
mod euler;
mod evenness;
mod external;
mod finder;
mod frame;
mod friction;
mod galerkin;
mod heap;
mod momentum;
mod plastic;
mod predictor;
mod regions;
mod search;
mod sides;
mod spacing;
mod springs;
mod stage;
mod state;
mod steep;
mod step;
mod system;
mod tet_springs;
mod tr_bdf2;
mod volume;

pub use body::{BodyError, BodySpring, LIGHTEST, Material, Mesh, SHORTEST, SoftBody};
pub use contact::Contact;
pub(crate) use contact::Weighted;
pub use evenness::DirectionalModulus;
pub use external::{Ambient, GoalSpring, Pin};
pub use finder::{ContactFinder, ContactQuery};
pub use frame::{FrameReport, Integrator, SolverFrame};
pub use plastic::{Plasticity, flow, reset, tear};
pub use stage::BodySolver;
pub use state::State;

#[cfg(test)]
mod tests;
