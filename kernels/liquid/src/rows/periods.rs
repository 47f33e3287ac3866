//! Lattices that repeat: a liquid that goes out at one side of a box comes in at the other.
//!
//! Cells beyond a side that repeats are *images*: copies of the cells that they repeat, stored so that neighbours need no
//! search. A loop that reads neighbours fills the images first ([`Images::fill`]); only cells inside are written. Without
//! a period there are no images, and nothing is done.

use std::cmp::{max, min};
use std::ops::Range;

use numerics::vector::{Vec3, add};
use serde::{Deserialize, Serialize};

use crate::rows::{Cell, CellRows};

/// After how many cells along each axis, from cell 0 on, everything repeats; 0 where it does not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Periods(pub [i32; 3]);

impl Periods {
    /// Nothing repeats.
    pub const NONE: Self = Self([0; 3]);

    /// Whether anything repeats.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0 != [0; 3]
    }

    /// Whether a cell is no image.
    pub fn holds(self, cell: Cell) -> bool {
        (0..3).all(|axis| self.0[axis] == 0 || (0 <= cell[axis] && cell[axis] < self.0[axis]))
    }

    /// The cell that a cell repeats; itself where it is no image.
    pub fn home(self, cell: Cell) -> Cell {
        [0, 1, 2].map(|axis| self.home_along(axis, cell[axis]))
    }

    fn home_along(self, axis: usize, n: i32) -> i32 {
        if self.0[axis] > 0 { n.rem_euclid(self.0[axis]) } else { n }
    }

    /// The place that a place repeats, both in cells.
    #[inline(always)]
    pub fn home_point(self, mut point: Vec3) -> Vec3 {
        if self.any() {
            for (x, period) in point.iter_mut().zip(self.0) {
                if period > 0 {
                    let period = period as f32;
                    *x -= period * (*x / period).floor();
                }
            }
        }
        point
    }

    /// Periods of a lattice with cells twice as large; of an odd number of cells, the last is half as large.
    pub fn halved(self) -> Self {
        Self(self.0.map(|n| (n + 1) / 2))
    }

    /// Periods of a lattice with cells `by` times smaller.
    pub fn refined(self, by: i32) -> Self {
        Self(self.0.map(|n| n * by))
    }

    /// Calls `f` with all places in a box that repeat a place, but for itself; all in cells.
    pub fn each_repeat(self, point: Vec3, [low, high]: [Vec3; 2], mut f: impl FnMut(Vec3)) {
        // The numbers of periods by which it may be moved.
        let steps = |axis: usize| {
            let period = self.0[axis] as f32;
            match self.0[axis] {
                0 => 0..=0,
                _ => {
                    ((low[axis] - point[axis]) / period).ceil() as i32
                        ..=((high[axis] - point[axis]) / period).floor() as i32
                }
            }
        };
        for k in steps(2) {
            for j in steps(1) {
                for i in steps(0) {
                    if [i, j, k] != [0; 3] {
                        let [x, y, z] = self.0;
                        f(add(point, [i * x, j * y, k * z].map(|n| n as f32)));
                    }
                }
            }
        }
    }

    /// The cells that a set of cells repeats, with those that repeat none.
    pub fn gathered(self, rows: CellRows) -> CellRows {
        if !self.any() {
            return rows;
        }
        let [first, last] = [0, 1].map(|end| [0, 1].map(|axis| rows.low[axis] + end * rows.size[axis]));
        let range = |axis: usize| if self.0[axis + 1] > 0 { 0..self.0[axis + 1] } else { first[axis]..last[axis] };
        let [ys, zs] = [range(0), range(1)];
        // All numbers along y or z that a number of the result stands for.
        let repeats = |axis: usize, n: i32| {
            let period = self.0[axis + 1];
            let step = max(period, 1);
            let start = if period > 0 { first[axis] + (n - first[axis]).rem_euclid(period) } else { n };
            let end = if period > 0 { last[axis] } else { n + 1 };
            (start..end).step_by(step as usize)
        };
        CellRows::from_ranges([ys.start, zs.start], [ys.len() as i32, zs.len() as i32], |y, z, out| {
            for z in repeats(1, z) {
                for y in repeats(0, y) {
                    for span in rows.row(y, z) {
                        self.gather_along_x(span.start..span.end, out);
                    }
                }
            }
        })
    }

    fn gather_along_x(self, span: Range<i32>, out: &mut Vec<Range<i32>>) {
        let period = self.0[0];
        if period == 0 {
            return out.push(span);
        }
        let len = min(span.end - span.start, period);
        let start = span.start.rem_euclid(period);
        out.push(start..min(start + len, period));
        out.push(0..start + len - period);
    }

    /// A set of cells without images, and its images at most `margin` cells beyond the sides.
    pub fn with_images(self, rows: CellRows, margin: i32) -> CellRows {
        if !self.any() {
            return rows;
        }
        let range = |axis: usize| match self.0[axis + 1] {
            0 => (rows.low[axis], rows.low[axis] + rows.size[axis]),
            period => (-margin, period + margin),
        };
        let [(y0, y1), (z0, z1)] = [range(0), range(1)];
        CellRows::from_ranges([y0, z0], [y1 - y0, z1 - z0], |y, z, out| {
            for span in rows.row(self.home_along(1, y), self.home_along(2, z)) {
                if self.0[0] == 0 {
                    out.push(span.start..span.end);
                    continue;
                }
                let (low, high) = (-margin, self.0[0] + margin);
                let mut start = span.start - (span.start - low).div_euclid(self.0[0]) * self.0[0] - self.0[0];
                while start < high {
                    out.push(max(start, low)..min(start + span.len() as i32, high));
                    start += self.0[0];
                }
            }
        })
    }

    /// A set of cells in storage: what it repeats, and `margin` images beyond the sides.
    pub fn stored(self, rows: CellRows, margin: i32) -> CellRows {
        self.with_images(self.gathered(rows), margin)
    }

    /// Where the images among stored cells are, and what they repeat.
    pub fn images(self, rows: &CellRows) -> Images {
        let mut images = Images { periods: self, pairs: Vec::new(), homes: Vec::new() };
        if self.any() {
            images.homes = (0..rows.len() as u32).collect();
            for (to, cell) in rows.iter().enumerate() {
                let home = self.home(cell);
                if let Some(from) = rows.find(home).filter(|_| home != cell) {
                    images.homes[to] = from as u32;
                    images.pairs.push(Image { to: to as u32, from: from as u32, cell });
                }
            }
        }
        images
    }
}

/// An image and the cell that it repeats.
#[derive(Clone, Copy, Debug)]
struct Image {
    to: u32,
    from: u32,
    cell: Cell,
}

/// The images among stored cells.
#[derive(Clone, Debug, Default)]
pub struct Images {
    periods: Periods,
    pairs: Vec<Image>,
    /// For each cell, where the one that it repeats is; empty without periods.
    homes: Vec<u32>,
}

impl Images {
    /// After how many cells everything repeats.
    pub fn periods(&self) -> Periods {
        self.periods
    }

    /// Where the value of the cell is that a stored cell repeats.
    #[inline(always)]
    pub fn home(&self, at: usize) -> usize {
        if self.homes.is_empty() { at } else { self.homes[at] as usize }
    }

    /// Whether a stored cell is no image.
    pub fn is_home(&self, at: usize) -> bool {
        self.home(at) == at
    }

    /// Gives each image the value of what it repeats.
    pub fn fill<T: Copy>(&self, field: &mut [T]) {
        for image in &self.pairs {
            field[image.to as usize] = field[image.from as usize];
        }
    }

    /// The same of several fields.
    pub fn fill_each<T: Copy, const N: usize>(&self, fields: &mut [Vec<T>; N]) {
        fields.iter_mut().for_each(|field| self.fill(field));
    }

    /// Gives each image 0.
    pub fn clear(&self, field: &mut [f64]) {
        self.pairs.iter().for_each(|image| field[image.to as usize] = 0.0);
    }

    /// Gives low faces along `axis` on a side that repeats the values of their images on the other, where `is_wanted` says
    /// so of where they are.
    pub(crate) fn give_home<T: Copy>(&self, axis: usize, field: &mut [T], is_wanted: impl Fn(usize) -> bool) {
        let is_opposite = |image: &&Image| {
            let mut lowest = image.cell;
            lowest[axis] -= self.periods.0[axis];
            lowest[axis] == 0 && self.periods.holds(lowest)
        };
        for image in self.pairs.iter().filter(is_opposite).filter(|image| is_wanted(image.from as usize)) {
            field[image.from as usize] = field[image.to as usize];
        }
    }

    /// Gives each image its value, times what makes the sums over children of coarse cells the transpose of their
    /// interpolation: where a period is odd, the last coarse cell has the only children beyond the side. `on_faces`: the
    /// axis along which values lie on low faces.
    pub(crate) fn fill_for_sums(&self, field: &mut [f32], on_faces: Option<usize>) {
        for image in &self.pairs {
            let weight = |axis: usize| {
                let period = self.periods.0[axis];
                let (at, is_odd) = (image.cell[axis], period % 2 == 1);
                match (0..period).contains(&at) || !is_odd || period == 0 {
                    true => 1.0,
                    false if at == period && on_faces != Some(axis) => 1.0 / 3.0,
                    false => 0.0,
                }
            };
            let weight = weight(0) * weight(1) * weight(2);
            field[image.to as usize] = weight * field[image.from as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_gathered_and_repeated() {
        let periods = Periods([6, 0, 5]);
        let cells = [[-1, 3, 0], [7, 3, 0], [2, -4, 12], [5, 0, -11], [0, 9, 4]];
        let gathered = periods.gathered(CellRows::from_cells(&cells));
        assert_eq!(gathered, CellRows::from_cells(&cells.map(|cell| periods.home(cell))).union(&gathered));
        assert_eq!(gathered.len(), cells.len());
        assert!(gathered.iter().all(|cell| periods.holds(cell)));
        let stored = periods.with_images(gathered.clone(), 7);
        let all = CellRows::cuboid([-7, -5, -7], [13, 11, 12]);
        for cell in all.iter() {
            assert_eq!(stored.find(cell).is_some(), gathered.find(periods.home(cell)).is_some(), "{cell:?}");
        }
        let mut field: Vec<i32> = stored.tabulate(|[x, y, z]| 100 * x + 10 * y + z);
        let images = periods.images(&stored);
        images.fill(&mut field);
        for (at, cell) in stored.iter().enumerate() {
            let [x, y, z] = periods.home(cell);
            assert_eq!(field[at], 100 * x + 10 * y + z);
            assert_eq!(images.is_home(at), periods.holds(cell));
        }
    }

    #[test]
    fn rows_longer_than_a_period_and_periods_of_one_cell_are_gathered() {
        let periods = Periods([3, 1, 0]);
        let gathered = periods.gathered(CellRows::cuboid([-4, -3, 2], [9, 5, 4]));
        assert_eq!(gathered, CellRows::cuboid([0, 0, 2], [3, 1, 4]));
        let stored = periods.with_images(gathered, 2);
        assert_eq!(stored, CellRows::cuboid([-2, -2, 2], [5, 3, 4]));
    }

    #[test]
    fn places_come_home() {
        let periods = Periods([8, 0, 3]);
        assert_eq!(periods.home_point([-0.5, -7.0, 9.25]), [7.5, -7.0, 0.25]);
        assert_eq!(Periods::NONE.home_point([-1.0, 2.0, 3e9]), [-1.0, 2.0, 3e9]);
    }
}
