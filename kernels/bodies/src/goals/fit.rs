//! The affine map that brings the held points of a piece nearest to where they belong.

use super::{ConnectedPieces, HeldBody, target};
use numerics::vector::{DMat3, DVec3, Vec3, to_f64};

/// Of the trace of the held points' scatter: in directions thinner than this share's root, a fit follows the rest shape.
/// Squared coordinates keep 16 digits, so what is above is known to 4; what is taken off too little, the solve does.
const THIN: f64 = 1e-12;

/// An affine map.
pub(super) struct Affine {
    from: DVec3,
    to: DVec3,
    /// The linear part less the identity.
    stretch: DMat3,
    rests: bool,
}

/// Sums over the held points of a piece.
#[derive(Clone, Default)]
struct Sums {
    count: f64,
    rest: DVec3,
    goal: DVec3,
    moved: bool,
    /// Rest · restᵀ, from the middles.
    scatter: DMat3,
    /// (Goal − rest) · restᵀ, from the middles.
    change: DMat3,
}

impl Affine {
    /// One a piece; none where nothing of it is held.
    pub(super) fn of_pieces(held: &HeldBody<'_>, pieces: &ConnectedPieces) -> Vec<Option<Self>> {
        let mut sums = vec![Sums::default(); pieces.count];
        let held_points = || {
            let all = held.points.iter().enumerate();
            all.filter_map(|(point, rest)| Some((pieces.of_point[point] as usize, *rest, target(held, point)?)))
        };
        for (piece, rest, goal) in held_points() {
            let sums = &mut sums[piece];
            sums.count += 1.0;
            sums.moved |= rest != goal;
            sums.rest += to_f64(rest);
            sums.goal += to_f64(goal);
        }
        for sums in &mut sums {
            sums.rest /= sums.count;
            sums.goal /= sums.count;
        }
        for (piece, rest, goal) in held_points() {
            let sums = &mut sums[piece];
            let offset = to_f64(rest) - sums.rest;
            let goal = to_f64(goal) - sums.goal;
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

    /// Whether all held points are where they were at rest.
    pub(super) fn rests(&self) -> bool {
        self.rests
    }

    /// Where it brings a point.
    pub(super) fn map(&self, rest: Vec3) -> DVec3 {
        let rest = to_f64(rest);
        if self.rests {
            return rest;
        }
        let offset = rest - self.from;
        self.to + offset + self.stretch * offset
    }
}
