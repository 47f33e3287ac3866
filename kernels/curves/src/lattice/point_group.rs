//! Sixteen points in a lattice, side by side.

use super::{DeformationLattice, Extrapolation, LatticeBasis};
use numerics::lanes::{F64x16, LANES};
use numerics::simd::kernel;
use numerics::vector::DMat3;

const ZERO: F64x16 = F64x16::ZERO;

/// Sixteen points: positions, displacements and their derivatives.
#[derive(Clone)]
pub(super) struct PointGroup {
    positions: [F64x16; 3],
    displacements: [F64x16; 3],
    /// Derivatives of the displacements: by axis of the derivative, then by component.
    slopes: [[F64x16; 3]; 3],
    /// Determinants of the Jacobian of the map.
    pub(super) determinant: F64x16,
}

impl Default for PointGroup {
    fn default() -> Self {
        Self { positions: [ZERO; 3], displacements: [ZERO; 3], slopes: [[ZERO; 3]; 3], determinant: ZERO }
    }
}

impl PointGroup {
    /// Loads up to sixteen points; the remaining lanes keep their values.
    pub(super) fn load(&mut self, points: &[[f32; 3]]) {
        for (lane, point) in points.iter().enumerate() {
            for k in 0..3 {
                self.positions[k].0[lane] = f64::from(point[k]);
            }
        }
    }

    /// Moves the points.
    pub(super) fn store(&self, points: &mut [[f32; 3]]) {
        for (lane, point) in points.iter_mut().enumerate() {
            for k in 0..3 {
                // −0 + 0 is +0, so a coordinate that does not move is not written.
                if self.displacements[k].0[lane] != 0.0 {
                    point[k] = (self.positions[k].0[lane] + self.displacements[k].0[lane]) as f32;
                }
            }
        }
    }

    /// Writes the Jacobians of the map.
    pub(super) fn jacobians(&self, jacobians: &mut [DMat3]) {
        for (lane, jacobian) in jacobians.iter_mut().enumerate() {
            for row in 0..3 {
                for axis in 0..3 {
                    let own = if row == axis { 1.0 } else { 0.0 };
                    jacobian[(row, axis)] = own + self.slopes[axis][row].0[lane];
                }
            }
        }
    }
}

/// The basis function of a control point along one axis, and its derivative.
#[derive(Clone, Copy)]
struct Weight {
    value: F64x16,
    slope: F64x16,
}

const NO_WEIGHT: Weight = Weight { value: ZERO, slope: ZERO };

/// Buffers that groups reuse.
#[derive(Default)]
pub(super) struct Scratch {
    /// By axis, the weights of the control points along it.
    weights: [Vec<Weight>; 3],
}

kernel! {
    /// Finds the displacements of a group and their derivatives.
    pub(super) fn displace_group(lattice: &DeformationLattice<'_>, scratch: &mut Scratch, group: &mut PointGroup) = body;
}

#[inline(always)]
fn body(lattice: &DeformationLattice<'_>, scratch: &mut Scratch, group: &mut PointGroup) {
    let mut cells = [[0_usize; LANES]; 3];
    for axis in 0..3 {
        let (inside, beyond) = box_coordinates(lattice, axis, &group.positions[axis]);
        let weights = &mut scratch.weights[axis];
        match lattice.basis {
            LatticeBasis::Trilinear => cells[axis] = tents(lattice.divisions[axis], &inside, weights),
            LatticeBasis::Bernstein => bernstein(lattice.divisions[axis], &inside, weights),
        }
        for weight in weights.iter_mut() {
            extrapolate(lattice, axis, &group.positions[axis], &beyond, weight);
        }
    }
    let [weights_x, weights_y, weights_z] = &scratch.weights;
    let weights = [&weights_x[..], &weights_y[..], &weights_z[..]];
    let [along_x, along_y, _] = lattice.divisions.map(|cells| cells + 1);
    match lattice.basis {
        LatticeBasis::Bernstein => {
            let control = |[i, j, k]: [usize; 3]| {
                let offset = lattice.offsets[i + along_x * (j + along_y * k)];
                offset.map(|x| F64x16([f64::from(x); LANES]))
            };
            sum(weights, control, group);
        }
        LatticeBasis::Trilinear => {
            let control = |corner: [usize; 3]| {
                let mut offsets = [ZERO; 3];
                for lane in 0..LANES {
                    let [i, j, k] = [0, 1, 2].map(|axis| cells[axis][lane] + corner[axis]);
                    let offset = lattice.offsets[i + along_x * (j + along_y * k)];
                    for component in 0..3 {
                        offsets[component].0[lane] = f64::from(offset[component]);
                    }
                }
                offsets
            };
            sum(weights, control, group);
        }
    }
    determinants(group);
}

/// Coordinates along an axis of the box, 0 to 1, and the distance of the points beyond that range.
#[inline(always)]
fn box_coordinates(lattice: &DeformationLattice<'_>, axis: usize, positions: &F64x16) -> (F64x16, F64x16) {
    let (mut inside, mut beyond) = (ZERO, ZERO);
    for lane in 0..LANES {
        let along = (positions.0[lane] - lattice.from[axis]) / lattice.extent[axis];
        let within = if along < 0.0 { 0.0 } else { along };
        let within = if within > 1.0 { 1.0 } else { within };
        inside.0[lane] = within;
        beyond.0[lane] = along - within;
    }
    (inside, beyond)
}

/// Weights of the two control points around each point, and the cell it is in. A point on the boundary between two
/// cells belongs to the upper one.
#[inline(always)]
fn tents(divisions: usize, along: &F64x16, weights: &mut Vec<Weight>) -> [usize; LANES] {
    weights.clear();
    weights.resize(2, NO_WEIGHT);
    let (count, last) = (divisions as f64, (divisions - 1) as f64);
    let mut cells = [0; LANES];
    for lane in 0..LANES {
        let at = along.0[lane] * count;
        let cell = at.floor();
        let cell = if cell > last { last } else { cell };
        cells[lane] = cell as usize;
        weights[0].value.0[lane] = 1.0 - (at - cell);
        weights[1].value.0[lane] = at - cell;
        weights[0].slope.0[lane] = -count;
        weights[1].slope.0[lane] = count;
    }
    cells
}

/// Bernstein polynomials of degree n from those of degree n − 1, by de Casteljau's scheme: sums of products of numbers
/// from 0 to 1, without cancellation. B′ᵢⁿ = n·(Bᵢ₋₁ⁿ⁻¹ − Bᵢⁿ⁻¹).
#[inline(always)]
fn bernstein(degree: usize, along: &F64x16, weights: &mut Vec<Weight>) {
    weights.clear();
    weights.resize(degree + 1, NO_WEIGHT);
    weights[0].value = F64x16([1.0; LANES]);
    for reached in 1..=degree {
        for i in (0..=reached).rev() {
            let (own, before) = (weights[i].value, if i > 0 { weights[i - 1].value } else { ZERO });
            for lane in 0..LANES {
                let t = along.0[lane];
                weights[i].value.0[lane] = (1.0 - t) * own.0[lane] + t * before.0[lane];
                // Overwritten for each degree; the last one remains.
                weights[i].slope.0[lane] = degree as f64 * (before.0[lane] - own.0[lane]);
            }
        }
    }
}

/// Relative to a point's distance from the origin and the box's extent: a point that rounding puts this far outside
/// still has the slopes of the inside. f32 rounds by a sixteenth of this.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// Extends a weight to points outside the box, and makes its slope one per metre.
#[inline(always)]
fn extrapolate(
    lattice: &DeformationLattice<'_>,
    axis: usize,
    positions: &F64x16,
    beyond: &F64x16,
    weight: &mut Weight,
) {
    let extends = if lattice.extrapolation == Extrapolation::Extend { 1.0 } else { 0.0 };
    let extent = lattice.extent[axis];
    for lane in 0..LANES {
        let beyond = beyond.0[lane];
        let slope = weight.slope.0[lane];
        weight.value.0[lane] += extends * slope * beyond;
        let inside = beyond.abs() * extent <= ROUNDING * (positions.0[lane].abs() + extent);
        let kept = if inside { 1.0 } else { extends };
        weight.slope.0[lane] = kept * slope / extent;
    }
}

/// Σ weights · offsets, row by row, plane by plane, and its derivatives.
#[inline(always)]
fn sum(weights: [&[Weight]; 3], control: impl Fn([usize; 3]) -> [F64x16; 3], group: &mut PointGroup) {
    let (mut displacements, mut slopes) = ([ZERO; 3], [[ZERO; 3]; 3]);
    for (k, z) in weights[2].iter().enumerate() {
        let (mut plane, mut plane_x, mut plane_y) = ([ZERO; 3], [ZERO; 3], [ZERO; 3]);
        for (j, y) in weights[1].iter().enumerate() {
            let (mut row, mut row_x) = ([ZERO; 3], [ZERO; 3]);
            for (i, x) in weights[0].iter().enumerate() {
                let offset = control([i, j, k]);
                add_weighted(&mut row, &x.value, &offset);
                add_weighted(&mut row_x, &x.slope, &offset);
            }
            add_weighted(&mut plane, &y.value, &row);
            add_weighted(&mut plane_x, &y.value, &row_x);
            add_weighted(&mut plane_y, &y.slope, &row);
        }
        add_weighted(&mut displacements, &z.value, &plane);
        add_weighted(&mut slopes[0], &z.value, &plane_x);
        add_weighted(&mut slopes[1], &z.value, &plane_y);
        add_weighted(&mut slopes[2], &z.slope, &plane);
    }
    (group.displacements, group.slopes) = (displacements, slopes);
}

/// `to` + `weight` · `of`.
#[inline(always)]
fn add_weighted(to: &mut [F64x16; 3], weight: &F64x16, of: &[F64x16; 3]) {
    for component in 0..3 {
        for lane in 0..LANES {
            to[component].0[lane] += weight.0[lane] * of[component].0[lane];
        }
    }
}

#[inline(always)]
fn determinants(group: &mut PointGroup) {
    let [x, y, z] = &group.slopes;
    for lane in 0..LANES {
        let [a, b, c] = [1.0 + x[0].0[lane], y[0].0[lane], z[0].0[lane]];
        let [d, e, f] = [x[1].0[lane], 1.0 + y[1].0[lane], z[1].0[lane]];
        let [g, h, i] = [x[2].0[lane], y[2].0[lane], 1.0 + z[2].0[lane]];
        group.determinant.0[lane] = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    }
}
