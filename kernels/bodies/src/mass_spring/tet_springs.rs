//! The edges of tetrahedra, which become springs.

use super::body::Mesh;
use crate::tets::FACES;

/// The corners of the six edges of a tetrahedron.
pub(super) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// All edges of tetrahedra, each once, as pairs of points; and the six edges of each tetrahedron.
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

/// For each missing edge the springs on boundary edges at its two ends, that is, on faces of a single tetrahedron.
pub(super) fn neighbours_of_missing(mesh: &Mesh<'_>, ends: &[[u32; 2]], tet_springs: &[[u32; 6]]) -> Vec<Vec<u32>> {
    if mesh.missing.is_empty() {
        return Vec::new();
    }
    let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::with_capacity(4 * mesh.tets.len());
    for (tet, springs) in mesh.tets.iter().zip(tet_springs) {
        for face in FACES {
            let mut corners = face.map(|corner| tet[corner]);
            corners.sort_unstable();
            let spring = |a: usize, b: usize| {
                let edge = [face[a].min(face[b]), face[a].max(face[b])];
                springs[EDGES.iter().position(|known| *known == edge).unwrap_or(0)]
            };
            faces.push((corners, [spring(0, 1), spring(1, 2), spring(0, 2)]));
        }
    }
    faces.sort_unstable();
    let mut at = vec![Vec::new(); mesh.points.len()];
    for same in faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1) {
        for spring in same[0].1 {
            ends[spring as usize].iter().for_each(|end| at[*end as usize].push(spring));
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
