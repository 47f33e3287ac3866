//! Nearest points and points within a distance, in a tree that halves the points along the longest side of their box.
//!
//! Promise: the same results for the same points in the same order; distances are compared in `f64`, so that they neither
//! overflow nor vanish for any finite points. Limit: coincident points are not told apart, so a search near many of them
//! goes through all of them.

use crate::vector::{DVec3, Vec3, to_f64};

/// Points of a node that is not split further.
const LEAF: usize = 8;

/// Points in an order in which neighbours are close.
#[derive(Clone, Debug, Default)]
pub struct PointTree {
    points: Vec<Vec3>,
    /// The number of each point in the list that the tree was made of.
    numbers: Vec<u32>,
    /// The axis along which the node with that middle is split.
    axes: Vec<u8>,
}

/// A point that a search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundPoint {
    /// Its number in the list that the tree was made of.
    pub number: u32,
    /// The square of its distance.
    pub square: f64,
}

impl PointTree {
    /// The tree of finite points.
    pub fn new(points: &[Vec3]) -> Self {
        let mut numbers: Vec<u32> = (0..points.len() as u32).collect();
        let mut axes = vec![0; points.len()];
        split(points, &mut numbers, &mut axes);
        let points = numbers.iter().map(|n| points[*n as usize]).collect();
        Self { points, numbers, axes }
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Calls `found` for each point at most `radius` from `place`, in the order of the tree.
    pub fn within(&self, place: Vec3, radius: f64, mut found: impl FnMut(FoundPoint)) {
        let reach = radius * radius;
        self.visit(place, |point| {
            if point.square <= reach {
                found(point);
            }
            reach
        });
    }

    /// The `count` points closest to `place`, nearest first; `near` is cleared and filled with them.
    pub fn nearest(&self, place: Vec3, count: usize, near: &mut Vec<FoundPoint>) {
        near.clear();
        if count == 0 {
            return;
        }
        self.visit(place, |point| {
            if near.len() == count && near[count - 1].square <= point.square {
                return near[count - 1].square;
            }
            let at = near.partition_point(|other| other.square <= point.square);
            near.truncate(count - 1);
            near.insert(at, point);
            if near.len() == count { near[count - 1].square } else { f64::INFINITY }
        });
    }

    /// Calls `each` for points, nearer nodes first, which returns the square of the distance beyond which no more are wanted.
    fn visit(&self, place: Vec3, mut each: impl FnMut(FoundPoint) -> f64) {
        let at = to_f64(place);
        let mut reach = f64::INFINITY;
        let mut found = |n: usize, reach: &mut f64| {
            *reach = each(FoundPoint { number: self.numbers[n], square: square(at - to_f64(self.points[n])) });
        };
        // Nodes to visit, with the square of the distance of the plane beyond which they lie.
        let mut open = vec![(0, self.len(), 0.0)];
        while let Some((first, end, beyond)) = open.pop() {
            if beyond > reach {
                continue;
            }
            if end - first <= LEAF {
                (first..end).for_each(|n| found(n, &mut reach));
                continue;
            }
            let middle = first + (end - first) / 2;
            let axis = usize::from(self.axes[middle]);
            let off = at[axis] - f64::from(self.points[middle][axis]);
            found(middle, &mut reach);
            let [near, far] = match off < 0.0 {
                true => [(first, middle), (middle + 1, end)],
                false => [(middle + 1, end), (first, middle)],
            };
            open.push((far.0, far.1, off * off));
            open.push((near.0, near.1, beyond));
        }
    }
}

fn square(v: DVec3) -> f64 {
    v.dot(&v)
}

/// Orders the numbers of points so that the middle one of each node separates its halves.
fn split(points: &[Vec3], numbers: &mut [u32], axes: &mut [u8]) {
    if numbers.len() <= LEAF {
        numbers.sort_unstable();
        return;
    }
    let axis = longest_side(points, numbers);
    let middle = numbers.len() / 2;
    let coordinate = |n: &u32| points[*n as usize][axis];
    numbers.select_nth_unstable_by(middle, |a, b| coordinate(a).total_cmp(&coordinate(b)).then(a.cmp(b)));
    axes[middle] = axis as u8;
    let (low, high) = numbers.split_at_mut(middle);
    let (low_axes, high_axes) = axes.split_at_mut(middle);
    split(points, low, low_axes);
    split(points, &mut high[1..], &mut high_axes[1..]);
}

fn longest_side(points: &[Vec3], numbers: &[u32]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for n in numbers {
        for axis in 0..3 {
            low[axis] = low[axis].min(points[*n as usize][axis]);
            high[axis] = high[axis].max(points[*n as usize][axis]);
        }
    }
    let side = |axis: usize| f64::from(high[axis]) - f64::from(low[axis]);
    (1..3).fold(0, |longest, axis| if side(axis) > side(longest) { axis } else { longest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Key;

    fn scattered(count: usize) -> Vec<Vec3> {
        let key = Key::new(3);
        (0..count).map(|n| [0, 1, 2].map(|axis| key.of(n as u64).of(axis).between([-1.0, 1.0]))).collect()
    }

    fn squares(points: &[Vec3], place: Vec3) -> Vec<FoundPoint> {
        let found =
            |(n, p): (usize, &Vec3)| FoundPoint { number: n as u32, square: square(to_f64(place) - to_f64(*p)) };
        let mut all: Vec<FoundPoint> = points.iter().enumerate().map(found).collect();
        all.sort_by(|a, b| a.square.total_cmp(&b.square));
        all
    }

    #[test]
    fn searches_find_what_an_exhaustive_search_finds() {
        for count in [0, 1, 7, 8, 9, 100, 1000] {
            let points = scattered(count);
            let tree = PointTree::new(&points);
            assert_eq!((tree.len(), tree.is_empty()), (count, count == 0));
            for place in scattered(20).into_iter().map(|p| p.map(|x| 1.5 * x)) {
                let all = squares(&points, place);
                let mut near = Vec::new();
                tree.nearest(place, 12, &mut near);
                assert_eq!(near, all[..count.min(12)]);
                let mut within = Vec::new();
                tree.within(place, 0.5, |found| within.push(found));
                within.sort_by(|a, b| a.square.total_cmp(&b.square));
                assert_eq!(within, all[..all.partition_point(|found| found.square <= 0.25)]);
            }
        }
    }

    #[test]
    fn coincident_far_and_tiny_points_are_found() {
        let mut near = Vec::new();
        let heap = PointTree::new(&[[1.0, 2.0, 3.0]; 100]);
        heap.nearest([1.0; 3], 200, &mut near);
        assert_eq!(near.len(), 100);
        for size in [1e-42_f32, 1e38] {
            let points = scattered(100).iter().map(|p| p.map(|x| x * size)).collect::<Vec<_>>();
            PointTree::new(&points).nearest(points[40], 1, &mut near);
            assert_eq!(near[0].square.to_bits(), 0, "{size}");
        }
        let none = PointTree::new(&[]);
        none.nearest([0.0; 3], 3, &mut near);
        assert!(near.is_empty());
    }

    #[test]
    fn no_points_are_wanted_and_none_found() {
        let mut near = vec![FoundPoint { number: 0, square: 0.0 }];
        PointTree::new(&scattered(20)).nearest([0.0; 3], 0, &mut near);
        assert!(near.is_empty());
    }
}
