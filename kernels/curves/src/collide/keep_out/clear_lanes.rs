//! Which of sixteen curves stay in their half-spaces.
//!
//! In f32: what that may decide otherwise than f64 is within the margins, so that a curve is only left to the exact test.

use super::super::hair::SKIPPED_GAPS;
use super::super::half_space::{HalfSpace, ROUNDING, SHELLS};
use super::LIFTED;
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::vector;

/// Rounding of heights computed in f32, relative to the reach and the largest coordinate of the root.
const ROUNDING_F32: f32 = 1e-6;

/// 1 − the relative rounding of squares of distances.
const SQUARES_KEPT: f32 = 1.0 - 2e-6;

/// What sixteen curves need to stay above, as long as skin and roots do not move.
#[derive(Debug)]
pub(in crate::collide) struct ClearBounds {
    /// The roots of the rest shapes on the skin.
    root: Lanes<3>,
    up: Lanes<3>,
    /// Squares of the reaches of half-spaces and their rises, less and more by the rounding.
    squares: [F32x16; SHELLS],
    rises: [F32x16; SHELLS],
    /// Square of the distance from `root` up to which a curve that starts there is not tested at its start.
    lifted: F32x16,
    /// 1 for each curve that there is, else 0.
    curves: F32x16,
}

impl ClearBounds {
    /// Of up to sixteen curves with these half-spaces; `gap` metres are kept from contacts.
    pub(in crate::collide) fn of(root: Lanes<3>, half_spaces: &[HalfSpace], gap: f64) -> Self {
        let zero = F32x16::splat(0.0);
        let (mut up, mut squares, mut rises) = ([zero; 3], [zero; SHELLS], [zero; SHELLS]);
        let (mut lifted, mut curves) = (zero, zero);
        for (lane, half_space) in half_spaces.iter().enumerate() {
            curves.0[lane] = 1.0;
            set(&mut up, lane, half_space.up);
            // What is farther from its root than the farthest reach is not clear, whatever its rounding.
            let scale = half_space.reaches[SHELLS - 1] + vector::largest(get(&root, lane));
            let slack = (4.0 * ROUNDING as f32 + ROUNDING_F32) * scale;
            let near = (LIFTED * gap) as f32 - slack;
            lifted.0[lane] = if near > 0.0 { near * near } else { 0.0 };
            for shell in 0..SHELLS {
                let room = half_space.reaches[shell] - slack;
                squares[shell].0[lane] = if room > 0.0 { room * room * SQUARES_KEPT } else { 0.0 };
                rises[shell].0[lane] = half_space.rises[shell] + slack;
            }
        }
        Self { root, up, squares, rises, lifted, curves }
    }
}

/// Up to sixteen curves, of which one CV after the other is added.
pub(crate) struct ClearLanes<'a> {
    bounds: &'a ClearBounds,
    /// Length at the start of a curve that is not tested.
    untested: f32,
    /// Of the last CV: the height and the square of the distance from the root.
    height: F32x16,
    square: F32x16,
    /// 1 for each curve that has met nothing so far, else 0. Not whole numbers, whose selection by comparisons of `f32` the
    /// compiler leaves scalar.
    clear: F32x16,
    /// For each segment a bit for each curve on which it is below something near; the last for all further segments too.
    below: [u16; SEGMENT_BITS],
}

/// Number of segments of a curve that are told apart.
const SEGMENT_BITS: usize = u32::BITS as usize;

/// The bit of a curve's segment `k`; the last is that of all further segments too.
#[inline(always)]
pub(in crate::collide) fn segment_bit(k: usize) -> usize {
    if k < SEGMENT_BITS - 1 { k } else { SEGMENT_BITS - 1 }
}

impl<'a> ClearLanes<'a> {
    /// Curves with these bounds; `gap` metres are kept from contacts.
    #[inline(always)]
    pub(in crate::collide) fn of(bounds: &'a ClearBounds, gap: f64) -> Self {
        let zero = F32x16::splat(0.0);
        let (untested, below) = ((SKIPPED_GAPS * gap) as f32, [0; SEGMENT_BITS]);
        Self { bounds, untested, height: zero, square: zero, clear: bounds.curves, below }
    }

    /// Adds the CVs `k`, of which those before 0 and 1 have been added; curves without one repeat their last.
    #[inline(always)]
    pub(crate) fn add(&mut self, k: usize, before: &Lanes<3>, cv: &Lanes<3>) {
        if k == 1 {
            (self.height, self.square) = self.heights(&self.tested_starts(before, cv));
            self.check_finite();
        }
        let (height, square) = self.heights(cv);
        // A loop over the lanes for each shell, not the other way round, which the compiler leaves scalar.
        let (lower, farther) = (self.height.least(&height), self.square.most(&square));
        let mut rise = F32x16::splat(f32::INFINITY);
        for shell in (0..SHELLS).rev() {
            let mut lowest = self.bounds.rises[shell];
            for lane in 0..LANES {
                let is_near = farther.0[lane] < self.bounds.squares[shell].0[lane];
                lowest.0[lane] = if is_near { lowest.0[lane] } else { rise.0[lane] };
            }
            rise = lowest;
        }
        let mut above = 0;
        for lane in 0..LANES {
            let is_above = lower.0[lane] > rise.0[lane];
            self.clear.0[lane] = if is_above { self.clear.0[lane] } else { 0.0 };
            above |= u16::from(is_above) << lane;
        }
        self.below[segment_bit(k - 1)] |= !above;
        (self.height, self.square) = (height, square);
        self.check_finite();
    }

    /// A bit for each curve that is above all obstacles near it, but for the length at its start that is not tested. One
    /// with a coordinate that is NaN or infinite is not.
    #[inline(always)]
    pub(crate) fn mask(&self) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u16::from(self.clear.0[lane] > 0.0) << lane;
        }
        mask
    }

    /// Of a curve of so many CVs, not one of [`Self::mask`], a bit for each segment that is not above all obstacles
    /// near it, but for the length at its start that is not tested; the last of them for all further segments too. All bits
    /// if there is none, as of a curve with a coordinate that is NaN or infinite.
    #[inline(always)]
    pub(crate) fn segments_below(&self, lane: usize, cvs: usize) -> u32 {
        let mut bits = 0;
        for k in 0..SEGMENT_BITS {
            if k + 1 < cvs {
                bits |= u32::from(self.below[k] >> lane & 1) << k;
            }
        }
        if bits == 0 { u32::MAX } else { bits }
    }

    /// Comparisons with the next CV would overlook one that is not.
    #[inline(always)]
    fn check_finite(&mut self) {
        for lane in 0..LANES {
            self.clear.0[lane] = if self.square.0[lane] < f32::INFINITY { self.clear.0[lane] } else { 0.0 };
        }
        for lane in 0..LANES {
            self.clear.0[lane] = if self.height.0[lane].abs() < f32::INFINITY { self.clear.0[lane] } else { 0.0 };
        }
    }

    /// Where the tested parts of curves start; at their second CV if their first segments are not tested.
    #[inline(always)]
    fn tested_starts(&self, from: &Lanes<3>, to: &Lanes<3>) -> Lanes<3> {
        let mut start = *to;
        let (_, away) = self.heights(from);
        for lane in 0..LANES {
            let mut along = [0.0; 3];
            let mut square = 0.0;
            for axis in 0..3 {
                along[axis] = to[axis].0[lane] - from[axis].0[lane];
                square += along[axis] * along[axis];
            }
            let length = square.sqrt();
            let untested = if away.0[lane] < self.bounds.lifted.0[lane] { self.untested } else { 0.0 };
            let share = if length > untested { untested / length } else { 1.0 };
            for axis in 0..3 {
                start[axis].0[lane] = from[axis].0[lane] + along[axis] * share;
            }
        }
        start
    }

    /// Heights above the roots, and squares of the distances from them.
    #[inline(always)]
    fn heights(&self, at: &Lanes<3>) -> (F32x16, F32x16) {
        let (mut height, mut square) = (F32x16::splat(0.0), F32x16::splat(0.0));
        for axis in 0..3 {
            for lane in 0..LANES {
                let away = at[axis].0[lane] - self.bounds.root[axis].0[lane];
                height.0[lane] += self.bounds.up[axis].0[lane] * away;
                square.0[lane] += away * away;
            }
        }
        (height, square)
    }
}
