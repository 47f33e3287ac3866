//! How near the axes of curves with a width come to what they collide with, in the written result.

use super::capsule::distance;
use super::crossing::corners;
use super::hair::Hair;
use super::segment_turn::{Nearby, gather};
use super::{Collide, Reached};
use numerics::lanes::LANES;
use numerics::vector::{DVec3, to_f32, to_f64};

/// Share of half a width that may be missing: contacts are computed to 1e-4 of it.
const MISSING: f64 = 1e-3;

impl Hair<'_> {
    /// Counts the segments that are nearer to something than half their width, from where the curve is that far away on,
    /// and whether its root is nearer.
    #[inline(always)]
    pub(super) fn measure_clearance<'t>(&self, how: &Collide<'t>, nearby: &mut Nearby<'t>, reached: &mut Reached) {
        let mut is_away = false;
        for k in 0..self.out.len() - 1 {
            let half = 0.5 * f64::from(how.width.at(self.first + k));
            if !(half > 0.0 && half.is_finite()) {
                continue;
            }
            let [from, to] = [self.out[k], self.out[k + 1]].map(to_f64);
            gather(
                how.obstacles,
                to_f32(from.inf(&to).add_scalar(-half)),
                to_f32(from.sup(&to).add_scalar(half)),
                nearby,
            );
            // Rounding of what is written is no lack.
            let rounding = 4.8e-7 * from.amax().max(to.amax());
            let missing = |from: &DVec3| (half - rounding - nearest(from, &to, half, nearby)) / half;
            if !is_away {
                let start = nearest(&from, &from, half, nearby);
                is_away = start >= half * (1.0 - MISSING) - rounding;
                if k == 0 {
                    reached.near_roots += u64::from(!is_away);
                }
            }
            let missing = if is_away { missing(&from) } else { continue };
            if missing > MISSING {
                reached.too_near += 1;
                reached.missing_width = reached.missing_width.max(missing);
            }
        }
    }
}

/// Distance of a segment from what is near it, at most `most`.
fn nearest(from: &DVec3, to: &DVec3, most: f64, nearby: &Nearby<'_>) -> f64 {
    let mut least = most;
    for (block, lanes) in nearby.iter() {
        for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
            least = least.min(distance(from, to, &corners(block, lane)));
        }
    }
    least
}
