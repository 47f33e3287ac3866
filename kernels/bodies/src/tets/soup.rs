//! Any polygons as triangles with consistent orientation: open, crossing or with several faces at an edge.
//!
//! Faces that share an edge with exactly one other face are oriented alike, as most of the faces connected in this way
//! are. Points at the same position count as one. What cannot be oriented (a Möbius strip) is oriented alike as far as
//! possible.

use numerics::triangulate::triangulate;

use super::repair::{PolygonSurface, SignedUnionFind};

/// Triangles over the points of the polygons.
pub(super) struct Soup {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Whether every edge has an even number of faces, so that an inside is defined everywhere.
    pub(super) closed: bool,
}

/// A side of a triangle: its ends, lower first, the triangle, and whether it runs from the lower to the higher.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    ends: [u32; 2],
    triangle: u32,
    rises: bool,
}

impl Soup {
    /// Of the faces of `surface` with at least three different positions; oriented anew if `orient`.
    pub(super) fn of(surface: &PolygonSurface, orient: bool) -> Self {
        let same = same_positions(surface.points);
        let mut triangles = Vec::new();
        for run in surface.starts.windows(2) {
            let corners = &surface.corners[run[0] as usize..run[1] as usize];
            let at: Vec<[f32; 3]> = corners.iter().map(|corner| surface.points[*corner as usize]).collect();
            let cut = triangulate(&at).into_iter().map(|ear| ear.map(|k| corners[k as usize]));
            triangles.extend(cut.filter(|[a, b, c]| {
                let [a, b, c] = [a, b, c].map(|corner| same[*corner as usize]);
                a != b && b != c && c != a
            }));
        }
        let sides = sides(&triangles, &same);
        let closed = sides.chunk_by(|a, b| a.ends == b.ends).all(|edge| edge.len() % 2 == 0);
        let mut soup = Self { triangles, closed };
        if orient {
            soup.orient(&sides);
        }
        soup
    }

    fn orient(&mut self, sides: &[Side]) {
        let count = self.triangles.len();
        let mut pieces = SignedUnionFind::new(count);
        for edge in sides.chunk_by(|a, b| a.ends == b.ends) {
            if let [first, second] = edge {
                // Where that contradicts what is joined already, the piece is not orientable.
                let _ = pieces.join(first.triangle, second.triangle, first.rises == second.rises);
            }
        }
        let roots: Vec<(u32, bool)> = (0..count as u32).map(|triangle| pieces.root(triangle)).collect();
        // How many more triangles of a piece are oriented like its first than opposite to it.
        let mut like_first = vec![0_i64; count];
        roots.iter().for_each(|(root, turned)| like_first[*root as usize] += if *turned { -1 } else { 1 });
        for (triangle, (root, turned)) in self.triangles.iter_mut().zip(&roots) {
            if *turned == (like_first[*root as usize] >= 0) {
                triangle.swap(1, 2);
            }
        }
    }
}

/// The lowest point at the position of each point.
fn same_positions(points: &[[f32; 3]]) -> Vec<u32> {
    // −0 and 0 are the same position.
    let key = |point: u32| points[point as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by_key(|point| (key(*point), *point));
    let mut same = vec![0; points.len()];
    for group in order.chunk_by(|a, b| key(*a) == key(*b)) {
        group.iter().for_each(|point| same[*point as usize] = group[0]);
    }
    same
}

fn sides(triangles: &[[u32; 3]], same: &[u32]) -> Vec<Side> {
    let of = |(triangle, corners): (u32, &[u32; 3])| {
        let [a, b, c] = corners.map(|corner| same[corner as usize]);
        [[a, b], [b, c], [c, a]].map(|[from, to]| Side {
            ends: [from.min(to), from.max(to)],
            triangle,
            rises: from < to,
        })
    };
    let mut sides: Vec<Side> = (0..).zip(triangles).flat_map(of).collect();
    sides.sort_unstable();
    sides
}
