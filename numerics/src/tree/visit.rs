//! Which blocks a region of space meets.

use super::{Block, Boxes, LANES, MOST_LEVELS, NONE, TriangleTree};
use crate::vector::Vec3;

/// A region of space that finds which boxes it meets.
pub trait Region {
    /// A bit for each lane whose box meets the region; extra bits are allowed, except for unused lanes. For use in kernels
    /// it must be `#[inline(always)]` and without closures.
    fn meeting(&self, boxes: &Boxes) -> u16;
}

/// A box, its faces included; it may be a point or a segment along an axis. One with a NaN coordinate meets nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// The least of each coordinate.
    pub low: Vec3,
    /// The largest of each coordinate.
    pub high: Vec3,
}

impl Region for Cuboid {
    #[inline(always)]
    fn meeting(&self, boxes: &Boxes) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            let mut meets = true;
            for axis in 0..3 {
                meets &= boxes.low[axis].0[lane] <= self.high[axis];
                meets &= boxes.high[axis].0[lane] >= self.low[axis];
            }
            mask |= u16::from(meets) << lane;
        }
        mask
    }
}

impl TriangleTree {
    /// The indices in [`TriangleTree::blocks`] of all blocks that have a triangle whose box meets `region`, ascending, each
    /// with a bit for each lane of such a triangle.
    ///
    /// In a kernel use this rather than a visit with a closure: closures are not compiled for the kernel's path.
    #[inline(always)]
    pub fn walk<R: Region>(&self, region: R) -> Walk<'_, R> {
        let top = self.levels.len();
        let mut walk = Walk { tree: self, region, open: [0; MOST_LEVELS], lanes: [0; MOST_LEVELS], level: top };
        if top > 0 {
            walk.level = top - 1;
            walk.lanes[walk.level] = walk.region.meeting(&self.levels[walk.level][0]);
        }
        walk
    }

    /// Calls `visit` with each block that has a triangle whose box meets `low`…`high` (ends included),
    /// in the order of [`TriangleTree::blocks`], and with a bit for each lane of such a triangle.
    #[inline(always)]
    pub fn visit_box<'t>(&'t self, low: Vec3, high: Vec3, mut visit: impl FnMut(&'t Block, u16)) {
        for (block, lanes) in self.walk(Cuboid { low, high }) {
            visit(&self.blocks[block], lanes);
        }
    }
}

/// See [`TriangleTree::walk`].
pub struct Walk<'a, R> {
    tree: &'a TriangleTree,
    region: R,
    /// At each level the current box, and its lanes still to be visited.
    open: [usize; MOST_LEVELS],
    lanes: [u16; MOST_LEVELS],
    /// The current level; above the last one at the end.
    level: usize,
}

impl<R> Walk<'_, R> {
    /// The region, which may shrink during the walk.
    #[inline(always)]
    pub fn region(&mut self) -> &mut R {
        &mut self.region
    }
}

impl<R: Region> Iterator for Walk<'_, R> {
    type Item = (usize, u16);

    #[inline(always)]
    fn next(&mut self) -> Option<(usize, u16)> {
        while self.level < self.tree.levels.len() {
            let lanes = self.lanes[self.level];
            if lanes == 0 {
                self.level += 1;
                continue;
            }
            let child = self.open[self.level] * LANES + lanes.trailing_zeros() as usize;
            self.lanes[self.level] = lanes & (lanes - 1);
            // A region without end meets the empty boxes of unused lanes too, and these have no children.
            if self.level > 0 {
                if let Some(boxes) = self.tree.levels[self.level - 1].get(child) {
                    self.level -= 1;
                    self.open[self.level] = child;
                    self.lanes[self.level] = self.region.meeting(boxes);
                }
                continue;
            }
            let Some(block) = self.tree.blocks.get(child) else { continue };
            let lanes = self.region.meeting(&block.boxes());
            if lanes != 0 && lanes & block.filled() != 0 {
                return Some((child, lanes & block.filled()));
            }
        }
        None
    }
}

impl Block {
    /// A bit for each lane that has a triangle.
    #[inline(always)]
    pub fn filled(&self) -> u16 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u16::from(self.triangle[lane] != NONE) << lane;
        }
        mask
    }
}
