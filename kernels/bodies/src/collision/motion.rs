//! Motion of an obstacle between given poses: the best-fitting rigid motion, plus linear interpolation of the
//! remainder in the rotating frame.
//!
//! The centroid moves linearly, and the mesh rotates about it at a constant rate by the least-squares rotation (Horn
//! 1987). Poses are met exactly, and a mesh that moves rigidly keeps its shape. Limits: the rotation between two
//! poses is less than half a turn; a centroid on an arc takes the chord.

use numerics::rotation::best_rotation;
use numerics::vector::{DMat3, DVec3};

/// Positions at one time in the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ObstaclePose {
    /// Time, from 0 at the start of the frame to 1 at its end.
    pub share: f64,
    /// Positions of all points, metres.
    pub positions: Vec<[f64; 3]>,
}

/// Poses and the motions between them.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    poses: Vec<ObstaclePose>,
    intervals: Vec<PoseInterval>,
}

#[derive(Clone, Debug)]
struct PoseInterval {
    middles: [DVec3; 2],
    axis: DVec3,
    /// Rotation angle, radians.
    angle: f64,
    /// Distance of the farthest point from the axis, metres.
    radius: f64,
}

impl Motion {
    /// From poses at increasing times, all with the same number of finite points.
    pub(super) fn new(poses: &[ObstaclePose]) -> Self {
        let intervals =
            poses.windows(2).map(|pair| PoseInterval::between(&pair[0].positions, &pair[1].positions)).collect();
        Self { poses: poses.to_vec(), intervals }
    }

    /// The interval that contains the time `share` (the earlier of two), and the fraction of it that has passed.
    fn interval(&self, share: f64) -> Option<(usize, f64)> {
        let last = self.intervals.len().checked_sub(1)?;
        let index = self.poses[1..].iter().position(|pose| share <= pose.share).unwrap_or(last);
        let (from, to) = (self.poses[index].share, self.poses[index + 1].share);
        Some((index, ((share - from) / (to - from)).clamp(0.0, 1.0)))
    }

    /// Positions of all points.
    pub(super) fn at(&self, share: f64) -> Vec<[f64; 3]> {
        match self.interval(share) {
            None => self.poses[0].positions.clone(),
            Some((index, 0.0)) => self.poses[index].positions.clone(),
            Some((index, 1.0)) => self.poses[index + 1].positions.clone(),
            Some((index, along)) => {
                let interval = &self.intervals[index];
                if interval.angle == 0.0 {
                    let ends = self.poses[index].positions.iter().zip(&self.poses[index + 1].positions);
                    return ends.map(|(a, b)| DVec3::from(*a).lerp(&DVec3::from(*b), along).into()).collect();
                }
                let middle = interval.middles[0].lerp(&interval.middles[1], along);
                let (turn, back) = (interval.rotation(along), interval.rotation(1.0).transpose());
                let point =
                    |(a, b): (&[f64; 3], &[f64; 3])| (middle + turn * interval.offset(&back, a, b, along)).into();
                self.poses[index].positions.iter().zip(&self.poses[index + 1].positions).map(point).collect()
            }
        }
    }

    /// Velocity of a point, metres a frame; 0 before the first pose and after the last.
    pub(super) fn velocity_per_frame(&self, share: f64, point: u32) -> DVec3 {
        let (first, last) = (self.poses[0].share, self.poses[self.poses.len() - 1].share);
        let Some((index, along)) = self.interval(share).filter(|_| first <= share && share <= last) else {
            return DVec3::zeros();
        };
        let interval = &self.intervals[index];
        let [from, to] = [index, index + 1].map(|pose| &self.poses[pose].positions[point as usize]);
        let back = interval.rotation(1.0).transpose();
        let turn = interval.rotation(along);
        let left = back * (DVec3::from(*to) - interval.middles[1]) - (DVec3::from(*from) - interval.middles[0]);
        let spun = interval.axis.cross(&(turn * interval.offset(&back, from, to, along))) * interval.angle;
        let displacement = interval.middles[1] - interval.middles[0] + spun + turn * left;
        displacement / (self.poses[index + 1].share - self.poses[index].share)
    }

    /// The angle by which it turns between two `times`, radians.
    pub(super) fn turn(&self, times: [f64; 2]) -> f64 {
        let of = |(interval, pair): (&PoseInterval, &[ObstaclePose])| {
            let shared = pair[1].share.min(times[1]) - pair[0].share.max(times[0]);
            interval.angle * shared.max(0.0) / (pair[1].share - pair[0].share)
        };
        self.intervals.iter().zip(self.poses.windows(2)).map(of).sum()
    }

    /// Times from the first to the second of `times`, close enough that between them no point deviates from a
    /// straight line by more than `allowed`.
    pub(super) fn times(&self, times: [f64; 2], allowed: f64) -> Vec<f64> {
        /// Largest number of pieces of an interval.
        const MOST: f64 = 16.0;
        let mut out = vec![times[0]];
        for (interval, pair) in self.intervals.iter().zip(self.poses.windows(2)) {
            let (from, to) = (pair[0].share.max(times[0]), pair[1].share.min(times[1]));
            if to > from {
                let angle = interval.angle * (to - from) / (pair[1].share - pair[0].share);
                let sag = interval.radius * angle * angle / 8.0;
                let pieces = if sag > 0.0 { (sag / allowed).sqrt().ceil().clamp(1.0, MOST) } else { 1.0 };
                out.extend((1..=pieces as u32).map(|piece| from + (to - from) * (f64::from(piece) / pieces)));
            }
        }
        out.retain(|time| *time < times[1]);
        out.push(times[1]);
        out.dedup();
        if out.len() == 1 {
            out.push(times[1]);
        }
        out
    }
}

impl PoseInterval {
    fn between(from: &[[f64; 3]], to: &[[f64; 3]]) -> Self {
        let mean =
            |points: &[[f64; 3]]| points.iter().map(|p| DVec3::from(*p)).sum::<DVec3>() / (points.len().max(1) as f64);
        let middles = [mean(from), mean(to)];
        let mut spread = DMat3::zeros();
        for (a, b) in from.iter().zip(to) {
            spread += (DVec3::from(*a) - middles[0]) * (DVec3::from(*b) - middles[1]).transpose();
        }
        let [w, x, y, z] = best_rotation(&spread);
        let (axis, length) = (DVec3::new(x, y, z), DVec3::new(x, y, z).norm());
        let angle = 2.0 * libm::atan2(length, w.abs());
        if angle <= 1e-15 {
            return Self { middles, axis: DVec3::z(), angle: 0.0, radius: 0.0 };
        }
        let axis = axis * (w.signum() / length);
        let radius = from.iter().map(|a| axis.cross(&(DVec3::from(*a) - middles[0])).norm()).fold(0.0, f64::max);
        Self { middles, axis, angle, radius }
    }

    /// Rotation after the fraction `along` of the interval (Rodrigues).
    fn rotation(&self, along: f64) -> DMat3 {
        let (sine, cosine) = libm::sincos(self.angle * along);
        let cross = self.axis.cross_matrix();
        DMat3::identity() + cross * sine + cross * cross * (1.0 - cosine)
    }

    /// Offset of a point from the centroid, before rotation.
    fn offset(&self, back: &DMat3, from: &[f64; 3], to: &[f64; 3], along: f64) -> DVec3 {
        (DVec3::from(*from) - self.middles[0]).lerp(&(back * (DVec3::from(*to) - self.middles[1])), along)
    }
}
