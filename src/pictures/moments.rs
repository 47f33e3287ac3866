//! The frames of a contact sheet: those between which the outputs move most evenly.
//!
//! Guarantees: the first and the last frame are always among them; at most [`MOST`] frames are held, however many are
//! cooked; the choice depends only on the geometry. Limit: motion is that of up to `SAMPLES` points of an output; where
//! nothing moves, frames are evenly spaced.

use std::collections::BTreeMap;
use std::sync::Arc;

use engine::geometry::Geometry;
use engine::time::Frame;

/// What an output is at a frame, by the output's position in the graph.
pub(super) type Shot = BTreeMap<usize, Arc<Geometry>>;

/// Frames held while cooking: a choice among twice as many as are drawn.
const MOST: usize = 12;
/// Points of an output whose motion is measured.
const SAMPLES: usize = 1024;
/// Motion that a change of topology counts as, relative to the extent of the points.
const NEW_TOPOLOGY: f64 = 0.1;

/// Collects frames and keeps those that show most.
#[derive(Default)]
pub(super) struct Moments {
    shots: BTreeMap<Frame, Shot>,
    /// Motion up to each kept frame since the first one, metres summed over the outputs.
    moved: BTreeMap<Frame, f64>,
    total: f64,
    poses: BTreeMap<usize, Pose>,
}

/// Some points of an output, by which its motion is measured.
struct Pose {
    counts: Vec<usize>,
    points: Vec<[f32; 3]>,
}

impl Moments {
    /// Adds a frame, later than those before. The motion of the outputs that are subjects counts; others are only kept.
    pub(super) fn add(&mut self, frame: Frame, shot: Shot, is_subject: impl Fn(usize) -> bool) {
        for (output, geometry) in shot.iter().filter(|(output, _)| is_subject(**output)) {
            let pose = Pose::of(geometry);
            if let Some(before) = self.poses.get(output) {
                self.total += before.distance(&pose);
            }
            self.poses.insert(*output, pose);
        }
        self.shots.insert(frame, shot);
        self.moved.insert(frame, self.total);
        self.thin_out(MOST);
    }

    /// The frames to draw, at most `count`.
    pub(super) fn chosen(mut self, count: usize) -> BTreeMap<Frame, Shot> {
        self.thin_out(count);
        self.shots
    }

    /// Drops the frame between whose neighbours least happens until `count` are left.
    fn thin_out(&mut self, count: usize) {
        while self.moved.len() > count.max(2) {
            let kept: Vec<(Frame, f64)> = self.moved.iter().map(|(frame, moved)| (*frame, *moved)).collect();
            let gap = |around: &&[(Frame, f64)]| (around[2].1 - around[0].1, around[2].0.ticks() - around[0].0.ticks());
            let least = kept.windows(3).min_by(|a, b| {
                let (a, b) = (gap(a), gap(b));
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
            });
            let Some(least) = least.map(|around| around[1].0) else { return };
            self.moved.remove(&least);
            self.shots.remove(&least);
        }
    }
}

impl Pose {
    fn of(geometry: &Geometry) -> Self {
        let counts: Vec<usize> = geometry.parts().map(engine::geometry::Component::point_count).collect();
        let step = counts.iter().sum::<usize>().div_ceil(SAMPLES).max(1);
        let points = geometry.parts().flat_map(|part| part.positions().iter().step_by(step).copied());
        let liquid = geometry.volume().map(|volume| volume.level_set().nodes().filter(|(_, phi)| *phi < 0.0).count());
        Self { points: points.collect(), counts: counts.into_iter().chain(liquid).collect() }
    }

    /// Mean distance between the points of two poses, metres.
    fn distance(&self, other: &Self) -> f64 {
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        if self.counts != other.counts || self.points.len() != other.points.len() {
            return NEW_TOPOLOGY * self.extent().max(other.extent());
        }
        let pairs = self.points.iter().zip(&other.points);
        let sum: f64 = pairs.map(|(a, b)| finite(apart(*a, *b))).sum();
        sum / self.points.len().max(1) as f64
    }

    /// Diagonal of the bounds.
    fn extent(&self) -> f64 {
        let points = || self.points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
        let Some(first) = points().next() else { return 0.0 };
        let bound =
            |choose: fn(f32, f32) -> f32| points().fold(*first, |most, p| [0, 1, 2].map(|k| choose(most[k], p[k])));
        apart(bound(f32::min), bound(f32::max))
    }
}

fn apart(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])) * (f64::from(a[k]) - f64::from(b[k]))).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::Component;

    fn chosen(frames: i64, x: impl Fn(i64) -> f32) -> Vec<f64> {
        let mut moments = Moments::default();
        for frame in 1..=frames {
            let points = Component::points(vec![[x(frame), 0.0, 0.0], [x(frame), 1.0, 0.0]]);
            moments.add(Frame::whole(frame), Shot::from([(0, Arc::new(points.into()))]), |_| true);
            assert!(moments.shots.len() <= MOST);
        }
        moments.chosen(6).keys().map(|frame| frame.number()).collect()
    }

    #[test]
    fn frames_are_where_something_moves_and_the_first_and_last_are_among_them() {
        // Still, then 12 frames of motion, then still.
        let frames = chosen(100, |frame| (frame.clamp(40, 52) - 40) as f32);
        assert_eq!((frames[0], frames[5]), (1.0, 100.0));
        let moving = frames.iter().filter(|frame| (40.0..=53.0).contains(*frame)).count();
        assert!(moving >= 4, "{frames:?}");
    }

    #[test]
    fn even_motion_and_none_give_evenly_spaced_frames() {
        for speed in [0.0, 0.5] {
            let frames = chosen(61, |frame| frame as f32 * speed);
            let longest = frames.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
            assert!(frames.len() == 6 && frames[0] == 1.0 && frames[5] == 61.0 && longest <= 24.0, "{frames:?}");
        }
        assert_eq!(chosen(3, |frame| frame as f32), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_change_of_topology_is_motion_and_nan_is_not() {
        let pose = |points: Vec<[f32; 3]>| Pose::of(&Component::points(points).into());
        let two = pose(vec![[0.0; 3], [0.0, 2.0, 0.0]]);
        assert_eq!(two.distance(&pose(vec![[0.0; 3]])), 0.2);
        assert_eq!(two.distance(&pose(vec![[3.0, 0.0, 0.0], [f32::NAN; 3]])), 1.5);
    }
}
