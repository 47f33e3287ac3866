//! Implicit Euler with contacts: detect, solve, and repeat while contacts were missed.
//!
//! Friction is solved with given normal loads: first those of the last step, then those found by the descent, until
//! they agree (see [`super::friction`]). The result satisfies Coulomb's law for its own normal forces.

use super::contact::{Contact, ContactConstraint};
use super::finder::ContactQuery;
use super::heap::ContactScale;
use super::spacing;
use super::springs::distance;
use super::stage::{Solved, Stage};
use super::step::{Interval, Kinematics, StepEnd, Stepper, deepest, sum};
use numerics::vector::DVec3;
use std::collections::BTreeMap;
use std::ops::Range;

/// Rounds of contact detection in a step.
const MOST_ROUNDS: u32 = 4;
/// Largest initial displacement of a particle onto a surface, as a fraction of the mean spring length.
const MOST_NUDGE: f64 = 0.3;
/// Depth of a particle in an obstacle, relative to the size of the bodies, from which its whole piece is set on the surface.
const FAR: f64 = 1e6;

/// Where the descent of a step begins.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Guess {
    /// At predicted positions, on what they would pass.
    Predicted,
    /// Where the step starts, if it is out of balance by more than its contacts.
    Start,
    /// There, but pieces that nothing is near have moved on as wholes.
    MovedOn,
}

impl Stepper<'_> {
    /// Potential contacts of a step in which particles move to `to`, with their loads at the start.
    pub(super) fn contacts(&self, step: Interval<'_>, to: &[DVec3]) -> Vec<ContactConstraint> {
        let Interval { start, times, h } = step;
        let Some(contacts) = self.frame.contacts else { return Vec::new() };
        let body = self.context.body;
        let mut found: Vec<Contact> = Vec::new();
        let [from, to] = [&start.x, to].map(|x| body.contact_points(x));
        contacts.find(&ContactQuery { from: &from, to: &to, times }, &mut found);
        let scale = ContactScale {
            seconds: self.seconds,
            gravity: self.context.external.at(times[1]).gravity.norm().min(FAR * body.size / (h * h)),
            particle_stiffness: &self.solver.particle_stiffness,
            heaps: &self.solver.heaps,
        };
        let constraint = |contact: &Contact| {
            let known = ContactConstraint::new(body, contact, &scale)?;
            let displacement = spacing::least(body, &known) * h / self.seconds;
            Some(known.depenetrating(&start.x, h, displacement).with_load(&start.x, &start.loads, h))
        };
        let mut known: Vec<ContactConstraint> = found.iter().filter_map(constraint).collect();
        // Contacts of the same points share the last loads.
        let asked = self.loads(&known, |contact| contact.load);
        for contact in known.iter_mut().filter(|contact| contact.load > 0.0) {
            let shares = contact.points().map(|(point, _)| start.loads[point] / asked[point]);
            contact.load *= shares.fold(1.0, f64::min);
        }
        known
    }

    /// The sum over contacts of loads on each contact point.
    pub(super) fn loads(&self, contacts: &[ContactConstraint], of: impl Fn(&ContactConstraint) -> f64) -> Vec<f64> {
        let mut loads = vec![0.0; self.context.body.contact_point_count()];
        for contact in contacts {
            let load = of(contact);
            contact.points().for_each(|(point, weight)| loads[point] += weight.abs() * load);
        }
        loads
    }

    /// Detects contacts at `x`, and whether `known` lacks deep ones of them: contacts may push particles to surfaces
    /// that were far away, and surfaces bend.
    pub(super) fn find_missed(
        &self,
        known: &[ContactConstraint],
        step: Interval<'_>,
        x: &[DVec3],
    ) -> (Vec<ContactConstraint>, bool) {
        let deep = |contacts: &[ContactConstraint]| contacts.iter().filter(|contact| contact.is_too_deep(x)).count();
        let found = self.contacts(step, x);
        let missed = deep(&found) > deep(known);
        (found, missed)
    }

    /// A step of implicit Euler.
    pub(super) fn euler(&mut self, step: Interval<'_>, contacts: &mut Vec<ContactConstraint>, guess: Guess) -> StepEnd {
        let Interval { start, times, h } = step;
        let mut z = start.x.clone();
        let y = step.ahead();
        let mut x = match guess {
            Guess::Predicted => self.slid(&start.x, &y, contacts, h),
            Guess::Start => start.x.clone(),
            Guess::MovedOn => self.moved_on(start, contacts, h),
        };
        self.context.external.hold(times[1], &mut x, &mut z, h);
        let volumes = self.solver.volumes.at(self.context.body, &z);
        self.solver.set_step_start(&self.context, h, |first, second| distance(&z, first, second), volumes);
        let (mut solved, mut scale) = (Solved::default(), 0.0);
        self.solver.hurried = self.is_spent();
        let most_rounds = if self.solver.hurried { 1 } else { MOST_ROUNDS };
        for round in 1..=most_rounds {
            let stopped = self.stopped(&y, contacts, times[1], h);
            let mut stage = Stage::new(self.context, [&y, &z], h, times[1]);
            if let Some((y, gravity)) = &stopped {
                (stage.y, stage.now.gravity) = (y, *gravity);
            }
            if round == 1 || self.set_back(&start.x, contacts, &mut x) {
                scale = self.scale(&stage, &start.x, contacts, h);
                (solved.first, solved.enough) = (0.0, 0.0);
            }
            let again = self.solver.descend(&stage, contacts, scale, &solved, &mut x);
            solved = Solved { residual: again.residual, ..sum(solved, again) };
            let (mut found, missed) = self.find_missed(contacts, step, &x);
            // Contacts that were deep before are being separated.
            let sank = |c: &&ContactConstraint| c.is_too_deep(&x) && c.clearance(&x, 0.0) < c.clearance(&start.x, h);
            solved.unmet = found.iter().filter(sank).map(|c| -c.clearance(&x, 0.0)).fold(0.0, f64::max);
            solved.passed = found.iter().filter(sank).any(|c| -c.clearance(&x, 0.0) > c.of.gap);
            solved.deepest = deepest(&found, &x);
            if round == most_rounds || !missed {
                break;
            }
            take_loads(contacts, &mut found);
            found.retain(|contact| !contact.of_heap);
            found.extend(contacts.iter().filter(|contact| contact.of_heap));
            *contacts = found;
        }
        let v: Vec<DVec3> = x.iter().zip(&z).map(|(x, z)| (x - z) / h).collect();
        // First-order estimate: the change of velocity acts a whole step late.
        let errors = v.iter().zip(&start.v).map(|(v, before)| (v - before) * (0.5 * h)).collect();
        StepEnd { x, v, errors, solved }
    }

    /// Estimate of the squared residual of free motion from `x` to that of the stage plus gravity and obstacle motion in
    /// `h`.
    fn scale(&self, stage: &Stage<'_>, x: &[DVec3], contacts: &[ContactConstraint], h: f64) -> f64 {
        let y = stage.y;
        let mass = &self.context.body.mass;
        let falls = (stage.now.gravity * (h * h)).norm_squared();
        let own: f64 =
            (0..x.len()).map(|particle| mass[particle] * (falls + (y[particle] - x[particle]).norm_squared())).sum();
        let given = contacts.iter().flat_map(|contact| {
            let displacement = (contact.velocity * h).norm_squared();
            contact.sides().map(move |(particle, weight)| mass[particle] * weight * weight * displacement)
        });
        let scale = own + given.sum::<f64>();
        if scale > 0.0 { scale } else { f64::INFINITY }
    }

    /// The positions at the start of a step, from which pieces that nothing is near move on as wholes. Of their motion a descent
    /// from there starts with that of their deformation alone: it cannot end with more potential energy than both were.
    fn moved_on(&self, start: &Kinematics, contacts: &[ContactConstraint], h: f64) -> Vec<DVec3> {
        let body = self.context.body;
        let mut near = vec![false; body.order.pieces.len()];
        for (particle, _) in contacts.iter().flat_map(ContactConstraint::sides) {
            near[body.layout.piece_of(particle)] = true;
        }
        let mut x = start.x.clone();
        for (particles, _) in body.pieces().zip(near).filter(|(_, near)| !near) {
            if !particles.clone().any(|particle| self.solver.system.is_loose(particle)) {
                let by = body.mean_by_mass(particles.clone(), &start.v) * h;
                x[particles].iter_mut().for_each(|x| *x += by);
            }
        }
        x
    }

    /// The predicted positions `y`, moved so that contacts stay as deep as at `x` or just touch: friction acts on
    /// slip, so the initial guess should not contain normal motion. Pieces that an obstacle stops at once are set on it as a
    /// whole: the first directions would leave their particles thousands of sizes apart, from where no descent comes back.
    fn slid(&self, x: &[DVec3], y: &[DVec3], contacts: &[ContactConstraint], h: f64) -> Vec<DVec3> {
        let (mut out, held) = (y.to_vec(), &self.context.external.held);
        for contact in contacts.iter().filter(|contact| contact.is_of_one_point()) {
            let before = contact.clearance(x, h);
            let missing = before.min(0.0) - contact.clearance(&out, 0.0);
            if (missing > 0.0 || before < 0.0)
                && missing.abs() < MOST_NUDGE * spacing::least(self.context.body, contact)
            {
                contact.shift(missing, held, &mut out);
            }
        }
        for (piece, way) in self.far_below(contacts, &out, DVec3::zeros()) {
            let Some(way) = way else { continue };
            piece.filter(|particle| !held[*particle]).for_each(|particle| out[particle] += way);
        }
        out
    }

    /// The particles of each piece, and the way out of the obstacle in which it is deepest once moved from `x` on `by` that, if
    /// it is more than `FAR`.
    fn far_below(&self, contacts: &[ContactConstraint], x: &[DVec3], by: DVec3) -> Vec<(Range<usize>, Option<DVec3>)> {
        let body = self.context.body;
        let mut pieces: Vec<_> = body.pieces().map(|piece| (piece, None)).collect();
        for contact in contacts.iter().filter(|contact| !contact.is_two_sided()) {
            let depth = -contact.clearance(x, 0.0) - contact.normal.dot(&by);
            let (_, way) = &mut pieces[body.layout.piece_of(contact.particles[0] as usize)];
            if depth > FAR * body.size && way.is_none_or(|way: DVec3| depth > way.norm()) {
                *way = Some(contact.normal * depth);
            }
        }
        pieces
    }

    /// Sets pieces that fell more than `FAR` into an obstacle, which was not known yet, to where they `were`; returns whether
    /// there are any.
    fn set_back(&self, were: &[DVec3], contacts: &[ContactConstraint], x: &mut [DVec3]) -> bool {
        let mut far = self.far_below(contacts, x, DVec3::zeros());
        far.retain(|piece| piece.1.is_some());
        let any = !far.is_empty();
        for (piece, _) in far {
            for particle in piece.filter(|particle| !self.context.external.held[*particle]) {
                x[particle] = were[particle];
            }
        }
        any
    }

    /// The predicted positions `y` of a step of `h` that ends at `time`, and gravity in it, where these would take a piece to
    /// more than `FAR` in an obstacle: each of them is limited to that. The obstacle stops the piece all the same, and rounding of
    /// such distances is larger than bodies are.
    fn stopped(&self, y: &[DVec3], contacts: &[ContactConstraint], time: f64, h: f64) -> Option<(Vec<DVec3>, DVec3)> {
        let (most, gravity) = (FAR * self.context.body.size, self.context.external.at(time).gravity);
        let falls = gravity * (h * h);
        let [ways, stopped] = [DVec3::zeros(), falls].map(|by| self.far_below(contacts, y, by));
        if stopped.iter().all(|piece| piece.1.is_none()) {
            return None;
        }
        let (mut out, part) = (y.to_vec(), (most / falls.norm()).min(1.0));
        for ((piece, way), (_, stopped)) in ways.into_iter().zip(stopped) {
            let more = match stopped {
                None => falls * (1.0 - part),
                Some(_) => way.map_or(DVec3::zeros(), |way| way - way.normalize() * most),
            };
            out[piece].iter_mut().for_each(|out| *out += more);
        }
        Some((out, gravity * part))
    }
}

/// Transfers the loads of `known` contacts to newly detected ones of the same points with a similar normal.
fn take_loads(known: &[ContactConstraint], found: &mut [ContactConstraint]) {
    /// Cosine of the largest angle between similar normals.
    const SAME: f64 = 0.9;
    let mut by_points: BTreeMap<[u32; 4], Vec<&ContactConstraint>> = BTreeMap::new();
    known.iter().for_each(|contact| by_points.entry(contact.of.points).or_default().push(contact));
    for contact in found {
        let along = |other: &ContactConstraint| other.normal.dot(&contact.normal);
        let alike = by_points.get(&contact.of.points).into_iter().flatten();
        let nearest = alike.max_by(|a, b| along(a).total_cmp(&along(b)));
        contact.load = nearest.filter(|other| along(other) > SAME).map_or(0.0, |other| other.load);
    }
}
