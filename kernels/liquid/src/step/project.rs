//! The end of a substep: what is left of a velocity once it neither compresses the liquid nor differs from what viscosity
//! allows.

use numerics::parallel;

use crate::carried::CellMaterials;
use crate::pressure::{PressureGrid, PressureSolver, Stop, face_densities};
use crate::rows::{CellRows, Finder};
use crate::stencil::Stencil;
use crate::step::domain::{Domain, Obstacle};
use crate::step::exchange::Imposed;
use crate::step::force::{CutCell, pressed, rested};
use crate::step::motion::{Guess, LiquidCells, Motion};
use crate::step::pour::{Pour, pour};
use crate::step::{LiquidReport, LiquidSettings, ViscousSolve};
use crate::velocity::FaceFields;

/// Net flow of a cell, of the largest error that it may cause in a velocity.
const FLOW_SHARE: f64 = 0.25;

/// A projection of one substep.
pub(super) struct Projection<'a> {
    pub settings: &'a LiquidSettings,
    pub cells: &'a LiquidCells,
    pub materials: Materials,
    pub solid: Option<Obstacle<'a>>,
    /// The liquid cells that the solid cuts, where the force on it is wanted; else none.
    pub cut: &'a [CutCell],
    pub imposed: &'a [Imposed],
    /// The speed of the liquid, m/s.
    pub speed: f64,
    /// What gravity adds to it, m/s.
    pub gravity: [f64; 3],
    /// The length of the substep.
    pub seconds: f64,
}

/// The largest viscosity · Δt ÷ (density · cell²) that is solved for. Such liquid is rigid to one part in 10¹⁰; beyond,
/// rounding of its strain would be force.
const STIFFEST: f64 = 1e10;

/// What the liquid of a substep is made of.
pub(super) struct Materials {
    /// Viscosity · Δt ÷ (density · cell²) where it is the same everywhere.
    viscosity: f64,
    /// The same of each cell, and its density ÷ that of the settings, where it is not.
    of_cells: Option<[Vec<f32>; 2]>,
}

impl Materials {
    /// `own`: viscosity and density where it is the same everywhere.
    pub(super) fn new(own: [f64; 2], cells: Option<CellMaterials>, settings: &LiquidSettings, seconds: f64) -> Self {
        let per_viscosity = seconds / (own[1] * settings.cell * settings.cell);
        let scaled = |mut values: Vec<f32>, by: f64, most: f64| {
            values.iter_mut().for_each(|value| *value = (f64::from(*value) * by).min(most) as f32);
            values
        };
        let of_cells = cells.map(|cells| {
            [scaled(cells.viscosity, per_viscosity, STIFFEST), scaled(cells.density, 1.0 / own[1], f64::INFINITY)]
        });
        Self { viscosity: (own[0] * per_viscosity).min(STIFFEST), of_cells }
    }

    /// The largest viscosity · Δt ÷ (density · cell²).
    fn largest(&self, cells: &LiquidCells) -> f64 {
        let Some([viscosity, density]) = &self.of_cells else { return self.viscosity };
        let kinematic = viscosity.iter().zip(density).zip(&cells.level_set).filter(|(_, phi)| **phi < 0.0);
        kinematic.fold(0.0, |most, ((viscosity, density), _)| most.max(f64::from(viscosity / density)))
    }

    /// Viscosity and density of other cells.
    pub(super) fn on(&self, cells: &LiquidCells, domain: &Domain, rows: &CellRows) -> [Vec<f32>; 2] {
        let own = self.viscosity as f32;
        let Some([viscosity, density]) = &self.of_cells else { return [vec![own; rows.len()], vec![1.0; rows.len()]] };
        let mut fields = [rows.resampled(&cells.rows, viscosity, own), rows.resampled(&cells.rows, density, 1.0)];
        let images = domain.periods().images(rows);
        fields.iter_mut().for_each(|field| images.fill(field));
        fields
    }

    /// Whether viscosity · Δt ÷ (density · cell²) is above `most` everywhere.
    pub(super) fn are_thicker(&self, cells: &LiquidCells, most: f32) -> bool {
        match &self.of_cells {
            Some([viscosity, density]) => {
                let mut of_liquid = viscosity.iter().zip(density).zip(&cells.level_set).filter(|(_, phi)| **phi < 0.0);
                of_liquid.all(|((viscosity, density), _)| *viscosity > most * density)
            }
            None => self.viscosity > f64::from(most),
        }
    }

    /// Sets faces to 0 beside cells where it is, where not all are the same.
    pub(super) fn clear_thicker(&self, cells: &LiquidCells, most: f32, faces: &mut FaceFields<f32>) {
        let Some([viscosity, density]) = &self.of_cells else { return };
        let is_thick = |at: usize| cells.level_set[at] < 0.0 && viscosity[at] > most * density[at];
        let finder = Finder::new(&cells.rows);
        for (at, cell) in cells.rows.iter().enumerate() {
            for axis in 0..3 {
                let mut below = cell;
                below[axis] -= 1;
                if is_thick(at) || finder.find(below).is_some_and(is_thick) {
                    faces[axis][at] = 0.0;
                }
            }
        }
    }

    /// The density at each low face, where it is not the same everywhere.
    fn of_faces(&self, cells: &LiquidCells) -> Option<FaceFields<f32>> {
        let [_, density] = self.of_cells.as_ref()?;
        Some(face_densities(&cells.rows, &cells.level_set, density))
    }
}

/// The equations of a pressure that acts alone.
pub(super) struct PressureEquations {
    solver: PressureSolver,
    /// The density at each low face, where it is not the same everywhere.
    density: Option<FaceFields<f32>>,
}

impl PressureEquations {
    /// Whether the liquid has the same density everywhere: they then depend on its cells alone.
    pub(super) fn are_uniform(&self) -> bool {
        self.density.is_none()
    }
}

impl Projection<'_> {
    /// Lets pressure act on a velocity, and viscosity where it counts. `before`: the velocity without gravity. Returns the
    /// equations of pressure, too, where these are solved alone.
    pub(super) fn apply(
        &self,
        before: &FaceFields<f32>,
        pours: &mut [Pour],
        faces: &mut FaceFields<f32>,
        motion: &mut Motion,
    ) -> (LiquidReport, Option<PressureEquations>) {
        let solve = self.settings.coupling.solve(self.materials.largest(self.cells));
        let equations = (solve != ViscousSolve::Coupled).then(|| self.pressure_equations());
        let mut report = match &equations {
            None => {
                let likely = motion.with_last_gain(self.cells, before, self.seconds);
                self.by_pressure_and_viscosity(&likely, pours, faces, &mut motion.guess)
            }
            Some(equations) if solve == ViscousSolve::Decoupled => {
                self.by_pressure_then_viscosity(equations, pours, faces, &mut motion.guess)
            }
            Some(equations) => {
                self.by_pressure(equations, self.speed.max(self.pull()), pours, faces, &mut motion.guess)
            }
        };
        pours.iter().for_each(|pour| pour.enter(motion, self.seconds));
        let density = self.materials.of_cells.as_ref().map(|[_, density]| &density[..]);
        let rested = self.force(rested(self.cut, self.gravity, density));
        report.solid_force.iter_mut().zip(rested).for_each(|(force, rested)| *force += rested);
        (LiquidReport { viscous_substeps: u32::from(solve != ViscousSolve::LeftOut), ..report }, equations)
    }

    /// The largest component of what gravity adds, m/s.
    pub(super) fn pull(&self) -> f64 {
        self.gravity.iter().fold(0.0, |most, g| most.max(g.abs()))
    }

    /// Sets the equations of pressure up.
    pub(super) fn pressure_equations(&self) -> PressureEquations {
        let cells = self.cells;
        let density = self.materials.of_faces(cells);
        let lighter = density.as_ref().map(|density| divided(&cells.open, density));
        let [x, y, z] = lighter.as_ref().unwrap_or(&cells.open);
        let periods = self.settings.domain.periods();
        let grid = PressureGrid { rows: &cells.rows, level_set: &cells.level_set, weights: [x, y, z], periods };
        PressureEquations { solver: PressureSolver::new(&grid), density }
    }

    /// Drives the divergence out of a velocity. `scale`: the speed that errors are measured against, m/s.
    pub(super) fn by_pressure(
        &self,
        PressureEquations { solver, density }: &PressureEquations,
        scale: f64,
        pours: &mut [Pour],
        faces: &mut FaceFields<f32>,
        guess: &mut Guess,
    ) -> LiquidReport {
        let cells = self.cells;
        let mut inflow = inflow(solver, cells, faces);
        let poured = pour(pours, solver, self.settings.cell, &mut inflow);
        let mut q = solver.rows().resampled(&guess.rows, &guess.q, 0.0);
        let stop = Stop { flow: self.flow_tolerance(scale), iterations: self.settings.max_iterations };
        let solved = solver.solve(&mut inflow, &mut q, stop);
        subtract_gradient(solver, cells, density.as_ref(), &q, faces);
        let force = self.force(pressed(self.cut, solver, &q));
        *guess = Guess { rows: solver.rows().clone(), q };
        let is_done = solved.flow <= stop.flow;
        LiquidReport {
            pressure_iterations: solved.iterations,
            pressure_residual: if scale > 0.0 { solved.flow / scale } else { 0.0 },
            solves_cut_short: u32::from(!is_done),
            solid_force: force,
            ..self.report(solved.flow, [solved.unbalanced, poured])
        }
    }

    /// Net flow of a cell, m/s, that may be left.
    pub(super) fn flow_tolerance(&self, scale: f64) -> f64 {
        self.settings.tolerance * (FLOW_SHARE * scale).min(self.settings.cell / self.seconds)
    }

    /// The force, N, of an impulse ÷ density · cell³.
    pub(super) fn force(&self, impulse: [f64; 3]) -> [f64; 3] {
        let LiquidSettings { cell, density, .. } = self.settings;
        impulse.map(|impulse| impulse * density * cell * cell * cell / self.seconds)
    }

    pub(super) fn report(&self, flow: f64, unbalanced: [f64; 2]) -> LiquidReport {
        let per_cell = self.seconds / self.settings.cell;
        let unbalanced = if unbalanced[1].abs() > unbalanced[0].abs() { unbalanced[1] } else { unbalanced[0] };
        LiquidReport { max_divergence: flow * per_cell, unbalanced: unbalanced * per_cell, ..LiquidReport::default() }
    }
}

/// The net inflow of each liquid cell, m/s.
fn inflow(solver: &PressureSolver, cells: &LiquidCells, faces: &FaceFields<f32>) -> Vec<f64> {
    let mut through: FaceFields<f64> = Default::default();
    parallel::for_each(through.iter_mut().enumerate(), |_, (axis, through)| {
        let flow = |(u, share): (&f32, &f32)| f64::from(*u) * f64::from(*share);
        let mut own: Vec<f64> = faces[axis].iter().zip(&cells.open[axis]).map(flow).collect();
        if let Some(solid) = &cells.solid_velocity {
            own.iter_mut().zip(covered(axis, &cells.open, solid)).for_each(|(own, covered)| *own += covered);
        }
        *through = solver.rows().resampled(&cells.rows, &own, 0.0);
    });
    net(solver.rows(), solver.stencil(), &through)
}

/// What a solid carries through the share of each face that it covers, m/s.
pub(super) fn covered(axis: usize, open: &FaceFields<f32>, solid: &FaceFields<f32>) -> impl Iterator<Item = f64> {
    solid[axis].iter().zip(&open[axis]).map(|(u, share)| f64::from(*u) * (1.0 - f64::from(*share)))
}

/// What flows into each active cell, less what flows out, where this flows through faces upwards.
pub(super) fn net(rows: &CellRows, stencil: &Stencil, through: &FaceFields<f64>) -> Vec<f64> {
    let mut inflow = vec![0.0; rows.len()];
    stencil.update([&mut inflow], |runs, first, [inflow]| {
        for run in runs {
            for n in 0..run.len as usize {
                let (at, _, [x, y, z]) = run.neighbours(n);
                let along_x = through[0][at] - through[0][x];
                let along_y = through[1][at] - through[1][y];
                let along_z = through[2][at] - through[2][z];
                inflow[at - first] = along_x + along_y + along_z;
            }
        }
    });
    inflow
}

/// The open share of each face ÷ its density.
fn divided(open: &FaceFields<f32>, density: &FaceFields<f32>) -> FaceFields<f32> {
    std::array::from_fn(|axis| open[axis].iter().zip(&density[axis]).map(|(open, density)| open / density).collect())
}

/// Takes the gradient of `q` ÷ the density from open faces.
fn subtract_gradient(
    solver: &PressureSolver,
    cells: &LiquidCells,
    density: Option<&FaceFields<f32>>,
    q: &[f64],
    faces: &mut FaceFields<f32>,
) {
    parallel::for_each(faces.iter_mut().enumerate(), |_, (axis, faces)| {
        let mut gradient = vec![0.0; solver.rows().len()];
        solver.for_each_gradient_along(axis, q, |at, value| gradient[at] = value as f32);
        let mut gradient = cells.rows.resampled(solver.rows(), &gradient, 0.0);
        if let Some(density) = density {
            gradient.iter_mut().zip(&density[axis]).for_each(|(gradient, density)| *gradient /= density);
        }
        let open = cells.open[axis].iter().map(|open| *open > 0.0);
        let taken = faces.iter_mut().zip(&gradient).zip(open);
        taken.filter(|(_, is_open)| *is_open).for_each(|((u, gradient), _)| *u -= gradient);
    });
}
