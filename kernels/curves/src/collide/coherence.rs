//! Directions that lie in the skin, led out of it continuously.
//!
//! First contact is not continuous in where the wind wants a segment: what lies flat on the skin either stays where it is
//! or passes on over it, as its goal is a little below the skin or above, and wind that blows straight into the skin
//! presses curves now to one side, now to the other. No map of all directions onto those above the skin that leaves
//! these as they are is continuous and also keeps the side; so the deeper a goal lies in the skin, the more upright a
//! segment is left.

use numerics::vector::DVec3;
use std::f64::consts::FRAC_PI_2;

/// How far upright rather than along the curve wind leaves those that it blows straight into the skin: found to halve
/// the jumps that are left, on fur.
const UPRIGHT: f64 = 1.0;

/// How high over the skin the way leads from the one side to the other.
const ARCH: f64 = 2.0;

/// The skin under a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    /// Outward, unit.
    pub(super) normal: DVec3,
    /// Of the segment's pivot over it.
    pub(super) height: f64,
}

impl Ground {
    /// Where a segment of that length, whose curve leads along `along`, is to point instead of at `goal`: the same where
    /// its end is above the ground, else above it. Continuous in all of them; unit vectors.
    pub(super) fn lead_out(&self, along: &DVec3, goal: &DVec3, length: f64) -> DVec3 {
        let n = &self.normal;
        // The lowest that it may point, and how low it does.
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
        let mixed = pressed * (1.0 - share) + standing * share + n * (ARCH * share * (1.0 - share) * room);
        // Where there is room below, the way between two directions that are above the ground may dip into it.
        match mixed.try_normalize(1e-9) {
            Some(led) if led.dot(n) < -libm::sin(lowest) => edge(&led).unwrap_or(pressed),
            led => led.unwrap_or(pressed),
        }
    }

    /// Where it points with the wind straight into the ground: down as far as there is room.
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
    fn goals_above_the_ground_are_kept_and_others_led_above_it() {
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
    fn wind_straight_into_the_skin_leaves_curves_half_upright() {
        let ground = Ground { normal: DVec3::z(), height: 0.0 };
        for goal in [-DVec3::z(), DVec3::new(1e-12, 0.0, -1.0), DVec3::new(0.0, -1e-12, -1.0)] {
            let led = ground.lead_out(&DVec3::x(), &goal, 1.0);
            assert!((led - DVec3::new(1.0, 0.0, 1.0).normalize()).norm() < 1e-9, "{led}");
        }
    }

    #[test]
    fn goals_that_lie_close_are_led_to_directions_that_lie_close() {
        for height in [0.0, 0.1, 0.3] {
            let mut most = 0.0_f64;
            for i in 0..20_000 {
                let key = Key::new(4).of(i);
                let ground = Ground { normal: DVec3::z(), height };
                let along = DVec3::new(1.0, 0.0, 0.3 * key.of(5).f64()).normalize();
                let goal = random(key.of(1));
                let near = (goal + random(key.of(2)) * 1e-4).normalize();
                let way = ground.lead_out(&along, &goal, 1.0) - ground.lead_out(&along, &near, 1.0);
                most = most.max(way.norm() / (goal - near).norm());
            }
            assert!(most < 4.0, "{height}: {most}");
        }
    }
}
