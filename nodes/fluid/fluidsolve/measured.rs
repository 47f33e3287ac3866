//! What is measured of the liquid, as metrics.

use engine::prelude::*;
use liquid::level_set::PhiSampler;
use liquid::marked::MarkedSurface;
use liquid::step::{LiquidReport, Surface};

use super::{
    CAPS_HIT, CFL_REACHED, COLLIDER_FORCE_X, COLLIDER_FORCE_Y, COLLIDER_FORCE_Z, COUPLED_ITERATIONS, COUPLED_RESIDUAL,
    LIQUID_CELLS, LONG_SUBSTEPS, MAX_DIVERGENCE, PASSED_THROUGH, PRESSURE_ITERATIONS, PRESSURE_RESIDUAL,
    SOLVES_CUT_SHORT, SUBSTEPS_USED, VISCOSITY_ITERATIONS, VISCOSITY_RESIDUAL,
};

/// Sets the metrics of a frame that the solver alone determines.
pub(super) fn measured(metrics: &mut MetricValues, report: &LiquidReport) {
    metrics.set(SUBSTEPS_USED, report.substeps);
    metrics.set(CFL_REACHED, report.cfl_reached);
    metrics.set(CAPS_HIT, report.caps_hit + report.solves_cut_short);
    metrics.set(LONG_SUBSTEPS, report.caps_hit);
    metrics.set(SOLVES_CUT_SHORT, report.solves_cut_short);
    metrics.set(PRESSURE_ITERATIONS, report.pressure_iterations);
    metrics.set(PRESSURE_RESIDUAL, report.pressure_residual);
    metrics.set(COUPLED_ITERATIONS, report.coupled_iterations);
    metrics.set(COUPLED_RESIDUAL, report.coupled_residual);
    metrics.set(VISCOSITY_ITERATIONS, report.viscosity_iterations);
    metrics.set(VISCOSITY_RESIDUAL, report.viscosity_residual);
    metrics.set(MAX_DIVERGENCE, report.max_divergence.max(report.unbalanced));
    metrics.set(PASSED_THROUGH, report.passed_through);
    metrics.set(LIQUID_CELLS, report.liquid_cells as f64);
    for (metric, force) in [COLLIDER_FORCE_X, COLLIDER_FORCE_Y, COLLIDER_FORCE_Z].into_iter().zip(report.solid_force) {
        metrics.set(metric, force);
    }
}

/// Number of cells of a surface, in solver cells, whose middle is in the liquid.
pub(super) fn liquid_cells(surface: &MarkedSurface) -> usize {
    let view = surface.view();
    let is_in = |cell: [i32; 3]| (0..3).all(|k| view.low[k] <= cell[k] && cell[k] < view.high[k]);
    view.rows.iter().zip(view.phi).filter(|(cell, phi)| **phi < 0.0 && is_in(*cell)).count()
}

/// Parts along the side of a cell that the surface may cut, for its mass.
const PARTS: i32 = 4;
/// Distance from the surface, in cells, from which on it does not.
const UNCUT: f32 = 1.0;

/// The centre of mass of what a surface encloses, in solver cells, of this density at a place; 0 where there is no liquid.
pub(super) fn centre_of_mass(surface: &MarkedSurface, density: impl Fn([f32; 3]) -> f64) -> [f32; 3] {
    let view = surface.level_set().view();
    let unit = 1.0 / f64::from(surface.resolution());
    let mut sampler = PhiSampler::new(view);
    let (mut moment, mut mass) = ([0.0; 3], 0.0);
    let mut add = |place: [f64; 3], volume: f64| {
        let place = place.map(|x| x * unit);
        let own = volume * density(place.map(|x| x as f32));
        mass += own;
        (0..3).for_each(|k| moment[k] += own * place[k]);
    };
    let is_in = |cell: [i32; 3]| (0..3).all(|k| view.low[k] <= cell[k] && cell[k] < view.high[k]);
    for (at, cell) in view.rows.iter().enumerate().filter(|(_, cell)| is_in(*cell)) {
        let side = if view.phi[at].abs() < UNCUT { PARTS } else { 1 };
        if side == 1 && view.phi[at] >= 0.0 {
            continue;
        }
        for n in 0..side * side * side {
            let part = [n % side, n / side % side, n / (side * side)];
            let share = |k: usize| (f64::from(part[k]) + 0.5) / f64::from(side);
            let place = [0, 1, 2].map(|k| f64::from(cell[k]) + share(k));
            let phi = f64::from(sampler.at(place.map(|x| x as f32))) * f64::from(side);
            let filled = (0.5 - phi).clamp(0.0, 1.0);
            if filled > 0.0 {
                add(place, filled / f64::from(side * side * side));
            }
        }
    }
    moment.map(|x| if mass > 0.0 { (x / mass) as f32 } else { 0.0 })
}

/// Points − edges + faces of a closed mesh of quads, in which two quads share each edge.
pub(super) fn euler_characteristic(surface: &Component) -> f64 {
    surface.point_count() as f64 - surface.element_count() as f64
}
