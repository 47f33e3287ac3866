//! Rotations: by the Cayley transform, and the one that best fits two sets of points.

use crate::vector::{DMat3, DVec3};
use nalgebra::Matrix4;

/// A rotation by the Cayley transform: exactly orthogonal and without trigonometric functions. Its angle is
/// 2·atan(|w|/2), equal to |w| up to third order.
#[derive(Clone, Copy, Debug)]
pub struct CayleyRotation {
    half: DVec3,
    scale: f64,
}

impl CayleyRotation {
    /// By the vector `w`: its direction is the axis, its length about the angle, radians.
    pub fn by(w: DVec3) -> Self {
        let half = w * 0.5;
        Self { half, scale: 2.0 / (1.0 + half.norm_squared()) }
    }

    /// The rotated vector.
    #[inline]
    pub fn apply(&self, v: DVec3) -> DVec3 {
        v + (self.half.cross(&v) + self.half.cross(&self.half.cross(&v))) * self.scale
    }

    /// The vector that is rotated to `v`.
    #[inline]
    pub fn undo(&self, v: DVec3) -> DVec3 {
        v + (self.half.cross(&self.half.cross(&v)) - self.half.cross(&v)) * self.scale
    }
}

/// Quaternion (cosine first) of the rotation that best maps the first points of a covariance Σ a bᵀ to the second:
/// the dominant eigenvector of Horn's matrix, by Jacobi rotations. The identity if it fits as well as any other.
pub fn best_rotation(spread: &DMat3) -> [f64; 4] {
    /// Preference for the identity, as a fraction of the covariance: above the rounding of degenerate point sets.
    const CALM: f64 = 1e-13;
    /// Number of Jacobi sweeps, which converge quadratically.
    const SWEEPS: usize = 12;
    let s = spread;
    let (xx, yy, zz) = (s[(0, 0)], s[(1, 1)], s[(2, 2)]);
    let (yz, zx, xy) = (s[(1, 2)] - s[(2, 1)], s[(2, 0)] - s[(0, 2)], s[(0, 1)] - s[(1, 0)]);
    let (pyz, pzx, pxy) = (s[(1, 2)] + s[(2, 1)], s[(2, 0)] + s[(0, 2)], s[(0, 1)] + s[(1, 0)]);
    let mut m = Matrix4::new(
        xx + yy + zz + CALM * s.norm(),
        yz,
        zx,
        xy,
        yz,
        xx - yy - zz,
        pxy,
        pzx,
        zx,
        pxy,
        yy - xx - zz,
        pyz,
        xy,
        pzx,
        pyz,
        zz - xx - yy,
    );
    let mut vectors = Matrix4::identity();
    for _ in 0..SWEEPS {
        for p in 0..3 {
            for q in p + 1..4 {
                if m[(p, q)] == 0.0 {
                    continue;
                }
                let theta = (m[(q, q)] - m[(p, p)]) / (2.0 * m[(p, q)]);
                let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let sine = tangent * cosine;
                for k in 0..4 {
                    let (a, b) = (m[(k, p)], m[(k, q)]);
                    (m[(k, p)], m[(k, q)]) = (cosine * a - sine * b, sine * a + cosine * b);
                }
                for k in 0..4 {
                    let (a, b) = (m[(p, k)], m[(q, k)]);
                    (m[(p, k)], m[(q, k)]) = (cosine * a - sine * b, sine * a + cosine * b);
                }
                for k in 0..4 {
                    let (a, b) = (vectors[(k, p)], vectors[(k, q)]);
                    (vectors[(k, p)], vectors[(k, q)]) = (cosine * a - sine * b, sine * a + cosine * b);
                }
            }
        }
    }
    let best = (1..4).fold(0, |best, k| if m[(k, k)] > m[(best, best)] { k } else { best });
    let quaternion: [f64; 4] = [0, 1, 2, 3].map(|k| vectors[(k, best)]);
    if quaternion.iter().all(|x| x.is_finite()) { quaternion } else { [1.0, 0.0, 0.0, 0.0] }
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
