//! The frame of the wind: two axes across it and the third upwind, from the centre of the curves, in a
//! power-of-two unit in which all coordinates are below 2.

use super::Collider;
use numerics::lanes::{F32x16, F64x16, LANES, Lanes, get, set};
use numerics::simd::{Path, kernel};
use numerics::vector::{self, DVec3, Vec3, direction, to_f32, to_f64};

/// The map from the scene to the frame.
pub(super) struct Frame {
    centre: DVec3,
    /// Two axes across the wind and the one upwind, each of length `unit`.
    axes: [DVec3; 3],
    /// Frame units per metre.
    unit: f64,
}

/// Largest distance of a CV on a triangle from its plane, in the frame's unit: [`SKIN`] times the collider's size, but
/// at most `most` and at least `least`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gap {
    least: f32,
    most: f32,
}

impl Gap {
    /// The gap for a collider of this size.
    #[inline(always)]
    pub(super) fn at(self, size: f32) -> f32 {
        self.least.max(self.most.min(SKIN * size))
    }
}

/// Relative to a collider's size: above the rounding of text files with six digits, below any modelled gap.
const SKIN: f32 = 1e-5;

/// Relative to a curve's size: 1e-5 of a collider as large as a landscape is longer than a hair.
const HAIR: f32 = 1e-2;

/// Rounding error of a position and of the plane of a triangle there, in ulp.
const ULPS: f32 = 4.0;

impl Frame {
    /// `None` if `wind` has no direction.
    pub(super) fn of(wind: [f64; 3], points: &[Vec3], colliders: &[Collider<'_>]) -> Option<Self> {
        let upwind = direction(-DVec3::from(wind))?;
        let path = Path::chosen();
        let bounds = bounds_of(path, points);
        let centre = bounds.centre();
        let reach = colliders.iter().map(|collider| bounds_of(path, collider.points).reach(centre));
        let extent = reach.fold(bounds.reach(centre), f64::max);
        let exponent = if extent > 0.0 { libm::ilogb(extent) } else { 0 };
        let unit = libm::scalbn(1.0, -exponent);

        let across = direction(to_f64(vector::perpendicular(to_f32(upwind))))?;
        // Found in f32, it is perpendicular to the wind to f32 rounding only; this removes the rest.
        let across = direction(across - upwind * across.dot(&upwind))?;
        let axes = [across, upwind.cross(&across), upwind].map(|axis| axis * unit);
        Some(Self { centre, axes, unit })
    }

    /// A point of the scene in the frame, without lanes.
    #[cfg(test)]
    pub(super) fn at(&self, point: Vec3) -> Vec3 {
        let from_centre = to_f64(point) - self.centre;
        let [a, b, c] = &self.axes;
        [a.dot(&from_centre) as f32, b.dot(&from_centre) as f32, c.dot(&from_centre) as f32]
    }

    /// Points of the scene in the frame.
    #[inline(always)]
    pub(super) fn at_lanes(&self, points: &Lanes<3>) -> Lanes<3> {
        let mut from_centre = [F64x16::ZERO; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                from_centre[axis].0[lane] = f64::from(points[axis].0[lane]) - self.centre[axis];
            }
        }
        let [x, y, z] = &from_centre;
        let mut out = *points;
        for axis in 0..3 {
            let along = &self.axes[axis];
            for lane in 0..LANES {
                let sum = along.x * x.0[lane] + along.y * y.0[lane] + along.z * z.0[lane];
                out[axis].0[lane] = sum as f32;
            }
        }
        out
    }

    /// A length of the scene in the frame.
    #[inline(always)]
    pub(super) fn length(&self, metres: f32) -> f32 {
        (f64::from(metres) * self.unit) as f32
    }

    /// The gap for the CVs of a curve.
    #[inline(always)]
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

kernel! {
    /// Writes points of the scene in the frame.
    pub(super) fn write_framed(frame: &Frame, points: &[Vec3], framed: &mut [Vec3]) = write_framed_body;
}

#[inline(always)]
fn write_framed_body(frame: &Frame, points: &[Vec3], framed: &mut [Vec3]) {
    for (framed, points) in framed.chunks_mut(LANES).zip(points.chunks(LANES)) {
        let mut at = [F32x16::splat(0.0); 3];
        for lane in 0..points.len() {
            set(&mut at, lane, points[lane]);
        }
        let at = frame.at_lanes(&at);
        for lane in 0..framed.len() {
            framed[lane] = get(&at, lane);
        }
    }
}

kernel! {
    /// [`Bounds::of`] for many points.
    fn bounds_of(points: &[Vec3]) -> Bounds = Bounds::of;
}

/// Coordinates of sixteen points.
const COORDINATES: usize = 3 * LANES;

/// Smallest and largest coordinates; both 0 without points.
#[derive(Debug, PartialEq)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    /// Bounds of the points, coordinates that are not finite ignored.
    #[inline(always)]
    fn of(points: &[Vec3]) -> Self {
        let mut bounds = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };
        // As they lie in memory: those that are a multiple of three apart are along the same axis.
        let (sixteens, others) = points.as_flattened().as_chunks::<COORDINATES>();
        if !sixteens.is_empty() {
            bounds = Self::of_sixteens(sixteens);
        }
        for point in others.as_chunks::<3>().0 {
            for axis in 0..3 {
                bounds.add(axis, point[axis]);
            }
        }
        bounds.or_zero()
    }

    #[inline(always)]
    fn of_sixteens(sixteens: &[[f32; COORDINATES]]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; COORDINATES], [f32::NEG_INFINITY; COORDINATES]);
        for coordinates in sixteens {
            for k in 0..COORDINATES {
                let x = coordinates[k];
                let finite = x.abs() < f32::INFINITY;
                low[k] = if finite & (x < low[k]) { x } else { low[k] };
                high[k] = if finite & (x > high[k]) { x } else { high[k] };
            }
        }
        // Halves, quarters…, each of a multiple of three.
        let (mut eight, mut four, mut two) = ([[0.0; 24]; 2], [[0.0; 12]; 2], [[0.0; 6]; 2]);
        for k in 0..24 {
            eight[0][k] = lesser(low[k], low[k + 24]);
            eight[1][k] = larger(high[k], high[k + 24]);
        }
        for k in 0..12 {
            four[0][k] = lesser(eight[0][k], eight[0][k + 12]);
            four[1][k] = larger(eight[1][k], eight[1][k + 12]);
        }
        for k in 0..6 {
            two[0][k] = lesser(four[0][k], four[0][k + 6]);
            two[1][k] = larger(four[1][k], four[1][k + 6]);
        }
        let mut bounds = Self { low: [0.0; 3], high: [0.0; 3] };
        for k in 0..3 {
            bounds.low[k] = lesser(two[0][k], two[0][k + 3]);
            bounds.high[k] = larger(two[1][k], two[1][k + 3]);
        }
        bounds
    }

    /// Adds a coordinate, unless it is not finite.
    #[inline(always)]
    fn add(&mut self, axis: usize, x: f32) {
        let x = if x.abs() < f32::INFINITY { x } else { f32::NAN };
        self.low[axis] = if x < self.low[axis] { x } else { self.low[axis] };
        self.high[axis] = if x > self.high[axis] { x } else { self.high[axis] };
    }

    /// The same, with 0 along axes without coordinates.
    #[inline(always)]
    fn or_zero(self) -> Self {
        let mut bounds = Self { low: [0.0; 3], high: [0.0; 3] };
        for axis in 0..3 {
            if self.low[axis] <= self.high[axis] {
                (bounds.low[axis], bounds.high[axis]) = (self.low[axis], self.high[axis]);
            }
        }
        bounds
    }

    fn centre(&self) -> DVec3 {
        to_f64(self.low) * 0.5 + to_f64(self.high) * 0.5
    }

    /// The largest coordinate relative to `centre`.
    fn reach(&self, centre: DVec3) -> f64 {
        (to_f64(self.low) - centre).amax().max((to_f64(self.high) - centre).amax())
    }
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_a_rotation_with_its_third_axis_upwind() {
        for wind in [[1.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.3, -0.2, 1e-3], [1e300, 1e300, 1.0]] {
            let frame = Frame::of(wind, &[[-1.0, 0.0, 0.0], [1.0, 0.5, 0.0]], &[]).unwrap();
            assert_eq!((frame.unit, frame.centre), (1.0, DVec3::new(0.0, 0.25, 0.0)));
            let [a, b, c] = frame.axes;
            assert!(a.dot(&b).abs() < 1e-15 && b.dot(&c).abs() < 1e-15 && c.dot(&a).abs() < 1e-15);
            assert!([a, b, c].iter().all(|axis| (axis.norm_squared() - 1.0).abs() < 1e-15));
            assert!((c.dot(&direction(wind.into()).unwrap()) + 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn bounds_of_many_points_are_those_of_each() {
        let coordinate = |k: u64| match k % 41 {
            7 => f32::NAN,
            8 => f32::INFINITY,
            9 => f32::NEG_INFINITY,
            _ => numerics::random::Key::new(5).of(k).between([-3.0, 2.0]),
        };
        for count in [0, 1, 2, 15, 16, 17, 100, 333] {
            let points: Vec<Vec3> = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2].map(coordinate)).collect();
            let mut each = Bounds { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };
            points.iter().for_each(|point| (0..3).for_each(|axis| each.add(axis, point[axis])));
            let each = each.or_zero();
            for path in Path::all() {
                assert_eq!(bounds_of(path, &points), each, "{count}");
            }
        }
    }

    #[test]
    fn many_points_are_framed_as_each_is() {
        let points: Vec<Vec3> = (0..333).map(|k| [k as f32, 0.1 * k as f32, 5.0 - k as f32]).collect();
        let frame = Frame::of([1.0, 0.3, -0.2], &points, &[]).unwrap();
        let mut framed = vec![[0.0; 3]; points.len()];
        write_framed(Path::chosen(), &frame, &points, &mut framed);
        assert!(framed.iter().zip(&points).all(|(framed, point)| *framed == frame.at(*point)));
    }

    #[test]
    fn any_scene_is_scaled_below_two() {
        for scale in [1e-40_f32, 1e-6, 1.0, 1e6, 3e38] {
            let points = [[0.0, 0.0, 0.0], [scale, 0.0, 0.0]];
            let frame = Frame::of([1.0, 0.0, 0.0], &points, &[]).unwrap();
            let [.., upwind] = frame.at(points[0]);
            assert!((1.0..2.0).contains(&upwind), "{upwind}");
        }
    }
}
