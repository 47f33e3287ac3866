//! A level set to read, and the 4³ values around a cube of it.

use numerics::vector::Vec3;

use super::sample::floor;
use crate::level_set::cubic::{Block, cubic};
use crate::rows::{Cell, CellRows, RowSpan};

/// φ at the centres of cells, negative inside the liquid. The unit of length is the cell: cell [x, y, z] reaches from
/// there to [x + 1, y + 1, z + 1], its centre is in the middle.
#[derive(Clone, Copy, Debug)]
pub struct PhiView<'a> {
    /// The stored cells.
    pub rows: &'a CellRows,
    /// φ of each stored cell; finite.
    pub phi: &'a [f32],
    /// φ > 0 of cells that are not stored.
    pub outside: f32,
    /// The first cell of the domain; what is stored outside it does not count.
    pub low: Cell,
    /// The cell after the last of the domain.
    pub high: Cell,
}

impl PhiView<'_> {
    /// φ and its gradient at a point between centres of the domain, tricubic: it takes several times as long as
    /// [`PhiSampler`](super::PhiSampler), whose φ is too large by a sixteenth of a cell where a ball of 4 cells radius bends it.
    pub(crate) fn cubic_at(&self, point: Vec3) -> (f32, Vec3) {
        let [x, y, z] = point.map(|x| floor(x - 0.5));
        let block = RowBlocks::new(*self, y, z).at(x);
        cubic(&block, std::array::from_fn(|axis| point[axis] - 0.5 - [x, y, z][axis] as f32))
    }
}

/// The blocks around cubes of a row, for cubes whose x ascends. Cube [x, y, z] has the centres of cells [x, y, z] to
/// [x + 1, y + 1, z + 1] at its corners.
pub(crate) struct RowBlocks<'a> {
    view: PhiView<'a>,
    y: i32,
    z: i32,
    rows: [&'a [RowSpan]; 16],
    /// Whether the sixteen rows lie in the domain.
    within: bool,
}

impl<'a> RowBlocks<'a> {
    pub(crate) fn new(view: PhiView<'a>, y: i32, z: i32) -> Self {
        let rows = std::array::from_fn(|row| view.rows.row(y - 1 + row as i32 % 4, z - 1 + row as i32 / 4));
        let fits = |at: i32, axis: usize| view.low[axis] < at && at + 2 < view.high[axis];
        Self { view, y, z, rows, within: fits(y, 1) && fits(z, 2) }
    }

    /// The values around the cube at `x`, which is at least that of the call before. Beyond the domain they go on
    /// linearly.
    #[inline]
    pub(crate) fn at(&mut self, x: i32) -> Block {
        let mut block = [self.view.outside; 64];
        for (row, spans) in self.rows.iter_mut().enumerate() {
            while let Some((first, rest)) = spans.split_first()
                && first.end < x
            {
                *spans = rest;
            }
            let four = &mut block[4 * row..4 * row + 4];
            match spans.first() {
                Some(span) if span.start < x && x + 2 < span.end => {
                    let first = span.at(x - 1);
                    four.copy_from_slice(&self.view.phi[first..first + 4]);
                }
                _ => fill_gaps(self.view.phi, spans, x, four),
            }
        }
        if !(self.within && self.view.low[0] < x && x + 2 < self.view.high[0]) {
            self.extend(&mut block, x);
        }
        block
    }

    /// Overwrites what lies beyond the domain by what lies in it.
    #[cold]
    fn extend(&self, block: &mut Block, x: i32) {
        for (axis, (at, stride)) in [(x, 1), (self.y, 4), (self.z, 16)].into_iter().enumerate() {
            let first = (self.view.low[axis].saturating_sub(at - 1)).clamp(0, 3) as usize;
            let last = (self.view.high[axis].saturating_sub(at)).clamp(0, 3) as usize;
            if (first, last) == (0, 3) {
                continue;
            }
            for line in 0..16 {
                // The other two axes count lines.
                let start = match axis {
                    0 => 4 * line,
                    1 => line % 4 + 16 * (line / 4),
                    _ => line,
                };
                extend_line(block, |n| start + n * stride, first, last);
            }
        }
    }
}

fn extend_line(block: &mut Block, index: impl Fn(usize) -> usize, first: usize, last: usize) {
    let (low, high) = (block[index(first)], block[index(last)]);
    let (below, above) =
        if first < last { (low - block[index(first + 1)], high - block[index(last - 1)]) } else { (0.0, 0.0) };
    for n in 0..first {
        block[index(n)] = low + (first - n) as f32 * below;
    }
    for n in last + 1..4 {
        block[index(n)] = high + (n - last) as f32 * above;
    }
}

/// What is stored of the four cells from x − 1; spans before them are left out already.
#[cold]
fn fill_gaps(phi: &[f32], spans: &[RowSpan], x: i32, four: &mut [f32]) {
    for (n, value) in four.iter_mut().enumerate() {
        let cell = x - 1 + n as i32;
        if let Some(span) = spans.iter().take_while(|span| span.start <= cell).find(|span| cell < span.end) {
            *value = phi[span.at(cell)];
        }
    }
}
