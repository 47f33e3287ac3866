//! The pressure equation on one grid: its matrix, products with it, and the smoother.

use numerics::simd::{Path, kernel};

use crate::chebyshev::{Chebyshev, Weights};
use crate::rows::{CellRows, Images};
use crate::stencil::{Run, Stencil};

/// What a stored cell is to the pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum CellKind {
    /// Filled by a solid, or behind a wall: no pressure, no flow.
    #[default]
    Solid,
    /// An unknown pressure.
    Liquid,
    /// Pressure 0.
    Air,
}

/// For each liquid cell c with neighbours n across faces of weight w:
/// Σ w·(q_c − q_n) + surface·q_c, where q is 0 in air and w is 0 at walls.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub stencil: Stencil,
    pub kinds: Vec<CellKind>,
    /// Of the low face of each cell.
    pub weights: [Vec<f32>; 3],
    /// Σ w·(1/θ − 1) over the faces to air, θ the distance of the surface in cells.
    pub surface: Vec<f32>,
    /// 0 where the cell is not liquid.
    pub inverse_diagonal: Vec<f32>,
    /// Cells that repeat others; kinds and weights are theirs.
    pub images: Images,
}

/// The share of a cell between its centre and the surface, for the low face of each cell; 1 where that face is not
/// between liquid and air.
pub(super) type SurfaceDistances = [Vec<f32>; 3];

/// Cells stored around liquid: a coarse cell with liquid has all its neighbours' near faces, see
/// [`coarsen`](super::coarsen).
pub(super) const HALO: i32 = 2;

/// What a smoothing takes from errors.
const SMOOTHER: Chebyshev = Chebyshev { largest: 2.0, ratio: 10.0, degree: 3 };

impl Level {
    /// The matrix of the `liquid` cells.
    pub(super) fn new(
        stencil: Stencil,
        kinds: Vec<CellKind>,
        weights: [Vec<f32>; 3],
        distances: &SurfaceDistances,
        images: Images,
    ) -> Self {
        let len = stencil.rows().len();
        let mut surface = vec![0.0; len];
        let mut inverse_diagonal = vec![0.0; len];
        stencil.update([&mut surface, &mut inverse_diagonal], |runs, first, [surface, inverse]| {
            for run in runs {
                for n in 0..run.len as usize {
                    let (at, below, above) = run.neighbours(n);
                    let (mut sum, mut to_air) = (0.0, 0.0);
                    for axis in 0..3 {
                        // Each neighbour, and the cell whose low face lies between.
                        for (neighbour, face) in [(below[axis], at), (above[axis], above[axis])] {
                            let weight = f64::from(weights[axis][face]);
                            sum += weight;
                            if kinds[neighbour] == CellKind::Air {
                                to_air += weight * (1.0 / f64::from(distances[axis][face]) - 1.0);
                            }
                        }
                    }
                    surface[at - first] = to_air as f32;
                    let diagonal = sum + to_air;
                    inverse[at - first] = if diagonal > 0.0 { (1.0 / diagonal) as f32 } else { 0.0 };
                }
            }
        });
        Self { stencil, kinds, weights, surface, inverse_diagonal, images }
    }

    pub(super) fn rows(&self) -> &CellRows {
        self.stencil.rows()
    }

    fn matrix(&self) -> Matrix<'_> {
        let [x, y, z] = &self.weights;
        Matrix { x, y, z, surface: &self.surface }
    }

    /// `out` = A·`q`.
    pub(super) fn apply(&self, q: &mut [f64], out: &mut [f64]) {
        self.images.fill(q);
        let (path, matrix) = (Path::chosen(), self.matrix());
        self.stencil.update([out], |runs, first, [out]| apply_chunk(path, runs, first, &matrix, q, out));
    }

    /// `out` = (`b` − A·`q`)·`scale`, cell by cell.
    pub(super) fn scaled_residual(&self, q: &mut [f32], b: &[f32], scale: &[f32], out: &mut [f32]) {
        self.images.fill(q);
        let (path, equation) = (Path::chosen(), Equation { matrix: self.matrix(), q, b });
        self.stencil.update([out], |runs, first, [out]| residual_chunk(path, runs, first, &equation, scale, out));
    }

    /// Improves `q` as a solution of A·q = `b` by a Chebyshev polynomial of D⁻¹A. `from_zero`: `q` is not read but taken
    /// as 0. `spare` and `step` are scratch; all three are 0 where the cell is not liquid.
    pub(super) fn smooth(&self, from_zero: bool, b: &[f32], q: &mut Vec<f32>, spare: &mut Vec<f32>, step: &mut [f32]) {
        let path = Path::chosen();
        for (degree, weights) in SMOOTHER.steps().enumerate() {
            self.images.fill(q);
            let inverse = &self.inverse_diagonal[..];
            let weigh = Weighing { inverse, weights };
            let equation = Equation { matrix: self.matrix(), q, b };
            if degree == 0 && from_zero {
                self.stencil.update([&mut spare[..], step], |runs, first, [q, step]| {
                    first_chunk(path, runs, first, &weigh, b, q, step);
                });
            } else {
                self.stencil.update([&mut spare[..], &mut *step], |runs, first, [out, step]| {
                    smooth_chunk(path, runs, first, &equation, &weigh, out, step);
                });
            }
            std::mem::swap(q, spare);
        }
    }
}

struct Matrix<'a> {
    x: &'a [f32],
    y: &'a [f32],
    z: &'a [f32],
    surface: &'a [f32],
}

/// A·q = b, for one q.
struct Equation<'a> {
    matrix: Matrix<'a>,
    q: &'a [f32],
    b: &'a [f32],
}

struct Weighing<'a> {
    inverse: &'a [f32],
    weights: Weights,
}

kernel! {
    fn apply_chunk<'a>(runs: &[Run], first: usize, matrix: &Matrix<'a>, q: &[f64], out: &mut [f64]) = apply_body;
}

kernel! {
    fn residual_chunk<'a>(
        runs: &[Run], first: usize, equation: &Equation<'a>, scale: &[f32], out: &mut [f32],
    ) = residual_body;
}

kernel! {
    fn smooth_chunk<'a>(
        runs: &[Run], first: usize, equation: &Equation<'a>, weigh: &Weighing<'a>, out: &mut [f32], step: &mut [f32],
    ) = smooth_body;
}

kernel! {
    fn first_chunk<'a>(
        runs: &[Run], first: usize, weigh: &Weighing<'a>, b: &[f32], q: &mut [f32], step: &mut [f32],
    ) = first_body;
}

/// A·q in one cell at a time of a run.
#[inline(always)]
fn products<T>(run: &Run, matrix: &Matrix<'_>, q: &[T], mut out: impl FnMut(usize, T))
where
    T: Copy + From<f32> + std::ops::Sub<Output = T> + std::ops::Mul<Output = T> + std::ops::Add<Output = T>,
{
    let n = run.len as usize;
    let at = run.at as usize;
    let [y0, y1] = run.y.map(|at| at as usize);
    let [z0, z1] = run.z.map(|at| at as usize);
    let own = &q[at..][..n];
    let (left, right) = (&q[at - 1..][..n], &q[at + 1..][..n]);
    let (below, above) = (&q[y0..][..n], &q[y1..][..n]);
    let (behind, before) = (&q[z0..][..n], &q[z1..][..n]);
    let (wx0, wx1) = (&matrix.x[at..][..n], &matrix.x[at + 1..][..n]);
    let (wy0, wy1) = (&matrix.y[at..][..n], &matrix.y[y1..][..n]);
    let (wz0, wz1) = (&matrix.z[at..][..n], &matrix.z[z1..][..n]);
    let surface = &matrix.surface[at..][..n];
    for i in 0..n {
        let c = own[i];
        let x = T::from(wx0[i]) * (c - left[i]) + T::from(wx1[i]) * (c - right[i]);
        let y = T::from(wy0[i]) * (c - below[i]) + T::from(wy1[i]) * (c - above[i]);
        let z = T::from(wz0[i]) * (c - behind[i]) + T::from(wz1[i]) * (c - before[i]);
        out(i, (x + y) + (z + T::from(surface[i]) * c));
    }
}

#[inline(always)]
fn apply_body(runs: &[Run], first: usize, matrix: &Matrix<'_>, q: &[f64], out: &mut [f64]) {
    for run in runs {
        let out = &mut out[run.at as usize - first..][..run.len as usize];
        products(run, matrix, q, |i, product| out[i] = product);
    }
}

#[inline(always)]
fn residual_body(runs: &[Run], first: usize, equation: &Equation<'_>, scale: &[f32], out: &mut [f32]) {
    for run in runs {
        let out = &mut out[run.at as usize - first..][..run.len as usize];
        let (b, scale) = (&equation.b[run.range()], &scale[run.range()]);
        products(run, &equation.matrix, equation.q, |i, product| out[i] = (b[i] - product) * scale[i]);
    }
}

#[inline(always)]
fn smooth_body(
    runs: &[Run],
    first: usize,
    equation: &Equation<'_>,
    weigh: &Weighing<'_>,
    out: &mut [f32],
    step: &mut [f32],
) {
    let Weights { decay, gain } = weigh.weights;
    for run in runs {
        let here = run.at as usize - first..run.at as usize - first + run.len as usize;
        let (out, step) = (&mut out[here.clone()], &mut step[here]);
        let (b, inverse, own) = (&equation.b[run.range()], &weigh.inverse[run.range()], &equation.q[run.range()]);
        products(run, &equation.matrix, equation.q, |i, product| {
            step[i] = decay * step[i] + gain * inverse[i] * (b[i] - product);
            out[i] = own[i] + step[i];
        });
    }
}

#[inline(always)]
fn first_body(runs: &[Run], first: usize, weigh: &Weighing<'_>, b: &[f32], q: &mut [f32], step: &mut [f32]) {
    for run in runs {
        let here = run.at as usize - first..run.at as usize - first + run.len as usize;
        let (q, step) = (&mut q[here.clone()], &mut step[here]);
        let (b, inverse) = (&b[run.range()], &weigh.inverse[run.range()]);
        for i in 0..run.len as usize {
            step[i] = weigh.weights.gain * inverse[i] * b[i];
            q[i] = step[i];
        }
    }
}
