//! Triangle meshes as signed distances: what liquid starts from, sources, sinks, and colliders that move ([`MovingShape`]).
//!
//! Lengths are in cells: cell [x, y, z] reaches from there to [x + 1, y + 1, z + 1], and distances are stored at middles.
//! Near the surface a distance is exact up to the rounding of f32; a cell is inside where the closed pieces of the mesh
//! wind around its middle at least once in the direction that encloses volume, so overlapping pieces are one solid, and a
//! piece turned the other way within another is a hole. Open pieces enclose nothing ([`ShapeTopology`]).
//!
//! Promise: no NaN, whatever the points; the bits are the same for any number of threads; time and memory follow the part
//! of the surface and of its inside that lie in the domain. Limit: what is thinner than a cell falls between the middles of
//! cells; [`ShapeSettings::thicken`] closes it.

mod lines;
mod moving;
mod nearest;
#[cfg(test)]
mod tests;
mod thicken;
mod topology;

pub use moving::MovingShape;
pub use topology::ShapeTopology;

use numerics::vector::Vec3;

use crate::level_set::PhiView;
use crate::rows::{Cell, CellRows};
use lines::RowLines;
use nearest::{Foot, feet};
use topology::Part;

/// Where the distance of a mesh is computed, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSettings {
    /// The first cell of the domain.
    pub low: Cell,
    /// The cell after the last of the domain.
    pub high: Cell,
    /// Largest distance that is known, > 0, in cells.
    pub band: f32,
    /// Whether solids thinner than a cell, and open pieces, are made as thick as a cell is along their normal, so that
    /// nothing leaks through their faces. For colliders.
    pub thicken: bool,
}

impl ShapeSettings {
    /// A band of 5 cells in this domain; open pieces are left out and thin solids stay as they are.
    pub fn new(low: Cell, high: Cell) -> Self {
        Self { low, high, band: 5.0, thicken: false }
    }

    /// The cells, beyond the one that a surface is in, whose middle may be in the band.
    fn reach(&self) -> i32 {
        (self.band + 0.5).floor() as i32
    }
}

/// A place on a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePlace {
    /// Number of the triangle.
    pub triangle: u32,
    /// Weights of its corners: ≥ 0, with sum 1.
    pub weights: [f32; 3],
}

impl SurfacePlace {
    /// What values at the points of a mesh with these triangles are here.
    ///
    /// # Panics
    /// Where the triangle or a corner is out of range.
    pub fn mean<const N: usize>(&self, triangles: &[[u32; 3]], values: &[[f32; N]]) -> [f32; N] {
        let [a, b, c] = triangles[self.triangle as usize].map(|corner| values[corner as usize]);
        std::array::from_fn(|n| self.weights[0] * a[n] + self.weights[1] * b[n] + self.weights[2] * c[n])
    }
}

/// The signed distance of a mesh that stands still, negative inside.
#[derive(Clone, Debug, Default)]
pub struct MeshShape {
    low: Cell,
    high: Cell,
    far: f32,
    rows: CellRows,
    distance: Vec<f32>,
    band: CellRows,
    places: Vec<SurfacePlace>,
}

impl MeshShape {
    /// The distance of the mesh with its points here. A triangle with a corner that is not finite is left out; rows of
    /// cells that this opens are outside.
    ///
    /// # Panics
    /// Where there are fewer points than the topology was made of.
    pub fn new(topology: &ShapeTopology, points: &[Vec3], settings: &ShapeSettings) -> Self {
        let solid = Piece::solid(topology, points, settings);
        let all = match settings.thicken {
            true => solid.united(Piece::sheet(&topology.sheet, points, settings), settings.band),
            false => solid,
        };
        let Piece { rows, distance, band, feet } = all;
        let places = feet.iter().map(|foot| SurfacePlace { triangle: foot.triangle, weights: foot.weights }).collect();
        Self { low: settings.low, high: settings.high, far: settings.band, rows, distance, band, places }
    }

    /// The cells inside and those in the band around the surface; others are outside.
    pub fn rows(&self) -> &CellRows {
        &self.rows
    }

    /// The distance at the middle of each cell of [`Self::rows`]; beyond the band it is minus the width of the band.
    pub fn distance(&self) -> &[f32] {
        &self.distance
    }

    /// The cells in the band around the surface.
    pub fn band(&self) -> &CellRows {
        &self.band
    }

    /// The closest place of the mesh for each cell of [`Self::band`].
    pub fn places(&self) -> &[SurfacePlace] {
        &self.places
    }

    /// The distance to read as a level set.
    pub fn view(&self) -> PhiView<'_> {
        PhiView { rows: &self.rows, phi: &self.distance, outside: self.far, low: self.low, high: self.high }
    }

    /// The distance at a point, trilinear between the middles of cells; beyond the domain as at its closest middle.
    pub fn at(&self, point: Vec3) -> f32 {
        let (cell, share) = self.cube(point);
        let mut sum = 0.0;
        for_corners(&self.rows, cell, share, |weight, at| sum += weight * at.map_or(self.far, |at| self.distance[at]));
        sum
    }

    /// The first of the eight cells around a point, and where the point is between their middles.
    fn cube(&self, point: Vec3) -> (Cell, Vec3) {
        let (mut cell, mut share) = ([0; 3], [0.0; 3]);
        for axis in 0..3 {
            let last = (self.high[axis] - 1).max(self.low[axis]);
            let at = (point[axis] - 0.5).clamp(self.low[axis] as f32, last as f32);
            cell[axis] = at.floor() as i32;
            share[axis] = at - cell[axis] as f32;
        }
        (cell, share)
    }
}

/// Calls `read` with the trilinear weight of each of eight cells that has one, and where its value is.
fn for_corners(rows: &CellRows, [x, y, z]: Cell, [u, v, w]: Vec3, mut read: impl FnMut(f32, Option<usize>)) {
    for (k, along_z) in [1.0 - w, w].into_iter().enumerate() {
        for (j, along_y) in [1.0 - v, v].into_iter().enumerate() {
            for (i, along_x) in [1.0 - u, u].into_iter().enumerate() {
                let weight = along_x * along_y * along_z;
                if weight > 0.0 {
                    read(weight, rows.find([x + i as i32, y + j as i32, z + k as i32]));
                }
            }
        }
    }
}

/// The distance of the solids of a mesh, or of its sheets.
#[derive(Default)]
struct Piece {
    rows: CellRows,
    distance: Vec<f32>,
    band: CellRows,
    feet: Vec<Foot>,
}

impl Piece {
    fn solid(topology: &ShapeTopology, points: &[Vec3], settings: &ShapeSettings) -> Self {
        let Some(lines) = lines_of(&topology.solid, points, settings) else { return Self::default() };
        let inside = lines.inside(topology.is_inside_out).clipped(settings.low, settings.high);
        let (band, feet) = band_of(&lines, &topology.solid, points, settings);
        let mut near: Vec<f32> = feet.iter().map(|foot| foot.distance).collect();
        band.for_each_shared(&inside, |at, _, len| near[at..at + len].iter_mut().for_each(|d| *d = -*d));
        if settings.thicken {
            near = thicken::solid(&band, &feet, &near, settings.band, |triangle| topology.normal(points, triangle));
        }
        let rows = band.union(&inside);
        let distance = rows.resampled(&band, &near, -settings.band);
        Self { rows, distance, band, feet }
    }

    fn sheet(part: &Part, points: &[Vec3], settings: &ShapeSettings) -> Self {
        let Some(lines) = lines_of(part, points, settings) else { return Self::default() };
        let (band, feet) = band_of(&lines, part, points, settings);
        let distance = thicken::sheet(&band, &feet, settings.band);
        Self { rows: band.clone(), distance, band, feet }
    }

    /// Both as one: the smaller distance of each cell.
    fn united(self, other: Self, far: f32) -> Self {
        if other.rows.is_empty() {
            return self;
        }
        let (rows, band) = (self.rows.union(&other.rows), self.band.union(&other.band));
        let on = |rows: &CellRows, piece: &Self| rows.resampled(&piece.rows, &piece.distance, far);
        let closer = |(a, b): (f32, f32)| if b < a { b } else { a };
        let distance = on(&rows, &self).into_iter().zip(on(&rows, &other)).map(closer).collect();
        let feet_on = |piece: &Self| band.resampled(&piece.band, &piece.feet, Foot::default());
        let (ours, theirs) = (feet_on(&self), feet_on(&other));
        let is_theirs: Vec<bool> = on(&band, &self).iter().zip(on(&band, &other)).map(|(a, b)| b < *a).collect();
        let feet = (0..band.len()).map(|at| {
            let theirs_counts =
                ours[at].distance == f32::INFINITY || (is_theirs[at] && theirs[at].distance < f32::INFINITY);
            if theirs_counts { theirs[at] } else { ours[at] }
        });
        let feet = feet.collect();
        Self { rows, distance, band, feet }
    }
}

/// The rows around the domain, wide enough for all cells in the band; `None` where the mesh does not reach them.
fn lines_of(part: &Part, points: &[Vec3], settings: &ShapeSettings) -> Option<RowLines> {
    let by = settings.reach() + 1;
    let (low, high) = (settings.low.map(|x| x - by), settings.high.map(|x| x + by));
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for point in part.corners.iter().flatten().map(|point| points[*point as usize]) {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(point[axis]);
            bounds[1][axis] = bounds[1][axis].max(point[axis]);
        }
    }
    let meets = |axis: usize| bounds[0][axis] < high[axis] as f32 && bounds[1][axis] > low[axis] as f32;
    if !(0..3).all(meets) {
        return None;
    }
    // Rows that the mesh does not come near are not stored, however large the domain is.
    let near = |at: f32, beyond: i32| at.clamp(-1e9, 1e9).floor() as i32 + beyond;
    let low = [0, 1, 2].map(|axis| low[axis].max(near(bounds[0][axis], -by)));
    let high = [0, 1, 2].map(|axis| high[axis].min(near(bounds[1][axis], by + 1)));
    Some(RowLines::new(points, &part.corners, low, high))
}

fn band_of(lines: &RowLines, part: &Part, points: &[Vec3], settings: &ShapeSettings) -> (CellRows, Vec<Foot>) {
    let candidates = lines.touched().dilated(settings.reach()).clipped(settings.low, settings.high);
    feet(points, part, &candidates, settings.band)
}
