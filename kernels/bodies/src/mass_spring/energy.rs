//! Energies of a body, for reports and step control.

use super::springs;
use super::stage::{BodySolver, FrameContext};
use numerics::vector::{DVec2, DVec3};

/// Energies, joules.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Energies {
    pub(super) kinetic: f64,
    pub(super) springs: f64,
    /// In regions and inverted or thin tetrahedra.
    pub(super) volumes: f64,
    pub(super) goals: f64,
    /// Potential energy of gravity relative to the origin.
    pub(super) height: f64,
    /// Σ c·(change of length since the start of the step)² over the dashpots of springs, J·s: divided by the length of
    /// the step, the least energy that they may have taken.
    pub(super) dashed: f64,
}

impl Energies {
    /// The total, which must not grow without external driving.
    pub(super) fn sum(&self) -> f64 {
        self.kinetic + self.springs + self.volumes + self.goals + self.height
    }

    /// The scale of energy changes: the total without gravity, whose zero is arbitrary.
    pub(super) fn scale(&self) -> f64 {
        self.kinetic + self.springs + self.volumes + self.goals
    }
}

/// Measures the energies at `time`, a fraction of the frame; `looked` if volumes were last measured at these
/// positions.
pub(super) fn measure(
    solver: &mut BodySolver,
    context: &FrameContext<'_>,
    time: f64,
    [x, v]: [&[DVec3]; 2],
    looked: bool,
) -> Energies {
    let body = context.body;
    if !looked {
        solver.volumes.measure(body, x);
    }
    let [stored, thin] = solver.volumes.energy(context, x, &solver.inventory.watched);
    let (rest, before, now) = (&context.rest, &solver.lengths, &mut solver.lengths_now);
    now.resize(body.ends.len(), 0.0);
    let springs = body.spring_partition.sum(&mut now[..], |part, now: &mut [f64]| {
        let range = body.spring_partition.range(part);
        range.zip(now).filter(|(at, _)| rest.is_intact(*at as u32)).fold(DVec2::zeros(), |sum, (at, now)| {
            *now = springs::spring_length(body, x, at);
            let change = *now - before.get(at).copied().unwrap_or(*now);
            sum + DVec2::new(springs::stored(body, rest, at, *now), body.damping[at] * change * change)
        })
    });
    let clusters = &body.order.clusters;
    let gravity = context.external.at(time).gravity;
    let own = clusters.sum((), |cluster, ()| {
        clusters.range(cluster).fold(DVec3::zeros(), |sum, particle| {
            let mass = body.mass[particle];
            let goals = mass * context.external.goal_energy(particle, time, x[particle]);
            let height = -(mass * gravity.dot(&x[particle]));
            sum + DVec3::new(0.5 * mass * v[particle].norm_squared(), goals, height)
        })
    });
    let ([springs, dashed], [kinetic, goals, height]): ([f64; 2], [f64; 3]) = (springs.into(), own.into());
    Energies { kinetic, springs, volumes: stored + thin, goals, height, dashed }
}
