//! Which points lie inside a closed surface, and where they leave it in a given direction.
//!
//! Decided by exact winding numbers on a snap grid. A surface that faces inwards encloses nothing. Points are tested
//! together with six others around them, at a distance that counts as touching: where surfaces touch, rounding would
//! decide. Cost: a comparison with the bounding box for most points.

use super::grid::{GridPoint, SnapGrid};
use super::winding::{Winding, WindingCounts};
use numerics::vector::{DMat3, DVec3, to_f32, to_f64};

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
        let near = self.near(points, candidates);
        if near.is_empty() {
            return;
        }
        let Some((grid, grid_points)) = snapped(&self.corners) else { return };
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
                && (self.depth == 0.0
                    || beside.all(|(axis, by)| {
                        let mut beside = at;
                        beside[axis] += by;
                        encloses(beside)
                    }));
        }
    }

    /// Those of `candidates` (indices into `points`) that lie inside.
    pub(crate) fn within(&self, points: &[[f64; 3]], mut candidates: Vec<u32>) -> Vec<u32> {
        let mut inside = vec![false; points.len()];
        self.mark(points, &candidates, &mut inside);
        candidates.retain(|point| inside[*point as usize]);
        candidates
    }

    /// Where those of `candidates` (indices into `points`) that lie inside leave the surface along a unit `direction`,
    /// in their order.
    pub(crate) fn exits(&self, points: &[[f64; 3]], candidates: &[u32], direction: DVec3) -> Vec<Exit> {
        let mut exits = Vec::new();
        self.crossings(points, &self.near(points, candidates), direction, |point, crossed| {
            let mut left: i32 = crossed.iter().map(|crossing| crossing.passed).sum();
            if left <= 0 {
                return;
            }
            let last = crossed.iter().find(|crossing| {
                left -= crossing.passed;
                left <= 0
            });
            exits.extend(last.map(|last| Exit { point, face: last.face, distance: last.height.max(0.0) }));
        });
        exits
    }

    /// Calls `act` with each of `candidates` and the stretches of its line along a unit `direction` that are inside:
    /// distances at which they begin, 0 if the point is inside, and end.
    pub(crate) fn stretches(
        &self,
        points: &[[f64; 3]],
        candidates: &[u32],
        direction: DVec3,
        mut act: impl FnMut(u32, &[[f64; 2]]),
    ) {
        let mut stretches = Vec::new();
        self.crossings(points, candidates, direction, |point, crossed| {
            stretches.clear();
            let mut left: i32 = crossed.iter().map(|crossing| crossing.passed).sum();
            let mut begin = 0.0;
            for crossing in crossed {
                let before = left;
                left -= crossing.passed;
                match (before > 0, left > 0) {
                    (false, true) => begin = crossing.height,
                    (true, false) => stretches.push([begin, crossing.height]),
                    _ => {}
                }
            }
            act(point, &stretches);
        });
    }

    /// Calls `act` with each of `candidates` and where its line along a unit `direction` crosses the surface, in order.
    fn crossings(
        &self,
        points: &[[f64; 3]],
        candidates: &[u32],
        direction: DVec3,
        mut act: impl FnMut(u32, &[Crossing]),
    ) {
        let Some(origin) = self.corners.first().map(|corner| to_f64(*corner)).filter(|_| !candidates.is_empty()) else {
            return;
        };
        let side = direction.cross(&if direction.x.abs() < 0.7 { DVec3::x() } else { DVec3::y() }).normalize();
        let turn = DMat3::from_rows(&[side.transpose(), direction.cross(&side).transpose(), direction.transpose()]);
        // Turned so that the direction is +z, that of the rays that winding numbers are counted on.
        let turned: Vec<[f32; 3]> = self.corners.iter().map(|p| to_f32(turn * (to_f64(*p) - origin))).collect();
        let Some((grid, grid_points)) = snapped(&turned) else { return };
        let shells = vec![0; self.triangles.len()];
        let winding = Winding::new(&grid_points, &self.triangles, &shells);
        let mut crossed: Vec<Crossing> = Vec::new();
        let [low, high] = bounds(turned.iter().map(|p| p.map(f64::from)));
        for point in candidates {
            let at = turn * (DVec3::from(points[*point as usize]) - origin);
            crossed.clear();
            if !(0..2).all(|axis| low[axis] <= at[axis] && at[axis] <= high[axis]) || at.z > high[2] {
                continue;
            }
            let mut from = grid.grid_point(at.into()).map(i64::from);
            if at.z < low[2] {
                // The grid does not reach below the surface.
                from[2] = -1;
            }
            winding.crossed(from, 1, |face, passed| {
                let corners = self.triangles[face as usize].map(|corner| to_f64(turned[corner as usize]));
                crossed.push(Crossing { height: height_above(at, corners), face, passed });
            });
            crossed.sort_by(|a, b| a.height.total_cmp(&b.height).then(a.face.cmp(&b.face)));
            act(*point, &crossed);
        }
    }

    /// Those of `candidates` that are within the bounding box.
    fn near(&self, points: &[[f64; 3]], candidates: &[u32]) -> Vec<u32> {
        let within = |point: &u32| {
            let at = points[*point as usize];
            (0..3).all(|axis| self.low[axis] <= at[axis] && at[axis] <= self.high[axis])
        };
        candidates.iter().copied().filter(within).collect()
    }
}

/// Points on the finest grid that covers them.
fn snapped(points: &[[f32; 3]]) -> Option<(SnapGrid, Vec<GridPoint>)> {
    let grid = SnapGrid::around(points)?;
    Some((grid, points.iter().map(|p| grid.grid_point(p.map(f64::from))).collect()))
}

/// Height of a triangle above a point, along z; its lowest corner's if the triangle is upright.
fn height_above(at: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let height = normal.dot(&(a - at)) / normal.z;
    let (low, high) = (a.z.min(b.z).min(c.z) - at.z, a.z.max(b.z).max(c.z) - at.z);
    if height.is_finite() { height.clamp(low, high) } else { low }
}

/// Where the line of a point crosses a triangle: 1 from behind, −1 from the front.
struct Crossing {
    height: f64,
    face: u32,
    passed: i32,
}

/// Where a point leaves a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Exit {
    /// Index of the point.
    pub(crate) point: u32,
    /// Index of the triangle that it passes.
    pub(crate) face: u32,
    /// Distance to there, metres.
    pub(crate) distance: f64,
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

    /// Along the diagonal of a face, 0.5 from each of the planes that it leads to, and out of a shell around a cavity.
    #[test]
    fn points_leave_a_surface_where_their_line_first_comes_out() {
        let (points, triangles) = cube();
        let exits = |triangles: &[[u32; 3]], corners: &[[f64; 3]], at: [f64; 3], direction: DVec3| {
            Enclosure::new(corners, triangles, 0.0).exits(&[at], &[0], direction)
        };
        let away = exits(&triangles, &points, [0.5; 3], DVec3::new(1.0, 1.0, 0.0).normalize());
        assert!((away[0].distance - 0.5_f64.sqrt()).abs() < 1e-6, "{away:?}");
        for (axis, faces) in [[10, 11], [6, 7], [2, 3]].into_iter().enumerate() {
            let mut direction = DVec3::zeros();
            direction[axis] = 1.0;
            let away = exits(&triangles, &points, [0.3, 0.4, 0.45], direction);
            let left = [0.7, 0.6, 0.55][axis];
            assert!((away[0].distance - left).abs() < 1e-6 && faces.contains(&(away[0].face as usize)), "{away:?}");
        }
        assert_eq!(exits(&triangles, &points, [0.5, 0.5, 1.5], DVec3::z()), [], "it is outside");
        // A cavity from 0.25 to 0.75.
        let inner = points.iter().map(|p| p.map(|x| 0.25 + 0.5 * x));
        let all: Vec<[f64; 3]> = points.iter().copied().chain(inner).collect();
        let turned = triangles.iter().map(|[a, b, c]| [a + 8, c + 8, b + 8]);
        let shell: Vec<[u32; 3]> = triangles.iter().copied().chain(turned).collect();
        let away = exits(&shell, &all, [0.5, 0.5, 0.1], DVec3::z());
        assert!((away[0].distance - 0.15).abs() < 1e-6, "into the cavity: {away:?}");
        assert_eq!(exits(&shell, &all, [0.5; 3], DVec3::z()), [], "the cavity is outside");
        // Lines of points outside, inside, in the cavity, beyond, and beside.
        let solid = Enclosure::new(&all, &shell, 0.0);
        for (at, expected) in [
            ([0.5, 0.5, -0.5], &[[0.5, 0.75], [1.25, 1.5]][..]),
            ([0.5, 0.5, 0.0625], &[[0.0, 0.1875], [0.6875, 0.9375]]),
            ([0.5; 3], &[[0.25, 0.5]]),
            ([0.5, 0.5, 1.5], &[]),
            ([0.125, 0.5, -0.5], &[[0.5, 1.5]]),
        ] {
            let mut found = Vec::new();
            solid.stretches(&[at], &[0], DVec3::z(), |_, stretches| found.extend_from_slice(stretches));
            assert_eq!(found, expected, "{at:?}");
        }
        let mut beside = 0;
        solid.stretches(&[[-0.5, 0.5, 0.5]], &[0], DVec3::z(), |_, _| beside += 1);
        assert_eq!(beside, 0, "its line misses the surface");
    }

    #[test]
    fn a_surface_that_faces_inwards_encloses_nothing() {
        let turned: Vec<[u32; 3]> = cube().1.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert_eq!(marked(&turned, &[[0.5; 3], [2.0; 3]]), [false, false]);
        assert_eq!(marked(&[], &[[0.5; 3]]), [false], "nor does one without triangles");
    }
}
