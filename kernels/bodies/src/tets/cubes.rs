//! Blocks of cubes cut into tets, for tests and benches.

/// A block of `cells` boxes along x, y and z, each cut into six tets around its diagonal: points, x fastest, and
/// tets. `low` is the lowest corner and `size` the length of the sides, metres. All tets have the same orientation:
/// seen from the fourth corner, the first three run counter-clockwise.
///
/// # Panics
/// If there are 2³² points.
pub fn cubes(cells: [usize; 3], low: [f64; 3], size: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let [nx, ny, nz] = cells.map(|n| n + 1);
    assert!(nx.saturating_mul(ny).saturating_mul(nz) < 1 << 32, "{cells:?} are too many cubes");
    let coordinate = |axis: usize, k: usize| low[axis] + size[axis] * k as f64 / cells[axis].max(1) as f64;
    let in_order =
        |[x, y, z]: [usize; 3]| (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| [x, y, z])));
    let points = in_order([nx, ny, nz]).map(|at| [0, 1, 2].map(|axis| coordinate(axis, at[axis]))).collect();
    // The bits of a corner are its offsets along the axes; the six paths from corner 0 to 7 along edges.
    let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
    let tets = in_order(cells).flat_map(|[x, y, z]| {
        let corner =
            move |bits: usize| ((x + (bits & 1)) + nx * ((y + (bits >> 1 & 1)) + ny * (z + (bits >> 2)))) as u32;
        paths.map(|[a, b]| [0, a, b, 7].map(corner))
    });
    (points, tets.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tets::boundary;
    use numerics::vector::DVec3;

    #[test]
    fn tets_fill_the_block_with_consistent_orientation() {
        let (points, tets) = cubes([2, 3, 1], [1.0, -2.0, 0.5], [0.5, 0.75, 2.0]);
        assert_eq!((points.len(), tets.len()), (24, 36));
        assert_eq!((points[0], points[23]), ([1.0, -2.0, 0.5], [1.5, -1.25, 2.5]));
        let volume = |tet: &[u32; 4]| {
            let [o, a, b, c] = tet.map(|corner| DVec3::from(points[corner as usize]));
            (a - o).cross(&(b - o)).dot(&(c - o)) / 6.0
        };
        // A block of 0.75 m³ in 36 equal parts.
        assert!(tets.iter().all(|tet| (volume(tet) - 0.75 / 36.0).abs() < 1e-15));
    }

    #[test]
    fn neighbouring_cubes_share_faces() {
        let (points, tets) = cubes([2, 3, 4], [0.0; 3], [1.0; 3]);
        let points: Vec<_> = points.iter().map(|p| p.map(|x| x as f32)).collect();
        // Two triangles for each boundary square.
        assert_eq!(boundary(&tets, &points).len(), 2 * 2 * (2 * 3 + 3 * 4 + 4 * 2));
    }

    #[test]
    fn an_empty_block_has_no_tets() {
        assert_eq!(cubes([0, 1, 1], [0.0; 3], [1.0; 3]).1, Vec::<[u32; 4]>::new());
    }
}
