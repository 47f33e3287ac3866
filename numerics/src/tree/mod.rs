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

use crate::lanes::{F32x16, LANES, Lanes, set};
use crate::parallel;
use crate::vector::Vec3;
pub use closest::Closest;
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
    /// Points and index of the triangle of each lane of each block.
    members: Vec<Member>,
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

impl TriangleTree {
    /// The tree over `triangles`, each three indices of `points` (metres).
    ///
    /// # Panics
    /// Where an index is out of range, or there are 2³² triangles.
    pub fn build(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let order = split::order(points, triangles);
        let member = |&triangle: &u32| Member { points: triangles[triangle as usize], triangle };
        let mut tree = Self { members: order.iter().map(member).collect(), ..Self::default() };
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
        self.blocks.resize(self.members.len().div_ceil(LANES), Block::empty());
        refill(&mut self.blocks, &self.members, |members| Block::of(points, members));
        let mut level = 0;
        let mut rows = self.blocks.len();
        while rows > 1 || (level == 0 && rows > 0) {
            if self.levels.len() == level {
                self.levels.push(Vec::new());
            }
            let (below, above) = self.levels.split_at_mut(level);
            above[0].resize(rows.div_ceil(LANES), Boxes::empty());
            match below.last() {
                None => refill(&mut above[0], &self.blocks, |blocks| Boxes::around(blocks, Block::bounds)),
                Some(boxes) => refill(&mut above[0], boxes, |boxes| Boxes::around(boxes, Boxes::bounds)),
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

/// Sets each element to what `value` makes of the sixteen things below it.
fn refill<T: Send, U: Sync>(elements: &mut [T], below: &[U], value: impl Fn(&[U]) -> T + Sync) {
    parallel::for_each(elements.chunks_mut(TASK).zip(below.chunks(TASK * LANES)), |_, (elements, below)| {
        elements.iter_mut().zip(below.chunks(LANES)).for_each(|(element, below)| *element = value(below));
    });
}

impl Block {
    fn empty() -> Self {
        Self { corners: [[F32x16::splat(0.0); 3]; 3], triangle: [NONE; LANES] }
    }

    /// The block of up to sixteen triangles.
    fn of(points: &[Vec3], members: &[Member]) -> Self {
        let corners = |member: &Member| member.points.map(|point| points[point as usize]);
        let finite = |corners: &[Vec3; 3]| corners.iter().flatten().all(|x| x.is_finite());
        let first = members.iter().map(corners).find(finite).unwrap_or_default();
        let mut block = Self { corners: first.map(|corner| corner.map(F32x16::splat)), triangle: [NONE; LANES] };
        for (lane, member) in members.iter().enumerate() {
            let corners = corners(member);
            if finite(&corners) {
                block.triangle[lane] = member.triangle;
                for (to, corner) in block.corners.iter_mut().zip(corners) {
                    set(to, lane, corner);
                }
            }
        }
        block
    }

    /// Lowest and highest corner of the triangles: those of an empty box where there is none.
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
        let mut boxes = Boxes { low: *a, high: *a };
        // No closures here: they are not compiled for a kernel's path.
        for axis in 0..3 {
            boxes.low[axis] = a[axis].least(&b[axis]).least(&c[axis]);
            boxes.high[axis] = a[axis].most(&b[axis]).most(&c[axis]);
        }
        boxes
    }
}

impl Boxes {
    fn empty() -> Self {
        Self { low: EMPTY_LOW.map(F32x16::splat), high: EMPTY_HIGH.map(F32x16::splat) }
    }

    /// The boxes of up to sixteen items.
    fn around<T>(things: &[T], bounds: impl Fn(&T) -> (Vec3, Vec3)) -> Self {
        let mut boxes = Self::empty();
        for (lane, thing) in things.iter().enumerate() {
            let (low, high) = bounds(thing);
            set(&mut boxes.low, lane, low);
            set(&mut boxes.high, lane, high);
        }
        boxes
    }

    /// The box around all lanes.
    fn bounds(&self) -> (Vec3, Vec3) {
        let low = |axis: usize| self.low[axis].0.iter().fold(f32::INFINITY, |low, x| least(low, *x));
        let high = |axis: usize| self.high[axis].0.iter().fold(f32::NEG_INFINITY, |high, x| most(high, *x));
        ([low(0), low(1), low(2)], [high(0), high(1), high(2)])
    }
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
