//! Which blocks a box meets.

use super::{Block, Boxes, LANES, MOST_LEVELS, TriangleTree};
use crate::vec3::Vec3;

impl Boxes {
    /// A bit for each lane whose box meets `low`…`high`, ends included.
    #[inline(always)]
    pub fn meeting(&self, low: Vec3, high: Vec3) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            let [x, y, z] =
                [0, 1, 2].map(|axis| (self.low[axis].0[lane] <= high[axis]) & (self.high[axis].0[lane] >= low[axis]));
            mask |= u16::from(x & y & z) << lane;
        }
        mask
    }
}

impl TriangleTree {
    /// Calls `visit` with each block that has a triangle whose box meets `low`…`high` (ends included),
    /// in the order of [`TriangleTree::blocks`], and with a bit for each lane of such a triangle. A
    /// box with a coordinate that is no number meets nothing.
    #[inline(always)]
    pub fn visit_box(&self, low: Vec3, high: Vec3, mut visit: impl FnMut(&Block, u16)) {
        self.any_in_box(low, high, |block, lanes| {
            visit(block, lanes);
            false
        });
    }

    /// As [`TriangleTree::visit_box`], until `found` says true; whether it did.
    #[inline(always)]
    pub fn any_in_box(&self, low: Vec3, high: Vec3, mut found: impl FnMut(&Block, u16) -> bool) -> bool {
        self.any_where(
            |boxes| boxes.meeting(low, high),
            |block| {
                let block = &self.blocks[block];
                let meeting = block.boxes().meeting(low, high) & block.filled();
                meeting != 0 && found(block, meeting)
            },
        )
    }

    /// Calls `found` with the place of each block that `enter` lets through, a bit a lane, at all levels
    /// of the tree, until it says true; whether it did. Blank lanes must not be let through.
    #[inline(always)]
    pub(crate) fn any_where(&self, mut enter: impl FnMut(&Boxes) -> u16, mut found: impl FnMut(usize) -> bool) -> bool {
        let Some(top) = self.levels.len().checked_sub(1) else { return false };
        // At each level: the box that is open, and its lanes still to be entered.
        let (mut open, mut lanes) = ([0; MOST_LEVELS], [0; MOST_LEVELS]);
        let mut level = top;
        lanes[top] = enter(&self.levels[top][0]);
        loop {
            if lanes[level] == 0 {
                if level == top {
                    return false;
                }
                level += 1;
                continue;
            }
            let child = open[level] * LANES + lanes[level].trailing_zeros() as usize;
            lanes[level] &= lanes[level] - 1;
            if level > 0 {
                level -= 1;
                open[level] = child;
                lanes[level] = enter(&self.levels[level][child]);
            } else if found(child) {
                return true;
            }
        }
    }
}

impl Block {
    /// A bit for each lane that has a triangle.
    #[inline(always)]
    pub fn filled(&self) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u16::from(self.triangle[lane] != super::NONE) << lane;
        }
        mask
    }
}
