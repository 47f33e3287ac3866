//! Which of many things are connected.

use crate::rows::{CellRows, Periods, RowSpan};

/// Disjoint sets; the first of a set is its smallest member, whatever the order of joins.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    /// `n` members, each in a set of its own.
    pub(crate) fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The first member of the set of `n`.
    pub(crate) fn first(&mut self, mut n: u32) -> u32 {
        while self.0[n as usize] != n {
            let parent = self.0[n as usize];
            self.0[n as usize] = self.0[parent as usize];
            n = parent;
        }
        n
    }

    /// Makes the sets of `a` and `b` one.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

impl Sets {
    /// Cells that share a face, by the first cells of their spans.
    pub(crate) fn of_cells(cells: &CellRows, periods: Periods) -> Self {
        let mut sets = Self::new(cells.len());
        for ([y, z], spans) in cells.rows() {
            sets.join_touching(spans, cells.row(y + 1, z));
            sets.join_touching(spans, cells.row(y, z + 1));
            let Periods([nx, ny, nz]) = periods;
            if ny > 0 && y == 0 {
                sets.join_touching(spans, cells.row(ny - 1, z));
            }
            if nz > 0 && z == 0 {
                sets.join_touching(spans, cells.row(y, nz - 1));
            }
            if let Some(last) = cells.span_of([nx - 1, y, z]).filter(|_| nx > 0 && spans[0].start == 0) {
                sets.join(spans[0].base, last.base);
            }
        }
        sets
    }

    /// Joins the spans of two rows that share a face.
    fn join_touching(&mut self, spans: &[RowSpan], others: &[RowSpan]) {
        let mut next = 0;
        for span in spans {
            while next < others.len() && others[next].end <= span.start {
                next += 1;
            }
            for other in others[next..].iter().take_while(|other| other.start < span.end) {
                self.join(span.base, other.base);
            }
        }
    }
}
