//! The state of a body between frames.

use super::body::SoftBody;
use super::bounce::Impact;
use super::coarse::ContactFilters;
use numerics::cholesky::EnvelopeMatrix;
use serde::{Deserialize, Serialize};

/// Everything that later frames depend on: after saving and restoring it they have the same bits.
///
/// Particles by the caller's indices; springs as in [`SoftBody::springs`]; tetrahedra are those with a volume, in
/// order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Positions of particles, metres.
    pub positions: Vec<[f64; 3]>,
    /// Velocities of particles, m/s.
    pub velocities: Vec<[f64; 3]>,
    /// Rest length of each spring without plastic flow, metres.
    pub lengths: Vec<f64>,
    /// Plastic factor on that length.
    pub dents: Vec<f64>,
    /// Rest volume of each tetrahedron, m³.
    pub volumes: Vec<f64>,
    /// Torn springs.
    pub torn: Vec<bool>,
    /// Acceleration in the last step, m/s², for the predictor; empty at the start.
    pub(super) acceleration: Vec<[f64; 3]>,
    /// The last normal force of contacts on each contact point, newtons; empty at the start.
    pub(super) loads: Vec<f64>,
    pub(super) carried: Carried,
    pub(super) cached: CachedCoarseFactor,
}

/// What steps carry over besides the motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Carried {
    /// Number of steps still to be taken with implicit Euler.
    pub(super) euler_steps_left: u32,
    /// Energy that steps without external driving have dissipated so far, and that rounding in later ones may return, joules.
    pub(super) energy_budget: f64,
    /// Pieces in contact, if bounces are limited.
    pub(super) impacts: Vec<Impact>,
}

/// The factored coarse matrix, kept while it is good enough; iteration counts depend on it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct CachedCoarseFactor {
    pub(super) factor: EnvelopeMatrix,
    pub(super) filters: ContactFilters,
    /// Iterations of a solve when it was new, for each stage of a step; 0 before the first.
    pub(super) initial_iterations: [u32; 2],
    /// Iterations since then.
    pub(super) iterations_since: u32,
}

impl State {
    /// At rest in the body's rest shape.
    pub fn at_rest(body: &SoftBody) -> Self {
        let positions = body.order.index_of.iter().map(|particle| body.rest[*particle as usize].into()).collect();
        Self {
            positions,
            velocities: vec![[0.0; 3]; body.len()],
            lengths: body.lengths.clone(),
            dents: vec![1.0; body.lengths.len()],
            volumes: body.volumes.clone(),
            torn: vec![false; body.lengths.len()],
            acceleration: Vec::new(),
            loads: Vec::new(),
            carried: Carried::default(),
            cached: CachedCoarseFactor::default(),
        }
    }

    /// Whether it has an entry for each particle, spring and tetrahedron of `body`.
    pub fn fits(&self, body: &SoftBody) -> bool {
        let springs = body.ends.len();
        self.positions.len() == body.len()
            && self.velocities.len() == body.len()
            && [self.lengths.len(), self.dents.len(), self.torn.len()] == [springs; 3]
            && self.volumes.len() == body.tets.len()
    }

    /// Current rest length of each spring.
    pub(super) fn rest_lengths(&self) -> Vec<f64> {
        self.lengths.iter().zip(&self.dents).map(|(length, dent)| length * dent).collect()
    }
}
