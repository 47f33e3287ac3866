//! The energies of a body, and its worst spring: what a frame reports and what its steps are watched by.

use super::springs;
use super::stage::{Setting, Work};
use super::step::Moving;
use numerics::vector::DVec3;

/// Joules.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Energies {
    pub(super) kinetic: f64,
    pub(super) springs: f64,
    /// Regions and tetrahedra about to turn over.
    pub(super) volumes: f64,
    pub(super) goals: f64,
    /// Against gravity, from the origin.
    pub(super) height: f64,
}

impl Energies {
    /// All that a body without drive may not gain.
    pub(super) fn sum(&self) -> f64 {
        self.kinetic + self.springs + self.volumes + self.goals + self.height
    }

    /// What it is small against: without the part whose zero is arbitrary.
    pub(super) fn scale(&self) -> f64 {
        self.kinetic + self.springs + self.volumes + self.goals
    }
}

/// At `time`, a share of the frame; `looked` where volumes were last measured there.
pub(super) fn measure(work: &mut Work, on: &Setting<'_>, time: f64, moving: &Moving, looked: bool) -> Energies {
    let (body, x, v) = (on.body, &moving.x, &moving.v);
    if !looked {
        work.volumes.measure(body, x);
    }
    let watched = &work.inventory.watched;
    let thin: f64 = work.volumes.thin(body, x, on.volumes, watched).iter().map(|thin| thin.energy).sum();
    let stored = work.volumes.stored;
    let springs = body
        .spring_parts
        .sum((), |part, ()| body.spring_parts.range(part).map(|at| springs::energy(body, &on.rest, x, at)).sum());
    let clusters = &body.order.clusters;
    let own = clusters.map((), |cluster, ()| {
        clusters.range(cluster).fold([0.0; 3], |[kinetic, goals, height], place| {
            let mass = body.mass[place];
            [
                kinetic + 0.5 * mass * v[place].norm_squared(),
                goals + mass * on.drive.goal_energy(place, time, x[place]),
                height - mass * on.drive.gravity.dot(&x[place]),
            ]
        })
    });
    let [kinetic, goals, height] =
        own.into_iter().fold([0.0; 3], |sum, part| [sum[0] + part[0], sum[1] + part[1], sum[2] + part[2]]);
    Energies { kinetic, springs, volumes: stored + thin, goals, height }
}

/// The largest length ÷ length at rest of a spring, or its reciprocal; of springs that have a length at rest.
pub(super) fn worst_stretch(on: &Setting<'_>, x: &[DVec3]) -> f64 {
    let body = on.body;
    let worst = body.spring_parts.map((), |part, ()| {
        let springs =
            body.spring_parts.range(part).filter(|at| on.rest.holds(*at as u32) && on.rest.lengths[*at] > 0.0);
        let stretch = springs.map(|at| springs::spring_length(body, x, at) / on.rest.lengths[at]);
        stretch.map(|stretch| stretch.max(1.0 / stretch)).fold(1.0, f64::max)
    });
    worst.into_iter().fold(1.0, f64::max)
}
