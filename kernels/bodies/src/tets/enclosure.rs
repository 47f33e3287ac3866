//! Which points lie inside a closed surface.
//!
//! Decided by exact winding numbers on a snap grid. A surface that faces inwards encloses nothing. Points are tested
//! together with six others around them, at a distance that counts as touching: where surfaces touch, rounding would
//! decide. Cost: a comparison with the bounding box for most points.

use super::grid::{GridPoint, SnapGrid};
use super::winding::{Winding, WindingCounts};

/// A closed surface that faces outwards, and the depth from which points count as inside.
pub(crate) struct Enclosure {
    corners: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    low: [f64; 3],
    high: [f64; 3],
    depth: f64,
}

impl Enclosure {
    /// Of `triangles` over `points`, which may have others. Points closer than `depth` to the surface do not count, and
    /// some up to 1.8 times as deep.
    pub(crate) fn new(points: &[[f64; 3]], triangles: &[[u32; 3]], depth: f64) -> Self {
        let mut used: Vec<u32> = triangles.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        let row = |corner: u32| used.partition_point(|point| *point < corner) as u32;
        let [low, high] = bounds(used.iter().map(|point| points[*point as usize]));
        Self {
            corners: used.iter().map(|point| points[*point as usize].map(|x| x as f32)).collect(),
            triangles: triangles.iter().map(|corners| corners.map(row)).collect(),
            low: low.map(|x| x + depth),
            high: high.map(|x| x - depth),
            depth,
        }
    }

    /// Sets `inside` for those of `candidates` (indices into `points`) that lie inside.
    pub(crate) fn mark(&self, points: &[[f64; 3]], candidates: &[u32], inside: &mut [bool]) {
        let within = |point: &u32| {
            let at = points[*point as usize];
            (0..3).all(|axis| self.low[axis] <= at[axis] && at[axis] <= self.high[axis])
        };
        let near: Vec<u32> = candidates.iter().copied().filter(within).collect();
        if near.is_empty() {
            return;
        }
        let Some(grid) = SnapGrid::around(&self.corners) else { return };
        let grid_points: Vec<GridPoint> = self.corners.iter().map(|p| grid.grid_point(p.map(f64::from))).collect();
        let shells = vec![0; self.triangles.len()];
        let winding = Winding::new(&grid_points, &self.triangles, &shells);
        let mut tally = WindingCounts::new();
        let mut encloses = |at: [f64; 3]| {
            winding.around(grid.grid_point(at).map(i64::from), 1, &mut tally);
            tally.iter().any(|(_, count)| *count > 0)
        };
        for point in near {
            let at = points[point as usize];
            let mut beside = (0..3).flat_map(|axis| [-self.depth, self.depth].map(|by| (axis, by)));
            inside[point as usize] |= encloses(at)
                && beside.all(|(axis, by)| {
                    let mut beside = at;
                    beside[axis] += by;
                    encloses(beside)
                });
        }
    }
}

/// The lowest and highest coordinates of points; infinite, and inverted, without any.
pub fn bounds(points: impl Iterator<Item = [f64; 3]>) -> [[f64; 3]; 2] {
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    points.fold(none, |[low, high], p| {
        [[0, 1, 2].map(|axis| low[axis].min(p[axis])), [0, 1, 2].map(|axis| high[axis].max(p[axis]))]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube from the origin that faces outwards.
    fn cube() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let points = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(f64::from)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        (points, triangles)
    }

    fn marked(triangles: &[[u32; 3]], points: &[[f64; 3]]) -> Vec<bool> {
        let mut inside = vec![false; points.len()];
        let all: Vec<u32> = (0..points.len() as u32).collect();
        Enclosure::new(&cube().0, triangles, 0.1).mark(points, &all, &mut inside);
        inside
    }

    #[test]
    fn points_count_as_inside_from_a_depth_on() {
        let points = [[0.5; 3], [0.5, 0.5, 0.85], [0.5, 0.5, 0.95], [0.0, 0.5, 0.5], [0.5, 0.5, 1.5], [-3.0; 3]];
        assert_eq!(marked(&cube().1, &points), [true, true, false, false, false, false]);
    }

    #[test]
    fn a_surface_that_faces_inwards_encloses_nothing() {
        let turned: Vec<[u32; 3]> = cube().1.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert_eq!(marked(&turned, &[[0.5; 3], [2.0; 3]]), [false, false]);
        assert_eq!(marked(&[], &[[0.5; 3]]), [false], "nor does one without triangles");
    }
}
