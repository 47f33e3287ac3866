//! Edges of a surface, and which of them tets lack.
//!
//! The Delaunay tets of a surface's points have most of its edges, not all. Nothing keeps a list of the others: whoever
//! needs them (a soft body makes springs of them) has the surface and its tets, and asks [`missing_edges`].

use rayon::prelude::*;

/// Every edge of polygons once, its lower point first, sorted. `starts` are the first corner of each polygon and the
/// number of corners, `corners` the points.
pub fn edges(starts: &[u32], corners: &[u32]) -> Vec<[u32; 2]> {
    let sides = |run: &[u32]| {
        let corners = &corners[run[0] as usize..run[1] as usize];
        (0..corners.len()).map(move |k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            [a.min(b), a.max(b)]
        })
    };
    let mut edges: Vec<[u32; 2]> = starts.windows(2).flat_map(sides).collect();
    edges.par_sort_unstable();
    edges.dedup();
    edges
}

/// Those of `edges` that are no edge of a tet, in their order.
pub fn missing_edges(edges: &[[u32; 2]], tets: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let points = edges.as_flattened().iter().max().map_or(0, |highest| *highest as usize + 1);
    let around = TetsAround::new(points, tets);
    edges.par_iter().filter(|edge| !around.has(*edge)).copied().collect()
}

/// The tets around each of the first points.
pub(super) struct TetsAround<'a> {
    tets: &'a [[u32; 4]],
    /// First entry in `members` of each point, and their number at the end.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl<'a> TetsAround<'a> {
    pub(super) fn new(points: usize, tets: &'a [[u32; 4]]) -> Self {
        let mut starts = vec![0_u32; points + 1];
        for corner in tets.as_flattened().iter().filter(|corner| (**corner as usize) < points) {
            starts[*corner as usize + 1] += 1;
        }
        (0..points).for_each(|point| starts[point + 1] += starts[point]);
        let mut next = starts.clone();
        let mut members = vec![0; starts[points] as usize];
        for (tet, corners) in tets.iter().enumerate() {
            for corner in corners.iter().filter(|corner| (**corner as usize) < points) {
                let next = &mut next[*corner as usize];
                members[*next as usize] = tet as u32;
                *next += 1;
            }
        }
        Self { tets, starts, members }
    }

    /// The tets that have a point.
    pub(super) fn of(&self, point: u32) -> &[u32] {
        &self.members[self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize]
    }

    /// Whether a tet has all these points.
    pub(super) fn has(&self, points: &[u32]) -> bool {
        let mut tets = self.of(points[0]).iter().map(|tet| self.tets[*tet as usize]);
        tets.any(|tet| points.iter().all(|point| tet.contains(point)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quads_diagonals_are_no_edges_and_what_no_tet_has_is_missing() {
        let edges = edges(&[0, 4, 7], &[0, 1, 2, 3, 1, 4, 2]);
        assert_eq!(edges, [[0, 1], [0, 3], [1, 2], [1, 4], [2, 3], [2, 4]]);
        assert_eq!(missing_edges(&edges, &[[0, 1, 2, 9]]), [[0, 3], [1, 4], [2, 3], [2, 4]]);
        assert_eq!(missing_edges(&edges, &[]), edges);
        assert!(missing_edges(&[], &[[0, 1, 2, 3]]).is_empty());
    }
}
