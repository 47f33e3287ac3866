//! The frame of the wind: two axes across it and the third upwind, from the middle of the curves, in a
//! power of two of metres that brings the scene below 2.

use super::Collider;
use crate::vec3::{self, Vec3};
use rayon::prelude::*;

/// From a point of the scene to the frame.
pub(super) struct Frame {
    middle: [f64; 3],
    /// Across, across and upwind, each as long as the frame's unit is short.
    axes: [[f64; 3]; 3],
    unit: f64,
}

/// When a CV lies on a triangle, in the frame's unit: within `least` of its plane, or within
/// `share` of the collider's size while that is not more than `most`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gap {
    least: f32,
    most: f32,
}

impl Gap {
    /// The gap at a collider of a size.
    #[inline(always)]
    pub(super) fn at(self, size: f32) -> f32 {
        self.least.max(self.most.min(SKIN * size))
    }
}

/// Of a collider's size: above the rounding of a text file of six digits, below any gap one models.
const SKIN: f32 = 1e-5;

/// Of a curve's size: where the collider is a landscape, its hundred-thousandth is longer than a hair.
const HAIR: f32 = 1e-2;

/// Units in the last place by which a position, and the plane of a triangle there, may be off.
const ULPS: f32 = 4.0;

impl Frame {
    pub(super) fn of(wind: [f64; 3], points: &[Vec3], colliders: &[Collider<'_>]) -> Self {
        let bounds = Bounds::of(points);
        let middle = bounds.middle();
        let reach = colliders.iter().map(|collider| Bounds::of(collider.points).reach(middle));
        let extent = reach.fold(bounds.reach(middle), f64::max);
        let exponent = if extent > 0.0 { libm::ilogb(extent) } else { 0 };
        let unit = libm::scalbn(1.0, -exponent);

        let upwind = unit_vector(wind.map(|x| -x));
        let across = unit_vector(vec3::perpendicular(upwind.map(|x| x as f32)).map(f64::from));
        // The axis found in f32 is at a right angle to the wind to its rounding; this takes the rest.
        let along = dot(across, upwind);
        let across = unit_vector([0, 1, 2].map(|k| across[k] - along * upwind[k]));
        let other = [1, 2, 0].map(|k| upwind[k] * across[(k + 1) % 3] - upwind[(k + 1) % 3] * across[k]);
        Self { middle, axes: [across, other, upwind].map(|axis| axis.map(|x| x * unit)), unit }
    }

    /// A point of the scene, in the frame.
    #[inline(always)]
    pub(super) fn at(&self, point: Vec3) -> Vec3 {
        let [x, y, z] = point;
        let from = [f64::from(x) - self.middle[0], f64::from(y) - self.middle[1], f64::from(z) - self.middle[2]];
        let [a, b, c] = &self.axes;
        [dot(*a, from) as f32, dot(*b, from) as f32, dot(*c, from) as f32]
    }

    /// A length of the scene, in the frame.
    pub(super) fn length(&self, metres: f32) -> f32 {
        (f64::from(metres) * self.unit) as f32
    }

    /// When a CV of this curve lies on a triangle.
    pub(super) fn gap(&self, cvs: &[Vec3], asked: f32) -> Gap {
        let Bounds { low, high } = Bounds::of(cvs);
        let size = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f32::max);
        let largest = vec3::largest(low).max(vec3::largest(high)) * (ULPS * f32::EPSILON);
        Gap {
            least: self.length(asked.max(largest)),
            most: if size > 0.0 { self.length(size) * HAIR } else { f32::INFINITY },
        }
    }
}

/// Least and largest coordinates; of nothing, both 0.
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    /// Of the finite ones of some points.
    fn of(points: &[Vec3]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in points {
            for axis in 0..3 {
                let x = point[axis];
                let finite = x.abs() < f32::INFINITY;
                low[axis] = if (x < low[axis]) & finite { x } else { low[axis] };
                high[axis] = if (x > high[axis]) & finite { x } else { high[axis] };
            }
        }
        let some = |axis: usize, x: f32| if low[axis] <= high[axis] { x } else { 0.0 };
        Self { low: [0, 1, 2].map(|axis| some(axis, low[axis])), high: [0, 1, 2].map(|axis| some(axis, high[axis])) }
    }

    fn middle(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| 0.5 * f64::from(self.low[axis]) + 0.5 * f64::from(self.high[axis]))
    }

    /// The largest coordinate as seen from `middle`.
    fn reach(&self, middle: [f64; 3]) -> f64 {
        let reach = |axis: usize| {
            let [low, high] = [self.low[axis], self.high[axis]].map(|x| (f64::from(x) - middle[axis]).abs());
            low.max(high)
        };
        reach(0).max(reach(1)).max(reach(2))
    }
}

/// The curves' numbers, so that neighbours across the wind follow each other: along a Z-curve.
pub(super) fn neighbours(frame: &Frame, starts: &[u32], points: &[Vec3]) -> Vec<u32> {
    let key = |(curve, ends): (usize, &[u32])| {
        let [x, y, _] = if ends[0] < ends[1] { frame.at(points[ends[0] as usize]) } else { [0.0; 3] };
        // −2…2 to 16 bits.
        let cell = |x: f32| spread(((x + 2.0) * 16_384.0) as u32 & 0xffff);
        u64::from(cell(x) | cell(y) << 1) << 32 | curve as u64
    };
    let mut keys: Vec<u64> = starts.par_windows(2).enumerate().map(key).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Sixteen bits, a zero between each two.
fn spread(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `v` at length 1; its numbers are brought near 1 first, so that any length but 0 will do.
fn unit_vector(v: [f64; 3]) -> [f64; 3] {
    let largest = v.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let v = v.map(|x| x / largest);
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_a_turn_with_its_third_axis_upwind() {
        for wind in [[1.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.3, -0.2, 1e-3], [1e300, 1e300, 1.0]] {
            let frame = Frame::of(wind, &[[-1.0, 0.0, 0.0], [1.0, 0.5, 0.0]], &[]);
            assert_eq!((frame.unit, frame.middle), (1.0, [0.0, 0.25, 0.0]));
            let [a, b, c] = frame.axes;
            assert!(dot(a, b).abs() < 1e-15 && dot(b, c).abs() < 1e-15 && dot(c, a).abs() < 1e-15);
            assert!([a, b, c].iter().all(|axis| (dot(*axis, *axis) - 1.0).abs() < 1e-15));
            assert!((dot(c, unit_vector(wind)) + 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn any_scene_is_brought_below_two() {
        for scale in [1e-40_f32, 1e-6, 1.0, 1e6, 3e38] {
            let points = [[0.0, 0.0, 0.0], [scale, 0.0, 0.0]];
            let frame = Frame::of([1.0, 0.0, 0.0], &points, &[]);
            let [.., upwind] = frame.at(points[0]);
            assert!((1.0..2.0).contains(&upwind), "{upwind}");
        }
    }

    #[test]
    fn curves_side_by_side_follow_each_other() {
        // A row across the wind, numbered at random: sorted, each step is to the next place.
        let place = [5, 2, 7, 0, 3, 6, 1, 4];
        let points: Vec<Vec3> = place.iter().map(|k| [0.0, *k as f32, 0.0]).collect();
        let starts: Vec<u32> = (0..=8).collect();
        let order = neighbours(&Frame::of([0.0, 0.0, 1.0], &points, &[]), &starts, &points);
        let along: Vec<i32> = order.iter().map(|curve| place[*curve as usize]).collect();
        assert!(along.is_sorted() || along.iter().rev().is_sorted(), "{along:?}");
    }
}
