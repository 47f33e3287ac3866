//! Connected components of a body.

/// Connected components, numbered by their lowest points.
pub(super) struct ConnectedPieces {
    pub(super) count: usize,
    /// Component of each point; a point in no tet is one of its own.
    pub(super) of_point: Vec<u32>,
}

impl ConnectedPieces {
    pub(super) fn of(points: usize, tets: &[[u32; 4]]) -> Self {
        // Union-find: each entry leads to a lower point of the component, that of the lowest to itself.
        let mut towards: Vec<u32> = (0..points as u32).collect();
        for [a, rest @ ..] in tets {
            for b in rest {
                let (a, b) = (first(&mut towards, *a), first(&mut towards, *b));
                towards[a.max(b) as usize] = a.min(b);
            }
        }
        let mut count = 0;
        let mut of_point = vec![0; points];
        for point in 0..points {
            let first = first(&mut towards, point as u32) as usize;
            of_point[point] = if first == point { count } else { of_point[first] };
            count += u32::from(first == point);
        }
        Self { count: count as usize, of_point }
    }
}

/// The lowest point of a component; halves the path.
fn first(towards: &mut [u32], mut point: u32) -> u32 {
    while towards[point as usize] != point {
        let next = towards[towards[point as usize] as usize];
        towards[point as usize] = next;
        point = next;
    }
    point
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
