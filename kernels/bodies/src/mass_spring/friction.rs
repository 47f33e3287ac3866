//! Loads of friction: whether they are the normal forces of bodies in balance.
//!
//! A stage is solved with given loads, so that friction has a potential. The loads are right once they are the normal
//! forces that the solve ends with, which are read on the way, as soon as they are less wrong than the loads.
//!
//! How wrong normal forces are is seen from the force and torque that are left on a whole body. The norm of the residual
//! does not show it: stiff springs and contacts turn a wrong force into a tiny displacement.

use super::contact::ContactConstraint;
use super::predictor::RigidMotion;
use super::stage::{BodySolver, Stage};
use numerics::quad::Quad;
use numerics::vector::DVec3;

/// Force and torque left on a body, and change of the sum of its loads, that are tolerated, relative to that sum. They
/// decide how much a body that hits a surface is slowed.
const TOLERATED: f64 = 0.03;
const TOLERATED_CHANGE: f64 = 0.015;
/// Factor on that for a body which is pressed from opposite sides: what holds it is its stiffness.
const PRESSED: f64 = 8.0;
/// Change of single loads that is tolerated, relative to their sum.
const TOLERATED_SINGLE: f64 = 0.5;
/// Normal forces are read where what is left is less than this fraction of the change of single loads.
const READABLE: f64 = 0.5;

/// How far loads are from being the normal forces of bodies in balance; each for the body where it is the most.
#[derive(Clone, Debug, Default)]
pub(super) struct LoadBalance {
    /// Force left, or torque ÷ radius of gyration, and change of the sum of loads: relative to that sum, and ÷
    /// [`PRESSED`] where it is pressed.
    left: f64,
    change: f64,
    /// Change of single loads, relative to their sum.
    single: f64,
    /// The bodies with loads, and what forces left on them are relative to, newtons.
    bodies: Vec<(RigidMotion, f64)>,
}

impl LoadBalance {
    pub(super) fn is_in_balance(&self) -> bool {
        self.left <= TOLERATED
    }

    pub(super) fn agrees(&self) -> bool {
        self.change <= TOLERATED_CHANGE && self.single <= TOLERATED_SINGLE
    }

    /// Whether there are loads that bodies are in balance under, and that are the normal forces: nothing bounces.
    pub(super) fn is_settled(&self) -> bool {
        !self.bodies.is_empty() && self.is_in_balance() && self.agrees()
    }

    /// Whether bodies at `x` are in balance but for a part of what is tolerated, with the residual `r` of a stage of `a`.
    pub(super) fn holds(&self, a: f64, x: &[DVec3], r: &[Quad]) -> bool {
        /// Part of what is tolerated.
        const LEFT: f64 = 0.5;
        let left = |(body, scale): &(RigidMotion, f64)| body.force_left(x, r) / (a * a * scale);
        self.bodies.iter().all(|body| left(body) <= LEFT * TOLERATED)
    }

    /// Whether no more force is left on a body than its contacts exert.
    pub(super) fn is_near(&self) -> bool {
        self.left <= 1.0
    }

    /// Whether normal forces are less wrong than the loads.
    pub(super) fn is_readable(&self) -> bool {
        self.left < READABLE * self.single
    }
}

/// Normal forces on a piece, as loads of friction.
#[derive(Clone, Copy, Debug, Default)]
struct PieceLoads {
    sum: f64,
    /// Their vector sum.
    net: DVec3,
    /// The difference of their sum from that of the loads, and the sum of differences.
    change: f64,
    single: f64,
}

impl BodySolver {
    /// The balance of loads at `x`, for which the residual was just evaluated. Pinned pieces are in balance.
    pub(super) fn balance(&self, stage: &Stage<'_>, x: &[DVec3]) -> LoadBalance {
        let body = stage.context.body;
        let mut pieces = vec![PieceLoads::default(); body.order.pieces.len()];
        for contact in stage.contacts.iter().filter(|contact| contact.of.friction > 0.0) {
            let now = contact.load_at(x, 0.0);
            let mut last = usize::MAX;
            for (particle, weight) in contact.sides() {
                let piece = body.layout.piece_of(particle);
                let loads = &mut pieces[piece];
                loads.net += contact.normal * (weight * now);
                if piece != last {
                    loads.sum += now;
                    loads.change += now - contact.load;
                    loads.single += (now - contact.load).abs();
                }
                last = piece;
            }
        }
        let mut balance = LoadBalance::default();
        if pieces.iter().all(|piece| piece.sum == 0.0 && piece.single == 0.0) {
            return balance;
        }
        let left: Vec<DVec3> = self.r.iter().zip(&body.mass).map(|(r, mass)| r / (stage.a * stage.a * mass)).collect();
        for (piece, loads) in body.pieces().zip(&pieces).filter(|piece| piece.1.single > 0.0 || piece.1.sum > 0.0) {
            let pressed = 1.0 + (PRESSED - 1.0) * (1.0 - (loads.net.norm() / loads.sum).min(1.0));
            let motion = RigidMotion::new(body, &self.system.held, piece, [x, &left, &left]);
            let left = if loads.sum > 0.0 { motion.force(body) / (loads.sum * pressed) } else { 0.0 };
            balance.bodies.push((motion, loads.sum * pressed));
            balance.left = balance.left.max(left);
            balance.change = balance.change.max(loads.change.abs() / (loads.sum * pressed));
            balance.single = balance.single.max(loads.single / loads.sum);
        }
        balance
    }

    /// Sets the loads of friction to their means with the normal forces at `x`, since loads and normal forces that follow each
    /// other in full may alternate for ever; 0 where contacts are open. Velocities are the current ones. Returns the increase of
    /// the objective of a stage of `a`.
    pub(super) fn reload(&self, contacts: &mut [ContactConstraint], x: &[DVec3], a: f64, size: f64) -> f64 {
        let more = contacts.iter_mut().map(|contact| {
            let before = contact.friction_energy(&self.v, a, size);
            let now = contact.load_at(x, 0.0);
            contact.load = if now > 0.0 { 0.5 * (contact.load + now) } else { 0.0 };
            contact.friction_energy(&self.v, a, size) - before
        });
        a * a * more.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::super::body::{Material, Mesh, SoftBody};
    use super::*;
    use crate::tets::cubes;

    /// A block on which forces are left: the force, and the torque ÷ radius of gyration.
    #[test]
    fn bodies_are_in_balance_with_as_much_force_left_as_is_tolerated() {
        let (points, tets) = cubes([3, 2, 2], [0.0; 3], [0.3, 0.2, 0.2]);
        let material = Material { density: 1000.0.into(), stiffness: 1e4.into(), damping: 0.0.into() };
        let body = SoftBody::new(&Mesh { points: &points, tets: &tets, ..Mesh::default() }, &material, &[]).unwrap();
        let a = 0.04;
        let forces = |x: &DVec3| DVec3::y() + DVec3::z().cross(x) * 3.0;
        let left: Vec<DVec3> = body.rest.iter().zip(&body.mass).map(|(x, mass)| forces(x) / *mass).collect();
        let r: Vec<Quad> = body.rest.iter().map(|x| Quad::new(forces(x) * (a * a))).collect();
        let held = vec![false; body.len()];
        let motion = RigidMotion::new(&body, &held, 0..body.len(), [&body.rest, &left, &left]);
        let force = motion.force(&body);
        assert!((motion.force_left(&body.rest, &r) / (a * a * force) - 1.0).abs() < 1e-9);
        for (loads, holds) in [(1.01, true), (0.99, false)] {
            let bodies = vec![(motion.clone(), 2.0 * loads * force / TOLERATED)];
            assert_eq!(LoadBalance { bodies, ..LoadBalance::default() }.holds(a, &body.rest, &r), holds);
        }
    }
}
