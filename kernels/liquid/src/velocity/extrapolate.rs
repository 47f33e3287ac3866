//! Velocity continued past the faces where it is known.
//!
//! Layer by layer outward, an unknown face takes the mean of what its known neighbours say: a neighbour with another
//! known face behind it, or two, on the same line, continues linearly; only where no neighbour has do they say what they are
//! themselves. Linear fields, rigid rotation among them, are continued exactly.

use std::mem::replace;
use std::ops::Range;

use numerics::parallel;
use numerics::simd::{Path, kernel};

use crate::rows::{CellRows, RowSpan};
use crate::velocity::{ALL_FACES, FaceFields, FaceMask};

/// Values that one thread goes through.
const CHUNK: usize = 8192;

/// Rows that one thread cuts into lines.
const ROWS: usize = 64;

/// Stored cells next to each other along x; each row beside them is stored for all of them or for none.
#[derive(Clone, Copy, Debug)]
struct Line {
    at: u32,
    len: u32,
    /// Whether the cells before the first and after the last are stored.
    joined: [bool; 2],
    /// Where the first value of each of the rows [`BESIDE`] is; of rows that are not stored, a place past all cells, where
    /// nothing is known.
    beside: [u32; 12],
    /// From there to the value beside the next cell: 1, or 0 where the row is not stored.
    step: [u32; 12],
}

/// Rows beside a line, as steps along y and z: on each of four sides the next, the one behind it and the third.
#[rustfmt::skip]
const BESIDE: [[i32; 2]; 12] = [
    [-1, 0], [-2, 0], [-3, 0],
    [1, 0], [2, 0], [3, 0],
    [0, -1], [0, -2], [0, -3],
    [0, 1], [0, 2], [0, 3],
];

impl Line {
    /// Where the rows next to it that are stored have its cells.
    #[inline(always)]
    fn rows_beside(&self) -> impl Iterator<Item = Range<usize>> {
        let rows = (0..BESIDE.len()).step_by(3).filter(|near| self.step[*near] == 1);
        rows.map(|near| self.beside[near] as usize..(self.beside[near] + self.len) as usize)
    }

    /// Each neighbour of a cell, the one behind it and the third.
    #[inline(always)]
    fn sides(&self, n: u32, nowhere: usize) -> [[usize; 3]; 6] {
        // Cells of a line that follow each other are stored next to each other; beyond its ends one more is known of.
        let (at, below) = (self.at + n, n + u32::from(self.joined[0]));
        let above = self.len - 1 - n + u32::from(self.joined[1]);
        let down = |by: u32| if by <= below { (at - by) as usize } else { nowhere };
        let up = |by: u32| if by <= above { (at + by) as usize } else { nowhere };
        let side = |first: usize| [0, 1, 2].map(|by| (self.beside[first + by] + n * self.step[first + by]) as usize);
        [[1, 2, 3].map(down), [1, 2, 3].map(up), side(0), side(3), side(6), side(9)]
    }
}

/// Which differences between faces one behind the other are continued.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slopes {
    /// What they count as at most, which bounds what a rough field grows to.
    pub steepest: f32,
    /// Whether only those of smooth fields are: all of a difference that is the same as the next, nothing of one that is twice the
    /// next or half of it.
    pub smooth: bool,
}

impl Slopes {
    /// None: values go on as they are.
    const FLAT: Self = Self::nearest(0.0);

    /// The nearest difference, whatever the next is.
    pub const fn nearest(steepest: f32) -> Self {
        Self { steepest, smooth: false }
    }

    /// What follows a neighbour, the one behind it and the third, in each lane. Without branches: lanes that do not count may be
    /// anything.
    #[inline(always)]
    fn after(self, near: &Lanes, behind: &Lanes, third: &Lanes) -> Lanes {
        let mut slopes = [0.0; 4];
        for lane in 0..4 {
            slopes[lane] = near[lane] - behind[lane];
        }
        if self.smooth {
            for lane in 0..4 {
                let (nearest, next) = (slopes[lane], behind[lane] - third[lane]);
                let is_less = nearest.abs() < next.abs();
                let (less, more) = (if is_less { nearest } else { next }, if is_less { next } else { nearest });
                let rough = 3.0 * (more - less) / (more + less);
                let counts = (nearest * next > 0.0) & (rough < 1.0);
                slopes[lane] = if counts { less * (1.0 - rough) } else { 0.0 };
            }
        }
        let mut values = *near;
        for (value, slope) in values.iter_mut().zip(slopes) {
            let bounded = if slope > self.steepest { self.steepest } else { slope };
            *value += if bounded < -self.steepest { -self.steepest } else { bounded };
        }
        values
    }
}

/// The values of a cell's three faces, and a spare one.
type Lanes = [f32; 4];

/// All bits of the lanes of a mask of faces.
const BITS: [[u32; 4]; 8] = {
    let (mut all, mut mask) = ([[0; 4]; 8], 0);
    while mask < 8 {
        let mut axis = 0;
        while axis < 3 {
            all[mask][axis] = if mask >> axis & 1 == 1 { u32::MAX } else { 0 };
            axis += 1;
        }
        mask += 1;
    }
    all
};

/// Adds the lanes of a mask of faces.
#[inline(always)]
fn add_lanes(sums: &mut Lanes, values: Lanes, faces: FaceMask) {
    let bits = &BITS[usize::from(faces & ALL_FACES)];
    for lane in 0..4 {
        sums[lane] += f32::from_bits(values[lane].to_bits() & bits[lane]);
    }
}

/// What a cell gained in a layer.
struct Gain<const F: usize> {
    at: u32,
    faces: FaceMask,
    values: [Lanes; F],
}

/// What the cells of neighbouring lines gained in a layer, and which of the lines did.
struct Gains<const F: usize> {
    cells: Vec<Gain<F>>,
    lines: Vec<u32>,
}

/// Part of the fields, which one thread changes.
struct Part<'a, const F: usize> {
    /// Where its first cell is.
    first: usize,
    known: &'a mut [FaceMask],
    values: &'a mut [[Lanes; F]],
    fields: [[&'a mut [f32]; 3]; F],
}

impl<'a, const F: usize> Part<'a, F> {
    /// The cells before place `end`; the rest stays.
    fn split_off(&mut self, end: usize) -> Self {
        let len = end - self.first;
        let first = replace(&mut self.first, end);
        let known = self.known.split_off_mut(..len).unwrap_or_default();
        let values = self.values.split_off_mut(..len).unwrap_or_default();
        let part = |field: &mut &'a mut [f32]| field.split_off_mut(..len).unwrap_or_default();
        let fields = self.fields.each_mut().map(|faces| faces.each_mut().map(part));
        Self { first, known, values, fields }
    }

    /// Puts the values of each cell together.
    fn pack(&mut self) {
        for (n, values) in self.values.iter_mut().enumerate() {
            for (lanes, faces) in values.iter_mut().zip(&self.fields) {
                *lanes = [faces[0][n], faces[1][n], faces[2][n], 0.0];
            }
        }
    }

    fn apply(&mut self, gains: &[Gain<F>]) {
        for gain in gains {
            let n = gain.at as usize - self.first;
            self.known[n] |= gain.faces;
            for (own, values) in self.values[n].iter_mut().zip(&gain.values) {
                for axis in (0..3).filter(|axis| gain.faces >> axis & 1 == 1) {
                    own[axis] = values[axis];
                }
            }
        }
    }

    /// Gives the fields their values back.
    fn unpack(&mut self) {
        for (n, values) in self.values.iter().enumerate() {
            for (lanes, faces) in values.iter().zip(&mut self.fields) {
                for axis in 0..3 {
                    faces[axis][n] = lanes[axis];
                }
            }
        }
    }
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
            for row in line.rows_beside() {
                let [first, last] = [row.start, row.end - 1].map(|at| self.line_of[at] as usize);
                self.is_near[first..=last].fill(true);
            }
        }
    }
}

/// Continues `fields` on `rows` from the faces `known` to all others that can be reached: for so many `layers` each by its
/// `slopes`, farther as it is. In parallel; the same bits on any number of threads.
///
/// # Panics
/// Where a field does not have one value a cell.
pub fn extrapolate<const F: usize>(
    rows: &CellRows,
    known: &mut [FaceMask],
    mut fields: [&mut FaceFields<f32>; F],
    slopes: [Slopes; F],
    layers: u32,
) {
    let fits = |faces: &&mut FaceFields<f32>| faces.iter().all(|field| field.len() == rows.len());
    assert!(known.len() == rows.len() && fields.iter().all(fits), "one value a cell");
    let (path, lines, nowhere) = (Path::chosen(), lines(rows), rows.len());
    let chunks = chunks(&lines);
    let mut front = Front::new(&lines);
    // One more place than cells, where nothing is known.
    let mut packed = vec![[[0.0; 4]; F]; nowhere + 1];
    let mut masks = [&*known, &[0]].concat();
    let mut update = |masks: &mut [FaceMask], packed: &mut [[Lanes; F]], change: &Change<'_, F>| {
        let fields = fields.each_mut().map(|faces| faces.each_mut().map(|field| &mut field[..]));
        let mut rest = Part { first: 0, known: masks, values: packed, fields };
        let end = |chunk: &Range<usize>| lines.get(chunk.end).map_or(nowhere, |next| next.at as usize);
        parallel::for_each(chunks.iter().map(|chunk| rest.split_off(end(chunk))), change);
    };
    update(&mut masks, &mut packed, &|_, mut part| part.pack());
    for layer in 0.. {
        let gains: Vec<Gains<F>> = {
            let slopes = if layer < layers { slopes } else { [Slopes::FLAT; F] };
            let layer = Layer { lines: &lines, known: &masks, values: &packed, slopes };
            parallel::map(&chunks, |_, chunk| gains(path, &layer, chunk, &front.is_near))
        };
        if gains.iter().all(|gains| gains.lines.is_empty()) {
            break;
        }
        update(&mut masks, &mut packed, &|n, mut part| part.apply(&gains[n].cells));
        front.advance(&lines, gains.iter().flat_map(|gains| &gains.lines));
    }
    update(&mut masks, &mut packed, &|_, mut part| part.unpack());
    known.copy_from_slice(&masks[..nowhere]);
}

/// What to do with each part, given its number.
type Change<'a, const F: usize> = dyn Fn(usize, Part<'_, F>) + Sync + 'a;

struct Layer<'a, const F: usize> {
    lines: &'a [Line],
    /// Of each cell, and of one more.
    known: &'a [FaceMask],
    values: &'a [[Lanes; F]],
    slopes: [Slopes; F],
}

kernel! {
    fn gains<const F: usize>(layer: &Layer<'_, F>, chunk: &Range<usize>, is_near: &[bool]) -> Gains<F> = gains_body;
}

#[inline(always)]
fn gains_body<const F: usize>(layer: &Layer<'_, F>, chunk: &Range<usize>, is_near: &[bool]) -> Gains<F> {
    layer.gains(chunk, is_near)
}

impl<const F: usize> Layer<'_, F> {
    #[inline(always)]
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
            for (n, faces) in (0..).zip(&reached).filter(|(_, faces)| **faces != 0) {
                gains.cells.push(self.gain(line, n, *faces));
            }
            if gains.cells.len() > before {
                gains.lines.push(number as u32);
            }
        }
        gains
    }

    /// The unknown faces of each cell that have a known neighbour.
    #[inline(always)]
    fn reach(&self, line: &Line, own: &[FaceMask], reached: &mut Vec<FaceMask>) {
        reached.clear();
        reached.resize(own.len(), 0);
        for row in line.rows_beside() {
            reached.iter_mut().zip(&self.known[row]).for_each(|(reached, mask)| *reached |= mask);
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

    #[inline(always)]
    fn gain(&self, line: &Line, n: u32, faces: FaceMask) -> Gain<F> {
        // Of neighbours with as many known faces behind them as slopes need, and of the others.
        let (mut sums, mut counts) = ([[[0.0; 4]; 2]; F], [[[0.0; 4]; 2]; F]);
        for [near, behind, third] in line.sides(n, self.known.len() - 1) {
            let known = faces & self.known[near];
            if known == 0 {
                continue;
            }
            let pairs = known & self.known[behind];
            let triples = pairs & self.known[third];
            let (near, behind, third) = (&self.values[near], &self.values[behind], &self.values[third]);
            for (field, slopes) in self.slopes.iter().enumerate() {
                let linear = if slopes.smooth { triples } else { pairs };
                if linear != 0 {
                    let values = slopes.after(&near[field], &behind[field], &third[field]);
                    add_lanes(&mut counts[field][0], [1.0; 4], linear);
                    add_lanes(&mut sums[field][0], values, linear);
                }
                if linear != known {
                    add_lanes(&mut counts[field][1], [1.0; 4], known & !linear);
                    add_lanes(&mut sums[field][1], near[field], known & !linear);
                }
            }
        }
        let mean = |field: usize, lane: usize| {
            let kind = usize::from(counts[field][0][lane] == 0.0);
            sums[field][kind][lane] / counts[field][kind][lane]
        };
        let values = std::array::from_fn(|field| std::array::from_fn(|lane| mean(field, lane)));
        Gain { at: line.at + n, faces, values }
    }
}

/// Cuts spans wherever a row beside them begins or ends. In parallel.
fn lines(rows: &CellRows) -> Vec<Line> {
    let all: Vec<_> = rows.rows().collect();
    parallel::concat(parallel::map(all.chunks(ROWS), |_, part| lines_of(rows, part)))
}

/// The lines of some rows.
fn lines_of(rows: &CellRows, part: &[([i32; 2], &[RowSpan])]) -> Vec<Line> {
    let (mut lines, nowhere) = (Vec::new(), rows.len() as u32);
    for ([y, z], spans) in part {
        let mut beside = BESIDE.map(|[j, k]| rows.row(y + j, z + k));
        for span in *spans {
            let mut x = span.start;
            while x < span.end {
                let mut end = span.end;
                let found = beside.each_mut().map(|row| {
                    let (base, until) = base_at(row, x);
                    end = end.min(until);
                    base
                });
                let joined = [x > span.start, end < span.end];
                let (beside, step) = (found.map(|at| at.unwrap_or(nowhere)), found.map(|at| u32::from(at.is_some())));
                lines.push(Line { at: span.at(x) as u32, len: (end - x) as u32, joined, beside, step });
                x = end;
            }
        }
    }
    lines
}

/// Where a row stores `x`, and until which cell that holds. Drops the spans before it.
fn base_at(row: &mut &[RowSpan], x: i32) -> (Option<u32>, i32) {
    while let Some((first, rest)) = row.split_first()
        && first.end <= x
    {
        *row = rest;
    }
    match row.first() {
        Some(span) if span.start <= x => (Some(span.at(x) as u32), span.end),
        Some(span) => (None, span.start),
        None => (None, i32::MAX),
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
