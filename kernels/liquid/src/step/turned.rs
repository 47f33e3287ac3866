//! What keeps spin.
//!
//! In a substep liquid is accelerated along its way; the pressure acts all at once at the end of it. To second order the
//! velocity then lacks ½Δt²·D(∇p)/Dt = ½Δt²·(∇(Dp/Dt) − (∇u)ᵀ∇p). The first term is the gradient of something that is 0 on
//! the surface, which the next pressure makes good; the second is not. So ½Δt·(∇u)ᵀa is added to the velocity before it
//! is carried, with a = g − ∇p of the substep before: with ∇p alone, hydrostatic pressure would act on the surface of the
//! substep before, and waves grow.

use crate::rows::Periods;
use crate::step::motion::{Gain, Motion};
use crate::velocity::{Around, FaceFields, extrapolate, resampled};

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
        || Around::new(&rows),
        |around, cell, at| {
            let known = motion.known[at];
            let Some(places) = (if known == 0 { None } else { around.places(cell) }) else { return [0.0; 3] };
            [0, 1, 2].map(|axis| {
                if known >> axis & 1 == 0 {
                    return 0.0;
                }
                let slope = places.along(&velocity[axis], axis).clamp(-steepest, steepest);
                let mut sum = slope * gain.faces[axis][at];
                for other in [(axis + 1) % 3, (axis + 2) % 3] {
                    let slope = places.slope(&velocity[other], other, axis).clamp(-steepest, steepest);
                    sum += slope * places.mean(&gained[other], other, axis);
                }
                motion.velocity.faces()[axis][at] + weight * sum
            })
        },
    )
}
