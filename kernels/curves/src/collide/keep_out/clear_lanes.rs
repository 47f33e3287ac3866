//! Which of sixteen curves stay in their half-spaces.
//!
//! In f32: what that may decide otherwise than f64 is within the margins, so that a curve is only left to the exact test.

use super::super::hair::SKIPPED_GAPS;
use super::super::half_space::{ROUNDING, SHELLS};
use super::super::kept_half_spaces::KeptHalfSpaces;
use super::LIFTED;
use numerics::lanes::{F32x16, LANES, Lanes};
use std::ops::Range;

/// Rounding of heights computed in f32, relative to the reach and the largest coordinate of the root.
const ROUNDING_F32: f32 = 1e-6;

/// 1 − the relative rounding of squares of distances.
const SQUARES_KEPT: f32 = 1.0 - 2e-6;

/// Up to sixteen curves, of which one CV after the other is added.
pub(crate) struct ClearLanes {
    root: Lanes<3>,
    up: Lanes<3>,
    /// Squares of the reaches of half-spaces and their rises, less and more by the rounding.
    squares: [F32x16; SHELLS],
    rises: [F32x16; SHELLS],
    /// Length at the start of a curve that is not tested, and the square of the distance from `root` up to which a curve that
    /// starts there has such a length.
    untested: f32,
    lifted: F32x16,
    /// Of the last CV: the height and the square of the distance from the root.
    height: F32x16,
    square: F32x16,
    /// 1 for each curve that has met nothing so far.
    clear: [u32; LANES],
}

impl ClearLanes {
    /// These curves, with the roots of their rest shapes on the skin as it is now; `gap` metres are kept from contacts.
    #[inline(always)]
    pub(in crate::collide) fn of(
        curves: Range<usize>,
        root: &Lanes<3>,
        half_spaces: &KeptHalfSpaces,
        gap: f64,
    ) -> Self {
        let zero = F32x16::splat(0.0);
        let (mut up, mut reaches, mut rises) = ([zero; 3], [zero; SHELLS], [zero; SHELLS]);
        let mut clear = [0; LANES];
        for lane in 0..curves.len() {
            let Some(half_space) = half_spaces.get(curves.start + lane) else { continue };
            clear[lane] = 1;
            for axis in 0..3 {
                up[axis].0[lane] = half_space.up[axis];
            }
            for shell in 0..SHELLS {
                reaches[shell].0[lane] = half_space.reaches[shell];
                rises[shell].0[lane] = half_space.rises[shell];
            }
        }
        // What is farther from its root than the farthest reach is not clear, whatever its rounding.
        let (mut slack, mut squares, mut lifted) = (zero, [zero; SHELLS], zero);
        for lane in 0..LANES {
            let [x, y, z] = [root[0].0[lane].abs(), root[1].0[lane].abs(), root[2].0[lane].abs()];
            let xy = if x > y { x } else { y };
            let scale = reaches[SHELLS - 1].0[lane] + if xy > z { xy } else { z };
            slack.0[lane] = (4.0 * ROUNDING as f32 + ROUNDING_F32) * scale;
            let near = (LIFTED * gap) as f32 - slack.0[lane];
            lifted.0[lane] = if near > 0.0 { near * near } else { 0.0 };
        }
        for shell in 0..SHELLS {
            for lane in 0..LANES {
                let room = reaches[shell].0[lane] - slack.0[lane];
                squares[shell].0[lane] = if room > 0.0 { room * room * SQUARES_KEPT } else { 0.0 };
                rises[shell].0[lane] += slack.0[lane];
            }
        }
        let untested = (SKIPPED_GAPS * gap) as f32;
        Self { root: *root, up, squares, rises, untested, lifted, height: zero, square: zero, clear }
    }

    /// Adds the CVs `k`, of which those before 0 and 1 have been added; curves without one repeat their last.
    #[inline(always)]
    pub(crate) fn add(&mut self, k: usize, before: &Lanes<3>, cv: &Lanes<3>) {
        if k == 1 {
            (self.height, self.square) = self.heights(&self.tested_starts(before, cv));
            self.check_finite();
        }
        let (height, square) = self.heights(cv);
        for lane in 0..LANES {
            let (a, b) = (self.height.0[lane], height.0[lane]);
            let lower = if a < b { a } else { b };
            let (c, d) = (self.square.0[lane], square.0[lane]);
            let farther = if c > d { c } else { d };
            let mut rise = f32::INFINITY;
            for shell in (0..SHELLS).rev() {
                rise = if farther < self.squares[shell].0[lane] { self.rises[shell].0[lane] } else { rise };
            }
            self.clear[lane] &= u32::from(lower > rise);
        }
        (self.height, self.square) = (height, square);
        self.check_finite();
    }

    /// A bit for each curve that is above all obstacles near it, but for the length at its start that is not tested. One
    /// with a coordinate that is NaN or infinite is not.
    #[inline(always)]
    pub(crate) fn mask(&self) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= (self.clear[lane] as u16) << lane;
        }
        mask
    }

    /// Comparisons with the next CV would overlook one that is not.
    #[inline(always)]
    fn check_finite(&mut self) {
        for lane in 0..LANES {
            let is_finite = (self.square.0[lane] < f32::INFINITY) & (self.height.0[lane].abs() < f32::INFINITY);
            self.clear[lane] &= u32::from(is_finite);
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
            let untested = if away.0[lane] < self.lifted.0[lane] { self.untested } else { 0.0 };
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
                let away = at[axis].0[lane] - self.root[axis].0[lane];
                height.0[lane] += self.up[axis].0[lane] * away;
                square.0[lane] += away * away;
            }
        }
        (height, square)
    }
}
