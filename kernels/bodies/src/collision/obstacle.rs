//! What bodies touch that they do not move: animated meshes, and the ground.

use super::CollisionError;
use super::motion::{Motion, ObstaclePose};
use super::surface::{Moment, NONE, TriangleSurface};
use super::swept::Elements;
use numerics::tree::TriangleTree;
use numerics::vector::{DVec3, Vec3};

/// A mesh that moves through the frame as its poses say, as rigidly as they allow.
#[derive(Clone, Debug)]
pub struct Obstacle {
    pub(super) surface: TriangleSurface,
    pub(super) motion: Motion,
    /// Boxes of triangles, of sharp edges, and which edges those are.
    pub(super) faces: Elements<3>,
    pub(super) edges: Elements<2>,
    pub(super) sharp_edges: Vec<u32>,
    /// Points that a surface does not pass flat through.
    pub(super) sharp_points: Vec<u32>,
    /// Its triangles themselves, to look for the nearest.
    pub(super) solid: TriangleTree,
    /// Of the frame, seconds.
    seconds: f64,
    /// Distance kept from it, metres.
    pub(super) thickness: f64,
    /// Coulomb's μ.
    pub(super) friction: f64,
}

impl Obstacle {
    /// Of `triangles` of the points that each of `poses` has, in a frame of `seconds`. One pose stands still; shares of
    /// the frame rise. It keeps bodies `thickness` metres away and rubs with `friction`.
    ///
    /// # Errors
    /// Where there is no pose, a triangle names no point, or a number is not finite or below 0.
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
                return Err(CollisionError::Points { index, count: pose.positions.len(), expected: points });
            }
            if !pose.share.is_finite() || (index > 0 && pose.share <= poses[index - 1].share) {
                return Err(CollisionError::Share { index, share: pose.share });
            }
            check_points(&pose.positions)?;
        }
        for (what, value) in [("seconds", seconds), ("thickness", thickness), ("friction", friction)] {
            check_number(what, value)?;
        }
        let surface = TriangleSurface::new(points, triangles);
        let first = &poses[0].positions[..];
        let flat = |index: u32| poses.iter().all(|pose| is_flat(&surface, &Moment::of(&pose.positions), index));
        let sharp_edges: Vec<u32> = (0..surface.edges.len() as u32).filter(|index| !flat(*index)).collect();
        let mut sharp_points: Vec<u32> =
            sharp_edges.iter().flat_map(|index| surface.edges[*index as usize].ends).collect();
        sharp_points.sort_unstable();
        sharp_points.dedup();
        let ends = sharp_edges.iter().map(|index| surface.edges[*index as usize].ends).collect();
        Ok(Self {
            faces: Elements::new(surface.triangles.clone(), first),
            edges: Elements::new(ends, first),
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

    /// Whether it has an inside: every edge has two triangles that agree on what is out.
    pub fn is_closed(&self) -> bool {
        self.surface.closed
    }

    /// Where its points are at a share of the frame, metres: poses to the bit, between them as the rigid body that fits
    /// best and what is left straight on.
    pub fn at(&self, share: f64) -> Vec<[f64; 3]> {
        self.motion.at(share)
    }

    /// How fast it is where a triangle's corners have `weights`, m/s.
    ///
    /// # Panics
    /// Where there is no such triangle.
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

/// A plane that wins over all obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Unit, to its free side.
    pub up: [f64; 3],
    /// Of the plane along `up`, metres.
    pub height: f64,
    /// Distance kept, metres.
    pub thickness: f64,
    /// Coulomb's μ.
    pub friction: f64,
}

pub(super) fn narrow(pose: &[[f64; 3]]) -> Vec<Vec3> {
    pose.iter().map(|p| p.map(|x| x as f32)).collect()
}

pub(super) fn check_triangles(points: usize, triangles: &[[u32; 3]]) -> Result<(), CollisionError> {
    match triangles.iter().position(|corners| corners.iter().any(|corner| *corner as usize >= points)) {
        Some(index) => Err(CollisionError::Triangle { index, corners: triangles[index], count: points }),
        None => Ok(()),
    }
}

pub(super) fn check_points(points: &[[f64; 3]]) -> Result<(), CollisionError> {
    match points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
        Some(index) => Err(CollisionError::Point(index)),
        None => Ok(()),
    }
}

pub(super) fn check_number(what: &'static str, value: f64) -> Result<(), CollisionError> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(CollisionError::Number { what, value }) }
}

/// Whether the two triangles of an edge are one plane.
fn is_flat(surface: &TriangleSurface, at: &Moment<'_>, edge: u32) -> bool {
    /// 1 − cosine of the bend: 5e-5 of a radian, above the rounding of f32 meshes, below any bend that is meant.
    const BEND: f64 = 1e-9;
    let faces = surface.edges[edge as usize].faces;
    if faces.contains(&NONE) {
        return false;
    }
    match faces.map(|face| surface.normal(at, face)) {
        [Some(a), Some(b)] => a.dot(&b) > 1.0 - BEND,
        _ => false,
    }
}
