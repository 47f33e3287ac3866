//! Sixteen points in a lattice, side by side.

use super::turn::Matrix;
use super::{Basis, Lattice, Outside};
use numerics::lanes::LANES;
use numerics::simd::kernel;

/// Sixteen `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Lane(pub(super) [f64; LANES]);

const ZERO: Lane = Lane([0.0; LANES]);

/// Sixteen points: where they are, how far they move, and the derivative of that.
#[derive(Clone)]
pub(super) struct Group {
    at: [Lane; 3],
    shift: [Lane; 3],
    /// By axis of space that is differed along, then by component.
    slopes: [[Lane; 3]; 3],
    /// Of the whole map's derivative.
    pub(super) determinant: Lane,
}

impl Default for Group {
    fn default() -> Self {
        Self { at: [ZERO; 3], shift: [ZERO; 3], slopes: [[ZERO; 3]; 3], determinant: ZERO }
    }
}

impl Group {
    /// Takes up to sixteen points; lanes that are left keep what they had.
    pub(super) fn load(&mut self, points: &[[f32; 3]]) {
        for (lane, point) in points.iter().enumerate() {
            for k in 0..3 {
                self.at[k].0[lane] = f64::from(point[k]);
            }
        }
    }

    /// Moves the points.
    pub(super) fn store(&self, points: &mut [[f32; 3]]) {
        for (lane, point) in points.iter_mut().enumerate() {
            for k in 0..3 {
                // 0 added to −0 is 0: what does not move is not written.
                if self.shift[k].0[lane] != 0.0 {
                    point[k] = (self.at[k].0[lane] + self.shift[k].0[lane]) as f32;
                }
            }
        }
    }

    /// The map's derivatives.
    pub(super) fn jacobians(&self, jacobians: &mut [Matrix]) {
        for (lane, jacobian) in jacobians.iter_mut().enumerate() {
            for row in 0..3 {
                for axis in 0..3 {
                    let own = if row == axis { 1.0 } else { 0.0 };
                    jacobian[row][axis] = own + self.slopes[axis][row].0[lane];
                }
            }
        }
    }
}

/// What a control point's place along an axis counts for, and the derivative of that.
#[derive(Clone, Copy)]
struct Share {
    value: Lane,
    slope: Lane,
}

const NONE: Share = Share { value: ZERO, slope: ZERO };

/// Memory that groups use one after the other.
#[derive(Default)]
pub(super) struct Scratch {
    /// By axis, of each control point along it that counts.
    shares: [Vec<Share>; 3],
}

kernel! {
    /// Finds how a group moves.
    pub(super) fn move_group(lattice: &Lattice<'_>, scratch: &mut Scratch, group: &mut Group) = move_body;
}

#[inline(always)]
fn move_body(lattice: &Lattice<'_>, scratch: &mut Scratch, group: &mut Group) {
    let mut cells = [[0_usize; LANES]; 3];
    for axis in 0..3 {
        let (inside, beyond) = places(lattice, axis, &group.at[axis]);
        let shares = &mut scratch.shares[axis];
        match lattice.basis {
            Basis::Trilinear => cells[axis] = tents(lattice.divisions[axis], &inside, shares),
            Basis::Bernstein => bernstein(lattice.divisions[axis], &inside, shares),
        }
        for share in shares.iter_mut() {
            outside(lattice, axis, &group.at[axis], &beyond, share);
        }
    }
    let [shares_x, shares_y, shares_z] = &scratch.shares;
    let shares = [&shares_x[..], &shares_y[..], &shares_z[..]];
    let [along_x, along_y, _] = lattice.divisions.map(|cells| cells + 1);
    match lattice.basis {
        Basis::Bernstein => {
            let control = |[i, j, k]: [usize; 3]| {
                let offset = lattice.offsets[i + along_x * (j + along_y * k)];
                offset.map(|x| Lane([f64::from(x); LANES]))
            };
            sum(shares, control, group);
        }
        Basis::Trilinear => {
            let control = |place: [usize; 3]| {
                let mut offsets = [ZERO; 3];
                for lane in 0..LANES {
                    let [i, j, k] = [0, 1, 2].map(|axis| cells[axis][lane] + place[axis]);
                    let offset = lattice.offsets[i + along_x * (j + along_y * k)];
                    for component in 0..3 {
                        offsets[component].0[lane] = f64::from(offset[component]);
                    }
                }
                offsets
            };
            sum(shares, control, group);
        }
    }
    determinants(group);
}

/// Where points are along an axis of the box, 0 to 1, and how far beyond.
#[inline(always)]
fn places(lattice: &Lattice<'_>, axis: usize, at: &Lane) -> (Lane, Lane) {
    let (mut inside, mut beyond) = (ZERO, ZERO);
    for lane in 0..LANES {
        let place = (at.0[lane] - lattice.from[axis]) / lattice.extent[axis];
        let within = if place < 0.0 { 0.0 } else { place };
        let within = if within > 1.0 { 1.0 } else { within };
        inside.0[lane] = within;
        beyond.0[lane] = place - within;
    }
    (inside, beyond)
}

/// Shares of the two control points around each point, and which cell it is in. A point between two cells belongs to the
/// upper one.
#[inline(always)]
fn tents(divisions: usize, place: &Lane, shares: &mut Vec<Share>) -> [usize; LANES] {
    shares.clear();
    shares.resize(2, NONE);
    let (many, last) = (divisions as f64, (divisions - 1) as f64);
    let mut cells = [0; LANES];
    for lane in 0..LANES {
        let at = place.0[lane] * many;
        let cell = at.floor();
        let cell = if cell > last { last } else { cell };
        cells[lane] = cell as usize;
        shares[0].value.0[lane] = 1.0 - (at - cell);
        shares[1].value.0[lane] = at - cell;
        shares[0].slope.0[lane] = -many;
        shares[1].slope.0[lane] = many;
    }
    cells
}

/// Bernstein polynomials of degree n, from those of n − 1 as de Casteljau's scheme has them: sums of products of numbers
/// from 0 to 1, so no digit is lost. B′ᵢⁿ = n·(Bᵢ₋₁ⁿ⁻¹ − Bᵢⁿ⁻¹).
#[inline(always)]
fn bernstein(degree: usize, place: &Lane, shares: &mut Vec<Share>) {
    shares.clear();
    shares.resize(degree + 1, NONE);
    shares[0].value = Lane([1.0; LANES]);
    for reached in 1..=degree {
        for i in (0..=reached).rev() {
            let (own, before) = (shares[i].value, if i > 0 { shares[i - 1].value } else { ZERO });
            for lane in 0..LANES {
                let t = place.0[lane];
                shares[i].value.0[lane] = (1.0 - t) * own.0[lane] + t * before.0[lane];
                // Overwritten by each degree; the last one stays.
                shares[i].slope.0[lane] = degree as f64 * (before.0[lane] - own.0[lane]);
            }
        }
    }
}

/// Of a point's distance from the origin and the box's extent: what rounding puts so far outside still has the box's own
/// slopes. A box around an object is as large as it, and f32 rounds by a sixteenth of this.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// Makes a share that of the points outside, too, and its slope one a metre.
#[inline(always)]
fn outside(lattice: &Lattice<'_>, axis: usize, at: &Lane, beyond: &Lane, share: &mut Share) {
    let extends = if lattice.outside == Outside::Extend { 1.0 } else { 0.0 };
    let extent = lattice.extent[axis];
    for lane in 0..LANES {
        let beyond = beyond.0[lane];
        let slope = share.slope.0[lane];
        share.value.0[lane] += extends * slope * beyond;
        let inside = beyond.abs() * extent <= ROUNDING * (at.0[lane].abs() + extent);
        let kept = if inside { 1.0 } else { extends };
        share.slope.0[lane] = kept * slope / extent;
    }
}

/// Σ shares · offsets, row by row, plane by plane, and its derivatives.
#[inline(always)]
fn sum(shares: [&[Share]; 3], control: impl Fn([usize; 3]) -> [Lane; 3], group: &mut Group) {
    let (mut shift, mut slopes) = ([ZERO; 3], [[ZERO; 3]; 3]);
    for (k, z) in shares[2].iter().enumerate() {
        let (mut plane, mut plane_x, mut plane_y) = ([ZERO; 3], [ZERO; 3], [ZERO; 3]);
        for (j, y) in shares[1].iter().enumerate() {
            let (mut row, mut row_x) = ([ZERO; 3], [ZERO; 3]);
            for (i, x) in shares[0].iter().enumerate() {
                let offset = control([i, j, k]);
                add(&mut row, &x.value, &offset);
                add(&mut row_x, &x.slope, &offset);
            }
            add(&mut plane, &y.value, &row);
            add(&mut plane_x, &y.value, &row_x);
            add(&mut plane_y, &y.slope, &row);
        }
        add(&mut shift, &z.value, &plane);
        add(&mut slopes[0], &z.value, &plane_x);
        add(&mut slopes[1], &z.value, &plane_y);
        add(&mut slopes[2], &z.slope, &plane);
    }
    (group.shift, group.slopes) = (shift, slopes);
}

/// `to` + `share` · `of`.
#[inline(always)]
fn add(to: &mut [Lane; 3], share: &Lane, of: &[Lane; 3]) {
    for component in 0..3 {
        for lane in 0..LANES {
            to[component].0[lane] += share.0[lane] * of[component].0[lane];
        }
    }
}

#[inline(always)]
fn determinants(group: &mut Group) {
    let [x, y, z] = &group.slopes;
    for lane in 0..LANES {
        let [a, b, c] = [1.0 + x[0].0[lane], y[0].0[lane], z[0].0[lane]];
        let [d, e, f] = [x[1].0[lane], 1.0 + y[1].0[lane], z[1].0[lane]];
        let [g, h, i] = [x[2].0[lane], y[2].0[lane], 1.0 + z[2].0[lane]];
        group.determinant.0[lane] = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    }
}
