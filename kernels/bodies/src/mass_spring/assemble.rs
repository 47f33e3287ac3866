//! Forces, residual and linear system of a stage at given positions.

use super::contact::{ContactConstraint, ContactMode, ContactState};
use super::springs::{self, Sums};
use super::stage::{BodySolver, FrameContext, Stage};
use super::system::{System, smoother, solve_lower};
use numerics::partition::{Partition, RaggedSlice};
use numerics::rank_one::{RankOneTerms, add_square};
use numerics::simd::Path;
use numerics::vector::DVec3;

/// Factor on the regions' contribution to a particle's own diagonal block. The block smoother then accounts for part
/// of the coupling within a region, which saves a tenth of the iterations.
const OVERLAP: f64 = 3.0;

impl BodySolver {
    /// The force on each particle at `x` and `v`.
    pub(super) fn forces(&mut self, stage: &Stage<'_>, x: &[DVec3], v: &[DVec3]) -> Vec<DVec3> {
        self.update_transient_forces(stage, x, v);
        let mut out = vec![DVec3::zeros(); x.len()];
        self.set_forces(stage, [x, v], &mut out, |_, force| force);
        out
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

    /// The forces on a particle besides those of springs, contacts and thin tetrahedra. `regions` are those of the system, which may have been moved out.
    #[inline(always)]
    fn own_force(&self, regions: &RankOneTerms, stage: &Stage<'_>, particle: usize, [x, v]: [&[DVec3]; 2]) -> DVec3 {
        let FrameContext { body, external, .. } = stage.context;
        let own = external.force(particle, body.mass[particle], &stage.now, x[particle], v[particle]);
        own - regions.gather(particle, &self.volumes.pressures, &self.volumes.gradients)
    }

    /// The `others` among the forces on a particle, with those of contacts and thin tetrahedra.
    #[inline(always)]
    fn with_transient_force(&self, particle: usize, others: DVec3) -> DVec3 {
        self.transient_forces.get(particle).map_or(others, |force| others + force)
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
            self.assemble_system(stage, [x, &v], &mut r);
        } else {
            self.set_forces(stage, [x, &v], &mut r, |particle, force| {
                stage.residual(self.system.held[particle], particle, x, force)
            });
        }
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
        let (mut r, mut smoother) = (std::mem::take(&mut self.r), std::mem::take(&mut self.system.smoother));
        let of_contacts = stage.contacts.iter().flat_map(ContactConstraint::sides).map(|side| side.0);
        let of_tets = self.thin_tets.iter().flat_map(|thin| thin.corners).map(|corner| corner as usize);
        for particle in of_contacts.chain(of_tets) {
            (r[particle], smoother[particle]) = self.complete(&self.system, stage, particle, x);
        }
        (self.r, self.system.smoother) = (r, smoother);
    }

    /// Residual and smoother of a particle at `x`, from what `system` has of springs, regions and external forces, with
    /// contacts and thin tetrahedra.
    #[inline(always)]
    fn complete(&self, system: &System, stage: &Stage<'_>, particle: usize, x: &[DVec3]) -> (DVec3, [f32; 6]) {
        let Sums { pull, others, mut block } = system.sums[particle];
        system.transient.add_block(particle, 1.0, usize::MAX, &mut block);
        if let Some(other) = system.blocks.get(particle) {
            block.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
        }
        [0, 3, 5].iter().for_each(|diagonal| block[*diagonal] += system.inertia[particle]);
        let held = system.held[particle];
        let force = pull + self.with_transient_force(particle, others);
        (stage.residual(held, particle, x, force), if held { [0.0; 6] } else { smoother(&block) })
    }

    /// Sets `out` to `of` of each particle and the force on it, at positions `x` with velocities `v`.
    fn set_forces(
        &self,
        stage: &Stage<'_>,
        [x, v]: [&[DVec3]; 2],
        out: &mut [DVec3],
        of: impl Fn(usize, DVec3) -> DVec3 + Sync,
    ) {
        let body = stage.context.body;
        body.order.clusters.for_each(out, |cluster, out: &mut [DVec3]| {
            let particles = body.order.clusters.range(cluster);
            let first = particles.start;
            out.fill(DVec3::zeros());
            for particle in particles {
                springs::pull(body.adjacency.of(particle, &self.links), x, particle, first, out);
                let out = &mut out[particle - first];
                let others = self.own_force(&self.system.regions, stage, particle, [x, v]);
                *out = of(particle, *out + self.with_transient_force(particle, others));
            }
        });
    }

    /// The residual `r` at positions `x` with velocities `v`, and the linear system there, whose rank-one terms and
    /// blocks are set already.
    fn assemble_system(&mut self, stage: &Stage<'_>, [x, v]: [&[DVec3]; 2], r: &mut [DVec3]) {
        let FrameContext { body, external, .. } = stage.context;
        let clusters = &body.order.clusters;
        let mut system = std::mem::take(&mut self.system);
        let regions = &system.regions;
        let records = RaggedSlice::new(&body.adjacency.starts, &mut system.records);
        let (sums, inertia) = (&mut system.sums[..], &mut system.inertia[..]);
        let solver = &*self;
        clusters.for_each((sums, inertia, records), |cluster, (sums, inertia, records)| {
            let particles = clusters.range(cluster);
            let path = Path::chosen();
            let springs = (&body.adjacency, &solver.links[..]);
            springs::linearise(path, springs, records, x, stage.a, particles.clone(), sums);
            for ((particle, sums), inertia) in particles.zip(sums).zip(inertia) {
                sums.others = solver.own_force(regions, stage, particle, [x, v]);
                regions.add_block(particle, OVERLAP, usize::MAX, &mut sums.block);
                let mass = body.mass[particle];
                *inertia = mass + external.inertia(particle, mass, &stage.now, stage.a);
            }
        });
        let mut smoother = std::mem::take(&mut system.smoother);
        clusters.for_each((r, &mut smoother[..]), |cluster, (r, smooth): (&mut [DVec3], &mut [[f32; 6]])| {
            for ((particle, r), smooth) in clusters.range(cluster).zip(r).zip(smooth) {
                (*r, *smooth) = solver.complete(&system, stage, particle, x);
            }
        });
        system.smoother = smoother;
        self.system = system;
    }

    /// Sets up the rank-one terms of thin tetrahedra and contacts.
    fn set_rank_one_terms(&mut self, stage: &Stage<'_>) {
        let (body, a) = (stage.context.body, stage.a);
        let clusters = &body.order.clusters;
        self.system.blocks.clear();
        self.system.in_contact.clear();
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
                self.system.in_contact.push(particle as u32);
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
        self.system.in_contact.sort_unstable();
        self.system.in_contact.dedup();
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
