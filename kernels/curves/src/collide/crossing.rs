//! Whether a segment crosses a triangle: in f64, on the f32 positions that are written.

use super::triangle_filter::may_cross;
use numerics::lanes::Lanes;
use numerics::tree::{Block, Boxes, Cuboid, Region, TriangleTree};
use numerics::vector::{DVec3, Vec3, to_f64};

/// A segment through a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// Position along the segment, 0..1.
    pub(super) share: f64,
    /// Distance from the plane of the nearer of the two ends.
    pub(super) depth: f64,
    /// Unit normal of the triangle, towards the segment's start.
    pub(super) normal: DVec3,
}

/// Number of triangles of a block that are tested one by one, rather than to exclude some of them sixteen at a time.
const FEW: u32 = 1;

/// The corners of a block's triangle.
#[inline(always)]
pub(super) fn corners(block: &Block, lane: usize) -> [DVec3; 3] {
    let [a, b, c] = &block.corners;
    [corner(a, lane), corner(b, lane), corner(c, lane)]
}

/// The vector of one lane. Without a loop over the axes, which the compiler would make a gather of three.
#[inline(always)]
fn corner(lanes: &Lanes<3>, lane: usize) -> DVec3 {
    to_f64([lanes[0].0[lane], lanes[1].0[lane], lanes[2].0[lane]])
}

/// Where the segment from `a` to `b` crosses the triangle; touching counts. `None` in the triangle's own plane.
pub(super) fn crossing(a: &DVec3, b: &DVec3, [p, q, r]: &[DVec3; 3]) -> Option<Crossing> {
    let normal = (q - p).cross(&(r - p));
    let (start, end) = (normal.dot(&(a - p)), normal.dot(&(b - p)));
    if start * end > 0.0 || start == end {
        return None;
    }
    let along = b - a;
    let [p, q, r] = [p - a, q - a, r - a];
    let volumes = [along.dot(&p.cross(&q)), along.dot(&q.cross(&r)), along.dot(&r.cross(&p))];
    let around = volumes.iter().all(|volume| *volume >= 0.0) || volumes.iter().all(|volume| *volume <= 0.0);
    let towards_start = start > 0.0 || (start == 0.0 && end < 0.0);
    around.then(|| {
        let length = normal.norm();
        Crossing {
            share: start / (start - end),
            depth: start.abs().min(end.abs()) / length,
            normal: normal * (if towards_start { 1.0 } else { -1.0 } / length),
        }
    })
}

/// The first crossing along the segment from `a` to `b` with triangles of `blocks`.
#[inline(always)]
pub(super) fn first_crossing(blocks: &[(&Block, u16)], a: Vec3, b: Vec3) -> Option<Crossing> {
    let mut first: Option<Crossing> = None;
    for (block, lanes) in blocks {
        add_crossings(block, *lanes, a, b, &mut first);
    }
    first
}

/// As [`first_crossing`] with all triangles of trees.
#[inline(always)]
pub(super) fn first_crossing_in(obstacles: &[&TriangleTree], a: Vec3, b: Vec3) -> Option<Crossing> {
    let mut first = None;
    let low = [a[0].min(b[0]), a[1].min(b[1]), a[2].min(b[2])];
    let high = [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])];
    for tree in obstacles {
        tree.visit_box(low, high, |block, lanes| add_crossings(block, lanes, a, b, &mut first));
    }
    first
}

/// Whether the segment from `a` to `b` crosses one of some triangles of a block with these `boxes`.
#[inline(always)]
pub(super) fn crosses_block(block: &Block, boxes: &Boxes, lanes: u16, a: Vec3, b: Vec3) -> bool {
    let (mut low, mut high) = (a, a);
    for axis in 0..3 {
        low[axis] = low[axis].min(b[axis]);
        high[axis] = high[axis].max(b[axis]);
    }
    let lanes = lanes & Cuboid { low, high }.meeting(boxes);
    lanes != 0 && crosses_some(block, lanes, a, b)
}

/// Whether the segment from `a` to `b` crosses one of some triangles of a block.
#[inline(always)]
pub(super) fn crosses_some(block: &Block, lanes: u16, a: Vec3, b: Vec3) -> bool {
    let mut first = None;
    add_crossings(block, lanes, a, b, &mut first);
    first.is_some()
}

/// Replaces `first` by the first crossing with some triangles of a block, if that is nearer to `a`.
#[inline(always)]
pub(super) fn add_crossings(block: &Block, lanes: u16, a: Vec3, b: Vec3, first: &mut Option<Crossing>) {
    let mut lanes = if lanes.count_ones() > FEW { lanes & may_cross(block, a, b) } else { lanes };
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        if let Some(found) = crossing(&to_f64(a), &to_f64(b), &corners(block, lane))
            && first.is_none_or(|first| found.share < first.share)
        {
            *first = Some(found);
        }
    }
}
