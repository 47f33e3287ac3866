//! Edges of a surface, and which of them are not edges of tets.
//!
//! The Delaunay tets of a surface's points have most of its edges, but not all. The missing ones are not stored:
//! users that need them (soft bodies turn them into springs) have the surface and the tets and call
//! [`missing_edges`].

/// Each edge of polygons once, lower point first, sorted. `starts` are the first corner of each polygon and the
/// number of corners, `corners` their points.
pub fn edges(starts: &[u32], corners: &[u32]) -> Vec<[u32; 2]> {
    let sides = |run: &[u32]| {
        let corners = &corners[run[0] as usize..run[1] as usize];
        (0..corners.len()).map(move |k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            [a.min(b), a.max(b)]
        })
    };
    let mut edges: Vec<[u32; 2]> = starts.windows(2).flat_map(sides).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Those of `edges` that no tet has, in the same order.
pub fn missing_edges(edges: &[[u32; 2]], tets: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let points = edges.as_flattened().iter().max().map_or(0, |highest| *highest as usize + 1);
    let around = TetsAround::new(points, tets);
    edges.iter().filter(|edge| !around.has(*edge)).copied().collect()
}

/// Tets incident to each of the first points.
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

    /// The tets incident to a point.
    pub(super) fn of(&self, point: u32) -> &[u32] {
        &self.members[self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize]
    }

    /// Whether some tet has all these points.
    pub(super) fn has(&self, points: &[u32]) -> bool {
        let mut tets = self.of(points[0]).iter().map(|tet| self.tets[*tet as usize]);
        tets.any(|tet| points.iter().all(|point| tet.contains(point)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonals_of_quads_are_not_edges_and_edges_of_no_tet_are_missing() {
        let edges = edges(&[0, 4, 7], &[0, 1, 2, 3, 1, 4, 2]);
        assert_eq!(edges, [[0, 1], [0, 3], [1, 2], [1, 4], [2, 3], [2, 4]]);
        assert_eq!(missing_edges(&edges, &[[0, 1, 2, 9]]), [[0, 3], [1, 4], [2, 3], [2, 4]]);
        assert_eq!(missing_edges(&edges, &[]), edges);
        assert!(missing_edges(&[], &[[0, 1, 2, 3]]).is_empty());
    }
}
