//! Blocks and plates, and the springs of a block by van Gelder's formula, computed without the solver.

use std::collections::BTreeMap;

use engine::geometry::{Component, Geometry};

/// Cubes of `side`, `cells` of them along each axis from `low` on, six tets each.
pub(crate) fn block(cells: [u32; 3], side: f64, low: [f64; 3]) -> Component {
    cut(cells, side, low, |_| 0)
}

/// The same, each cube cut as the mirror image of its neighbours, so that a block with an even number of cells is
/// symmetric.
pub(crate) fn mirrored(cells: [u32; 3], side: f64, low: [f64; 3]) -> Component {
    cut(cells, side, low, |[x, y, z]| (x & 1) + 2 * (y & 1) + 4 * (z & 1))
}

/// The axes along which each cube is mirrored, one bit for each.
fn cut(cells: [u32; 3], side: f64, low: [f64; 3], turned: impl Fn([u32; 3]) -> u32) -> Component {
    let counts = cells.map(|n| n + 1);
    let (mut points, mut tets) = (Vec::new(), Vec::new());
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                points.push(std::array::from_fn(|k| (low[k] + side * f64::from([x, y, z][k])) as f32));
                if x == cells[0] || y == cells[1] || z == cells[2] {
                    continue;
                }
                let turned = turned([x, y, z]);
                let corner = |bits: u32| {
                    let bits = bits ^ turned;
                    x + (bits & 1) + counts[0] * (y + (bits >> 1 & 1) + counts[1] * (z + (bits >> 2)))
                };
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    let [a, b] = if turned.count_ones().is_multiple_of(2) { [a, b] } else { [b, a] };
                    tets.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    Component::tets(tets, points).unwrap()
}

/// The same tets with every point moved by `change`.
pub(crate) fn changed(body: &Component, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Component {
    let place = |(k, p): (usize, &[f32; 3])| change(k, p.map(f64::from)).map(|x| x as f32);
    let points = body.positions().iter().enumerate().map(place).collect();
    Component::tets(body.tet_corners().to_vec(), points).unwrap()
}

/// A box between two corners.
pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Geometry {
    let corner = |bits: usize| std::array::from_fn(|k| if bits >> k & 1 == 1 { high[k] as f32 } else { low[k] as f32 });
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Component::mesh(vec![4; 6], faces.concat(), (0..8).map(corner).collect()).unwrap().into()
}

/// A spring on an edge of tets.
pub(crate) struct Spring {
    pub(crate) ends: [usize; 2],
    /// N/m.
    pub(crate) stiffness: f64,
    /// At rest, metres.
    pub(crate) length: f64,
}

/// k = E·ΣV/L² over the tets at each edge.
pub(crate) fn springs(body: &Component, modulus: f64) -> Vec<Spring> {
    let points: Vec<[f64; 3]> = body.positions().iter().map(|p| p.map(f64::from)).collect();
    let mut volumes: BTreeMap<[usize; 2], f64> = BTreeMap::new();
    for tet in body.tet_corners() {
        let corners = tet.map(|corner| corner as usize);
        let volume = crate::measure::volume(corners.map(|corner| points[corner])).abs() / 6.0;
        for [a, b] in [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]] {
            let [a, b] = [corners[a], corners[b]];
            *volumes.entry([a.min(b), a.max(b)]).or_default() += volume;
        }
    }
    let spring = |(ends, volume): ([usize; 2], f64)| {
        let length = crate::measure::distance(&points[ends[0]], &points[ends[1]]);
        Spring { ends, stiffness: modulus * volume / (length * length), length }
    };
    volumes.into_iter().map(spring).collect()
}
