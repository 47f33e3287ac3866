//! Where particles will be: what the first Newton iteration of a stage starts from.
//!
//! A piece is taken to go on as a rigid body, and within that, turned along, each particle as it went: velocity and trend
//! of the deformation. So a stiff body that spins starts from a shape without strain, and linear solves have little left
//! to do. A guess changes where Newton's method begins, not the equation.

use super::body::Body;
use numerics::vector::{DMat3, DVec3};
use std::ops::Range;

/// Share of a piece's inertia below which it has none about an axis.
const NOTHING: f64 = 1e-9;

/// How a piece moves as a whole.
#[derive(Clone, Debug)]
pub(super) struct Rigid {
    pub(super) places: Range<usize>,
    middle: DVec3,
    pace: DVec3,
    /// Radians a second.
    spin: DVec3,
    /// m/s².
    trend: DVec3,
    /// Of its turning, joules.
    energy: f64,
}

impl Rigid {
    /// The rigid motion with the momenta of a piece; rest where it has `held` particles.
    pub(super) fn new(
        body: &Body,
        held: &[bool],
        piece: &Range<usize>,
        x: &[DVec3],
        v: &[DVec3],
        trend: &[DVec3],
    ) -> Self {
        let places = body.places(piece);
        let [middle, pace, spin] = [DVec3::zeros(); 3];
        let still = Self { places: places.clone(), middle, pace, spin, trend: DVec3::zeros(), energy: 0.0 };
        if held[places.clone()].contains(&true) {
            return still;
        }
        let mass: f64 = body.mass[places.clone()].iter().sum();
        let mean = |values: &[DVec3]| {
            let each = places.clone().zip(&values[places.clone()]);
            each.map(|(place, value)| value * body.mass[place]).sum::<DVec3>() / mass
        };
        let [middle, pace, trend] = [mean(x), mean(v), mean(trend)];
        let (mut turning, mut tensor) = (DVec3::zeros(), DMat3::zeros());
        for place in places.clone() {
            let (arm, m) = (x[place] - middle, body.mass[place]);
            turning += arm.cross(&(v[place] - pace)) * m;
            tensor += (DMat3::identity() * arm.norm_squared() - arm * arm.transpose()) * m;
        }
        tensor += DMat3::identity() * (NOTHING * tensor.trace());
        match tensor.try_inverse().map(|inverse| inverse * turning) {
            Some(spin) if spin.iter().chain(&middle).chain(&pace).all(|x| x.is_finite()) => {
                Self { places, middle, pace, spin, trend, energy: 0.5 * spin.dot(&turning) }
            }
            _ => still,
        }
    }

    /// The mean of its particles' places by mass.
    fn centre(&self, body: &Body, x: &[DVec3]) -> DVec3 {
        let mass: f64 = body.mass[self.places.clone()].iter().sum();
        self.places.clone().map(|place| x[place] * body.mass[place]).sum::<DVec3>() / mass
    }

    /// Without its turning.
    pub(super) fn shift(self) -> Self {
        Self { spin: DVec3::zeros(), ..self }
    }

    /// The velocity it has at `x`.
    pub(super) fn velocity(&self, x: DVec3) -> DVec3 {
        self.pace + self.spin.cross(&(x - self.middle))
    }
}

/// The motion of all pieces from some positions on.
#[derive(Clone, Debug)]
pub(super) struct Guess<'a> {
    body: &'a Body,
    pieces: Vec<Rigid>,
    x: &'a [DVec3],
    v: &'a [DVec3],
    trend: &'a [DVec3],
    /// The step that `trend` was measured over.
    before: f64,
}

impl<'a> Guess<'a> {
    /// From `x`, `v` and the change of velocity in the step of `before` seconds that led there. Pieces with `loose` particles
    /// are not rigid.
    pub(super) fn new(
        body: &'a Body,
        loose: &[bool],
        x: &'a [DVec3],
        v: &'a [DVec3],
        trend: &'a [DVec3],
        before: f64,
    ) -> Self {
        let rigid = |piece: &Range<usize>| Rigid::new(body, loose, piece, x, v, trend);
        Self { body, pieces: body.order.pieces.iter().map(rigid).collect(), x, v, trend, before }
    }

    /// The energy that turns each piece, joules.
    pub(super) fn spinning(&self) -> Vec<f64> {
        self.pieces.iter().map(|piece| piece.energy).collect()
    }

    /// Positions after `seconds`.
    pub(super) fn at(&self, seconds: f64) -> Vec<DVec3> {
        let each: Vec<[Turn; 2]> =
            self.pieces.iter().map(|p| [Turn::by(p.spin * (-0.5 * self.before)), Turn::by(p.spin * seconds)]).collect();
        self.map(|index, place| {
            let (piece, [back, turn]) = (&self.pieces[index], &each[index]);
            let arm = self.x[place] - piece.middle;
            let drift = self.v[place] - piece.velocity(self.x[place]);
            // The trend as it was half a step before, without what turning makes of it.
            let bent = self.trend[place] - piece.trend - piece.spin.cross(&piece.spin.cross(&back.apply(arm)));
            let own = arm + (drift + back.undo(bent) * (0.5 * seconds)) * seconds;
            piece.middle + (piece.pace + piece.trend * (0.5 * seconds)) * seconds + turn.apply(own)
        })
    }

    /// Positions after `seconds`, given where particles were at `share` of that time.
    pub(super) fn past(&self, seconds: f64, share: f64, middle: &[DVec3]) -> Vec<DVec3> {
        let early = share * seconds;
        // A parabola through both places and the first velocity; for the whole as for the deformation.
        let on = |start: DVec3, pace: DVec3, at: DVec3| {
            start + pace * seconds + (at - start - pace * early) / (share * share)
        };
        let whole = |piece: &Rigid| {
            let centre = if piece.spin == DVec3::zeros() { piece.middle } else { piece.centre(self.body, middle) };
            let turns = [Turn::by(piece.spin * early), Turn::by(piece.spin * seconds)];
            (centre, on(piece.middle, piece.pace, centre), turns)
        };
        let each: Vec<(DVec3, DVec3, [Turn; 2])> = self.pieces.iter().map(whole).collect();
        self.map(|index, place| {
            let (piece, (centre, whole, [halfway, turn])) = (&self.pieces[index], &each[index]);
            let arm = self.x[place] - piece.middle;
            let drift = self.v[place] - piece.velocity(self.x[place]);
            whole + turn.apply(on(arm, drift, halfway.undo(middle[place] - centre)))
        })
    }

    /// What `of` gives for each particle and its piece.
    fn map(&self, of: impl Fn(usize, usize) -> DVec3 + Sync) -> Vec<DVec3> {
        let order = &self.body.order;
        let mut out = vec![DVec3::zeros(); self.x.len()];
        order.clusters.each(&mut out[..], |cluster, out: &mut [DVec3]| {
            let piece = order.pieces.partition_point(|piece| piece.end <= cluster);
            order.clusters.range(cluster).zip(out).for_each(|(place, out)| *out = of(piece, place));
        });
        out
    }
}

/// A rotation by Cayley's transform: exact, without sines. By 2·atan(|w|/2), w to third order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    half: DVec3,
    scale: f64,
}

impl Turn {
    pub(super) fn by(w: DVec3) -> Self {
        let half = w * 0.5;
        Self { half, scale: 2.0 / (1.0 + half.norm_squared()) }
    }

    pub(super) fn apply(&self, v: DVec3) -> DVec3 {
        v + (self.half.cross(&v) + self.half.cross(&self.half.cross(&v))) * self.scale
    }

    pub(super) fn undo(&self, v: DVec3) -> DVec3 {
        v + (self.half.cross(&self.half.cross(&v)) - self.half.cross(&v)) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_keeps_lengths_and_is_undone() {
        let turn = Turn::by(DVec3::new(0.3, -2.0, 1.0));
        let v = DVec3::new(1.0, 2.0, -3.0);
        assert!((turn.apply(v).norm() - v.norm()).abs() < 1e-14);
        assert!((turn.undo(turn.apply(v)) - v).norm() < 1e-14);
        // A quarter turn: 2·atan(1) about z.
        assert!((Turn::by(DVec3::z() * 2.0).apply(DVec3::x()) - DVec3::y()).norm() < 1e-15);
    }
}
