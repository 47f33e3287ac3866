//! The viscous equation on one grid: its matrix, products with it, and the smoother.
//!
//! Strain first, then its divergence: a rigid motion has no strain but for rounding, whatever the viscosity.

use numerics::simd::{Path, kernel};

use crate::chebyshev::{Chebyshev, Weights};
use crate::fields::in_parts;
use crate::rows::{Cell, CellRows, Images};
use crate::stencil::{Run, Stencil};
use crate::velocity::FaceFields;

use super::extension::Extensions;

/// What the low face of a cell is to the velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum FaceKind {
    /// In air: no velocity.
    #[default]
    Air,
    /// An unknown velocity.
    Free,
    /// Moves with a solid.
    Solid,
}

/// For each free face, mass · u − Σ differences of stress.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Active: every cell with a free low face or a stress.
    pub stencil: Stencil,
    /// Whether a cell is liquid: then each of its faces is free or solid, and every free face belongs to such a cell.
    pub liquid: Vec<bool>,
    pub kinds: FaceFields<FaceKind>,
    /// Of each free face; 0 of others.
    pub mass: FaceFields<f32>,
    /// 2ν of a cell, where its normal stresses act.
    pub normal: Vec<f32>,
    /// ν of the edges along x, y and z at the low corner of a cell, where its shear stresses act.
    pub shear: FaceFields<f32>,
    /// Of the faces in air, on coarse grids: there velocities have values too where a stress needs them.
    pub extensions: Option<Extensions>,
    /// 1 ÷ the diagonal of the matrix; 0 where the face is not free.
    pub inverse_diagonal: FaceFields<f32>,
    /// Cells that repeat others; kinds are theirs, but masses and viscosities are 0.
    pub images: Images,
}

/// Cells stored around liquid: interpolation and extension read two beyond a free face.
pub(super) const HALO: i32 = 2;

/// The cell below along `axis`.
pub(super) fn lower(mut cell: Cell, axis: usize) -> Cell {
    cell[axis] -= 1;
    cell
}

/// The stresses of a velocity.
#[derive(Clone, Debug)]
pub(super) struct Stresses<T> {
    normal: FaceFields<T>,
    shear: FaceFields<T>,
}

impl<T: Copy + Default> Stresses<T> {
    pub(super) fn zero(len: usize) -> Self {
        let zero = || std::array::from_fn(|_| vec![T::default(); len]);
        Self { normal: zero(), shear: zero() }
    }
}

/// What a smoothing takes from errors.
const SMOOTHER: Chebyshev = Chebyshev { largest: 3.3, ratio: 16.0, degree: 4 };

impl Level {
    /// The matrix of the faces with a mass; `inverse_diagonal` is not read.
    pub(super) fn with_diagonal(mut self) -> Self {
        let mut diagonal: FaceFields<f64> = std::array::from_fn(|_| vec![0.0; self.normal.len()]);
        let [x, y, z] = &mut diagonal;
        self.stencil.update([x, y, z], |runs, first, out| {
            for run in runs {
                for n in 0..run.len as usize {
                    let at = run.at as usize + n;
                    (0..3).for_each(|axis| out[axis][at - first] = self.own_diagonal(run, n, axis));
                }
            }
        });
        if let Some(extensions) = &self.extensions {
            extensions.add_diagonal(&mut diagonal);
        }
        self.inverse_diagonal = std::array::from_fn(|axis| {
            let free = self.mass[axis].iter().map(|mass| *mass > 0.0);
            let inverse = diagonal[axis].iter().map(|diagonal| (1.0 / diagonal) as f32);
            inverse.zip(free).map(|(inverse, is_free)| if is_free { inverse } else { 0.0 }).collect()
        });
        self
    }

    /// The mass of a face, and the viscosities around it.
    fn own_diagonal(&self, run: &Run, n: usize, axis: usize) -> f64 {
        let (at, below, above) = run.neighbours(n);
        let [below, above] = [below, above].map(|near| near.map(|at| self.images.home(at)));
        let (side, other) = ((axis + 1) % 3, (axis + 2) % 3);
        let terms = [
            self.mass[axis][at],
            self.normal[at],
            self.normal[below[axis]],
            // The edges along `other` bound the face along `side`, and the other way round.
            self.shear[other][at],
            self.shear[other][above[side]],
            self.shear[side][at],
            self.shear[side][above[other]],
        ];
        terms.into_iter().map(f64::from).sum()
    }

    pub(super) fn rows(&self) -> &CellRows {
        self.stencil.rows()
    }

    /// `out` = A·`u` at free faces. `u` has the solids' velocities at their faces; `stresses` is scratch that is 0
    /// outside the active cells.
    pub(super) fn apply(&self, u: &mut FaceFields<f64>, stresses: &mut Stresses<f64>, out: &mut FaceFields<f64>) {
        let path = Path::chosen();
        if let Some(extensions) = &self.extensions {
            extensions.extend(u);
        }
        self.images.fill_each(u);
        self.stress(path, u, stresses, strain_f64);
        let balance = Balance { mass: &self.mass, stresses, u };
        let [x, y, z] = out;
        self.stencil.update([x, y, z], |runs, first, out| apply_f64(path, runs, first, &balance, out));
        if let Some(extensions) = &self.extensions {
            extensions.gather(out);
            extensions.clear(u);
        }
        for (out, mass) in out.iter_mut().zip(&self.mass) {
            in_parts(out, |first, part| {
                for (out, mass) in part.iter_mut().zip(&mass[first..]) {
                    *out = if *mass == 0.0 { 0.0 } else { *out };
                }
            });
        }
    }

    /// The net stress on the solid faces that `counts` picks, by axis and cell.
    pub(super) fn solid_impulse(&self, u: &FaceFields<f64>, counts: impl Fn(usize, Cell) -> bool) -> [f64; 3] {
        let mut stresses = Stresses::zero(self.normal.len());
        self.stress(Path::chosen(), u, &mut stresses, strain_f64);
        let mut sum = [0.0; 3];
        let mut give = |axis: usize, cell: Cell, stress: f64| {
            let cell = self.images.periods().home(cell);
            let is_solid = |at: usize| self.kinds[axis][at] == FaceKind::Solid;
            if stress != 0.0 && self.rows().find(cell).is_some_and(is_solid) && counts(axis, cell) {
                sum[axis] += stress;
            }
        };
        for (at, cell) in self.stencil.runs().iter().flat_map(|run| {
            let [x, y, z] = run.cell;
            run.range().zip((x..).map(move |x| [x, y, z]))
        }) {
            for axis in 0..3 {
                let mut above = cell;
                above[axis] += 1;
                let normal = stresses.normal[axis][at];
                give(axis, cell, normal);
                give(axis, above, -normal);
                let (side, other) = ((axis + 1) % 3, (axis + 2) % 3);
                let shear = stresses.shear[axis][at];
                for (face, across) in [(side, other), (other, side)] {
                    give(face, cell, -shear);
                    give(face, lower(cell, across), shear);
                }
            }
        }
        sum
    }

    /// `out` = A·`u` at free faces, whatever at others.
    fn multiply(&self, path: Path, u: &mut FaceFields<f32>, stresses: &mut Stresses<f32>, out: &mut FaceFields<f32>) {
        if let Some(extensions) = &self.extensions {
            extensions.extend(u);
        }
        self.images.fill_each(u);
        self.stress(path, u, stresses, strain_f32);
        let balance = Balance { mass: &self.mass, stresses, u };
        let [x, y, z] = &mut *out;
        self.stencil.update([x, y, z], |runs, first, out| apply_f32(path, runs, first, &balance, out));
        if let Some(extensions) = &self.extensions {
            extensions.gather(out);
            extensions.clear(u);
        }
    }

    fn stress<T: Copy + Send + Sync>(
        &self,
        path: Path,
        u: &FaceFields<T>,
        stresses: &mut Stresses<T>,
        strain: impl Fn(Path, &[Run], usize, &Self, &FaceFields<T>, [&mut [T]; 6]) + Sync,
    ) {
        let ([xx, yy, zz], [yz, zx, xy]) = (&mut stresses.normal, &mut stresses.shear);
        self.stencil.update([xx, yy, zz, yz, zx, xy], |runs, first, out| strain(path, runs, first, self, u, out));
        self.images.fill_each(&mut stresses.normal);
        self.images.fill_each(&mut stresses.shear);
    }

    /// `smoothing.product` = (`b` − A·`smoothing.u`)·`scale`, face by face.
    pub(super) fn scaled_residual(&self, b: &FaceFields<f32>, scale: &FaceFields<f32>, smoothing: &mut Smoothing) {
        let path = Path::chosen();
        let Smoothing { u, product, stresses, .. } = smoothing;
        self.multiply(path, u, stresses, product);
        let [x, y, z] = product;
        self.stencil.update([x, y, z], |runs, first, out| residual_chunk(path, runs, first, b, scale, out));
    }

    /// Improves `u` as a solution of A·u = `b` by a Chebyshev polynomial of D⁻¹A. `from_zero`: `u` is not read but taken
    /// as 0. All fields are 0 where the face is not free.
    pub(super) fn smooth(&self, from_zero: bool, b: &FaceFields<f32>, smoothing: &mut Smoothing) {
        let path = Path::chosen();
        for (degree, weights) in SMOOTHER.steps().enumerate() {
            let Smoothing { u, step, product, stresses } = &mut *smoothing;
            let weigh = Weighing { inverse: &self.inverse_diagonal, b, weights };
            let is_zero = degree == 0 && from_zero;
            if !is_zero {
                self.multiply(path, u, stresses, product);
            }
            let product = &*product;
            let ([ux, uy, uz], [sx, sy, sz]) = (&mut *u, &mut *step);
            self.stencil.update([ux, uy, uz, sx, sy, sz], |runs, first, out| {
                if is_zero {
                    first_chunk(path, runs, first, &weigh, out);
                } else {
                    smooth_chunk(path, runs, first, product, &weigh, out);
                }
            });
        }
    }
}

/// The fields that the smoother works on.
#[derive(Clone, Debug)]
pub(super) struct Smoothing {
    pub u: FaceFields<f32>,
    pub step: FaceFields<f32>,
    pub product: FaceFields<f32>,
    pub stresses: Stresses<f32>,
}

/// The two sides of mass · u − Σ differences of stress.
struct Balance<'a, T> {
    mass: &'a FaceFields<f32>,
    stresses: &'a Stresses<T>,
    u: &'a FaceFields<T>,
}

struct Weighing<'a> {
    inverse: &'a FaceFields<f32>,
    b: &'a FaceFields<f32>,
    weights: Weights,
}

kernel! {
    fn strain_f64(runs: &[Run], first: usize, level: &Level, u: &FaceFields<f64>, out: [&mut [f64]; 6]) = strain_body;
}

kernel! {
    fn strain_f32(runs: &[Run], first: usize, level: &Level, u: &FaceFields<f32>, out: [&mut [f32]; 6]) = strain_body;
}

kernel! {
    fn apply_f64<'a>(runs: &[Run], first: usize, balance: &Balance<'a, f64>, out: [&mut [f64]; 3]) = apply_body;
}

kernel! {
    fn apply_f32<'a>(runs: &[Run], first: usize, balance: &Balance<'a, f32>, out: [&mut [f32]; 3]) = apply_body;
}

kernel! {
    fn residual_chunk(
        runs: &[Run], first: usize, b: &FaceFields<f32>, scale: &FaceFields<f32>, out: [&mut [f32]; 3],
    ) = residual_body;
}

kernel! {
    fn smooth_chunk<'a>(
        runs: &[Run], first: usize, product: &FaceFields<f32>, weigh: &Weighing<'a>, out: [&mut [f32]; 6],
    ) = smooth_body;
}

kernel! {
    fn first_chunk<'a>(runs: &[Run], first: usize, weigh: &Weighing<'a>, out: [&mut [f32]; 6]) = first_body;
}

/// What a product needs of its numbers.
pub(super) trait Real:
    Copy
    + Default
    + Send
    + From<f32>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
    + std::ops::Add<Output = Self>
{
}
impl Real for f32 {}
impl Real for f64 {}

/// The `n` values of a run from `at` on.
#[inline(always)]
fn from<T>(field: &[T], at: usize, n: usize) -> &[T] {
    &field[at..][..n]
}

#[inline(always)]
fn strain_body<T: Real>(runs: &[Run], first: usize, level: &Level, u: &FaceFields<T>, out: [&mut [T]; 6]) {
    let [ux, uy, uz] = u;
    let [xx, yy, zz, yz, zx, xy] = out;
    for run in runs {
        let (at, n) = (run.at as usize, run.len as usize);
        let ([y0, y1], [z0, z1]) = (run.y.map(|at| at as usize), run.z.map(|at| at as usize));
        let here = at - first..at - first + n;
        let normal = from(&level.normal, at, n);
        let (x, x_right) = (from(ux, at, n), from(ux, at + 1, n));
        let (y, y_above) = (from(uy, at, n), from(uy, y1, n));
        let (z, z_before) = (from(uz, at, n), from(uz, z1, n));
        let (xx, yy, zz) = (&mut xx[here.clone()], &mut yy[here.clone()], &mut zz[here.clone()]);
        for i in 0..n {
            let twice = T::from(normal[i]);
            xx[i] = twice * (x_right[i] - x[i]);
            yy[i] = twice * (y_above[i] - y[i]);
            zz[i] = twice * (z_before[i] - z[i]);
        }
        let [of_yz, of_zx, of_xy] = [0, 1, 2].map(|axis| from(&level.shear[axis], at, n));
        let (x_below, x_behind) = (from(ux, y0, n), from(ux, z0, n));
        let (y_left, y_behind) = (from(uy, at - 1, n), from(uy, z0, n));
        let (z_left, z_below) = (from(uz, at - 1, n), from(uz, y0, n));
        let (yz, zx, xy) = (&mut yz[here.clone()], &mut zx[here.clone()], &mut xy[here]);
        for i in 0..n {
            yz[i] = T::from(of_yz[i]) * ((y[i] - y_behind[i]) + (z[i] - z_below[i]));
            zx[i] = T::from(of_zx[i]) * ((z[i] - z_left[i]) + (x[i] - x_behind[i]));
            xy[i] = T::from(of_xy[i]) * ((x[i] - x_below[i]) + (y[i] - y_left[i]));
        }
    }
}

/// Calls `out` with each cell of a run and the net stress on its low faces.
#[inline(always)]
fn forces<T: Real>(run: &Run, stresses: &Stresses<T>, mut out: impl FnMut(usize, [T; 3])) {
    let (at, n) = (run.at as usize, run.len as usize);
    let ([y0, y1], [z0, z1]) = (run.y.map(|at| at as usize), run.z.map(|at| at as usize));
    let ([xx, yy, zz], [yz, zx, xy]) = (&stresses.normal, &stresses.shear);
    let (xx, xx_left) = (from(xx, at, n), from(xx, at - 1, n));
    let (yy, yy_below) = (from(yy, at, n), from(yy, y0, n));
    let (zz, zz_behind) = (from(zz, at, n), from(zz, z0, n));
    let (yz, yz_above, yz_before) = (from(yz, at, n), from(yz, y1, n), from(yz, z1, n));
    let (zx, zx_right, zx_before) = (from(zx, at, n), from(zx, at + 1, n), from(zx, z1, n));
    let (xy, xy_right, xy_above) = (from(xy, at, n), from(xy, at + 1, n), from(xy, y1, n));
    for i in 0..n {
        let x = (xx[i] - xx_left[i]) + ((xy_above[i] - xy[i]) + (zx_before[i] - zx[i]));
        let y = (yy[i] - yy_below[i]) + ((xy_right[i] - xy[i]) + (yz_before[i] - yz[i]));
        let z = (zz[i] - zz_behind[i]) + ((zx_right[i] - zx[i]) + (yz_above[i] - yz[i]));
        out(i, [x, y, z]);
    }
}

#[inline(always)]
fn apply_body<T: Real>(runs: &[Run], first: usize, balance: &Balance<'_, T>, out: [&mut [T]; 3]) {
    let [out_x, out_y, out_z] = out;
    for run in runs {
        let (at, n) = (run.at as usize, run.len as usize);
        let here = at - first..at - first + n;
        let [mass_x, mass_y, mass_z] = [0, 1, 2].map(|axis| from(&balance.mass[axis], at, n));
        let [x, y, z] = [0, 1, 2].map(|axis| from(&balance.u[axis], at, n));
        let (out_x, out_y, out_z) = (&mut out_x[here.clone()], &mut out_y[here.clone()], &mut out_z[here]);
        forces(run, balance.stresses, |i, force| {
            out_x[i] = T::from(mass_x[i]) * x[i] - force[0];
            out_y[i] = T::from(mass_y[i]) * y[i] - force[1];
            out_z[i] = T::from(mass_z[i]) * z[i] - force[2];
        });
    }
}

#[inline(always)]
fn residual_body(runs: &[Run], first: usize, b: &FaceFields<f32>, scale: &FaceFields<f32>, out: [&mut [f32]; 3]) {
    for (axis, out) in out.into_iter().enumerate() {
        for run in runs {
            let (at, n) = (run.at as usize, run.len as usize);
            let (b, scale, out) = (from(&b[axis], at, n), from(&scale[axis], at, n), &mut out[at - first..][..n]);
            for i in 0..n {
                out[i] = (b[i] - out[i]) * scale[i];
            }
        }
    }
}

#[inline(always)]
fn smooth_body(runs: &[Run], first: usize, product: &FaceFields<f32>, weigh: &Weighing<'_>, out: [&mut [f32]; 6]) {
    let [x, y, z, step_x, step_y, step_z] = out;
    let Weights { decay, gain } = weigh.weights;
    for (axis, (u, step)) in [(x, step_x), (y, step_y), (z, step_z)].into_iter().enumerate() {
        for run in runs {
            let (at, n) = (run.at as usize, run.len as usize);
            let (inverse, b) = (from(&weigh.inverse[axis], at, n), from(&weigh.b[axis], at, n));
            let product = from(&product[axis], at, n);
            let (u, step) = (&mut u[at - first..][..n], &mut step[at - first..][..n]);
            for i in 0..n {
                step[i] = decay * step[i] + gain * inverse[i] * (b[i] - product[i]);
                u[i] += step[i];
            }
        }
    }
}

#[inline(always)]
fn first_body(runs: &[Run], first: usize, weigh: &Weighing<'_>, out: [&mut [f32]; 6]) {
    let [x, y, z, step_x, step_y, step_z] = out;
    for (axis, (u, step)) in [(x, step_x), (y, step_y), (z, step_z)].into_iter().enumerate() {
        for run in runs {
            let (at, n) = (run.at as usize, run.len as usize);
            let (inverse, b) = (from(&weigh.inverse[axis], at, n), from(&weigh.b[axis], at, n));
            let (u, step) = (&mut u[at - first..][..n], &mut step[at - first..][..n]);
            for i in 0..n {
                step[i] = weigh.weights.gain * inverse[i] * b[i];
                u[i] = step[i];
            }
        }
    }
}
