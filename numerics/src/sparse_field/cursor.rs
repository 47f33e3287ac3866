//! Reading single nodes of a sparse field, and points between nodes.

use super::{BLOCK_EDGE, FieldBlock, SparseField, key};

/// Reads a field near where it read last: the block found last is kept, so neighbours cost no search.
#[derive(Clone, Debug)]
pub struct FieldCursor<'a> {
    field: &'a SparseField,
    key: u64,
    block: Option<&'a FieldBlock>,
}

impl<'a> FieldCursor<'a> {
    pub(super) fn new(field: &'a SparseField) -> Self {
        Self { field, key: 0, block: field.find(0) }
    }

    /// The value of a node; the background outside the box.
    pub fn get(&mut self, node: [i64; 3]) -> f32 {
        if (0..3).any(|axis| node[axis] < 0 || node[axis] >= i64::from(self.field.size[axis])) {
            return self.field.background;
        }
        let node = node.map(|i| i as u32);
        let key = key(node.map(|i| i / BLOCK_EDGE));
        if key != self.key {
            (self.key, self.block) = (key, self.field.find(key));
        }
        let [x, y, z] = node.map(|i| i % BLOCK_EDGE);
        self.block.map_or(self.field.background, |block| block[(x + BLOCK_EDGE * (y + BLOCK_EDGE * z)) as usize])
    }

    /// The value at a point, in nodes from node 0: trilinear between the eight nodes around it. The background where that
    /// is far outside the box or not a number.
    pub fn sample(&mut self, point: [f64; 3]) -> f32 {
        let is_near = |axis: usize| point[axis] > -1.0 && point[axis] < f64::from(self.field.size[axis]);
        if !(0..3).all(is_near) {
            return self.field.background;
        }
        let low = point.map(|x| x.floor() as i64);
        let [u, v, w] = [0, 1, 2].map(|axis| point[axis] - low[axis] as f64);
        let mut at = |dx: i64, dy: i64, dz: i64| f64::from(self.get([low[0] + dx, low[1] + dy, low[2] + dz]));
        let mix = |a: f64, b: f64, share: f64| a * (1.0 - share) + b * share;
        let mut edge = |dy: i64, dz: i64| mix(at(0, dy, dz), at(1, dy, dz), u);
        let mut face = |dz: i64| mix(edge(0, dz), edge(1, dz), v);
        mix(face(0), face(1), w) as f32
    }
}
