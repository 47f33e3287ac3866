//! The zero level of a volume as a mesh, by naive surface nets: a point in every cube of eight cell centres that the
//! level crosses, at the mean of its edges' crossings, and a quad across every crossed edge.
//!
//! Guarantees: closed for any level set, as everything beyond the grid counts as outside; faces wind counter-clockwise
//! seen from outside (φ > 0); points in the order of the grid. Limit: first order in the cell, sharp edges are rounded,
//! and two sheets that meet in one cube share its point. A value that is not finite counts as outside.

use engine::geometry::{BLOCK_EDGE, FieldCursor, Grid, SparseField, Volume, VolumeSampler};
use numerics::parallel;
use numerics::vector::length;

/// Blocks whose cubes a thread looks at at a time, and crossed cubes whose quads it makes.
const TASK: usize = 4;
const QUAD_TASK: usize = 64;

/// Points (metres), the cell nearest to each, and quads.
pub(crate) struct Surface {
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) cells: Vec<[u32; 3]>,
    pub(crate) quads: Vec<[u32; 4]>,
}

/// The zero level of `volume`. Only cubes at stored blocks are visited: the level passes through no others.
pub(crate) fn zero_level(volume: &Volume) -> Surface {
    // Cube (i, j, k) has cell centres i−1…i, j−1…j, k−1…k at its corners; a layer around the grid is outside.
    let field = Field { grid: volume.level_grid(), phi: volume.level_set() };
    let cubes = field.grid.size.map(|n| i64::from(n) + 1);
    let blocks = cube_blocks(field.phi);
    let crossed = parallel::map(blocks.chunks(TASK), |_, blocks| {
        let mut cursor = field.phi.cursor();
        let cubes = blocks.iter().flat_map(|block| {
            let range = |axis: usize| {
                let first = i64::from(block[axis] * BLOCK_EDGE);
                first..(first + i64::from(BLOCK_EDGE)).min(cubes[axis])
            };
            let row = move |j, k| range(0).map(move |i| [i, j, k]);
            range(2).flat_map(move |k| range(1).flat_map(move |j| row(j, k)))
        });
        let found = cubes.filter_map(|cube| field.point(&mut cursor, cube).map(|point| (cube, point)));
        found.collect::<Vec<_>>()
    });
    let mut crossed: Vec<([i64; 3], [f32; 3])> = crossed.concat();
    let order = |[i, j, k]: [i64; 3]| [k, j, i];
    // The layers of blocks are in order already.
    let layer = |cube: &[i64; 3]| cube[2] / i64::from(BLOCK_EDGE);
    parallel::for_each(crossed.chunk_by_mut(|(a, _), (b, _)| layer(a) == layer(b)), |_, cubes| {
        cubes.sort_unstable_by_key(|(cube, _)| order(*cube));
    });
    let row = |cube| crossed.binary_search_by_key(&order(cube), |(cube, _)| order(*cube)).ok().map(|row| row as u32);
    let quads = parallel::map(crossed.chunks(QUAD_TASK), |_, cubes| {
        let mut cursor = field.phi.cursor();
        cubes.iter().flat_map(|(cube, _)| field.quads(&mut cursor, *cube, row)).collect::<Vec<_>>()
    });
    let last = field.grid.size.map(|n| i64::from(n) - 1);
    let cell = |cube: [i64; 3]| std::array::from_fn(|axis| cube[axis].min(last[axis]) as u32);
    Surface {
        points: crossed.iter().map(|(_, point)| *point).collect(),
        cells: crossed.iter().map(|(cube, _)| cell(*cube)).collect(),
        quads: quads.concat(),
    }
}

/// Blocks of 8³ cubes that have a corner in a stored block of `field`: the block itself and its neighbours above, in the order
/// of the grid.
fn cube_blocks(field: &SparseField) -> Vec<[u32; 3]> {
    let above = |[x, y, z]: [u32; 3]| (0..8).map(move |bits| [x + (bits & 1), y + (bits >> 1 & 1), z + (bits >> 2)]);
    let mut blocks: Vec<_> = field.blocks().flat_map(|(block, _)| above(block)).collect();
    blocks.sort_unstable_by_key(|[x, y, z]| [*z, *y, *x]);
    blocks.dedup();
    blocks
}

/// Speed in the middle of a cell of the level set, m/s.
pub(crate) fn speed(sampler: &mut VolumeSampler, grid: &Grid, cell: [u32; 3]) -> f32 {
    let middle = [0, 1, 2].map(|k| grid.origin[k] + grid.cell * (cell[k] as f32 + 0.5));
    length(sampler.velocity(middle))
}

struct Field<'a> {
    grid: Grid,
    phi: &'a SparseField,
}

impl Field<'_> {
    /// φ at a cell centre; half a cell outside beyond the grid, which puts the wall of a full grid on its border.
    fn at(&self, cursor: &mut FieldCursor, at: [i64; 3]) -> f32 {
        let outside = 0.5 * self.grid.cell;
        if (0..3).any(|axis| at[axis] < 0 || at[axis] >= i64::from(self.grid.size[axis])) {
            return outside;
        }
        let value = cursor.get(at);
        if value.is_finite() { value } else { outside }
    }

    /// The point of a cube, metres; `None` if the level does not cross it.
    fn point(&self, cursor: &mut FieldCursor, cube: [i64; 3]) -> Option<[f32; 3]> {
        let corner =
            |bits: usize| -> [i64; 3] { std::array::from_fn(|axis| cube[axis] - 1 + (bits >> axis & 1) as i64) };
        let values: [f32; 8] = std::array::from_fn(|bits| self.at(cursor, corner(bits)));
        if values.iter().all(|value| (*value < 0.0) == (values[0] < 0.0)) {
            return None;
        }
        let (mut sum, mut count) = ([0.0_f32; 3], 0.0);
        for low in 0..8_usize {
            for axis in (0..3).filter(|axis| low >> axis & 1 == 0) {
                let (a, b) = (values[low], values[low | 1 << axis]);
                if (a < 0.0) != (b < 0.0) {
                    let along = a / (a - b);
                    for (k, sum) in sum.iter_mut().enumerate() {
                        *sum += if k == axis { along } else { (low >> k & 1) as f32 };
                    }
                    count += 1.0;
                }
            }
        }
        // Cell centre (i, j, k) is half a cell into its cell.
        Some(std::array::from_fn(|k| self.grid.origin[k] + self.grid.cell * (cube[k] as f32 - 0.5 + sum[k] / count)))
    }

    /// The quads across the crossed edges that begin at the lowest corner of `cube`; each is shared by four cubes.
    fn quads(&self, cursor: &mut FieldCursor, cube: [i64; 3], row: impl Fn([i64; 3]) -> Option<u32>) -> Vec<[u32; 4]> {
        let corner = cube.map(|i| i - 1);
        let inside = self.at(cursor, corner) < 0.0;
        let mut quad = |axis: usize| {
            let mut beyond = corner;
            beyond[axis] += 1;
            if inside == (self.at(cursor, beyond) < 0.0) {
                return None;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let neighbour = |du, dv| {
                let mut at = cube;
                at[u] -= du;
                at[v] -= dv;
                row(at)
            };
            let [a, b, c, d] = [neighbour(0, 0)?, neighbour(1, 0)?, neighbour(1, 1)?, neighbour(0, 1)?];
            Some(if inside { [a, b, c, d] } else { [d, c, b, a] })
        };
        [quad(0), quad(1), quad(2)].into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::vector::{cross, dot, sub};

    fn volume(size: u32, phi: impl Fn([f32; 3]) -> f32) -> Volume {
        let grid = Grid { origin: [-1.0; 3], cell: 2.0 / size as f32, size: [size; 3] };
        let centre = |i: u32| -1.0 + grid.cell * (i as f32 + 0.5);
        let level_set = (0..size.pow(3))
            .map(|n| phi([centre(n % size), centre(n / size % size), centre(n / size / size)]))
            .collect();
        Volume::new(grid, level_set, [0, 1, 2].map(|axis| vec![0.0; grid.faces(axis)])).unwrap()
    }

    /// Every edge occurs equally often in both directions.
    fn assert_closed(surface: &Surface) {
        let mut edges: Vec<[u32; 2]> =
            surface.quads.iter().flat_map(|q| (0..4).map(move |k| [q[k], q[(k + 1) % 4]])).collect();
        let mut reversed: Vec<[u32; 2]> = edges.iter().map(|[a, b]| [*b, *a]).collect();
        edges.sort_unstable();
        reversed.sort_unstable();
        assert_eq!(edges, reversed);
    }

    #[test]
    fn a_ball_is_closed_round_and_faces_outwards() {
        let surface = zero_level(&volume(24, |p| length(p) - 0.6));
        assert_closed(&surface);
        assert!(surface.points.iter().all(|p| (length(*p) - 0.6).abs() < 0.02));
        for [a, b, c, _] in &surface.quads {
            let [a, b, c] = [a, b, c].map(|k| surface.points[*k as usize]);
            assert!(dot(cross(sub(b, a), sub(c, a)), a) > 0.0);
        }
    }

    #[test]
    fn a_ball_in_a_large_sparse_grid_is_the_ball_of_a_dense_one() {
        // 40³ cells around the same ball, of which only the blocks within the band are stored.
        let distance = |node: [u32; 3]| length(node.map(|i| -1.0 + 0.05 * (i as f32 + 0.5))) - 0.6;
        let grid = Grid { origin: [-1.0; 3], cell: 0.05, size: [40; 3] };
        let all = (0..40_u32.pow(3)).map(|n| distance([n % 40, n / 40 % 40, n / 1600]).min(0.1));
        let faces = || [0, 1, 2].map(|axis| vec![0.0; grid.faces(axis)]);
        let dense = Volume::new(grid, all.clone().map(|phi| phi + 1e-9).collect(), faces()).unwrap();
        let sparse = Volume::new(grid, all.collect(), faces()).unwrap();
        assert!(sparse.level_set().block_count() < 125, "{}", sparse.level_set().block_count());
        let (a, b) = (zero_level(&dense), zero_level(&sparse));
        assert_closed(&b);
        assert_eq!((a.quads, a.cells), (b.quads, b.cells));
    }

    #[test]
    fn a_full_grid_is_closed_at_its_border() {
        let surface = zero_level(&volume(2, |_| -0.5));
        assert_closed(&surface);
        assert_eq!(surface.quads.len(), 24);
        assert!(surface.points.iter().flatten().all(|x| x.abs() <= 1.0 + 1e-6));
    }

    #[test]
    fn air_has_no_surface_and_nan_is_air() {
        assert!(zero_level(&volume(4, |_| 1.0)).quads.is_empty());
        assert!(zero_level(&volume(4, |_| f32::NAN)).quads.is_empty());
    }

    #[test]
    fn speed_is_the_mean_of_a_cells_faces() {
        let grid = Grid { origin: [0.0; 3], cell: 1.0, size: [1; 3] };
        let volume = Volume::new(grid, vec![-1.0], [vec![2.0, 4.0], vec![4.0, 4.0], vec![0.0, 0.0]]).unwrap();
        assert_eq!(speed(&mut volume.sampler(), &grid, [0; 3]), 5.0);
    }
}
