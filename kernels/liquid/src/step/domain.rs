//! The box that a liquid is in.

use numerics::vector::Vec3;

use crate::open_share::open_share;
use crate::rows::{Cell, CellRows};

/// What a side of the domain is to the liquid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wall {
    /// Liquid leaves through it into air of pressure 0.
    Open,
    /// A solid wall.
    #[default]
    Closed,
    /// A solid wall without friction. Without viscosity there is no difference.
    FreeSlip,
}

/// The cells `low` ≤ cell < `high`, and the walls around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    /// The first cell.
    pub low: Cell,
    /// The cell after the last.
    pub high: Cell,
    /// For x, y and z the wall at the low side and at the high side.
    pub walls: [[Wall; 2]; 3],
}

/// A signed distance at a place in cells, negative inside a solid.
pub type Solid<'a> = &'a (dyn Fn(Vec3) -> f32 + Sync);

impl Domain {
    /// A box of these cells with closed walls.
    pub fn closed(low: Cell, high: Cell) -> Self {
        Self { low, high, walls: [[Wall::Closed; 2]; 3] }
    }

    /// The corners of the box, in cells.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.low, self.high].map(|corner| corner.map(|x| x as f32))
    }

    /// Whether the cell lies in the box.
    #[inline(always)]
    pub fn contains(&self, cell: Cell) -> bool {
        (0..3).all(|axis| self.low[axis] <= cell[axis] && cell[axis] < self.high[axis])
    }

    /// The part of the rows in the box and one cell beyond each side: cells beyond hold the faces of the wall above and
    /// tangential velocity behind walls.
    pub fn clip(&self, rows: &CellRows) -> CellRows {
        rows.clipped(self.low.map(|x| x - 1), self.high.map(|x| x + 1))
    }

    /// Where the low face of a cell is a side of the box, which wall that is.
    #[inline(always)]
    pub fn wall_at(&self, axis: usize, cell: Cell) -> Option<Wall> {
        if cell[axis] == self.low[axis] {
            return Some(self.walls[axis][0]);
        }
        (cell[axis] == self.high[axis]).then_some(self.walls[axis][1])
    }

    /// The open share of the low face of each cell along each axis.
    pub fn open_shares(&self, rows: &CellRows, solid: Option<Solid<'_>>) -> [Vec<f32>; 3] {
        rows.tabulate_each(|cell| [0, 1, 2].map(|axis| self.open_share(axis, cell, solid)))
    }

    fn open_share(&self, axis: usize, cell: Cell, solid: Option<Solid<'_>>) -> f32 {
        let within = |other: usize| {
            let high = self.high[other] + i32::from(other == axis);
            self.low[other] <= cell[other] && cell[other] < high
        };
        if !(0..3).all(within) || matches!(self.wall_at(axis, cell), Some(Wall::Closed | Wall::FreeSlip)) {
            return 0.0;
        }
        let Some(solid) = solid else { return 1.0 };
        open_share([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
            let mut corner = cell;
            corner[(axis + 1) % 3] += a;
            corner[(axis + 2) % 3] += b;
            solid(corner.map(|x| x as f32))
        }))
    }
}
