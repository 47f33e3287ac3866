//! The frame of the wind: two axes across it and the third upwind, from the middle of the curves, in a
//! power of two of metres that brings the scene below 2.

use super::Collider;
use numerics::vector::{self, Vec3};

/// From a point of the scene to the frame.
pub(super) struct Frame {
    middle: [f64; 3],
    /// Across, across and upwind, each as long as the frame's unit is short.
    axes: [[f64; 3]; 3],
    unit: f64,
}

/// When a CV lies on a triangle, in the frame's unit: within `least` of its plane, or within
/// `share` of the collider's size while that is not more than `most`.
#[derive(Clone, Copy, Debug, Default)]
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
        let across = unit_vector(vector::perpendicular(upwind.map(|x| x as f32)).map(f64::from));
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
        let largest = vector::largest(low).max(vector::largest(high)) * (ULPS * f32::EPSILON);
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
                let x = if point[axis].abs() < f32::INFINITY { point[axis] } else { f32::NAN };
                low[axis] = if x < low[axis] { x } else { low[axis] };
                high[axis] = if x > high[axis] { x } else { high[axis] };
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
}
