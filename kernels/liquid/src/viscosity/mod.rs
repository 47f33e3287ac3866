//! Pressure and viscosity solved together: the velocity at the end of a step that is free of divergence and in balance
//! with its own viscous stress (Larionov, Batty and Bridson 2017 give the continuous equations; the discretisation here is
//! of finite volumes on the MAC grid).
//!
//! Solving one after the other ([`StokesSolver::solve_viscosity`]) is wrong in rate: a free column sags 1.4 to 2 times too
//! fast. Together, any viscosity up to nearly rigid has its right rate at any time step.
//!
//! The unknowns are the velocities of free faces and the pressures of liquid cells. Flexible GCR (Eisenstat, Elman and
//! Schultz 1983), preconditioned by a block triangle: one multigrid cycle of the viscous equation, and for the Schur
//! complement one cycle of the pressure equation plus the resistance of viscosity (Cahouet and Chabard 1988). Rigid motions of
//! every component that is free to move are solved for exactly in each iteration; without that, nearly rigid liquid
//! takes five times the iterations and loses its spin.
//! Where a liquid's momentum outweighs its viscosity in every cell, smoothing alone does for both: there are no coarser grids,
//! and rigid motions only keep their momentum.

mod alone;
mod coarsen;
mod cycle;
mod extension;
mod level;
mod rigid;
mod setup;
#[cfg(test)]
mod tests;
mod unresisted;

use crate::fields::{add_scaled, in_parts, largest, weighted_dot};
use crate::pressure::{PressureGrid, PressureSolver, PressureWorkspace, face_densities};
use crate::rows::{Cell, CellRows, Periods};
use crate::stencil::Stencil;
use crate::velocity::FaceFields;
pub use alone::{ViscousSolved, ViscousStop};
use cycle::{Multigrid, Workspace};
use level::{Level, Stresses};
use rigid::RigidMotions;
use setup::Flow;

/// The grid that a step is solved on. Cells that are not stored are solid.
#[derive(Clone, Copy)]
pub struct StokesGrid<'a> {
    /// The stored cells: liquid ones and at least all within 2 of them that are not solid. Beyond, walls are along the grid.
    pub rows: &'a CellRows,
    /// Signed distance of the surface from each centre, in cells; negative inside liquid.
    pub level_set: &'a [f32],
    /// Open share of each low face along x, y and z.
    pub open: [&'a [f32]; 3],
    /// Signed distance of the nearest solid from the centre of each low face, in cells; negative inside.
    pub solid_distance: [&'a [f32]; 3],
    /// Density of each cell ÷ the reference density.
    pub density: &'a [f32],
    /// ν̂ = viscosity · Δt ÷ (reference density · cell²) of each cell.
    pub viscosity: &'a [f32],
    /// Share of a solid's shear stress that is dropped at the low face of a cell along an axis, one inside the solid: 0 no
    /// slip, 1 free slip.
    pub slip: &'a (dyn Fn(usize, Cell) -> f32 + Sync),
    /// After how many cells the grid repeats. Images within 2 of liquid are stored, too.
    pub periods: Periods,
}

/// When a solve ends.
#[derive(Clone, Copy, Debug)]
pub struct StokesStop {
    /// Largest error of a velocity, as estimated by the preconditioner, m/s.
    pub velocity: f64,
    /// Largest net flow into or out of a cell, m/s (divergence · cell).
    pub flow: f64,
    /// Most iterations.
    pub iterations: u32,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StokesSolved {
    /// Iterations taken.
    pub iterations: u32,
    /// Largest error of a velocity, as estimated, m/s.
    pub velocity: f64,
    /// Largest net flow into or out of a cell that is left, m/s.
    pub flow: f64,
    /// The net inflow, m/s a cell, that no pressure can drive out of a component that is closed all round. The largest.
    pub unbalanced: f64,
}

/// The matrix of a grid, ready to be solved for any velocity.
#[derive(Clone, Debug)]
pub struct StokesSolver {
    pressure: PressureSolver,
    viscous: Multigrid,
    rigid: RigidMotions,
    /// Whether smoothing alone reaches every error: see [`LIGHT`].
    is_light: bool,
    flow: Flow,
    /// See [`resistance`].
    resistance: Vec<f64>,
}

/// Velocities of faces, and pressures.
#[derive(Clone, Debug)]
struct Unknowns {
    u: FaceFields<f64>,
    q: Vec<f64>,
}

/// The largest ν̂ ÷ density with which a velocity's own momentum is half of the matrix's diagonal in the liquid: smoothing
/// then reaches every error, rigid motions too.
const LIGHT: f32 = 0.125;

/// Directions kept for orthogonality, at most; the oldest is dropped first. Ten are not enough where the viscosity jumps
/// by 1e8, nor forty where stiff liquid of few cells touches soft.
const KEPT: usize = 96;

/// Iterations after which the best velocity is kept, in case that the stop is not reached.
const SLOW: u32 = 40;

/// Bytes that the kept directions take, at most, unless they are fewer than [`LEAST_KEPT`].
const KEPT_BYTES: usize = 3 << 29;
const LEAST_KEPT: usize = 8;

impl StokesSolver {
    /// Sets the equations up.
    ///
    /// # Panics
    /// Where a field does not have one value a cell.
    pub fn new(grid: &StokesGrid<'_>) -> Self {
        let density = face_densities(grid.rows, grid.level_set, grid.density);
        let weights: FaceFields<f32> = std::array::from_fn(|axis| {
            grid.open[axis].iter().zip(&density[axis]).map(|(open, density)| open / density).collect()
        });
        let [x, y, z] = &weights;
        let (rows, level_set, periods) = (grid.rows, grid.level_set, grid.periods);
        let pressure_grid = PressureGrid { rows, level_set, weights: [x, y, z], periods };
        let pressure = PressureSolver::new(&pressure_grid);
        let (level, flow) = setup::set_up(grid, &pressure);
        let is_light = largest_viscosity(grid) <= LIGHT;
        let find = if is_light { RigidMotions::find_unresisted } else { RigidMotions::find };
        let rigid = find(&level, &flow.open);
        let resistance = resistance(&level, &flow, &pressure);
        Self { pressure, viscous: Multigrid::new(level, is_light), rigid, is_light, flow, resistance }
    }

    /// The cells that fields of this solver are stored for.
    pub fn rows(&self) -> &CellRows {
        self.pressure.rows()
    }

    /// What solves for the pressure.
    pub(crate) fn pressure(&self) -> &PressureSolver {
        &self.pressure
    }

    /// The liquid cells among them.
    pub fn stencil(&self) -> &Stencil {
        self.pressure.stencil()
    }

    /// Whether the low face of a cell has an unknown velocity.
    pub fn is_free(&self, axis: usize, at: usize) -> bool {
        self.viscous.finest().mass[axis][at] > 0.0
    }

    /// Solves for the velocity at the end of a step from that before it, with forces added. On entry `u` holds a first guess
    /// of it, and at solid faces the solid's; `q` one of pressure · Δt ÷ (reference density · cell), m/s. On return both
    /// hold the solution. `inflow` is what flows into each cell besides, m/s: by sources, and driven by
    /// solids that move, Σ (1 − open share) · the solid's velocity inwards. All on [`StokesSolver::rows`].
    pub fn solve(
        &self,
        before: &FaceFields<f64>,
        u: &mut FaceFields<f64>,
        q: &mut [f64],
        inflow: &[f64],
        stop: StokesStop,
    ) -> StokesSolved {
        let level = self.viscous.finest();
        let len = level.rows().len();
        let zero = || Unknowns { u: std::array::from_fn(|_| vec![0.0; len]), q: vec![0.0; len] };
        let mut work = Work::new(self);
        (0..len).filter(|at| !self.pressure.is_liquid(*at)).for_each(|at| q[at] = 0.0);
        let mut solved = StokesSolved::default();
        let mut residual = zero();
        self.momentum_lack(before, u, q, &mut work, &mut residual.u);
        self.outflow(u, &mut residual.q);
        residual.q.iter_mut().zip(inflow).for_each(|(residual, inflow)| *residual = inflow - *residual);
        solved.unbalanced = self.pressure.balance(&mut residual.q);
        let kept = (KEPT_BYTES / (8 * size_of::<f64>() * len.max(1))).clamp(LEAST_KEPT, KEPT);
        let mut directions: Vec<(Unknowns, Unknowns, f64)> = Vec::new();
        let mut best: Option<(f64, StokesSolved, FaceFields<f64>, Vec<f64>)> = None;
        loop {
            solved.flow = largest(&residual.q);
            let mut z = if directions.len() == kept { directions.remove(0).0 } else { zero() };
            self.precondition(&residual, &mut work, &mut z);
            solved.velocity = z.u.iter().map(|u| largest(u)).fold(0.0, f64::max);
            let is_done = solved.flow <= stop.flow && solved.velocity <= stop.velocity;
            if solved.iterations >= SLOW && !is_done {
                let error = (solved.flow / stop.flow).max(solved.velocity / stop.velocity);
                if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                    best = Some((error, solved, u.clone(), q.to_vec()));
                }
            }
            if is_done || solved.iterations >= stop.iterations || !solved.velocity.is_finite() {
                break;
            }
            let mut product = zero();
            self.multiply(&mut z, &mut work, &mut product);
            for (direction, image, norm) in &directions {
                let share = self.product(&product, image) / norm;
                product.add_scaled(-share, image);
                z.add_scaled(-share, direction);
            }
            let norm = self.product(&product, &product);
            let share = self.product(&residual, &product) / norm;
            // Nothing but rounding is left.
            if !share.is_finite() {
                break;
            }
            for axis in 0..3 {
                add_scaled(&mut u[axis], share, &z.u[axis]);
            }
            add_scaled(q, share, &z.q);
            residual.add_scaled(-share, &product);
            directions.push((z, product, norm));
            solved.iterations += 1;
        }
        // Where stiff liquid touches soft, a residual that becomes less may hide an error of velocity that grows.
        let is_done = solved.flow <= stop.flow && solved.velocity <= stop.velocity;
        if let Some((_, best, best_u, best_q)) = best.filter(|_| !is_done) {
            solved = StokesSolved { iterations: solved.iterations, ..best };
            *u = best_u;
            q.copy_from_slice(&best_q);
        }
        self.rigid.keep_momentum(level, before, u);
        level.images.fill_each(u);
        level.images.fill(q);
        solved
    }

    /// What the viscous stress of a velocity gives to the solid faces that `counts` picks, by axis and cell, in a step:
    /// velocity · the mass of a cell, m/s.
    pub fn solid_impulse(&self, u: &FaceFields<f64>, counts: impl Fn(usize, Cell) -> bool) -> [f64; 3] {
        self.viscous.finest().solid_impulse(u, counts)
    }

    /// `out` = the momentum before the step less that of `u` with its viscous stress and pressure.
    fn momentum_lack(
        &self,
        before: &FaceFields<f64>,
        u: &mut FaceFields<f64>,
        q: &mut [f64],
        work: &mut Work,
        out: &mut FaceFields<f64>,
    ) {
        let level = self.viscous.finest();
        level.apply(u, &mut work.stresses, out);
        self.add_gradient(q, out);
        for (axis, out) in out.iter_mut().enumerate() {
            in_parts(out, |first, part| {
                for (at, out) in (first..).zip(part) {
                    let momentum = f64::from(level.mass[axis][at]) * before[axis][at];
                    *out = if self.is_free(axis, at) { momentum - *out } else { 0.0 };
                }
            });
        }
    }

    /// `z` ≈ the solution for `residual`.
    fn precondition(&self, residual: &Unknowns, work: &mut Work, z: &mut Unknowns) {
        let flow = largest(&residual.q);
        if flow > 0.0 {
            self.pressure.precondition(&mut work.pressure, &residual.q, flow, &mut z.q);
            in_parts(&mut z.q, |first, part| {
                let of_part = residual.q[first..].iter().zip(&self.resistance[first..]);
                part.iter_mut().zip(of_part).for_each(|(z, (residual, resistance))| *z += resistance * residual);
            });
        } else {
            z.q.fill(0.0);
        }
        work.force.iter_mut().for_each(|force| force.fill(0.0));
        self.add_gradient(&mut z.q, &mut work.force);
        for (force, residual) in work.force.iter_mut().zip(&residual.u) {
            in_parts(force, |first, part| {
                part.iter_mut().zip(&residual[first..]).for_each(|(force, residual)| *force = residual - *force);
            });
        }
        self.precondition_velocity(work, &mut z.u);
    }

    /// `z` ≈ the viscous velocity for the force in `work`.
    fn precondition_velocity(&self, work: &mut Work, z: &mut FaceFields<f64>) {
        let level = self.viscous.finest();
        for (bending, force) in work.bending.iter_mut().zip(&work.force) {
            in_parts(bending, |first, part| part.copy_from_slice(&force[first..][..part.len()]));
        }
        if !self.is_light {
            self.rigid.remove(level, &mut work.bending);
        }
        let force = work.bending.iter().map(|force| largest(force)).fold(0.0, f64::max);
        if force > 0.0 {
            self.viscous.solve(&mut work.viscous, &work.bending, force, z);
        } else {
            z.iter_mut().for_each(|u| u.fill(0.0));
        }
        if !self.is_light {
            self.rigid.complete(level, &work.force, z);
        }
    }

    /// `out` = the matrix times `z`, whose velocity is 0 at solid faces.
    fn multiply(&self, z: &mut Unknowns, work: &mut Work, out: &mut Unknowns) {
        self.viscous.finest().apply(&mut z.u, &mut work.stresses, &mut out.u);
        self.add_gradient(&mut z.q, &mut out.u);
        self.outflow(&mut z.u, &mut out.q);
    }

    /// Adds what a pressure does to the momentum of each free face.
    fn add_gradient(&self, q: &mut [f64], out: &mut FaceFields<f64>) {
        let [x, y, z] = out;
        self.viscous.finest().images.fill(q);
        let q = &*q;
        self.viscous.finest().stencil.update([x, y, z], |runs, first, out| {
            for run in runs {
                let (at, n) = (run.at as usize, run.len as usize);
                for (axis, below) in [at - 1, run.y[0] as usize, run.z[0] as usize].into_iter().enumerate() {
                    let gradient = &self.flow.gradient[axis][at..][..n];
                    let (below, above, out) = (&q[below..][..n], &q[at..][..n], &mut out[axis][at - first..][..n]);
                    for i in 0..n {
                        out[i] += f64::from(gradient[i]) * (above[i] - below[i]);
                    }
                }
            }
        });
    }

    /// `out` = the net outflow of each liquid cell.
    fn outflow(&self, u: &mut FaceFields<f64>, out: &mut [f64]) {
        self.viscous.finest().images.fill_each(u);
        let u = &*u;
        let [open_x, open_y, open_z] = &self.flow.open;
        self.pressure.stencil().update([out], |runs, first, [out]| {
            for run in runs {
                let (at, n) = (run.at as usize, run.len as usize);
                let out = &mut out[at - first..][..n];
                let through = |open: &[f32], u: &[f64], above: usize, i: usize| {
                    f64::from(open[above + i]) * u[above + i] - f64::from(open[at + i]) * u[at + i]
                };
                for (i, out) in out.iter_mut().enumerate() {
                    let x = through(open_x, &u[0], at + 1, i);
                    let y = through(open_y, &u[1], run.y[1] as usize, i);
                    let z = through(open_z, &u[2], run.z[1] as usize, i);
                    *out = x + y + z;
                }
            }
        });
    }

    /// The product of two residuals that weighs momentum by what it moves, and outflow by the pressure that it takes.
    fn product(&self, a: &Unknowns, b: &Unknowns) -> f64 {
        let inverse = &self.viscous.finest().inverse_diagonal;
        let mut sum = 0.0;
        for axis in 0..3 {
            sum += weighted_dot(&a.u[axis], &b.u[axis], |at| f64::from(inverse[axis][at]));
        }
        let of_pressure = self.pressure.inverse_diagonal();
        sum + weighted_dot(&a.q, &b.q, |at| f64::from(of_pressure[at]) + self.resistance[at])
    }
}

/// The scratch of a solve.
struct Work {
    stresses: Stresses<f64>,
    viscous: Workspace,
    pressure: PressureWorkspace,
    force: FaceFields<f64>,
    /// The force less what moves components as rigid bodies.
    bending: FaceFields<f64>,
}

impl Work {
    fn new(solver: &StokesSolver) -> Self {
        let len = solver.rows().len();
        let zero = || std::array::from_fn(|_| vec![0.0; len]);
        Self {
            stresses: Stresses::zero(len),
            viscous: solver.viscous.workspace(),
            pressure: solver.pressure.workspace(),
            force: zero(),
            bending: zero(),
        }
    }
}

impl Unknowns {
    fn add_scaled(&mut self, share: f64, other: &Self) {
        for axis in 0..3 {
            add_scaled(&mut self.u[axis], share, &other.u[axis]);
        }
        add_scaled(&mut self.q, share, &other.q);
    }
}

/// The largest ν̂ ÷ density of liquid.
fn largest_viscosity(grid: &StokesGrid<'_>) -> f32 {
    let liquid = grid.viscosity.iter().zip(grid.density).zip(grid.level_set).filter(|(_, phi)| **phi < 0.0);
    liquid.fold(0.0, |most, ((viscosity, density), _)| most.max(viscosity / density))
}

/// What a pressure has to be in a liquid cell, ÷ its net outflow, where viscosity alone resists: the inverse of the
/// diagonal of (divergence · viscous diagonal⁻¹ · gradient), scaled so that it is twice the viscosity in a whole cell, as
/// Cahouet and Chabard have it. Where a solid covers most of a face, the liquid that is left flows as slowly as that
/// around it, so the pressure is higher by the square of the share: without this, a curved collider takes ten times the
/// iterations.
fn resistance(level: &Level, flow: &Flow, pressure: &PressureSolver) -> Vec<f64> {
    let yielding = |axis: usize, face: usize| {
        let (inverse, mass) = (f64::from(level.inverse_diagonal[axis][face]), f64::from(level.mass[axis][face]));
        let viscous = 1.0 / inverse - mass;
        let is_viscous = inverse > 0.0 && viscous > LEAST_VISCOUS * mass;
        is_viscous.then(|| f64::from(flow.open[axis][face]) * f64::from(flow.gradient[axis][face]) / viscous)
    };
    let mut out = vec![0.0; level.normal.len()];
    pressure.stencil().update([&mut out], |runs, first, [out]| {
        for run in runs {
            for n in 0..run.len as usize {
                let (at, _, above) = run.neighbours(n);
                let faces = (0..3).flat_map(|axis| [(axis, at), (axis, above[axis])]);
                let (mut sum, mut count) = (0.0, 0.0);
                for yielding in faces.filter_map(|(axis, face)| yielding(axis, face)) {
                    sum += yielding;
                    count += 1.0;
                }
                // In a whole cell each face has a diagonal of 8ν.
                let twice = f64::from(level.normal[at]);
                out[at - first] = if sum > 0.0 { 0.25 * count / sum } else { twice };
            }
        }
    });
    out
}

/// Viscosities around a face ÷ its mass, below which they are rounding.
const LEAST_VISCOUS: f64 = 1e-6;
