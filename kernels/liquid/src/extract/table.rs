//! The loops in which a surface leaves a cube, for all 256 sets of corners inside; made by program, once.
//!
//! Corner c of a cube lies at (c & 1, c >> 1 & 1, c >> 2). Edge 4 a + p + 2 q runs along axis a; p and q are its places, 0
//! or 1, along the axes (a + 1) mod 3 and (a + 2) mod 3. Face 2 a + s is the one across axis a at s.

use std::sync::LazyLock;

/// The loops of a cube: each is the set of the edges it crosses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Loops {
    pub(super) count: u8,
    /// A bit for each edge.
    pub(super) edges: [u16; 4],
}

impl Loops {
    /// Which loop crosses an edge; 0 where none does.
    #[inline(always)]
    pub(super) fn through(&self, edge: usize) -> u32 {
        let [_, b, c, d] = self.edges.map(|edges| u32::from(edges >> edge & 1));
        b + 2 * c + 3 * d
    }
}

/// Of every case, a bit for each corner inside: its loops, and those with its ambiguous face flipped.
pub(super) struct Table {
    /// The loops of case k, and at k + 256 those with the face `flip[k]` flipped.
    pub(super) loops: [Loops; 512],
    /// The face to flip where the cube across it is to flip it too.
    pub(super) flip: [Option<u8>; 256],
}

/// The only table.
pub(super) fn table() -> &'static Table {
    static TABLE: LazyLock<Table> = LazyLock::new(|| {
        let flip: [_; 256] = std::array::from_fn(|case| face_to_flip(case as u8));
        let of = |kind: usize| trace(kind as u8, flip[kind & 255].filter(|_| kind > 255));
        Table { loops: std::array::from_fn(of), flip }
    });
    &TABLE
}

/// The corners at both ends of an edge, the lower first.
pub(super) fn ends(edge: usize) -> [usize; 2] {
    let axis = edge / 4;
    let low = (edge & 1) << ((axis + 1) % 3) | (edge >> 1 & 1) << ((axis + 2) % 3);
    [low, low | 1 << axis]
}

/// The corners of a face, in a circle.
fn corners(face: u8) -> [usize; 4] {
    let (axis, side) = (usize::from(face / 2), usize::from(face % 2));
    let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    [0, b, b | c, c].map(|corner| corner | side << axis)
}

/// The edge between two corners.
fn edge_between(a: usize, b: usize) -> usize {
    (0..12).find(|edge| ends(*edge) == [a.min(b), a.max(b)]).expect("two corners of an edge")
}

/// Whether the inside corners of a face are two that no edge connects.
fn is_ambiguous(case: u8, face: u8) -> bool {
    let [a, b, c, d] = corners(face).map(|corner| case >> corner & 1);
    a == c && b == d && a != b
}

/// The face that the one loop of a case passes twice. Two cubes that meet there would share two pairs of vertices, and
/// the edge between them would have four quads.
fn face_to_flip(case: u8) -> Option<u8> {
    let loops = trace(case, None);
    let twice = |face: &u8| {
        let edges = face_edges(*face).iter().fold(0, |edges, edge| edges | 1 << edge);
        is_ambiguous(case, *face) && loops.edges.iter().any(|through| through & edges == edges)
    };
    (0..6).find(twice)
}

/// The edges of a face; the n-th is that from corner n to the next.
fn face_edges(face: u8) -> [usize; 4] {
    let around = corners(face);
    std::array::from_fn(|n| edge_between(around[n], around[(n + 1) % 4]))
}

/// Follows the surface over the faces of a cube. On an ambiguous face the corners inside are kept apart, on the flipped
/// one those outside.
fn trace(case: u8, flipped: Option<u8>) -> Loops {
    let inside = |corner: usize| case >> corner & 1 == 1;
    let mut label: [Option<usize>; 12] =
        std::array::from_fn(|edge| (inside(ends(edge)[0]) != inside(ends(edge)[1])).then_some(edge));
    let mut join = |a: usize, b: usize| {
        let (from, to) = (label[a].max(label[b]), label[a].min(label[b]));
        label.iter_mut().filter(|label| **label == from).for_each(|label| *label = to);
    };
    for face in 0..6 {
        let (around, edges) = (corners(face), face_edges(face));
        let crossed = edges.map(|edge| inside(ends(edge)[0]) != inside(ends(edge)[1]));
        if is_ambiguous(case, face) {
            let alone = flipped != Some(face);
            (0..4).filter(|n| inside(around[*n]) == alone).for_each(|n| join(edges[(n + 3) % 4], edges[n]));
        } else if let Some(first) = crossed.iter().position(|crossed| *crossed) {
            let last = crossed.iter().rposition(|crossed| *crossed).unwrap_or(first);
            join(edges[first], edges[last]);
        }
    }
    let mut loops = Loops::default();
    for first in 0..12 {
        if label[first] == Some(first) {
            let edges = (first..12).filter(|edge| label[*edge] == Some(first)).fold(0, |edges, edge| edges | 1 << edge);
            loops.edges[usize::from(loops.count)] = edges;
            loops.count += 1;
        }
    }
    loops
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_cross_each_edge_between_inside_and_outside_once() {
        let table = table();
        for kind in 0..512 {
            let loops = table.loops[kind];
            let inside = |corner: usize| kind >> corner & 1;
            let crossed = (0..12).filter(|edge| inside(ends(*edge)[0]) != inside(ends(*edge)[1]));
            let crossed = crossed.fold(0, |edges, edge| edges | 1_u16 << edge);
            assert_eq!(loops.edges.iter().fold(0, |all, edges| all | edges), crossed, "{kind}");
            let edges: u32 = loops.edges.iter().map(|edges| edges.count_ones()).sum();
            assert_eq!(edges, crossed.count_ones());
            assert_eq!(loops.edges.iter().filter(|edges| **edges != 0).count(), usize::from(loops.count));
            for edge in (0..12).filter(|edge| crossed >> edge & 1 == 1) {
                assert_eq!(loops.edges[loops.through(edge) as usize] >> edge & 1, 1);
            }
        }
    }

    #[test]
    fn no_case_has_two_faces_to_flip() {
        for case in 0..=255 {
            let loops = trace(case, None);
            let twice = (0..6).filter(|face| {
                let edges = face_edges(*face).iter().fold(0, |edges, edge| edges | 1 << edge);
                is_ambiguous(case, *face) && loops.edges.iter().any(|through| through & edges == edges)
            });
            assert!(twice.count() <= 1, "{case}");
        }
        let flipped = table().flip.iter().flatten().count();
        assert_eq!(flipped, 36, "cases with a face to flip");
    }
}
