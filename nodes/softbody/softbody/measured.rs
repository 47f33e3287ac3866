//! What the solver measures in a frame, as metrics.

use bodies::mass_spring::{FrameReport, State};
use engine::prelude::*;

use super::{
    CAPS_HIT, CG, CONTACTS, ELASTIC, ENERGY_LOST, ENERGY_SHED, ERROR_ESTIMATE, FAST_TURNS, GOAL_ENERGY, INVERTED_TETS,
    JAMMED, KINETIC, NEWTON, RESIDUAL, SUBSTEPS_USED, TOLERANCE_MISSED, TORN, UNCUT_IMPACTS, VOLUME_RATIO,
    WORST_STRETCH,
};

/// The metrics of a frame that the solver alone determines.
pub(super) fn measured(report: &FrameReport, state: &State) -> MetricValues {
    let mut metrics = MetricValues::default();
    metrics.set(NEWTON, report.newton);
    metrics.set(CG, report.cg);
    metrics.set(RESIDUAL, report.residual);
    metrics.set(CAPS_HIT, report.caps_hit + report.stopped);
    metrics.set(TOLERANCE_MISSED, report.tolerance_missed);
    metrics.set(ERROR_ESTIMATE, report.error_estimate);
    metrics.set(KINETIC, report.kinetic);
    metrics.set(ELASTIC, report.elastic);
    metrics.set(GOAL_ENERGY, report.goal_energy);
    metrics.set(ENERGY_SHED, report.energy_removed);
    metrics.set(ENERGY_LOST, report.energy_lost);
    metrics.set(FAST_TURNS, report.fast_turns);
    metrics.set(UNCUT_IMPACTS, report.uncut_impacts);
    metrics.set(VOLUME_RATIO, report.volume_ratio);
    metrics.set(WORST_STRETCH, report.worst_stretch);
    metrics.set(INVERTED_TETS, report.inverted_tets);
    metrics.set(CONTACTS, report.contacts);
    metrics.set(JAMMED, report.jammed);
    metrics.set(TORN, state.torn.iter().filter(|torn| **torn).count() as f64);
    metrics.set(SUBSTEPS_USED, report.substeps);
    metrics
}
