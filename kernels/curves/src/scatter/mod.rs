//! Points spread evenly over triangles: no two close together, and no void between them.
//!
//! Relaxation dart throwing (McCool & Fiume 1992): candidate i, uniform over the area, is accepted if no previously
//! accepted point is closer than `SPACING · √(area ÷ i)`. Distances are Euclidean; points on triangles that face in
//! opposite directions ignore each other, so that both sides of a thin sheet are filled equally.
//!
//! Guarantees: progressive: the points of a shorter list are the first of a longer one, and every list is evenly
//! distributed, so the density can vary over the surface by keeping shorter prefixes. A pure function of positions,
//! triangles and key, for any number of threads. Limit: a list is shorter than requested if the surface has no area, or
//! if `MAX_CANDIDATES` per point were not enough (about 3 usually are).

mod grow;
mod point_grid;

pub use grow::{Blade, grow, vertex_normals};

use crate::surface::SurfacePoint;
use numerics::parallel;
use numerics::random::Key;
use numerics::vector::{DVec3, to_f64};
use point_grid::PointGrid;

/// Relative to √(area ÷ candidates). Nearest neighbours among n points on a plane are then at least 0.48·√(area ÷ n)
/// and on average 0.73·√(area ÷ n) apart (random ones 0 and 0.5). At 0.6 it is 0.42 and 0.69; at 1.3 0.57 and 0.78, for
/// twice the time.
const SPACING: f64 = 0.8;

/// Candidates per point after which the search ends.
const MAX_CANDIDATES: u64 = 32;

/// Number of candidates in a task, and of triangles whose normals are: some 20 µs of work.
const TASK: u64 = 64;
const TRIANGLE_TASK: usize = 4096;

/// Number of candidates in the first round; each later round adds a quarter of all so far.
const FIRST_ROUND: u64 = 256;

/// Golden ratio × 2⁶⁴: any number of its multiples, modulo 1, fill a line evenly.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Triangles to spread points over.
pub struct ScatterSurface<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
    /// Cumulative area of the triangles, m².
    cumulative_area: Vec<f64>,
    /// Normal of each triangle, not normalised.
    normals: Vec<DVec3>,
    /// The smallest coordinates of all corners. Points are stored relative to them: none is negative, so a cast rounds
    /// down.
    low: DVec3,
}

impl<'a> ScatterSurface<'a> {
    /// The triangles, rows of `positions` (metres).
    ///
    /// # Panics
    /// If a corner is out of range.
    pub fn new(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]]) -> Self {
        let mut normals = vec![DVec3::zeros(); triangles.len()];
        parallel::fill(&mut normals, TRIANGLE_TASK, |row| area_vector(corners_of(positions, triangles[row])));
        let mut area = 0.0;
        let cumulative_area = normals.iter().map(|normal| {
            area += 0.5 * normal.norm();
            area
        });
        let cumulative_area = cumulative_area.collect();
        // Only of corners of triangles: a stray point far away would cost all others precision.
        let corners = || triangles.as_flattened().iter().map(|corner| positions[*corner as usize]);
        let least = |k: usize| corners().map(|p| f64::from(p[k])).fold(f64::INFINITY, f64::min);
        Self { positions, triangles, cumulative_area, normals, low: DVec3::new(least(0), least(1), least(2)) }
    }

    /// Area of all triangles, m².
    pub fn area(&self) -> f64 {
        self.cumulative_area.last().copied().unwrap_or(0.0)
    }

    /// `count` points, in the order in which they were found.
    pub fn spread(&self, count: usize, key: Key) -> Vec<SurfacePoint> {
        let mut points = Vec::with_capacity(count);
        let mut grid = PointGrid::new(self.spacing(0), FIRST_ROUND as usize);
        let last = MAX_CANDIDATES * count as u64;
        let mut tried = 0;
        while self.area() > 0.0 && points.len() < count && tried < last {
            let round = tried..(tried + FIRST_ROUND.max(tried / 4)).min(last);
            grid.refine(self.spacing(round.start));
            // First, in parallel, against the points of earlier rounds; then, in order, against those of this one.
            let fit = parallel::map(round.clone().step_by(TASK as usize), |_, first| {
                let candidates = (first..round.end.min(first + TASK)).map(|i| {
                    let point = self.candidate(i, key);
                    (i, point, point.position(self.positions, self.triangles) - self.low)
                });
                let fits = |(i, point, at): &(u64, SurfacePoint, DVec3)| {
                    !self.is_crowded(&grid, 0, point, *at, self.spacing(*i))
                };
                candidates.filter(fits).collect::<Vec<_>>()
            });
            let earlier = points.len();
            for (i, point, at) in fit.into_iter().flatten() {
                if points.len() < count && !self.is_crowded(&grid, earlier, &point, at, self.spacing(i)) {
                    grid.add(at, point.triangle);
                    points.push(point);
                }
            }
            tried = round.end;
        }
        points
    }

    /// Minimum distance of candidate `i` from all points accepted before it, metres.
    fn spacing(&self, i: u64) -> f64 {
        SPACING * (self.area() / (i + 1) as f64).sqrt()
    }

    /// Candidate `i`: multiples of the golden ratio give its position in the list of triangles and across the rows of
    /// the triangle; its position along a row is random.
    fn candidate(&self, i: u64, key: Key) -> SurfacePoint {
        let along = key.u64().wrapping_add(i.wrapping_mul(GOLDEN));
        // Must not be rounded up to the end, where no triangle begins.
        let target = ((along >> 11) as f64 / (1_u64 << 53) as f64 * self.area()).min(self.area().next_down());
        let triangle = self.cumulative_area.partition_point(|end| *end <= target);
        let start = if triangle == 0 { 0.0 } else { self.cumulative_area[triangle - 1] };
        let share = (target - start) / (self.cumulative_area[triangle] - start);
        let (down, across) = (share.sqrt(), key.of(i).f64());
        SurfacePoint { triangle: triangle as u32, weights: [1.0 - down, down * (1.0 - across), down * across] }
    }

    /// Whether any accepted point from row `first` on is too near.
    fn is_crowded(&self, grid: &PointGrid, first: usize, point: &SurfacePoint, at: DVec3, spacing: f64) -> bool {
        let facing = self.normals[point.triangle as usize];
        grid.any_near(at, first, |other| {
            (other.at - at).norm_squared() < spacing * spacing
                && facing.dot(&self.normals[other.triangle as usize]) > 0.0
        })
    }
}

fn corners_of(positions: &[[f32; 3]], triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|corner| to_f64(positions[corner as usize]))
}

/// The normal, outward where the corners are counter-clockwise; twice the area long.
fn area_vector([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(&(c - a))
}

#[cfg(test)]
mod tests;
