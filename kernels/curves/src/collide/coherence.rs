//! Directions into the skin are redirected out of it, continuously.
//!
//! First contact is not a continuous function of a segment's goal: a segment that lies flat on the skin stays there or
//! sweeps across it, depending on whether its goal is slightly below or above the skin, and wind straight into the skin
//! presses curves to one side or the other. No continuous map from all directions to those above the skin can leave the
//! latter unchanged and keep the side of all others; so the deeper a goal lies in the skin, the more upright the
//! segment is kept, nearly as its goal reflected by the skin; an arch lifts it a little more, off what lies beside it.
//! Room below a segment is shared with those after it: if each used all of it, curves would zigzag between the skin and the
//! height of a segment, and turn over where wind or skin change a little.

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
    /// The ground for the first segment of a goal whose CVs from its pivot on these are, metres: where the goal dips into the
    /// ground, a height that leaves room for the segments after it. Never more than before, the same for a last segment and
    /// where the goal does not dip, and continuous.
    ///
    /// By its share s of the deepest dip, and the room q that there is relative to it, a segment gets s (s + (1 − s) √q) of
    /// the height: less than its share s, so that curves stay farther off the skin than they need to. With its share alone
    /// twice as many curves jump on a sphere.
    #[inline(always)]
    pub(super) fn shared_with(self, goal: &[DVec3]) -> Self {
        let depth = |cv: &DVec3| (goal[0] - cv).dot(&self.normal);
        let deepest = goal[1..].iter().fold(0.0, |most: f64, cv| most.max(depth(cv)));
        if deepest <= self.height.max(0.0) {
            return self;
        }
        let height = self.height.max(0.0);
        let (own, room) = (depth(&goal[1]).max(0.0) / deepest, height / deepest);
        Self { height: height * own * (own + (1.0 - own) * room.sqrt()), ..self }
    }

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
        // Not 1 − lowest ÷ (π ÷ 2), which is a half at 45°: there a goal straight down is led nowhere, and one that passes it turns
        // over. This is so at 64°, where a segment hangs steeply and what turns over is small.
        let room = 1.0 - (lowest / FRAC_PI_2) * (lowest / FRAC_PI_2);
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

    /// A goal that sinks evenly by `depth` in so many segments, and a ground `height` below its first CV, normal z.
    fn shared(depth: f64, segments: u32, height: f64) -> f64 {
        let cv = |k: u32| DVec3::new(0.1, 0.0, -depth / f64::from(segments)) * f64::from(k);
        let goal: Vec<DVec3> = (0..=segments).map(cv).collect();
        Ground { normal: DVec3::z(), height }.shared_with(&goal).height
    }

    #[test]
    fn segments_share_the_room_below_them() {
        // By hand: a share of 2 in 8, and room for 2: 2 · 0.25 · (0.25 + 0.75 · 0.5).
        assert_eq!(shared(8.0, 4, 2.0), 0.3125);
        // Enough room, none, and a pivot below the height that is kept.
        assert_eq!([shared(8.0, 4, 8.0), shared(8.0, 4, 9.0), shared(8.0, 4, 0.0)], [8.0, 9.0, 0.0]);
        assert_eq!([shared(8.0, 4, -1e-4), shared(-8.0, 4, 0.5), shared(-8.0, 4, -1e-4)], [0.0, 0.5, -1e-4]);
        // Where there is just enough room, a segment gets what it needs.
        let just = shared(8.0, 4, 8.0 * (1.0 - 1e-9));
        assert!((just - 2.0).abs() < 1e-8, "{just}");
        for height in (0..100).map(|i| 0.02 * f64::from(i)) {
            let given = shared(2.0, 1, height);
            assert_eq!(given, height, "the last segment has all room");
            let given = shared(2.0, 3, height);
            assert!((0.0..=height).contains(&given), "{height}: {given}");
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
