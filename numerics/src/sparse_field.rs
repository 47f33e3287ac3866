//! One `f32` at each node of a box, stored in blocks of 8³ nodes where it differs from a background value.
//!
//! Promise: memory follows the stored blocks, not the box. Blocks are in the order of their nodes (x fastest, then y, then
//! z); a block that is background throughout is not stored, so equal fields have equal arrays. A clone shares both arrays
//! until one side is edited. Limit: at most 2²⁴ nodes along an axis, as many as an f32 coordinate tells apart.

use std::sync::Arc;

use crate::parallel;

mod cursor;
#[cfg(test)]
mod tests;

pub use cursor::FieldCursor;

/// Nodes along an edge of a block.
pub const BLOCK_EDGE: u32 = 8;

/// Nodes of a block.
pub const BLOCK_NODES: usize = (BLOCK_EDGE * BLOCK_EDGE * BLOCK_EDGE) as usize;

/// Blocks that a thread takes at a time.
const TASK: usize = 16;

/// Most nodes along an axis.
pub const MAX_NODES: u32 = 1 << 24;

/// Most nodes of a field whose dense form is made or read.
pub const MAX_DENSE: u64 = (1 << 31) - 1;

/// The values of a block, x fastest, then y, then z. Nodes outside the box hold the background.
pub type FieldBlock = [f32; BLOCK_NODES];

/// A field over a box of nodes `[0, size)`. Outside the stored blocks, and outside the box, it has the background value.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseField {
    size: [u32; 3],
    background: f32,
    /// Where the stored blocks lie, ascending; see [`key`].
    keys: Arc<Vec<u64>>,
    /// [`BLOCK_NODES`] values for each key.
    values: Arc<Vec<f32>>,
}

/// Why a field cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SparseFieldError {
    /// A dense array whose length is not the box's.
    #[error("{values} values for {nodes} nodes")]
    Length {
        /// Values given.
        values: usize,
        /// Nodes of the box.
        nodes: usize,
    },
    /// A box whose dense form is too large.
    #[error(
        "{} × {} × {} numbers would take {:.1} GiB, expected at most {MAX_DENSE} numbers",
        size[0], size[1], size[2], gibibytes(*size)
    )]
    TooLarge {
        /// Nodes along x, y, z.
        size: [u32; 3],
    },
    /// Too many nodes along an axis.
    #[error("{} × {} × {} numbers, expected at most {MAX_NODES} along an axis", size[0], size[1], size[2])]
    TooLong {
        /// Nodes along x, y, z.
        size: [u32; 3],
    },
    /// A block outside the box.
    #[error("block {block:?} is outside the box")]
    Outside {
        /// Position of the block, in blocks.
        block: [u32; 3],
    },
}

fn gibibytes(size: [u32; 3]) -> f64 {
    size.iter().map(|n| f64::from(*n)).product::<f64>() * 4.0 / (1_u64 << 30) as f64
}

/// Nodes of a box of that size, as a length of a dense array.
///
/// # Errors
/// Where they are more than [`MAX_DENSE`].
pub fn dense_len(size: [u32; 3]) -> Result<usize, SparseFieldError> {
    let nodes: u128 = size.iter().map(|n| u128::from(*n)).product();
    if nodes > u128::from(MAX_DENSE) { Err(SparseFieldError::TooLarge { size }) } else { Ok(nodes as usize) }
}

/// A block's position, in blocks, as a number that ascends with z, then y, then x.
fn key([x, y, z]: [u32; 3]) -> u64 {
    u64::from(x) | u64::from(y) << 21 | u64::from(z) << 42
}

/// The inverse of [`key`].
fn block_of(key: u64) -> [u32; 3] {
    [0, 21, 42].map(|shift| (key >> shift & 0x1f_ffff) as u32)
}

impl SparseField {
    /// A field that is background everywhere but in `blocks` (positions in blocks, in any order, repeats allowed).
    /// `fill` gets a block's position and its values, all background, and writes what differs; what it writes outside
    /// the box is dropped. Blocks are filled in parallel.
    ///
    /// # Errors
    /// Where the box is too long or a block lies outside it.
    pub fn from_blocks(
        size: [u32; 3],
        background: f32,
        blocks: impl IntoIterator<Item = [u32; 3]>,
        fill: impl Fn([u32; 3], &mut FieldBlock) + Sync,
    ) -> Result<Self, SparseFieldError> {
        if size.iter().any(|n| *n > MAX_NODES) {
            return Err(SparseFieldError::TooLong { size });
        }
        let mut keys = Vec::new();
        for block in blocks {
            if (0..3).any(|axis| block[axis] >= size[axis].div_ceil(BLOCK_EDGE)) {
                return Err(SparseFieldError::Outside { block });
            }
            keys.push(key(block));
        }
        keys.sort_unstable();
        keys.dedup();
        let mut values = vec![background; keys.len() * BLOCK_NODES];
        parallel::for_each(values.as_chunks_mut().0.iter_mut().zip(&keys), |_, (values, key)| {
            let block = block_of(*key);
            fill(block, values);
            clear_outside(size, background, block, values);
        });
        let mut field = Self { size, background, keys: Arc::new(keys), values: Arc::new(values) };
        field.drop_background();
        Ok(field)
    }

    /// The field of a dense array, x fastest, then y, then z.
    ///
    /// # Errors
    /// Where the array does not have one value a node, or the box is too large.
    pub fn from_dense(size: [u32; 3], background: f32, values: &[f32]) -> Result<Self, SparseFieldError> {
        let nodes = dense_len(size)?;
        if values.len() != nodes {
            return Err(SparseFieldError::Length { values: values.len(), nodes });
        }
        let blocks = if nodes == 0 { [0; 3] } else { size.map(|n| n.div_ceil(BLOCK_EDGE)) };
        let slab = |z: u32| (0..blocks[1]).flat_map(move |y| (0..blocks[0]).map(move |x| [x, y, z]));
        let is_stored = |block: &[u32; 3]| {
            let is_other = |row: &[f32]| row.iter().any(|x| x.to_bits() != background.to_bits());
            rows(size, *block).any(|(start, _, width)| is_other(&values[start..start + width]))
        };
        let stored = parallel::map(0..blocks[2], |_, z| slab(z).filter(is_stored).collect::<Vec<_>>());
        Self::from_blocks(size, background, stored.into_iter().flatten(), |block, out| {
            for (start, at, width) in rows(size, block) {
                out[at..at + width].copy_from_slice(&values[start..start + width]);
            }
        })
    }

    /// Nodes along x, y, z.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// The value where nothing is stored.
    pub fn background(&self) -> f32 {
        self.background
    }

    /// The values of all stored blocks, in the order of [`SparseField::blocks`].
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Number of stored blocks.
    pub fn block_count(&self) -> usize {
        self.keys.len()
    }

    /// The stored blocks: position, in blocks, and values; x fastest, then y, then z.
    pub fn blocks(&self) -> impl ExactSizeIterator<Item = ([u32; 3], &FieldBlock)> {
        self.keys.iter().map(|key| block_of(*key)).zip(self.values.as_chunks().0)
    }

    /// The nodes of the box that are in stored blocks, with their values, block by block.
    pub fn nodes(&self) -> impl Iterator<Item = ([u32; 3], f32)> {
        self.blocks().flat_map(|(block, values)| {
            (0..).zip(values).map(move |(at, value)| (node(block, at), *value)).filter(|(node, _)| self.contains(*node))
        })
    }

    fn contains(&self, node: [u32; 3]) -> bool {
        (0..3).all(|axis| node[axis] < self.size[axis])
    }

    /// A reader of single nodes and of points between them.
    pub fn cursor(&self) -> FieldCursor<'_> {
        FieldCursor::new(self)
    }

    fn find(&self, key: u64) -> Option<&FieldBlock> {
        self.keys.binary_search(&key).ok().map(|at| &self.values.as_chunks().0[at])
    }

    /// Every node of the box, x fastest, then y, then z.
    pub fn iter_dense(&self) -> impl Iterator<Item = f32> {
        let mut cursor = self.cursor();
        let [nx, ny, nz] = self.size.map(i64::from);
        let nodes = (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
        nodes.map(move |node| cursor.get(node))
    }

    /// Every node of the box as one array.
    ///
    /// # Errors
    /// Where the box is too large.
    pub fn to_dense(&self) -> Result<Vec<f32>, SparseFieldError> {
        let mut dense = vec![self.background; dense_len(self.size)?];
        for (block, values) in self.blocks() {
            for (start, at, width) in rows(self.size, block) {
                dense[start..start + width].copy_from_slice(&values[at..at + width]);
            }
        }
        Ok(dense)
    }

    /// Puts every value, the background too, through `change`. The array is copied first if another field shares it.
    pub fn edit(&mut self, change: impl Fn(f32) -> f32 + Sync) {
        self.background = change(self.background);
        parallel::for_each(Arc::make_mut(&mut self.values).chunks_mut(TASK * BLOCK_NODES), |_, values| {
            values.iter_mut().for_each(|value| *value = change(*value));
        });
        self.drop_background();
    }

    /// The part `[low, low + size)` of the field, as a field with `low` at its node 0.
    ///
    /// # Errors
    /// Where the part is too long.
    pub fn cropped(&self, low: [u32; 3], size: [u32; 3]) -> Result<Self, SparseFieldError> {
        let mut touched = Vec::new();
        for (block, _) in self.blocks() {
            // The blocks of the part that hold a node of this one: one or two along each axis.
            let range = |axis: usize| {
                let first = u64::from(block[axis] * BLOCK_EDGE);
                let (low, high) = (u64::from(low[axis]), u64::from(low[axis]) + u64::from(size[axis]));
                let (start, end) = (first.max(low), (first + u64::from(BLOCK_EDGE)).min(high));
                let is_empty = start >= end;
                let block = |node: u64| ((node - low) / u64::from(BLOCK_EDGE)) as u32;
                if is_empty { 0..0 } else { block(start)..block(end - 1) + 1 }
            };
            let [xs, ys, zs] = [range(0), range(1), range(2)];
            for z in zs {
                let row = |y: u32| xs.clone().map(move |x| [x, y, z]);
                touched.extend(ys.clone().flat_map(row));
            }
        }
        Self::from_blocks(size, self.background, touched, |block, out| {
            let mut cursor = self.cursor();
            for (at, value) in (0..).zip(out) {
                let node = node(block, at);
                *value = cursor.get([0, 1, 2].map(|axis| i64::from(low[axis]) + i64::from(node[axis])));
            }
        })
    }

    /// The smallest box around the stored nodes whose value `keeps`: its first node and the one past its last.
    pub fn bounds(&self, keeps: impl Fn(f32) -> bool) -> Option<[[u32; 3]; 2]> {
        self.nodes().filter(|(_, value)| keeps(*value)).fold(None, |bounds, (node, _)| {
            let [low, high] = bounds.unwrap_or([node; 2]);
            Some([[0, 1, 2].map(|k| low[k].min(node[k])), [0, 1, 2].map(|k| high[k].max(node[k] + 1))])
        })
    }

    /// Addresses and bytes of the two arrays; fields that share one have equal addresses.
    pub fn arrays(&self) -> [(usize, usize); 2] {
        [
            (Arc::as_ptr(&self.keys) as usize, self.keys.len() * size_of::<u64>()),
            (Arc::as_ptr(&self.values) as usize, self.values.len() * size_of::<f32>()),
        ]
    }

    /// Drops the blocks that are background throughout.
    fn drop_background(&mut self) {
        let background = self.background.to_bits();
        let is_stored = |block: &FieldBlock| block.iter().any(|x| x.to_bits() != background);
        let blocks = self.values.as_chunks().0;
        let stored = parallel::tabulate(blocks.len(), TASK, |n| is_stored(&blocks[n]));
        if stored.iter().all(|is_stored| *is_stored) {
            return;
        }
        // Of known length, so that no room for more is kept with them.
        let count = stored.iter().filter(|is_stored| **is_stored).count();
        let (mut keys, mut values) = (Vec::with_capacity(count), Vec::with_capacity(count * BLOCK_NODES));
        let all = self.keys.iter().zip(self.values.as_chunks::<BLOCK_NODES>().0).zip(&stored);
        for ((key, block), _) in all.filter(|(_, is_stored)| **is_stored) {
            keys.push(*key);
            values.extend_from_slice(block);
        }
        (self.keys, self.values) = (Arc::new(keys), Arc::new(values));
    }
}

/// Node number `at` of a block.
fn node(block: [u32; 3], at: u32) -> [u32; 3] {
    let within = [at % BLOCK_EDGE, at / BLOCK_EDGE % BLOCK_EDGE, at / (BLOCK_EDGE * BLOCK_EDGE)];
    [0, 1, 2].map(|axis| block[axis] * BLOCK_EDGE + within[axis])
}

/// The rows along x of a block that lie in the box: where each starts in a dense array, where in the block, its nodes.
fn rows(size: [u32; 3], block: [u32; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
    let [low, end] = [0, 1].map(|step| [0, 1, 2].map(|axis| ((block[axis] + step) * BLOCK_EDGE).min(size[axis])));
    let [nx, ny, _] = size.map(|n| n as usize);
    (low[2]..end[2]).flat_map(move |z| {
        (low[1]..end[1]).map(move |y| {
            let start = low[0] as usize + nx * (y as usize + ny * z as usize);
            let at = BLOCK_EDGE * (y % BLOCK_EDGE + BLOCK_EDGE * (z % BLOCK_EDGE));
            (start, at as usize, (end[0] - low[0]) as usize)
        })
    })
}

/// Sets the nodes of a block that lie outside the box to the background.
fn clear_outside(size: [u32; 3], background: f32, block: [u32; 3], values: &mut FieldBlock) {
    if (0..3).all(|axis| (block[axis] + 1) * BLOCK_EDGE <= size[axis]) {
        return;
    }
    for (at, value) in (0..).zip(values) {
        let node = node(block, at);
        if (0..3).any(|axis| node[axis] >= size[axis]) {
            *value = background;
        }
    }
}
