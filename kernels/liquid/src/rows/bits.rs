//! Rows as bits, where they are short: rows of neighbours are put together a word at a time.

use std::cmp::{max, min};
use std::ops::Range;

use numerics::parallel;

use super::{Cell, CellRows};

/// Cells of a word.
const BITS: usize = u64::BITS as usize;

/// All cells at most `by` away from those of `rows` in the box `low` ≤ cell < `high`.
pub(super) fn dilated(rows: &CellRows, by: i32, low: Cell, high: Cell) -> CellRows {
    let words = (high[0].abs_diff(low[0]) as usize).div_ceil(BITS);
    let size = [1, 2].map(|axis| high[axis] - low[axis]);
    // Along x and y, of each z that reaches the box.
    let (z0, nz) = (rows.low[1], rows.size[1]);
    let zs = max(z0, low[2].saturating_sub(by))..min(z0.saturating_add(nz), high[2].saturating_add(by));
    let slices: Vec<Vec<u64>> = parallel::map(zs.clone(), |_, z| {
        let mut slice = vec![0; size[0] as usize * words];
        for j in -by..size[0] + by {
            let mut own = vec![0; words];
            for span in rows.row(low[1] + j, z) {
                let (start, end) = (max(span.start - by, low[0]), min(span.end + by, high[0]));
                set(&mut own, (start - low[0]).max(0) as usize..(end - low[0]).max(0) as usize);
            }
            if own.iter().any(|word| *word != 0) {
                for to in max(j - by, 0)..min(j + by + 1, size[0]) {
                    join(&mut slice[to as usize * words..][..words], &own);
                }
            }
        }
        slice
    });
    CellRows::from_ranges([low[1], low[2]], size, |y, z, out| {
        let mut row = vec![0; words];
        let near = max(z - by, zs.start)..min(z + by + 1, zs.end);
        for slice in near.map(|z| &slices[(z - zs.start) as usize]) {
            join(&mut row, &slice[(y - low[1]) as usize * words..][..words]);
        }
        each_range(&row, |range| out.push(low[0] + range.start as i32..low[0] + range.end as i32));
    })
}

fn join(row: &mut [u64], other: &[u64]) {
    row.iter_mut().zip(other).for_each(|(word, other)| *word |= other);
}

fn set(row: &mut [u64], range: Range<usize>) {
    if range.is_empty() {
        return;
    }
    let (first, last) = (range.start / BITS, (range.end - 1) / BITS);
    for (n, word) in row[first..=last].iter_mut().enumerate() {
        let from = if n == 0 { range.start % BITS } else { 0 };
        let to = if first + n == last { (range.end - 1) % BITS + 1 } else { BITS };
        *word |= (u64::MAX >> (BITS - (to - from))) << from;
    }
}

/// Calls `f` with each range of bits that are set, as long as possible.
fn each_range(row: &[u64], mut f: impl FnMut(Range<usize>)) {
    let mut start = None;
    for (n, word) in row.iter().enumerate() {
        let mut bit = 0;
        while bit < BITS {
            let rest = word >> bit;
            match start {
                None if rest == 0 => break,
                None => {
                    bit += rest.trailing_zeros() as usize;
                    start = Some(n * BITS + bit);
                }
                Some(first) => {
                    bit += rest.trailing_ones() as usize;
                    if bit < BITS {
                        f(first..n * BITS + bit);
                        start = None;
                    }
                }
            }
        }
    }
    if let Some(first) = start {
        f(first..row.len() * BITS);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_found() {
        let cases: [&[[usize; 2]]; 6] =
            [&[], &[[0, 1]], &[[0, 192]], &[[3, 64], [65, 66], [127, 128]], &[[63, 65], [100, 192]], &[[64, 128]]];
        for ranges in cases {
            let mut row = vec![0; 3];
            ranges.iter().for_each(|[start, end]| set(&mut row, *start..*end));
            let mut found = Vec::new();
            each_range(&row, |range| found.push([range.start, range.end]));
            assert_eq!(found, ranges);
        }
    }

    #[test]
    fn cells_near_others_are_those_that_a_search_finds() {
        let inside = |[x, y, z]: Cell| (x * 7 + y * 5 + z * 3).rem_euclid(23) == 0 && (x + y) % 3 != 0;
        let rows = CellRows::cuboid([-70, -4, -3], [80, 9, 6]).filtered(|cell, _| inside(cell));
        for (by, low, high) in
            [(1, [-200, -8, -8], [200, 14, 12]), (2, [-60, -2, 1], [70, 5, 20]), (4, [-71, -9, -9], [81, 0, 0])]
        {
            let near = dilated(&rows, by, low, high);
            let expected = CellRows::cuboid(low, high).filtered(|cell, _| {
                (-by..=by).any(|k| {
                    (-by..=by).any(|j| (-by..=by).any(|i| rows.find([cell[0] + i, cell[1] + j, cell[2] + k]).is_some()))
                })
            });
            assert_eq!(near, expected, "{by}");
        }
    }
}
