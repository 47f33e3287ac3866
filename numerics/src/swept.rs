//! Bounding boxes of moving elements in a tree sixteen wide, in f32, rounded outwards so that no overlap is missed.

use crate::lanes::{F32x16, LANES, set};
use crate::parallel;
use crate::simd::{Path, kernel};
use crate::tree::{Boxes, Cuboid, NONE, Region, TriangleTree};
use crate::vector::Vec3;

/// Points that a thread takes at a time.
const TASK: usize = 1024;
/// Largest number of levels, enough for 2³² elements.
const MOST_LEVELS: usize = 8;

/// SweptElements of N points each, in groups of sixteen neighbours.
#[derive(Clone, Debug)]
pub struct SweptElements<const N: usize> {
    points: Vec<[u32; N]>,
    /// Index of the element in each lane; [`NONE`] in unused ones.
    order: Vec<[u32; LANES]>,
}

/// Swept boxes of elements. The children of the box in lane l of row r are row 16r + l of the level below.
#[derive(Clone, Debug)]
pub struct SweptBoxTree<'a> {
    order: &'a [[u32; LANES]],
    levels: Vec<Vec<Boxes>>,
    /// Bounds of everything.
    pub bounds: Cuboid,
}

/// A box that overlaps nothing.
const NOWHERE: Cuboid = Cuboid { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

impl<const N: usize> SweptElements<N> {
    /// Groups elements by their positions in `pose`.
    pub fn new(points: Vec<[u32; N]>, pose: &[[f64; 3]]) -> Self {
        // Each element becomes a degenerate triangle from its lowest to its highest corner, which the triangle tree
        // can sort.
        let boxes: Vec<Cuboid> = pose.iter().map(box_of).collect();
        let corners: Vec<Vec3> =
            points.iter().map(|element| bounds_of(element, &boxes)).flat_map(|own| [own.low, own.high]).collect();
        let members: Vec<[u32; 3]> = (0..points.len() as u32).map(|k| [2 * k, 2 * k + 1, 2 * k]).collect();
        let tree = TriangleTree::build(&corners, &members);
        Self { order: tree.blocks().iter().map(|block| block.triangle).collect(), points }
    }

    /// The boxes of all elements, given those of their points, inflated by `reach`.
    pub fn sweep(&self, boxes: &[Cuboid], reach: f64) -> SweptBoxTree<'_> {
        let own = |element: u32| inflated(&bounds_of(&self.points[element as usize], boxes), reach);
        let leaf =
            |lanes: &[u32; LANES]| row(lanes.iter().map(|lane| if *lane == NONE { NOWHERE } else { own(*lane) }));
        let mut levels: Vec<Vec<Boxes>> = vec![self.order.iter().map(leaf).collect()];
        while levels[levels.len() - 1].len() > 1 {
            let below = &levels[levels.len() - 1];
            let next = below.chunks(LANES).map(|rows| row(rows.iter().map(bounds))).collect();
            levels.push(next);
        }
        let bounds = levels[levels.len() - 1].first().map_or(NOWHERE, bounds);
        SweptBoxTree { order: &self.order, levels, bounds }
    }
}

/// Up to sixteen boxes as lanes; boxes of NaN overlap nothing.
fn row(boxes: impl Iterator<Item = Cuboid>) -> Boxes {
    let mut out = Boxes { low: NOWHERE.low.map(F32x16::splat), high: NOWHERE.high.map(F32x16::splat) };
    for (lane, own) in boxes.enumerate().filter(|own| !own.1.low[0].is_nan()) {
        set(&mut out.low, lane, own.low);
        set(&mut out.high, lane, own.high);
    }
    out
}

/// Bounds of sixteen boxes.
fn bounds(boxes: &Boxes) -> Cuboid {
    let mut out = NOWHERE;
    for axis in 0..3 {
        for lane in 0..LANES {
            out.low[axis] = out.low[axis].min(boxes.low[axis].0[lane]);
            out.high[axis] = out.high[axis].max(boxes.high[axis].0[lane]);
        }
    }
    out
}

/// The box of each point over all poses.
pub fn swept_boxes(poses: &[&[[f64; 3]]]) -> Vec<Cuboid> {
    let (first, others) = poses.split_first().map_or((&[][..], &[][..]), |(first, others)| (*first, others));
    let of = |point: usize| others.iter().fold(box_of(&first[point]), |own, pose| join(&own, &box_of(&pose[point])));
    let mut boxes = vec![NOWHERE; first.len()];
    parallel::fill(&mut boxes, TASK, of);
    boxes
}

/// The box of a point; of NaN, which overlaps nothing, if the point is not finite.
fn box_of(p: &[f64; 3]) -> Cuboid {
    if !(p[0] + p[1] + p[2]).is_finite() {
        return Cuboid { low: [f32::NAN; 3], high: [f32::NAN; 3] };
    }
    Cuboid { low: [below(p[0]), below(p[1]), below(p[2])], high: [-below(-p[0]), -below(-p[1]), -below(-p[2])] }
}

/// Bounds of two boxes; of NaN if one is.
#[inline(always)]
fn join(a: &Cuboid, b: &Cuboid) -> Cuboid {
    if b.low[0].is_nan() {
        return *b;
    }
    let mut out = *a;
    for axis in 0..3 {
        out.low[axis] = if b.low[axis] < a.low[axis] { b.low[axis] } else { a.low[axis] };
        out.high[axis] = if b.high[axis] > a.high[axis] { b.high[axis] } else { a.high[axis] };
    }
    out
}

/// Bounds of the boxes of some points.
#[inline]
pub fn bounds_of(points: &[u32], boxes: &[Cuboid]) -> Cuboid {
    let first = boxes[points[0] as usize];
    points[1..].iter().fold(first, |all, point| join(&all, &boxes[*point as usize]))
}

/// Bounds of the boxes of those points that are finite.
pub fn bounds_of_finite(points: &[u32], boxes: &[Cuboid]) -> Cuboid {
    let own = points.iter().map(|point| &boxes[*point as usize]).filter(|own| !own.low[0].is_nan());
    own.fold(NOWHERE, |all, own| join(&all, own))
}

/// A box inflated by `reach` on every side.
#[inline]
pub fn inflated(a: &Cuboid, reach: f64) -> Cuboid {
    let mut out = *a;
    for axis in 0..3 {
        out.low[axis] = below(f64::from(a.low[axis]) - reach);
        out.high[axis] = -below(-(f64::from(a.high[axis]) + reach));
    }
    out
}

/// The largest f32 that is not greater. Beyond single precision it is the end of the range instead: boxes stay finite, so
/// none meets [`NOWHERE`], and those that overlap still do, because the order of their bounds is kept.
fn below(x: f64) -> f32 {
    let near = x as f32;
    let below = if f64::from(near) > x { near.next_down() } else { near };
    below.clamp(-f32::MAX, f32::MAX)
}

/// Whether two boxes overlap.
#[inline]
pub fn overlap(a: &Cuboid, b: &Cuboid) -> bool {
    (0..3).all(|k| a.low[k] <= b.high[k] && b.low[k] <= a.high[k])
}

impl SweptBoxTree<'_> {
    /// SweptElements whose boxes overlap `region`, ascending.
    pub fn overlapping(&self, region: &Cuboid, out: &mut Vec<u32>) {
        out.clear();
        if overlap(region, &self.bounds) {
            gather(Path::chosen(), self, region, out);
            out.sort_unstable();
        }
    }
}

kernel! {
    fn gather(tree: &SweptBoxTree<'_>, region: &Cuboid, out: &mut Vec<u32>) = gather_on;
}

#[inline(always)]
fn gather_on(tree: &SweptBoxTree<'_>, region: &Cuboid, out: &mut Vec<u32>) {
    let top = tree.levels.len() - 1;
    let (mut rows, mut lanes) = ([0; MOST_LEVELS], [0u16; MOST_LEVELS]);
    let mut level = top;
    lanes[top] = region.meeting(&tree.levels[top][0]);
    loop {
        if lanes[level] == 0 {
            if level == top {
                return;
            }
            level += 1;
            continue;
        }
        let lane = lanes[level].trailing_zeros() as usize;
        lanes[level] &= lanes[level] - 1;
        if level > 0 {
            let row = rows[level] * LANES + lane;
            level -= 1;
            rows[level] = row;
            lanes[level] = region.meeting(&tree.levels[level][row]);
        } else {
            out.push(tree.order[rows[0]][lane]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_beyond_single_precision_meet_all_and_only_elements() {
        let points: Vec<[f64; 3]> = (0..40).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let elements = SweptElements::new((0..40).map(|k| [k]).collect(), &points);
        let far = |x: f64| points.iter().map(|p| [p[0] + x, x, -x]).collect::<Vec<_>>();
        for x in [0.0, 1e38, 1e39, 1e300, -1e300] {
            for reach in [0.0, 1e39, f64::INFINITY] {
                let moved = far(x);
                let boxes = swept_boxes(&[&points, &moved]);
                let tree = elements.sweep(&boxes, reach);
                let mut found = Vec::new();
                tree.overlapping(&inflated(&bounds_of(&(0..40).collect::<Vec<u32>>(), &boxes), reach), &mut found);
                assert_eq!(found, (0..40).collect::<Vec<u32>>(), "moved by {x}, reach {reach}");
            }
        }
    }
}
