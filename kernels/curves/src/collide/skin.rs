//! The surface that curves grow on: its outward normal, and heights above it.

use super::coherence::Ground;
use super::crossing::corners;
use super::perpendicular;
use numerics::tree::{Closest, Cuboid, TriangleTree};
use numerics::vector::{self, DVec3, Vec3, to_f32, to_f64};
use std::sync::Arc;

/// Largest number of turns that raise a segment.
const TURNS: usize = 3;

/// Share of the height wanted by which a raised CV may miss it.
const HEIGHT_ERROR: f64 = 1e-3;

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

/// What a [`SkinSurface`] borrows: made once for a skin that is still, whichever node asks for it.
#[derive(Clone, Debug)]
pub struct SkinMesh {
    tree: Arc<TriangleTree>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
}

impl SkinMesh {
    /// The skin of `triangles`, each three indices of `points` (metres), counter-clockwise from outside; `tree` is over them.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn new(tree: Arc<TriangleTree>, points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        Self { tree, triangles: triangles.to_vec(), normals: normals(points, triangles) }
    }

    /// The tree of its triangles.
    pub fn tree(&self) -> &Arc<TriangleTree> {
        &self.tree
    }

    /// The form that kernels take.
    pub fn surface(&self) -> SkinSurface<'_> {
        SkinSurface { tree: &self.tree, triangles: &self.triangles, normals: &self.normals }
    }
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

    /// The skin below a segment at `pivot`, if within `reach`, metres.
    #[inline(always)]
    pub(super) fn ground(&self, pivot: &DVec3, reach: f64) -> Option<Ground> {
        let (height, normal) = self.height(pivot, reach as f32)?;
        Some(Ground { normal, height: height.max(0.0) })
    }

    /// The step from a goal CV at `before` to the next one, turned so that its end is at `share` times the next CV's height
    /// above the skin at rest; `None` if it is that high already.
    ///
    /// Turning changes the height by about the change of the step along the normal at its end: exact on a plane. Elsewhere
    /// that is repeated.
    #[inline(always)]
    pub(super) fn raised(&self, rest: Vec3, before: &DVec3, step: &DVec3, share: f64) -> Option<DVec3> {
        let rest = to_f64(rest);
        let (height, _) = self.height(&rest, f32::INFINITY)?;
        let (wanted, length) = (share * height, step.norm());
        // It cannot have come closer by more than its displacement.
        let moved = (before + step - rest).norm();
        if height - moved >= wanted {
            return None;
        }
        let reach = 2.0 * (moved + height.abs() + length) as f32;
        let mut along = step.try_normalize(0.0)?;
        for turn in 0..TURNS {
            let Some((now, normal)) = self.height(&(before + along * length), reach) else { break };
            if turn == 0 && now >= wanted {
                return None;
            }
            if (now - wanted).abs() < HEIGHT_ERROR * wanted.abs() {
                break;
            }
            let up = along.dot(&normal);
            let rise = (up + (wanted - now) / length).clamp(-1.0, 1.0);
            let level = (along - normal * up).try_normalize(1e-9);
            let level = level.unwrap_or_else(|| perpendicular(&normal, &(rest - before)));
            along = level * (1.0 - rise * rise).sqrt() + normal * rise;
        }
        Some(along * length)
    }
}
