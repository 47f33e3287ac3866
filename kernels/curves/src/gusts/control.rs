//! Gusts placed by hand: a sphere, or a cube within a cube, under any affine map.
//!
//! In a control's own space its centre is at 0 and its axes end at 1. The share of a point q there runs from 0 at the
//! centre to 1 at the boundary, where the influence ends:
//! * sphere: |q|;
//! * cubes: with m = max |qᵢ|, so that level sets are cubes, m/2 up to the inner boundary m = 1, and
//!   ½ + ½·max (|qᵢ| − 1)/(outerᵢ − 1) from there to the outer one, where some |qᵢ| is `outerᵢ`. Each of its six sides may
//!   have its own distance `outerᵢ` from the centre; level sets are then boxes.
//!
//! A control without volume (a scale of 0 along an axis) reaches nothing.

use numerics::lanes::{F32x16, LANES, Lanes};
use numerics::ramp::Ramp;
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};

/// The shape of a control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlShape {
    /// A ball.
    Sphere,
    /// A cube within a cube.
    Cubes,
}

/// A control is flat if its volume is less than this fraction of the product of its axes' lengths: above f32 rounding
/// of three coplanar axes, below any stretch in practice.
const FLAT: f64 = 1e-6;

/// A region with its own space and its own ramp.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    shape: ControlShape,
    centre: DVec3,
    axes: [DVec3; 3],
    /// Distances of the outer box's sides from the centre along the axes: below and above, 1 or more.
    outer: [DVec3; 2],
    ramp: Ramp,
    strength: f32,
    /// The matrix from the scene to the control's own space, row by row; `None` if it is flat.
    inverse: Option<[DVec3; 3]>,
}

impl Control {
    /// A control at `centre` whose own axes end at `centre + axes[k]`, metres. `outer` is the size of the outer cube
    /// relative to the inner one (less than 1 counts as 1); `strength` may be negative.
    pub fn new(
        shape: ControlShape,
        centre: [f64; 3],
        axes: [[f64; 3]; 3],
        outer: f64,
        ramp: Ramp,
        strength: f32,
    ) -> Self {
        let axes = axes.map(DVec3::from);
        let outer = [DVec3::repeat(at_least_1(outer)); 2];
        Self { shape, centre: centre.into(), axes, outer, ramp, strength, inverse: inverse(axes) }
    }

    /// The control with an outer box of its own, whose sides lie at −`below[k]` and `above[k]` along its axes, in lengths of
    /// these; less than 1 counts as 1.
    #[must_use]
    pub fn within_box(mut self, below: [f64; 3], above: [f64; 3]) -> Self {
        self.outer = [below, above].map(|sides| DVec3::from(sides.map(at_least_1)));
        self
    }

    /// The control with its influence multiplied.
    #[must_use]
    pub fn times(mut self, factor: f32) -> Self {
        self.strength *= factor;
        self
    }

    pub(super) fn centre(&self) -> DVec3 {
        self.centre
    }

    pub(super) fn ramp(&self) -> &Ramp {
        &self.ramp
    }

    pub(super) fn strength(&self) -> f32 {
        self.strength
    }

    /// Half its extent along x, y and z; `None` if it reaches nothing.
    pub(super) fn reach(&self) -> Option<DVec3> {
        self.inverse.filter(|_| self.strength != 0.0)?;
        let ends = |axis: usize| DVec3::from(self.axes.map(|end| end[axis]));
        let extent = |axis: usize| match self.shape {
            ControlShape::Sphere => ends(axis).norm(),
            // About the centre, so that an outer box that is not is enclosed, too.
            ControlShape::Cubes => ends(axis).abs().dot(&self.outer[0].sup(&self.outer[1])),
        };
        Some(DVec3::new(extent(0), extent(1), extent(2)))
    }

    /// Whether its influence is nowhere negative.
    pub fn only_adds(&self) -> bool {
        let [least, most] = [self.ramp.min(), self.ramp.max()].map(|value| value * self.strength);
        least >= 0.0 && most >= 0.0
    }

    /// The control relative to a nearby point.
    pub(super) fn local(&self, origin: Vec3) -> Local {
        let inverse = self.inverse.unwrap_or_default();
        Local {
            shape: self.shape,
            centre: to_f32(self.centre - to_f64(origin)),
            rows: inverse.map(to_f32),
            beyond: self.outer.map(|sides| to_f32(sides.map(|side| 0.5 / (side - 1.0)))),
        }
    }
}

/// A control relative to a point.
pub(super) struct Local {
    shape: ControlShape,
    centre: Vec3,
    rows: [Vec3; 3],
    /// Increase of the share per unit beyond the inner cube, below and above the centre along each axis; infinite where the
    /// outer box ends there, too.
    beyond: [Vec3; 2],
}

impl Local {
    /// The shares of sixteen points, from the centre (0) to the outer boundary (1).
    #[inline(always)]
    pub(super) fn share(&self, at: &Lanes<3>) -> F32x16 {
        let mut own = [F32x16::splat(0.0); 3];
        for row in 0..3 {
            for lane in 0..LANES {
                let mut sum = 0.0;
                for axis in 0..3 {
                    sum += self.rows[row][axis] * (at[axis].0[lane] - self.centre[axis]);
                }
                own[row].0[lane] = sum;
            }
        }
        let mut share = F32x16::splat(0.0);
        match self.shape {
            ControlShape::Sphere => {
                for lane in 0..LANES {
                    share.0[lane] = vector::length([own[0].0[lane], own[1].0[lane], own[2].0[lane]]);
                }
            }
            ControlShape::Cubes => {
                for lane in 0..LANES {
                    let (mut most, mut outside) = (0.0, 0.0);
                    for axis in 0..3 {
                        let along = own[axis].0[lane];
                        let size = along.abs();
                        let beyond = if along < 0.0 { self.beyond[0][axis] } else { self.beyond[1][axis] };
                        // Within the inner cube's range infinity times 0 does not count.
                        let past = if size > 1.0 { (size - 1.0) * beyond } else { 0.0 };
                        most = if size > most { size } else { most };
                        outside = if past > outside { past } else { outside };
                    }
                    share.0[lane] = if most > 1.0 { 0.5 + outside } else { 0.5 * most };
                }
            }
        }
        share
    }
}

fn at_least_1(side: f64) -> f64 {
    if side > 1.0 { side } else { 1.0 }
}

/// The inverse of the matrix whose columns are `axes`, row by row; `None` if they span no volume.
fn inverse(axes: [DVec3; 3]) -> Option<[DVec3; 3]> {
    // Each axis is normalised first: no product overflows, and flatness does not depend on scale.
    let lengths = axes.map(|axis| axis.norm());
    if !lengths.iter().all(|length| (1e-150..1e150).contains(length)) {
        return None;
    }
    let [a, b, c] = std::array::from_fn(|k| axes[k] / lengths[k]);
    let volume = a.dot(&b.cross(&c));
    if volume.abs() <= FLAT {
        return None;
    }
    let rows = [b.cross(&c), c.cross(&a), a.cross(&b)];
    Some(std::array::from_fn(|k| rows[k] / volume / lengths[k]))
}

/// The first rows of an outline: its centre and the ends of its x, y and z axes.
pub const AXIS_ROWS: usize = 4;

/// Minimum number of points of a great circle, and of a cube's edge.
const CIRCLE: usize = 32;
const EDGE: usize = 6;

/// Points that draw a control in its own space: [`AXIS_ROWS`], then a sphere's three great circles or the edges of the
/// inner cube and of the outer box, from −`outer[0]` to `outer[1]`. At least `least` points.
pub fn outline(shape: ControlShape, outer: [[f64; 3]; 2], least: usize) -> Vec<[f32; 3]> {
    let mut points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    match shape {
        ControlShape::Sphere => circles(CIRCLE.max(least.div_ceil(3)), &mut points),
        ControlShape::Cubes => {
            let edge = EDGE.max(least.div_ceil(24));
            edges([[1.0; 3]; 2], edge, &mut points);
            edges(outer, edge, &mut points);
        }
    }
    points
}

/// Unit circles about x, y and z.
fn circles(count: usize, points: &mut Vec<[f32; 3]>) {
    for axis in 0..3 {
        for k in 0..count {
            let angle = std::f64::consts::TAU * k as f64 / count as f64;
            let mut point = [0.0; 3];
            point[(axis + 1) % 3] = libm::cos(angle) as f32;
            point[(axis + 2) % 3] = libm::sin(angle) as f32;
            points.push(point);
        }
    }
}

/// The twelve edges of a box from −`sides[0]` to `sides[1]`, with both corners of each.
fn edges([below, above]: [[f64; 3]; 2], count: usize, points: &mut Vec<[f32; 3]>) {
    for axis in 0..3 {
        let [middle, half] = [above[axis] - below[axis], above[axis] + below[axis]].map(|x| 0.5 * x);
        for corner in 0..4 {
            for k in 0..count {
                let mut point = [0.0; 3];
                point[axis] = (middle + half * (2.0 * k as f64 / (count - 1) as f64 - 1.0)) as f32;
                for (bit, across) in [(1, (axis + 1) % 3), (2, (axis + 2) % 3)] {
                    point[across] = if corner & bit == 0 { -below[across] } else { above[across] } as f32;
                }
                points.push(point);
            }
        }
    }
}
