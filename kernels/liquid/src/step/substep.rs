//! One substep.

use numerics::vector::{Vec3, scale};

use crate::level_set::PhiView;
use crate::pressure::{PressureGrid, PressureSolver, Stop};
use crate::rows::CellRows;
use crate::step::domain::Solid;
use crate::step::motion::{Gain, Guess, LiquidCells, Motion};
use crate::step::turned;
use crate::step::{LiquidReport, LiquidSettings, Splitting, Wall};
use crate::velocity::{Advection, FaceFields, MacVelocity, Sampler};

/// What is around a liquid.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// Gravity at a time since the start of the frame, m/s².
    pub gravity: &'a (dyn Fn(f64) -> [f64; 3] + Sync),
    /// What liquid does not enter.
    pub solid: Option<Solid<'a>>,
}

/// The surface of a liquid.
pub trait Surface {
    /// φ, a distance near the surface.
    fn view(&self) -> PhiView<'_>;

    /// Moves by a flow that moves nothing in the liquid farther than `reach` cells.
    fn advance(&mut self, flow: &Moving<'_>, reach: f32);
}

/// The ways of points in a substep.
#[derive(Clone, Copy, Debug)]
pub struct Moving<'a> {
    /// Velocity, m/s.
    pub velocity: &'a MacVelocity,
    /// Cells moved at 1 m/s.
    pub step: f32,
}

impl<'a> Moving<'a> {
    /// The way, in cells, at a place in cells. Fast where successive places are near each other.
    pub fn reader(&self) -> impl FnMut(Vec3) -> Vec3 + use<'a> {
        let (velocity, step) = (self.velocity, self.step);
        let mut sampler = Sampler::new(velocity.rows());
        move |point| scale(velocity.at(&mut sampler, point), step)
    }
}

/// Differences of velocity between neighbouring faces that are continued, in cells a substep: a flow that changes faster
/// would turn its cells over.
const STEEPEST: f32 = 0.25;

/// Cells past the liquid, besides those that it moves, whose velocity is needed: a surface follows the flow in a band.
const BAND: i32 = 5;

/// Net flow of a cell, of the largest error that it may cause in a velocity.
const FLOW_SHARE: f64 = 0.25;

/// Moves on by `seconds`; `middle` is when gravity is read.
pub(super) fn substep<S: Surface>(
    settings: &LiquidSettings,
    surface: &mut S,
    motion: &mut Motion,
    around: &Surroundings<'_>,
    middle: f64,
    seconds: f64,
) -> LiquidReport {
    let domain = &settings.domain;
    let step = (seconds / settings.cell) as f32;
    let reach = motion.largest_speed() as f32 * step;
    let layers = BAND + reach.ceil().min(64.0) as i32;
    let steepest = STEEPEST / step;
    let rows = motion.rows_past_liquid(domain, layers);
    let own = motion.velocity.faces();
    let (velocity, carried) = match &motion.gain {
        Some(gain) => {
            let carried = turned::carried(motion, gain, seconds, step, steepest);
            let [velocity, carried] = motion.continued([own, &carried], &rows, steepest, domain, around.solid);
            (velocity, Some(carried))
        }
        None => {
            let [velocity] = motion.continued([own], &rows, steepest, domain, around.solid);
            (velocity, None)
        }
    };
    let velocity = MacVelocity::new(rows, velocity);
    surface.advance(&Moving { velocity: &velocity, step }, reach);

    let cells = LiquidCells::of(domain, surface, around.solid);
    let advection = Advection { velocity: &velocity, bounds: domain.bounds(), step, scheme: settings.scheme };
    let mut faces = advection.carry(carried.as_ref().unwrap_or(velocity.faces()), &cells.rows, &cells.moving);
    let gravity = (around.gravity)(middle);
    for axis in 0..3 {
        let gain = (gravity[axis] * seconds) as f32;
        let moving = faces[axis].iter_mut().zip(&cells.moving).filter(|(_, mask)| **mask >> axis & 1 == 1);
        moving.for_each(|(u, _)| *u += gain);
    }
    let stored_cells = velocity.rows().len();
    drop((velocity, carried));

    let scale = gravity.iter().fold(motion.largest_speed(), |most, g| most.max(g.abs() * seconds));
    let (mut report, taken) = project(settings, &cells, &mut faces, &mut motion.guess, scale, seconds);
    motion.gain = (settings.splitting == Splitting::KeepsSpin).then(|| {
        let gained = |axis: usize| taken[axis].iter().map(|taken| (gravity[axis] * seconds) as f32 - taken).collect();
        Gain { faces: [gained(0), gained(1), gained(2)], seconds }
    });
    report.substeps = 1;
    report.cfl_reached = f64::from(reach);
    report.stored_cells = stored_cells;
    report.liquid_cells = cells.count;
    report.left_domain = outflow(settings, &cells, &faces) * seconds * settings.cell * settings.cell;
    motion.liquid_cells = cells.count;
    motion.known = cells.known;
    motion.velocity = MacVelocity::new(cells.rows, faces);
    report
}

/// Drives the divergence out of a velocity. Returns what that took from it besides. `scale`: what errors of the velocity
/// are measured against.
fn project(
    settings: &LiquidSettings,
    cells: &LiquidCells,
    faces: &mut FaceFields<f32>,
    guess: &mut Guess,
    scale: f64,
    seconds: f64,
) -> (LiquidReport, FaceFields<f32>) {
    let [x, y, z] = &cells.open;
    let grid = PressureGrid { rows: &cells.rows, level_set: &cells.level_set, weights: [x, y, z] };
    let solver = PressureSolver::new(&grid);
    let mut inflow = inflow(&solver, cells, faces);
    let mut q = solver.rows().resampled(&guess.rows, &guess.q, 0.0);
    let flow = settings.tolerance * (FLOW_SHARE * scale).min(settings.cell / seconds);
    let stop = Stop { flow, iterations: settings.max_iterations };
    let solved = solver.solve(&mut inflow, &mut q, stop);
    let taken = subtract_gradient(&solver, cells, &q, faces);
    *guess = Guess { rows: solver.rows().clone(), q };
    let per_cell = seconds / settings.cell;
    let report = LiquidReport {
        pressure_iterations: solved.iterations,
        solves_cut_short: u32::from(solved.flow > stop.flow && solved.iterations >= stop.iterations),
        max_divergence: solved.flow * per_cell,
        unbalanced: solved.unbalanced * per_cell,
        ..LiquidReport::default()
    };
    (report, taken)
}

/// The net inflow of each liquid cell, m/s.
fn inflow(solver: &PressureSolver, cells: &LiquidCells, faces: &FaceFields<f32>) -> Vec<f64> {
    let rows = solver.rows();
    let through: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let flow = |(u, share): (&f32, &f32)| f64::from(*u) * f64::from(*share);
        let own: Vec<f64> = faces[axis].iter().zip(&cells.open[axis]).map(flow).collect();
        rows.resampled(&cells.rows, &own, 0.0)
    });
    let mut inflow = vec![0.0; rows.len()];
    solver.stencil().update([&mut inflow], |runs, first, [inflow]| {
        for run in runs {
            for n in 0..run.len as usize {
                let at = run.at as usize + n;
                let along_x = through[0][at] - through[0][at + 1];
                let along_y = through[1][at] - through[1][run.y[1] as usize + n];
                let along_z = through[2][at] - through[2][run.z[1] as usize + n];
                inflow[at - first] = along_x + along_y + along_z;
            }
        }
    });
    inflow
}

/// Takes the gradient of `q` from open faces; returns it.
fn subtract_gradient(
    solver: &PressureSolver,
    cells: &LiquidCells,
    q: &[f64],
    faces: &mut FaceFields<f32>,
) -> FaceFields<f32> {
    let mut gradient: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; solver.rows().len()]);
    solver.for_each_gradient(q, |axis, at, value| gradient[axis][at] = value as f32);
    std::array::from_fn(|axis| {
        let mut taken = cells.rows.resampled(solver.rows(), &gradient[axis], 0.0);
        for (at, taken) in taken.iter_mut().enumerate() {
            if cells.open[axis][at] > 0.0 {
                faces[axis][at] -= *taken;
            } else {
                *taken = 0.0;
            }
        }
        taken
    })
}

/// What flows out through open walls, m/s · faces.
fn outflow(settings: &LiquidSettings, cells: &LiquidCells, faces: &FaceFields<f32>) -> f64 {
    let domain = &settings.domain;
    if domain.walls.as_flattened().iter().all(|wall| *wall != Wall::Open) {
        return 0.0;
    }
    let rows: &CellRows = &cells.rows;
    let mut sum = 0.0;
    for (at, cell) in rows.iter().enumerate() {
        for axis in 0..3 {
            if cells.moving[at] >> axis & 1 == 1 && domain.wall_at(axis, cell) == Some(Wall::Open) {
                let outward = if cell[axis] == domain.low[axis] { -1.0 } else { 1.0 };
                sum += outward * f64::from(cells.open[axis][at]) * f64::from(faces[axis][at]);
            }
        }
    }
    sum
}
