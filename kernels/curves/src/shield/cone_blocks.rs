//! The blocks of triangles around some cones.
//!
//! The cones of sixteen CVs that are close to each other meet nearly the same blocks. These are found once, and put side by side
//! so that each cone tests sixteen of them at once.

use super::Obstacle;
use super::cone::{DistanceWeight, meeting_cones};
use super::facing::Facings;
use super::views::View;
use numerics::lanes::{F32x16, LANES, set};
use numerics::tree::{Boxes, Region};
use numerics::vector::Vec3;

/// Number of blocks above which cones are looked at one by one: they may be far apart.
const MOST_SHARED: usize = 128;

/// Blocks in the order of the tree.
#[derive(Default)]
pub(super) struct ConeBlocks {
    groups: Vec<Group>,
    count: usize,
    /// Whether there are more.
    cut_short: bool,
}

/// Up to sixteen blocks.
pub(super) struct Group {
    /// Those of lanes without a block are empty.
    pub(super) boxes: Boxes,
    pub(super) facings: Facings,
    /// Their indices.
    pub(super) blocks: [u32; LANES],
}

impl Group {
    #[inline(always)]
    fn empty() -> Self {
        let boxes = Boxes { low: [F32x16::splat(f32::INFINITY); 3], high: [F32x16::splat(f32::NEG_INFINITY); 3] };
        Self { boxes, facings: Facings::unknown(), blocks: [0; LANES] }
    }
}

impl ConeBlocks {
    /// Replaces them by those that cones of this slope upwind of `views` may meet; not by all if there are several cones and
    /// too many blocks.
    #[inline(always)]
    pub(super) fn gather<W: DistanceWeight>(&mut self, obstacle: &Obstacle, views: &[View], slope: f32, fade: W) {
        self.groups.clear();
        (self.count, self.cut_short) = (0, false);
        let Some(edges) = &obstacle.edges else { return };
        for (block, _) in obstacle.tree.walk(Cones::of(views, slope, fade)) {
            if self.count == MOST_SHARED && views.len() > 1 {
                self.cut_short = true;
                return;
            }
            let lane = self.count % LANES;
            if lane == 0 {
                self.groups.push(Group::empty());
            }
            let (group, facing) = (self.count / LANES, edges.facing(block));
            let group = &mut self.groups[group];
            set(&mut group.boxes.low, lane, facing.box_low);
            set(&mut group.boxes.high, lane, facing.box_high);
            group.facings.set(lane, facing);
            group.blocks[lane] = block as u32;
            self.count += 1;
        }
    }

    /// Whether they are all that the cones may meet.
    #[inline(always)]
    pub(super) fn are_all(&self) -> bool {
        !self.cut_short
    }

    #[inline(always)]
    pub(super) fn groups(&self) -> &[Group] {
        &self.groups
    }
}

/// The space around cones whose tips lie in a box.
struct Cones {
    low: Vec3,
    high: Vec3,
    slope: f32,
    farthest: f32,
}

impl Cones {
    #[inline(always)]
    fn of<W: DistanceWeight>(views: &[View], slope: f32, fade: W) -> Self {
        let mut cones = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3], slope, farthest: 0.0 };
        for view in views {
            for axis in 0..3 {
                let x = view.at[axis];
                cones.low[axis] = if x < cones.low[axis] { x } else { cones.low[axis] };
                cones.high[axis] = if x > cones.high[axis] { x } else { cones.high[axis] };
            }
            let farthest = fade.farthest(view.reach);
            cones.farthest = if farthest > cones.farthest { farthest } else { cones.farthest };
        }
        cones
    }
}

impl Region for Cones {
    /// Each number is rounded as for one cone, so that nothing which that meets is missed.
    #[inline(always)]
    fn meeting(&self, boxes: &Boxes) -> u16 {
        meeting_cones(boxes, [self.low, self.high], self.slope, self.farthest)
    }
}
