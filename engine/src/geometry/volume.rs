//! A volume: a level set at cell centres and velocity on MAC faces, each on its own regular grid and stored sparsely.

use numerics::sparse_field::{FieldCursor, SparseField, SparseFieldError};

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
    /// Number of cells.
    pub fn cells(&self) -> usize {
        count(self.size)
    }

    /// Number of faces whose normal is `axis` (0 x, 1 y, 2 z).
    pub fn faces(&self, axis: usize) -> usize {
        count(self.faces_size(axis))
    }

    /// Faces along x, y, z whose normal is `axis`: one more than the cells along that axis.
    pub fn faces_size(&self, axis: usize) -> [u32; 3] {
        [0, 1, 2].map(|k| self.size[k].saturating_add(u32::from(k == axis)))
    }

    /// Converts a point in metres to cells from the lowest corner.
    fn in_cells(&self, point: [f32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (f64::from(point[k]) - f64::from(self.origin[k])) / f64::from(self.cell))
    }

    /// The cells `[low, high)` as a grid of their own.
    fn cropped(&self, [low, high]: [[u32; 3]; 2]) -> Self {
        let at = |k: usize| f64::from(self.origin[k]) + f64::from(self.cell) * f64::from(low[k]);
        Self { origin: [0, 1, 2].map(|k| at(k) as f32), cell: self.cell, size: [0, 1, 2].map(|k| high[k] - low[k]) }
    }

    /// Checks that origin and cell size are finite and that the cell size is above 0.
    fn check(&self) -> Result<(), GeometryError> {
        let is_valid = self.cell > 0.0 && self.cell.is_finite() && self.origin.iter().all(|x| x.is_finite());
        is_valid.then_some(()).ok_or(GeometryError::Grid { origin: self.origin, cell: self.cell })
    }
}

/// The number of nodes of a box, saturating at the largest `usize`.
fn count(size: [u32; 3]) -> usize {
    size.iter().fold(1, |count: usize, n| count.saturating_mul(*n as usize))
}

/// The names of a volume's fields in files and messages.
pub const VOLUME_FIELDS: [&str; 4] = ["level_set", "velocity_x", "velocity_y", "velocity_z"];

/// Level set φ (m, negative inside) at the cell centres of one grid, velocity (m/s) on the MAC faces of another.
///
/// Both are sparse. Where nothing is stored, φ has a positive background value, which means outside and at least the
/// band width away, and velocity is zero. A clone shares every array.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    level_grid: Grid,
    level_set: SparseField,
    velocity_grid: Grid,
    velocity: [SparseField; 3],
    once: Table,
}

impl Volume {
    /// A volume of dense arrays on one grid, x fastest, then y, then z. The background of the level set is
    /// [`Volume::default_background`].
    ///
    /// # Errors
    /// If the length of an array does not fit the grid, the grid is too large for dense arrays (the message contains
    /// the size in bytes), or the cell size is not above 0.
    pub fn new(grid: Grid, level_set: Vec<f32>, velocity: [Vec<f32>; 3]) -> Result<Self, GeometryError> {
        let background = Self::default_background(&grid, level_set.iter().copied());
        Self::from_dense(grid, &level_set, background, grid, velocity.each_ref().map(Vec::as_slice))
    }

    /// A volume of dense arrays on two grids, x fastest, then y, then z; `background` is φ outside the level set's grid.
    ///
    /// # Errors
    /// As for [`Volume::new`], and if `background` is not above 0.
    pub fn from_dense(
        level_grid: Grid,
        level_set: &[f32],
        background: f32,
        velocity_grid: Grid,
        velocity: [&[f32]; 3],
    ) -> Result<Self, GeometryError> {
        let field = |field: usize, size: [u32; 3], background: f32, values: &[f32]| {
            let error = |error| match error {
                SparseFieldError::Length { values, nodes } => {
                    GeometryError::Rows { name: VOLUME_FIELDS[field].into(), rows: values, expected: nodes }
                }
                error => GeometryError::Field { name: VOLUME_FIELDS[field], error },
            };
            SparseField::from_dense(size, background, values).map_err(error)
        };
        let level_set = field(0, level_grid.size, background, level_set)?;
        let [x, y, z] = velocity;
        let face = |axis: usize, values: &[f32]| field(axis + 1, velocity_grid.faces_size(axis), 0.0, values);
        let velocity = [face(0, x)?, face(1, y)?, face(2, z)?];
        Self::from_fields(level_grid, level_set, velocity_grid, velocity)
    }

    /// A volume of sparse fields: `level_set` has one node per cell of `level_grid`, `velocity` one node per face of
    /// `velocity_grid`.
    ///
    /// # Errors
    /// If the size of a field does not fit its grid, the background of the level set is not above 0 or that of a
    /// velocity is not 0, or a cell size is not above 0.
    pub fn from_fields(
        level_grid: Grid,
        level_set: SparseField,
        velocity_grid: Grid,
        velocity: [SparseField; 3],
    ) -> Result<Self, GeometryError> {
        level_grid.check()?;
        velocity_grid.check()?;
        let volume = Self { level_grid, level_set, velocity_grid, velocity, once: Table::new(1) };
        for (k, (name, field)) in volume.fields().into_iter().enumerate() {
            let expected = if k == 0 { level_grid.size } else { velocity_grid.faces_size(k - 1) };
            if field.size() != expected {
                return Err(GeometryError::FieldSize { name, size: field.size(), expected });
            }
            let background = field.background();
            let fits = if k == 0 { background > 0.0 && background.is_finite() } else { background == 0.0 };
            if !fits {
                return Err(GeometryError::Background { name, background });
            }
        }
        Ok(volume)
    }

    /// The background of a level set that does not specify one: its largest finite value, at least half a cell, so that
    /// a liquid that fills its grid ends at the border of the grid.
    pub fn default_background(grid: &Grid, level_set: impl IntoIterator<Item = f32>) -> f32 {
        let least = (0.5 * grid.cell).max(f32::from_bits(1));
        level_set.into_iter().filter(|x| x.is_finite()).fold(least, f32::max)
    }

    /// This volume with `length` applied to every length and velocity.
    pub(super) fn with_lengths(&self, length: impl Fn(f32) -> f32 + Sync) -> Self {
        let mut volume = self.clone();
        for grid in [&mut volume.level_grid, &mut volume.velocity_grid] {
            *grid = Grid { origin: grid.origin.map(&length), cell: length(grid.cell), size: grid.size };
        }
        volume.level_set.edit(&length);
        volume.velocity.iter_mut().for_each(|field| field.edit(&length));
        volume
    }

    /// The grid of the level set.
    pub fn level_grid(&self) -> Grid {
        self.level_grid
    }

    /// φ at cell centres, metres, negative inside.
    pub fn level_set(&self) -> &SparseField {
        &self.level_set
    }

    /// The grid of the velocity.
    pub fn velocity_grid(&self) -> Grid {
        self.velocity_grid
    }

    /// Velocity through the faces across x, y and z, m/s.
    pub fn velocity(&self) -> &[SparseField; 3] {
        &self.velocity
    }

    /// All fields by the names in [`VOLUME_FIELDS`].
    pub fn fields(&self) -> [(&'static str, &SparseField); 4] {
        let ([a, b, c, d], [x, y, z]) = (VOLUME_FIELDS, &self.velocity);
        [(a, &self.level_set), (b, x), (c, y), (d, z)]
    }

    /// A sampler of φ and velocity at arbitrary points.
    pub fn sampler(&self) -> VolumeSampler<'_> {
        let velocity = self.velocity.each_ref().map(SparseField::cursor);
        VolumeSampler { volume: self, level_set: self.level_set.cursor(), velocity }
    }

    /// The volume cropped to its liquid: the grid of the level set to the cells with φ below `band`, that of the
    /// velocity to the cells within `reach` of a liquid cell along each axis (both in metres). The new origins are
    /// rounded to `f32`.
    ///
    /// # Errors
    /// None for a volume whose numbers are finite.
    pub fn cropped(&self, band: f32, reach: f32) -> Result<Self, GeometryError> {
        let band = band.min(self.level_set.background());
        let cells = self.level_set.bounds(|phi| phi < band).unwrap_or_default();
        let level_grid = self.level_grid.cropped(cells);
        let level_set = self.level_set.cropped(cells[0], level_grid.size).map_err(in_field(VOLUME_FIELDS[0]))?;
        let moving = self.level_set.bounds(|phi| phi < 0.0).map_or_else(Default::default, |liquid| {
            let Grid { origin, cell, size } = self.velocity_grid;
            // The cells of the velocity grid that overlap the bounds of the liquid enlarged by `reach`.
            [0, 1].map(|end| {
                [0, 1, 2].map(|k| {
                    let edge = f64::from(self.level_grid.cell) * f64::from(liquid[end][k]);
                    let edge = f64::from(self.level_grid.origin[k]) - f64::from(origin[k]) + edge;
                    let reach = f64::from(reach) / f64::from(cell);
                    let at = edge / f64::from(cell);
                    let at = if end == 0 { (at - reach).floor() } else { (at + reach).ceil() };
                    // The conversion to u32 saturates.
                    (at as u32).min(size[k])
                })
            })
        });
        let velocity_grid = self.velocity_grid.cropped(moving);
        let face = |axis: usize| {
            let part = self.velocity[axis].cropped(moving[0], velocity_grid.faces_size(axis));
            part.map_err(in_field(VOLUME_FIELDS[axis + 1]))
        };
        let velocity = [face(0)?, face(1)?, face(2)?];
        let mut volume = Self::from_fields(level_grid, level_set, velocity_grid, velocity)?;
        volume.once = self.once.clone();
        Ok(volume)
    }

    /// Attributes of the whole volume.
    pub fn once(&self) -> &Table {
        &self.once
    }

    /// Attributes of the whole volume, for writing.
    pub fn once_mut(&mut self) -> &mut Table {
        &mut self.once
    }
}

fn in_field(name: &'static str) -> impl Fn(SparseFieldError) -> GeometryError {
    move |error| GeometryError::Field { name, error }
}

/// Samples a volume at points; fast if each point is near the previous one.
#[derive(Clone, Debug)]
pub struct VolumeSampler<'a> {
    volume: &'a Volume,
    level_set: FieldCursor<'a>,
    velocity: [FieldCursor<'a>; 3],
}

impl VolumeSampler<'_> {
    /// φ at a point (metres), trilinear between cell centres; the background outside.
    pub fn level_set(&mut self, point: [f32; 3]) -> f32 {
        self.level_set.sample(self.volume.level_grid.in_cells(point).map(|x| x - 0.5))
    }

    /// Velocity at a point (metres), m/s: each component trilinear between its own faces; zero outside.
    pub fn velocity(&mut self, point: [f32; 3]) -> [f32; 3] {
        let at = self.volume.velocity_grid.in_cells(point);
        [0, 1, 2].map(|axis| self.velocity[axis].sample([0, 1, 2].map(|k| if k == axis { at[k] } else { at[k] - 0.5 })))
    }
}

#[cfg(test)]
mod tests;
