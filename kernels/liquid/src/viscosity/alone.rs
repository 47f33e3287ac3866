//! Viscosity without pressure: what it makes of a velocity in a step, for solving one after the other.
//!
//! Flexible conjugate gradients (Polak and Ribière's direction, as the preconditioner rounds to `f32`), preconditioned as
//! the velocity of the coupled solve is: a multigrid cycle, and rigid motions exactly.

use crate::fields::{add_scaled, dot, largest, scale_and_add};
use crate::velocity::FaceFields;

use super::{StokesSolver, Work};

/// When a solve for viscosity alone ends.
#[derive(Clone, Copy, Debug)]
pub struct ViscousStop {
    /// Largest error of a velocity, as estimated by the preconditioner, m/s.
    pub velocity: f64,
    /// Most iterations.
    pub iterations: u32,
}

/// How a solve for viscosity alone ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViscousSolved {
    /// Iterations taken.
    pub iterations: u32,
    /// Largest error of a velocity, as estimated, m/s.
    pub velocity: f64,
}

impl StokesSolver {
    /// Solves for the velocity at the end of a step in which viscosity acts on `before`, and nothing else. On entry `u` holds a
    /// first guess of it, and at solid faces the solid's; on return the solution. All on [`StokesSolver::rows`].
    pub fn solve_viscosity(
        &self,
        before: &FaceFields<f64>,
        u: &mut FaceFields<f64>,
        stop: ViscousStop,
    ) -> ViscousSolved {
        let level = self.viscous.finest();
        let len = level.rows().len();
        let zero = || -> FaceFields<f64> { std::array::from_fn(|_| vec![0.0; len]) };
        let mut work = Work::new(self);
        let (mut residual, mut better, mut direction, mut image) = (zero(), zero(), zero(), zero());
        self.momentum_lack(before, u, &mut vec![0.0; len], &mut work, &mut residual);
        let mut solved = ViscousSolved::default();
        // Residual · what the preconditioner made of it, the step before.
        let mut energy_before = 0.0;
        loop {
            for axis in 0..3 {
                work.force[axis].copy_from_slice(&residual[axis]);
            }
            self.precondition_velocity(&mut work, &mut better);
            solved.velocity = better.iter().map(|u| largest(u)).fold(0.0, f64::max);
            let is_done = solved.velocity <= stop.velocity;
            if is_done || solved.iterations >= stop.iterations || !solved.velocity.is_finite() {
                break;
            }
            let energy = product(&residual, &better);
            // `image` still holds what the residual lost in the step before.
            let share = if solved.iterations == 0 { 0.0 } else { -product(&image, &better) / energy_before };
            (0..3).for_each(|axis| scale_and_add(&mut direction[axis], share, &better[axis]));
            level.apply(&mut direction, &mut work.stresses, &mut image);
            let length = product(&residual, &direction) / product(&direction, &image);
            // Nothing but rounding is left.
            if !length.is_finite() {
                break;
            }
            for axis in 0..3 {
                add_scaled(&mut u[axis], length, &direction[axis]);
                image[axis].iter_mut().for_each(|image| *image *= length);
                add_scaled(&mut residual[axis], -1.0, &image[axis]);
            }
            energy_before = energy;
            solved.iterations += 1;
        }
        level.images.fill_each(u);
        solved
    }
}

/// Σ a · b.
fn product(a: &FaceFields<f64>, b: &FaceFields<f64>) -> f64 {
    (0..3).map(|axis| dot(&a[axis], &b[axis])).fold(0.0, |sum, x| sum + x)
}
