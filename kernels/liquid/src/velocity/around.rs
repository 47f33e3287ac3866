//! Velocity at the middles of faces and of cells, without a search for each.

use numerics::vector::Vec3;

use crate::rows::{Cell, CellRows, RowSpan};
use crate::velocity::FaceFields;

/// Rows around one, as steps along y and z: those whose faces are next to the faces of its cells.
const ROWS: [[i32; 2]; 7] = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [-1, 1], [1, -1]];

/// The rows around a cell. Those of the last are remembered, so cells in the order of fields are found without a search.
#[derive(Clone, Debug)]
pub(crate) struct Around<'a> {
    rows: &'a CellRows,
    row: [i32; 2],
    /// x − 1 to x + 1 are stored in all rows for `start` ≤ x < `end`.
    start: i32,
    end: i32,
    /// Where the values at x = 0 would be, modulo 2³².
    base: [u32; 7],
}

/// Where the value of a cell is in each of [`ROWS`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places([usize; 7]);

impl<'a> Around<'a> {
    pub(crate) fn new(rows: &'a CellRows) -> Self {
        Self { rows, row: [0; 2], start: 0, end: 0, base: [0; 7] }
    }

    /// Where the cells around are; `None` where one is not stored.
    #[inline(always)]
    pub(crate) fn places(&mut self, [x, y, z]: Cell) -> Option<Places> {
        if self.row != [y, z] || x < self.start || x >= self.end {
            self.find([x, y, z])?;
        }
        Some(Places(self.base.map(|base| base.wrapping_add(x as u32) as usize)))
    }

    /// The same, and for how many cells from there along x it holds.
    #[inline(always)]
    pub(crate) fn places_of_run(&mut self, cell: Cell) -> Option<(Places, usize)> {
        let places = self.places(cell)?;
        Some((places, (self.end - cell[0]) as usize))
    }

    #[inline(never)]
    fn find(&mut self, [x, y, z]: Cell) -> Option<()> {
        let mut spans = [RowSpan { start: 0, end: 0, base: 0 }; 7];
        for (span, [j, k]) in spans.iter_mut().zip(ROWS) {
            let row = self.rows.row(y + j, z + k);
            *span = *row.get(row.partition_point(|span| span.end <= x))?;
            if span.start >= x || span.end <= x + 1 {
                return None;
            }
        }
        self.row = [y, z];
        self.start = spans.iter().fold(i32::MIN, |start, span| start.max(span.start)) + 1;
        self.end = spans.iter().fold(i32::MAX, |end, span| end.min(span.end)) - 1;
        self.base = spans.map(|span| span.base.wrapping_sub(span.start as u32));
        Some(())
    }
}

impl Places {
    /// Where the value of the cell itself is.
    #[inline(always)]
    pub(crate) fn own(&self) -> usize {
        self.0[0]
    }

    /// The value of a field that lies on the low faces along `of`, in the middle of the cell's low face along `at`: the mean of
    /// the four faces around.
    #[inline(always)]
    pub(crate) fn mean(&self, field: &[f32], of: usize, at: usize) -> f32 {
        let [a, b] = self.sums(field, of, at);
        0.25 * (a + b)
    }

    /// How that changes along `at`, per cell.
    #[inline(always)]
    pub(crate) fn slope(&self, field: &[f32], of: usize, at: usize) -> f32 {
        let [a, b] = self.sums(field, of, at);
        0.5 * (b - a)
    }

    /// Of the faces along `of` around a low face along `at`, the sum of the two below it and that of the two above.
    #[inline(always)]
    fn sums(&self, field: &[f32], of: usize, at: usize) -> [f32; 2] {
        let [a, b, c, d] = self.four(of, at);
        [field[a] + field[b], field[c] + field[d]]
    }

    /// Where they are: the two below and the two above.
    #[inline(always)]
    fn four(&self, of: usize, at: usize) -> [usize; 4] {
        let [own, y_up, y_down, z_up, z_down, yz, zy] = self.0;
        match (of, at) {
            (1, 0) => [own - 1, y_up - 1, own, y_up],
            (2, 0) => [own - 1, z_up - 1, own, z_up],
            (0, 1) => [y_down, y_down + 1, own, own + 1],
            (2, 1) => [y_down, yz, own, z_up],
            (0, _) => [z_down, z_down + 1, own, own + 1],
            _ => [z_down, zy, own, y_up],
        }
    }

    /// The derivative along its own axis, per cell, of a field on faces.
    #[inline(always)]
    pub(crate) fn along(&self, field: &[f32], axis: usize) -> f32 {
        let [own, y_up, y_down, z_up, z_down, ..] = self.0;
        let (below, above) = [(own - 1, own + 1), (y_down, y_up), (z_down, z_up)][axis];
        0.5 * (field[above] - field[below])
    }

    /// The velocity in the middle of the low face along an axis, of this cell and those after it along x: as many as
    /// `velocities` has room for.
    #[inline(always)]
    pub(crate) fn at_faces(&self, faces: &FaceFields<f32>, axis: usize, velocities: [&mut [f32]; 3]) {
        let len = velocities[0].len();
        velocities[axis].copy_from_slice(&faces[axis][self.own()..][..len]);
        for of in [(axis + 1) % 3, (axis + 2) % 3] {
            let [a, b, c, d] = self.four(of, axis).map(|at| &faces[of][at..][..len]);
            for (n, mean) in velocities[of].iter_mut().enumerate() {
                *mean = 0.25 * ((a[n] + b[n]) + (c[n] + d[n]));
            }
        }
    }

    /// The velocity in the middle of the cell.
    #[inline(always)]
    pub(crate) fn at_centre(&self, faces: &FaceFields<f32>) -> Vec3 {
        let [own, y_up, _, z_up, ..] = self.0;
        let mean = |axis: usize, above: usize| 0.5 * (faces[axis][own] + faces[axis][above]);
        [mean(0, own + 1), mean(1, y_up), mean(2, z_up)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::velocity::{MacVelocity, Sampler, Site};

    #[test]
    fn middles_have_what_a_sampler_finds_there() {
        let inside = |cell: Cell| cell.map(|x| x * x).iter().sum::<i32>() < 40 && cell != [1, 2, 0];
        let rows = CellRows::cuboid([-6, -5, -7], [9, 8, 6]).filtered(|cell, _| inside(cell));
        let number = |cell: Cell, axis: i32| (cell[0] * 5 + cell[1] * 3 + cell[2] * 11 + axis).rem_euclid(17) as f32;
        let faces: FaceFields<f32> = std::array::from_fn(|axis| rows.tabulate(|cell| number(cell, axis as i32)));
        let velocity = MacVelocity::new(rows.clone(), faces.clone());
        let (mut around, mut sampler) = (Around::new(&rows), Sampler::new(&rows));
        let mut found = 0;
        for (at, cell) in rows.iter().enumerate() {
            let steps = ROWS.iter().flat_map(|[j, k]| [-1, 0, 1].map(|i| [cell[0] + i, cell[1] + j, cell[2] + k]));
            let is_stored = steps.into_iter().all(|cell| rows.find(cell).is_some());
            let places = around.places(cell);
            assert_eq!(places.is_some(), is_stored, "{cell:?}");
            let Some(places) = places else { continue };
            found += 1;
            assert_eq!(places.own(), at);
            assert_eq!(places.at_centre(&faces), velocity.at(&mut sampler, Site::Centre.of(cell)));
            for axis in 0..3 {
                let middle = Site::FACES[axis].of(cell);
                let (places, len) = around.places_of_run(cell).unwrap();
                let mut found = [0, 1, 2].map(|_| vec![0.0; len]);
                places.at_faces(&faces, axis, found.each_mut().map(|found| &mut found[..]));
                for n in 0..len {
                    let middle = Site::FACES[axis].of([cell[0] + n as i32, cell[1], cell[2]]);
                    assert_eq!([0, 1, 2].map(|of| found[of][n]), velocity.at(&mut sampler, middle));
                }
                for of in 0..3 {
                    let (mut below, mut above) = (middle, middle);
                    below[axis] -= 0.5;
                    above[axis] += 0.5;
                    let [below, above] = [below, above].map(|at| sampler.value(&faces[of], Site::FACES[of], at));
                    let slope =
                        if of == axis { places.along(&faces[of], of) } else { places.slope(&faces[of], of, axis) };
                    assert_eq!(slope, above - below, "{axis} {of}");
                }
            }
        }
        assert!(found > 80, "{found}");
    }
}
