//! The affine map that best fits the motion of a piece's points that have targets.

use super::{ConnectedPieces, HeldBody};
use numerics::vector::{DMat3, DVec3, Vec3, to_f64};

/// Regularisation relative to the trace of the covariance: in directions that are thinner than its square root the
/// fit follows the rest shape. Squares have 16 digits, so anything thicker is known to 4; whatever the fit misses is
/// solved for.
const THIN: f64 = 1e-12;

/// An affine map.
pub(super) struct Affine {
    from: DVec3,
    to: DVec3,
    /// The linear part minus the identity.
    stretch: DMat3,
    rests: bool,
}

/// Sums over the points of a piece that have targets.
#[derive(Clone, Default)]
struct Sums {
    count: f64,
    rest: DVec3,
    goal: DVec3,
    moved: bool,
    /// Σ rest · restᵀ about the centroids.
    scatter: DMat3,
    /// Σ (goal − rest) · restᵀ about the centroids.
    change: DMat3,
}

impl Affine {
    /// One for each piece; `None` if none of the piece has a target.
    pub(super) fn of_pieces(held: &HeldBody<'_>, pieces: &ConnectedPieces) -> Vec<Option<Self>> {
        let mut sums = vec![Sums::default(); pieces.count];
        let targets = held.targets();
        for (point, rest, goal) in &targets {
            let sums = &mut sums[pieces.of_point[*point] as usize];
            sums.count += 1.0;
            sums.moved |= rest != goal;
            sums.rest += to_f64(*rest);
            sums.goal += to_f64(*goal);
        }
        for sums in &mut sums {
            sums.rest /= sums.count;
            sums.goal /= sums.count;
        }
        for (point, rest, goal) in &targets {
            let sums = &mut sums[pieces.of_point[*point] as usize];
            let offset = to_f64(*rest) - sums.rest;
            let goal = to_f64(*goal) - sums.goal;
            sums.scatter += offset * offset.transpose();
            sums.change += (goal - offset) * offset.transpose();
        }
        sums.into_iter().map(|sums| (sums.count > 0.0).then(|| Self::of(&sums))).collect()
    }

    fn of(sums: &Sums) -> Self {
        let trace = sums.scatter.trace();
        let scatter = sums.scatter / trace + DMat3::identity() * THIN;
        let stretch = match scatter.try_inverse().filter(|_| trace > 0.0) {
            Some(inverse) => sums.change / trace * inverse,
            None => DMat3::zeros(),
        };
        let finite = stretch.iter().all(|x| x.is_finite());
        let stretch = if finite { stretch } else { DMat3::zeros() };
        Self { from: sums.rest, to: sums.goal, stretch, rests: !sums.moved }
    }

    /// Whether all targets are the rest positions.
    pub(super) fn rests(&self) -> bool {
        self.rests
    }

    /// Image of a point.
    pub(super) fn map(&self, rest: Vec3) -> DVec3 {
        let rest = to_f64(rest);
        if self.rests {
            return rest;
        }
        let offset = rest - self.from;
        self.to + offset + self.stretch * offset
    }
}
