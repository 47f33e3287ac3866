//! A surface that has been verified: closed, consistently oriented, not self-intersecting.

use numerics::vector::{DVec3, to_f64};

use super::edges::edges;
use super::grid::{GridPoint, SnapGrid};
use super::repair::{PolygonSurface, Polygons, RepairCounts, repaired_polygons};
use super::self_crossing::crossing;
use super::shells::{Shells, pieces, turned};
use super::surface_fault::SurfaceFault;
use numerics::tree::TriangleTree;

/// A closed surface around one or several bodies, repaired if that was requested.
#[derive(Clone, Debug)]
pub struct ClosedSurface {
    /// For each point, its index in the input, ascending.
    pub source_points: Vec<u32>,
    /// For each face, its index in the input, ascending.
    pub source_faces: Vec<u32>,
    /// First corner of each face, and the number of corners at the end.
    pub starts: Vec<u32>,
    /// Point of each corner, counter-clockwise seen from outside the bodies.
    pub corners: Vec<u32>,
    /// Positions, metres.
    pub points: Vec<[f32; 3]>,
    /// Repairs that were made.
    pub changes: RepairCounts,
    /// Number of bodies.
    pub bodies: usize,
    pub(super) grid: SnapGrid,
    pub(super) grid_points: Vec<GridPoint>,
    pub(super) shells: Shells,
    /// Shell of each point.
    pub(super) shell_of: Vec<u32>,
    pub(super) tree: TriangleTree,
}

impl ClosedSurface {
    /// Verifies a surface: closed, consistently oriented, without self-intersections. With `repair`, safe repairs are
    /// made first: duplicate points are merged where the surface is open or already connected, points without a face,
    /// faces with fewer than three points and duplicate faces are dropped, and faces are flipped to face away from
    /// the bodies. Closed shells within another one bound cavities, whatever their orientation, and shells within
    /// those are bodies again. A surface without faces, or with only degenerate ones, is closed around nothing.
    ///
    /// # Errors
    /// The first fault that cannot, or may not, be repaired.
    ///
    /// # Panics
    /// If a corner is out of range, or there are 2³² corners.
    pub fn of(surface: &PolygonSurface, repair: bool) -> Result<Self, SurfaceFault> {
        if let Some(point) = surface.points.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
            return Err(SurfaceFault::NotFinite { point: point as u32 });
        }
        let grid = SnapGrid::around(surface.points).unwrap_or_else(SnapGrid::unit);
        let grid_points: Vec<GridPoint> =
            surface.points.iter().map(|point| grid.grid_point(point.map(f64::from))).collect();
        let (polygons, mut changes) = repaired_polygons(surface, &grid_points, repair)?;
        let mut pieces = pieces(&polygons, repair)?;
        let mut shells = Shells::outward(&polygons, &mut pieces, surface.points, &grid_points)?;
        let wide: Vec<[f32; 3]> = grid_points.iter().map(|grid_point| grid_point.map(|x| x as f32)).collect();
        let tree = TriangleTree::build(&wide, &shells.triangles);
        if let Some((pair, count)) = crossing(&grid_points, &shells.triangles, &tree) {
            let [first, _] = pair.map(|triangle| shells.triangles[triangle as usize]);
            let face = |triangle: u32| polygons.faces[shells.polygons[triangle as usize] as usize];
            return Err(SurfaceFault::SelfIntersection {
                faces: pair.map(face),
                at: surface.points[first[0] as usize],
                count,
            });
        }
        shells.nest(&mut pieces, &grid_points);
        turned(&polygons, &pieces, &shells, repair, &mut changes)?;
        let (source_points, name) = kept(&polygons, grid_points.len());
        shells.triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = name[*corner as usize]);
        Ok(Self {
            points: source_points.iter().map(|point| surface.points[*point as usize]).collect(),
            grid_points: source_points.iter().map(|point| grid_points[*point as usize]).collect(),
            shell_of: shells.of_points(source_points.len()),
            source_points,
            corners: corners(&polygons, &pieces, &name),
            source_faces: polygons.faces,
            starts: polygons.starts,
            changes,
            bodies: shells.bodies,
            grid,
            shells,
            tree,
        })
    }

    /// Points of a face, in order.
    pub fn face(&self, face: usize) -> &[u32] {
        &self.corners[self.starts[face] as usize..self.starts[face + 1] as usize]
    }

    /// Each edge once, lower point first, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        edges(&self.starts, &self.corners)
    }

    /// Mean length of the edges, metres; 0 without edges.
    pub fn mean_edge(&self) -> f64 {
        let edges = self.edges();
        let length = |[a, b]: &[u32; 2]| (to_f64(self.points[*a as usize]) - to_f64(self.points[*b as usize])).norm();
        edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64
    }

    /// Longest side of a triangle, in grid steps.
    pub(super) fn longest_side(&self, triangle: u32) -> f64 {
        let corners = self.shells.triangles[triangle as usize].map(|corner| self.grid_points[corner as usize]);
        let square = |k: usize| {
            let [a, b] = [k, (k + 1) % 3].map(|k| DVec3::from(corners[k].map(f64::from)));
            (a - b).norm_squared()
        };
        square(0).max(square(1)).max(square(2)).sqrt()
    }

    /// Enclosed volume, m³.
    pub fn volume(&self) -> f64 {
        let Some(origin) = self.points.first().map(|point| to_f64(*point)) else { return 0.0 };
        let from_origin = |corner: u32| to_f64(self.points[corner as usize]) - origin;
        let six = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(from_origin);
            a.dot(&b.cross(&c))
        };
        self.shells.triangles.iter().map(six).sum::<f64>() / 6.0
    }
}

/// The points used by polygons, and their new indices.
fn kept(polygons: &Polygons, points: usize) -> (Vec<u32>, Vec<u32>) {
    let mut name = vec![u32::MAX; points];
    polygons.corners.iter().for_each(|corner| name[*corner as usize] = 0);
    let kept: Vec<u32> = (0..points as u32).filter(|point| name[*point as usize] == 0).collect();
    kept.iter().enumerate().for_each(|(new, old)| name[*old as usize] = new as u32);
    (kept, name)
}

/// Corners with new point indices, reversed for flipped polygons; the first corner stays first.
fn corners(polygons: &Polygons, pieces: &[(u32, bool)], name: &[u32]) -> Vec<u32> {
    let mut corners: Vec<u32> = polygons.corners.iter().map(|corner| name[*corner as usize]).collect();
    for (run, _) in polygons.starts.windows(2).zip(pieces).filter(|(_, (_, turned))| *turned) {
        corners[run[0] as usize + 1..run[1] as usize].reverse();
    }
    corners
}
