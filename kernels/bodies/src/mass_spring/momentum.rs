//! Exact conservation of linear and angular momentum of unconstrained groups of pieces, independent of the accuracy
//! of linear solves.

use super::body::SoftBody;
use super::contact::ContactMode;
use super::stage::{BodySolver, Stage};
use numerics::pieces::pieces;
use numerics::rotation::CayleyRotation;
use numerics::vector::{DMat3, DVec3};

/// Total residual and translational stiffness of each group.
pub(super) struct MomentumTarget {
    /// Sum of residuals over each group.
    residual: Vec<DVec3>,
    /// Stiffness of each group against translation: inertia and contacts with obstacles.
    stiffness: Vec<DMat3>,
    obstacle_contacts: Vec<ObstacleContact>,
}

/// A contact of a group with an obstacle.
struct ObstacleContact {
    group: usize,
    /// Index in the stage's contacts.
    contact: usize,
    /// Sum of its weights.
    weight: f64,
    /// As in [`super::contact::ContactConstraint::stiffness_directions`].
    directions: Vec<DVec3>,
}

impl BodySolver {
    /// Finds the groups of pieces, joined by contacts with each other, that are not pinned; and which pieces have no
    /// contact.
    pub(super) fn find_free_groups(&mut self, stage: &Stage<'_>) {
        let body = stage.context.body;
        let pieces_in_all = body.order.pieces.len();
        let piece_of = |particle: usize| body.layout.piece_of(particle) as u32;
        let (mut bound, mut touched) = (vec![false; pieces_in_all], vec![false; pieces_in_all]);
        for particle in (0..body.len()).filter(|particle| self.system.is_loose(*particle)) {
            bound[piece_of(particle) as usize] = true;
        }
        let mut links = Vec::new();
        for contact in stage.contacts {
            let first = piece_of(contact.particles[0] as usize);
            for (particle, _) in contact.sides() {
                touched[piece_of(particle) as usize] = true;
                links.push([first, piece_of(particle)]);
            }
        }
        let groups = pieces(pieces_in_all, links.into_iter());
        let mut free = vec![true; pieces_in_all];
        for (piece, group) in groups.iter().enumerate() {
            free[*group as usize] &= !bound[piece];
        }
        self.free_pieces = touched.iter().zip(&bound).map(|(touched, bound)| !touched && !bound).collect();
        self.groups = groups.iter().map(|group| free[*group as usize].then_some(*group)).collect();
    }

    /// What the translation of each group is to account for: the right-hand side `right` of the linear system.
    pub(super) fn momentum_target(&self, stage: &Stage<'_>, right: &[DVec3]) -> MomentumTarget {
        let inertia = &self.system.inertia;
        let residual = self.sums(stage, |particle| right[particle]);
        let inertia = self.sums(stage, |particle| DVec3::repeat(inertia[particle]));
        let mut stiffness: Vec<DMat3> = inertia.iter().map(DMat3::from_diagonal).collect();
        let obstacle_contacts = self.obstacle_contacts(stage);
        for obstacle in &obstacle_contacts {
            let shift = |direction: &DVec3| direction * direction.transpose() * (obstacle.weight * obstacle.weight);
            obstacle.directions.iter().for_each(|direction| stiffness[obstacle.group] += shift(direction));
        }
        MomentumTarget { residual, stiffness, obstacle_contacts }
    }

    /// Contacts between groups and obstacles.
    fn obstacle_contacts(&self, stage: &Stage<'_>) -> Vec<ObstacleContact> {
        let known = stage.contacts.iter().zip(&self.contact_states).enumerate();
        let obstacle_contacts =
            known.filter(|known| known.1.1.mode != ContactMode::Open).filter_map(|(index, (contact, state))| {
                let piece = stage.context.body.layout.piece_of(contact.particles[0] as usize);
                let group = self.groups[piece].filter(|_| !contact.is_two_sided())? as usize;
                Some(ObstacleContact {
                    group,
                    contact: index,
                    weight: contact.of.weights.iter().sum(),
                    directions: contact.stiffness_directions(state, stage.a).collect(),
                })
            });
        obstacle_contacts.collect()
    }

    fn sums(&self, stage: &Stage<'_>, of: impl Fn(usize) -> DVec3 + Sync) -> Vec<DVec3> {
        let order = &stage.context.body.order;
        let sums = order.clusters.map((), |cluster, ()| order.clusters.range(cluster).map(&of).sum::<DVec3>());
        let mut groups = vec![DVec3::zeros(); order.pieces.len()];
        for (piece, group) in order.pieces.iter().zip(&self.groups) {
            if let Some(group) = group {
                sums[piece.clone()].iter().for_each(|sum| groups[*group as usize] += sum);
            }
        }
        groups
    }

    /// Translates each group as a whole so that `dx` accounts for its entire residual, and updates `r`. Springs and
    /// volumes are not affected.
    pub(super) fn correct_linear_momentum(&mut self, stage: &Stage<'_>, target: &MomentumTarget) {
        let body = stage.context.body;
        let given = self.sums(stage, |particle| self.dx[particle] * self.system.inertia[particle]);
        let mut left: Vec<DVec3> =
            target.residual.iter().zip(&given).map(|(residual, given)| residual - given).collect();
        for obstacle in &target.obstacle_contacts {
            let displacement = stage.contacts[obstacle.contact].weighted_sum(&self.dx);
            obstacle.directions.iter().for_each(|direction| {
                left[obstacle.group] -= direction * (obstacle.weight * direction.dot(&displacement))
            });
        }
        let by = |(left, stiffness): (&DVec3, &DMat3)| {
            let by = stiffness.cholesky().map(|factor| factor.solve(left)).unwrap_or_default();
            if by.iter().all(|by| by.is_finite()) { by } else { DVec3::zeros() }
        };
        let by: Vec<DVec3> = left.iter().zip(&target.stiffness).map(by).collect();
        for (group, particle) in members(body, &self.groups) {
            self.dx[particle] += by[group];
            self.r[particle] -= by[group] * self.system.inertia[particle];
        }
        for obstacle in &target.obstacle_contacts {
            for (particle, weight) in stage.contacts[obstacle.contact].sides() {
                let push = |sum: DVec3, direction: &DVec3| {
                    sum + direction * (weight * obstacle.weight * direction.dot(&by[obstacle.group]))
                };
                self.r[particle] -= obstacle.directions.iter().fold(DVec3::zeros(), push);
            }
        }
    }

    /// The positions `x`, with residual `r`, after each group was rotated as a whole so that it has the angular
    /// momentum that the stage's equation demands, which corrects the error of linear solves. Springs and volumes are
    /// not affected; the stiffness of contacts with obstacles is accounted for. `None` if there is nothing to rotate.
    pub(super) fn corrected_angular_momentum(&self, stage: &Stage<'_>, x: &[DVec3]) -> Option<Vec<DVec3>> {
        /// Moments of inertia below this fraction of the trace are treated as zero.
        const NEGLIGIBLE: f64 = 1e-9;
        let (body, inertia) = (stage.context.body, &self.system.inertia);
        let members = || members(body, &self.groups);
        let count = body.order.pieces.len();
        let mut middles = vec![(DVec3::zeros(), 0.0); count];
        for (group, particle) in members() {
            middles[group].0 += x[particle] * inertia[particle];
            middles[group].1 += inertia[particle];
        }
        let middles: Vec<DVec3> = middles.into_iter().map(|(sum, mass)| sum / mass).collect();
        let mut turned = vec![(DVec3::zeros(), DMat3::zeros()); count];
        for (group, particle) in members() {
            let offset = x[particle] - middles[group];
            let (torque, tensor) = &mut turned[group];
            *torque += offset.cross(&self.r[particle]);
            *tensor += (DMat3::identity() * offset.norm_squared() - offset * offset.transpose()) * inertia[particle];
        }
        turned.iter_mut().for_each(|(_, tensor)| *tensor += DMat3::identity() * (NEGLIGIBLE * tensor.trace()));
        for obstacle in self.obstacle_contacts(stage) {
            let sides = stage.contacts[obstacle.contact].sides();
            let offset = sides
                .fold(DVec3::zeros(), |sum, (particle, weight)| sum + (x[particle] - middles[obstacle.group]) * weight);
            for direction in &obstacle.directions {
                let torque_arm = offset.cross(direction);
                turned[obstacle.group].1 += torque_arm * torque_arm.transpose();
            }
        }
        let turn = |(torque, tensor): &(DVec3, DMat3)| {
            let angle = tensor.cholesky()?.solve(torque);
            angle.iter().all(|x| x.is_finite()).then(|| CayleyRotation::by(angle))
        };
        let turns: Vec<Option<CayleyRotation>> = turned.iter().map(turn).collect();
        let rotated = || members().filter_map(|(group, particle)| Some((group, particle, turns[group].as_ref()?)));
        rotated().next()?;
        let mut corrected = x.to_vec();
        for (group, particle, turn) in rotated() {
            corrected[particle] = middles[group] + turn.apply(x[particle] - middles[group]);
        }
        Some(corrected)
    }
}

/// The particles of groups, with the group.
fn members(body: &SoftBody, groups: &[Option<u32>]) -> impl Iterator<Item = (usize, usize)> {
    let grouped = body.pieces().zip(groups).filter_map(|(piece, group)| Some(((*group)? as usize, piece)));
    grouped.flat_map(|(group, piece)| piece.map(move |particle| (group, particle)))
}
