//! Bodies far too soft to carry their weight: they lie in heaps.
//!
//! The skin of a heap is crushed into more contacts with itself than can be met. Repeated detection and shorter steps would
//! only press more of it into each other and throw what they meet apart: 700 Newton iterations a frame for particles that flew
//! metres high and deep. Contacts of a heap with skin are therefore those that are first detected in a step, and their depth
//! is accepted. Those with the ground and obstacles are met as always, in at most four rounds of 60 iterations a step. Nor are steps cut for
//! the errors of heaps: with a tolerance a frame of 340 particles took 4,200 iterations in 200 steps.

use super::body::SoftBody;
use numerics::vector::DVec3;

/// E ÷ (ρgh) below which a body is a heap. Tetrahedra turn inside out from a twentieth on.
const HEAP: f64 = 0.01;
/// Resistance by weight ÷ (weight ÷ gap): contacts, thirty times as stiff, bear a column of 57 particles where their force
/// becomes linear.
const BORNE: f64 = 0.1;

/// What the stiffness of contacts is measured by in a frame.
pub(super) struct ContactScale<'a> {
    /// Length of the frame.
    pub(super) seconds: f64,
    /// Acceleration by gravity, m/s².
    pub(super) gravity: f64,
    /// Sum of spring stiffnesses at each particle, N/m.
    pub(super) particle_stiffness: &'a [f64],
    /// Whether each particle is of a heap.
    pub(super) heaps: &'a [bool],
}

impl ContactScale<'_> {
    /// Resistance of a particle to a contact that keeps the distance `gap`, metres, N/m: by its inertia, or by its weight if
    /// that needs more to be borne within the gap, and by springs. Between bodies weight does not count: crushed skin would be
    /// thrown apart.
    pub(super) fn resistance(&self, body: &SoftBody, particle: usize, gap: f64, two_sided: bool) -> f64 {
        let weight = if two_sided || gap <= 0.0 { 0.0 } else { BORNE * self.gravity / gap };
        let mass = body.mass[particle];
        (4.0 * mass / (self.seconds * self.seconds)).max(weight * mass) + self.particle_stiffness[particle] / 3.0
    }
}

/// Whether each particle is of a heap under `gravity`, m/s²; empty if none is.
pub(super) fn heaps(body: &SoftBody, gravity: DVec3) -> Vec<bool> {
    let mut heaps = Vec::new();
    for (piece, ratio) in body.pieces().zip(body.stiffness_to_weights(gravity)) {
        if ratio < HEAP {
            heaps.resize(body.len(), false);
            heaps[piece].fill(true);
        }
    }
    heaps
}
