//! A mesh row by row: the cells that triangles touch, and where the line through the middles of a row's cells crosses
//! triangles.
//!
//! Crossings are decided in whole numbers, 2⁻²⁰ of a cell, and a line through an edge or a corner is moved to one side by
//! an infinitesimal, so a line crosses a closed surface inwards as often as outwards, whatever the triangles.

use std::ops::Range;

use numerics::parallel;
use numerics::vector::Vec3;

use crate::rows::{Cell, CellRows};

/// What is known of one row.
#[derive(Clone, Debug, Default)]
struct RowLine {
    touched: Vec<Range<i32>>,
    /// x, and +1 where the line enters a solid, −1 where it leaves one.
    crossings: Vec<(f64, i32)>,
}

/// The rows of a box in y and z.
#[derive(Clone, Debug)]
pub(super) struct RowLines {
    low: [i32; 2],
    size: [i32; 2],
    x: Range<i32>,
    rows: Vec<RowLine>,
}

/// Cells along an axis that [a, b] reaches into, within `low` ≤ cell < `high`.
fn cells([a, b]: [f32; 2], low: i32, high: i32) -> Range<i32> {
    let within = |x: f32| x.clamp(low as f32, high as f32) as i32;
    within(a.floor())..within(b.floor() + 1.0)
}

fn extent(corners: &[Vec3; 3], axis: usize) -> [f32; 2] {
    let [a, b, c] = corners.map(|corner| corner[axis]);
    [a.min(b).min(c), a.max(b).max(c)]
}

impl RowLines {
    /// The rows of the box `low` ≤ cell < `high`. Triangles with a corner that is not finite are left out.
    pub(super) fn new(points: &[Vec3], triangles: &[[u32; 3]], low: Cell, high: Cell) -> Self {
        let (corner_low, size) = ([low[1], low[2]], [(high[1] - low[1]).max(0), (high[2] - low[2]).max(0)]);
        let corners = |triangle: u32| triangles[triangle as usize].map(|point| points[point as usize]);
        let mut slabs: Vec<Vec<u32>> = vec![Vec::new(); size[1] as usize];
        for triangle in 0..triangles.len() as u32 {
            let corners = corners(triangle);
            if corners.iter().flatten().all(|x| x.is_finite())
                && !cells(extent(&corners, 1), low[1], high[1]).is_empty()
            {
                for z in cells(extent(&corners, 2), low[2], high[2]) {
                    slabs[(z - low[2]) as usize].push(triangle);
                }
            }
        }
        let rows = parallel::map(slabs, |k, slab| {
            let mut rows = vec![RowLine::default(); size[0] as usize];
            for triangle in slab {
                add(&mut rows, &corners(triangle), low, high, low[2] + k as i32);
            }
            rows.iter_mut().for_each(|row| row.crossings.sort_by(|a, b| a.0.total_cmp(&b.0)));
            rows
        });
        Self { low: corner_low, size, x: low[0]..high[0], rows: parallel::concat(rows) }
    }

    fn row(&self, y: i32, z: i32) -> &RowLine {
        &self.rows[((y - self.low[0]) + (z - self.low[1]) * self.size[0]) as usize]
    }

    /// The cells that triangles touch.
    pub(super) fn touched(&self) -> CellRows {
        CellRows::from_ranges(self.low, self.size, |y, z, out| out.extend_from_slice(&self.row(y, z).touched))
    }

    /// The cells whose middle the surface winds around, counted from both ends of the row: where a row enters a solid and
    /// never leaves it, because a triangle is missing, nothing is inside.
    pub(super) fn inside(&self, is_inside_out: bool) -> CellRows {
        let sign = if is_inside_out { -1 } else { 1 };
        CellRows::from_ranges(self.low, self.size, |y, z, out| {
            let crossings = &self.row(y, z).crossings;
            let all: i32 = crossings.iter().map(|crossing| sign * crossing.1).sum();
            let mut winding = 0;
            for pair in crossings.windows(2) {
                winding += sign * pair[0].1;
                if winding > 0 && winding > all {
                    // The first cell whose middle is not below x.
                    let [start, end] = [pair[0].0, pair[1].0]
                        .map(|x| (x - 0.5).ceil().clamp(f64::from(self.x.start), f64::from(self.x.end)) as i32);
                    out.extend((start < end).then_some(start..end));
                }
            }
        })
    }
}

/// Adds a triangle to the rows of slab z.
fn add(rows: &mut [RowLine], corners: &[Vec3; 3], low: Cell, high: Cell, z: i32) {
    let near = !cells(extent(corners, 0), low[0], high[0]).is_empty();
    let in_slab = Polygon::of(corners).between(2, z);
    let projected = Projected::of(corners);
    for y in cells(extent(corners, 1), low[1], high[1]) {
        let row = &mut rows[(y - low[1]) as usize];
        if near && let Some(x) = in_slab.between(1, y).extent_x() {
            row.touched.extend(Some(cells(x, low[0], high[0])).filter(|x| !x.is_empty()));
        }
        row.crossings.extend(projected.crossing(y, z));
    }
}

/// A triangle cut by planes.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [[f64; 3]; 8],
    count: usize,
}

impl Polygon {
    fn of(triangle: &[Vec3; 3]) -> Self {
        let mut corners = [[0.0; 3]; 8];
        corners.iter_mut().zip(triangle).for_each(|(to, from)| *to = from.map(f64::from));
        Self { corners, count: 3 }
    }

    /// The part between two planes of the lattice.
    fn between(&self, axis: usize, cell: i32) -> Self {
        self.above(axis, 1.0, f64::from(cell)).above(axis, -1.0, -f64::from(cell) - 1.0)
    }

    /// The part with `sign`·x ≥ `bound`.
    fn above(&self, axis: usize, sign: f64, bound: f64) -> Self {
        let mut out = Self { corners: [[0.0; 3]; 8], count: 0 };
        let mut push = |corner| {
            out.corners[out.count] = corner;
            out.count += 1;
        };
        for n in 0..self.count {
            let (a, b) = (self.corners[n], self.corners[(n + 1) % self.count]);
            let (over_a, over_b) = (sign * a[axis] - bound, sign * b[axis] - bound);
            if over_a >= 0.0 {
                push(a);
            }
            if (over_a >= 0.0) != (over_b >= 0.0) {
                let t = over_a / (over_a - over_b);
                push(std::array::from_fn(|k| a[k] + t * (b[k] - a[k])));
            }
        }
        out
    }

    fn extent_x(&self) -> Option<[f32; 2]> {
        let all = self.corners[..self.count].iter().map(|corner| corner[0]);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        (self.count > 0).then_some([low as f32, high as f32])
    }
}

/// Whole steps of a cell.
const STEPS: f64 = 1_048_576.0;

/// A triangle as a line along x sees it.
struct Projected {
    x: [f64; 3],
    /// y and z in steps.
    sides: [[i128; 2]; 3],
}

impl Projected {
    fn of(corners: &[Vec3; 3]) -> Self {
        // Areas fit 128 bits.
        let steps = |x: f32| i128::from(((f64::from(x) * STEPS).round() as i64).clamp(-(1 << 60), 1 << 60));
        Self {
            x: corners.map(|corner| f64::from(corner[0])),
            sides: corners.map(|corner| [steps(corner[1]), steps(corner[2])]),
        }
    }

    /// Where the line through the middles of a row crosses it.
    fn crossing(&self, y: i32, z: i32) -> Option<(f64, i32)> {
        let middle = |cell: i32| (2 * i128::from(cell) + 1) * (STEPS as i128 / 2);
        let [a, b, c] = self.sides.map(|[j, k]| [j - middle(y), k - middle(z)]);
        let side = turn(a, b);
        if side == 0 || turn(b, c) != side || turn(c, a) != side {
            return None;
        }
        let [over_a, over_b, over_c] = [area(b, c), area(c, a), area(a, b)].map(|area| area as f64);
        let x = (over_a * self.x[0] + over_b * self.x[1] + over_c * self.x[2]) / (over_a + over_b + over_c);
        // A normal along x points out of the solid.
        Some((x, -side))
    }
}

/// Twice the area of a triangle with a corner at the origin.
fn area(a: [i128; 2], b: [i128; 2]) -> i128 {
    a[0] * b[1] - a[1] * b[0]
}

/// Its sign, with the origin moved by ε along y and by ε² along z.
fn turn(a: [i128; 2], b: [i128; 2]) -> i32 {
    let [along_y, along_z] = [b[0] - a[0], b[1] - a[1]];
    let sign = [area(a, b), -along_z, along_y].into_iter().find(|value| *value != 0).unwrap_or(0);
    sign.signum() as i32
}
