//! Velocity continued past the faces where it is known.
//!
//! Layer by layer outward, an unknown face takes the mean of what its known neighbours say: a neighbour with another
//! known face behind it, on the same line, continues linearly; only where no neighbour has one do they say what they are
//! themselves. Linear fields, rigid rotation among them, are continued exactly.

use std::ops::Range;

use numerics::parallel;

use crate::rows::{CellRows, RowSpan};
use crate::velocity::{ALL_FACES, FaceFields, FaceMask};

/// A row that is not stored.
const NONE: u32 = u32::MAX;

/// Values that one thread goes through.
const CHUNK: usize = 8192;

/// Stored cells next to each other along x; each row beside them is stored for all of them or for none.
#[derive(Clone, Copy, Debug)]
struct Line {
    at: u32,
    len: u32,
    /// Whether the cells before the first and after the last are stored.
    joined: [bool; 2],
    /// Where the first value of the rows at y − 2, y − 1, y + 1, y + 2 and z − 2, z − 1, z + 1, z + 2 is.
    beside: [u32; 8],
}

const BESIDE: [[i32; 2]; 8] = [[-2, 0], [-1, 0], [1, 0], [2, 0], [0, -2], [0, -1], [0, 1], [0, 2]];

/// Pairs of a neighbour and the one behind it, as numbers of [`BESIDE`].
const PAIRS: [[usize; 2]; 4] = [[1, 0], [2, 3], [5, 4], [6, 7]];

/// What a cell gained in a layer.
struct Gain<const F: usize> {
    at: u32,
    faces: FaceMask,
    values: [[f32; 3]; F],
}

/// What the cells of neighbouring lines gained in a layer, and which of the lines did.
struct Gains<const F: usize> {
    cells: Vec<Gain<F>>,
    lines: Vec<u32>,
}

/// The lines beside which, or in which, faces became known in the last layer: others gain nothing in the next.
struct Front {
    is_near: Vec<bool>,
    /// The line of each cell.
    line_of: Vec<u32>,
}

impl Front {
    fn new(lines: &[Line]) -> Self {
        let line_of = lines.iter().enumerate().flat_map(|(n, line)| std::iter::repeat_n(n as u32, line.len as usize));
        Self { is_near: vec![true; lines.len()], line_of: line_of.collect() }
    }

    /// Goes on from the lines that gained.
    fn advance<'a>(&mut self, lines: &[Line], gained: impl Iterator<Item = &'a u32>) {
        self.is_near.fill(false);
        for number in gained.map(|number| *number as usize) {
            let line = &lines[number];
            self.is_near[number] = true;
            if line.joined[0] {
                self.is_near[number - 1] = true;
            }
            if line.joined[1] {
                self.is_near[number + 1] = true;
            }
            for row in PAIRS.map(|[near, _]| line.beside[near]).into_iter().filter(|row| *row != NONE) {
                let [first, last] = [row, row + line.len - 1].map(|at| self.line_of[at as usize] as usize);
                self.is_near[first..=last].fill(true);
            }
        }
    }
}

/// Continues `fields` on `rows` from the faces `known` to all others that can be reached. Differences between faces one
/// behind the other count as at most `steepest`, which bounds what a rough field grows to. At most `layers` are added.
/// In parallel; the same bits on any number of threads.
///
/// # Panics
/// Where a field does not have one value a cell.
pub fn extrapolate<const F: usize>(
    rows: &CellRows,
    known: &mut [FaceMask],
    mut fields: [&mut FaceFields<f32>; F],
    steepest: f32,
    layers: u32,
) {
    let fits = |faces: &&mut FaceFields<f32>| faces.iter().all(|field| field.len() == rows.len());
    assert!(known.len() == rows.len() && fields.iter().all(fits), "one value a cell");
    let lines = lines(rows);
    let chunks = chunks(&lines);
    let mut front = Front::new(&lines);
    for _ in 0..layers {
        let gains: Vec<Gains<F>> = {
            let layer = Layer { lines: &lines, known, fields: fields.each_ref().map(|faces| &**faces), steepest };
            parallel::map(&chunks, |_, chunk| layer.gains(chunk, &front.is_near))
        };
        if gains.iter().all(|gains| gains.lines.is_empty()) {
            return;
        }
        for gain in gains.iter().flat_map(|gains| &gains.cells) {
            let at = gain.at as usize;
            known[at] |= gain.faces;
            for (faces, values) in fields.iter_mut().zip(gain.values) {
                for axis in 0..3 {
                    if gain.faces >> axis & 1 == 1 {
                        faces[axis][at] = values[axis];
                    }
                }
            }
        }
        front.advance(&lines, gains.iter().flat_map(|gains| &gains.lines));
    }
}

struct Layer<'a, const F: usize> {
    lines: &'a [Line],
    known: &'a [FaceMask],
    fields: [&'a FaceFields<f32>; F],
    steepest: f32,
}

impl<const F: usize> Layer<'_, F> {
    fn gains(&self, chunk: &Range<usize>, is_near: &[bool]) -> Gains<F> {
        let mut gains = Gains { cells: Vec::new(), lines: Vec::new() };
        let mut reached = Vec::new();
        for number in chunk.clone().filter(|number| is_near[*number]) {
            let line = &self.lines[number];
            let own = &self.known[line.at as usize..][..line.len as usize];
            if own.iter().fold(ALL_FACES, |all, mask| all & mask) == ALL_FACES {
                continue;
            }
            self.reach(line, own, &mut reached);
            let before = gains.cells.len();
            for (n, faces) in reached.iter().enumerate().filter(|(_, faces)| **faces != 0) {
                gains.cells.push(self.gain(line, n, *faces));
            }
            if gains.cells.len() > before {
                gains.lines.push(number as u32);
            }
        }
        gains
    }

    /// The unknown faces of each cell that have a known neighbour.
    fn reach(&self, line: &Line, own: &[FaceMask], reached: &mut Vec<FaceMask>) {
        reached.clear();
        reached.resize(own.len(), 0);
        for row in PAIRS.map(|[near, _]| line.beside[near]).into_iter().filter(|row| *row != NONE) {
            let near = &self.known[row as usize..][..own.len()];
            reached.iter_mut().zip(near).for_each(|(reached, mask)| *reached |= mask);
        }
        let last = own.len() - 1;
        reached[1..].iter_mut().zip(own).for_each(|(reached, mask)| *reached |= mask);
        reached[..last].iter_mut().zip(&own[1..]).for_each(|(reached, mask)| *reached |= mask);
        if line.joined[0] {
            reached[0] |= self.known[line.at as usize - 1];
        }
        if line.joined[1] {
            reached[last] |= self.known[line.at as usize + own.len()];
        }
        reached.iter_mut().zip(own).for_each(|(reached, mask)| *reached &= !mask);
    }

    fn gain(&self, line: &Line, n: usize, faces: FaceMask) -> Gain<F> {
        let pairs = pairs(line, n as u32);
        let mut gain = Gain { at: line.at + n as u32, faces, values: [[0.0; 3]; F] };
        for axis in (0..3).filter(|axis| faces >> axis & 1 == 1) {
            let is_known = |at: u32| at != NONE && self.known[at as usize] >> axis & 1 == 1;
            let mut count = [0.0_f32; 2];
            // Of neighbours with a known face behind them, and of the others.
            let mut sums = [[0.0; 2]; F];
            for [near, behind] in pairs {
                if !is_known(near) {
                    continue;
                }
                let linear = is_known(behind);
                count[usize::from(!linear)] += 1.0;
                for (faces, sums) in self.fields.iter().zip(&mut sums) {
                    let value = faces[axis][near as usize];
                    let slope = if linear { self.limited(value - faces[axis][behind as usize]) } else { 0.0 };
                    sums[usize::from(!linear)] += value + slope;
                }
            }
            let kind = usize::from(count[0] == 0.0);
            for (values, sums) in gain.values.iter_mut().zip(sums) {
                values[axis] = sums[kind] / count[kind];
            }
        }
        gain
    }

    fn limited(&self, slope: f32) -> f32 {
        let slope = if slope > self.steepest { self.steepest } else { slope };
        if slope < -self.steepest { -self.steepest } else { slope }
    }
}

/// Each neighbour of a cell of a line, and the cell behind it.
#[inline(always)]
fn pairs(line: &Line, n: u32) -> [[u32; 2]; 6] {
    let at = line.at + n;
    // Cells of a line that follow each other are stored next to each other; beyond its ends one more is known of.
    let below = n + u32::from(line.joined[0]);
    let above = line.len - 1 - n + u32::from(line.joined[1]);
    let down = |by: u32| if by <= below { at - by } else { NONE };
    let up = |by: u32| if by <= above { at + by } else { NONE };
    let row = |row: usize| if line.beside[row] == NONE { NONE } else { line.beside[row] + n };
    let pair = |[near, behind]: [usize; 2]| [row(near), row(behind)];
    let [a, b, c, d] = PAIRS;
    [[down(1), down(2)], [up(1), up(2)], pair(a), pair(b), pair(c), pair(d)]
}

/// Cuts spans wherever a row beside them begins or ends.
fn lines(rows: &CellRows) -> Vec<Line> {
    let mut lines = Vec::new();
    for ([y, z], spans) in rows.rows() {
        let mut beside = BESIDE.map(|[j, k]| rows.row(y + j, z + k));
        for span in spans {
            let mut x = span.start;
            while x < span.end {
                let mut end = span.end;
                let found = beside.each_mut().map(|row| {
                    let (base, until) = base_at(row, x);
                    end = end.min(until);
                    base
                });
                let joined = [x > span.start, end < span.end];
                lines.push(Line { at: span.at(x) as u32, len: (end - x) as u32, joined, beside: found });
                x = end;
            }
        }
    }
    lines
}

/// Where a row stores `x`, and until which cell that holds. Drops the spans before it.
fn base_at(row: &mut &[RowSpan], x: i32) -> (u32, i32) {
    while let Some((first, rest)) = row.split_first()
        && first.end <= x
    {
        *row = rest;
    }
    match row.first() {
        Some(span) if span.start <= x => (span.at(x) as u32, span.end),
        Some(span) => (NONE, span.start),
        None => (NONE, i32::MAX),
    }
}

fn chunks(lines: &[Line]) -> Vec<Range<usize>> {
    let mut chunks = Vec::new();
    let mut first = 0;
    for number in 0..lines.len() {
        let next = lines.get(number + 1);
        if next.is_none_or(|next| next.at as usize / CHUNK != lines[first].at as usize / CHUNK) {
            chunks.push(first..number + 1);
            first = number + 1;
        }
    }
    chunks
}
