//! A mesh that moves within a frame.

use numerics::parallel;
use numerics::vector::{Vec3, add, cross, dot, length, lerp, scale, sub, unit};

use super::{MeshShape, ShapeSettings, ShapeTopology, SurfacePlace, for_corners};
use crate::rows::Cell;

/// Cells that the fastest point moves from one pose to the next, at most, unless there are [`MOST_POSES`].
const STRIDE: f32 = 2.0;

/// Intervals between poses in a frame: as many as make 64 cells, which a substep's liquid hardly moves either.
const MOST_POSES: usize = 32;

/// A mesh at one time of a frame.
#[derive(Clone, Debug)]
struct Pose {
    shape: MeshShape,
    /// The velocity of the closest place, cells a frame, for each cell of the band.
    velocity: Vec<Vec3>,
}

/// The signed distance and the velocity of a mesh whose points move linearly from where they are at the start of a frame
/// to where they are at its end. Times are shares of the frame, 0…1; velocities are in cells a frame.
///
/// The distance is computed at poses that are at most two cells of motion apart. Between them it is carried along with the
/// surface from the pose before and the pose after, and mixed: exact up to sampling where the mesh only translates.
/// Limit: distances within two cells of the band's width may be too large.
#[derive(Clone, Debug)]
pub struct MovingShape {
    settings: ShapeSettings,
    poses: Vec<Pose>,
    end: Vec<Vec3>,
    is_capped: bool,
    /// Cells that its surface moves along its normal in the frame, at most.
    sweep: f32,
}

impl MovingShape {
    /// A mesh that moves from `start` to `end` in a frame.
    ///
    /// # Panics
    /// Where `start` and `end` have different lengths, or fewer points than the topology was made of.
    pub fn new(topology: &ShapeTopology, start: &[Vec3], end: &[Vec3], settings: &ShapeSettings) -> Self {
        let first = MeshShape::new(topology, start, settings);
        Self::following(first, topology, start, end, settings)
    }

    /// The frame after this one, which ends at `end`; its first pose is the last of this one.
    ///
    /// # Panics
    /// Where `end` does not have as many points as before.
    #[must_use]
    pub fn next_frame(mut self, topology: &ShapeTopology, end: &[Vec3]) -> Self {
        let first = self.poses.pop().map_or_else(MeshShape::default, |pose| pose.shape);
        Self::following(first, topology, &self.end, end, &self.settings)
    }

    fn following(
        first: MeshShape,
        topology: &ShapeTopology,
        start: &[Vec3],
        end: &[Vec3],
        settings: &ShapeSettings,
    ) -> Self {
        assert_eq!(start.len(), end.len(), "a mesh keeps its points");
        let velocities: Vec<Vec3> = start.iter().zip(end).map(|(a, b)| sub(*b, *a)).collect();
        let farthest = velocities.iter().map(|v| length(*v)).filter(|way| way.is_finite()).fold(0.0, f32::max);
        let wanted = (farthest / STRIDE).ceil();
        let intervals = if wanted < MOST_POSES as f32 { wanted as usize } else { MOST_POSES };
        let later = (1..=intervals).map(|n| {
            let share = n as f32 / intervals as f32;
            let points: Vec<Vec3> = match n == intervals {
                true => end.to_vec(),
                false => start.iter().zip(end).map(|(a, b)| lerp(*a, *b, share)).collect(),
            };
            MeshShape::new(topology, &points, settings)
        });
        let corners = topology.corners();
        let pose = |shape: MeshShape| {
            let velocity =
                |place: &SurfacePlace| place.mean(&corners, &velocities).map(|v| if v.is_finite() { v } else { 0.0 });
            let places = shape.places();
            let velocity = parallel::tabulate(places.len(), parallel::CHUNK, |n| velocity(&places[n]));
            Pose { shape, velocity }
        };
        let poses = std::iter::once(first).chain(later).map(pose).collect();
        let sweep = if farthest > 0.0 { sweep(&corners, [start, end], &velocities) } else { 0.0 };
        Self { settings: *settings, poses, end: end.to_vec(), is_capped: wanted > MOST_POSES as f32, sweep }
    }

    /// Times of the frame at which the distance is computed: 1 where the mesh stands still.
    pub fn poses(&self) -> usize {
        self.poses.len()
    }

    /// Whether it moves farther in the frame than distances follow accurately: 64 cells.
    pub fn is_capped(&self) -> bool {
        self.is_capped
    }

    /// Cells that its surface moves along its normal in the frame, at most: 0 where it only slides along itself, or never comes
    /// within the band of the cells `low` ≤ cell < `high`.
    pub fn sweep_near(&self, [low, high]: [Cell; 2]) -> f32 {
        let is_near = |pose: &Pose| {
            let meets =
                |(first, end): (Cell, Cell)| (0..3).all(|axis| first[axis] < high[axis] && end[axis] > low[axis]);
            pose.shape.rows().bounds().is_some_and(meets)
        };
        if self.sweep > 0.0 && self.poses.iter().any(is_near) { self.sweep } else { 0.0 }
    }

    /// The shape at the start of the frame and at its end.
    pub fn ends(&self) -> [&MeshShape; 2] {
        [&self.poses[0].shape, &self.poses[self.poses.len() - 1].shape]
    }

    /// The distance from a place in cells, negative inside.
    pub fn distance(&self, share: f32, point: Vec3) -> f32 {
        let (before, after, mix) = self.around(share);
        let ahead = |(pose, after): (&Pose, f32)| pose.shape.at(pose.origin(point, after));
        let first = ahead(before);
        if mix > 0.0 { first + mix * (ahead(after) - first) } else { first }
    }

    /// The velocity of the closest place of the mesh, cells a frame; 0 far from it.
    pub fn velocity(&self, share: f32, point: Vec3) -> Vec3 {
        let (before, after, mix) = self.around(share);
        let carried = |(pose, after): (&Pose, f32)| pose.velocity(pose.origin(point, after));
        match (carried(before), carried(after)) {
            (Some(a), Some(b)) => lerp(a, b, mix),
            (a, b) => a.or(b).unwrap_or_default(),
        }
    }

    /// The poses before and after a time, each with the share of the frame since then, and how far between them it is.
    fn around(&self, share: f32) -> ((&Pose, f32), (&Pose, f32), f32) {
        let intervals = self.poses.len() - 1;
        let at = if share > 0.0 { share.min(1.0) * intervals as f32 } else { 0.0 };
        let (first, next) = (at as usize, (at as usize + 1).min(intervals));
        let since = |pose: usize| (at - pose as f32) / intervals.max(1) as f32;
        ((&self.poses[first], since(first)), (&self.poses[next], since(next)), at - first as f32)
    }
}

/// The most that a corner of a triangle moves along the triangle's normal, at the start or at the end. What is not finite does
/// not count.
fn sweep(triangles: &[[u32; 3]], poses: [&[Vec3]; 2], velocities: &[Vec3]) -> f32 {
    let along = |points: &[Vec3], corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let Some(normal) = unit(cross(sub(b, a), sub(c, a))) else { return 0.0 };
        let ways = corners.iter().map(|corner| dot(normal, velocities[*corner as usize]).abs());
        ways.filter(|way| way.is_finite()).fold(0.0, f32::max)
    };
    let most = |points: &[Vec3]| triangles.iter().fold(0.0, |most: f32, corners| most.max(along(points, corners)));
    let [start, end] = poses.map(most);
    start.max(end)
}

impl Pose {
    /// Where what is at `point` now was, or will be, at this pose, `since` which a share of the frame has passed.
    fn origin(&self, point: Vec3, since: f32) -> Vec3 {
        let mut origin = point;
        if since != 0.0 {
            for _ in 0..2 {
                origin = self.velocity(origin).map_or(origin, |v| add(point, scale(v, -since)));
            }
        }
        origin
    }

    /// The velocity at a point: the mean of the cells around it that are in the band, trilinear. `None` beyond the band.
    fn velocity(&self, point: Vec3) -> Option<Vec3> {
        let (cell, share) = self.shape.cube(point);
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for_corners(self.shape.band(), cell, share, |weight, at| {
            if let Some(at) = at {
                sum = add(sum, scale(self.velocity[at], weight));
                weights += weight;
            }
        });
        (weights > 0.0).then(|| scale(sum, 1.0 / weights))
    }
}
