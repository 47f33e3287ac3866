//! A half-space for each curve that no obstacle enters: segments well inside it are free without a query of the trees.
//!
//! Along a direction `up`, nothing near a curve is higher above its root than `rise`. A segment whose turn stays above
//! that by more than its gap meets nothing. Where the tests here say so, a sweep through the trees ends at the goal
//! with nothing met, so results keep their bits; `rise` has margins for the rounding of that sweep.

use super::Collide;
use super::segment_turn::Segment;
use numerics::lanes::{F32x16, LANES};
use numerics::tree::{Block, Boxes, Region};
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};

/// Rounding relative to the largest coordinate: of f32 positions and boxes 1e-7, of the plane of a turn, whose sine is at
/// least 1e-9, 2e-7.
pub(super) const ROUNDING: f64 = 5e-7;

/// Cosine of the angle between the facet under a root and the smooth normal up to which the facet's normal is taken. It
/// is preferred because the smooth one tilts: along it the root's own facet rises beside the root.
pub(super) const SAME_SIDE: f64 = 0.8;

/// 1 + the cosine of a turn close to half a turn, whose plane rounding decides.
const OPPOSITE: f64 = 0.01;

/// The half-space of a curve. The default one frees nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct HalfSpace {
    /// Its direction, at most of length 1.
    pub(super) up: Vec3,
    /// Distances from the root, metres, ascending; what is not known has a distance of 0.
    pub(super) reaches: [f32; SHELLS],
    /// The highest point of obstacles within each of these distances, above the root, metres. Segments near the root need
    /// to be above what is near it alone.
    pub(super) rises: [f32; SHELLS],
}

/// Number of distances: a curve of five CVs has a segment more within each.
pub(super) const SHELLS: usize = 4;

impl HalfSpace {
    /// The half-space of the curve `cvs`, displaced by `shift`, whose largest diameter is `width` metres
    /// and which keeps `gap` metres from contacts.
    #[inline(always)]
    pub(super) fn of(cvs: &[Vec3], shift: &DVec3, width: f64, gap: f64, how: &Collide<'_>) -> Self {
        let root = to_f64(cvs[0]) + shift;
        let length: f64 = cvs.windows(2).map(|ends| (to_f64(ends[1]) - to_f64(ends[0])).norm()).sum();
        // Segments of even length end a little within the distance of a shell.
        let reach_of = |shell: usize| {
            let share = if shell + 1 == SHELLS { 1.0 } else { 1.02 * (shell + 1) as f64 / SHELLS as f64 };
            1.001 * (share * length + gap) + 2.0 * width
        };
        let reach = reach_of(SHELLS - 1);
        let scale = f64::from(vector::largest(to_f32(root))) + reach;
        let slack = ROUNDING * scale;
        let Some((up, facet)) = how.skin.as_ref().and_then(|skin| skin.facet(&root, SAME_SIDE)) else {
            return Self::default();
        };
        // Shortened by more than the rounding to f32 may lengthen it.
        let up = to_f32(up * (1.0 - 1e-6));
        let mut above = Above {
            low: to_f32(root.map(|x| x - reach - 8.0 * slack)),
            high: to_f32(root.map(|x| x + reach + 8.0 * slack)),
            root: to_f32(root),
            up,
            rise: f64::NEG_INFINITY,
            below: f32::NEG_INFINITY,
            slack: slack as f32,
            reach: reach as f32,
        };
        above.add(&facet, &root);
        let mut reaches = [0.0; SHELLS];
        for shell in 0..SHELLS {
            reaches[shell] = (reach_of(shell) + 9.0 * slack) as f32;
        }
        let mut rises = [F32x16::splat(f32::NEG_INFINITY); SHELLS];
        for tree in how.obstacles {
            let mut walk = tree.walk(above);
            while let Some((block, _)) = walk.next() {
                walk.region().add_block(&tree.blocks()[block], &reaches, &mut rises);
            }
        }
        let mut known = Self { up, ..Self::default() };
        for shell in 0..SHELLS {
            for lane in 0..LANES {
                above.rise = above.rise.max(f64::from(rises[shell].0[lane]));
            }
            // No segment starts higher than the curve is long.
            if above.rise > length {
                return known;
            }
            known.reaches[shell] = reach_of(shell) as f32;
            known.rises[shell] = ((above.rise + slack) as f32).next_up();
        }
        known
    }

    /// The rise within the least known distance that is `needed` metres more than that of a point `away` from the root;
    /// infinite where none is.
    #[inline(always)]
    fn rise(&self, away: &DVec3, needed: f64) -> f64 {
        let square = away.norm_squared();
        for shell in 0..SHELLS {
            let room = f64::from(self.reaches[shell]) - needed;
            if room > 0.0 && square <= room * room {
                return f64::from(self.rises[shell]);
            }
        }
        f64::INFINITY
    }

    /// Whether a segment between two points, of a curve with this root, is above all obstacles near it.
    #[inline(always)]
    pub(super) fn clears(&self, root: &DVec3, [from, to]: [&DVec3; 2], rounding: f64) -> bool {
        let (up, from, to) = (to_f64(self.up), from - root, to - root);
        let farther = if from.norm_squared() > to.norm_squared() { from } else { to };
        up.dot(&from).min(up.dot(&to)) > self.rise(&farther, 4.0 * rounding) + 4.0 * rounding
    }

    /// Whether a curve with this root is above all obstacles near it, but for `untested` metres at its start. One with
    /// a coordinate that is NaN or infinite is not. Kernels test sixteen at a time.
    #[cfg(test)]
    pub(super) fn clears_curve(&self, root: &DVec3, cvs: &[Vec3], untested: f64) -> bool {
        let up = to_f64(self.up);
        let mut largest = 0.0_f32;
        for cv in cvs {
            largest = largest.max(vector::largest(*cv));
        }
        let slack = 4.0 * ROUNDING * f64::from(largest);
        let mut squares = [0.0; SHELLS];
        for shell in 0..SHELLS {
            let room = (f64::from(self.reaches[shell]) - slack).max(0.0);
            squares[shell] = room * room;
        }
        let (start, first) = (to_f64(cvs[0]), to_f64(cvs[1]) - to_f64(cvs[0]));
        let length = first.norm();
        // The first segment is not tested if it is no longer than that.
        let is_tested = length > untested;
        let start = if is_tested { start + first * (untested / length) - root } else { to_f64(cvs[1]) - root };
        let (mut height, mut square) = (up.dot(&start), start.norm_squared());
        for cv in &cvs[if is_tested { 1 } else { 2 }..] {
            let away = to_f64(*cv) - root;
            let (next, next_square) = (up.dot(&away), away.norm_squared());
            let (lower, farther) = (height.min(next), square.max(next_square));
            let mut rise = f64::INFINITY;
            for shell in (0..SHELLS).rev() {
                if farther < squares[shell] {
                    rise = f64::from(self.rises[shell]);
                }
            }
            // Not if either is NaN.
            if !(lower > rise + slack && height.is_finite() && next.is_finite()) {
                return false;
            }
            (height, square) = (next, next_square);
        }
        true
    }

    /// Whether a segment of this length and no thickness from `pivot`, of a curve with this root, meets nothing however it
    /// turns: whatever [`HalfSpace::frees`] would be told of its directions, it would find nothing within `gap`.
    #[inline(always)]
    pub(super) fn frees_any_turn(&self, root: &DVec3, pivot: &DVec3, [length, gap, rounding]: [f64; 3]) -> bool {
        let away = pivot - root;
        let rise = self.rise(&away, length + gap + 4.0 * rounding);
        rise < f64::INFINITY && to_f64(self.up).dot(&away) - rise - rounding - length > gap
    }

    /// Whether the turn of a segment, of a curve with this root, meets nothing: it stays above all obstacles by more
    /// than their distance to be kept.
    #[inline(always)]
    pub(super) fn frees(&self, root: &DVec3, segment: &Segment<'_>) -> bool {
        let Segment { pivot, from, to, length, half, gap, rounding, .. } = segment;
        let away = pivot - root;
        let rise = self.rise(&away, length + gap + 3.0 * half + 4.0 * rounding);
        let (up, facing) = (to_f64(self.up), 1.0 + from.dot(to));
        if rise == f64::INFINITY || !facing.is_finite() || facing < OPPOSITE {
            return false;
        }
        // Height of the pivot above everything, and a lower bound of the slopes of the turn: that of an end if both
        // rise, else that of the middle of a turn between two ends as low as the lower one.
        let height = up.dot(&away) - rise - rounding;
        let slope = from.dot(&up).min(to.dot(&up));
        let lowest = if slope < 0.0 { (slope * (2.0 / facing).sqrt()).max(-1.0) } else { slope };
        // A point at radius r whose height differs by d lies an arc of at least d from the segment's.
        if height + length * lowest.min(0.0) - 3.0 * half > *gap {
            return true;
        }
        // An obstacle at radius r has a slope of −height/r at most, so it lies an arc of r·lowest + height away, and r
        // is at least `height`.
        *half == 0.0 && lowest > 0.0 && height > 8.0 * rounding && lowest * height > 1.0001 * gap - height
    }
}

/// What is in a box and above the highest point found so far.
#[derive(Clone, Copy)]
struct Above {
    low: Vec3,
    high: Vec3,
    root: Vec3,
    up: Vec3,
    /// Height above the root of the highest point, metres.
    rise: f64,
    /// The same, rounded.
    below: f32,
    /// Rounding of heights here.
    slack: f32,
    reach: f32,
}

impl Region for Above {
    #[inline(always)]
    fn meeting(&self, boxes: &Boxes) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            let mut meets = true;
            let (mut height, mut size) = (self.slack, 0.0_f32);
            for axis in 0..3 {
                let (low, high) = (boxes.low[axis].0[lane], boxes.high[axis].0[lane]);
                meets &= (low <= self.high[axis]) & (high >= self.low[axis]);
                let along = (if self.up[axis] >= 0.0 { high } else { low }) - self.root[axis];
                height += along * self.up[axis];
                size += (low - self.root[axis]).abs() + (high - self.root[axis]).abs();
            }
            // Overflow meets.
            let below = height + 1e-6 * size + 2e-14 * size * (size / self.reach) < self.below;
            mask |= u16::from(meets & !below) << lane;
        }
        mask
    }
}

impl Above {
    /// Adds the heights of a block's triangles to the `rises` within distances from the root, one a lane.
    #[inline(always)]
    fn add_block(&self, block: &Block, reaches: &[f32; SHELLS], rises: &mut [F32x16; SHELLS]) {
        let boxes = block.boxes();
        let mut away = F32x16::splat(f32::NEG_INFINITY);
        for axis in 0..3 {
            let root = self.root[axis];
            for lane in 0..LANES {
                let (before, after) = (boxes.low[axis].0[lane] - root, root - boxes.high[axis].0[lane]);
                let most = if before > after { before } else { after };
                away.0[lane] = if most > away.0[lane] { most } else { away.0[lane] };
            }
        }
        let mut heights = F32x16::splat(f32::NEG_INFINITY);
        for corner in &block.corners {
            for lane in 0..LANES {
                let x = corner[0].0[lane] - self.root[0];
                let y = corner[1].0[lane] - self.root[1];
                let z = corner[2].0[lane] - self.root[2];
                let size = x.abs() + y.abs() + z.abs();
                // Five roundings to f32; its intersection with a circle of radius `reach` is computed in f64 to the square
                // of its size.
                let doubt = 3e-7 * size + 2e-14 * size * (size / self.reach);
                let height = self.up[0] * x + self.up[1] * y + self.up[2] * z + doubt;
                heights.0[lane] = if height > heights.0[lane] { height } else { heights.0[lane] };
            }
        }
        for shell in 0..SHELLS {
            for lane in 0..LANES {
                let within = away.0[lane] <= reaches[shell] && heights.0[lane] > rises[shell].0[lane];
                rises[shell].0[lane] = if within { heights.0[lane] } else { rises[shell].0[lane] };
            }
        }
    }

    /// Adds a triangle. Its intersection with a circle of radius `reach` is computed in f64 to the square of its size.
    #[inline(always)]
    fn add(&mut self, corners: &[DVec3; 3], root: &DVec3) {
        let up = to_f64(self.up);
        for corner in corners {
            let away = corner - root;
            let size = away.x.abs() + away.y.abs() + away.z.abs();
            let height = up.dot(&away) + 1e-14 * size * (1.0 + size / f64::from(self.reach));
            self.rise = self.rise.max(height);
        }
        self.below = self.rise as f32;
    }
}

#[cfg(test)]
mod tests;
