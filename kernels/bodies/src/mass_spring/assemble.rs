//! Forces, residual and linear system of a stage at given positions.

use super::contact::{ContactConstraint, ContactMode, ContactState};
use super::springs::{self, Sums};
use super::stage::{BodySolver, FrameContext, Stage};
use super::system::{System, smoother, solve_lower};
use numerics::partition::{Partition, RaggedSlice};
use numerics::rank_one::{RankOneTerms, add_square};
use numerics::vector::DVec3;

/// Factor on the regions' contribution to a particle's own diagonal block. The block smoother then accounts for part
/// of the coupling within a region, which saves a tenth of the iterations.
const OVERLAP: f64 = 3.0;

impl BodySolver {
    /// The force on each particle at `x` and `v`.
    pub(super) fn forces(&mut self, stage: &Stage<'_>, x: &[DVec3], v: &[DVec3]) -> Vec<DVec3> {
        self.update_transient_forces(stage, x, v);
        self.sum_up(stage, [x, v], false);
        (0..x.len()).map(|particle| self.force(particle)).collect()
    }

    /// Evaluates volumes, thin tetrahedra and contacts at `x` and `v`, and the forces of the latter two.
    fn update_transient_forces(&mut self, stage: &Stage<'_>, x: &[DVec3], v: &[DVec3]) {
        let FrameContext { body, volumes, .. } = stage.context;
        if !std::mem::take(&mut self.measured) {
            self.volumes.measure(body, x);
        }
        self.thin_tets = self.volumes.thin_tets(body, x, volumes, &self.inventory.watched);
        self.contact_states.resize(stage.contacts.len(), ContactState::default());
        for (contact, state) in stage.contacts.iter().zip(&mut self.contact_states) {
            contact.update(state, [x, v], stage.early, body.size);
        }
        self.transient_forces.clear();
        if !self.thin_tets.is_empty() || !self.contact_states.is_empty() {
            self.transient_forces.resize(x.len(), DVec3::zeros());
            for thin in &self.thin_tets {
                for (corner, gradient) in thin.corners.iter().zip(&thin.gradient) {
                    self.transient_forces[*corner as usize] += gradient * thin.pressure;
                }
            }
            let known = stage.contacts.iter().zip(&self.contact_states);
            for (contact, state) in known.filter(|known| known.1.mode != ContactMode::Open) {
                contact.push(state.force, &mut self.transient_forces);
            }
        }
    }

    /// The force on a particle, of which what acts on it besides contacts and thin tetrahedra was just summed up.
    #[inline(always)]
    fn force(&self, particle: usize) -> DVec3 {
        let Sums { pull, others, .. } = self.system.sums[particle];
        pull + self.transient_forces.get(particle).map_or(others, |force| others + force)
    }

    /// Evaluates the residual at `x`, and if `linear` the linear system too.
    pub(super) fn assemble(&mut self, stage: &Stage<'_>, x: &[DVec3], linear: bool) {
        let (mut v, mut r) = (std::mem::take(&mut self.v), std::mem::take(&mut self.r));
        velocities(stage, x, &mut v);
        self.update_transient_forces(stage, x, &v);
        if linear {
            self.volumes.linearise();
            if !self.volumes.is_disabled() {
                let weights = self.volumes.weights(stage.a);
                self.system.regions.set(&weights, &self.volumes.gradients, &stage.context.body.order.clusters);
            }
            self.linearise_steep_forces(stage);
            self.set_rank_one_terms(stage);
        }
        self.sum_up(stage, [x, &v], linear);
        let (clusters, mut smoother) = (&stage.context.body.order.clusters, std::mem::take(&mut self.system.smoother));
        clusters.for_each((&mut r[..], &mut smoother[..]), |cluster, (r, smoother)| {
            for ((particle, r), smoother) in clusters.range(cluster).zip(r).zip(smoother) {
                *r = stage.residual(self.system.held[particle], particle, x, self.force(particle));
                if linear {
                    *smoother = self.smoother(particle);
                }
            }
        });
        self.system.smoother = smoother;
        (self.v, self.r) = (v, r);
    }

    /// As [`Self::assemble`] of the linear system, after one at the same `x` since which only contacts changed.
    pub(super) fn assemble_contacts(&mut self, stage: &Stage<'_>, x: &[DVec3]) {
        let v = std::mem::take(&mut self.v);
        self.measured = true;
        self.update_transient_forces(stage, x, &v);
        self.v = v;
        self.linearise_steep_forces(stage);
        self.complete_in_contact(stage, x);
    }

    /// Sets rank-one terms, and residual and smoother of the particles in them, after forces or linearisation of contacts
    /// changed.
    pub(super) fn complete_in_contact(&mut self, stage: &Stage<'_>, x: &[DVec3]) {
        self.set_rank_one_terms(stage);
        let of_contacts = stage.contacts.iter().flat_map(ContactConstraint::sides).map(|side| side.0);
        let of_tets = self.thin_tets.iter().flat_map(|thin| thin.corners).map(|corner| corner as usize);
        for particle in of_contacts.chain(of_tets) {
            self.r[particle] = stage.residual(self.system.held[particle], particle, x, self.force(particle));
            self.system.smoother[particle] = self.smoother(particle);
        }
    }

    /// Smoother of a particle, from what the system has of springs, regions and external forces, with contacts and thin
    /// tetrahedra.
    #[inline(always)]
    fn smoother(&self, particle: usize) -> [f32; 6] {
        let system = &self.system;
        if system.held[particle] {
            return [0.0; 6];
        }
        let mut block = system.sums[particle].block;
        system.transient.add_block(particle, 1.0, usize::MAX, &mut block);
        if let Some(other) = system.blocks.get(particle) {
            block.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
        }
        [0, 3, 5].iter().for_each(|diagonal| block[*diagonal] += system.inertia[particle]);
        smoother(&block)
    }

    /// Sums what acts on each particle at positions `x` with velocities `v` besides contacts and thin tetrahedra; if `linear`,
    /// in the linear system too.
    fn sum_up(&mut self, stage: &Stage<'_>, [x, v]: [&[DVec3]; 2], linear: bool) {
        let FrameContext { body, external, .. } = stage.context;
        let clusters = &body.order.clusters;
        let System { records, sums, inertia, regions, .. } = &mut self.system;
        let (links, volumes, regions) = (&self.links, &self.volumes, &*regions);
        let records = RaggedSlice::new(&body.adjacency.starts, records);
        clusters.for_each((&mut sums[..], &mut inertia[..], records), |cluster, (sums, inertia, records)| {
            let particles = clusters.range(cluster);
            springs::sum_up(&body.adjacency, links, records, x, stage.a, (particles.clone(), &mut *sums), linear);
            for ((particle, sums), inertia) in particles.zip(sums).zip(inertia) {
                let mass = body.mass[particle];
                let own = external.force(particle, mass, &stage.now, x[particle], v[particle]);
                sums.others = own - regions.gather(particle, &volumes.pressures, &volumes.gradients);
                if linear {
                    regions.add_block(particle, OVERLAP, usize::MAX, &mut sums.block);
                    *inertia = mass + external.inertia(particle, mass, &stage.now, stage.a);
                }
            }
        });
    }

    /// Sets up the rank-one terms of thin tetrahedra and contacts.
    fn set_rank_one_terms(&mut self, stage: &Stage<'_>) {
        let (body, a) = (stage.context.body, stage.a);
        let clusters = &body.order.clusters;
        self.system.blocks.clear();
        self.system.anchors = self.thin_tets.len();
        let (mut starts, mut particles, mut along) = (vec![0u32], Vec::new(), Vec::new());
        for thin in &self.thin_tets {
            let root = (a * a * thin.stiffness).sqrt();
            particles.extend(thin.corners);
            along.extend(thin.gradient.iter().map(|g| g * root));
            starts.push(particles.len() as u32);
        }
        let known = || stage.contacts.iter().zip(&self.contact_states);
        let grouped = [false, true].into_iter().flat_map(|two_sided| known().map(move |known| (two_sided, known)));
        for (two_sided, (contact, state)) in grouped {
            if state.mode == ContactMode::Open || contact.is_two_sided() != two_sided {
                continue;
            }
            let directions = contact.stiffness_directions(state, a);
            let mut sides = contact.sides();
            if let (Some((particle, weight)), None) = (sides.next(), sides.next()) {
                self.system.blocks.resize(body.len(), [0.0; 6]);
                let block = &mut self.system.blocks[particle];
                directions.for_each(|direction| add_square(block, direction, weight * weight));
                continue;
            }
            for direction in directions {
                for (particle, weight) in contact.sides() {
                    particles.push(particle as u32);
                    along.push(direction * weight);
                }
                starts.push(particles.len() as u32);
            }
            self.system.anchors = if two_sided { self.system.anchors } else { starts.len() - 1 };
        }
        let partition = Partition::even(starts.len() - 1, 512, 1);
        let transient: &mut RankOneTerms = &mut self.system.transient;
        transient.set_topology(body.len(), &starts, &particles, partition);
        transient.set(&vec![1.0; starts.len() - 1], &along, clusters);
    }

    /// The squared length of a residual, given for each particle, in the norm of the block-diagonal preconditioner.
    pub(super) fn squared_norm(&self, clusters: &Partition, r: impl Fn(usize) -> DVec3 + Sync) -> f64 {
        let of = |particle: usize| solve_lower(&self.system.smoother[particle], r(particle)).norm_squared();
        clusters.sum((), |cluster, ()| clusters.range(cluster).map(of).sum())
    }

    /// That of the last residual.
    pub(super) fn square(&self, stage: &Stage<'_>) -> f64 {
        self.squared_norm(&stage.context.body.order.clusters, |particle| self.r[particle])
    }
}

/// Velocities of the stage at `x`, (x − z)/a.
pub(super) fn velocities(stage: &Stage<'_>, x: &[DVec3], v: &mut Vec<DVec3>) {
    v.resize(x.len(), DVec3::zeros());
    let clusters = &stage.context.body.order.clusters;
    clusters.for_each(&mut v[..], |cluster, v: &mut [DVec3]| {
        for (particle, v) in clusters.range(cluster).zip(v) {
            *v = (x[particle] - stage.z[particle]) / stage.a;
        }
    });
}
