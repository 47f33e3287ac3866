//! Which of sixteen curves stay in their half-spaces.

use super::super::half_space::{HalfSpace, ROUNDING, SHELLS};
use numerics::lanes::{F64x16, LANES};
use numerics::vector::{DVec3, Vec3};

/// Up to sixteen curves: their half-spaces, roots and CVs.
pub(super) struct ClearLanes {
    up: [F64x16; 3],
    reaches: [F64x16; SHELLS],
    rises: [F64x16; SHELLS],
    root: [F64x16; 3],
    untested: F64x16,
    /// The first row of each curve, and the number of its CVs; 0 where there is no curve.
    first: [usize; LANES],
    cvs: [usize; LANES],
}

impl ClearLanes {
    /// No curves.
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self {
            up: [F64x16::ZERO; 3],
            reaches: [F64x16::ZERO; SHELLS],
            rises: [F64x16::ZERO; SHELLS],
            root: [F64x16::ZERO; 3],
            untested: F64x16::ZERO,
            first: [0; LANES],
            cvs: [0; LANES],
        }
    }

    /// Puts a curve of `cvs` CVs from row `first` on a lane, with its half-space, the root of its rest shape and the length
    /// at its start that is not tested.
    #[inline(always)]
    pub(super) fn put(
        &mut self,
        lane: usize,
        [first, cvs]: [usize; 2],
        half_space: &HalfSpace,
        root: &DVec3,
        untested: f64,
    ) {
        (self.first[lane], self.cvs[lane]) = (first, cvs);
        self.untested.0[lane] = untested;
        for axis in 0..3 {
            self.up[axis].0[lane] = f64::from(half_space.up[axis]);
            self.root[axis].0[lane] = root[axis];
        }
        for shell in 0..SHELLS {
            self.reaches[shell].0[lane] = f64::from(half_space.reaches[shell]);
            self.rises[shell].0[lane] = f64::from(half_space.rises[shell]);
        }
    }

    /// A bit for each curve of `points` that is above all obstacles near it, but for the length at its start that is not tested.
    /// One with a coordinate that is NaN or infinite is not.
    #[inline(always)]
    pub(super) fn clear(&self, points: &[Vec3]) -> u16 {
        let mut most = 0;
        for lane in 0..LANES {
            most = if self.cvs[lane] > most { self.cvs[lane] } else { most };
        }
        // What is farther from its root than the farthest reach is not clear, whatever its rounding.
        let mut slack = self.reaches[SHELLS - 1];
        for lane in 0..LANES {
            let [x, y, z] = [self.root[0].0[lane].abs(), self.root[1].0[lane].abs(), self.root[2].0[lane].abs()];
            let xy = if x > y { x } else { y };
            slack.0[lane] = 4.0 * ROUNDING * (slack.0[lane] + if xy > z { xy } else { z });
        }
        let mut squares = [F64x16::ZERO; SHELLS];
        for shell in 0..SHELLS {
            for lane in 0..LANES {
                let room = self.reaches[shell].0[lane] - slack.0[lane];
                squares[shell].0[lane] = if room > 0.0 { room * room } else { 0.0 };
            }
        }
        let mut first = [F64x16::ZERO; 3];
        self.read(points, 0, &mut first);
        let mut cv = first;
        self.read(points, 1, &mut cv);
        let start = self.tested_starts(&first, &cv);
        let (mut height, mut square) = self.heights(&start);
        let mut clear = [true; LANES];
        for k in 1..most {
            // Curves without a CV more keep their last one.
            self.read(points, k, &mut cv);
            let (next, next_square) = self.heights(&cv);
            for lane in 0..LANES {
                let lower = if height.0[lane] < next.0[lane] { height.0[lane] } else { next.0[lane] };
                let farther = if square.0[lane] > next_square.0[lane] { square.0[lane] } else { next_square.0[lane] };
                let mut rise = f64::INFINITY;
                for shell in (0..SHELLS).rev() {
                    rise = if farther < squares[shell].0[lane] { self.rises[shell].0[lane] } else { rise };
                }
                // Not if either is NaN or infinite.
                let is_finite = height.0[lane].abs() < f64::INFINITY && next.0[lane].abs() < f64::INFINITY;
                clear[lane] &= (lower > rise + slack.0[lane]) & is_finite;
            }
            (height, square) = (next, next_square);
        }
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u16::from(clear[lane] & (self.cvs[lane] >= 2)) << lane;
        }
        mask
    }

    /// Reads the CVs `k`; lanes without one keep theirs.
    #[inline(always)]
    fn read(&self, points: &[Vec3], k: usize, cv: &mut [F64x16; 3]) {
        for lane in 0..LANES {
            if k < self.cvs[lane] {
                let p = points[self.first[lane] + k];
                for axis in 0..3 {
                    cv[axis].0[lane] = f64::from(p[axis]);
                }
            }
        }
    }

    /// Where the tested parts of curves start; at their second CV if their first segments are not tested.
    #[inline(always)]
    fn tested_starts(&self, from: &[F64x16; 3], to: &[F64x16; 3]) -> [F64x16; 3] {
        let mut start = *to;
        for lane in 0..LANES {
            let along = DVec3::from_fn(|axis, _| to[axis].0[lane] - from[axis].0[lane]);
            let length = along.norm();
            let share = self.untested.0[lane] / length;
            for axis in 0..3 {
                let at = from[axis].0[lane] + along[axis] * share;
                start[axis].0[lane] = if length > self.untested.0[lane] { at } else { to[axis].0[lane] };
            }
        }
        start
    }

    /// Heights above the roots, and squares of the distances from them.
    #[inline(always)]
    fn heights(&self, at: &[F64x16; 3]) -> (F64x16, F64x16) {
        let (mut height, mut square) = (F64x16::ZERO, F64x16::ZERO);
        for axis in 0..3 {
            for lane in 0..LANES {
                let away = at[axis].0[lane] - self.root[axis].0[lane];
                height.0[lane] += self.up[axis].0[lane] * away;
                square.0[lane] += away * away;
            }
        }
        (height, square)
    }
}
