//! Predicted positions, the initial guess of a stage's first Newton iteration.
//!
//! Each piece is extrapolated as a rigid body, and the deformation within it, in the rotating frame, by its velocity
//! and acceleration. A stiff spinning body then starts without strain, which leaves little for the linear solve. The
//! prediction affects only the initial guess, not the equations.

use super::body::SoftBody;
use numerics::vector::{DMat3, DVec3};
use std::ops::Range;

/// Moments of inertia below this fraction of the trace are treated as zero.
const NEGLIGIBLE: f64 = 1e-9;

/// Rigid motion of a piece.
#[derive(Clone, Debug)]
pub(super) struct RigidMotion {
    pub(super) particles: Range<usize>,
    middle: DVec3,
    pace: DVec3,
    /// Angular velocity, radians a second.
    spin: DVec3,
    /// Acceleration, m/s².
    trend: DVec3,
    /// Kinetic energy of rotation, joules.
    energy: f64,
}

impl RigidMotion {
    /// The rigid motion with the momenta of a piece; at rest if it has particles that are `held`.
    pub(super) fn new(
        body: &SoftBody,
        held: &[bool],
        piece: &Range<usize>,
        x: &[DVec3],
        v: &[DVec3],
        trend: &[DVec3],
    ) -> Self {
        let particles = body.particles(piece);
        let [middle, pace, spin] = [DVec3::zeros(); 3];
        let still = Self { particles: particles.clone(), middle, pace, spin, trend: DVec3::zeros(), energy: 0.0 };
        if held[particles.clone()].contains(&true) {
            return still;
        }
        let mass: f64 = body.mass[particles.clone()].iter().sum();
        let mean = |values: &[DVec3]| {
            let each = particles.clone().zip(&values[particles.clone()]);
            each.map(|(particle, value)| value * body.mass[particle]).sum::<DVec3>() / mass
        };
        let [middle, pace, trend] = [mean(x), mean(v), mean(trend)];
        let (mut turning, mut tensor) = (DVec3::zeros(), DMat3::zeros());
        for particle in particles.clone() {
            let (offset, m) = (x[particle] - middle, body.mass[particle]);
            turning += offset.cross(&(v[particle] - pace)) * m;
            tensor += (DMat3::identity() * offset.norm_squared() - offset * offset.transpose()) * m;
        }
        tensor += DMat3::identity() * (NEGLIGIBLE * tensor.trace());
        match tensor.try_inverse().map(|inverse| inverse * turning) {
            Some(spin) if spin.iter().chain(&middle).chain(&pace).all(|x| x.is_finite()) => {
                Self { particles, middle, pace, spin, trend, energy: 0.5 * spin.dot(&turning) }
            }
            _ => still,
        }
    }

    /// Centre of mass at positions `x`.
    fn centre(&self, body: &SoftBody, x: &[DVec3]) -> DVec3 {
        let mass: f64 = body.mass[self.particles.clone()].iter().sum();
        self.particles.clone().map(|particle| x[particle] * body.mass[particle]).sum::<DVec3>() / mass
    }

    /// The same without rotation.
    pub(super) fn shift(self) -> Self {
        Self { spin: DVec3::zeros(), ..self }
    }

    /// Velocity at position `x`.
    pub(super) fn velocity(&self, x: DVec3) -> DVec3 {
        self.pace + self.spin.cross(&(x - self.middle))
    }
}

/// Extrapolation of all pieces from given positions.
#[derive(Clone, Debug)]
pub(super) struct Predictor<'a> {
    body: &'a SoftBody,
    pieces: Vec<RigidMotion>,
    x: &'a [DVec3],
    v: &'a [DVec3],
    trend: &'a [DVec3],
    /// Length of the step over which `trend` was measured, seconds.
    before: f64,
}

impl<'a> Predictor<'a> {
    /// From `x`, `v` and the acceleration `trend` measured over the last step of `before` seconds. Pieces with
    /// `loose` particles are not treated as rigid.
    pub(super) fn new(
        body: &'a SoftBody,
        loose: &[bool],
        x: &'a [DVec3],
        v: &'a [DVec3],
        trend: &'a [DVec3],
        before: f64,
    ) -> Self {
        let rigid = |piece: &Range<usize>| RigidMotion::new(body, loose, piece, x, v, trend);
        Self { body, pieces: body.order.pieces.iter().map(rigid).collect(), x, v, trend, before }
    }

    /// Kinetic energy of rotation of each piece, joules.
    pub(super) fn spinning(&self) -> Vec<f64> {
        self.pieces.iter().map(|piece| piece.energy).collect()
    }

    /// Positions after `seconds`.
    pub(super) fn at(&self, seconds: f64) -> Vec<DVec3> {
        let each: Vec<[CayleyRotation; 2]> = self
            .pieces
            .iter()
            .map(|p| [CayleyRotation::by(p.spin * (-0.5 * self.before)), CayleyRotation::by(p.spin * seconds)])
            .collect();
        self.map(|index, particle| {
            let (piece, [back, turn]) = (&self.pieces[index], &each[index]);
            let offset = self.x[particle] - piece.middle;
            let drift = self.v[particle] - piece.velocity(self.x[particle]);
            // Acceleration of the deformation half a step earlier: without the centripetal part.
            let bent = self.trend[particle] - piece.trend - piece.spin.cross(&piece.spin.cross(&back.apply(offset)));
            let own = offset + (drift + back.undo(bent) * (0.5 * seconds)) * seconds;
            piece.middle + (piece.pace + piece.trend * (0.5 * seconds)) * seconds + turn.apply(own)
        })
    }

    /// Positions after `seconds`, given those at the fraction `share` of that time.
    pub(super) fn past(&self, seconds: f64, share: f64, middle: &[DVec3]) -> Vec<DVec3> {
        let early = share * seconds;
        // Parabola through both positions with the initial velocity, used for the centre and for the deformation.
        let on = |start: DVec3, pace: DVec3, at: DVec3| {
            start + pace * seconds + (at - start - pace * early) / (share * share)
        };
        let whole = |piece: &RigidMotion| {
            let centre = if piece.spin == DVec3::zeros() { piece.middle } else { piece.centre(self.body, middle) };
            let turns = [CayleyRotation::by(piece.spin * early), CayleyRotation::by(piece.spin * seconds)];
            (centre, on(piece.middle, piece.pace, centre), turns)
        };
        let each: Vec<(DVec3, DVec3, [CayleyRotation; 2])> = self.pieces.iter().map(whole).collect();
        self.map(|index, particle| {
            let (piece, (centre, whole, [solve_lower, turn])) = (&self.pieces[index], &each[index]);
            let offset = self.x[particle] - piece.middle;
            let drift = self.v[particle] - piece.velocity(self.x[particle]);
            whole + turn.apply(on(offset, drift, solve_lower.undo(middle[particle] - centre)))
        })
    }

    /// Evaluates `of` for each particle and its piece.
    fn map(&self, of: impl Fn(usize, usize) -> DVec3 + Sync) -> Vec<DVec3> {
        let order = &self.body.order;
        let mut out = vec![DVec3::zeros(); self.x.len()];
        order.clusters.for_each(&mut out[..], |cluster, out: &mut [DVec3]| {
            let piece = order.pieces.partition_point(|piece| piece.end <= cluster);
            order.clusters.range(cluster).zip(out).for_each(|(particle, out)| *out = of(piece, particle));
        });
        out
    }
}

/// A rotation by the Cayley transform: exactly orthogonal and without trigonometric functions. Its angle is
/// 2·atan(|w|/2), equal to |w| up to third order.
#[derive(Clone, Copy, Debug)]
pub(super) struct CayleyRotation {
    half: DVec3,
    scale: f64,
}

impl CayleyRotation {
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
    fn a_rotation_preserves_length_and_has_an_inverse() {
        let turn = CayleyRotation::by(DVec3::new(0.3, -2.0, 1.0));
        let v = DVec3::new(1.0, 2.0, -3.0);
        assert!((turn.apply(v).norm() - v.norm()).abs() < 1e-14);
        assert!((turn.undo(turn.apply(v)) - v).norm() < 1e-14);
        // A quarter turn, 2·atan(1), about z.
        assert!((CayleyRotation::by(DVec3::z() * 2.0).apply(DVec3::x()) - DVec3::y()).norm() < 1e-15);
    }
}
