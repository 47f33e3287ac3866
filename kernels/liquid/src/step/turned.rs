//! What keeps spin.
//!
//! In a substep liquid is accelerated along its way; the pressure acts all at once at the end of it. To second order the
//! velocity then lacks ½Δt²·D(∇p)/Dt = ½Δt²·(∇(Dp/Dt) − (∇u)ᵀ∇p). The first term is the gradient of something that is 0 on
//! the surface, which the next pressure makes good; the second is not. So ½Δt·(∇u)ᵀa is added to the velocity before it
//! is carried, with a = g − ∇p of the substep before: with ∇p alone, hydrostatic pressure would act on the surface of the
//! substep before, and waves grow.

use crate::rows::{CellRows, Periods};
use crate::step::motion::{Gain, Motion};
use crate::velocity::{Around, FaceFields, Slopes, extrapolate, resampled};

/// Layers of faces past the liquid that differences at its faces reach.
const REACHED: u32 = 2;

/// Fields that are known on the faces of the liquid, continued past it as far as differences at its faces reach.
struct Differences<const F: usize> {
    rows: CellRows,
    fields: [FaceFields<f32>; F],
}

impl<const F: usize> Differences<F> {
    /// `fields`: on the rows of the velocity; see [`carried`].
    fn of(motion: &Motion, fields: [&FaceFields<f32>; F], periods: Periods, steepest: f32) -> Self {
        let rows = match periods.any() {
            true => periods.stored(motion.rows().dilated(1), 2 * REACHED as i32),
            false => motion.rows().dilated(1),
        };
        let images = periods.images(&rows);
        let mut known = rows.resampled(motion.rows(), &motion.known, 0);
        let mut fields = fields.map(|faces| resampled(&rows, motion.rows(), faces));
        images.fill(&mut known);
        fields.iter_mut().for_each(|faces| images.fill_each(faces));
        extrapolate(&rows, &mut known, fields.each_mut(), [Slopes::nearest(steepest); F], REACHED);
        Self { rows, fields }
    }
}

/// The velocity that is to be carried in a substep of `seconds`, on the rows of the velocity. `gain`: of the substep before;
/// `step`: cells moved at speed 1; differences of velocity count as at most `steepest`.
pub(super) fn carried(
    motion: &Motion,
    gain: &Gain,
    periods: Periods,
    seconds: f64,
    [step, steepest]: [f32; 2],
) -> FaceFields<f32> {
    let Differences { rows, fields: [velocity, gained] } =
        &Differences::of(motion, [motion.velocity.faces(), &gain.faces], periods, steepest);
    let weight = 0.5 * step * (seconds / gain.seconds) as f32;
    motion.rows().tabulate_with(
        || Around::new(rows),
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
