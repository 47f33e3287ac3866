//! Values between the points of a lattice, trilinearly.

use numerics::vector::Vec3;

use crate::rows::{Cell, CellRows, RowSpan};
use crate::velocity::{FaceFields, within};

/// Where in its cell the value of a field lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// In the middle of the low face along x.
    FaceX,
    /// In the middle of the low face along y.
    FaceY,
    /// In the middle of the low face along z.
    FaceZ,
    /// In the middle of the cell.
    Centre,
}

impl Site {
    /// The low faces along x, y and z.
    pub const FACES: [Self; 3] = [Self::FaceX, Self::FaceY, Self::FaceZ];

    /// From the low corner of a cell to its value, in cells.
    #[inline(always)]
    pub const fn offset(self) -> Vec3 {
        match self {
            Self::FaceX => [0.0, 0.5, 0.5],
            Self::FaceY => [0.5, 0.0, 0.5],
            Self::FaceZ => [0.5, 0.5, 0.0],
            Self::Centre => [0.5, 0.5, 0.5],
        }
    }

    /// Where the value of a cell lies.
    #[inline(always)]
    pub fn of(self, cell: Cell) -> Vec3 {
        let offset = self.offset();
        [cell[0] as f32 + offset[0], cell[1] as f32 + offset[1], cell[2] as f32 + offset[2]]
    }
}

/// The eight values around a point.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    /// Where the first of two values along x is in a field; y ascends first, then z.
    pub at: [u32; 4],
    /// How far the point is from the first corner towards the last, 0…1 along each axis.
    pub t: Vec3,
}

impl Corners {
    /// The eight values, x fastest.
    #[inline(always)]
    pub fn values<T: Copy>(&self, field: &[T]) -> [T; 8] {
        let pair = |at: u32| {
            let pair = &field[at as usize..at as usize + 2];
            [pair[0], pair[1]]
        };
        let [[a, b], [c, d], [e, f], [g, h]] = self.at.map(pair);
        [a, b, c, d, e, f, g, h]
    }

    /// The value at the point.
    #[inline(always)]
    pub fn value(&self, field: &[f32]) -> f32 {
        trilinear(self.values(field), self.t)
    }

    /// The derivative along an axis at the point, per cell.
    #[inline(always)]
    pub fn slope(&self, field: &[f32], axis: usize) -> f32 {
        let values = self.values(field);
        let (mut low, mut high) = (self.t, self.t);
        (low[axis], high[axis]) = (0.0, 1.0);
        trilinear(values, high) - trilinear(values, low)
    }
}

/// The value between eight corners, x fastest.
#[inline(always)]
pub fn trilinear(v: [f32; 8], [x, y, z]: Vec3) -> f32 {
    let (low, high) = ([v[0], v[1], v[4], v[5]], [v[2], v[3], v[6], v[7]]);
    let (mut rows, mut ends) = ([0.0; 4], [0.0; 2]);
    for n in 0..4 {
        rows[n] = low[n] + (high[n] - low[n]) * y;
    }
    for n in 0..2 {
        ends[n] = rows[n] + (rows[n + 2] - rows[n]) * z;
    }
    ends[0] + (ends[1] - ends[0]) * x
}

/// Four rows around points, and the cells along x for which all four are stored.
#[derive(Clone, Copy, Debug)]
struct Window {
    row: [i32; 2],
    /// x and x + 1 are stored in all rows for `start` ≤ x < `end`.
    start: i32,
    end: i32,
    /// Where the values at x = 0 would be, modulo 2³².
    base: [u32; 4],
}

const NO_WINDOW: Window = Window { row: [0; 2], start: 0, end: 0, base: [0; 4] };

/// Finds the values around points. It remembers the rows of the last points, so points near each other are found without
/// a search.
#[derive(Clone, Debug)]
pub struct Sampler<'a> {
    rows: &'a CellRows,
    /// One window for each row modulo 4 along y and z: those around a point, for all sites, have different ones.
    windows: [Window; 16],
    /// Those of `rows`, once a point far from all cells has asked for them.
    bounds: Option<(Cell, Cell)>,
}

impl<'a> Sampler<'a> {
    /// For fields on `rows`.
    pub fn new(rows: &'a CellRows) -> Self {
        Self { rows, windows: [NO_WINDOW; 16], bounds: None }
    }

    /// The values around `point`, in cells; `None` where one is not stored.
    #[inline(always)]
    pub fn corners(&mut self, site: Site, point: Vec3) -> Option<Corners> {
        self.corners_of(split(site, point))
    }

    #[inline(always)]
    fn corners_of(&mut self, (cell, t): (Cell, Vec3)) -> Option<Corners> {
        Some(Corners { at: self.places(cell)?, t })
    }

    /// Where the first of two values along x is, given the cell of the first corner; as [`Corners`] has it.
    #[inline(always)]
    pub(super) fn places(&mut self, [x, y, z]: Cell) -> Option<[u32; 4]> {
        let slot = (y & 3 | (z & 3) << 2) as usize;
        let mut window = &self.windows[slot];
        if window.row != [y, z] || x < window.start || x >= window.end {
            self.windows[slot] = self.window([x, y, z])?;
            window = &self.windows[slot];
        }
        let mut places = window.base;
        for place in &mut places {
            *place = place.wrapping_add(x as u32);
        }
        Some(places)
    }

    /// The value of `field` at `point`. Where not all corners are stored, the mean of those that are, weighted as they
    /// would be; where none is, the value closest to the point. 0 where there is no cell.
    #[inline(always)]
    pub fn value(&mut self, field: &[f32], site: Site, point: Vec3) -> f32 {
        match self.corners(site, point) {
            Some(corners) => corners.value(field),
            None => self.value_beside(field, site, point),
        }
    }

    /// A velocity on faces at `point`, as [`Self::value`] finds each component.
    #[inline(always)]
    pub fn velocity(&mut self, faces: &FaceFields<f32>, point: Vec3) -> Vec3 {
        // Between faces and between centres, along each axis.
        let [x, y, z] = [0, 1, 2].map(|axis| split_along(point[axis], 0.0));
        let [a, b, c] = [0, 1, 2].map(|axis| split_along(point[axis], 0.5));
        [
            self.component(&faces[0], Site::FaceX, [x, b, c], point),
            self.component(&faces[1], Site::FaceY, [a, y, c], point),
            self.component(&faces[2], Site::FaceZ, [a, b, z], point),
        ]
    }

    #[inline(always)]
    fn component(&mut self, field: &[f32], site: Site, [x, y, z]: [(i32, f32); 3], point: Vec3) -> f32 {
        match self.corners_of(([x.0, y.0, z.0], [x.1, y.1, z.1])) {
            Some(corners) => corners.value(field),
            None => self.value_beside(field, site, point),
        }
    }

    #[inline(never)]
    fn window(&self, [x, y, z]: Cell) -> Option<Window> {
        let around = |[y, z]: [i32; 2]| {
            let row = self.rows.row(y, z);
            let span = row.get(row.partition_point(|span| span.end <= x))?;
            (span.start <= x && x + 1 < span.end).then_some(*span)
        };
        let mut spans = [RowSpan { start: 0, end: 0, base: 0 }; 4];
        for (span, row) in spans.iter_mut().zip(rows_around([y, z])) {
            *span = around(row)?;
        }
        let start = spans.iter().fold(i32::MIN, |start, span| start.max(span.start));
        let end = spans.iter().fold(i32::MAX, |end, span| end.min(span.end)) - 1;
        Some(Window { row: [y, z], start, end, base: spans.map(|span| span.base.wrapping_sub(span.start as u32)) })
    }

    #[cold]
    pub(super) fn value_beside(&mut self, field: &[f32], site: Site, point: Vec3) -> f32 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (at, weight) in self.stored_beside(site, point).into_iter().flatten() {
            sum += weight * field[at];
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { 0.0 }
    }

    /// Where the values are that make up the one at a point, and their weights, which sum up to 1; none where there is no cell.
    pub(crate) fn weights(&mut self, site: Site, point: Vec3) -> [Option<(usize, f32)>; 8] {
        let mut found = self.stored_beside(site, point);
        let sum = found.iter().flatten().fold(0.0, |sum, (_, weight)| sum + weight);
        found.iter_mut().flatten().for_each(|(_, weight)| *weight /= sum);
        found
    }

    /// Those of the eight corners around a point that are stored and count, with their weights; else the closest cell.
    fn stored_beside(&mut self, site: Site, point: Vec3) -> [Option<(usize, f32)>; 8] {
        let ([x, y, z], t) = split(site, point);
        let mut found: [Option<(usize, f32)>; 8] = std::array::from_fn(|corner| {
            let up = [0, 1, 2].map(|axis| corner as i32 >> axis & 1);
            let weight = |axis: usize| if up[axis] == 1 { t[axis] } else { 1.0 - t[axis] };
            let weight = weight(0) * weight(1) * weight(2);
            let at = self.rows.find([x + up[0], y + up[1], z + up[2]])?;
            (weight > 0.0).then_some((at, weight))
        });
        if found.iter().all(Option::is_none) {
            let nearest = [0, 1, 2].map(|axis| [x, y, z][axis] + i32::from(t[axis] >= 0.5));
            found[0] = self.closest(nearest).map(|at| (at, 1.0));
        }
        found
    }

    /// Where the value of the stored cell closest to `cell` is.
    fn closest(&mut self, [x, y, z]: Cell) -> Option<usize> {
        if self.rows.is_empty() {
            return None;
        }
        self.bounds = self.bounds.or_else(|| self.rows.bounds());
        let (low, high) = self.bounds?;
        let square = |n: i32| i64::from(n) * i64::from(n);
        let [x, y, z] = [0, 1, 2].map(|axis| [x, y, z][axis].clamp(low[axis], high[axis] - 1));
        let mut best: Option<(i64, usize)> = None;
        let mut reach = 0;
        while best.is_none_or(|(distance, _)| square(reach) < distance) {
            for k in -reach..=reach {
                // Rows nearer than `reach` were searched before.
                let stride = if k.abs() == reach { 1 } else { (2 * reach).max(1) };
                for j in (-reach..=reach).step_by(stride as usize) {
                    for span in self.rows.row(y + j, z + k) {
                        let near = x.clamp(span.start, span.end - 1);
                        let distance = square(near - x) + square(j) + square(k);
                        if best.is_none_or(|(least, _)| distance < least) {
                            best = Some((distance, span.at(near)));
                        }
                    }
                }
            }
            reach += 1;
        }
        best.map(|(_, at)| at)
    }
}

fn rows_around([y, z]: [i32; 2]) -> [[i32; 2]; 4] {
    [[y, z], [y + 1, z], [y, z + 1], [y + 1, z + 1]]
}

/// Points farther from 0 count as if they were there, cells.
const FARTHEST: f32 = 2_097_152.0;

/// Adding it rounds a number up to [`FARTHEST`] to the nearest whole one, in the low bits of the sum.
const WHOLE: f32 = 12_582_912.0;

/// The cell of the first corner around a point, and how far the point is from it.
#[inline(always)]
fn split(site: Site, point: Vec3) -> (Cell, Vec3) {
    let offset = site.offset();
    let at = [0, 1, 2].map(|axis| split_along(point[axis], offset[axis]));
    (at.map(|(cell, _)| cell), at.map(|(_, t)| t))
}

/// The same along one axis.
#[inline(always)]
pub(super) fn split_along(x: f32, offset: f32) -> (i32, f32) {
    let p = within(x, -FARTHEST, FARTHEST) - offset;
    // A whole p may take the cell below, with t = 1.
    let sum = (p - 0.5) + WHOLE;
    (sum.to_bits() as i32 - WHOLE.to_bits() as i32, p - (sum - WHOLE))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear([x, y, z]: Vec3) -> f32 {
        0.5 + 2.0 * x - 3.0 * y + 0.25 * z
    }

    #[test]
    fn linear_fields_are_sampled_exactly_between_any_cells() {
        let rows =
            CellRows::cuboid([-6, -5, -7], [9, 8, 6]).filtered(|cell, _| cell.map(|x| x * x).iter().sum::<i32>() < 40);
        for site in [Site::FaceX, Site::FaceY, Site::FaceZ, Site::Centre] {
            let field = rows.tabulate(|cell| linear(site.of(cell)));
            let mut sampler = Sampler::new(&rows);
            let mut found = 0;
            for n in 0..4000 {
                let p = [17, 29, 41].map(|step| ((n * step) % 1000) as f32 * 0.014 - 7.0);
                if sampler.corners(site, p).is_some() {
                    found += 1;
                    assert!((sampler.value(&field, site, p) - linear(p)).abs() < 1e-5, "{site:?} {p:?}");
                    let mut slope = |axis| sampler.corners(site, p).unwrap().slope(&field, axis);
                    let slopes = [0, 1, 2].map(&mut slope);
                    assert!((0..3).all(|axis| (slopes[axis] - [2.0, -3.0, 0.25][axis]).abs() < 2e-5), "{slopes:?}");
                }
            }
            assert!(found > 500, "{found}");
        }
    }

    #[test]
    fn beyond_the_stored_cells_the_closest_values_count() {
        let rows = CellRows::from_cells(&[[0, 0, 0], [1, 0, 0], [4, 2, 0], [5, 2, 0]]);
        let field = [1.0, 2.0, 3.0, 4.0];
        let mut sampler = Sampler::new(&rows);
        let mut at = |p| sampler.value(&field, Site::Centre, p);
        // Two of eight corners; the middle between them.
        assert_eq!(at([1.0, 0.7, 0.6]), 1.5);
        assert_eq!(at([-9.0, 0.5, 0.5]), 1.0);
        assert_eq!(at([2.9, 0.5, 30.5]), 2.0);
        assert_eq!(at([4.6, 90.0, 0.5]), 3.0);
        assert_eq!(at([1e20, 1e20, -1e20]), 4.0);
        assert_eq!(Sampler::new(&CellRows::default()).value(&[], Site::FaceX, [0.5; 3]), 0.0);
    }
}
