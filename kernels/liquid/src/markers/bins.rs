//! Markers by the cube between eight centres of cells that they are in.

use numerics::parallel;

use super::Marker;
use crate::level_set::floor;
use crate::rows::{Cell, CellRows};

/// For each stored cell, the markers in the cube of which it is the first corner.
pub(crate) struct Bins {
    /// Where the markers of each stored cell start in `order`; then the number of all.
    pub(super) first: Vec<u32>,
    /// Markers by cell and, within one, by number.
    pub(super) order: Vec<u32>,
}

/// The cell of what is in none.
pub(crate) const NOWHERE: u32 = u32::MAX;

/// The first corner of the cube around a point; beyond the outermost centres of the domain, the nearest cube.
pub(super) fn cube(point: [f32; 3], (low, high): (Cell, Cell)) -> Cell {
    std::array::from_fn(|axis| floor(point[axis] - 0.5).clamp(low[axis], (high[axis] - 2).max(low[axis])))
}

impl Bins {
    /// The markers that `keep` keeps by number, of those in stored cubes.
    pub(super) fn new(
        rows: &CellRows,
        domain: (Cell, Cell),
        markers: &[Marker],
        keep: impl Fn(usize) -> bool + Sync,
    ) -> Self {
        let find = |n: usize| {
            let at = keep(n).then(|| rows.find(cube(markers[n].point, domain))).flatten();
            at.map_or(NOWHERE, |at| at as u32)
        };
        let cells = parallel::tabulate(markers.len(), parallel::CHUNK, find);
        Self::of_cells(&cells, rows.len())
    }

    /// What lies in each of `count` cells, where `cells` has the cell of each point, or [`NOWHERE`].
    pub(crate) fn of_cells(cells: &[u32], count: usize) -> Self {
        let mut first = vec![0_u32; count + 1];
        for cell in cells.iter().filter(|cell| **cell != NOWHERE) {
            first[*cell as usize + 1] += 1;
        }
        for cell in 1..first.len() {
            first[cell] += first[cell - 1];
        }
        let mut next = first.clone();
        let mut order = vec![0; first[count] as usize];
        for (n, cell) in cells.iter().enumerate().filter(|(_, cell)| **cell != NOWHERE) {
            let place = &mut next[*cell as usize];
            order[*place as usize] = n as u32;
            *place += 1;
        }
        Self { first, order }
    }

    /// The markers of the cubes `from` ≤ cube < `to`.
    #[inline(always)]
    pub(crate) fn of(&self, from: usize, to: usize) -> &[u32] {
        &self.order[self.first[from] as usize..self.first[to] as usize]
    }

    /// The markers of the cubes at most `ring` away from one along each axis.
    pub(crate) fn around<'a>(
        &'a self,
        rows: &'a CellRows,
        [x, y, z]: Cell,
        ring: i32,
    ) -> impl Iterator<Item = &'a u32> {
        let lines = (z - ring..=z + ring).flat_map(move |z| (y - ring..=y + ring).map(move |y| [y, z]));
        let spans = lines.flat_map(move |[y, z]| rows.row(y, z));
        let parts = spans.map(move |span| (span, span.start.max(x - ring), span.end.min(x + ring + 1)));
        parts.filter(|(_, from, to)| from < to).flat_map(|(span, from, to)| self.of(span.at(from), span.at(to - 1) + 1))
    }

    /// All markers, of cubes with at least `crowd` only `left`, evenly picked.
    pub(crate) fn thinned(&self, crowd: usize, left: usize) -> Vec<u32> {
        let mut out = Vec::with_capacity(self.order.len());
        for cell in self.first.windows(2) {
            let markers = &self.order[cell[0] as usize..cell[1] as usize];
            let count = markers.len();
            if count < crowd {
                out.extend(markers);
            } else {
                out.extend((0..left).map(|n| markers[n * count / left]));
            }
        }
        out
    }
}
