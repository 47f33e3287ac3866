//! Directions into the skin are redirected out of it, continuously.
//!
//! First contact is not a continuous function of a segment's goal: a segment that lies flat on the skin stays there or
//! sweeps across it, depending on whether its goal is slightly below or above the skin, and wind straight into the skin
//! presses curves to one side or the other. No continuous map from all directions to those above the skin can leave the
//! latter unchanged and keep the side of all others; so the deeper a goal lies in the skin, the more upright the
//! segment is kept, nearly as its goal reflected by the skin; an arch lifts it a little more, off what lies beside it.

use numerics::vector::DVec3;
use std::f64::consts::FRAC_PI_2;

/// How upright a segment is kept by wind straight into the skin, relative to the direction of its curve, which earlier
/// segments have turned: the less upright, the more their changes add up towards the tip. Of 2, 5, 10 and
/// 100, with an arch of 0 to 2, this pair has the fewest jumps on a camel (studies/coherence_study).
const UPRIGHT: f64 = 10.0;

/// Height above the skin of the path from one side to the other, beyond that of a circle.
const ARCH: f64 = 1.5;

/// The skin under a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    /// Outward unit normal.
    pub(super) normal: DVec3,
    /// Height of the segment's pivot above it, metres, less what its end is to be kept off it.
    pub(super) height: f64,
}

impl Ground {
    /// The direction that replaces `goal` for a segment of this length whose curve runs along `along`: unchanged if the
    /// segment's end is above the ground, otherwise a direction above it. Continuous in all arguments; unit vectors.
    pub(super) fn lead_out(&self, along: &DVec3, goal: &DVec3, length: f64) -> DVec3 {
        let n = &self.normal;
        // The largest angle below the horizon that is allowed, and that of the goal.
        let lowest = libm::asin((self.height / length).clamp(0.0, 1.0));
        let low = -libm::asin(goal.dot(n).clamp(-1.0, 1.0));
        if low <= lowest {
            return *goal;
        }
        let share = (low - lowest) / (FRAC_PI_2 - lowest);
        let room = 1.0 - lowest / FRAC_PI_2;
        let edge = |towards: &DVec3| {
            let aside = (towards - n * towards.dot(n)).try_normalize(1e-9);
            aside.map(|aside| aside * libm::cos(lowest) - n * libm::sin(lowest))
        };
        let standing = self.left_standing(along, room);
        let Some(pressed) = edge(goal) else { return standing };
        let (sine, cosine) = libm::sincos(share * FRAC_PI_2);
        let mixed = pressed * cosine + standing * sine + n * (ARCH * share * (1.0 - share) * room);
        // If there is room below the pivot, the path between two directions above the ground may still dip into it.
        match mixed.try_normalize(1e-9) {
            Some(led) if led.dot(n) < -libm::sin(lowest) => edge(&led).unwrap_or(pressed),
            led => led.unwrap_or(pressed),
        }
    }

    /// The result for wind straight into the ground: as far down as there is room.
    fn left_standing(&self, along: &DVec3, room: f64) -> DVec3 {
        let n = &self.normal;
        let above = along + n * ((-along.dot(n)).max(0.0) + UPRIGHT);
        (above.try_normalize(1e-9).unwrap_or(*n) * room - n * (1.0 - room)).try_normalize(1e-9).unwrap_or(*along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::random::Key;

    fn random(key: Key) -> DVec3 {
        DVec3::from_fn(|axis, _| key.of(axis as u64).f64() * 2.0 - 1.0).normalize()
    }

    #[test]
    fn goals_above_the_ground_are_kept_and_others_redirected_above_it() {
        for i in 0..20_000 {
            let key = Key::new(3).of(i);
            let ground = Ground { normal: random(key.of(0)), height: 1.5 * key.of(9).f64() };
            let (along, goal) = (random(key.of(1)), random(key.of(2)));
            let led = ground.lead_out(&along, &goal, 1.0);
            let end = |at: &DVec3| ground.height + at.dot(&ground.normal);
            assert!((led.norm() - 1.0).abs() < 1e-12 && end(&led) > -1e-9, "{i}: {}", end(&led));
            assert!(end(&goal) < 0.0 || led == goal, "{i}");
        }
    }

    #[test]
    fn wind_straight_into_the_skin_leaves_curves_nearly_upright() {
        let ground = Ground { normal: DVec3::z(), height: 0.0 };
        for goal in [-DVec3::z(), DVec3::new(1e-12, 0.0, -1.0), DVec3::new(0.0, -1e-12, -1.0)] {
            let led = ground.lead_out(&DVec3::x(), &goal, 1.0);
            assert!((led - DVec3::new(1.0, 0.0, UPRIGHT).normalize()).norm() < 1e-9, "{led}");
        }
    }

    #[test]
    fn close_goals_give_close_directions() {
        for height in [0.0, 0.1, 0.3] {
            let mut most = 0.0_f64;
            for i in 0..20_000 {
                let key = Key::new(4).of(i);
                let ground = Ground { normal: DVec3::z(), height };
                let along = DVec3::new(1.0, 0.0, 0.3 * key.of(5).f64()).normalize();
                let goal = random(key.of(1));
                let near = (goal + random(key.of(2)) * 1e-4).normalize();
                let difference = ground.lead_out(&along, &goal, 1.0) - ground.lead_out(&along, &near, 1.0);
                most = most.max(difference.norm() / (goal - near).norm());
            }
            assert!(most < 4.0, "{height}: {most}");
        }
    }
}
