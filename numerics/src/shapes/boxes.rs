//! Shapes with straight edges.
//!
//! Points are shared along edges and at corners. Promise and limit: see [`super`].

use super::{Polygons, coordinate};

/// The faces of a box, `n` quads along x, y and z.
pub fn block(size: [f64; 3], n: [usize; 3]) -> Polygons {
    let mut block = Polygons::default();
    let rim = rim(n[0], n[2]);
    let at = |column: usize, axis: usize| coordinate(size[axis], column, n[axis]);

    let floor = sheet(&mut block, size, n, 0);
    let mut below: Vec<usize> = rim.iter().map(|at| floor(*at)).collect();
    let mut lid = None;
    for layer in 1..=n[1] {
        let above: Vec<usize> = if layer == n[1] {
            let top = sheet(&mut block, size, n, layer);
            let above = rim.iter().map(|at| top(*at)).collect();
            lid = Some(top);
            above
        } else {
            let first = block.points.len();
            block.points.extend(rim.iter().map(|[x, z]| [at(*x, 0), at(layer, 1), at(*z, 2)]));
            (first..block.points.len()).collect()
        };
        for k in 0..rim.len() {
            let next = (k + 1) % rim.len();
            block.face([below[k], below[next], above[next], above[k]]);
        }
        below = above;
    }
    for (x, z) in cells(n[0], n[2]) {
        block.face([floor([x, z]), floor([x + 1, z]), floor([x + 1, z + 1]), floor([x, z + 1])]);
        if let Some(lid) = &lid {
            block.face([lid([x, z]), lid([x, z + 1]), lid([x + 1, z + 1]), lid([x + 1, z])]);
        }
    }
    block
}

/// A flat sheet in x and z at height 0, facing up, `n` quads along each side. Open.
pub fn grid(size: [f64; 2], n: usize) -> Polygons {
    let mut grid = Polygons::default();
    let point = sheet(&mut grid, [size[0], 0.0, size[1]], [n, 1, n], 0);
    for (x, z) in cells(n, n) {
        grid.face([point([x, z]), point([x, z + 1]), point([x + 1, z + 1]), point([x + 1, z])]);
    }
    grid
}

/// Adds a layer's points, x fastest; returns the index of the point at a column and row.
fn sheet(to: &mut Polygons, size: [f64; 3], n: [usize; 3], layer: usize) -> impl Fn([usize; 2]) -> usize + use<> {
    let first = to.points.len();
    let y = coordinate(size[1], layer, n[1]);
    for z in 0..=n[2] {
        to.points.extend((0..=n[0]).map(|x| [coordinate(size[0], x, n[0]), y, coordinate(size[2], z, n[2])]));
    }
    let stride = n[0] + 1;
    move |[x, z]| first + z * stride + x
}

/// Column and row of each quad.
fn cells(columns: usize, rows: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..rows).flat_map(move |z| (0..columns).map(move |x| (x, z)))
}

/// Columns and rows around a sheet's border, counter-clockwise from above: +z side first, then +x.
fn rim(columns: usize, rows: usize) -> Vec<[usize; 2]> {
    let front = (0..columns).map(|x| [x, rows]);
    let right = (0..rows).map(|k| [columns, rows - k]);
    let back = (0..columns).map(|k| [columns - k, 0]);
    let left = (0..rows).map(|z| [0, z]);
    front.chain(right).chain(back).chain(left).collect()
}
