//! Implicit Euler with contacts: finds them, solves, looks whether others came, what got thin and what friction there is, and
//! goes on.
//!
//! Friction is solved with pushes that are given: those the particles were under at last, then those found on the way down,
//! until they are about the same. So each step has an objective, and what comes out has Coulomb's friction of its own pushes.

use super::contact::{Contact, ContactConstraint, ContactQuery};
use super::search::{StopCriteria, reload};
use super::springs::distance;
use super::stage::{Solved, Stage};
use super::step::{Kinematics, Stepper, deepest, sum};
use numerics::vector::DVec3;
use std::cell::OnceCell;

/// Times that implicit Euler looks for contacts it has missed.
const ROUNDS: u32 = 4;
/// Share of the mean spring that a first guess may move a particle to a surface.
const NUDGE: f64 = 0.3;
/// Share of the first residual at which implicit Euler stops.
const EULER_SHARE: f64 = 0.05;

impl Stepper<'_> {
    /// Contacts on the way from `start` `to` there, with the load they have at its start.
    pub(super) fn contacts(&self, start: &Kinematics, to: &[DVec3], times: [f64; 2]) -> Vec<ContactConstraint> {
        let h = (times[1] - times[0]) * self.seconds;
        let Some(contacts) = self.frame.contacts else { return Vec::new() };
        let body = self.context.body;
        let outwards = |x: &[DVec3]| -> Vec<[f64; 3]> {
            body.order.index_of.iter().map(|particle| x[*particle as usize].into()).collect()
        };
        let mut found: Vec<Contact> = Vec::new();
        contacts.find(&ContactQuery { from: &outwards(&start.x), to: &outwards(to), times }, &mut found);
        let known = found
            .iter()
            .filter_map(|contact| ContactConstraint::new(body, contact, self.seconds, &self.solver.particle_stiffness));
        let way = body.spacing * h / self.seconds;
        known.map(|c| c.depenetrating(&start.x, h, way).with_load(&start.x, &start.loads, h)).collect()
    }

    /// The largest push of an obstacle on each particle at `x`.
    pub(super) fn loads(&self, contacts: &[ContactConstraint], x: &[DVec3]) -> Vec<f64> {
        let mut loads = vec![0.0; x.len()];
        for contact in contacts {
            for (particle, _) in contact.sides() {
                loads[particle] = f64::max(loads[particle], contact.load_at(x));
            }
        }
        loads
    }

    /// The contacts that `x` has, and whether `known` lacks deep ones of them: what was far may be pushed near, and surfaces
    /// bend.
    pub(super) fn find_missed(
        &self,
        known: &[ContactConstraint],
        start: &Kinematics,
        x: &[DVec3],
        times: [f64; 2],
    ) -> (Vec<ContactConstraint>, bool) {
        if self.frame.contacts.is_none() {
            return (Vec::new(), false);
        }
        let deep = |contacts: &[ContactConstraint]| contacts.iter().filter(|contact| contact.is_too_deep(x)).count();
        let found = self.contacts(start, x, times);
        let missed = deep(&found) > deep(known);
        (found, missed)
    }

    /// How deep the worst contact is where particles are at `time`, metres below its gap.
    fn depth(&self, moving: &Kinematics, time: f64) -> f64 {
        deepest(&self.contacts(moving, &moving.x, [time; 2]), &moving.x)
    }

    /// Implicit Euler; `off` where it begins off balance by more than its contacts.
    pub(super) fn euler(
        &mut self,
        moving: &mut Kinematics,
        times: [f64; 2],
        contacts: &mut Vec<ContactConstraint>,
        off: bool,
    ) -> (Solved, f64) {
        let h = (times[1] - times[0]) * self.seconds;
        let mut z = moving.x.clone();
        let y: Vec<DVec3> = moving.x.iter().zip(&moving.v).map(|(x, v)| x + v * h).collect();
        let mut x = if off { moving.x.clone() } else { self.slid(&moving.x, &y, contacts, h) };
        self.pin(&mut x, &mut z, times[1], h);
        let volumes = self.solver.volumes.at(self.context.body, &z);
        self.solver.set_step_start(&self.context, h, |first, second| distance(&z, first, second), volumes);
        let scale = self.scale(&moving.x, &y, contacts, h);
        let mut enough = StopCriteria { share: EULER_SHARE, scale, square: 0.0, first: 0.0 };
        let mut solved = Solved::default();
        let stage = Stage {
            y: &y,
            z: &z,
            a: h,
            time: times[1],
            contacts: &[],
            early: 0.0,
            spinning: &[],
            line_search: true,
            index: 0,
        };
        let before = OnceCell::new();
        for round in 1..=ROUNDS {
            let again = self.solver.descend(&self.context, &stage, contacts, enough, self.warm, &mut x);
            solved = Solved { residual: again.residual, ..sum(solved, again) };
            (enough.square, enough.first) = (solved.enough, solved.first);
            let changed = reload(contacts, &x, &self.solver.v, h, self.context.body.size).is_some();
            let (mut found, missed) = self.find_missed(contacts, moving, &x, times);
            let thinned = self.watch_thin(&x);
            // What was deep before is on its way out. A plane of the end may call deep what was none: surfaces turn.
            let sank = |c: &&ContactConstraint| {
                let now = -c.clearance(&x, 0.0);
                c.is_too_deep(&x)
                    && (now > -c.clearance(&moving.x, h) || now > *before.get_or_init(|| self.depth(moving, times[0])))
            };
            solved.unmet = found.iter().filter(sank).map(|c| -c.clearance(&x, 0.0)).fold(0.0, f64::max);
            solved.deepest = deepest(&found, &x);
            if round == ROUNDS || !(missed || changed || thinned) {
                break;
            }
            if missed {
                take_loads(contacts, &mut found);
                *contacts = found;
            }
        }
        let v: Vec<DVec3> = x.iter().zip(&z).map(|(x, z)| (x - z) / h).collect();
        // What velocities changed by is a whole step late.
        let estimate = v.iter().zip(&moving.v).map(|(v, before)| 0.5 * h * (v - before).norm()).fold(0.0, f64::max);
        (moving.x, moving.v) = (x, v);
        (solved, estimate)
    }

    /// About the square of the residual of motion on from `x` to `y`, gravity and obstacles within `h`, if nothing gave way.
    fn scale(&self, x: &[DVec3], y: &[DVec3], contacts: &[ContactConstraint], h: f64) -> f64 {
        let mass = &self.context.body.mass;
        let falls = (DVec3::from(self.frame.gravity) * (h * h)).norm_squared();
        let own: f64 =
            (0..x.len()).map(|particle| mass[particle] * (falls + (y[particle] - x[particle]).norm_squared())).sum();
        let given = contacts.iter().flat_map(|contact| {
            let way = (contact.velocity * h).norm_squared();
            contact.sides().map(move |(particle, weight)| mass[particle] * weight * weight * way)
        });
        let scale = own + given.sum::<f64>();
        if scale > 0.0 { scale } else { f64::INFINITY }
    }

    /// `y`, with contacts as deep as they were at `x`, or just touching: a slip that goes on is what friction is sure of.
    fn slid(&self, x: &[DVec3], y: &[DVec3], contacts: &[ContactConstraint], h: f64) -> Vec<DVec3> {
        let mut out = y.to_vec();
        for contact in contacts {
            let Some((particle, weight)) = contact.single_particle() else { continue };
            let before = contact.clearance(x, h);
            let missing = before.min(0.0) - contact.clearance(&out, 0.0);
            if (missing > 0.0 || before < 0.0) && missing.abs() < NUDGE * self.context.body.spacing {
                out[particle] += contact.normal * (missing / weight);
            }
        }
        out
    }
}

/// Has contacts found anew count the loads of those that `known` has of the same particles in about the same direction.
fn take_loads(known: &[ContactConstraint], found: &mut [ContactConstraint]) {
    /// Cosine of the angle within which directions are the same.
    const SAME: f64 = 0.9;
    let mut order: Vec<u32> = (0..known.len() as u32).collect();
    order.sort_by_key(|index| (known[*index as usize].particles, *index));
    for contact in found {
        let first = order.partition_point(|index| known[*index as usize].particles < contact.particles);
        let mine = order[first..].iter().map(|index| &known[*index as usize]);
        let alike = mine.take_while(|other| other.particles == contact.particles);
        let nearest = alike.max_by(|a, b| a.normal.dot(&contact.normal).total_cmp(&b.normal.dot(&contact.normal)));
        contact.load = nearest.filter(|other| other.normal.dot(&contact.normal) > SAME).map_or(0.0, |other| other.load);
    }
}
