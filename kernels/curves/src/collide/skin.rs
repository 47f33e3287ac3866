//! The surface that curves grow on: its outward normal, and heights above it.

use super::coherence::Ground;
use super::crossing::corners;
use numerics::tree::{Closest, Cuboid, TriangleTree};
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};

/// A skin: tree, triangles and normals of its points.
#[derive(Clone, Copy)]
pub struct SkinSurface<'a> {
    /// Over `triangles`.
    pub tree: &'a TriangleTree,
    /// Points of each triangle, counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
    /// Outward normal of each point, of any length; see [`normals`].
    pub normals: &'a [Vec3],
}

/// Outward normals of the points of a mesh, each the mean of its triangles' normals weighted by their angles there, so
/// that it does not depend on how faces are triangulated; 0 where undefined.
pub fn normals(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::zeros(); points.len()];
    for corners in triangles {
        let at = corners.map(|corner| to_f64(points[corner as usize]));
        let normal = (at[1] - at[0]).cross(&(at[2] - at[0]));
        let Some(normal) = normal.try_normalize(0.0).filter(|normal| normal.iter().all(|x| x.is_finite())) else {
            continue;
        };
        for k in 0..3 {
            let (a, b) = (at[(k + 1) % 3] - at[k], at[(k + 2) % 3] - at[k]);
            sums[corners[k] as usize] += normal * libm::atan2(a.cross(&b).norm(), a.dot(&b));
        }
    }
    sums.iter().map(|sum| sum.try_normalize(0.0).map_or([0.0; 3], to_f32)).collect()
}

impl SkinSurface<'_> {
    /// The outward unit normal at a point of the surface; `None` if undefined.
    pub(super) fn normal(&self, at: &Closest) -> Option<DVec3> {
        let corners = self.triangles[at.triangle as usize];
        let mixed = (0..3)
            .fold(DVec3::zeros(), |sum, k| sum + to_f64(self.normals[corners[k] as usize]) * f64::from(at.weights[k]));
        mixed.try_normalize(1e-12)
    }

    /// The corners of the triangle of a point found.
    #[inline(always)]
    pub(super) fn corners(&self, at: &Closest) -> Option<[DVec3; 3]> {
        // The point lies on its triangle up to rounding.
        let slack = 4e-6 * (vector::largest(at.point) + at.distance);
        let [low, high] = [-slack, slack].map(|slack| at.point.map(|x| x + slack));
        let mut walk = self.tree.walk(Cuboid { low, high });
        walk.find_map(|(block, _)| {
            let block = &self.tree.blocks()[block];
            let lane = block.triangle.iter().position(|triangle| *triangle == at.triangle)?;
            Some(corners(block, lane))
        })
    }

    /// The corners of the triangle nearest to a point, and the direction out of the surface there: that triangle's normal
    /// if it lies along the interpolated one by a cosine above `same_side`, else the interpolated one.
    #[inline(always)]
    pub(super) fn facet(&self, p: &DVec3, same_side: f64) -> Option<(DVec3, [DVec3; 3])> {
        let at = self.tree.closest(to_f32(*p), f32::INFINITY)?;
        let corners = self.corners(&at)?;
        let flat = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).try_normalize(0.0);
        let flat = flat.filter(|normal| normal.iter().all(|x| x.is_finite()));
        let up = match (flat, self.normal(&at)) {
            (Some(flat), Some(smooth)) if flat.dot(&smooth) > same_side => flat,
            (flat, smooth) => smooth.or(flat)?,
        };
        Some((up, corners))
    }

    /// Height of a point above the surface, negative inside, and the normal there.
    #[inline(always)]
    pub(super) fn height(&self, p: &DVec3, reach: f32) -> Option<(f64, DVec3)> {
        let closest = self.tree.closest([p.x as f32, p.y as f32, p.z as f32], reach)?;
        let normal = self.normal(&closest)?;
        let away = p - to_f64(closest.point);
        // Near an edge the interpolated normal is not parallel to the offset: it only decides the sign.
        let height = away.norm().copysign(away.dot(&normal));
        Some((height, normal))
    }

    /// The skin below a segment at `pivot`, if within its reach.
    #[inline(always)]
    pub(super) fn ground(&self, pivot: &DVec3, length: f64) -> Option<Ground> {
        let (height, normal) = self.height(pivot, length as f32)?;
        Some(Ground { normal, height: height.max(0.0) })
    }

    /// A CV's goal, raised to `scale` times the CV's height above the skin at rest; unchanged if it is that high
    /// already.
    #[inline(always)]
    pub(super) fn raised(&self, rest: Vec3, goal: &DVec3, scale: f64) -> DVec3 {
        let rest = to_f64(rest);
        let Some((height, _)) = self.height(&rest, f32::INFINITY) else { return *goal };
        // It cannot have come closer by more than its displacement.
        let moved = (goal - rest).norm();
        if height - moved >= scale * height {
            return *goal;
        }
        match self.height(goal, 2.0 * ((moved + height.abs()) as f32)) {
            Some((now, normal)) if now < scale * height => goal + normal * (scale * height - now),
            _ => *goal,
        }
    }
}
