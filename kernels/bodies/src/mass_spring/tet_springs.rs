//! The edges of tetrahedra, which become springs.

use super::body::Mesh;
use crate::tets::{faces_of, sorted};

/// The corners of the six edges of a tetrahedron.
pub(super) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// All edges of tetrahedra, each once and ascending, as pairs of points; and the six edges of each tetrahedron.
pub(super) fn edges(tets: &[[u32; 4]]) -> (Vec<[u32; 2]>, Vec<[u32; 6]>) {
    let ends = |tet: &[u32; 4], edge: [usize; 2]| {
        let [a, b] = edge.map(|corner| tet[corner]);
        [a.min(b), a.max(b)]
    };
    let mut sorted: Vec<([u32; 2], u32)> = Vec::with_capacity(6 * tets.len());
    for (index, tet) in tets.iter().enumerate() {
        sorted.extend(EDGES.iter().enumerate().map(|(k, edge)| (ends(tet, *edge), (6 * index + k) as u32)));
    }
    sorted.sort_unstable();
    let mut unique: Vec<[u32; 2]> = Vec::new();
    let mut springs = vec![[0; 6]; tets.len()];
    for (ends, at) in sorted {
        if unique.last() != Some(&ends) {
            unique.push(ends);
        }
        springs[at as usize / 6][at as usize % 6] = unique.len() as u32 - 1;
    }
    (unique, springs)
}

/// For each missing edge the springs, among those with these `ends`, on boundary edges at its two ends, that is, on faces of a
/// single tetrahedron.
pub(super) fn neighbours_of_missing(mesh: &Mesh<'_>, ends: &[[u32; 2]]) -> Vec<Vec<u32>> {
    if mesh.missing.is_empty() {
        return Vec::new();
    }
    let mut faces: Vec<[u32; 3]> = mesh.tets.iter().flat_map(faces_of).map(sorted).collect();
    faces.sort_unstable();
    let mut at = vec![Vec::new(); mesh.points.len()];
    for same in faces.chunk_by(|a, b| a == b).filter(|same| same.len() == 1) {
        let [a, b, c] = same[0];
        for edge in [[a, b], [a, c], [b, c]] {
            let spring = ends.partition_point(|known| *known < edge) as u32;
            edge.iter().for_each(|end| at[*end as usize].push(spring));
        }
    }
    let near = |[a, b]: &[u32; 2]| {
        let mut near: Vec<u32> = at[*a as usize].iter().chain(&at[*b as usize]).copied().collect();
        near.sort_unstable();
        near.dedup();
        near
    };
    mesh.missing.iter().map(near).collect()
}
