//! Loops over cells and their six neighbours, in parallel, with unit stride.
//!
//! Promise: chunks depend on the cells alone, so a loop that writes its own cells, and sums made a chunk at a time, have
//! the same bits on any number of threads.

use std::cmp::min;
use std::mem::take;
use std::ops::Range;

use numerics::parallel;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::rows::{CellRows, RowSpan};

/// Cells next to each other along x whose neighbours, too, are next to each other in a field. Those along x are one
/// before and one after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Where the value of the first cell is.
    pub at: u32,
    /// Number of cells.
    pub len: u32,
    /// The first cell.
    pub cell: [i32; 3],
    /// Where the values of the first cell's neighbours below and above along y are.
    pub y: [u32; 2],
    /// The same along z.
    pub z: [u32; 2],
}

impl Run {
    /// Where the values of the cells are.
    #[inline(always)]
    pub fn range(&self) -> Range<usize> {
        self.at as usize..self.at as usize + self.len as usize
    }

    /// Where the value of cell `n` is, and those of its neighbours below and above along x, y and z.
    #[inline(always)]
    pub fn neighbours(&self, n: usize) -> (usize, [usize; 3], [usize; 3]) {
        let at = self.at as usize + n;
        let [[y_below, y_above], [z_below, z_above]] = [self.y, self.z].map(|rows| rows.map(|row| row as usize + n));
        (at, [at - 1, y_below, z_below], [at + 1, y_above, z_above])
    }
}

/// The values that one thread writes, and the runs among them.
#[derive(Clone, Debug)]
struct Chunk {
    runs: Range<usize>,
    values: Range<usize>,
}

/// A set of active cells inside the rows that store them.
#[derive(Clone, Debug)]
pub struct Stencil {
    rows: CellRows,
    active: CellRows,
    runs: Vec<Run>,
    chunks: Vec<Chunk>,
}

/// Stored cells that one thread works through.
const CHUNK: usize = 8192;

impl Stencil {
    /// The cells `active`, stored with all cells at most `halo` ≥ 1 away.
    pub fn around(active: CellRows, halo: i32) -> Self {
        Self::within(active.dilated(halo.max(1)), active)
    }

    /// The cells `active` of `rows`.
    ///
    /// # Panics
    /// Where a neighbour of an active cell is not stored.
    pub fn within(rows: CellRows, active: CellRows) -> Self {
        let runs = runs(&rows, &active);
        let chunks = chunks(&rows, &runs);
        Self { rows, active, runs, chunks }
    }

    /// The stored cells: fields have one value for each.
    pub fn rows(&self) -> &CellRows {
        &self.rows
    }

    /// The active cells.
    pub fn active(&self) -> &CellRows {
        &self.active
    }

    /// All runs, in the order of fields.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Calls `f` with the runs of each chunk, where the first of its values is in the fields, and its part of each field
    /// of `out`; in parallel.
    pub fn update<T: Send, const N: usize>(&self, out: [&mut [T]; N], f: impl Fn(&[Run], usize, [&mut [T]; N]) + Sync) {
        self.update_and_fold(out, f);
    }

    /// The same; what `f` makes of each chunk, in the order of fields.
    pub fn update_and_fold<T: Send, R: Send, const N: usize>(
        &self,
        out: [&mut [T]; N],
        f: impl Fn(&[Run], usize, [&mut [T]; N]) -> R + Sync,
    ) -> Vec<R> {
        if let [chunk] = &self.chunks[..] {
            return vec![f(&self.runs[chunk.runs.clone()], 0, out)];
        }
        let mut rest = out;
        let parts: Vec<_> = self
            .chunks
            .iter()
            .map(|chunk| {
                let part = rest.each_mut().map(|field| {
                    let (part, after) = take(field).split_at_mut(chunk.values.len());
                    *field = after;
                    part
                });
                (chunk, part)
            })
            .collect();
        parallel::map(parts, |_, (chunk, part)| f(&self.runs[chunk.runs.clone()], chunk.values.start, part))
    }

    /// What `f` makes of the runs of each chunk, in the order of fields.
    pub fn fold<R: Send>(&self, f: impl Fn(&[Run]) -> R + Sync) -> Vec<R> {
        parallel::map(&self.chunks, |_, chunk| f(&self.runs[chunk.runs.clone()]))
    }
}

/// Only the cells are kept: the runs follow from them.
impl Serialize for Stencil {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (&self.rows, &self.active).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Stencil {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (rows, active) = Deserialize::deserialize(deserializer)?;
        Ok(Self::within(rows, active))
    }
}

/// Cuts the spans of active cells wherever a neighbouring row's spans begin or end.
fn runs(rows: &CellRows, active: &CellRows) -> Vec<Run> {
    let mut out = Vec::new();
    for ([y, z], spans) in active.rows() {
        let near = [rows.row(y, z), rows.row(y - 1, z), rows.row(y + 1, z), rows.row(y, z - 1), rows.row(y, z + 1)];
        let mut next = [0; 5];
        for span in spans {
            let mut x = span.start;
            while x < span.end {
                let found: [RowSpan; 5] = std::array::from_fn(|row| {
                    while near[row][next[row]].end <= x {
                        next[row] += 1;
                    }
                    near[row][next[row]]
                });
                let own = found[0];
                assert!(own.start < x && span.end < own.end, "an active cell at the end of a stored span");
                assert!(found.iter().all(|other| other.start <= x), "a neighbour of an active cell is not stored");
                let end = found[1..].iter().fold(span.end, |end, other| min(end, other.end));
                let at = |row: usize| found[row].at(x) as u32;
                let (len, cell) = ((end - x) as u32, [x, y, z]);
                out.push(Run { at: at(0), len, cell, y: [at(1), at(2)], z: [at(3), at(4)] });
                x = end;
            }
        }
    }
    out
}

/// Cuts the fields between runs into pieces of about [`CHUNK`] values.
fn chunks(rows: &CellRows, runs: &[Run]) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    let (mut first, mut start) = (0, 0);
    for (number, run) in runs.iter().enumerate() {
        if run.at as usize - start > CHUNK {
            chunks.push(Chunk { runs: first..number, values: start..run.at as usize });
            (first, start) = (number, run.at as usize);
        }
    }
    chunks.push(Chunk { runs: first..runs.len(), values: start..rows.len() });
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_reach_every_active_cell_and_its_neighbours() {
        let inside = |[x, y, z]: [i32; 3]| (x - 20).pow(2) + (y + z).pow(2) < 300 && (x * 7 + y * 3 + z) % 11 != 0;
        let active = CellRows::cuboid([0, -20, -20], [50, 20, 20]).filtered(|cell, _| inside(cell));
        let stencil = Stencil::around(active.clone(), 1);
        let rows = stencil.rows();
        let mut cells = active.iter();
        for run in stencil.runs() {
            for n in 0..run.len {
                let [x, y, z] = cells.next().unwrap();
                let at = run.at + n;
                assert_eq!([run.cell[0] + n as i32, run.cell[1], run.cell[2]], [x, y, z]);
                let near = [
                    [x, y, z],
                    [x - 1, y, z],
                    [x + 1, y, z],
                    [x, y - 1, z],
                    [x, y + 1, z],
                    [x, y, z - 1],
                    [x, y, z + 1],
                ];
                let (own, below, above) = run.neighbours(n as usize);
                assert_eq!(own, at as usize);
                let expected = [own, below[0], above[0], below[1], above[1], below[2], above[2]];
                assert_eq!(near.map(|cell| rows.find(cell)), expected.map(Some));
            }
        }
        assert_eq!(cells.next(), None);
    }

    #[test]
    fn chunks_write_each_value_once() {
        let stencil = Stencil::around(CellRows::cuboid([0; 3], [40, 50, 60]), 1);
        assert!(stencil.chunks.len() > 10);
        let mut fields = [vec![0_u32; stencil.rows().len()], vec![0; stencil.rows().len()]];
        let [a, b] = &mut fields;
        stencil.update([a, b], |runs, first, [a, b]| {
            for run in runs {
                for at in run.range() {
                    a[at - first] += 1;
                    b[at - first] += at as u32;
                }
            }
        });
        for (at, cell) in stencil.rows().iter().enumerate() {
            let active = u32::from(stencil.active().find(cell).is_some());
            assert_eq!((fields[0][at], fields[1][at]), (active, active * at as u32));
        }
    }
}
