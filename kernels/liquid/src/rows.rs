//! Which cells of a lattice are stored: rows along x, each a list of spans, without gaps in the arrays.
//!
//! Promise: memory and time follow the cells, not the box in which they are looked for: 4 bytes for each row of the
//! smallest box that holds them, and 12 bytes a span besides the values. A field on the rows is a plain slice with one value a cell, in the order of z, then y, then x, so
//! loops along a span have unit stride.

use std::cmp::{max, min};
use std::mem::take;
use std::ops::Range;

use numerics::parallel;
use serde::{Deserialize, Serialize};

mod bits;
mod periods;
#[cfg(test)]
mod tests;

pub use periods::{Images, Periods};

/// A cell: its number along x, y and z.
pub type Cell = [i32; 3];

/// Cells next to each other along x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowSpan {
    /// The first cell.
    pub start: i32,
    /// The cell after the last.
    pub end: i32,
    /// Where the value of the first cell is in a field.
    pub base: u32,
}

impl RowSpan {
    /// Where the value of the cell `x` is.
    pub fn at(&self, x: i32) -> usize {
        self.base as usize + (x - self.start) as usize
    }

    /// Number of cells.
    #[expect(clippy::len_without_is_empty, reason = "a span always has a cell")]
    pub fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    fn contains(&self, x: i32) -> bool {
        self.start <= x && x < self.end
    }
}

/// The longest row, in cells, that is put together from bits: an eighth of a byte meanwhile for each cell of the smallest box.
const MOST_BITS: i64 = 512;

/// Cells that one thread tabulates, about.
const TABULATED: usize = 4096;

/// Cells that one thread copies, about.
const COPIED: usize = 32_768;

/// A set of cells. Spans of a row ascend and do not touch. The first and the last row along y and along z have cells.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CellRows {
    /// y and z of the first row.
    low: [i32; 2],
    /// Rows along y and z.
    size: [i32; 2],
    /// For each row, its first span; then the number of all spans.
    first: Vec<u32>,
    spans: Vec<RowSpan>,
    cells: usize,
}

/// A span with the y and z of its row.
pub type PlacedSpan = ([i32; 2], RowSpan);

/// For each z, the number of spans of each row along y, and the spans.
type Slices = [(Vec<u32>, Vec<Range<i32>>)];

/// The rows along y and along z outside which there are no spans; `None` where there is none.
fn filled(slices: &Slices) -> Option<(Range<usize>, Range<usize>)> {
    let has_spans = |(_, spans): &(_, Vec<_>)| !spans.is_empty();
    let (first, last) = (slices.iter().position(has_spans)?, slices.iter().rposition(has_spans)?);
    let (mut start, mut end) = (usize::MAX, 0);
    for (counts, _) in &slices[first..=last] {
        // Only rows that can widen the range are looked at.
        start = min(start, counts.iter().take(start).position(|n| *n > 0).unwrap_or(start));
        end = max(end, counts.iter().skip(end).rposition(|n| *n > 0).map_or(end, |y| end + y + 1));
    }
    Some((start..end, first..last + 1))
}

/// What pushes the cells of row (y, z), as half-open ranges of x.
type RowFill<'a> = dyn Fn(i32, i32, &mut Vec<Range<i32>>) + Sync + 'a;

impl CellRows {
    /// The cells that `fill` pushes, as half-open ranges of x in any order, for each row (y, z) of the box. Rows are
    /// filled in parallel.
    ///
    /// # Panics
    /// Where the cells are more than a `u32` counts.
    pub fn from_ranges(low: [i32; 2], size: [i32; 2], fill: impl Fn(i32, i32, &mut Vec<Range<i32>>) + Sync) -> Self {
        Self::from_filled(low, size, &fill)
    }

    /// Not generic: compiled once.
    fn from_filled(low: [i32; 2], size: [i32; 2], fill: &RowFill<'_>) -> Self {
        let size = size.map(|n| max(n, 0));
        let slices = parallel::map(low[1]..low[1] + size[1], |_, z| {
            let (mut counts, mut spans, mut row) = (Vec::with_capacity(size[0] as usize), Vec::new(), Vec::new());
            for y in low[0]..low[0] + size[0] {
                row.clear();
                fill(y, z, &mut row);
                let before = spans.len();
                join(&mut row, &mut spans);
                counts.push((spans.len() - before) as u32);
            }
            (counts, spans)
        });
        let Some((ys, zs)) = filled(&slices) else { return Self::default() };
        let low = [low[0] + ys.start as i32, low[1] + zs.start as i32];
        let mut rows = Self { low, size: [ys.len() as i32, zs.len() as i32], first: vec![0], ..Self::default() };
        // Rows outside have no spans.
        for (counts, spans) in slices.into_iter().skip(zs.start).take(zs.len()) {
            for count in &counts[ys.clone()] {
                let last = rows.first[rows.first.len() - 1];
                rows.first.push(last + count);
            }
            for Range { start, end } in spans {
                let base = u32::try_from(rows.cells).expect("more cells than a u32 counts");
                rows.spans.push(RowSpan { start, end, base });
                rows.cells += (end - start) as usize;
            }
        }
        rows
    }

    /// The cells of a list, in any order, repeats allowed.
    pub fn from_cells(cells: &[Cell]) -> Self {
        let mut sorted: Vec<_> = cells.iter().map(|[x, y, z]| (*z, *y, *x)).collect();
        sorted.sort_unstable();
        let Some(((z0, ..), (z1, ..))) = sorted.first().zip(sorted.last()) else { return Self::default() };
        let (y0, y1) = sorted.iter().fold((i32::MAX, i32::MIN), |(low, high), (_, y, _)| (min(low, *y), max(high, *y)));
        Self::from_ranges([y0, *z0], [y1 - y0 + 1, z1 - z0 + 1], |y, z, out| {
            let start = sorted.partition_point(|cell| *cell < (z, y, i32::MIN));
            let row = sorted[start..].iter().take_while(|cell| (cell.0, cell.1) == (z, y));
            out.extend(row.map(|(.., x)| *x..*x + 1));
        })
    }

    /// All cells with `low` ≤ cell < `high`.
    pub fn cuboid(low: Cell, high: Cell) -> Self {
        let size = [high[1] - low[1], high[2] - low[2]];
        Self::from_ranges([low[1], low[2]], size, |_, _, out| out.push(low[0]..high[0]))
    }

    /// Number of cells, and length of a field.
    pub fn len(&self) -> usize {
        self.cells
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.cells == 0
    }

    /// The spans of a row, ascending.
    pub fn row(&self, y: i32, z: i32) -> &[RowSpan] {
        // Numbers below 0 become huge.
        let from = |low: i32, n: i32| (i64::from(n) - i64::from(low)) as u64;
        let [j, k] = [from(self.low[0], y), from(self.low[1], z)];
        let [rows, layers] = self.size.map(|n| n as u64);
        if j < rows && k < layers { self.row_numbered((j + k * rows) as usize) } else { &[] }
    }

    /// The spans of a row, given its number among all rows.
    #[inline(always)]
    fn row_numbered(&self, number: usize) -> &[RowSpan] {
        let ends = &self.first[number..number + 2];
        &self.spans[ends[0] as usize..ends[1] as usize]
    }

    /// Where the value of a cell is; `None` where it is not stored.
    pub fn find(&self, cell: Cell) -> Option<usize> {
        self.span_of(cell).map(|span| span.at(cell[0]))
    }

    /// The span that holds a cell.
    pub fn span_of(&self, [x, y, z]: Cell) -> Option<&RowSpan> {
        let row = self.row(y, z);
        row.get(row.partition_point(|span| span.end <= x)).filter(|span| span.contains(x))
    }

    /// The span that holds a cell, or the gap between spans that does, which is [`NOWHERE`].
    fn span_or_gap(&self, [x, y, z]: Cell) -> RowSpan {
        let row = self.row(y, z);
        let after = row.partition_point(|span| span.end <= x);
        match row.get(after) {
            Some(span) if span.start <= x => *span,
            next => {
                let start = if after > 0 { row[after - 1].end } else { i32::MIN };
                RowSpan { start, end: next.map_or(i32::MAX, |next| next.start), base: NOWHERE }
            }
        }
    }

    /// The rows that hold cells, with y and z, in the order of fields.
    pub fn rows(&self) -> impl Iterator<Item = ([i32; 2], &[RowSpan])> {
        self.rows_of(0..self.size[1])
    }

    /// Those of some layers along z, counted from the first.
    fn rows_of(&self, layers: Range<i32>) -> impl Iterator<Item = ([i32; 2], &[RowSpan])> {
        let ny = self.size[0];
        let rows = layers.flat_map(move |k| (0..ny).map(move |j| (j, k, j as usize + k as usize * ny as usize)));
        let spans = rows.map(|(j, k, number)| ([self.low[0] + j, self.low[1] + k], self.row_numbered(number)));
        spans.filter(|(_, spans)| !spans.is_empty())
    }

    /// The spans with the y and z of their row, in the order of fields.
    pub fn spans(&self) -> impl Iterator<Item = PlacedSpan> {
        self.rows().flat_map(|(row, spans)| spans.iter().map(move |span| (row, *span)))
    }

    /// All cells, in the order of fields.
    pub fn iter(&self) -> impl Iterator<Item = Cell> {
        self.spans().flat_map(|([y, z], span)| (span.start..span.end).map(move |x| [x, y, z]))
    }

    /// The smallest box, low corner and high, that holds every cell: low ≤ cell < high. `None` where there is no cell.
    pub fn bounds(&self) -> Option<(Cell, Cell)> {
        let mut bounds: Option<(Cell, Cell)> = None;
        for ([y, z], spans) in self.rows() {
            let (low, high) = bounds.unwrap_or(([i32::MAX; 3], [i32::MIN; 3]));
            let (x0, x1) = (spans[0].start, spans[spans.len() - 1].end);
            bounds = Some((
                [min(low[0], x0), min(low[1], y), min(low[2], z)],
                [max(high[0], x1), max(high[1], y + 1), max(high[2], z + 1)],
            ));
        }
        bounds
    }

    /// The cells that `keep` keeps; it gets each cell and where its value is.
    pub fn filtered(&self, keep: impl Fn(Cell, usize) -> bool + Sync) -> Self {
        Self::from_ranges(self.low, self.size, |y, z, out| {
            for span in self.row(y, z) {
                let mut x = span.start;
                while x < span.end {
                    let start = x;
                    while x < span.end && keep([x, y, z], span.at(x)) {
                        x += 1;
                    }
                    if x > start {
                        out.push(start..x);
                    }
                    x += 1;
                }
            }
        })
    }

    /// The cells of either set.
    pub fn union(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if self.is_empty() { other.clone() } else { self.clone() };
        }
        let low = [0, 1].map(|axis| min(self.low[axis], other.low[axis]));
        let end = |rows: &Self, axis: usize| rows.low[axis] + rows.size[axis];
        let size = [0, 1].map(|axis| max(end(self, axis), end(other, axis)) - low[axis]);
        Self::from_ranges(low, size, |y, z, out| out.extend(self.row(y, z).iter().chain(other.row(y, z)).map(range)))
    }

    /// All cells at most `by` cells away along every axis.
    pub fn dilated(&self, by: i32) -> Self {
        self.dilated_within(by, [i32::MIN; 3], [i32::MAX; 3])
    }

    /// Those of them inside the box `low` ≤ cell < `high`; none outside it is made meanwhile.
    pub fn dilated_within(&self, by: i32, low: Cell, high: Cell) -> Self {
        let Some((first, last)) = self.bounds() else { return Self::default() };
        let (low, high) = (
            [0, 1, 2].map(|axis| max(first[axis].saturating_sub(by), low[axis])),
            [0, 1, 2].map(|axis| min(last[axis].saturating_add(by), high[axis])),
        );
        if (0..3).any(|axis| low[axis] >= high[axis]) {
            return Self::default();
        }
        if i64::from(high[0]) - i64::from(low[0]) <= MOST_BITS {
            return bits::dilated(self, by, low, high);
        }
        let first = [0, 1].map(|axis| max(self.low[axis] - by, low[axis + 1]));
        let end = [0, 1].map(|axis| min(self.low[axis] + self.size[axis] + by, high[axis + 1]));
        let along_xy = Self::from_ranges([first[0], self.low[1]], [end[0] - first[0], self.size[1]], |y, z, out| {
            let rows = (y - by..=y + by).flat_map(|y| self.row(y, z));
            out.extend(rows.map(|span| max(span.start - by, low[0])..min(span.end + by, high[0])));
        });
        Self::from_ranges(first, [end[0] - first[0], end[1] - first[1]], |y, z, out| {
            out.extend((z - by..=z + by).flat_map(|z| along_xy.row(y, z)).map(range));
        })
    }

    /// All cells inside the box `low` ≤ cell < `high` whose distance from one of these in the box is at most `by` cells, and
    /// few farther ones: a cube around each cell, grown by neighbours across faces for the rest of the way. Around a single cell it
    /// holds two thirds of the cells of [`Self::dilated_within`].
    pub fn rounded_within(&self, by: i32, low: Cell, high: Cell) -> Self {
        // A ball fits into a cube of √2 − 1 times its radius and an octahedron of the rest.
        let cube = (0.41422 * by as f32).ceil() as i32;
        let mut rows = self.clipped(low, high).dilated_within(cube, low, high);
        for _ in cube..by {
            rows = rows.with_neighbours(low, high);
        }
        rows
    }

    /// These cells and those across their faces, inside a box.
    fn with_neighbours(&self, low: Cell, high: Cell) -> Self {
        let first = [0, 1].map(|axis| max(self.low[axis] - 1, low[axis + 1]));
        let end = [0, 1].map(|axis| min(self.low[axis] + self.size[axis] + 1, high[axis + 1]));
        Self::from_ranges(first, [end[0] - first[0], end[1] - first[1]], |y, z, out| {
            out.extend(self.row(y, z).iter().map(|span| max(span.start - 1, low[0])..min(span.end + 1, high[0])));
            for [y, z] in [[y - 1, z], [y + 1, z], [y, z - 1], [y, z + 1]] {
                out.extend(self.row(y, z).iter().map(|span| max(span.start, low[0])..min(span.end, high[0])));
            }
        })
    }

    /// All cells of which one at most 1 lower along every axis is in the set: the cells whose low corner touches it.
    pub fn grown_up(&self) -> Self {
        let [y0, z0] = self.low;
        let [ny, nz] = self.size;
        Self::from_ranges([y0, z0], [ny + 1, nz + 1], |y, z, out| {
            let rows = [self.row(y, z), self.row(y - 1, z), self.row(y, z - 1), self.row(y - 1, z - 1)];
            out.extend(rows.into_iter().flatten().map(|span| span.start..span.end + 1));
        })
    }

    /// The cells inside the box `low` ≤ cell < `high`.
    pub fn clipped(&self, low: Cell, high: Cell) -> Self {
        let first = [max(self.low[0], low[1]), max(self.low[1], low[2])];
        let end = [min(self.low[0] + self.size[0], high[1]), min(self.low[1] + self.size[1], high[2])];
        Self::from_ranges(first, [end[0] - first[0], end[1] - first[1]], |y, z, out| {
            let inside = |span: &RowSpan| max(span.start, low[0])..min(span.end, high[0]);
            out.extend(self.row(y, z).iter().map(inside));
        })
    }

    /// The cells of the lattice with cells twice as large that hold a cell of this one.
    pub fn halved(&self) -> Self {
        let half = |n: i32| n.div_euclid(2);
        let first = self.low.map(half);
        let end = [0, 1].map(|axis| half(self.low[axis] + self.size[axis] + 1));
        Self::from_ranges(first, [end[0] - first[0], end[1] - first[1]], |y, z, out| {
            for (y, z) in [(2 * y, 2 * z), (2 * y + 1, 2 * z), (2 * y, 2 * z + 1), (2 * y + 1, 2 * z + 1)] {
                out.extend(self.row(y, z).iter().map(|span| half(span.start)..half(span.end + 1)));
            }
        })
    }

    /// The cells `by` times smaller that fill those of this one.
    pub fn refined(&self, by: i32) -> Self {
        Self::from_ranges(self.low.map(|x| by * x), self.size.map(|n| by * n), |y, z, out| {
            let spans = self.row(y.div_euclid(by), z.div_euclid(by));
            out.extend(spans.iter().map(|span| by * span.start..by * span.end));
        })
    }

    /// Calls `copy` with where each stretch of cells that both sets hold lies in a field on these rows, in one on
    /// `other`, and its length.
    pub fn for_each_shared(&self, other: &Self, copy: impl FnMut(usize, usize, usize)) {
        self.for_each_shared_in(0..self.size[1], other, copy);
    }

    /// The same for the rows of some layers along z, counted from the first.
    fn for_each_shared_in(&self, layers: Range<i32>, other: &Self, mut copy: impl FnMut(usize, usize, usize)) {
        for ([y, z], spans) in self.rows_of(layers) {
            let others = other.row(y, z);
            let mut next = 0;
            for span in spans {
                while next < others.len() && others[next].end <= span.start {
                    next += 1;
                }
                for theirs in others[next..].iter().take_while(|theirs| theirs.start < span.end) {
                    let (start, end) = (max(span.start, theirs.start), min(span.end, theirs.end));
                    copy(span.at(start), theirs.at(start), (end - start) as usize);
                }
            }
        }
    }

    /// The field whose value in each cell is what `value` makes of it; in parallel.
    pub fn tabulate<T: Copy + Default + Send>(&self, value: impl Fn(Cell) -> T + Sync) -> Vec<T> {
        let [out] = self.tabulate_each(|cell| [value(cell)]);
        out
    }

    /// As many fields as `values` makes values of a cell; in parallel.
    pub fn tabulate_each<T: Copy + Default + Send, const N: usize>(
        &self,
        values: impl Fn(Cell) -> [T; N] + Sync,
    ) -> [Vec<T>; N] {
        self.tabulate_with(|| (), |(), cell, _| values(cell))
    }

    /// As many fields as `values` makes values of a cell; it also gets where they are stored, and what `start` makes for
    /// each stretch of cells that a thread goes through in the order of fields. In parallel.
    pub fn tabulate_with<T: Copy + Default + Send, S, const N: usize>(
        &self,
        start: impl Fn() -> S + Sync,
        values: impl Fn(&mut S, Cell, usize) -> [T; N] + Sync,
    ) -> [Vec<T>; N] {
        self.tabulate_parts(|spans, first, part| {
            let mut state = start();
            for ([y, z], span) in spans {
                for x in span.start..span.end {
                    let at = span.at(x);
                    let values = values(&mut state, [x, *y, *z], at);
                    for field in 0..N {
                        part[field][at - first] = values[field];
                    }
                }
            }
        })
    }

    /// Fields of 0 whose parts `fill` changes: it gets the spans of a part, where its first value is, and its values. In
    /// parallel.
    pub(crate) fn tabulate_parts<T: Copy + Default + Send, const N: usize>(
        &self,
        fill: impl Fn(&[PlacedSpan], usize, [&mut [T]; N]) + Sync,
    ) -> [Vec<T>; N] {
        let mut out: [Vec<T>; N] = std::array::from_fn(|_| vec![T::default(); self.len()]);
        let spans: Vec<_> = self.spans().collect();
        parallel::for_each(parts(&spans, out.each_mut().map(|field| &mut field[..])), |_, (spans, part)| {
            fill(spans, spans[0].1.base as usize, part);
        });
        out
    }

    /// What `of` makes of each of about `count` stretches of cells, in their order. In parallel.
    pub(crate) fn map_stretches<T: Send>(&self, count: usize, of: impl Fn(&[PlacedSpan]) -> T + Sync) -> Vec<T> {
        let spans: Vec<_> = self.spans().collect();
        parallel::map(stretches(&spans, self.len().div_ceil(count).max(TABULATED)), |_, spans| of(spans))
    }

    /// A field on these rows with the values of `field` on `from`, and `outside` where `from` has no cell. In parallel.
    pub fn resampled<T: Copy + Send + Sync>(&self, from: &Self, field: &[T], outside: T) -> Vec<T> {
        let mut out = vec![outside; self.len()];
        let mut rest = &mut out[..];
        let mut part = |layers: Range<i32>| {
            let first = self.start_of(layers.start);
            let (part, after) = take(&mut rest).split_at_mut(self.start_of(layers.end) - first);
            rest = after;
            (layers, first, part)
        };
        let layers = self.size[1];
        let each = (layers as usize * COPIED / self.len().max(1)).clamp(1, layers.max(1) as usize) as i32;
        let parts: Vec<_> = (0..layers).step_by(each as usize).map(|z| part(z..min(z + each, layers))).collect();
        parallel::for_each(parts, |_, (layers, first, part)| {
            self.for_each_shared_in(layers, from, |at, theirs, len| {
                part[at - first..at - first + len].copy_from_slice(&field[theirs..theirs + len]);
            });
        });
        out
    }

    /// Where the value of the first cell from a layer along z on is, layers counted from the first.
    fn start_of(&self, layer: i32) -> usize {
        let row = layer as usize * self.size[0] as usize;
        let span = self.first.get(row).and_then(|span| self.spans.get(*span as usize));
        span.map_or(self.cells, |span| span.base as usize)
    }
}

/// Stretches of about [`TABULATED`] cells, and the part of each field that belongs to them.
fn parts<'a, T, const N: usize>(
    spans: &'a [PlacedSpan],
    fields: [&'a mut [T]; N],
) -> Vec<(&'a [PlacedSpan], [&'a mut [T]; N])> {
    let mut rest = fields;
    let part = |spans: &'a [PlacedSpan]| {
        let len = spans.iter().map(|(_, span)| span.len()).sum();
        let part = rest.each_mut().map(|field| {
            let (part, after) = take(field).split_at_mut(len);
            *field = after;
            part
        });
        (spans, part)
    };
    stretches(spans, TABULATED).map(part).collect()
}

/// Stretches of spans with about `cells` cells each.
fn stretches(spans: &[PlacedSpan], cells: usize) -> impl Iterator<Item = &[PlacedSpan]> {
    spans.chunk_by(move |a, b| a.1.base as usize / cells == b.1.base as usize / cells)
}

/// Finds cells near each other faster than [`CellRows::find`]: it remembers the last span, or gap between spans, of each of 16
/// rows.
#[derive(Clone, Debug)]
pub struct Finder<'a> {
    rows: &'a CellRows,
    /// For rows with the same y and z modulo 4, the row that was looked at last, and its span or gap.
    last: [Remembered; 16],
}

/// A row, y and z, and a span of it, or a gap.
type Remembered = std::cell::Cell<([i32; 2], RowSpan)>;

/// Where the values of a gap would be: no field is that long.
const NOWHERE: u32 = u32::MAX;

impl<'a> Finder<'a> {
    /// Finds cells of these rows.
    pub fn new(rows: &'a CellRows) -> Self {
        let none = ([0; 2], RowSpan { start: 0, end: 0, base: 0 });
        Self { rows, last: std::array::from_fn(|_| Remembered::new(none)) }
    }

    /// Where the value of a cell is; `None` where it is not stored.
    #[inline(always)]
    pub fn find(&self, [x, y, z]: Cell) -> Option<usize> {
        let (row, mut span) = self.last[(y & 3 | (z & 3) << 2) as usize].get();
        if row != [y, z] || !span.contains(x) {
            span = self.look_up([x, y, z]);
        }
        (span.base != NOWHERE).then(|| span.at(x))
    }

    /// The same, where `len` cells from there along x are stored.
    #[inline(always)]
    pub(crate) fn find_run(&self, [x, y, z]: Cell, len: i32) -> Option<usize> {
        let (row, mut span) = self.last[(y & 3 | (z & 3) << 2) as usize].get();
        if row != [y, z] || !span.contains(x) {
            span = self.look_up([x, y, z]);
        }
        (span.base != NOWHERE && x + len <= span.end).then(|| span.at(x))
    }

    #[inline(never)]
    fn look_up(&self, [x, y, z]: Cell) -> RowSpan {
        let span = self.rows.span_or_gap([x, y, z]);
        self.last[(y & 3 | (z & 3) << 2) as usize].set(([y, z], span));
        span
    }
}

fn range(span: &RowSpan) -> Range<i32> {
    span.start..span.end
}

/// Sorts the ranges of a row and appends them to `spans`, those that touch as one.
fn join(row: &mut [Range<i32>], spans: &mut Vec<Range<i32>>) {
    row.sort_unstable_by_key(|range| range.start);
    let first = spans.len();
    for range in row.iter().filter(|range| range.start < range.end) {
        match spans[first..].last_mut() {
            Some(last) if range.start <= last.end => last.end = max(last.end, range.end),
            _ => spans.push(range.clone()),
        }
    }
}
