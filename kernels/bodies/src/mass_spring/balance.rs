//! Where the energy of a step goes: what damping takes, what drives the body, and what time stepping loses.
//!
//! Work is force × displacement with the forces at the end of the step, so that for implicit Euler the balance has no
//! error of its own.

use super::contact::{ContactConstraint, ContactMode};
use super::energy::Energies;
use super::springs;
use super::stage::Stage;
use super::step::{Interval, Kinematics, Stepper};
use numerics::vector::DVec3;
use std::ops::Range;

/// A step that was taken.
#[derive(Clone, Copy)]
pub(super) struct TakenStep<'a> {
    pub(super) interval: Interval<'a>,
    pub(super) end: &'a Kinematics,
    pub(super) contacts: &'a [ContactConstraint],
}

impl Stepper<'_> {
    /// Energy that a step loses without damping, drag or friction, joules: through time stepping, through contacts,
    /// which should store energy and give it back, and through limits on it. `energies` are those at both ends.
    pub(super) fn energy_lost(&mut self, [before, after]: [&Energies; 2], taken: TakenStep<'_>) -> f64 {
        let TakenStep { interval: Interval { start, times, h }, end, contacts } = taken;
        let (body, external) = (self.context.body, self.context.external);
        let moved = |particle: usize| end.x[particle] - start.x[particle];
        let clusters = &body.order.clusters;
        let [then, now] = times.map(|time| external.at(time));
        let given: f64 = clusters.sum((), |cluster, ()| {
            let of = |particle: usize| {
                let ends = ([&then, &now], h);
                external.work(particle, body.mass[particle], ends, end.x[particle], moved(particle))
            };
            clusters.range(cluster).map(of).sum()
        });
        let by_contacts = contacts.iter().zip(&self.solver.contact_states).map(|(contact, state)| {
            if state.mode == ContactMode::Open {
                return 0.0;
            }
            // Of the normal force, only what moves the obstacle.
            let normal = contact.normal * contact.normal.dot(&state.force);
            let displacement: DVec3 = contact.sides().map(|(particle, weight)| moved(particle) * weight).sum();
            (state.force - normal).dot(&displacement) + normal.dot(&contact.velocity) * h
        });
        let by_contacts = by_contacts.sum::<f64>() + self.work_of_missing_forces(taken);
        let damped = after.dashed / h + self.solver.volumes.dissipated(h);
        let pins: Vec<usize> = external.moving_pins().collect();
        let mut by_pins = 0.0;
        if !pins.is_empty() {
            let stage = Stage { contacts, ..Stage::new(self.context, [&[], &[]], h, times[1]) };
            let force = self.solver.forces(&stage, &end.x, &end.v);
            let reaction = |pin: usize| (end.v[pin] - start.v[pin]) * (body.mass[pin] / h) - force[pin];
            by_pins = pins.into_iter().map(|pin| reaction(pin).dot(&moved(pin))).sum();
        }
        let lost = before.sum() - after.sum() + given + by_contacts + by_pins - damped;
        if lost.is_finite() { lost } else { 0.0 }
    }

    /// Work of moving obstacles by what contact forces at the end of a step lack of those that
    /// changed the momentum of each piece, joules.
    fn work_of_missing_forces(&self, taken: TakenStep<'_>) -> f64 {
        let TakenStep { interval: Interval { start, times, h }, end, contacts } = taken;
        let (body, external) = (self.context.body, self.context.external);
        // For each piece its missing force, and velocities of obstacles with the sum of their weights.
        let mut pieces = vec![(DVec3::zeros(), DVec3::zeros(), 0.0); body.order.pieces.len()];
        for (contact, state) in contacts.iter().zip(&self.solver.contact_states) {
            if state.mode == ContactMode::Open {
                continue;
            }
            for (particle, weight) in contact.sides() {
                let (missing, velocity, sum) = &mut pieces[body.layout.piece_of(particle)];
                *missing -= state.force * weight;
                if !contact.is_two_sided() {
                    *velocity += contact.velocity * (state.normal_force * weight);
                    *sum += state.normal_force * weight;
                }
            }
        }
        let (mut work, now) = (0.0, external.at(times[1]));
        for (particles, (mut missing, velocity, sum)) in body.pieces().zip(pieces) {
            if velocity == DVec3::zeros() || external.held[particles.clone()].contains(&true) {
                continue;
            }
            for particle in particles {
                let mass = body.mass[particle];
                missing += (end.v[particle] - start.v[particle]) * (mass / h);
                missing -= external.force(particle, mass, &now, end.x[particle], end.v[particle]);
            }
            work += missing.dot(&velocity) * (h / sum);
        }
        work
    }

    /// The largest error of the speed of a piece in contact by a step, a root mean square over its particles, relative to
    /// the speed that it would have if all its energy, with what its dashpots took, were kinetic. `errors` are those of
    /// positions. What is pinned does not bounce.
    pub(super) fn impact_error(&self, taken: TakenStep<'_>, errors: &[DVec3]) -> f64 {
        /// Speeds below what gravity gives in this many frames are not resolved: what rests, or is rolled, does not bounce.
        const SLOW: f64 = 3.0;
        let TakenStep { interval: Interval { start, h, .. }, end, contacts } = taken;
        let body = self.context.body;
        // The squared speed of what each piece touches.
        let mut touched = vec![-1.0; body.order.pieces.len()];
        for contact in contacts.iter().filter(|c| c.clearance(&start.x, h).min(c.clearance(&end.x, 0.0)) < 0.0) {
            for (particle, _) in contact.sides() {
                let piece = body.layout.piece_of(particle);
                touched[piece] = contact.velocity.norm_squared().max(touched[piece]);
            }
        }
        if touched.iter().all(|speed| *speed < 0.0) {
            return 0.0;
        }
        // Of each piece, twice the elastic energy at both ends, and what dashpots take.
        let mut energy = vec![[0.0; 3]; touched.len()];
        for (at, [a, _]) in body.ends.iter().enumerate().filter(|(at, _)| self.context.rest.is_intact(*at as u32)) {
            let [then, now] = [&self.solver.lengths, &self.solver.lengths_now].map(|lengths| lengths[at]);
            let stored = |length| springs::stored(body, &self.context.rest, at, length);
            let sums = &mut energy[body.layout.piece_of(*a as usize)];
            (sums[0], sums[1]) = (sums[0] + 2.0 * stored(then), sums[1] + 2.0 * stored(now));
            sums[2] += 2.0 * body.damping[at] * (now - then) * (now - then) / h;
        }
        let slow = SLOW * DVec3::from(self.frame.gravity).norm() * self.seconds;
        let of_piece = |(index, particles): (usize, Range<usize>)| {
            let [mut before, mut after, damped] = energy[index];
            let (mut mass, mut wrong) = (0.0, 0.0);
            for particle in particles {
                mass += body.mass[particle];
                before += body.mass[particle] * start.v[particle].norm_squared();
                after += body.mass[particle] * end.v[particle].norm_squared();
                wrong += body.mass[particle] * errors[particle].norm_squared();
            }
            let scale = (before.max(after) + damped) / mass + touched[index] + slow * slow;
            let wrong = 4.0 * wrong / (mass * h * h);
            if wrong > 0.0 { (wrong / scale).sqrt() } else { 0.0 }
        };
        let is_held = |piece: &Range<usize>| self.context.external.held[piece.clone()].contains(&true);
        let is_heap = |piece: &Range<usize>| self.solver.heaps.get(piece.start) == Some(&true);
        let pieces = body.pieces().enumerate();
        let free = pieces.filter(|(index, piece)| touched[*index] >= 0.0 && !is_held(piece) && !is_heap(piece));
        free.map(of_piece).fold(0.0, f64::max)
    }
}
