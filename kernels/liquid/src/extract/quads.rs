//! A quad across every edge between a cell inside and a cell outside.

use super::cubes::{Cube, Cubes};
use super::table::table;
use crate::rows::Cell;

/// The quads of the edges that start at the first corners of a slab's cubes, counter-clockwise seen from outside, and what
/// `of` makes of the cells inside and outside that each separates.
pub(super) fn quads<T>(cubes: &Cubes, slab: usize, of: impl Fn(Cell, Cell) -> T) -> (Vec<[u32; 4]>, Vec<T>) {
    let z = cubes.low[1] + slab as i32;
    let (mut out, mut made) = (Vec::with_capacity(cubes.slabs[slab].vertices.len()), Vec::new());
    for (y, row) in cubes.rows(slab) {
        let mut near = Near::new([row, cubes.row(y - 1, z), cubes.row(y, z - 1), cubes.row(y - 1, z - 1)]);
        for cube in row {
            near.advance(cube.x);
            for axis in 0..3 {
                let inside = cube.inside(0);
                if inside != cube.inside(1 << axis) {
                    let [a, b, c, d] = near.around(axis);
                    let first = [cube.x, y, z];
                    let mut second = first;
                    second[axis] += 1;
                    out.push(if inside { [a, b, c, d] } else { [d, c, b, a] });
                    made.push(if inside { of(first, second) } else { of(second, first) });
                }
            }
        }
    }
    (out, made)
}

/// The cubes around those of a row: in the row itself, one before along y, along z, and along both.
struct Near<'a> {
    rows: [&'a [Cube]; 4],
    next: [usize; 4],
    x: i32,
}

impl<'a> Near<'a> {
    fn new(rows: [&'a [Cube]; 4]) -> Self {
        Self { rows, next: [0; 4], x: i32::MIN }
    }

    fn advance(&mut self, x: i32) {
        self.x = x;
        for (row, next) in self.rows.iter().zip(&mut self.next) {
            while row.get(*next).is_some_and(|cube| cube.x < x) {
                *next += 1;
            }
        }
    }

    /// The vertices around the edge along `axis`, counter-clockwise seen from its end.
    #[inline]
    fn around(&self, axis: usize) -> [u32; 4] {
        [[1, 1], [0, 1], [0, 0], [1, 0]].map(|[b, c]| {
            let mut before = [0; 3];
            before[(axis + 1) % 3] = b;
            before[(axis + 2) % 3] = c;
            let row = before[1] + 2 * before[2];
            let cube = self.rows[row][self.next[row] - before[0]];
            debug_assert_eq!(cube.x, self.x - before[0] as i32);
            cube.vertex + table().loops[usize::from(cube.kind)].through(4 * axis + b + 2 * c)
        })
    }
}
