//! A liquid on the solver's cells as a volume, and a volume's level set as the kernel reads it.

use engine::geometry::Grid;
use engine::prelude::*;
use liquid::level_set::PhiView;
use liquid::rows::{Cell, CellRows};
use liquid::velocity::MacVelocity;
use numerics::sparse_field::{BLOCK_EDGE, FieldBlock, SparseField, SparseFieldError};

/// Where cells lie: the corner of cell [0, 0, 0] and the side of a cell, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    pub(crate) origin: [f64; 3],
    pub(crate) cell: f64,
}

impl Lattice {
    /// A point in cells.
    pub(crate) fn in_cells(&self, point: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|k| ((f64::from(point[k]) - self.origin[k]) / self.cell) as f32)
    }

    /// A place in cells in metres.
    pub(crate) fn in_metres(&self, place: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|k| (self.origin[k] + self.cell * f64::from(place[k])) as f32)
    }

    /// The lattice whose cells are `by` times smaller.
    pub(crate) fn refined(&self, by: u32) -> Self {
        Self { origin: self.origin, cell: self.cell / f64::from(by) }
    }

    /// The grid of the cells `low` ≤ cell < `high`.
    fn grid(&self, [low, high]: [Cell; 2]) -> Grid {
        Grid {
            origin: [0, 1, 2].map(|k| (self.origin[k] + self.cell * f64::from(low[k])) as f32),
            cell: self.cell as f32,
            size: size(low, high),
        }
    }
}

fn size(low: Cell, high: Cell) -> [u32; 3] {
    [0, 1, 2].map(|k| high[k].saturating_sub(low[k]).max(0) as u32)
}

/// The volume of a level set and a velocity, each on the smallest box of its own cells that holds it. The velocity is
/// multiplied by `pace`.
///
/// # Errors
/// Where a box is too long for a volume.
pub(crate) fn volume(
    level_set: PhiView<'_>,
    level_lattice: Lattice,
    velocity: &MacVelocity,
    pace: f32,
    bounds: [Cell; 2],
    lattice: Lattice,
) -> Result<Volume> {
    let (cell, outside) = (level_lattice.cell as f32, level_set.outside);
    let within = boxed(level_set.rows, [level_set.low, level_set.high]);
    let background = outside * cell;
    let phi = field(level_set.rows, level_set.phi, within, [0; 3], background, |phi| phi * cell)?;
    let moving = boxed(velocity.rows(), bounds);
    let face = |axis: usize| {
        let beyond = [0, 1, 2].map(|k| i32::from(k == axis));
        field(velocity.rows(), &velocity.faces()[axis], moving, beyond, 0.0, |u| pace * u)
    };
    let faces = [face(0)?, face(1)?, face(2)?];
    Ok(Volume::from_fields(level_lattice.grid(within), phi, lattice.grid(moving), faces)?)
}

/// The smallest box within `bounds` that holds the cells.
fn boxed(rows: &CellRows, [low, high]: [Cell; 2]) -> [Cell; 2] {
    match rows.clipped(low, high).bounds() {
        Some((low, high)) => [low, high],
        None => [low, low],
    }
}

/// The field of a box, `beyond` nodes longer, with what `change` makes of the values of its cells.
fn field(
    rows: &CellRows,
    values: &[f32],
    [low, high]: [Cell; 2],
    beyond: Cell,
    background: f32,
    change: impl Fn(f32) -> f32 + Sync,
) -> Result<SparseField> {
    let high = [0, 1, 2].map(|k| if high[k] > low[k] { high[k] + beyond[k] } else { high[k] });
    let mut size = size(low, high);
    if size.contains(&0) {
        // An empty box has no cells, but faces across one side.
        size = [0, 1, 2].map(|k| beyond[k] as u32);
    }
    let edge = BLOCK_EDGE as i32;
    let is_within = |axis: usize, at: i32| low[axis] <= at && at < high[axis];
    let spans = rows.spans().filter(|([y, z], _)| is_within(1, *y) && is_within(2, *z));
    let blocks = spans.flat_map(|([y, z], span)| {
        let (start, end) = (span.start.max(low[0]) - low[0], span.end.min(high[0]) - low[0]);
        let first = start.div_euclid(edge);
        let count = if start < end { (end - 1).div_euclid(edge) + 1 - first } else { 0 };
        let [y, z] = [y - low[1], z - low[2]].map(|x| (x / edge) as u32);
        (0..count).map(move |n| [(first + n) as u32, y, z])
    });
    let fill = |block: [u32; 3], out: &mut FieldBlock| {
        let first = [0, 1, 2].map(|k| low[k] + edge * block[k] as i32);
        for row in 0..edge * edge {
            let (y, z) = (row % edge, row / edge);
            for span in rows.row(first[1] + y, first[2] + z) {
                for x in span.start.max(first[0])..span.end.min(first[0] + edge) {
                    out[(x - first[0] + edge * row) as usize] = change(values[span.at(x)]);
                }
            }
        }
    };
    SparseField::from_blocks(size, background, blocks, fill).map_err(too_long)
}

fn too_long(error: SparseFieldError) -> Error {
    Error::refused(format!("the liquid is too large for a volume: {error}"))
        .hint("use larger cells, or a smaller domain")
}

/// The level set of a volume in the cells of its own grid, the first of which is [0, 0, 0].
pub(crate) struct VolumeLevelSet {
    rows: CellRows,
    phi: Vec<f32>,
    outside: f32,
    size: [u32; 3],
}

impl VolumeLevelSet {
    pub(crate) fn new(volume: &Volume) -> Self {
        let (field, cell) = (volume.level_set(), volume.level_grid().cell);
        let blocks: Vec<([u32; 3], &FieldBlock)> = field.blocks().collect();
        let (edge, size, background) = (BLOCK_EDGE, field.size(), field.background());
        // Blocks ascend with z, then y, then x.
        let row_of = |y: u32, z: u32| {
            let key = [z / edge, y / edge];
            let first = blocks.partition_point(|([_, y, z], _)| [*z, *y] < key);
            let count = blocks[first..].partition_point(|([_, y, z], _)| [*z, *y] == key);
            &blocks[first..first + count]
        };
        let at = |x: u32, y: u32, z: u32| (x % edge + edge * (y % edge + edge * (z % edge))) as usize;
        let (ny, nz) = (size[1] as i32, size[2] as i32);
        let rows = CellRows::from_ranges([0, 0], [ny, nz], |y, z, out| {
            let (y, z) = (y as u32, z as u32);
            for ([block, _, _], values) in row_of(y, z) {
                let stored =
                    (edge * block..size[0].min(edge * (block + 1))).filter(|x| values[at(*x, y, z)] != background);
                out.extend(stored.map(|x| x as i32..x as i32 + 1));
            }
        });
        let phi = rows.tabulate(|cell_at| {
            let [x, y, z] = cell_at.map(|x| x as u32);
            let row = row_of(y, z);
            let block = row.partition_point(|([block, _, _], _)| *block < x / edge);
            row[block].1[at(x, y, z)] / cell
        });
        Self { rows, phi, outside: background / cell, size }
    }

    pub(crate) fn view(&self) -> PhiView<'_> {
        let high = self.size.map(|n| n as i32);
        PhiView { rows: &self.rows, phi: &self.phi, outside: self.outside, low: [0; 3], high }
    }
}
