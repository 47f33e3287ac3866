//! A 16-wide bounding volume hierarchy over triangles, built once and refitted when points move.
//!
//! Triangles are split at medians down to groups of sixteen, each a [`Block`]; sixteen blocks are the lanes of one
//! [`Boxes`], sixteen of those the lanes of the next, so no pointers are needed: the children of box n are 16n…16n+15 one
//! level down, and all boxes but the last of a level are full.
//!
//! Promise: the same tree on any number of threads, and the same bits from queries on every SIMD path; a query misses no
//! triangle whose box it meets. Queries are inlined, so inside a `kernel!` they use its vectors; iterate blocks by
//! [`TriangleTree::walk`] there. Triangles without area are kept as segments or points; a triangle with a corner that is
//! not finite is left out until a refit makes it finite. Limit: [`TriangleTree::closest`] computes fourth powers of
//! lengths in f32, so edges and distances should lie between 1e-9 and 1e9.

mod closest;
mod split;
mod visit;

use crate::lanes::{F32x16, LANES, Lanes, get, set};
use crate::parallel;
use crate::simd::{Path, kernel};
use crate::vector::Vec3;
pub use closest::Closest;
use std::sync::Arc;
pub use visit::{Cuboid, Region, Walk};

/// The index of a lane that holds no triangle.
pub const NONE: u32 = u32::MAX;

/// Sixteen triangles side by side, by corner and axis; an unused lane repeats the block's first triangle with index
/// [`NONE`].
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The corners, in metres.
    pub corners: [Lanes<3>; 3],
    /// Index of each lane's triangle, ascending.
    pub triangle: [u32; LANES],
}

/// Sixteen boxes side by side; an unused lane is an empty box (low +inf, high −inf), which meets nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Boxes {
    /// The least of each coordinate.
    pub low: Lanes<3>,
    /// The largest of each coordinate.
    pub high: Lanes<3>,
}

const EMPTY_LOW: Vec3 = [f32::INFINITY; 3];
const EMPTY_HIGH: Vec3 = [f32::NEG_INFINITY; 3];

/// Levels of boxes that 2³² triangles need.
const MOST_LEVELS: usize = 8;

/// Blocks or boxes that a task refits at least: some 20 µs of work.
const TASK: usize = 64;

/// The tree. A default one is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleTree {
    /// Points and index of the triangle of each lane of each block; shared by trees of the same triangles.
    members: Arc<Vec<Member>>,
    blocks: Vec<Block>,
    /// `levels[0]` has a lane a block, every other level a lane for each box of the previous one; the last has one box.
    levels: Vec<Vec<Boxes>>,
}

/// An input triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Member {
    points: [u32; 3],
    triangle: u32,
}

impl Member {
    #[inline(always)]
    fn corners(&self, points: &[Vec3]) -> [Vec3; 3] {
        let [a, b, c] = self.points;
        [points[a as usize], points[b as usize], points[c as usize]]
    }
}

impl TriangleTree {
    /// The tree over `triangles`, each three indices of `points` (metres).
    ///
    /// # Panics
    /// Where an index is out of range, or there are 2³² triangles.
    pub fn build(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let order = split::order(points, triangles);
        let member = |&triangle: &u32| Member { points: triangles[triangle as usize], triangle };
        let mut tree = Self { members: Arc::new(order.iter().map(member).collect()), ..Self::default() };
        tree.refit(points);
        tree
    }

    /// A tree over the same triangles, in the same order, at the positions `points`.
    ///
    /// # Panics
    /// As [`TriangleTree::refit`].
    #[must_use]
    pub fn moved(&self, points: &[Vec3]) -> Self {
        let mut tree = Self { members: self.members.clone(), ..Self::default() };
        tree.refit(points);
        tree
    }

    /// Moves the triangles to the positions `points`; their order in the tree stays.
    ///
    /// # Panics
    /// Where there are fewer points than the tree was built on.
    pub fn refit(&mut self, points: &[Vec3]) {
        let path = Path::chosen();
        self.blocks.resize(self.members.len().div_ceil(LANES), Block::empty());
        refill(&mut self.blocks, &self.members, |blocks, members| refit_blocks(path, points, members, blocks));
        let mut level = 0;
        let mut rows = self.blocks.len();
        while rows > 1 || (level == 0 && rows > 0) {
            if self.levels.len() == level {
                self.levels.push(Vec::new());
            }
            let (below, above) = self.levels.split_at_mut(level);
            above[0].resize(rows.div_ceil(LANES), Boxes::empty());
            match below.last() {
                None => refill(&mut above[0], &self.blocks, |boxes, blocks| around_blocks(path, blocks, boxes)),
                Some(below) => refill(&mut above[0], below, |boxes, below| around_boxes(path, below, boxes)),
            }
            rows = above[0].len();
            level += 1;
        }
    }

    /// Whether it has no triangle, or none that is finite.
    pub fn is_empty(&self) -> bool {
        self.bounds().0[0] == f32::INFINITY
    }

    /// Lowest and highest corner of all; +inf and −inf where it is empty.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.levels.last().map_or((EMPTY_LOW, EMPTY_HIGH), |top| top[0].bounds())
    }

    /// All blocks. A block may have no triangle, where all of its triangles are left out.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Triangles left out because a corner is not finite.
    pub fn left_out(&self) -> usize {
        let here = |block: &Block| block.triangle.iter().filter(|triangle| **triangle != NONE).count();
        self.members.len() - self.blocks.iter().map(here).sum::<usize>()
    }
}

/// Sets elements, some in each piece of work, to what `fill` makes of those below them, sixteen for each.
fn refill<T: Send, U: Sync>(elements: &mut [T], below: &[U], fill: impl Fn(&mut [T], &[U]) + Sync) {
    parallel::for_each(elements.chunks_mut(TASK).zip(below.chunks(TASK * LANES)), |_, (elements, below)| {
        fill(elements, below);
    });
}

kernel! {
    /// The blocks of `members`.
    fn refit_blocks(points: &[Vec3], members: &[Member], blocks: &mut [Block]) = refit_blocks_body;
}

#[inline(always)]
fn refit_blocks_body(points: &[Vec3], members: &[Member], blocks: &mut [Block]) {
    for (block, members) in blocks.iter_mut().zip(members.chunks(LANES)) {
        block.set(points, members);
    }
}

kernel! {
    /// The boxes around blocks.
    fn around_blocks(blocks: &[Block], boxes: &mut [Boxes]) = around_blocks_body;
}

#[inline(always)]
fn around_blocks_body(blocks: &[Block], boxes: &mut [Boxes]) {
    for (boxes, blocks) in boxes.iter_mut().zip(blocks.chunks(LANES)) {
        *boxes = Boxes::empty();
        for (lane, block) in blocks.iter().enumerate() {
            boxes.set(lane, block.bounds());
        }
    }
}

kernel! {
    /// The boxes around boxes.
    fn around_boxes(below: &[Boxes], boxes: &mut [Boxes]) = around_boxes_body;
}

#[inline(always)]
fn around_boxes_body(below: &[Boxes], boxes: &mut [Boxes]) {
    for (boxes, below) in boxes.iter_mut().zip(below.chunks(LANES)) {
        *boxes = Boxes::empty();
        for (lane, one) in below.iter().enumerate() {
            boxes.set(lane, one.bounds());
        }
    }
}

impl Block {
    fn empty() -> Self {
        Self { corners: [[F32x16::splat(0.0); 3]; 3], triangle: [NONE; LANES] }
    }

    /// Sets it to up to sixteen triangles.
    #[inline(always)]
    fn set(&mut self, points: &[Vec3], members: &[Member]) {
        for (lane, member) in members.iter().enumerate() {
            self.put(lane, member.corners(points));
            self.triangle[lane] = member.triangle;
        }
        if members.len() < LANES || !self.is_finite() {
            self.set_some(points, members);
        }
    }

    /// The same, where there are fewer or not all are finite.
    #[inline(never)]
    fn set_some(&mut self, points: &[Vec3], members: &[Member]) {
        *self = Self::empty();
        let mut first = LANES;
        for (lane, member) in members.iter().enumerate() {
            let corners = member.corners(points);
            if corners.as_flattened().iter().all(|x| x.is_finite()) {
                self.put(lane, corners);
                self.triangle[lane] = member.triangle;
                first = if first == LANES { lane } else { first };
            }
        }
        if first == LANES {
            return;
        }
        let [a, b, c] = &self.corners;
        let repeated = [get(a, first), get(b, first), get(c, first)];
        for lane in 0..LANES {
            if self.triangle[lane] == NONE {
                self.put(lane, repeated);
            }
        }
    }

    /// Whether all coordinates are.
    #[inline(always)]
    fn is_finite(&self) -> bool {
        let mut sizes = F32x16::splat(0.0);
        for corner in &self.corners {
            for axis in corner {
                for lane in 0..LANES {
                    // Where one is NaN or infinite, so is the sum.
                    sizes.0[lane] += axis.0[lane] * 0.0;
                }
            }
        }
        let mut finite = true;
        for lane in 0..LANES {
            finite &= sizes.0[lane] == 0.0;
        }
        finite
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (to, corner) in self.corners.iter_mut().zip(corners) {
            set(to, lane, corner);
        }
    }

    /// Lowest and highest corner of the triangles: those of an empty box where there is none.
    #[inline(always)]
    fn bounds(&self) -> (Vec3, Vec3) {
        if self.triangle == [NONE; LANES] {
            return (EMPTY_LOW, EMPTY_HIGH);
        }
        let boxes = self.boxes();
        boxes.bounds()
    }

    /// The box of each lane's triangle; an unused lane has that of the triangle it repeats.
    #[inline(always)]
    pub fn boxes(&self) -> Boxes {
        let [a, b, c] = &self.corners;
        // No closures here: they are not compiled for a kernel's path. No loop over the axes either: the compiler vectorises
        // it, with a gather for each lane.
        Boxes {
            low: [a[0].least(&b[0]).least(&c[0]), a[1].least(&b[1]).least(&c[1]), a[2].least(&b[2]).least(&c[2])],
            high: [a[0].most(&b[0]).most(&c[0]), a[1].most(&b[1]).most(&c[1]), a[2].most(&b[2]).most(&c[2])],
        }
    }
}

impl Boxes {
    fn empty() -> Self {
        Self { low: EMPTY_LOW.map(F32x16::splat), high: EMPTY_HIGH.map(F32x16::splat) }
    }

    /// Replaces the box of a lane.
    #[inline(always)]
    fn set(&mut self, lane: usize, (low, high): (Vec3, Vec3)) {
        set(&mut self.low, lane, low);
        set(&mut self.high, lane, high);
    }

    /// The box around all lanes.
    #[inline(always)]
    fn bounds(&self) -> (Vec3, Vec3) {
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            low[axis] = least_of(&self.low[axis]);
            high[axis] = most_of(&self.high[axis]);
        }
        (low, high)
    }
}

/// The least of all lanes.
#[inline(always)]
fn least_of(lanes: &F32x16) -> f32 {
    // Halves, quarters…: a lane after another would be a chain of sixteen. Each of a length of its own, as loops of a length that
    // changes are left scalar.
    let (mut eight, mut four, mut two) = ([0.0; 8], [0.0; 4], [0.0; 2]);
    for lane in 0..8 {
        eight[lane] = least(lanes.0[lane], lanes.0[lane + 8]);
    }
    for lane in 0..4 {
        four[lane] = least(eight[lane], eight[lane + 4]);
    }
    for lane in 0..2 {
        two[lane] = least(four[lane], four[lane + 2]);
    }
    least(two[0], two[1])
}

/// The largest of all lanes, as [`least_of`].
#[inline(always)]
fn most_of(lanes: &F32x16) -> f32 {
    let (mut eight, mut four, mut two) = ([0.0; 8], [0.0; 4], [0.0; 2]);
    for lane in 0..8 {
        eight[lane] = most(lanes.0[lane], lanes.0[lane + 8]);
    }
    for lane in 0..4 {
        four[lane] = most(eight[lane], eight[lane + 4]);
    }
    for lane in 0..2 {
        two[lane] = most(four[lane], four[lane + 2]);
    }
    most(two[0], two[1])
}

/// The lesser; `b` where one is NaN.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger; `b` where one is NaN.
#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests;
