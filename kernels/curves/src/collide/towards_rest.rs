//! Curves that no turn frees: back towards their rest shape.
//!
//! Segments turn one at a time, so an earlier one may carry a later one to where no direction of it is free. The whole
//! curve is then blended towards rest, all directions by the same share, up to the first pose without a crossing.

use super::Collide;
use super::crossing::first_crossing_in;
use super::hair::{Hair, part_way};
use super::perpendicular;
use numerics::vector::{DVec3, Vec3, to_f32, to_f64};

/// Steps from the collided pose to rest.
const STEPS: u32 = 8;

/// Halvings of the step before the first pose that is free.
const HALVINGS: u32 = 6;

impl Hair<'_> {
    /// Replaces the written curve, whose segments have the `directions` given, by the nearest pose towards rest that
    /// crosses nothing, to 1/512 of the way; leaves it if rest crosses something.
    pub(super) fn fall_back(&mut self, how: &Collide<'_>, directions: &[DVec3]) -> bool {
        let collided = self.out.to_vec();
        if !self.poses_freely(how, directions, 0.0) {
            self.out.copy_from_slice(&collided);
            return false;
        }
        let share = |step: u32| f64::from(STEPS - step) / f64::from(STEPS);
        let first = (1..STEPS).find(|step| self.poses_freely(how, directions, share(*step))).unwrap_or(STEPS);
        let (mut free, mut crossing) = (share(first), share(first - 1));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (free + crossing);
            if self.poses_freely(how, directions, middle) {
                free = middle;
            } else {
                crossing = middle;
            }
        }
        self.poses_freely(how, directions, free)
    }

    /// Writes the pose with this share of the turn from rest to `directions`; whether it crosses nothing.
    fn poses_freely(&mut self, how: &Collide<'_>, directions: &[DVec3], share: f64) -> bool {
        // Rest itself has the bits that were found free.
        if share == 0.0 && self.rest_has_lengths_of_goal() {
            for (out, cv) in self.out.iter_mut().zip(self.rest) {
                *out = to_f32(to_f64(*cv) + self.shift);
            }
        } else {
            self.pose(directions, share);
        }
        (0..directions.len()).all(|k| {
            let [from, to] = [self.out[k], self.out[k + 1]];
            from == to || first_crossing_in(how.obstacles, self.tested_start(how, k), to).is_none()
        })
    }

    fn pose(&mut self, directions: &[DVec3], share: f64) {
        let step = |curve: &[Vec3], k: usize| to_f64(curve[k + 1]) - to_f64(curve[k]);
        for (k, direction) in directions.iter().enumerate() {
            let rest = step(self.rest, k).try_normalize(0.0).unwrap_or(*direction);
            // A segment without a length has no direction.
            let along = if direction.norm_squared() > 0.0 {
                part_way(&rest, direction, &perpendicular(&rest, &DVec3::zeros()), share)
            } else {
                DVec3::zeros()
            };
            self.out[k + 1] = to_f32(to_f64(self.out[k]) + along * step(self.goal, k).norm());
        }
    }

    /// Where the tested part of a written segment starts.
    fn tested_start(&self, how: &Collide<'_>, k: usize) -> Vec3 {
        let [from, to] = [self.out[k], self.out[k + 1]].map(to_f64);
        let untested = self.untested(how, k);
        let along = (to - from).try_normalize(0.0).unwrap_or_default();
        if untested > 0.0 { to_f32(from + along * untested) } else { self.out[k] }
    }

    /// Whether the rest shape, displaced, has the goal's root and, up to rounding, its lengths.
    fn rest_has_lengths_of_goal(&self) -> bool {
        let largest = self.goal.iter().flatten().fold(0.0, |most: f32, x| most.max(x.abs()));
        let length = |curve: &[Vec3], k: usize| (to_f64(curve[k + 1]) - to_f64(curve[k])).norm();
        self.rest[0] == self.goal[0]
            && (1..self.goal.len()).all(|k| {
                let [rest, goal] = [length(self.rest, k - 1), length(self.goal, k - 1)];
                (rest - goal).abs() <= 2.4e-7 * (f64::from(largest) + goal)
            })
    }
}
