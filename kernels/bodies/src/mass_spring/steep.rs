//! Linearisation of forces that grow steeply: those of contacts, regions and thin tetrahedra.
//!
//! Far into the steep part of such a force, each iteration of Newton's method would only undo a part of the excess. In a
//! descent each force is therefore linearised where it is what the last linear system predicted, if that is smaller
//! than what it is now. The residual is that of the current forces.

use super::stage::{Stage, StageSolver};

impl StageSolver {
    /// Linearises contact forces and pressures at the predicted ones instead of the current ones, where they are smaller.
    pub(super) fn linearise_steep_forces(&mut self, stage: &Stage<'_>) {
        self.contact_offsets.clear();
        self.thin_offsets.clear();
        for (index, ((contact, state), push)) in
            stage.contacts.iter().zip(&mut self.contact_states).zip(&self.predicted_loads).enumerate()
        {
            let before = state.normal_force;
            contact.linearise_at(state, *push);
            if state.normal_force != before {
                self.contact_offsets.push((index, state.normal_force - before));
            }
        }
        if !stage.line_search {
            return;
        }
        self.volumes.linearise();
        let Some(pressures) = &self.predicted_pressures else { return };
        for (index, thin) in self.thin_tets.iter_mut().enumerate() {
            let known = pressures.binary_search_by_key(&thin.tet, |known| known.0);
            let offset = thin.linearise(known.map_or(0.0, |known| pressures[known].1));
            if offset != 0.0 {
                self.thin_offsets.push((index, offset));
            }
        }
    }

    /// Forgets the predicted pressures, so that the next linear system is at the current ones.
    pub(super) fn forget_pressures(&mut self) {
        self.volumes.forget();
        self.predicted_pressures = None;
    }

    /// Whether the last linear system was not that of the current pressures.
    pub(super) fn used_predicted_pressures(&self) -> bool {
        !self.thin_offsets.is_empty() || self.volumes.offsets.iter().any(|offset| *offset != 0.0)
    }

    /// Replaces forces in the residual by those that the linearisation uses: the right-hand side of the linear system.
    pub(super) fn use_linearised_forces(&mut self, stage: &Stage<'_>) {
        let (square, held) = (stage.a * stage.a, &self.system.held);
        for (index, more) in &self.contact_offsets {
            let contact = &stage.contacts[*index];
            for (particle, weight) in contact.sides().filter(|side| !held[side.0]) {
                self.r[particle] += contact.normal * (more * weight * stage.a * stage.a);
            }
        }
        for (index, more) in &self.thin_offsets {
            let thin = &self.thin_tets[*index];
            for (corner, gradient) in thin.corners.iter().zip(&thin.gradient).filter(|side| !held[*side.0 as usize]) {
                self.r[*corner as usize] += gradient * (more * square);
            }
        }
        let (volumes, regions) = (&self.volumes, &self.system.regions);
        if volumes.offsets.iter().any(|offset| *offset != 0.0) {
            for (particle, r) in self.r.iter_mut().enumerate().filter(|(particle, _)| !held[*particle]) {
                *r -= regions.gather(particle, &volumes.offsets, &volumes.gradients) * square;
            }
        }
    }
}
