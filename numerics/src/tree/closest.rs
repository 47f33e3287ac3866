//! The nearest point of the surface.

use super::{Block, Boxes, LANES, MOST_LEVELS, NONE, TriangleTree};
use crate::lanes::{F32x16, get};
use crate::parallel;
use crate::simd::{Path, kernel};
use crate::vector::{self, Vec3, cross, dot, scale, sub};

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Index of its triangle.
    pub triangle: u32,
    /// Barycentric weights of its corners: ≥ 0, with sum 1.
    pub weights: [f32; 3],
    /// Its position, metres.
    pub point: Vec3,
    /// Its distance, metres.
    pub distance: f32,
}

/// A box is visited unless it is farther than the nearest triangle by more than this share of the squared distance, which
/// is above the rounding of both.
const ROUNDING: f32 = 1e-6;

/// Query points of a task: some 30 µs of work.
const TASK: usize = 64;

kernel! {
    fn closest_chunk(tree: &TriangleTree, from: &[Vec3], reach: f32, out: &mut [Option<Closest>]) = chunk;
}

#[inline(always)]
fn chunk(tree: &TriangleTree, from: &[Vec3], reach: f32, out: &mut [Option<Closest>]) {
    for (out, p) in out.iter_mut().zip(from) {
        *out = tree.closest(*p, reach);
    }
}

impl TriangleTree {
    /// [`TriangleTree::closest`] from each point of `from`, on the widest SIMD path.
    pub fn closest_each(&self, from: &[Vec3], reach: f32) -> Vec<Option<Closest>> {
        self.closest_each_on(Path::chosen(), from, reach)
    }

    /// [`TriangleTree::closest_each`] on a given SIMD path.
    pub fn closest_each_on(&self, path: Path, from: &[Vec3], reach: f32) -> Vec<Option<Closest>> {
        let mut out = vec![None; from.len()];
        let chunks = out.chunks_mut(TASK).zip(from.chunks(TASK));
        parallel::for_each(chunks, |_, (out, from)| closest_chunk(path, self, from, reach, out));
        out
    }

    /// The nearest point of the surface within `reach` metres of `p`, accurate to a few ulp of the distance and of the
    /// triangle's size; of equally near triangles the one of lowest index. `None` where `p` is not finite.
    #[inline(always)]
    pub fn closest(&self, p: Vec3, reach: f32) -> Option<Closest> {
        let top = self.levels.len().checked_sub(1)?;
        if !(p[0].is_finite() && p[1].is_finite() && p[2].is_finite()) {
            return None;
        }
        let mut best = Found { square: reach * reach, triangle: NONE, weights: [0.0; 3], towards: [0.0; 3] };
        let (mut open, mut lanes) = ([0; MOST_LEVELS], [0; MOST_LEVELS]);
        let mut squares = [F32x16::splat(0.0); MOST_LEVELS];
        let mut level = top;
        (squares[top], lanes[top]) = self.levels[top][0].within(p, best.square);
        loop {
            let Some(lane) = nearest(&squares[level], lanes[level], best.square) else {
                if level == top {
                    break;
                }
                level += 1;
                continue;
            };
            lanes[level] &= !(1 << lane);
            let child = open[level] * LANES + lane;
            if level > 0 {
                level -= 1;
                open[level] = child;
                (squares[level], lanes[level]) = self.levels[level][child].within(p, best.square);
            } else {
                best.try_block(&self.blocks[child], p);
            }
        }
        let Found { triangle, weights, towards, .. } = best;
        let found = Closest { triangle, weights, point: vector::add(p, towards), distance: vector::length(towards) };
        (triangle != NONE).then_some(found)
    }
}

/// The lane among `lanes` with the least of `squares`, the first of equals, if it may be as near as `limit`.
#[inline(always)]
fn nearest(squares: &F32x16, mut lanes: u16, limit: f32) -> Option<usize> {
    let (mut least, mut at) = (limit, None);
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let square = squares.0[lane] * (1.0 - ROUNDING);
        if square < least || (square <= least && at.is_none()) {
            (least, at) = (square, Some(lane));
        }
    }
    at
}

impl Boxes {
    /// Distance squared of `p` to each box, and a bit for each that may be as near as `limit`.
    #[inline(always)]
    fn within(&self, p: Vec3, limit: f32) -> (F32x16, u16) {
        let mut squares = F32x16::splat(0.0);
        for lane in 0..LANES {
            let mut square = 0.0;
            for axis in 0..3 {
                let below = self.low[axis].0[lane] - p[axis];
                let above = p[axis] - self.high[axis].0[lane];
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                square += outside * outside;
            }
            squares.0[lane] = square;
        }
        let mut mask = 0;
        for lane in 0..LANES {
            // An unused lane is infinitely far.
            let square = squares.0[lane];
            mask |= u16::from((square * (1.0 - ROUNDING) <= limit) & (square < f32::INFINITY)) << lane;
        }
        (squares, mask)
    }
}

impl Block {
    /// The corners of a lane's triangle relative to `p`.
    #[inline(always)]
    pub fn around(&self, lane: usize, p: Vec3) -> [Vec3; 3] {
        let [a, b, c] = &self.corners;
        [sub(get(a, lane), p), sub(get(b, lane), p), sub(get(c, lane), p)]
    }
}

/// The nearest so far.
struct Found {
    square: f32,
    triangle: u32,
    weights: [f32; 3],
    /// From the point to it.
    towards: Vec3,
}

impl Found {
    /// Takes the nearest triangle of a block if it is nearer.
    #[inline(always)]
    fn try_block(&mut self, block: &Block, p: Vec3) {
        let (mut squares, mut ab, mut ac) = (F32x16::splat(0.0), F32x16::splat(0.0), F32x16::splat(0.0));
        for lane in 0..LANES {
            let (square, b, c) = nearest_on(block.around(lane, p));
            squares.0[lane] = square;
            ab.0[lane] = b;
            ac.0[lane] = c;
        }
        for lane in 0..LANES {
            let (square, triangle) = (squares.0[lane], block.triangle[lane]);
            if triangle != NONE && (square < self.square || (square == self.square && triangle < self.triangle)) {
                let (b, c) = (ab.0[lane], ac.0[lane]);
                *self = Self {
                    square,
                    triangle,
                    weights: [((1.0 - b) - c).max(0.0), b, c],
                    towards: between(block.around(lane, p), b, c),
                };
            }
        }
    }
}

/// Squared distance from the origin to the nearest point of a triangle, and the weights of its second and third corner
/// there. From barycentric coordinates inside, else the nearest of the nearest points of the three sides, which is correct
/// for triangles without area too.
#[inline(always)]
fn nearest_on(corners: [Vec3; 3]) -> (f32, f32, f32) {
    let [a, b, c] = corners;
    let (ab, ac) = (sub(b, a), sub(c, a));
    let normal = cross(ab, ac);
    let area = dot(normal, normal);
    let inverse = if area > 0.0 { 1.0 / area } else { 0.0 };
    let second = dot(normal, cross(ac, a)) * inverse;
    let third = dot(normal, cross(a, ab)) * inverse;
    let first = (1.0 - second) - third;
    let inside = (area > 0.0) & (first >= 0.0) & (second >= 0.0) & (third >= 0.0);

    let on_ab = along(a, ab);
    let on_ac = along(a, ac);
    let on_bc = along(b, sub(c, b));
    let (mut least, mut u, mut v) = (square_at(corners, on_ab, 0.0), on_ab, 0.0);
    let next = square_at(corners, 0.0, on_ac);
    let nearer = next < least;
    (least, u, v) = if nearer { (next, 0.0, on_ac) } else { (least, u, v) };
    let next = square_at(corners, 1.0 - on_bc, on_bc);
    let nearer = next < least;
    (least, u, v) = if nearer { (next, 1.0 - on_bc, on_bc) } else { (least, u, v) };
    let next = square_at(corners, second, third);
    if inside & (next < least) { (next, second, third) } else { (least, u, v) }
}

/// Distance squared of the origin to [`between`].
#[inline(always)]
fn square_at(corners: [Vec3; 3], u: f32, v: f32) -> f32 {
    let point = between(corners, u, v);
    dot(point, point)
}

/// The point of a triangle with weights `u` and `v` of its second and third corner.
#[inline(always)]
fn between([a, b, c]: [Vec3; 3], u: f32, v: f32) -> Vec3 {
    vector::add(a, vector::add(scale(sub(b, a), u), scale(sub(c, a), v)))
}

/// The parameter, 0..1, of the point nearest to the origin along `side` from `start`; 0 on a side of no length.
#[inline(always)]
fn along(start: Vec3, side: Vec3) -> f32 {
    let square = dot(side, side);
    let share = -dot(start, side) / if square > 0.0 { square } else { 1.0 };
    let share = if share > 0.0 { share } else { 0.0 };
    if share < 1.0 { share } else { 1.0 }
}
