//! Predicted positions, the initial guess of a stage's first Newton iteration.
//!
//! Each piece is extrapolated as a rigid body, and the deformation within it, in the rotating frame, by its velocity
//! and acceleration. A stiff spinning body then starts without strain, which leaves little for the linear solve. The
//! prediction affects only the initial guess, not the equations.

use super::body::SoftBody;
use numerics::quad::Quad;
use numerics::rotation::CayleyRotation;
use numerics::vector::{DMat3, DVec3};
use std::ops::Range;

/// Moments of inertia below this fraction of the trace are treated as zero.
const NEGLIGIBLE: f64 = 1e-9;

/// Rigid motion of a piece.
#[derive(Clone, Debug, Default)]
pub(super) struct RigidMotion {
    pub(super) particles: Range<usize>,
    centroid: DVec3,
    linear_velocity: DVec3,
    /// Angular velocity, radians a second.
    angular_velocity: DVec3,
    /// Acceleration, m/s².
    acceleration: DVec3,
    /// Kinetic energy of rotation, joules.
    energy: f64,
    /// 1 ÷ mass, and the inverse of the tensor of inertia; 0 if it is held.
    inverse_mass: f64,
    inverse_inertia: DMat3,
}

impl RigidMotion {
    /// The rigid motion with the momenta of the `particles` of a piece, by positions, velocities and accelerations; at rest if
    /// some of them are `held`.
    pub(super) fn new(body: &SoftBody, held: &[bool], particles: Range<usize>, motion: [&[DVec3]; 3]) -> Self {
        let still = Self { particles: particles.clone(), ..Self::default() };
        if held[particles.clone()].contains(&true) {
            return still;
        }
        let mass = body.mass_of(particles.clone());
        let [centroid, linear_velocity, acceleration] =
            motion.map(|values| body.mean_by_mass(particles.clone(), values));
        let (mut turning, mut tensor) = (DVec3::zeros(), DMat3::zeros());
        for particle in particles.clone() {
            let (offset, m) = (motion[0][particle] - centroid, body.mass[particle]);
            turning += offset.cross(&(motion[1][particle] - linear_velocity)) * m;
            tensor += (DMat3::identity() * offset.norm_squared() - offset * offset.transpose()) * m;
        }
        tensor += DMat3::identity() * (NEGLIGIBLE * tensor.trace());
        match tensor.try_inverse().map(|inverse| (inverse, inverse * turning)) {
            Some((inverse_inertia, angular_velocity))
                if angular_velocity.iter().chain(&centroid).chain(&linear_velocity).all(|x| x.is_finite()) =>
            {
                Self {
                    particles,
                    centroid,
                    linear_velocity,
                    angular_velocity,
                    acceleration,
                    energy: 0.5 * angular_velocity.dot(&turning),
                    inverse_mass: 1.0 / mass,
                    inverse_inertia,
                }
            }
            _ => still,
        }
    }

    /// The same without rotation, which impulses do not cause either.
    pub(super) fn without_rotation(self) -> Self {
        Self { angular_velocity: DVec3::zeros(), inverse_inertia: DMat3::zeros(), ..self }
    }

    /// With accelerations given as velocities, the force and the torque ÷ radius of gyration that cause them, newtons.
    pub(super) fn force(&self, body: &SoftBody) -> f64 {
        let mass = body.mass_of(self.particles.clone());
        (mass * (mass * self.linear_velocity.norm_squared() + 2.0 * self.energy)).sqrt()
    }

    /// The force, and the torque ÷ radius of gyration, that are the sum of forces `r` on its particles at `x`; 0 if it is held.
    pub(super) fn force_left(&self, x: &[DVec3], r: &[Quad]) -> f64 {
        let (mut force, mut torque) = (Quad::default(), Quad::default());
        let centroid = Quad::new(self.centroid);
        for (x, r) in x[self.particles.clone()].iter().zip(&r[self.particles.clone()]) {
            force += *r;
            torque += (Quad::new(*x) - centroid).cross(*r);
        }
        let (force, torque) = (force.xyz(), torque.xyz());
        if self.inverse_mass > 0.0 {
            (force.norm_squared() + torque.dot(&(self.inverse_inertia * torque)) / self.inverse_mass).sqrt()
        } else {
            0.0
        }
    }

    /// Speed along `normal` that an impulse of 1 N·s along it at `point` gives that point, 1/kg.
    pub(super) fn mobility(&self, point: DVec3, normal: DVec3) -> f64 {
        let arm = (point - self.centroid).cross(&normal);
        self.inverse_mass + arm.dot(&(self.inverse_inertia * arm))
    }

    /// The change of its motion by an `impulse` at `point`, N·s.
    pub(super) fn pushed(&self, point: DVec3, impulse: DVec3) -> Self {
        Self {
            linear_velocity: impulse * self.inverse_mass,
            angular_velocity: self.inverse_inertia * (point - self.centroid).cross(&impulse),
            ..self.clone()
        }
    }

    /// Velocity at position `x`.
    pub(super) fn velocity(&self, x: DVec3) -> DVec3 {
        self.linear_velocity + self.angular_velocity.cross(&(x - self.centroid))
    }
}

/// Extrapolation of all pieces from given positions.
#[derive(Clone, Debug)]
pub(super) struct Predictor<'a> {
    body: &'a SoftBody,
    pieces: Vec<RigidMotion>,
    x: &'a [DVec3],
    v: &'a [DVec3],
    acceleration: &'a [DVec3],
    /// Length of the step over which `acceleration` was measured, seconds.
    before: f64,
}

impl<'a> Predictor<'a> {
    /// From positions, velocities and the accelerations measured over the last step of `before` seconds. Pieces with
    /// `loose` particles are not treated as rigid.
    pub(super) fn new(body: &'a SoftBody, loose: &[bool], motion: [&'a [DVec3]; 3], before: f64) -> Self {
        let pieces = body.pieces().map(|piece| RigidMotion::new(body, loose, piece, motion)).collect();
        let [x, v, acceleration] = motion;
        Self { body, pieces, x, v, acceleration, before }
    }

    /// Kinetic energy of rotation of each piece, joules.
    pub(super) fn rotational_energy(&self) -> Vec<f64> {
        self.pieces.iter().map(|piece| piece.energy).collect()
    }

    /// Positions after `seconds`.
    pub(super) fn at(&self, seconds: f64) -> Vec<DVec3> {
        let each: Vec<[CayleyRotation; 2]> = self
            .pieces
            .iter()
            .map(|piece| [-0.5 * self.before, seconds].map(|after| CayleyRotation::by(piece.angular_velocity * after)))
            .collect();
        self.map(|index, particle| {
            let (piece, [back, turn]) = (&self.pieces[index], &each[index]);
            let offset = self.x[particle] - piece.centroid;
            let drift = self.v[particle] - piece.velocity(self.x[particle]);
            // Acceleration of the deformation half a step earlier: without the centripetal part.
            let bent = self.acceleration[particle]
                - piece.acceleration
                - piece.angular_velocity.cross(&piece.angular_velocity.cross(&back.apply(offset)));
            let own = offset + (drift + back.undo(bent) * (0.5 * seconds)) * seconds;
            piece.centroid + (piece.linear_velocity + piece.acceleration * (0.5 * seconds)) * seconds + turn.apply(own)
        })
    }

    /// Positions after `seconds`, given those at the fraction `share` of that time.
    pub(super) fn past(&self, seconds: f64, share: f64, middle: &[DVec3]) -> Vec<DVec3> {
        let early = share * seconds;
        // Parabola through both positions with the initial velocity, used for the centre and for the deformation.
        let on = |start: DVec3, velocity: DVec3, at: DVec3| {
            start + velocity * seconds + (at - start - velocity * early) / (share * share)
        };
        let whole = |piece: &RigidMotion| {
            let centre = if piece.angular_velocity == DVec3::zeros() {
                piece.centroid
            } else {
                self.body.mean_by_mass(piece.particles.clone(), middle)
            };
            let turns = [early, seconds].map(|after| CayleyRotation::by(piece.angular_velocity * after));
            (centre, on(piece.centroid, piece.linear_velocity, centre), turns)
        };
        let each: Vec<(DVec3, DVec3, [CayleyRotation; 2])> = self.pieces.iter().map(whole).collect();
        self.map(|index, particle| {
            let (piece, (centre, whole, [early_turn, turn])) = (&self.pieces[index], &each[index]);
            let offset = self.x[particle] - piece.centroid;
            let drift = self.v[particle] - piece.velocity(self.x[particle]);
            whole + turn.apply(on(offset, drift, early_turn.undo(middle[particle] - centre)))
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
