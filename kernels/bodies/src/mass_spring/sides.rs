//! What is done where a step that may not be shortened any further leaves contacts with open obstacles or the ground too deep:
//! what would otherwise go through them is kept on the side it came from.
//!
//! From positions alone the next step could not tell that side, as it can where an obstacle has an inside. Particles are
//! therefore moved back until contacts are just not too deep, and no longer approach, as in an inelastic impact.

use super::contact::ContactConstraint;
use super::energy::measure;
use super::step::{self, Interval, Kinematics, Stepped, Stepper};
use numerics::vector::DVec3;

/// Depth, in gaps, at which a contact that was too deep is left.
const LEFT: f64 = 0.9;
/// Rounds of contact detection, and turns through all contacts in a round.
const ROUNDS: u32 = 4;
const TURNS: u32 = 8;

impl Stepper<'_> {
    /// Changes the `end` of a step so that contacts with open obstacles and the ground that were not too deep at its start are
    /// not at its end.
    pub(super) fn keep_sides(&mut self, step: Interval<'_>, end: &mut Kinematics, stepped: &mut Stepped) {
        let Interval { start, times, h } = step;
        let (mass, held) = (&self.context.body.mass, self.context.external.held.clone());
        let mut met: Vec<ContactConstraint> = Vec::new();
        for _ in 0..ROUNDS {
            let mut found = self.contacts(step, &end.x);
            found.retain(|contact| contact.of.open);
            let mut moved = vec![false; found.len()];
            for _ in 0..TURNS {
                let mut any = false;
                for (contact, moved) in found.iter().zip(&mut moved) {
                    let (before, now) = (contact.clearance(&start.x, h), contact.clearance(&end.x, 0.0));
                    if contact.is_too_deep(&end.x) && now < before {
                        let missing = before.min(-LEFT * contact.of.gap) - now;
                        *moved |= impel(contact, missing, (mass, &held), &mut end.x);
                        any |= *moved;
                    }
                }
                if !any {
                    break;
                }
            }
            if !moved.contains(&true) {
                break;
            }
            met.extend(found.into_iter().zip(moved).filter(|(_, moved)| *moved).map(|(contact, _)| contact));
        }
        if met.is_empty() {
            return;
        }
        for _ in 0..TURNS {
            for contact in &met {
                let approach = contact.normal.dot(&(contact.velocity - contact.weighted_sum(&end.v)));
                if approach > 0.0 {
                    impel(contact, approach, (mass, &held), &mut end.v);
                }
            }
        }
        end.acceleration.fill(DVec3::zeros());
        let before = stepped.after.sum();
        self.solver.latest_inventory = None;
        self.refresh_inventory(&end.x);
        stepped.after = measure(self.solver, &self.context, times[1], [&end.x, &end.v], false);
        // What it gained by that is taken from the motion.
        let (gained, kinetic) = (stepped.after.sum() - before, stepped.after.kinetic);
        if gained > 0.0 && kinetic > 0.0 {
            let keep = ((kinetic - gained) / kinetic).max(0.0).sqrt();
            end.v.iter_mut().zip(&held).filter(|(_, held)| !**held).for_each(|(v, _)| *v *= keep);
            stepped.after.kinetic = step::kinetic(self.context.body, &end.v);
        }
        stepped.report.energy_lost += before - stepped.after.sum();
    }
}

/// Changes the vectors of those particles of a contact that are not held by an impulse along its normal, so that their
/// weighted sum changes by `change` along it. Returns whether any was.
fn impel(contact: &ContactConstraint, change: f64, (mass, held): (&[f64], &[bool]), vectors: &mut [DVec3]) -> bool {
    let free = || contact.sides().filter(|side| !held[side.0]);
    let mobility: f64 = free().map(|(particle, weight)| weight * weight / mass[particle]).sum();
    if !(mobility > 0.0 && change.is_finite()) {
        return false;
    }
    free().for_each(|(particle, weight)| {
        vectors[particle] += contact.normal * (change / mobility * weight / mass[particle]);
    });
    true
}
