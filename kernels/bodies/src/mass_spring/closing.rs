//! Contacts with obstacles that a direction closes.
//!
//! A linear system has the contacts that are closed where it was made. Its solution may press hundreds of others closed by
//! several gaps, which a line search prevents with steps of an eighth, again and again. So those are added as springs that act
//! from their gap on, and the solve is continued. Most directions can then be followed in full: a pin that rolls over dough
//! takes a quarter fewer Newton iterations.
//!
//! Not where more force is left on a body than its contacts exert, as in an impact: the solve is not accurate enough there, and
//! stiff bodies would tilt. For the same reason contacts that a direction pulls on stay. Nor between bodies: those that start
//! inside each other come apart less evenly with it.

use super::stage::{BodySolver, Stage};
use numerics::quad::Quad;
use numerics::vector::DVec3;

impl BodySolver {
    /// Adds the contacts that the direction `dx` from `x` closes to the linear system with the right-hand side `right`, and
    /// sets the residual `r` to that of `dx`. Returns false if there are none.
    ///
    /// What touches no obstacle yet closes none: the line search stops it where it first does, and friction begins there.
    /// Without friction it would glide on. Nor do heaps, which are pressed into more contacts than can be met.
    pub(super) fn close_contacts(&mut self, stage: &Stage<'_>, x: &[DVec3], right: &mut [DVec3]) -> bool {
        let (touching, square, mut closed) = (self.touching_obstacles(stage), stage.a * stage.a, false);
        for (contact, state) in stage.contacts.iter().zip(&mut self.contact_states) {
            let first = contact.particles[0] as usize;
            let may_close = touching[stage.context.body.layout.piece_of(first)] && self.heaps.get(first) != Some(&true);
            if may_close && !contact.is_two_sided() && contact.close(state, &self.dx) {
                closed = true;
                for (particle, weight) in contact.sides().filter(|side| !self.system.held[side.0]) {
                    right[particle] += contact.normal * (state.normal_force * weight * square);
                }
            }
        }
        if closed {
            self.complete_in_contact(stage, x);
            let dx: Vec<Quad> = self.dx.iter().copied().map(Quad::new).collect();
            let mut product = vec![Quad::default(); dx.len()];
            self.system.apply(stage.context.body, &dx, &mut product);
            let left = right.iter().zip(product).map(|(right, product)| right - product.xyz());
            self.r.iter_mut().zip(left).for_each(|(r, left)| *r = left);
        }
        closed
    }
}

#[cfg(test)]
mod tests {
    use super::super::body::{Material, Mesh, SoftBody};
    use super::super::contact::{Contact, ContactConstraint};
    use super::super::heap::ContactScale;
    use super::*;
    use crate::tets::cubes;

    /// A corner 0.4 mm above the gap of the ground: as linearised, what goes a little below it is pressed as hard as it will
    /// be there, and what stays above it not at all.
    #[test]
    fn a_contact_that_a_direction_closes_acts_from_its_gap_on() {
        let (points, tets) = cubes([1, 1, 1], [0.0, 1.4e-3, 0.0], [0.1; 3]);
        let material = Material { density: 1000.0.into(), stiffness: 5e3.into(), damping: 0.01.into() };
        let body = SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).unwrap();
        let contact = Contact {
            points: [0; 4],
            weights: [1.0, 0.0, 0.0, 0.0],
            normal: [0.0, 1.0, 0.0],
            offset: 0.0,
            gap: 1e-3,
            velocity: [0.0; 3],
            friction: 0.0,
            jammed: false,
            open: false,
        };
        let scale = ContactScale { seconds: 0.04, gravity: 9.81, particle_stiffness: &[100.0; 8], heaps: &[] };
        let contact = ContactConstraint::new(&body, &contact, &scale).unwrap();
        let still = [DVec3::zeros(); 8];
        for (down, closes) in [(0.3e-3, false), (0.4e-3 + 1e-9, true)] {
            let dx = [DVec3::new(0.0, -down, 0.0); 8];
            let moved: Vec<DVec3> = body.rest.iter().zip(&dx).map(|(x, d)| x + d).collect();
            let [mut state, end] = [&body.rest, &moved].map(|x| contact.at(x, &still, 0.0, body.size));
            assert_eq!(contact.close(&mut state, &dx), closes);
            contact.predict(&mut state, &dx, 1.0, 0.04);
            assert!((state.predicted - end.normal_force).abs() <= 1e-5 * end.normal_force, "{state:?} {end:?}");
            assert_eq!(end.normal_force > 0.0, closes);
            assert!(!contact.close(&mut state, &dx), "it is closed, or stays open");
        }
    }
}
