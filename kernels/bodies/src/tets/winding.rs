//! Winding numbers of shells around a point: 1 for points inside a shell.
//!
//! Exact for closed shells on the grid and for points at fractions of it; a point on a shell is treated as one beside
//! it. Each triangle crossed by the ray from the point towards +z counts as +1 or −1 by its orientation. All sums are
//! integers; a ray through an edge crosses exactly one of its two triangles, as if it were displaced slightly towards
//! +x and even less towards +y.

use nalgebra::Vector3;

use super::grid::{GridPoint, SIDE};

/// Triangles by the squares they cover in x and y.
pub(super) struct Winding<'a> {
    grid_points: &'a [GridPoint],
    triangles: &'a [[u32; 3]],
    /// Shell of each triangle.
    shells: &'a [u32],
    /// Squares are 2^shift wide.
    shift: u32,
    /// First entry in `members` of each square, row by row, and their number at the end.
    starts: Vec<u32>,
    members: Vec<u32>,
}

/// The shells with a non-zero winding number around a point, and that number.
pub(super) type WindingCounts = Vec<(u32, i32)>;

/// Largest mean number of squares that a triangle may be listed in.
const MOST_ENTRIES: usize = 8;

impl<'a> Winding<'a> {
    pub(super) fn new(grid_points: &'a [GridPoint], triangles: &'a [[u32; 3]], shells: &'a [u32]) -> Self {
        // About as many squares as triangles, fewer if triangles cover many of them.
        let mut bits = (usize::BITS - triangles.len().leading_zeros()) / 2;
        let mut new = Self { grid_points, triangles, shells, shift: 0, starts: Vec::new(), members: Vec::new() };
        loop {
            new.shift = SIDE.trailing_zeros() - bits;
            let entries: usize = triangles.iter().map(|triangle| new.squares(*triangle).count()).sum();
            if entries <= MOST_ENTRIES * triangles.len() || bits == 0 {
                break;
            }
            bits -= 1;
        }
        let mut starts = vec![0_u32; new.across() * new.across() + 1];
        for triangle in triangles {
            new.squares(*triangle).for_each(|square| starts[square + 1] += 1);
        }
        (1..starts.len()).for_each(|square| starts[square] += starts[square - 1]);
        let mut next = starts.clone();
        new.members = vec![0; starts[starts.len() - 1] as usize];
        for (index, triangle) in triangles.iter().enumerate() {
            for square in new.squares(*triangle) {
                new.members[next[square] as usize] = index as u32;
                next[square] += 1;
            }
        }
        new.starts = starts;
        new
    }

    /// Number of squares in a row.
    fn across(&self) -> usize {
        (SIDE >> self.shift) as usize + 1
    }

    /// The squares that a triangle's bounds cover; none for a vertical triangle, which no ray crosses.
    fn squares(&self, triangle: [u32; 3]) -> impl Iterator<Item = usize> + use<> {
        let [a, b, c] = triangle.map(|corner| self.grid_points[corner as usize].map(i64::from));
        let upright = (b[0] - a[0]) * (c[1] - a[1]) == (b[1] - a[1]) * (c[0] - a[0]);
        let low = |axis: usize| (a[axis].min(b[axis]).min(c[axis]) >> self.shift) as usize;
        let high = |axis: usize| (a[axis].max(b[axis]).max(c[axis]) >> self.shift) as usize;
        let (columns, rows) = (low(0)..high(0) + 1, if upright { 0..0 } else { low(1)..high(1) + 1 });
        let across = self.across();
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }

    /// Winding numbers of all shells around the point `sum` ÷ `parts`, where `sum` adds up to 4 grid points.
    pub(super) fn around(&self, sum: [i64; 3], parts: i64, tally: &mut WindingCounts) {
        tally.clear();
        self.crossed(sum, parts, |member, passed| {
            let shell = self.shells[member as usize];
            match tally.iter_mut().find(|(other, _)| *other == shell) {
                Some((_, count)) => *count += passed,
                None => tally.push((shell, passed)),
            }
        });
        tally.retain(|(_, count)| *count != 0);
    }

    /// Calls `found` with each triangle that the ray from that point towards +z crosses, and 1 if it does so from
    /// behind, −1 from the front.
    pub(super) fn crossed(&self, sum: [i64; 3], parts: i64, mut found: impl FnMut(u32, i32)) {
        let square = |axis: usize| ((sum[axis] / parts) >> self.shift) as usize;
        let square = square(1) * self.across() + square(0);
        for member in &self.members[self.starts[square] as usize..self.starts[square + 1] as usize] {
            let corners = self.triangles[*member as usize].map(|corner| self.grid_points[corner as usize]);
            let passed = passed(corners, sum, parts);
            if passed != 0 {
                found(*member, passed);
            }
        }
    }
}

/// 1 if the ray from `sum` ÷ `parts` towards +z crosses the triangle from behind, −1 from the front, 0 if it misses.
fn passed(corners: [GridPoint; 3], sum: [i64; 3], parts: i64) -> i32 {
    // From each corner to the point, times `parts`.
    let to = corners.map(|corner| [0, 1, 2].map(|axis| sum[axis] - parts * i64::from(corner[axis])));
    let mut turn = 0;
    for k in 0..3 {
        let (from, next) = (to[k], to[(k + 1) % 3]);
        // Both ends are on the same side of the point in y, so the side does not cross that line.
        if (from[1] >= 0) == (next[1] >= 0) {
            continue;
        }
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let left = i64::from(b[0] - a[0]) * from[1] - i64::from(b[1] - a[1]) * from[0];
        turn += if from[1] >= 0 { i32::from(left > 0) } else { -i32::from(left < 0) };
    }
    if turn == 0 {
        return 0;
    }
    let [a, b, c] = corners.map(|corner| Vector3::from(corner.map(i64::from)));
    let normal = (b - a).cross(&(c - a));
    let before = normal.map(i128::from).dot(&Vector3::from(to[0].map(i128::from)));
    if i128::from(turn) * before < 0 { turn } else { 0 }
}
