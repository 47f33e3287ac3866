//! Linearisation of forces that grow steeply: those of contacts, regions and thin tetrahedra.
//!
//! Far into the steep part of such a force, each iteration of Newton's method would only undo a part of the excess. In a
//! descent each force is therefore linearised where it is what the last linear system predicted, if that is smaller
//! than what it is now. The residual is that of the current forces.

use super::contact::ContactState;
use super::stage::{BodySolver, Stage};
use numerics::vector::DVec3;

impl BodySolver {
    /// Linearises forces of contacts and thin tetrahedra at the predicted ones instead of the current ones, where they are
    /// smaller.
    pub(super) fn linearise_steep_forces(&mut self, stage: &Stage<'_>) {
        for (contact, state) in stage.contacts.iter().zip(&mut self.contact_states) {
            contact.linearise(state);
        }
        let Some(pressures) = self.predicted_pressures.as_ref().filter(|_| stage.line_search) else { return };
        for thin in &mut self.thin_tets {
            let known = pressures.binary_search_by_key(&thin.tet, |known| known.0);
            thin.linearise(known.map_or(0.0, |known| pressures[known].1));
        }
    }

    /// Forgets the predicted pressures, so that the next linear system is at the current ones.
    pub(super) fn forget_pressures(&mut self) {
        self.volumes.predicted.clear();
        self.predicted_pressures = None;
    }

    /// Whether the last linear system was not that of the current pressures.
    pub(super) fn used_predicted_pressures(&self) -> bool {
        self.thin_tets.iter().any(|thin| thin.offset != 0.0) || self.volumes.offsets.iter().any(|offset| *offset != 0.0)
    }

    /// Replaces forces in the residual by those that the linearisation uses: the right-hand side of the linear system.
    pub(super) fn use_linearised_forces(&mut self, stage: &Stage<'_>) {
        let (square, held) = (stage.a * stage.a, &self.system.held);
        let known = stage.contacts.iter().zip(&self.contact_states);
        for (contact, ContactState { offset: more, .. }) in known.filter(|known| known.1.offset != 0.0) {
            for (particle, weight) in contact.sides().filter(|side| !held[side.0]) {
                self.r[particle] += contact.normal * (more * weight * stage.a * stage.a);
            }
        }
        for thin in self.thin_tets.iter().filter(|thin| thin.offset != 0.0) {
            for (corner, gradient) in thin.corners.iter().zip(&thin.gradient).filter(|side| !held[*side.0 as usize]) {
                self.r[*corner as usize] += gradient * (thin.offset * square);
            }
        }
        let (volumes, regions) = (&self.volumes, &self.system.regions);
        if volumes.offsets.iter().any(|offset| *offset != 0.0) {
            let clusters = &stage.context.body.order.clusters;
            clusters.for_each(&mut self.r[..], |cluster, r: &mut [DVec3]| {
                for (particle, r) in clusters.range(cluster).zip(r).filter(|(particle, _)| !held[*particle]) {
                    *r -= regions.gather(particle, &volumes.offsets, &volumes.gradients) * square;
                }
            });
        }
    }
}
