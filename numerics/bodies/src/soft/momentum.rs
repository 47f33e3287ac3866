//! What is kept of the momenta of whole pieces, whatever linear solves leave of a residual.

use super::V3;
use super::body::Body;
use super::contact::Touching;
use super::guess::Turn;
use super::order::pieces;
use super::stage::{Setting, Work};
use nalgebra::Matrix3;

impl Work {
    /// Which pieces, joined by contacts with each other, nothing but gravity, drag and goals acts on from outside; and which
    /// of them are in no contact.
    pub(super) fn find_free(&mut self, on: &Setting<'_>, contacts: &[Touching]) {
        let order = &on.body.order;
        let piece_of = |place: usize| {
            let cluster = self.layout.cluster[place] as usize;
            order.pieces.partition_point(|piece| piece.end <= cluster)
        };
        self.system.held.clone_from(&on.drive.held);
        let mut bound = vec![false; order.pieces.len()];
        let mut turns = vec![true; order.pieces.len()];
        let alone = &self.system.alone;
        for place in (0..on.body.len()).filter(|place| on.drive.held[*place] || alone.get(*place) == Some(&true)) {
            bound[piece_of(place)] = true;
        }
        let mut links = Vec::new();
        for contact in contacts {
            let first = contact.places[0] as usize;
            for (place, _) in contact.sides() {
                turns[piece_of(place)] = false;
                links.push([piece_of(first) as u32, piece_of(place) as u32]);
                bound[piece_of(place)] |= contact.alone().is_some();
            }
        }
        let groups = pieces(order.pieces.len(), links.into_iter());
        let mut free = vec![true; order.pieces.len()];
        for (piece, group) in groups.iter().enumerate() {
            free[*group as usize] &= !bound[piece];
        }
        self.turns = turns.iter().zip(&bound).map(|(turns, bound)| *turns && !bound).collect();
        self.groups = groups.iter().map(|group| free[*group as usize].then_some(*group)).collect();
    }

    /// For each group of pieces the sum of residuals and of inertia.
    pub(super) fn momenta(&self, body: &Body) -> Vec<(V3, f64)> {
        self.sums(body, |place| (self.r[place], self.system.inertia[place]))
    }

    fn sums(&self, body: &Body, of: impl Fn(usize) -> (V3, f64) + Sync) -> Vec<(V3, f64)> {
        let clusters = &body.order.clusters;
        let add = |sum: (V3, f64), part: (V3, f64)| (sum.0 + part.0, sum.1 + part.1);
        let sums = clusters.map((), |cluster, ()| clusters.range(cluster).map(&of).fold((V3::zeros(), 0.0), add));
        let mut groups = vec![(V3::zeros(), 0.0); body.order.pieces.len()];
        for (piece, group) in body.order.pieces.iter().zip(&self.groups) {
            if let Some(group) = group {
                let slot = &mut groups[*group as usize];
                *slot = sums[piece.clone()].iter().copied().fold(*slot, add);
            }
        }
        groups
    }

    /// Shifts each free group as a whole so that `dx` gives it the momentum `wanted`, and takes it from `r`.
    pub(super) fn shift(&mut self, body: &Body, wanted: &[(V3, f64)]) {
        let given = self.sums(body, |place| (self.dx[place] * self.system.inertia[place], 0.0));
        for (index, piece) in body.order.pieces.iter().enumerate() {
            let Some(group) = self.groups[index].map(|group| group as usize) else { continue };
            let by = (wanted[group].0 - given[group].0) / wanted[group].1;
            if by.iter().all(|by| by.is_finite()) {
                for place in body.places(piece) {
                    self.dx[place] += by;
                    self.r[place] -= by * self.system.inertia[place];
                }
            }
        }
    }

    /// Turns each free piece as a whole so that it has the angular momentum of the stage's equation, whatever linear solves
    /// left: springs and volumes do not feel it.
    pub(super) fn turn(&self, body: &Body, x: &mut [V3]) {
        /// Share of a piece's inertia below which it has none about an axis.
        const NOTHING: f64 = 1e-9;
        let inertia = &self.system.inertia;
        for (_, piece) in body.order.pieces.iter().enumerate().filter(|(index, _)| self.turns[*index]) {
            let places = body.places(piece);
            let (sum, mass) = places.clone().fold((V3::zeros(), 0.0), |(sum, mass), place| {
                (sum + x[place] * inertia[place], mass + inertia[place])
            });
            let middle = sum / mass;
            let (mut torque, mut tensor) = (V3::zeros(), Matrix3::zeros());
            for place in places.clone() {
                let arm = x[place] - middle;
                torque += arm.cross(&self.r[place]);
                tensor += (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * inertia[place];
            }
            tensor += Matrix3::identity() * (NOTHING * tensor.trace());
            let Some(angle) = tensor.try_inverse().map(|inverse| inverse * torque) else { continue };
            if angle.iter().all(|x| x.is_finite()) {
                let turn = Turn::by(angle);
                x[places].iter_mut().for_each(|x| *x = middle + turn.apply(*x - middle));
            }
        }
    }
}
