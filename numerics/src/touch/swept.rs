//! Boxes around what moves, in a tree sixteen wide, f32, rounded outwards: nothing that may meet is left out.
//!
//! An element's box is put into a [`TriangleTree`] as a triangle without area from its lowest to its highest corner.

use super::V3;
use super::surface::Places;
use crate::simd::{Path, kernel};
use crate::tree::{Cuboid, TriangleTree};
use crate::vec3::Vec3;

/// The tree of some elements, each of up to three points; its shape is kept, its boxes are put anew.
#[derive(Clone, Debug)]
pub(super) struct Elements<const N: usize> {
    points: Vec<[u32; N]>,
    tree: TriangleTree,
}

impl<const N: usize> Elements<N> {
    /// Of elements that are about where they are in `pose`.
    pub(super) fn new(points: Vec<[u32; N]>, pose: Places<'_>) -> Self {
        let boxes: Vec<Vec3> = points.iter().flat_map(|element| ends(&around(element, &[pose], 0.0))).collect();
        let members: Vec<[u32; 3]> = (0..points.len() as u32).map(|k| [2 * k, 2 * k + 1, 2 * k]).collect();
        Self { tree: TriangleTree::build(&boxes, &members), points }
    }

    /// The tree of the boxes around all poses, wider by `reach`.
    pub(super) fn sweep(&self, poses: &[Places<'_>], reach: f64) -> TriangleTree {
        let boxes: Vec<Vec3> =
            self.points.iter().flat_map(|element| ends(&around(element, poses, reach))).collect();
        let mut tree = self.tree.clone();
        tree.refit(&boxes);
        tree
    }
}

fn ends(of: &Cuboid) -> [Vec3; 2] {
    [of.low, of.high]
}

/// The box around some points in all poses, wider by `reach`; one of NaN where a point is not finite.
pub(super) fn around(points: &[u32], poses: &[Places<'_>], reach: f64) -> Cuboid {
    let (mut low, mut high, mut sum) = (V3::repeat(f64::INFINITY), V3::repeat(f64::NEG_INFINITY), 0.0);
    for pose in poses {
        for point in points {
            let p = V3::from(pose[*point as usize]);
            (low, high) = (low.inf(&p), high.sup(&p));
            sum += p.x + p.y + p.z;
        }
    }
    if !sum.is_finite() {
        return Cuboid { low: [f32::NAN; 3], high: [f32::NAN; 3] };
    }
    Cuboid { low: [0, 1, 2].map(|k| below(low[k] - reach)), high: [0, 1, 2].map(|k| -below(-(high[k] + reach))) }
}

/// The largest f32 that is not above.
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// Whether two boxes have a point in common.
pub(super) fn meet(a: &Cuboid, (low, high): (Vec3, Vec3)) -> bool {
    (0..3).all(|k| a.low[k] <= high[k] && low[k] <= a.high[k])
}

/// Elements whose boxes meet `region`, rising.
pub(super) fn meeting(tree: &TriangleTree, region: Cuboid, out: &mut Vec<u32>) {
    out.clear();
    gather(Path::chosen(), tree, region, out);
    out.sort_unstable();
}

kernel! {
    fn gather(tree: &TriangleTree, region: Cuboid, out: &mut Vec<u32>) = gather_on;
}

#[inline(always)]
fn gather_on(tree: &TriangleTree, region: Cuboid, out: &mut Vec<u32>) {
    for (block, lanes) in tree.walk(region) {
        let block = &tree.blocks()[block];
        let mut mask = lanes;
        while mask != 0 {
            out.push(block.triangle[mask.trailing_zeros() as usize]);
            mask &= mask - 1;
        }
    }
}
