//! Where particles will be: what the first Newton iteration of a stage starts from.
//!
//! A piece is taken to go on as a rigid body, and within that, turned along, each particle as it went: velocity and trend
//! of the deformation. So a stiff body that spins starts from a shape without strain, and linear solves have little left
//! to do. A guess changes where Newton's method begins, not the equation.

use super::V3;
use super::body::Body;
use nalgebra::Matrix3;
use std::ops::Range;

/// Share of a piece's inertia below which it has none about an axis.
const NOTHING: f64 = 1e-9;

/// How a piece moves as a whole.
#[derive(Clone, Debug)]
pub(super) struct Rigid {
    pub(super) places: Range<usize>,
    middle: V3,
    pace: V3,
    /// Radians a second.
    spin: V3,
    /// m/s².
    trend: V3,
    /// Of its turning, joules.
    energy: f64,
}

impl Rigid {
    /// The rigid motion with the momenta of a piece; rest where it has `held` particles.
    pub(super) fn new(body: &Body, held: &[bool], piece: &Range<usize>, x: &[V3], v: &[V3], trend: &[V3]) -> Self {
        let places = body.places(piece);
        let [middle, pace, spin] = [V3::zeros(); 3];
        let still = Self { places: places.clone(), middle, pace, spin, trend: V3::zeros(), energy: 0.0 };
        if held[places.clone()].contains(&true) {
            return still;
        }
        let mass: f64 = body.mass[places.clone()].iter().sum();
        let mean = |values: &[V3]| {
            let each = places.clone().zip(&values[places.clone()]);
            each.map(|(place, value)| value * body.mass[place]).sum::<V3>() / mass
        };
        let [middle, pace, trend] = [mean(x), mean(v), mean(trend)];
        let (mut turning, mut tensor) = (V3::zeros(), Matrix3::zeros());
        for place in places.clone() {
            let (arm, m) = (x[place] - middle, body.mass[place]);
            turning += arm.cross(&(v[place] - pace)) * m;
            tensor += (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * m;
        }
        tensor += Matrix3::identity() * (NOTHING * tensor.trace());
        match tensor.try_inverse().map(|inverse| inverse * turning) {
            Some(spin) if spin.iter().chain(&middle).chain(&pace).all(|x| x.is_finite()) => {
                Self { places, middle, pace, spin, trend, energy: 0.5 * spin.dot(&turning) }
            }
            _ => still,
        }
    }

    /// Without its turning.
    pub(super) fn shift(self) -> Self {
        Self { spin: V3::zeros(), ..self }
    }

    /// The velocity it has at `x`.
    pub(super) fn velocity(&self, x: V3) -> V3 {
        self.pace + self.spin.cross(&(x - self.middle))
    }
}

/// The motion of all pieces from some positions on.
#[derive(Clone, Debug)]
pub(super) struct Guess<'a> {
    pieces: Vec<Rigid>,
    x: &'a [V3],
    v: &'a [V3],
    trend: &'a [V3],
    /// The step that `trend` was measured over.
    before: f64,
}

impl<'a> Guess<'a> {
    /// From `x`, `v` and the change of velocity in the step of `before` seconds that led there. Pieces with `held` particles
    /// are not rigid.
    pub(super) fn new(body: &Body, held: &[bool], x: &'a [V3], v: &'a [V3], trend: &'a [V3], before: f64) -> Self {
        let rigid = |piece: &Range<usize>| Rigid::new(body, held, piece, x, v, trend);
        Self { pieces: body.order.pieces.iter().map(rigid).collect(), x, v, trend, before }
    }

    /// The energy that turns pieces, joules.
    pub(super) fn spinning(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.energy).sum()
    }

    /// Positions after `seconds`.
    pub(super) fn at(&self, seconds: f64) -> Vec<V3> {
        let mut out = vec![V3::zeros(); self.x.len()];
        for piece in &self.pieces {
            let back = Turn::by(piece.spin * (-0.5 * self.before));
            let turn = Turn::by(piece.spin * seconds);
            for place in piece.places.clone() {
                let arm = self.x[place] - piece.middle;
                let drift = self.v[place] - piece.pace - piece.spin.cross(&arm);
                // The trend as it was half a step before, without what turning makes of it.
                let earlier = back.apply(arm);
                let bent = self.trend[place] - piece.trend - piece.spin.cross(&piece.spin.cross(&earlier));
                let bent = back.undo(bent);
                let own = arm + (drift + bent * (0.5 * seconds)) * seconds;
                out[place] = piece.middle + (piece.pace + piece.trend * (0.5 * seconds)) * seconds + turn.apply(own);
            }
        }
        out
    }

    /// Positions after `seconds`, given where particles were at `share` of that time.
    pub(super) fn past(&self, seconds: f64, share: f64, middle: &[V3], body: &Body) -> Vec<V3> {
        let mut out = vec![V3::zeros(); self.x.len()];
        let early = share * seconds;
        for piece in &self.pieces {
            let mass: f64 = piece.places.clone().map(|place| body.mass[place]).sum();
            let sum = |values: &[V3]| piece.places.clone().map(|place| values[place] * body.mass[place]).sum::<V3>();
            let centre = if piece.spin == V3::zeros() { piece.middle } else { sum(middle) / mass };
            // A parabola through both places and the first velocity; for the whole as for the deformation.
            let on = |start: V3, pace: V3, at: V3| start + pace * seconds + (at - start - pace * early) / (share * share);
            let (halfway, turn) = (Turn::by(piece.spin * early), Turn::by(piece.spin * seconds));
            let whole = on(piece.middle, piece.pace, centre);
            for place in piece.places.clone() {
                let arm = self.x[place] - piece.middle;
                let drift = self.v[place] - piece.pace - piece.spin.cross(&arm);
                let own = on(arm, drift, halfway.undo(middle[place] - centre));
                out[place] = whole + turn.apply(own);
            }
        }
        out
    }
}

/// A rotation by Cayley's transform: exact, without sines. By 2·atan(|w|/2), w to third order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    half: V3,
    scale: f64,
}

impl Turn {
    pub(super) fn by(w: V3) -> Self {
        let half = w * 0.5;
        Self { half, scale: 2.0 / (1.0 + half.norm_squared()) }
    }

    pub(super) fn apply(&self, v: V3) -> V3 {
        v + (self.half.cross(&v) + self.half.cross(&self.half.cross(&v))) * self.scale
    }

    pub(super) fn undo(&self, v: V3) -> V3 {
        v + (self.half.cross(&self.half.cross(&v)) - self.half.cross(&v)) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_keeps_lengths_and_is_undone() {
        let turn = Turn::by(V3::new(0.3, -2.0, 1.0));
        let v = V3::new(1.0, 2.0, -3.0);
        assert!((turn.apply(v).norm() - v.norm()).abs() < 1e-14);
        assert!((turn.undo(turn.apply(v)) - v).norm() < 1e-14);
        // A quarter turn: 2·atan(1) about z.
        assert!((Turn::by(V3::z() * 2.0).apply(V3::x()) - V3::y()).norm() < 1e-15);
    }
}
