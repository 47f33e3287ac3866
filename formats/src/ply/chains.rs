//! Joins edges to polylines.

/// Joins `edges` to polylines: returns the number of CVs of each, and their vertices, concatenated.
///
/// A polyline continues through every vertex with exactly two edges and ends at any other. Polylines are in the order
/// of their first edges in the list, which give their directions. A closed polyline starts with its first edge and ends
/// at its first vertex. An edge from a vertex to itself is left out. Time and memory are linear.
pub(super) fn join(edges: &[[u32; 2]], vertices: usize) -> (Vec<u32>, Vec<u32>) {
    let mut degree = vec![0_u32; vertices];
    // The xor of the numbers of a vertex's edges: for two edges, xor with one of them gives the other.
    let mut both = vec![0_u32; vertices];
    for (number, [a, b]) in (0_u32..).zip(edges).filter(|(_, [a, b])| a != b) {
        for vertex in [*a as usize, *b as usize] {
            degree[vertex] += 1;
            both[vertex] ^= number;
        }
    }
    let mut used = vec![false; edges.len()];
    // The vertex after `vertex` when coming along the edge `from`, and the edge that leads there.
    let onward = |vertex: u32, from: u32, used: &mut [bool]| {
        if degree[vertex as usize] != 2 {
            return None;
        }
        let edge = both[vertex as usize] ^ from;
        if std::mem::replace(&mut used[edge as usize], true) {
            return None;
        }
        let [a, b] = edges[edge as usize];
        Some((if a == vertex { b } else { a }, edge))
    };
    let (mut counts, mut chain) = (Vec::new(), Vec::new());
    for (number, [a, b]) in (0_u32..).zip(edges) {
        if a == b || std::mem::replace(&mut used[number as usize], true) {
            continue;
        }
        let start = chain.len();
        chain.push(*a);
        let mut end = Some((*b, number));
        while let Some((vertex, edge)) = end {
            chain.push(vertex);
            end = onward(vertex, edge, &mut used);
        }
        let forth = chain.len();
        let mut end = onward(*a, number, &mut used);
        while let Some((vertex, edge)) = end {
            chain.push(vertex);
            end = onward(vertex, edge, &mut used);
        }
        let back = chain.len() - forth;
        chain[forth..].reverse();
        chain[start..].rotate_right(back);
        counts.push((chain.len() - start) as u32);
    }
    (counts, chain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polylines(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
        let vertices = edges.iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let (counts, chain) = join(edges, vertices);
        let mut rest = chain.as_slice();
        let take = |count: &u32| rest.split_off(..*count as usize).unwrap().to_vec();
        counts.iter().map(take).collect()
    }

    #[test]
    fn unordered_edges_are_joined_in_the_direction_of_the_first() {
        assert_eq!(polylines(&[[0, 1], [1, 2], [2, 3]]), [[0, 1, 2, 3]]);
        assert_eq!(polylines(&[[2, 1], [3, 2], [0, 1]]), [[3, 2, 1, 0]]);
        assert_eq!(polylines(&[[4, 5], [0, 1], [6, 5]]), [vec![4, 5, 6], vec![0, 1]]);
    }

    #[test]
    fn polylines_end_at_a_fork() {
        assert_eq!(polylines(&[[0, 1], [1, 2], [1, 3], [3, 4]]), [vec![0, 1], vec![1, 2], vec![1, 3, 4]]);
    }

    #[test]
    fn a_closed_polyline_ends_at_its_first_vertex() {
        assert_eq!(polylines(&[[0, 1], [1, 2], [2, 0]]), [[0, 1, 2, 0]]);
        assert_eq!(polylines(&[[0, 1], [0, 1]]), [[0, 1, 0]], "two edges between the same vertices are a ring too");
        assert_eq!(polylines(&[[0, 1], [1, 2], [2, 0], [0, 3]]), [vec![0, 1, 2, 0], vec![0, 3]], "a ring on a stem");
    }

    #[test]
    fn an_edge_from_a_vertex_to_itself_is_left_out() {
        assert_eq!(polylines(&[[0, 0], [0, 1], [1, 1], [1, 2]]), [[0, 1, 2]]);
        assert!(polylines(&[[3, 3]]).is_empty());
        assert!(polylines(&[]).is_empty());
    }
}
