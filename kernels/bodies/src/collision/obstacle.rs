//! Obstacles: animated meshes, and the ground.

use super::CollisionError;
use super::body_skin::signed_volume;
use super::motion::{Motion, ObstaclePose};
use super::surface::{Moment, TriangleSurface};
use numerics::swept::SweptElements;
use numerics::tree::TriangleTree;
use numerics::vector::{DVec3, Vec3};

/// A mesh that moves through the frame as its poses prescribe, as rigidly as possible.
#[derive(Clone, Debug)]
pub struct Obstacle {
    pub(super) surface: TriangleSurface,
    pub(super) motion: Motion,
    /// Sharp edges, for swept boxes, and their indices.
    pub(super) edges: SweptElements<2>,
    pub(super) sharp_edges: Vec<u32>,
    /// Points where the surface is not flat.
    pub(super) sharp_points: Vec<u32>,
    /// Its triangles, for closest-point queries.
    pub(super) solid: TriangleTree,
    /// Length of the frame, seconds.
    pub(super) seconds: f64,
    /// Distance to keep from it, metres.
    pub(super) thickness: f64,
    /// Coulomb's friction coefficient μ.
    pub(super) friction: f64,
}

impl Obstacle {
    /// An obstacle of `triangles` over the points of each of `poses`, in a frame of `seconds`. With one pose it is at
    /// rest; times of poses must increase. `thickness` is the distance to keep, metres, `friction` Coulomb's μ.
    ///
    /// # Errors
    /// Without a pose, or if a triangle's index is out of range or a number is not finite or negative.
    pub fn new(
        triangles: &[[u32; 3]],
        poses: &[ObstaclePose],
        seconds: f64,
        thickness: f64,
        friction: f64,
    ) -> Result<Self, CollisionError> {
        let points = poses.first().ok_or(CollisionError::NoPose)?.positions.len();
        check_triangles(points, triangles)?;
        for (index, pose) in poses.iter().enumerate() {
            if pose.positions.len() != points {
                return Err(CollisionError::Points(index, pose.positions.len(), points));
            }
            if !pose.share.is_finite() || (index > 0 && pose.share <= poses[index - 1].share) {
                return Err(CollisionError::Share(index, pose.share));
            }
            check_points(&pose.positions)?;
        }
        for (what, value) in [("seconds", seconds), ("thickness", thickness), ("friction", friction)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(CollisionError::Number(what, value));
            }
        }
        let first = &poses[0].positions[..];
        let surface = TriangleSurface::new(first, triangles);
        let flat = |index: u32| poses.iter().all(|pose| is_flat(&surface, &Moment::of(&pose.positions), index));
        let sharp_edges: Vec<u32> = (0..surface.edges.len() as u32).filter(|index| !flat(*index)).collect();
        let mut sharp_points: Vec<u32> =
            sharp_edges.iter().flat_map(|index| surface.edges[*index as usize].ends).collect();
        sharp_points.sort_unstable();
        sharp_points.dedup();
        let ends = sharp_edges.iter().map(|index| surface.edges[*index as usize].ends).collect();
        Ok(Self {
            edges: SweptElements::new(ends, first),
            solid: TriangleTree::build(&narrow(first), &surface.triangles),
            motion: Motion::new(poses),
            surface,
            sharp_edges,
            sharp_points,
            seconds,
            thickness,
            friction,
        })
    }

    /// Positions of its points at a time in the frame, metres: exact at poses, between them by the best-fitting rigid
    /// motion and a linear remainder.
    pub fn at(&self, share: f64) -> Vec<[f64; 3]> {
        self.motion.at(share)
    }

    /// Whether it is closed with faces that point inwards at the start of the frame: it holds what is in it.
    pub(super) fn is_room(&self) -> bool {
        self.surface.closed && signed_volume(&self.surface.triangles, &self.at(0.0)) < 0.0
    }

    /// Its velocity at the point of a triangle with barycentric `weights`, m/s.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn velocity(&self, share: f64, triangle: u32, weights: [f64; 3]) -> [f64; 3] {
        self.velocity_of(share, &self.surface.triangles[triangle as usize], &weights).into()
    }

    pub(super) fn velocity_of(&self, share: f64, points: &[u32], weights: &[f64]) -> DVec3 {
        if self.seconds <= 0.0 {
            return DVec3::zeros();
        }
        let sides = points.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
        sides.map(|(point, weight)| self.motion.velocity_per_frame(share, *point) * *weight).sum::<DVec3>()
            / self.seconds
    }
}

/// The ground, a plane that takes precedence over obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Unit normal towards the free side.
    pub up: [f64; 3],
    /// Distance of the plane from the origin along `up`, metres.
    pub height: f64,
    /// Distance to keep, metres.
    pub thickness: f64,
    /// Coulomb's friction coefficient μ.
    pub friction: f64,
}

pub(super) fn narrow(pose: &[[f64; 3]]) -> Vec<Vec3> {
    pose.iter().map(|p| p.map(|x| x as f32)).collect()
}

pub(super) fn check_triangles(points: usize, triangles: &[[u32; 3]]) -> Result<(), CollisionError> {
    match triangles.iter().position(|corners| corners.iter().any(|corner| *corner as usize >= points)) {
        Some(index) => Err(CollisionError::Triangle(index, triangles[index], points)),
        None => Ok(()),
    }
}

pub(super) fn check_points(points: &[[f64; 3]]) -> Result<(), CollisionError> {
    match points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
        Some(index) => Err(CollisionError::Point(index)),
        None => Ok(()),
    }
}

/// Whether the two triangles at an edge are coplanar.
fn is_flat(surface: &TriangleSurface, at: &Moment<'_>, edge: u32) -> bool {
    /// 1 − cosine of the angle between them: 5e-5 radians, above the rounding of f32 meshes and below any intended
    /// angle.
    const BEND: f64 = 1e-9;
    match surface.edges[edge as usize].faces.map(|face| surface.normal(at, face)) {
        [Some(a), Some(b)] => a.dot(&b) > 1.0 - BEND,
        _ => false,
    }
}
