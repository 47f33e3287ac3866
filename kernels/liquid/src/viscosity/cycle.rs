//! One multigrid V-cycle: an approximate solution of A·u = b in `f32`.

use crate::fields::{add_scaled, divide_into, dot, in_parts, scale_and_add};
use crate::grids::coarsened_to;
use crate::stencil::Run;
use crate::transfer::{Place, add_interpolated, restrict};

use super::coarsen::coarsened;
use super::level::{FaceKind, Level, Smoothing, Stresses};
use crate::velocity::FaceFields;

/// Cells of the coarsest grid, about.
const COARSEST: usize = 150;

/// On the coarsest grid, share of the residual that conjugate gradients leave, and most iterations.
const REDUCTION: f64 = 1e-3;
const ITERATIONS: u32 = 80;

#[derive(Clone, Debug)]
pub(super) struct Multigrid {
    levels: Vec<Level>,
    /// Of each level but the coarsest, towards the next.
    scales: Vec<FaceFields<f32>>,
    /// Whether there is one grid alone, which smoothing solves.
    is_light: bool,
}

/// The fields of a level during a cycle.
#[derive(Clone, Debug)]
struct Scratch {
    smoothing: Smoothing,
    b: FaceFields<f32>,
}

/// The fields of all levels during a cycle.
#[derive(Clone, Debug)]
pub(super) struct Workspace(Vec<Scratch>);

impl Multigrid {
    /// `is_light`: mass outweighs viscosity everywhere, so that no error is too smooth for the smoother.
    pub(super) fn new(finest: Level, is_light: bool) -> Self {
        let fewest = if is_light { usize::MAX } else { COARSEST };
        let levels = coarsened_to(fewest, finest, |level| level.stencil.active().len(), coarsened);
        let scales = levels.windows(2).map(|pair| scales(&pair[0], &pair[1])).collect();
        Self { levels, scales, is_light }
    }

    /// The grids, the finest first.
    #[cfg(test)]
    pub(super) fn grids(&self) -> &[Level] {
        &self.levels
    }

    pub(super) fn finest(&self) -> &Level {
        &self.levels[0]
    }

    pub(super) fn workspace(&self) -> Workspace {
        let scratch = |level: &Level| {
            let len = level.rows().len();
            let zero = || std::array::from_fn(|_| vec![0.0; len]);
            let smoothing = Smoothing { u: zero(), step: zero(), product: zero(), stresses: Stresses::zero(len) };
            Scratch { smoothing, b: zero() }
        };
        Workspace(self.levels.iter().map(scratch).collect())
    }

    /// `out` ≈ A⁻¹·`b`; `largest` is the largest entry of `b`, above 0. `b` is 0 where the face is not free.
    pub(super) fn solve(
        &self,
        workspace: &mut Workspace,
        b: &FaceFields<f64>,
        largest: f64,
        out: &mut FaceFields<f64>,
    ) {
        for (to, from) in workspace.0[0].b.iter_mut().zip(b) {
            // Largest entry 1: neither overflow nor denormals, whatever the unit.
            divide_into(to, from, largest);
        }
        self.cycle(0, &mut workspace.0);
        for (to, from) in out.iter_mut().zip(&workspace.0[0].smoothing.u) {
            in_parts(to, |first, part| {
                part.iter_mut().zip(&from[first..]).for_each(|(to, from)| *to = f64::from(*from) * largest);
            });
        }
    }

    fn cycle(&self, number: usize, scratch: &mut [Scratch]) {
        let level = &self.levels[number];
        let (fine, coarser) = scratch.split_at_mut(1);
        let Scratch { smoothing, b } = &mut fine[0];
        let Some(scale) = self.scales.get(number) else {
            if self.is_light {
                level.smooth(true, b, smoothing);
                return level.smooth(false, b, smoothing);
            }
            return solve_coarsest(level, b, &mut smoothing.u);
        };
        let coarse = &self.levels[number + 1];
        level.smooth(true, b, smoothing);
        level.scaled_residual(b, scale, smoothing);
        for axis in 0..3 {
            level.images.fill_for_sums(&mut smoothing.product[axis], Some(axis));
            restrict(
                Place::Face(axis),
                level.rows(),
                &coarse.stencil,
                &smoothing.product[axis],
                &mut coarser[0].b[axis],
            );
        }
        if let Some(extensions) = &coarse.extensions {
            extensions.gather(&mut coarser[0].b);
        }
        self.cycle(number + 1, coarser);
        let correction = &mut coarser[0].smoothing.u;
        if let Some(extensions) = &coarse.extensions {
            extensions.extend(correction);
        }
        coarse.images.fill_each(correction);
        for axis in 0..3 {
            let (place, u) = (Place::Face(axis), &mut smoothing.u[axis]);
            add_interpolated(place, &level.stencil, coarse.rows(), &scale[axis], &correction[axis], u);
        }
        if let Some(extensions) = &coarse.extensions {
            extensions.clear(correction);
        }
        level.smooth(false, b, smoothing);
    }
}

/// Share of the diagonal that is added on the coarsest grid: rounding must not move a body that only its mass holds.
const STIFFENING: f64 = 1e-4;

/// Conjugate gradients with the diagonal as preconditioner.
fn solve_coarsest(level: &Level, b: &FaceFields<f32>, u: &mut FaceFields<f32>) {
    let len = level.rows().len();
    let zero = || -> FaceFields<f64> { std::array::from_fn(|_| vec![0.0; len]) };
    let product = |a: &FaceFields<f64>, b: &FaceFields<f64>| (0..3).map(|axis| dot(&a[axis], &b[axis])).sum::<f64>();
    let is_free = |axis: usize, at: usize| level.mass[axis][at] > 0.0;
    let inside = |b: &[f32], axis: usize| -> Vec<f64> {
        b.iter().enumerate().map(|(at, b)| if is_free(axis, at) { f64::from(*b) } else { 0.0 }).collect()
    };
    let mut residual: FaceFields<f64> = std::array::from_fn(|axis| inside(&b[axis], axis));
    let (mut solution, mut direction, mut image, mut stresses) = (zero(), zero(), zero(), Stresses::zero(len));
    let (mut before, mut first) = (0.0, 0.0);
    for iteration in 0..ITERATIONS {
        let better: FaceFields<f64> = std::array::from_fn(|axis| {
            let inverse = level.inverse_diagonal[axis].iter().map(|inverse| f64::from(*inverse));
            residual[axis].iter().zip(inverse).map(|(residual, inverse)| residual * inverse).collect()
        });
        let energy = product(&residual, &better);
        if iteration == 0 {
            first = energy;
        }
        if energy.is_nan() || energy <= first * REDUCTION * REDUCTION {
            break;
        }
        let share = if iteration == 0 { 0.0 } else { energy / before };
        before = energy;
        (0..3).for_each(|axis| scale_and_add(&mut direction[axis], share, &better[axis]));
        level.apply(&mut direction, &mut stresses, &mut image);
        for axis in 0..3 {
            for (at, inverse) in level.inverse_diagonal[axis].iter().enumerate().filter(|(_, inverse)| **inverse > 0.0)
            {
                image[axis][at] += STIFFENING / f64::from(*inverse) * direction[axis][at];
            }
        }
        let curvature = product(&direction, &image);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let length = energy / curvature;
        for axis in 0..3 {
            add_scaled(&mut solution[axis], length, &direction[axis]);
            add_scaled(&mut residual[axis], -length, &image[axis]);
        }
    }
    for axis in 0..3 {
        u[axis].iter_mut().zip(&solution[axis]).for_each(|(u, solution)| *u = *solution as f32);
    }
}

/// What the weights of interpolation are multiplied by at each fine face; 0 where it is not free. Faces in air without an
/// extended velocity are left out; solid ones count, with velocity 0.
fn scales(fine: &Level, coarse: &Level) -> FaceFields<f32> {
    let is_extended = |axis, at| {
        coarse.extensions.as_ref().is_some_and(|extensions| extensions.reaches(axis, coarse.images.home(at)))
    };
    let ones = vec![1.0; fine.rows().len()];
    let interpolated = |axis: usize, counts: &dyn Fn(usize) -> bool| {
        let counted: Vec<f32> = (0..coarse.rows().len()).map(|at| f32::from(counts(at))).collect();
        let mut shares = vec![0.0; fine.rows().len()];
        add_interpolated(Place::Face(axis), &fine.stencil, coarse.rows(), &ones, &counted, &mut shares);
        shares
    };
    std::array::from_fn(|axis| {
        let kinds = &coarse.kinds[axis];
        let mut scales = interpolated(axis, &|at| kinds[at] == FaceKind::Free);
        // Shares are multiples of 1/32, so no sum of them is rounded.
        let counted = interpolated(axis, &|at| kinds[at] != FaceKind::Air || is_extended(axis, at));
        fine.stencil.update([&mut scales], |runs, first, [scales]| {
            for at in runs.iter().flat_map(Run::range) {
                let scale = &mut scales[at - first];
                let reaches_free = *scale > 0.0 && fine.kinds[axis][at] == FaceKind::Free;
                *scale = if reaches_free { 1.0 / counted[at] } else { 0.0 };
            }
        });
        scales
    })
}
