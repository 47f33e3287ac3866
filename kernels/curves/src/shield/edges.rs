//! Neighbouring triangles: for each block of a tree, the third corner of the neighbour across each side.

use super::facing::{Facing, write_facings};
use numerics::lanes::{F32x16, Lanes, set};
use numerics::parallel;
use numerics::simd::Path;
use numerics::tree::{Block, NONE, TriangleTree};
use numerics::vector::Vec3;
use rayon::slice::ParallelSliceMut;

/// Third corners of the neighbours of a block's triangles. Side k runs from corner k to the next; a side without a neighbour has
/// its own first corner instead, which makes a triangle without area.
pub(super) type Thirds = [Lanes<3>; 3];

/// The neighbours of the triangles of a tree, one entry for each block.
pub(super) struct Edges {
    thirds: Vec<Thirds>,
    facings: Vec<Facing>,
}

/// Number of blocks in a task: some 20 µs of work.
const TASK: usize = 128;

/// One side of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    /// Its points, the lower index first.
    points: [u32; 2],
    /// Whether the triangle runs along it from the higher index to the lower.
    falls: bool,
    triangle: u32,
    side: u8,
}

/// For each side of each triangle the third point of its neighbour, or the side's own first point without one.
#[derive(Clone, Debug)]
pub struct Neighbours(Vec<[u32; 3]>);

impl Neighbours {
    /// Two triangles are neighbours where they run along the same two points in opposite directions, as consistently
    /// wound faces do; where more than two meet, they are paired in order and the rest have none. Of the points it only
    /// matters whether they are finite.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn of(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        Self(thirds(points, triangles))
    }
}

impl Edges {
    pub(super) fn of(tree: &TriangleTree, points: &[Vec3], Neighbours(thirds): &Neighbours) -> Self {
        let of_block = |block: &Block| {
            let mut third = block.corners;
            for (lane, triangle) in block.triangle.iter().enumerate().filter(|(_, triangle)| **triangle != NONE) {
                for (side, point) in thirds[*triangle as usize].iter().enumerate() {
                    set(&mut third[side], lane, points[*point as usize]);
                }
            }
            third
        };
        let (path, blocks) = (Path::chosen(), tree.blocks());
        let mut edges = Self {
            thirds: vec![[[F32x16::splat(0.0); 3]; 3]; blocks.len()],
            facings: vec![Facing::default(); blocks.len()],
        };
        let tasks = edges.thirds.chunks_mut(TASK).zip(edges.facings.chunks_mut(TASK)).zip(blocks.chunks(TASK));
        parallel::for_each(tasks, |_, ((thirds, facings), blocks)| {
            for (thirds, block) in thirds.iter_mut().zip(blocks) {
                *thirds = of_block(block);
            }
            write_facings(path, blocks, thirds, facings);
        });
        edges
    }

    #[inline(always)]
    pub(super) fn of_block(&self, block: usize) -> &Thirds {
        &self.thirds[block]
    }

    /// The same without knowing from where any block is seen from one side.
    #[cfg(test)]
    pub(super) fn without_facings(mut self) -> Self {
        for facing in &mut self.facings {
            *facing = facing.forgotten();
        }
        self
    }

    /// From where the triangles of a block are seen from one side.
    #[inline(always)]
    pub(super) fn facing(&self, block: usize) -> &Facing {
        &self.facings[block]
    }
}

fn thirds(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let finite = |point: u32| points[point as usize].iter().all(|x| x.is_finite());
    let has_sides = |[a, b, c]: [u32; 3]| a != b && b != c && c != a && finite(a) && finite(b) && finite(c);
    let mut sides: Vec<Side> = Vec::with_capacity(3 * triangles.len());
    for (triangle, corners) in triangles.iter().enumerate().filter(|(_, corners)| has_sides(**corners)) {
        for side in 0..3 {
            let (from, to) = (corners[side], corners[(side + 1) % 3]);
            let points = [from.min(to), from.max(to)];
            sides.push(Side { points, falls: from > to, triangle: triangle as u32, side: side as u8 });
        }
    }
    sides.par_sort_unstable();
    let mut thirds = triangles.to_vec();
    for same in sides.chunk_by(|a, b| a.points == b.points) {
        let (rising, falling) = same.split_at(same.partition_point(|side| !side.falls));
        for (a, b) in rising.iter().zip(falling) {
            let third = |of: &Side| triangles[of.triangle as usize][(usize::from(of.side) + 2) % 3];
            thirds[a.triangle as usize][usize::from(a.side)] = third(b);
            thirds[b.triangle as usize][usize::from(b.side)] = third(a);
        }
    }
    thirds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_has_the_third_corner_of_its_neighbour() {
        // Two triangles of a square, wound alike; then the second reversed, which leaves both without a neighbour.
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(thirds(&points, &[[0, 1, 2], [0, 2, 3]]), [[0, 1, 3], [1, 2, 3]]);
        assert_eq!(thirds(&points, &[[0, 1, 2], [0, 3, 2]]), [[0, 1, 2], [0, 3, 2]]);
        assert_eq!(thirds(&points, &[[0, 0, 2]]), [[0, 0, 2]]);
    }

    #[test]
    fn of_three_triangles_at_a_side_two_are_neighbours() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
        let thirds = thirds(&points, &[[0, 1, 2], [1, 0, 3], [1, 0, 4]]);
        assert_eq!([thirds[0][0], thirds[1][0], thirds[2][0]], [3, 2, 1]);
    }
}
