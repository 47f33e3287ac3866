//! What is kept of the momenta of whole pieces, whatever linear solves leave of a residual.

use super::body::Body;
use super::contact::{Mode, Touching};
use super::guess::Turn;
use super::order::pieces;
use super::stage::{Setting, Stage, Work};
use numerics::vector::{DMat3, DVec3};

/// Sum of weights above which a contact is with an obstacle: it is 1 there, and 0 between two bodies, which hold each other
/// only.
const HELD: f64 = 0.5;

/// What groups of pieces are to be given, and what they put up against being shifted as a whole.
pub(super) struct Whole {
    /// Σ of residuals, of each group.
    wanted: Vec<DVec3>,
    /// Resistance to a shift: inertia, and contacts with obstacles.
    resisted: Vec<DMat3>,
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
    ways: ([DVec3; 3], usize),
}

impl Hold {
    /// Directions it resists in, each scaled by the root of the stiffness.
    fn ways(&self) -> impl Iterator<Item = &DVec3> {
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
        let (wanted, mut resisted): (Vec<DVec3>, Vec<DMat3>) =
            sums.into_iter().map(|(wanted, inertia)| (wanted, DMat3::identity() * inertia)).unzip();
        let holds = self.holds(stage);
        for hold in &holds {
            let shift = |way: &DVec3| way * way.transpose() * (hold.weight * hold.weight);
            hold.ways().for_each(|way| resisted[hold.group] += shift(way));
        }
        Whole { wanted, resisted, holds }
    }

    /// What obstacles hold groups by.
    fn holds(&self, stage: &Stage<'_>) -> Vec<Hold> {
        let known = stage.contacts.iter().zip(&self.touches).zip(&self.drags).enumerate();
        let holds =
            known.filter(|known| known.1.0.1.mode != Mode::Apart).filter_map(|(index, ((contact, touch), drag))| {
                let weight: f64 = contact.weights.iter().sum();
                let piece = self.layout.piece[self.layout.cluster[contact.places[0] as usize] as usize];
                let group = self.groups[piece as usize].filter(|_| weight.abs() > HELD)? as usize;
                Some(Hold { group, contact: index, weight, ways: contact.resisted(touch, stage.a, drag) })
            });
        holds.collect()
    }

    fn sums(&self, body: &Body, of: impl Fn(usize) -> (DVec3, f64) + Sync) -> Vec<(DVec3, f64)> {
        let clusters = &body.order.clusters;
        let add = |sum: (DVec3, f64), part: (DVec3, f64)| (sum.0 + part.0, sum.1 + part.1);
        let sums = clusters.map((), |cluster, ()| clusters.range(cluster).map(&of).fold((DVec3::zeros(), 0.0), add));
        let mut groups = vec![(DVec3::zeros(), 0.0); body.order.pieces.len()];
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
        let mut left: Vec<DVec3> = whole.wanted.iter().zip(&given).map(|(wanted, (given, _))| wanted - given).collect();
        for hold in &whole.holds {
            let way_of = stage.contacts[hold.contact].between(&self.dx);
            hold.ways().for_each(|way| left[hold.group] -= way * (hold.weight * way.dot(&way_of)));
        }
        let by = |(left, resisted): (&DVec3, &DMat3)| {
            let by = resisted.cholesky().map(|factor| factor.solve(left)).unwrap_or_default();
            if by.iter().all(|by| by.is_finite()) { by } else { DVec3::zeros() }
        };
        let by: Vec<DVec3> = left.iter().zip(&whole.resisted).map(by).collect();
        for (piece, group) in body.order.pieces.iter().zip(&self.groups) {
            let Some(group) = *group else { continue };
            for place in body.places(piece) {
                self.dx[place] += by[group as usize];
                self.r[place] -= by[group as usize] * self.system.inertia[place];
            }
        }
        for hold in &whole.holds {
            for (place, weight) in stage.contacts[hold.contact].sides() {
                let push = |sum: DVec3, way: &DVec3| sum + way * (weight * hold.weight * way.dot(&by[hold.group]));
                self.r[place] -= hold.ways().fold(DVec3::zeros(), push);
            }
        }
    }

    /// Turns each group as a whole so that it has the angular momentum of the stage's equation, whatever linear solves left:
    /// springs and volumes do not feel it, and contacts with obstacles are counted for what they resist.
    pub(super) fn turn(&self, body: &Body, stage: &Stage<'_>, x: &mut [DVec3]) {
        /// Share of a group's inertia below which it has none about an axis.
        const NOTHING: f64 = 1e-9;
        let inertia = &self.system.inertia;
        let members = || {
            let grouped = body.order.pieces.iter().zip(&self.groups);
            let grouped = grouped.filter_map(|(piece, group)| Some(((*group)? as usize, piece)));
            grouped.flat_map(|(group, piece)| body.places(piece).map(move |place| (group, place)))
        };
        let count = body.order.pieces.len();
        let mut middles = vec![(DVec3::zeros(), 0.0); count];
        for (group, place) in members() {
            middles[group].0 += x[place] * inertia[place];
            middles[group].1 += inertia[place];
        }
        let middles: Vec<DVec3> = middles.into_iter().map(|(sum, mass)| sum / mass).collect();
        let mut turned = vec![(DVec3::zeros(), DMat3::zeros()); count];
        for (group, place) in members() {
            let arm = x[place] - middles[group];
            let (torque, tensor) = &mut turned[group];
            *torque += arm.cross(&self.r[place]);
            *tensor += (DMat3::identity() * arm.norm_squared() - arm * arm.transpose()) * inertia[place];
        }
        turned.iter_mut().for_each(|(_, tensor)| *tensor += DMat3::identity() * (NOTHING * tensor.trace()));
        for hold in self.holds(stage) {
            let sides = stage.contacts[hold.contact].sides();
            let arm =
                sides.fold(DVec3::zeros(), |sum, (place, weight)| sum + (x[place] - middles[hold.group]) * weight);
            for way in hold.ways() {
                let lever = arm.cross(way);
                turned[hold.group].1 += lever * lever.transpose();
            }
        }
        let turn = |(torque, tensor): &(DVec3, DMat3)| {
            let angle = tensor.cholesky()?.solve(torque);
            angle.iter().all(|x| x.is_finite()).then(|| Turn::by(angle))
        };
        let turns: Vec<Option<Turn>> = turned.iter().map(turn).collect();
        for (group, place) in members() {
            if let Some(turn) = &turns[group] {
                x[place] = middles[group] + turn.apply(x[place] - middles[group]);
            }
        }
    }
}
