//! What is kept of the momenta of whole pieces, whatever linear solves leave of a residual.

use super::V3;
use super::body::Body;
use super::contact::{Mode, Touching};
use super::guess::Turn;
use super::order::pieces;
use super::stage::{Setting, Stage, Work};
use nalgebra::Matrix3;

/// Sum of weights above which a contact is with an obstacle: it is 1 there, and 0 between two bodies, which hold each other
/// only.
const HELD: f64 = 0.5;

type M3 = Matrix3<f64>;

/// What groups of pieces are to be given, and what they put up against being shifted as a whole.
pub(super) struct Whole {
    /// Σ of residuals, of each group.
    wanted: Vec<V3>,
    /// Resistance to a shift: inertia, and contacts with obstacles.
    resisted: Vec<M3>,
    holds: Vec<Hold>,
}

/// A contact by which an obstacle holds a group.
struct Hold {
    group: usize,
    /// Which of the stage's.
    contact: usize,
    /// Σ of its weights.
    weight: f64,
    /// As in [`Touching::resisted`].
    ways: ([V3; 3], usize),
}

impl Hold {
    /// Directions it resists in, each scaled by the root of the stiffness.
    fn ways(&self) -> impl Iterator<Item = &V3> {
        self.ways.0[..self.ways.1].iter()
    }
}

impl Work {
    /// Which pieces, joined by contacts with each other, are nowhere held; and which of them are in no contact.
    pub(super) fn find_free(&mut self, on: &Setting<'_>, contacts: &[Touching]) {
        let pieces_in_all = on.body.order.pieces.len();
        let piece_of = |place: usize| self.layout.piece[self.layout.cluster[place] as usize];
        self.system.held.clone_from(&on.drive.held);
        let (mut bound, mut touched) = (vec![false; pieces_in_all], vec![false; pieces_in_all]);
        let alone = &self.system.alone;
        for place in (0..on.body.len()).filter(|place| on.drive.held[*place] || alone.get(*place) == Some(&true)) {
            bound[piece_of(place) as usize] = true;
        }
        let mut links = Vec::new();
        for contact in contacts {
            let first = contact.places[0] as usize;
            for (place, _) in contact.sides() {
                touched[piece_of(place) as usize] = true;
                links.push([piece_of(first), piece_of(place)]);
            }
        }
        let groups = pieces(pieces_in_all, links.into_iter());
        let mut free = vec![true; pieces_in_all];
        for (piece, group) in groups.iter().enumerate() {
            free[*group as usize] &= !bound[piece];
        }
        self.turns = touched.iter().zip(&bound).map(|(touched, bound)| !touched && !bound).collect();
        self.groups = groups.iter().map(|group| free[*group as usize].then_some(*group)).collect();
    }

    /// What the residual asks of each group as a whole.
    pub(super) fn whole(&self, body: &Body, stage: &Stage<'_>) -> Whole {
        let inertia = &self.system.inertia;
        let sums = self.sums(body, |place| (self.r[place], inertia[place]));
        let (wanted, mut resisted): (Vec<V3>, Vec<M3>) =
            sums.into_iter().map(|(wanted, inertia)| (wanted, M3::identity() * inertia)).unzip();
        let mut holds = Vec::new();
        let known = stage.contacts.iter().zip(&self.touches).zip(&self.drags).enumerate();
        for (index, ((contact, touch), drag)) in known.filter(|known| known.1.0.1.mode != Mode::Apart) {
            let weight: f64 = contact.weights.iter().sum();
            let piece = self.layout.piece[self.layout.cluster[contact.places[0] as usize] as usize];
            let Some(group) = self.groups[piece as usize].filter(|_| weight.abs() > HELD) else { continue };
            let ways = contact.resisted(touch, stage.a, drag);
            let hold = Hold { group: group as usize, contact: index, weight, ways };
            hold.ways().for_each(|way| resisted[hold.group] += way * way.transpose() * (weight * weight));
            holds.push(hold);
        }
        Whole { wanted, resisted, holds }
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

    /// Shifts each group as a whole so that `dx` gives it all that is wanted, and takes that from `r`: springs and volumes do
    /// not feel it.
    pub(super) fn shift(&mut self, body: &Body, stage: &Stage<'_>, whole: &Whole) {
        let given = self.sums(body, |place| (self.dx[place] * self.system.inertia[place], 0.0));
        let mut left: Vec<V3> = whole.wanted.iter().zip(&given).map(|(wanted, (given, _))| wanted - given).collect();
        for hold in &whole.holds {
            let way_of = stage.contacts[hold.contact].between(&self.dx);
            hold.ways().for_each(|way| left[hold.group] -= way * (hold.weight * way.dot(&way_of)));
        }
        let by = |(left, resisted): (&V3, &M3)| {
            let by = resisted.cholesky().map(|factor| factor.solve(left)).unwrap_or_default();
            if by.iter().all(|by| by.is_finite()) { by } else { V3::zeros() }
        };
        let by: Vec<V3> = left.iter().zip(&whole.resisted).map(by).collect();
        for (piece, group) in body.order.pieces.iter().zip(&self.groups) {
            let Some(group) = *group else { continue };
            for place in body.places(piece) {
                self.dx[place] += by[group as usize];
                self.r[place] -= by[group as usize] * self.system.inertia[place];
            }
        }
        for hold in &whole.holds {
            for (place, weight) in stage.contacts[hold.contact].sides() {
                let push = |sum: V3, way: &V3| sum + way * (weight * hold.weight * way.dot(&by[hold.group]));
                self.r[place] -= hold.ways().fold(V3::zeros(), push);
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
            let (mut torque, mut tensor) = (V3::zeros(), M3::zeros());
            for place in places.clone() {
                let arm = x[place] - middle;
                torque += arm.cross(&self.r[place]);
                tensor += (M3::identity() * arm.norm_squared() - arm * arm.transpose()) * inertia[place];
            }
            tensor += M3::identity() * (NOTHING * tensor.trace());
            let Some(angle) = tensor.try_inverse().map(|inverse| inverse * torque) else { continue };
            if angle.iter().all(|x| x.is_finite()) {
                let turn = Turn::by(angle);
                x[places].iter_mut().for_each(|x| *x = middle + turn.apply(*x - middle));
            }
        }
    }
}
