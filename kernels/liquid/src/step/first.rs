//! What the first substep of a liquid that moves needs of the one before, which there was not.

use crate::step::flight::Flight;
use crate::step::motion::{Gain, LiquidCells, Motion};
use crate::step::project::{Materials, Projection};
use crate::step::sources::Span;
use crate::step::substep::{FARTHEST, STEEPEST};
use crate::step::turned::along_itself;
use crate::step::{LiquidReport, LiquidSettings, Splitting, Surface, Surroundings};
use crate::velocity::resampled;

/// What finding the first gain took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FirstSolve {
    pressure_iterations: u32,
    coupled_iterations: u32,
    viscosity_iterations: u32,
    solves_cut_short: u32,
}

impl FirstSolve {
    /// Adds it to the report of the substep.
    pub(super) fn count(self, report: &mut LiquidReport) {
        report.pressure_iterations += self.pressure_iterations;
        report.coupled_iterations += self.coupled_iterations;
        report.viscosity_iterations += self.viscosity_iterations;
        report.solves_cut_short += self.solves_cut_short;
    }
}

/// Finds what a substep like the next would have added to the velocity of liquid that moves, where there was none. Δt·(g −
/// (u·∇)u) is what the velocity at a place changes by without pressure; what pressure and viscosity leave of it is
/// what it changes by. Solids count as still: their own motion is in the velocity, or an impulse that does not go on.
pub(super) fn begin(
    settings: &LiquidSettings,
    surface: &dyn Surface,
    motion: &mut Motion,
    around: &Surroundings<'_>,
    span: Span,
) -> FirstSolve {
    let (speed, is_new) = (motion.largest_speed(), std::mem::take(&mut motion.is_new));
    let seconds = span.times[1] - span.times[0];
    let step = (seconds / settings.cell) as f32;
    let is_followed = speed > 0.0 && speed as f32 * step <= FARTHEST;
    if !is_new || settings.splitting != Splitting::KeepsSpin || !is_followed {
        return FirstSolve::default();
    }
    let steepest = STEEPEST / step;
    let pulled = (around.gravity)(span.times[0]).map(|g| g * seconds);
    let solid = around.solid.map(|solid| solid.at(span.times[0]).stopped());
    let mut cells = LiquidCells::of(&settings.domain, surface, solid);
    cells.fill_images();

    let mut along = along_itself(motion, settings.domain.periods(), steepest);
    along.iter_mut().flatten().for_each(|along| *along *= -step);
    let mut faces = resampled(&cells.rows, motion.rows(), &along);
    for axis in 0..3 {
        for (u, moving) in faces[axis].iter_mut().zip(&cells.moving) {
            *u = if moving >> axis & 1 == 1 { *u + pulled[axis] as f32 } else { 0.0 };
        }
    }
    cells.images.fill_each(&mut faces);
    let still = faces.each_ref().map(|field| vec![0.0; field.len()]);
    let own = [(around.viscosity)(span.times[0]), settings.density];
    // Taking stock of the points of materials may change them: the substep itself will do so.
    let points = motion.materials.clone();
    let materials = motion.materials_of(&cells, surface.view(), &settings.domain, own.map(|own| own as f32));
    motion.materials = points;
    let materials = Materials::new(own, materials, settings, seconds);
    let (cut, imposed) = (&[], &[]);
    let projection =
        Projection { settings, cells: &cells, materials, solid, cut, imposed, speed, gravity: pulled, seconds };
    let report = projection.apply(&still, &mut [], &mut faces, motion);
    let change = resampled(motion.rows(), &cells.rows, &faces);
    let gained = |axis: usize| change[axis].iter().zip(&along[axis]).map(|(change, along)| change - along).collect();
    let faces = [gained(0), gained(1), gained(2)];
    let steady = Flight::of(&cells, &settings.domain, &[]).steady;
    let changed = (!steady.is_empty() && !motion.flying.is_empty()).then(|| {
        let steady = motion.rows().resampled(&cells.rows, &steady, 0);
        std::array::from_fn(|axis| {
            let faces = change[axis].iter().zip(&steady);
            let besides = |(u, mask): (&f32, &u8)| if mask >> axis & 1 == 1 { u - pulled[axis] as f32 } else { 0.0 };
            faces.map(besides).collect()
        })
    });
    motion.gain = Some(Gain { faces, changed, seconds });
    FirstSolve {
        pressure_iterations: report.pressure_iterations,
        coupled_iterations: report.coupled_iterations,
        viscosity_iterations: report.viscosity_iterations,
        solves_cut_short: report.solves_cut_short,
    }
}
