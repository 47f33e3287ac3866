//! What keeps spin.
//!
//! In a substep liquid is accelerated along its way; the pressure acts all at once at the end of it. To second order the
//! velocity then lacks ½Δt²·D(∇p)/Dt = ½Δt²·(∇(Dp/Dt) − (∇u)ᵀ∇p). The first term is the gradient of something that is 0 on
//! the surface, which the next pressure makes good; the second is not. So ½Δt·(∇u)ᵀa is added to the velocity before it
//! is carried, with a = g − ∇p of the substep before: with ∇p alone, hydrostatic pressure would act on the surface of the
//! substep before, and waves grow.

use numerics::vector::Vec3;

use crate::rows::Periods;
use crate::step::motion::{Gain, Motion};
use crate::velocity::{FaceFields, Sampler, Site, extrapolate, resampled};

/// Layers of faces past the liquid that differences at its faces reach.
const REACHED: u32 = 2;

/// The velocity that is to be carried in a substep of `seconds`, on the rows of the velocity. `gain`: of the substep before;
/// `step`: cells moved at speed 1; differences of velocity count as at most `steepest`.
pub(super) fn carried(
    motion: &Motion,
    gain: &Gain,
    periods: Periods,
    seconds: f64,
    step: f32,
    steepest: f32,
) -> FaceFields<f32> {
    let rows = match periods.any() {
        true => periods.stored(motion.rows().dilated(1), 2 * REACHED as i32),
        false => motion.rows().dilated(1),
    };
    let images = periods.images(&rows);
    let mut known = rows.resampled(motion.rows(), &motion.known, 0);
    let mut velocity = resampled(&rows, motion.rows(), motion.velocity.faces());
    let mut gained = resampled(&rows, motion.rows(), &gain.faces);
    images.fill(&mut known);
    images.fill_each(&mut velocity);
    images.fill_each(&mut gained);
    extrapolate(&rows, &mut known, [&mut velocity, &mut gained], steepest, REACHED);
    let weight = 0.5 * step * (seconds / gain.seconds) as f32;
    motion.rows().tabulate_with(
        || Sampler::new(&rows),
        |sampler, cell, at| {
            let mut carried = [0.0; 3];
            for axis in (0..3).filter(|axis| motion.known[at] >> axis & 1 == 1) {
                let own = motion.velocity.faces()[axis][at];
                let middle = Site::FACES[axis].of(cell);
                let mut sum =
                    along(sampler, &velocity[axis], axis, middle).clamp(-steepest, steepest) * gain.faces[axis][at];
                for other in (0..3).filter(|other| *other != axis) {
                    let Some(corners) = sampler.corners(Site::FACES[other], middle) else { continue };
                    let slope = corners.slope(&velocity[other], axis);
                    sum += slope.clamp(-steepest, steepest) * corners.value(&gained[other]);
                }
                carried[axis] = own + weight * sum;
            }
            carried
        },
    )
}

/// The derivative of a field on faces along their own axis.
fn along(sampler: &mut Sampler<'_>, field: &[f32], axis: usize, face: Vec3) -> f32 {
    let (mut below, mut above) = (face, face);
    below[axis] -= 0.5;
    above[axis] += 0.5;
    let site = Site::FACES[axis];
    sampler.value(field, site, above) - sampler.value(field, site, below)
}
