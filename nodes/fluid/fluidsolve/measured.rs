//! What is measured of the liquid, as metrics.

use engine::prelude::*;
use liquid::marked::MarkedSurface;
use liquid::step::{LiquidReport, Surface};

use super::{
    CAPS_HIT, CFL_REACHED, COLLIDER_FORCE_X, COLLIDER_FORCE_Y, COLLIDER_FORCE_Z, COUPLED_ITERATIONS, COUPLED_RESIDUAL,
    LIQUID_CELLS, LONG_SUBSTEPS, MAX_DIVERGENCE, PRESSURE_ITERATIONS, PRESSURE_RESIDUAL, SOLVES_CUT_SHORT,
    SUBSTEPS_USED, VISCOSITY_ITERATIONS, VISCOSITY_RESIDUAL,
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
    metrics.set(LIQUID_CELLS, report.liquid_cells as f64);
    for (metric, force) in [COLLIDER_FORCE_X, COLLIDER_FORCE_Y, COLLIDER_FORCE_Z].into_iter().zip(report.solid_force) {
        metrics.set(metric, force);
    }
}

/// Where liquid is, in solver cells.
pub(super) struct Pool {
    /// The centre of mass; 0 where there is no liquid.
    pub(super) centre: [f32; 3],
    /// Number of cells.
    pub(super) cells: usize,
}

/// The cells of a surface whose middle is in the liquid, of this density at a place in cells.
pub(super) fn pool_of(surface: &MarkedSurface, density: impl Fn([f32; 3]) -> f64) -> Pool {
    let view = surface.view();
    let (mut sum, mut mass, mut cells) = ([0.0; 3], 0.0, 0_usize);
    for (at, cell) in view.rows.iter().enumerate() {
        if view.phi[at] < 0.0 && (0..3).all(|k| view.low[k] <= cell[k] && cell[k] < view.high[k]) {
            cells += 1;
            let own = density(cell.map(|x| x as f32 + 0.5));
            mass += own;
            (0..3).for_each(|k| sum[k] += own * (f64::from(cell[k]) + 0.5));
        }
    }
    Pool { centre: sum.map(|x| if cells > 0 { (x / mass) as f32 } else { 0.0 }), cells }
}

/// Points − edges + faces of a closed mesh of quads, in which two quads share each edge.
pub(super) fn euler_characteristic(surface: &Component) -> f64 {
    surface.point_count() as f64 - surface.element_count() as f64
}
