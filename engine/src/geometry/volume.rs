//! A volume: a level set in cell centres and velocity on MAC faces of one regular grid.

use std::sync::Arc;

use super::GeometryError;
use super::column::Table;

/// A regular grid of cubic cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lowest corner of cell (0, 0, 0), metres.
    pub origin: [f32; 3],
    /// Edge of a cell, metres.
    pub cell: f32,
    /// Cells along x, y, z.
    pub size: [u32; 3],
}

impl Grid {
    /// Cells in all.
    pub fn cells(&self) -> usize {
        self.size.iter().map(|n| *n as usize).product()
    }

    /// Faces whose normal is `axis` (0 x, 1 y, 2 z): one more than the cells along it.
    pub fn faces(&self, axis: usize) -> usize {
        (0..3).map(|k| self.size[k] as usize + usize::from(k == axis)).product()
    }
}

/// Level set φ (m, negative inside) at cell centres, velocity (m/s) on MAC faces; x fastest, then y, then z.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    grid: Grid,
    level_set: Arc<Vec<f32>>,
    velocity: [Arc<Vec<f32>>; 3],
    once: Table,
}

impl Volume {
    /// A volume on `grid`.
    ///
    /// # Errors
    /// Where an array's length is not the grid's.
    pub fn new(grid: Grid, level_set: Vec<f32>, velocity: [Vec<f32>; 3]) -> Result<Self, GeometryError> {
        let lengths = [("level_set", level_set.len(), grid.cells())].into_iter().chain(
            ["velocity_x", "velocity_y", "velocity_z"]
                .into_iter()
                .enumerate()
                .map(|(axis, name)| (name, velocity[axis].len(), grid.faces(axis))),
        );
        for (name, rows, expected) in lengths {
            if rows != expected {
                return Err(GeometryError::Rows { name: name.into(), rows, expected });
            }
        }
        Ok(Self { grid, level_set: Arc::new(level_set), velocity: velocity.map(Arc::new), once: Table::new(1) })
    }

    /// This volume with every length in it, speeds included, put through `length`.
    pub(super) fn with_lengths(&self, length: impl Fn(f32) -> f32) -> Self {
        let Grid { origin, cell, size } = self.grid;
        let grid = Grid { origin: origin.map(&length), cell: length(cell), size };
        let field = |field: &Arc<Vec<f32>>| Arc::new(field.iter().copied().map(&length).collect());
        let velocity = self.velocity.each_ref().map(field);
        Self { grid, level_set: field(&self.level_set), velocity, once: self.once.clone() }
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// φ at cell centres, metres, negative inside.
    pub fn level_set(&self) -> &Arc<Vec<f32>> {
        &self.level_set
    }

    /// Velocity through the faces across x, y and z, m/s.
    pub fn velocity(&self) -> &[Arc<Vec<f32>>; 3] {
        &self.velocity
    }

    /// Attributes of the whole.
    pub fn once(&self) -> &Table {
        &self.once
    }

    /// Attributes of the whole, for writing.
    pub fn once_mut(&mut self) -> &mut Table {
        &mut self.once
    }
}
