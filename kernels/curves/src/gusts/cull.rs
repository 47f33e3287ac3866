//! Culling: which regions may reach a run of points. Boxes against boxes, sixteen regions at a time.
//!
//! Conservative: boxes of regions are rounded outwards.

use numerics::lanes::LANES;
use numerics::simd::{Path, kernel};
use numerics::vector::{DVec3, Vec3};

/// A low and a high corner.
pub(super) type Bounds = [Vec3; 2];

/// Bounds of no points: they overlap nothing, and their union with others changes nothing.
pub(super) const NOWHERE: Bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// Coordinates of sixteen points.
const FLOATS: usize = 3 * LANES;

kernel! {
    /// The bounds of points.
    pub(super) fn bounds_of(points: &[Vec3]) -> Bounds = bounds_body;
}

#[inline(always)]
fn bounds_body(points: &[Vec3]) -> Bounds {
    let (whole, rest) = points.as_flattened().as_chunks::<FLOATS>();
    let [mut low, mut high] = [[f32::INFINITY; FLOATS], [f32::NEG_INFINITY; FLOATS]];
    for floats in whole {
        for i in 0..FLOATS {
            low[i] = if floats[i] < low[i] { floats[i] } else { low[i] };
            high[i] = if floats[i] > high[i] { floats[i] } else { high[i] };
        }
    }
    for (i, float) in rest.iter().enumerate() {
        low[i] = low[i].min(*float);
        high[i] = high[i].max(*float);
    }
    let (low, high) = (low.as_chunks::<3>().0, high.as_chunks::<3>().0);
    low.iter().zip(high).fold(NOWHERE, |bounds, (low, high)| join(bounds, [*low, *high]))
}

kernel! {
    /// The least coordinate of finite points along each axis: half of their bounds, for less than half the instructions.
    fn lowest_of(points: &[Vec3]) -> Vec3 = lowest_body;
}

#[inline(always)]
fn lowest_body(points: &[Vec3]) -> Vec3 {
    let (whole, rest) = points.as_flattened().as_chunks::<FLOATS>();
    let mut low = [f32::INFINITY; FLOATS];
    for floats in whole {
        for i in 0..FLOATS {
            low[i] = if low[i] < floats[i] { low[i] } else { floats[i] };
        }
    }
    for (i, float) in rest.iter().enumerate() {
        low[i] = low[i].min(*float);
    }
    low.as_chunks::<3>().0.iter().fold(NOWHERE[0], |low, one| [0, 1, 2].map(|axis| low[axis].min(one[axis])))
}

kernel! {
    /// The greatest coordinate of finite points along each axis.
    fn highest_of(points: &[Vec3]) -> Vec3 = highest_body;
}

#[inline(always)]
fn highest_body(points: &[Vec3]) -> Vec3 {
    let (whole, rest) = points.as_flattened().as_chunks::<FLOATS>();
    let mut high = [f32::NEG_INFINITY; FLOATS];
    for floats in whole {
        for i in 0..FLOATS {
            high[i] = if high[i] > floats[i] { high[i] } else { floats[i] };
        }
    }
    for (i, float) in rest.iter().enumerate() {
        high[i] = high[i].max(*float);
    }
    high.as_chunks::<3>().0.iter().fold(NOWHERE[1], |high, one| [0, 1, 2].map(|axis| high[axis].max(one[axis])))
}

/// Whether all points, which are finite, are on one side of a box, the one on which the first point is.
pub(super) fn all_beside(path: Path, points: &[Vec3], [low, high]: &Bounds) -> bool {
    let Some(first) = points.first() else { return true };
    if let Some(axis) = (0..3).find(|axis| first[*axis] > high[*axis]) {
        lowest_of(path, points)[axis] > high[axis]
    } else if let Some(axis) = (0..3).find(|axis| first[*axis] < low[*axis]) {
        highest_of(path, points)[axis] < low[axis]
    } else {
        false
    }
}

/// The union with other bounds.
fn join([low, high]: Bounds, [other_low, other_high]: Bounds) -> Bounds {
    [[0, 1, 2].map(|k| low[k].min(other_low[k])), [0, 1, 2].map(|k| high[k].max(other_high[k]))]
}

/// Boxes of regions, an array for each axis and end, and the index of each box's region.
#[derive(Default)]
pub(super) struct Boxes {
    low: [Vec<f32>; 3],
    high: [Vec<f32>; 3],
    regions: Vec<u32>,
}

impl Boxes {
    /// Adds the box `reach` around `centre`, rounded outwards.
    pub(super) fn push(&mut self, region: u32, centre: DVec3, reach: DVec3) {
        self.regions.push(region);
        for axis in 0..3 {
            self.low[axis].push(((centre[axis] - reach[axis]) as f32).next_down());
            self.high[axis].push(((centre[axis] + reach[axis]) as f32).next_up());
        }
    }

    /// The bounds of all boxes.
    pub(super) fn bounds(&self) -> Bounds {
        let least = |of: &Vec<f32>| of.iter().fold(f32::INFINITY, |least, x| least.min(*x));
        let largest = |of: &Vec<f32>| of.iter().fold(f32::NEG_INFINITY, |largest, x| largest.max(*x));
        [self.low.each_ref().map(least), self.high.each_ref().map(largest)]
    }

    /// Number of boxes.
    pub(super) fn len(&self) -> usize {
        self.regions.len()
    }

    /// The region of the box at `index`.
    pub(super) fn region(&self, index: usize) -> usize {
        self.regions[index] as usize
    }

    /// 1 for each of the sixteen boxes from `first` on that overlaps `bounds`, else 0.
    #[inline(always)]
    pub(super) fn meet(&self, first: usize, [low, high]: &Bounds) -> [u32; LANES] {
        let mut met = [0; LANES];
        let here = LANES.min(self.len() - first);
        met[..here].fill(1);
        for axis in 0..3 {
            let (from, to) = (&self.low[axis][first..first + here], &self.high[axis][first..first + here]);
            // Full groups of sixteen are vectorised.
            match (<&[f32; LANES]>::try_from(from), <&[f32; LANES]>::try_from(to)) {
                (Ok(from), Ok(to)) => {
                    for lane in 0..LANES {
                        met[lane] &= u32::from(from[lane] <= high[axis]) & u32::from(to[lane] >= low[axis]);
                    }
                }
                _ => {
                    for lane in 0..here {
                        met[lane] &= u32::from(from[lane] <= high[axis]) & u32::from(to[lane] >= low[axis]);
                    }
                }
            }
        }
        met
    }
}

kernel! {
    /// The boxes of `all` that overlap `bounds`, in order.
    pub(super) fn meeting(all: &Boxes, bounds: &Bounds) -> Boxes = meeting_body;
}

#[inline(always)]
fn meeting_body(all: &Boxes, bounds: &Bounds) -> Boxes {
    let mut near = Boxes::default();
    for first in (0..all.len()).step_by(LANES) {
        let met = all.meet(first, bounds);
        if met == [0; LANES] {
            continue;
        }
        for index in (0..LANES).filter(|lane| met[*lane] != 0).map(|lane| first + lane) {
            near.regions.push(all.regions[index]);
            for axis in 0..3 {
                near.low[axis].push(all.low[axis][index]);
                near.high[axis].push(all.high[axis][index]);
            }
        }
    }
    near
}
