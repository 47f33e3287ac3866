//! Connected components of a body.

use numerics::pieces::pieces;

/// Connected components, numbered by their lowest points.
pub(super) struct ConnectedPieces {
    pub(super) count: usize,
    /// Component of each point; a point in no tet is one of its own.
    pub(super) of_point: Vec<u32>,
}

impl ConnectedPieces {
    pub(super) fn of(points: usize, tets: &[[u32; 4]]) -> Self {
        let links = tets.iter().flat_map(|[first, others @ ..]| others.map(|other| [*first, other]));
        let lowest = pieces(points, links);
        let mut count = 0;
        let mut of_point = vec![0; points];
        for point in 0..points {
            let first = lowest[point] as usize;
            of_point[point] = if first == point { count } else { of_point[first] };
            count += u32::from(first == point);
        }
        Self { count: count as usize, of_point }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_numbered_by_their_lowest_points_in_any_order_of_tets() {
        for tets in [[[9, 3, 5, 7], [0, 8, 2, 4], [7, 1, 3, 5]], [[7, 1, 3, 5], [4, 2, 8, 0], [5, 9, 7, 3]]] {
            let pieces = ConnectedPieces::of(10, &tets);
            assert_eq!((pieces.count, pieces.of_point), (3, vec![0, 1, 0, 1, 0, 1, 2, 1, 0, 1]));
        }
    }
}
