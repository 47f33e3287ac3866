//! What a body carries from one frame to the next.

use super::body::SoftBody;
use super::cholesky::Lower;
use super::coarse::Anchors;
use serde::{Deserialize, Serialize};

/// Everything the next frame hangs on: written and read back, the frames that follow have the same bits.
///
/// Particles by the caller's index; springs as in [`Body::springs`]; tetrahedra are those with a volume, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Metres.
    pub positions: Vec<[f64; 3]>,
    /// Metres a second.
    pub velocities: Vec<[f64; 3]>,
    /// Length each spring has at rest, dents left aside, metres.
    pub lengths: Vec<f64>,
    /// What dents scale it by.
    pub dents: Vec<f64>,
    /// Volume each tetrahedron has at rest, m³.
    pub volumes: Vec<f64>,
    /// Springs that are no more.
    pub torn: Vec<bool>,
    /// How velocities changed in the last step, m/s²: what the next first guess goes by; none at the start.
    pub(super) trend: Vec<[f64; 3]>,
    /// The push of an obstacle that each particle was under at last, newtons; none at the start.
    pub(super) loads: Vec<f64>,
    /// Steps for which contacts are taken to change.
    pub(super) euler_steps_left: u32,
    /// Energy that steps without drive have lost so far, joules.
    pub(super) energy_budget: f64,
    pub(super) warm: CachedFactor,
}

/// The coarse half of the preconditioner, kept while it is good enough: it is what the iterations hang on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct CachedFactor {
    pub(super) factor: Lower,
    pub(super) anchors: Anchors,
    /// Iterations to the tolerance when it was new, for each stage of a step; 0 before the first.
    pub(super) fresh: [u32; 2],
    /// Iterations since then.
    pub(super) spent: u32,
}

impl State {
    /// At rest in the shape of the body.
    pub fn at_rest(body: &SoftBody) -> Self {
        let positions = body.order.index_of.iter().map(|particle| body.rest[*particle as usize].into()).collect();
        Self {
            positions,
            velocities: vec![[0.0; 3]; body.len()],
            lengths: body.lengths.clone(),
            dents: vec![1.0; body.lengths.len()],
            volumes: body.volumes.clone(),
            torn: vec![false; body.lengths.len()],
            trend: Vec::new(),
            loads: Vec::new(),
            euler_steps_left: 0,
            energy_budget: 0.0,
            warm: CachedFactor::default(),
        }
    }

    /// Whether it has one entry for each of the body's particles, springs and tetrahedra.
    pub fn fits(&self, body: &SoftBody) -> bool {
        let springs = body.ends.len();
        self.positions.len() == body.len()
            && self.velocities.len() == body.len()
            && [self.lengths.len(), self.dents.len(), self.torn.len()] == [springs; 3]
            && self.volumes.len() == body.tets.len()
    }

    /// Length each spring has at rest now.
    pub(super) fn rest_lengths(&self) -> Vec<f64> {
        self.lengths.iter().zip(&self.dents).map(|(length, dent)| length * dent).collect()
    }
}
