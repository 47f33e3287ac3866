//! The end of a substep of a viscous liquid: pressure and viscosity act at once, or one after the other.

use crate::rows::CellRows;
use crate::step::LiquidReport;
use crate::step::domain::{Obstacle, Wall, share_outside};
use crate::step::exchange::Imposed;
use crate::step::force::pressed;
use crate::step::motion::Guess;
use crate::step::pour::{Pour, pour};
use crate::step::project::{PressureEquations, Projection, covered, net};
use crate::velocity::FaceFields;
use crate::viscosity::{StokesGrid, StokesSolver, StokesStop, ViscousStop};

/// The least speed of thick liquid, of what gravity adds in a substep, that errors are measured against.
const CREEP: f64 = 1e-3;

/// The equations of a viscous liquid, on more cells than the liquid's.
struct ViscousEquations {
    rows: CellRows,
    open: FaceFields<f32>,
    solid_velocity: Option<FaceFields<f32>>,
    solver: StokesSolver,
}

impl Projection<'_> {
    fn equations(&self) -> ViscousEquations {
        let (cells, domain) = (self.cells, &self.settings.domain);
        let rows = domain.clip_with_images(&cells.rows.dilated(1), 2);
        let level_set = cells.level_set_on(domain, &rows);
        let [mut open, distance] = domain.faces(&rows, self.solid);
        let mut solid_velocity = self.solid.map(|solid| domain.solid_velocity(&rows, &open, solid));
        if !self.imposed.is_empty() {
            let still = || std::array::from_fn(|_| vec![0.0; rows.len()]);
            Imposed::close(self.imposed, &rows, &mut open, solid_velocity.get_or_insert_with(still));
        }
        let images = domain.periods().images(&rows);
        images.fill_each(&mut open);
        solid_velocity.iter_mut().for_each(|velocity| images.fill_each(velocity));
        let [[open_x, open_y, open_z], [x, y, z]] = [&open, &distance];
        let [viscosity, density] = self.materials.on(cells, domain, &rows);
        let solver = StokesSolver::new(&StokesGrid {
            rows: &rows,
            level_set: &level_set,
            open: [open_x, open_y, open_z],
            solid_distance: [x, y, z],
            density: &density,
            viscosity: &viscosity,
            slip: &|axis, cell| domain.slip(axis, cell, self.settings.slip),
            periods: domain.periods(),
        });
        ViscousEquations { rows, open, solid_velocity, solver }
    }

    /// Thick liquid creeps far more slowly than gravity would have it.
    fn creep(&self) -> f64 {
        self.speed.max(CREEP * self.pull())
    }

    /// Drives the divergence out of a velocity and lets viscosity act, both at once. `likely`: a first guess of the result.
    pub(super) fn by_pressure_and_viscosity(
        &self,
        likely: &FaceFields<f32>,
        pours: &mut [Pour],
        faces: &mut FaceFields<f32>,
        guess: &mut Guess,
    ) -> LiquidReport {
        let equations = self.equations();
        let ViscousEquations { solver, .. } = &equations;
        let [before, mut u] = [self.on_solver(&equations, faces, false), self.on_solver(&equations, likely, true)];
        let mut q = solver.rows().resampled(&guess.rows, &guess.q, 0.0);
        let scale = self.creep();
        let stop = StokesStop {
            velocity: self.settings.tolerance * scale,
            flow: self.flow_tolerance(scale),
            iterations: self.settings.max_iterations,
        };
        let mut inflow = equations.driven();
        let poured = pour(pours, solver.pressure(), self.settings.cell, &mut inflow);
        let solved = solver.solve(&before, &mut u, &mut q, &inflow, stop);
        let mut force = pressed(self.cut, solver.pressure(), &q);
        if let Some(solid) = self.solid {
            let of_viscosity = self.viscous_impulse(&equations, &u, solid);
            force.iter_mut().zip(of_viscosity).for_each(|(force, of_viscosity)| *force += of_viscosity);
        }
        self.take_over(&equations, &u, faces);
        *guess = Guess { rows: solver.rows().clone(), q };
        let is_done = solved.flow <= stop.flow && solved.velocity <= stop.velocity;
        LiquidReport {
            coupled_iterations: solved.iterations,
            coupled_residual: if scale > 0.0 { solved.velocity / scale } else { 0.0 },
            solves_cut_short: u32::from(!is_done),
            solid_force: self.force(force),
            ..self.report(solved.flow, [solved.unbalanced, poured])
        }
    }

    /// Drives the divergence out of a velocity, lets viscosity act, and drives out what divergence that made.
    pub(super) fn by_pressure_then_viscosity(
        &self,
        equations: &PressureEquations,
        pours: &mut [Pour],
        faces: &mut FaceFields<f32>,
        guess: &mut Guess,
    ) -> LiquidReport {
        let scale = self.creep();
        let images = &self.cells.images;
        let first = self.by_pressure(equations, scale, &mut pours.to_vec(), faces, guess);
        images.fill_each(faces);
        let viscous = self.by_viscosity(scale, faces);
        images.fill_each(faces);
        let second = self.by_pressure(equations, scale, pours, faces, &mut Guess::default());
        let forces = [first.solid_force, viscous.solid_force, second.solid_force];
        LiquidReport {
            pressure_iterations: first.pressure_iterations + second.pressure_iterations,
            solves_cut_short: first.solves_cut_short + viscous.solves_cut_short + second.solves_cut_short,
            solid_force: [0, 1, 2].map(|axis| forces.iter().map(|force| force[axis]).sum()),
            viscosity_iterations: viscous.viscosity_iterations,
            viscosity_residual: viscous.viscosity_residual,
            ..second
        }
    }

    /// Lets viscosity alone act on a velocity.
    fn by_viscosity(&self, scale: f64, faces: &mut FaceFields<f32>) -> LiquidReport {
        let equations = self.equations();
        let before = self.on_solver(&equations, faces, false);
        let mut u = self.on_solver(&equations, faces, true);
        let (velocity, iterations) = (self.settings.tolerance * scale, self.settings.max_iterations);
        let solved = equations.solver.solve_viscosity(&before, &mut u, ViscousStop { velocity, iterations });
        let is_done = solved.velocity <= velocity;
        let force = self.solid.map(|solid| self.viscous_impulse(&equations, &u, solid));
        self.take_over(&equations, &u, faces);
        LiquidReport {
            viscosity_iterations: solved.iterations,
            viscosity_residual: if scale > 0.0 { solved.velocity / scale } else { 0.0 },
            solves_cut_short: u32::from(!is_done),
            solid_force: self.force(force.unwrap_or_default()),
            ..LiquidReport::default()
        }
    }

    /// A velocity on the cells of the solver; `with_solids`: that of solids at the faces that they close.
    fn on_solver(&self, equations: &ViscousEquations, faces: &FaceFields<f32>, with_solids: bool) -> FaceFields<f64> {
        let ViscousEquations { rows, open, solid_velocity, solver, .. } = equations;
        std::array::from_fn(|axis| {
            let mut own = rows.resampled(&self.cells.rows, &faces[axis], 0.0);
            if let Some(solid) = solid_velocity.as_ref().filter(|_| with_solids) {
                let closed = own.iter_mut().zip(&solid[axis]).zip(&open[axis]).filter(|(_, open)| **open == 0.0);
                closed.for_each(|((own, solid), _)| *own = *solid);
            }
            let own: Vec<f64> = own.into_iter().map(f64::from).collect();
            solver.rows().resampled(rows, &own, 0.0)
        })
    }

    /// Gives the faces that move the velocity that was solved for.
    fn take_over(&self, equations: &ViscousEquations, u: &FaceFields<f64>, faces: &mut FaceFields<f32>) {
        for axis in 0..3 {
            let solved = self.cells.rows.resampled(equations.solver.rows(), &u[axis], 0.0);
            let moving = faces[axis].iter_mut().zip(&solved).zip(&self.cells.moving);
            moving.filter(|(_, mask)| **mask >> axis & 1 == 1).for_each(|((u, solved), _)| *u = *solved as f32);
        }
    }

    /// What the viscous stress of a velocity gives to a solid, velocity · the mass of a cell.
    fn viscous_impulse(&self, equations: &ViscousEquations, u: &FaceFields<f64>, solid: Obstacle<'_>) -> [f64; 3] {
        let domain = &self.settings.domain;
        equations.solver.solid_impulse(u, |axis, cell| {
            let is_inner = domain.contains(cell) && matches!(domain.wall_at(axis, cell), None | Some(Wall::Periodic));
            is_inner && share_outside(axis, cell, solid) == 0.0
        })
    }
}

impl ViscousEquations {
    /// The net inflow of each liquid cell that solids drive, m/s.
    fn driven(&self) -> Vec<f64> {
        let Self { rows, open, solid_velocity, solver, .. } = self;
        let Some(solid) = solid_velocity else { return vec![0.0; solver.rows().len()] };
        let through = std::array::from_fn(|axis| {
            let covered: Vec<f64> = covered(axis, open, solid).collect();
            solver.rows().resampled(rows, &covered, 0.0)
        });
        net(solver.rows(), solver.stencil(), &through)
    }
}
