//! Forces, residual and linear system of a stage at given positions.

use super::contact::ContactMode;
use super::springs::{self, Sums};
use super::stage::{FrameContext, Stage, StageSolver};
use super::system::{smoother, solve_lower};
use numerics::partition::{Partition, RaggedSlice};
use numerics::rank_one::{RankOneTerms, add_square};
use numerics::vector::DVec3;

/// Factor on the regions' contribution to a particle's own diagonal block. The block smoother then accounts for part
/// of the coupling within a region, which saves a tenth of the iterations.
const OVERLAP: f64 = 3.0;

impl StageSolver {
    /// The force on each particle at `x` and `v`.
    pub(super) fn forces(
        &mut self,
        context: &FrameContext<'_>,
        stage: &Stage<'_>,
        x: &[DVec3],
        v: &[DVec3],
    ) -> Vec<DVec3> {
        self.update_transient_forces(context, stage, x, v);
        let mut out = vec![DVec3::zeros(); x.len()];
        let (body, solver) = (context.body, &*self);
        body.order.clusters.for_each(&mut out[..], |cluster, out: &mut [DVec3]| {
            let particles = body.order.clusters.range(cluster);
            for particle in particles.clone() {
                springs::pull(body.adjacency.of(particle, &solver.links), x, particle, particles.start, out);
                out[particle - particles.start] += solver.own_force(context, stage.time, particle, x, v);
            }
        });
        out
    }

    /// Evaluates volumes, thin tetrahedra and contacts at `x` and `v`, and the forces of the latter two.
    fn update_transient_forces(&mut self, context: &FrameContext<'_>, stage: &Stage<'_>, x: &[DVec3], v: &[DVec3]) {
        let body = context.body;
        if !std::mem::take(&mut self.measured) {
            self.volumes.measure(body, x);
        }
        self.thin_tets = self.volumes.thin_tets(body, x, context.volumes, &self.inventory.watched);
        self.contact_states.clear();
        self.contact_states.extend(stage.contacts.iter().map(|contact| contact.at(x, v, stage.early, body.size)));
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

    /// All forces on a particle but those of its springs.
    #[inline(always)]
    fn own_force(&self, context: &FrameContext<'_>, time: f64, particle: usize, x: &[DVec3], v: &[DVec3]) -> DVec3 {
        let mut sum = context.external.force(particle, context.body.mass[particle], time, x[particle], v[particle]);
        if !self.system.regions.is_empty() {
            sum -= self.system.regions.gather(particle, &self.volumes.pressures, &self.volumes.gradients);
        }
        if let Some(transient_forces) = self.transient_forces.get(particle) {
            sum += transient_forces;
        }
        sum
    }

    /// Evaluates the residual at `x`, and if `linear` the linear system too.
    pub(super) fn assemble(&mut self, context: &FrameContext<'_>, stage: &Stage<'_>, x: &[DVec3], linear: bool) {
        let mut v = std::mem::take(&mut self.v);
        velocities(&context.body.order.clusters, x, stage, &mut v);
        self.update_transient_forces(context, stage, x, &v);
        let mut r = std::mem::take(&mut self.r);
        if linear {
            self.linearise_steep_forces(stage);
            self.set_rank_one_terms(context, stage);
            self.assemble_system(context, stage, [x, &v], &mut r);
        } else {
            self.assemble_residual(context, stage, [x, &v], &mut r);
        }
        self.r = r;
        self.v = v;
    }

    /// The residual `r` at positions `x` with velocities `v`.
    fn assemble_residual(&self, context: &FrameContext<'_>, stage: &Stage<'_>, [x, v]: [&[DVec3]; 2], r: &mut [DVec3]) {
        let (body, a) = (context.body, stage.a);
        let clusters = &body.order.clusters;
        clusters.for_each(r, |cluster, r: &mut [DVec3]| {
            let particles = clusters.range(cluster);
            r.fill(DVec3::zeros());
            for particle in particles.clone() {
                springs::pull(body.adjacency.of(particle, &self.links), x, particle, particles.start, r);
                let r = &mut r[particle - particles.start];
                *r = if self.system.held[particle] {
                    DVec3::zeros()
                } else {
                    let force = *r + self.own_force(context, stage.time, particle, x, v);
                    force * (a * a) - (x[particle] - stage.y[particle]) * body.mass[particle]
                };
            }
        });
    }

    /// The residual `r` at positions `x` with velocities `v`, and the linear system there, whose rank-one terms and
    /// blocks are set already.
    fn assemble_system(
        &mut self,
        context: &FrameContext<'_>,
        stage: &Stage<'_>,
        [x, v]: [&[DVec3]; 2],
        r: &mut [DVec3],
    ) {
        let (body, a) = (context.body, stage.a);
        let clusters = &body.order.clusters;
        let mut system = std::mem::take(&mut self.system);
        let (held, blocks, regions, transient) = (&system.held, &system.blocks, &system.regions, &system.transient);
        let per_particle = (
            r,
            &mut system.inertia[..],
            &mut system.smoother[..],
            RaggedSlice::new(&body.adjacency.starts, &mut system.records),
        );
        // `own_force` would read the regions from `self.system`, which has been moved out.
        let solver = &*self;
        clusters.for_each(per_particle, |cluster, (r, inertia, smooth, mut records)| {
            let particles = clusters.range(cluster);
            let first = particles.start;
            r.fill(DVec3::zeros());
            let mut sums = Sums { forces: r, blocks: &mut vec![[0.0; 6]; particles.len()] };
            for (((particle, inertia), smooth), records) in particles.zip(inertia).zip(smooth).zip(records.iter_mut()) {
                let links = body.adjacency.of(particle, &solver.links);
                springs::linearise(links, records, x, a, particle, first, &mut sums);
                let (pull, mut block) = (sums.forces[particle - first], sums.blocks[particle - first]);
                let mass = body.mass[particle];
                let mut own = context.external.force(particle, mass, stage.time, x[particle], v[particle]);
                if !regions.is_empty() {
                    own -= regions.gather(particle, &solver.volumes.pressures, &solver.volumes.gradients);
                    regions.add_block(particle, OVERLAP, usize::MAX, &mut block);
                }
                own += solver.transient_forces.get(particle).copied().unwrap_or_default();
                if !transient.is_empty() {
                    transient.add_block(particle, 1.0, usize::MAX, &mut block);
                }
                if let Some(other) = blocks.get(particle) {
                    block.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
                }
                *inertia = mass + context.external.inertia(particle, mass, a);
                [0, 3, 5].iter().for_each(|diagonal| block[*diagonal] += *inertia);
                sums.forces[particle - first] = if held[particle] {
                    DVec3::zeros()
                } else {
                    (own + pull) * (a * a) - (x[particle] - stage.y[particle]) * mass
                };
                *smooth = if held[particle] { [0.0; 6] } else { smoother(&block) };
            }
        });
        self.system = system;
    }

    /// Sets up the rank-one terms of volumes, thin tetrahedra and contacts.
    fn set_rank_one_terms(&mut self, context: &FrameContext<'_>, stage: &Stage<'_>) {
        let (body, a) = (context.body, stage.a);
        let clusters = &body.order.clusters;
        if !self.volumes.is_disabled() {
            let weights = self.volumes.weights(a);
            self.system.regions.set(&weights, &self.volumes.gradients, clusters);
        }
        self.system.blocks.clear();
        self.system.anchors = self.thin_tets.len();
        let (mut starts, mut particles, mut along) = (vec![0u32], Vec::new(), Vec::new());
        for thin in &self.thin_tets {
            let root = (a * a * thin.stiffness).sqrt();
            particles.extend(thin.corners);
            along.extend(thin.gradient.iter().map(|g| g * root));
            starts.push(particles.len() as u32);
        }
        let known = || stage.contacts.iter().zip(&self.contact_states).zip(&self.friction_duals);
        let grouped = [false, true].into_iter().flat_map(|two_sided| known().map(move |known| (two_sided, known)));
        for (two_sided, ((contact, state), dual)) in grouped {
            if state.mode == ContactMode::Open || contact.is_two_sided() != two_sided {
                continue;
            }
            let (directions, count) = contact.stiffness_directions(state, a, dual);
            let mut sides = contact.sides();
            if let (Some((particle, weight)), None) = (sides.next(), sides.next()) {
                self.system.blocks.resize(body.len(), [0.0; 6]);
                let block = &mut self.system.blocks[particle];
                directions[..count].iter().for_each(|direction| add_square(block, *direction, weight * weight));
                continue;
            }
            for direction in &directions[..count] {
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

    /// The squared residual in the norm of the block-diagonal preconditioner.
    pub(super) fn square(&self, clusters: &Partition) -> f64 {
        clusters.sum((), |cluster, ()| {
            let particles = clusters.range(cluster);
            particles
                .map(|particle| solve_lower(&self.system.smoother[particle], self.r[particle]).norm_squared())
                .sum()
        })
    }

    /// The squared distance of the residual from `other`, in the same norm.
    pub(super) fn distance(&self, clusters: &Partition, other: &[DVec3]) -> f64 {
        let own = |particle: usize| {
            solve_lower(&self.system.smoother[particle], self.r[particle] - other[particle]).norm_squared()
        };
        clusters.sum((), |cluster, ()| clusters.range(cluster).map(own).sum())
    }
}

/// Velocities of the stage, (x − z)/a.
pub(super) fn velocities(clusters: &Partition, x: &[DVec3], stage: &Stage<'_>, v: &mut Vec<DVec3>) {
    v.resize(x.len(), DVec3::zeros());
    clusters.for_each(&mut v[..], |cluster, v: &mut [DVec3]| {
        for (particle, v) in clusters.range(cluster).zip(v) {
            *v = (x[particle] - stage.z[particle]) / stage.a;
        }
    });
}
