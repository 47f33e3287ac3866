//! The order of the triangles in the tree: runs of sixteen that are close together.

use super::{LANES, least, most};
use crate::vector::Vec3;

/// Below this number of triangles a half is not worth a task of its own.
const TASK: usize = 1024;

/// A triangle by the centre of its box, as integers that order like the coordinates. One that is not finite comes last.
#[derive(Clone, Copy)]
struct Item {
    middle: [u32; 3],
    triangle: u32,
}

/// The triangles' indices; each run of sixteen is a block, and so on up the tree.
pub(super) fn order(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    assert!(triangles.len() < u32::MAX as usize, "{} triangles are too many", triangles.len());
    let item = |(triangle, corners): (usize, &[u32; 3])| {
        let corners = corners.map(|point| points[point as usize]);
        let finite = corners.iter().flatten().all(|x| x.is_finite());
        let middle = |axis: usize| {
            let [a, b, c] = corners.map(|corner| corner[axis]);
            0.5 * least(least(a, b), c) + 0.5 * most(most(a, b), c)
        };
        let middle = if finite { [0, 1, 2].map(|axis| rank(middle(axis))) } else { [u32::MAX; 3] };
        Item { middle, triangle: triangle as u32 }
    };
    let mut items: Vec<Item> = triangles.iter().enumerate().map(item).collect();
    split(&mut items);
    items.into_iter().map(|item| item.triangle).collect()
}

/// Orders the triangles of one box.
fn split(items: &mut [Item]) {
    if items.len() <= LANES {
        items.sort_unstable_by_key(|item| item.triangle);
        return;
    }
    let mut child = LANES;
    while child * LANES < items.len() {
        child *= LANES;
    }
    halve(items, child);
}

/// Orders the triangles of some lanes of a box; each lane but the last has `child` triangles.
fn halve(items: &mut [Item], child: usize) {
    let lanes = items.len().div_ceil(child);
    if lanes <= 1 {
        return split(items);
    }
    let axis = longest(items);
    let middle = lanes.div_ceil(2) * child;
    let key = |item: &Item| u64::from(item.middle[axis]) << 32 | u64::from(item.triangle);
    items.select_nth_unstable_by_key(middle, key);
    let (left, right) = items.split_at_mut(middle);
    if left.len() < TASK {
        halve(left, child);
        halve(right, child);
    } else {
        rayon::join(|| halve(left, child), || halve(right, child));
    }
}

/// The axis along which the centres extend farthest.
fn longest(items: &[Item]) -> usize {
    let (mut low, mut high) = ([u32::MAX; 3], [0; 3]);
    for item in items {
        for axis in 0..3 {
            let rank = item.middle[axis];
            low[axis] = low[axis].min(rank);
            high[axis] = high[axis].max(if rank == u32::MAX { 0 } else { rank });
        }
    }
    let extent = [0, 1, 2].map(|axis| if low[axis] < high[axis] { value(high[axis]) - value(low[axis]) } else { 0.0 });
    let [x, y, z] = extent;
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

/// An integer that orders like the finite `x`.
fn rank(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The inverse of [`rank`].
fn value(rank: u32) -> f32 {
    f32::from_bits(if rank >> 31 == 1 { rank & !(1 << 31) } else { !rank })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_order_like_their_numbers_and_have_an_inverse() {
        let rising = [f32::MIN, -1.5, -1e-40, 0.0, 1e-40, 2.0, f32::MAX];
        assert!(rising.windows(2).all(|pair| rank(pair[0]) < rank(pair[1])));
        assert!(rising.iter().all(|x| value(rank(*x)).to_bits() == x.to_bits()));
    }
}
