//! The affine map that brings the held points of a piece nearest to where they belong.

use super::{Held, Pieces, target};
use nalgebra::Matrix3;

/// Of the trace of the held points' scatter: in directions thinner than this share's root, a fit follows the rest shape.
/// Squared coordinates keep 16 digits, so what is above is known to 4; what is taken off too little, the solve does.
const THIN: f64 = 1e-12;

/// An affine map.
pub(super) struct Affine {
    from: [f64; 3],
    to: [f64; 3],
    /// The linear part less the identity, row by row.
    stretch: [[f64; 3]; 3],
    rests: bool,
}

/// Sums over the held points of a piece.
#[derive(Clone, Default)]
struct Sums {
    count: f64,
    rest: [f64; 3],
    goal: [f64; 3],
    moved: bool,
    /// Rest · restᵀ, from the middles.
    scatter: [[f64; 3]; 3],
    /// (Goal − rest) · restᵀ, from the middles.
    change: [[f64; 3]; 3],
}

impl Affine {
    /// One a piece; none where nothing of it is held.
    pub(super) fn of_pieces(held: &Held<'_>, pieces: &Pieces) -> Vec<Option<Self>> {
        let mut sums = vec![Sums::default(); pieces.count];
        let held_points = || {
            let all = held.points.iter().enumerate();
            all.filter_map(|(point, rest)| Some((pieces.of_point[point] as usize, *rest, target(held, point)?)))
        };
        for (piece, rest, goal) in held_points() {
            let sums = &mut sums[piece];
            sums.count += 1.0;
            sums.moved |= rest != goal;
            for k in 0..3 {
                sums.rest[k] += f64::from(rest[k]);
                sums.goal[k] += f64::from(goal[k]);
            }
        }
        for sums in &mut sums {
            for k in 0..3 {
                sums.rest[k] /= sums.count;
                sums.goal[k] /= sums.count;
            }
        }
        for (piece, rest, goal) in held_points() {
            let sums = &mut sums[piece];
            let arm = [0, 1, 2].map(|k| f64::from(rest[k]) - sums.rest[k]);
            let goal = [0, 1, 2].map(|k| f64::from(goal[k]) - sums.goal[k]);
            for row in 0..3 {
                for column in 0..3 {
                    sums.scatter[row][column] += arm[row] * arm[column];
                    sums.change[row][column] += (goal[row] - arm[row]) * arm[column];
                }
            }
        }
        sums.into_iter().map(|sums| (sums.count > 0.0).then(|| Self::of(&sums))).collect()
    }

    fn of(sums: &Sums) -> Self {
        let trace = sums.scatter[0][0] + sums.scatter[1][1] + sums.scatter[2][2];
        let share = |rows: &[[f64; 3]; 3]| Matrix3::from_fn(|row, column| rows[row][column] / trace);
        let scatter = share(&sums.scatter) + Matrix3::identity() * THIN;
        let stretch = match scatter.try_inverse().filter(|_| trace > 0.0) {
            Some(inverse) => share(&sums.change) * inverse,
            None => Matrix3::zeros(),
        };
        let finite = stretch.iter().all(|x| x.is_finite());
        let stretch = [0, 1, 2].map(|row| [0, 1, 2].map(|k| if finite { stretch[(row, k)] } else { 0.0 }));
        Self { from: sums.rest, to: sums.goal, stretch, rests: !sums.moved }
    }

    /// Whether all held points are where they were at rest.
    pub(super) fn rests(&self) -> bool {
        self.rests
    }

    /// Where it brings a point.
    pub(super) fn map(&self, rest: [f32; 3]) -> [f64; 3] {
        let rest = rest.map(f64::from);
        if self.rests {
            return rest;
        }
        let arm = [0, 1, 2].map(|k| rest[k] - self.from[k]);
        [0, 1, 2].map(|k| {
            let [x, y, z] = self.stretch[k];
            self.to[k] + arm[k] + (x * arm[0] + y * arm[1] + z * arm[2])
        })
    }
}
