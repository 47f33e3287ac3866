//! One substep.

use numerics::vector::{Vec3, scale};

use crate::level_set::PhiView;
use crate::rows::CellRows;
use crate::step::domain::Solid;
use crate::step::motion::{Gain, LiquidCells, Motion};
use crate::step::project::Projection;
use crate::step::turned;
use crate::step::{LiquidReport, LiquidSettings, Splitting, Wall};
use crate::velocity::{Advection, FaceFields, MacVelocity, Sampler};

/// What is around a liquid.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// Gravity at a time since the start of the frame, m/s².
    pub gravity: &'a (dyn Fn(f64) -> [f64; 3] + Sync),
    /// Dynamic viscosity at a time since the start of the frame, Pa·s.
    pub viscosity: &'a (dyn Fn(f64) -> f64 + Sync),
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

/// Moves on by `seconds`; `middle` is when gravity and viscosity are read.
pub(super) fn substep<S: Surface>(
    settings: &LiquidSettings,
    surface: &mut S,
    motion: &mut Motion,
    around: &Surroundings<'_>,
    middle: f64,
    seconds: f64,
) -> LiquidReport {
    let domain = &settings.domain;
    // Where it is and how it moves at the middle of the substep is what pushes the liquid.
    let solid = around.solid.map(|solid| solid.at(middle));
    let step = (seconds / settings.cell) as f32;
    let reach = motion.largest_speed() as f32 * step;
    let layers = BAND + reach.ceil().min(64.0) as i32;
    let steepest = STEEPEST / step;
    let rows = motion.rows_past_liquid(domain, layers);
    let own = motion.velocity.faces();
    let (velocity, carried) = match &motion.gain {
        Some(gain) => {
            let carried = turned::carried(motion, gain, seconds, step, steepest);
            let [velocity, carried] = motion.continued([own, &carried], &rows, steepest, domain, solid);
            (velocity, Some(carried))
        }
        None => {
            let [velocity] = motion.continued([own], &rows, steepest, domain, solid);
            (velocity, None)
        }
    };
    let velocity = MacVelocity::new(rows, velocity);
    surface.advance(&Moving { velocity: &velocity, step }, reach);

    let cells = LiquidCells::of(domain, surface, solid);
    let advection = Advection { velocity: &velocity, bounds: domain.bounds(), step, scheme: settings.scheme };
    let mut faces = advection.carry(carried.as_ref().unwrap_or(velocity.faces()), &cells.rows, &cells.moving);
    let before = faces.clone();
    let gravity = (around.gravity)(middle);
    for axis in 0..3 {
        let gain = (gravity[axis] * seconds) as f32;
        let moving = faces[axis].iter_mut().zip(&cells.moving).filter(|(_, mask)| **mask >> axis & 1 == 1);
        moving.for_each(|(u, _)| *u += gain);
    }
    let stored_cells = velocity.rows().len();
    drop((velocity, carried));

    let pull = gravity.iter().fold(0.0_f64, |most, g| most.max(g.abs() * seconds));
    let projection = Projection { settings, cells: &cells, solid, speed: motion.largest_speed(), pull, seconds };
    let viscosity = (around.viscosity)(middle) * seconds / (settings.density * settings.cell * settings.cell);
    let mut report = match settings.coupling.is_coupled(viscosity) {
        true => {
            let likely = motion.with_last_gain(&cells, &before, seconds);
            projection.by_pressure_and_viscosity(viscosity, &likely, &mut faces, &mut motion.guess)
        }
        false => projection.by_pressure(&mut faces, &mut motion.guess),
    };
    report.viscous_substeps = u32::from(settings.coupling.is_coupled(viscosity));
    motion.gain = (settings.splitting == Splitting::KeepsSpin).then(|| {
        let gained =
            |axis: usize| faces[axis].iter().zip(&before[axis]).map(|(after, before)| after - before).collect();
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
