//! How high bodies bounce: impacts are followed from the first contact to the last, and leave at most a given share of
//! the speed of approach.
//!
//! A body is slowed when it loses contact, not while it is pressed, so that it recovers its shape first. Only its motion
//! as a whole is slowed: what vibrates or rotates goes on. Two bodies are slowed by opposite impulses where they were in
//! contact, so that momenta are conserved. Either takes energy, never adds any.

use super::coarse::Layout;
use super::contact::ContactConstraint;
use super::predictor::RigidMotion;
use super::step::{Interval, Kinematics, Stepper};
use numerics::vector::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Stands for obstacles as the second of two things in contact.
const OBSTACLES: usize = usize::MAX;

/// A piece in contact with obstacles or with another piece.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Impact {
    /// The pieces, the lower one first; the second may be [`OBSTACLES`].
    pieces: [usize; 2],
    /// The highest speed at which they approached each other as wholes or where they touch, and the one at which they
    /// were already leaving when they met, m/s.
    approach: f64,
    leaving: f64,
    touch: Touch,
    /// Seconds since they were last in contact. What vibrates loses contact for short times, so that an impact is over
    /// only after a frame without.
    apart: f64,
}

/// Where two things are in contact: means over their contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Touch {
    /// Towards the first piece.
    normal: [f64; 3],
    point: [f64; 3],
    /// Velocity of obstacles there, m/s.
    velocity: [f64; 3],
}

impl Touch {
    /// The closed ones of `contacts` at `x`, by pieces.
    fn all(contacts: &[ContactConstraint], x: &[DVec3], layout: &Layout) -> BTreeMap<[usize; 2], Self> {
        // Sums of normals, points, velocities, and of the depths that weigh them.
        let mut sums: BTreeMap<[usize; 2], ([DVec3; 3], f64)> = BTreeMap::new();
        for contact in contacts {
            let depth = -contact.clearance(x, 0.0);
            if depth.is_nan() || depth <= 0.0 {
                continue;
            }
            let [first, second] = contact.surfaces().map(|particles| particles.first());
            let Some(first) = first else { continue };
            let piece_of = |particle: &u32| layout.piece_of(*particle as usize);
            let pieces = [piece_of(first), second.map_or(OBSTACLES, piece_of)];
            if pieces[0] == pieces[1] {
                continue;
            }
            let turned = pieces[0] > pieces[1];
            let key = if turned { [pieces[1], pieces[0]] } else { pieces };
            let of_first = contact.sides().take(contact.surfaces()[0].len());
            let point: DVec3 = of_first.map(|(particle, weight)| x[particle] * weight).sum();
            let (sum, weight) = sums.entry(key).or_default();
            sum[0] += contact.normal * if turned { -depth } else { depth };
            sum[1] += point * depth;
            sum[2] += contact.velocity * depth;
            *weight += depth;
        }
        let mean = |(key, ([normal, point, velocity], weight)): (_, ([DVec3; 3], f64))| {
            let normal = normal.try_normalize(0.0)?;
            let touch =
                Self { normal: normal.into(), point: (point / weight).into(), velocity: (velocity / weight).into() };
            (touch.point.iter().chain(&touch.velocity).all(|x| x.is_finite())).then_some((key, touch))
        };
        sums.into_iter().filter_map(mean).collect()
    }

    /// The speed at which a point of the first piece leaves the second.
    fn speed(&self, pieces: &[RigidMotion]) -> f64 {
        let of = |piece: &RigidMotion| DVec3::from(self.normal).dot(&piece.velocity(self.point.into()));
        match pieces {
            [first, second] => of(first) - of(second),
            [first] => of(first) - self.obstacle_speed(),
            _ => 0.0,
        }
    }

    fn obstacle_speed(&self) -> f64 {
        DVec3::from(self.normal).dot(&DVec3::from(self.velocity))
    }
}

impl Stepper<'_> {
    /// Follows impacts through a step, and slows what lost contact in it if it leaves faster than
    /// `bounce` × its speed of approach. Returns the work that moving obstacles do by that, joules, if anything was slowed.
    pub(super) fn limit_bounce(
        &mut self,
        bounce: f64,
        contacts: &[ContactConstraint],
        Interval { start, h, .. }: Interval<'_>,
        motion: &mut Kinematics,
    ) -> Option<f64> {
        let mut now = Touch::all(contacts, &motion.x, &self.context.body.layout);
        let known = std::mem::take(&mut motion.carried.impacts);
        let mut work: Option<f64> = None;
        for mut impact in known {
            if let Some(touch) = now.remove(&impact.pieces) {
                (impact.touch, impact.apart) = (touch, 0.0);
                impact.approach = impact.approach.max(self.approach(&touch, &impact.pieces, start));
            } else {
                if impact.apart == 0.0
                    && let Some(more) = self.slow(bounce, &impact, motion)
                {
                    *work.get_or_insert(0.0) += more;
                }
                impact.apart += h;
            }
            if impact.apart <= self.seconds {
                motion.carried.impacts.push(impact);
            }
        }
        for (pieces, touch) in now {
            let approach = self.approach(&touch, &pieces, start).max(0.0);
            let leaving = touch.speed(&self.rigid(&pieces, start)).max(0.0);
            motion.carried.impacts.push(Impact { pieces, approach, leaving, touch, apart: 0.0 });
        }
        motion.carried.impacts.sort_unstable_by_key(|impact| impact.pieces);
        work
    }

    /// The motion of one piece as a whole, or of two as rigid bodies.
    fn rigid(&self, pieces: &[usize; 2], motion: &Kinematics) -> Vec<RigidMotion> {
        let [first, second] = pieces.map(|piece| self.rotating(piece, motion));
        match second {
            Some(_) => first.into_iter().chain(second).collect(),
            None => first.into_iter().map(RigidMotion::without_rotation).collect(),
        }
    }

    fn rotating(&self, piece: usize, motion: &Kinematics) -> Option<RigidMotion> {
        let (body, held) = (self.context.body, &self.context.external.held);
        Some(RigidMotion::new(body, held, body.pieces().nth(piece)?, [&motion.x, &motion.v, &motion.v]))
    }

    /// The speed at which pieces approach each other, as wholes or where they touch.
    fn approach(&self, touch: &Touch, pieces: &[usize; 2], motion: &Kinematics) -> f64 {
        let rotating: Vec<RigidMotion> = pieces.iter().filter_map(|piece| self.rotating(*piece, motion)).collect();
        (-touch.speed(&rotating)).max(-touch.speed(&self.rigid(pieces, motion)))
    }

    /// Slows pieces that lost contact; returns the work of obstacles if they leave too fast.
    fn slow(&self, bounce: f64, impact: &Impact, motion: &mut Kinematics) -> Option<f64> {
        let (pieces, touch) = (self.rigid(&impact.pieces, motion), impact.touch);
        let (normal, point) = (DVec3::from(touch.normal), DVec3::from(touch.point));
        let mobility: f64 = pieces.iter().map(|piece| piece.mobility(point, normal)).sum();
        let mut target = (bounce * impact.approach).max(impact.leaving);
        if pieces.len() == 1 {
            // An obstacle that recedes does not pull.
            target = target.max(-touch.obstacle_speed());
        }
        let excess = touch.speed(&pieces) - target;
        if !(excess > 0.0 && mobility > 0.0) {
            return None;
        }
        for (piece, sign) in pieces.iter().zip([-1.0, 1.0]) {
            let change = piece.pushed(point, normal * (sign * excess / mobility));
            for particle in piece.particles.clone() {
                motion.v[particle] += change.velocity(motion.x[particle]);
            }
        }
        let obstacle = if pieces.len() == 1 { touch.obstacle_speed() } else { 0.0 };
        Some(-excess / mobility * obstacle)
    }
}
