//! Between a grid and the next coarser one: trilinear interpolation, and its transpose.
//!
//! The caller scales the weights of each fine cell so that those of coarse cells that do not exist are left out and the
//! others sum to 1. That halves the number of iterations.

use std::cmp::{max, min};

use numerics::simd::{Path, kernel};

use crate::rows::{CellRows, RowSpan};
use crate::stencil::{Run, Stencil};

/// Where the values of a field are in their cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// At the centre.
    Centre,
    /// At the centre of the low face along an axis.
    Face(usize),
}

impl Place {
    /// Whether values along `axis` lie on the faces, so that every other fine one lies on a coarse one.
    fn is_on_faces(self, axis: usize) -> bool {
        self == Self::Face(axis)
    }

    /// The two coarse numbers nearest to a fine one along `axis`, with their weights.
    fn parents(self, axis: usize, n: i32) -> [(i32, f32); 2] {
        let (half, odd) = (n.div_euclid(2), n.rem_euclid(2));
        match (self.is_on_faces(axis), odd) {
            (true, 0) => [(half, 1.0), (half + 1, 0.0)],
            (true, _) => [(half, 0.5), (half + 1, 0.5)],
            (false, _) => [(half, 0.75), (half + 2 * odd - 1, 0.25)],
        }
    }

    /// The four fine numbers that have a coarse one among their parents, from 2n − 1 on, with its weights.
    fn children(self, axis: usize) -> [f32; 4] {
        if self.is_on_faces(axis) { [0.5, 1.0, 0.5, 0.0] } else { [0.25, 0.75, 0.75, 0.25] }
    }
}

/// `out` = the transpose of interpolation of a fine residual, already scaled, in the active cells of `coarse`.
pub(crate) fn restrict(place: Place, fine: &CellRows, coarse: &Stencil, residual: &[f32], out: &mut [f32]) {
    let path = Path::chosen();
    coarse.update([out], |runs, first, [out]| restrict_chunk(path, runs, first, place, fine, residual, out));
}

/// `q` += `scale` · the interpolated `correction`, in the active cells of `fine`.
pub(crate) fn add_interpolated(
    place: Place,
    fine: &Stencil,
    coarse: &CellRows,
    scale: &[f32],
    correction: &[f32],
    q: &mut [f32],
) {
    let path = Path::chosen();
    let from = Interpolated { place, rows: coarse, field: correction };
    fine.update([q], |runs, first, [q]| interpolate_chunk(path, runs, first, &from, scale, q));
}

struct Interpolated<'a> {
    place: Place,
    rows: &'a CellRows,
    field: &'a [f32],
}

kernel! {
    fn restrict_chunk(
        runs: &[Run], first: usize, place: Place, fine: &CellRows, residual: &[f32], out: &mut [f32],
    ) = restrict_body;
}

kernel! {
    fn interpolate_chunk<'a>(
        runs: &[Run], first: usize, from: &Interpolated<'a>, scale: &[f32], q: &mut [f32],
    ) = interpolate_body;
}

#[inline(always)]
fn restrict_body(runs: &[Run], first: usize, place: Place, fine: &CellRows, residual: &[f32], out: &mut [f32]) {
    let mut line = Vec::new();
    let [along_x, along_y, along_z] = [0, 1, 2].map(|axis| place.children(axis));
    let weights: [f32; 16] = std::array::from_fn(|row| along_y[row % 4] * along_z[row / 4]);
    let (mut last, mut near): (_, [&[RowSpan]; 16]) = (None, [&[]; 16]);
    for run in runs {
        let n = run.len as usize;
        let [x, y, z] = run.cell.map(|n| 2 * n - 1);
        if last != Some([y, z]) {
            last = Some([y, z]);
            near = std::array::from_fn(|row| fine.row(y + row as i32 % 4, z + row as i32 / 4));
        }
        let line = zeros(&mut line, 2 * n + 2);
        for (row, weight) in near.iter_mut().zip(weights) {
            add_row(row, residual, x, weight, line);
        }
        let out = &mut out[run.at as usize - first..][..n];
        let [a, b, c, d] = along_x;
        for i in 0..n {
            let line = &line[2 * i..][..4];
            out[i] = (a * line[0] + b * line[1]) + (c * line[2] + d * line[3]);
        }
    }
}

#[inline(always)]
fn interpolate_body(runs: &[Run], first: usize, from: &Interpolated<'_>, scale: &[f32], q: &mut [f32]) {
    let (mut line, mut fine_line) = (Vec::new(), Vec::new());
    let place = from.place;
    let (mut last, mut near): (_, [(&[RowSpan], f32); 4]) = (None, [(&[], 0.0); 4]);
    for run in runs {
        let n = run.len as usize;
        let (low, odd) = (run.cell[0].div_euclid(2), run.cell[0].rem_euclid(2) as usize);
        let pairs = (odd + n).div_ceil(2);
        let [_, y, z] = run.cell;
        if last != Some([y, z]) {
            last = Some([y, z]);
            let (ys, zs) = (place.parents(1, y), place.parents(2, z));
            near = std::array::from_fn(|row| {
                let ((y, weight_y), (z, weight_z)) = (ys[row % 2], zs[row / 2]);
                (from.rows.row(y, z), weight_y * weight_z)
            });
        }
        let line = zeros(&mut line, pairs + 2);
        for (row, weight) in &mut near {
            add_row(row, from.field, low - 1, *weight, line);
        }
        if fine_line.len() < 2 * pairs {
            fine_line.resize(2 * pairs, 0.0);
        }
        let (twos, _) = fine_line[..2 * pairs].as_chunks_mut::<2>();
        // Weights of the coarse values before, at and after for the even and the odd fine value.
        let [even, odd_weights] = if place.is_on_faces(0) {
            [[0.0, 1.0, 0.0], [0.0, 0.5, 0.5]]
        } else {
            [[0.25, 0.75, 0.0], [0.0, 0.75, 0.25]]
        };
        for i in 0..pairs {
            let [before, at, after] = [line[i], line[i + 1], line[i + 2]];
            twos[i] = [even[0] * before + even[1] * at, odd_weights[1] * at + odd_weights[2] * after];
        }
        let (q, scale) = (&mut q[run.at as usize - first..][..n], &scale[run.range()]);
        let values = &fine_line[odd..][..n];
        for i in 0..n {
            q[i] += scale[i] * values[i];
        }
    }
}

/// The first values of a list, which grows to hold them, all 0.
#[inline(always)]
fn zeros(line: &mut Vec<f32>, len: usize) -> &mut [f32] {
    if line.len() < len {
        line.resize(len, 0.0);
    }
    let line = &mut line[..len];
    line.fill(0.0);
    line
}

/// `line` += `weight` · the values of the cells of a row from `from` on, 0 where they are not stored. Drops the spans before
/// them from the row: calls for a row ascend.
#[inline(always)]
pub(crate) fn add_row(row: &mut &[RowSpan], field: &[f32], from: i32, weight: f32, line: &mut [f32]) {
    if weight == 0.0 {
        return;
    }
    while let Some((first, rest)) = row.split_first()
        && first.end <= from
    {
        *row = rest;
    }
    let end = from + line.len() as i32;
    for span in row.iter().take_while(|span| span.start < end) {
        let (start, end) = (max(span.start, from), min(span.end, end));
        let values = &field[span.at(start)..][..(end - start) as usize];
        let line = &mut line[(start - from) as usize..][..values.len()];
        for i in 0..values.len() {
            line[i] += weight * values[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::Cell;

    /// Calls `f` with the coarse cells that a fine value is interpolated from, and their weights.
    fn each_parent(place: Place, cell: Cell, mut f: impl FnMut(Cell, f32)) {
        let [xs, ys, zs] = [0, 1, 2].map(|axis| place.parents(axis, cell[axis]));
        for (z, weight_z) in zs {
            for (y, weight_y) in ys {
                for (x, weight_x) in xs {
                    let weight = weight_x * weight_y * weight_z;
                    if weight > 0.0 {
                        f([x, y, z], weight);
                    }
                }
            }
        }
    }

    /// Values that grow linearly are interpolated exactly, and restriction is the transpose of interpolation.
    #[test]
    fn interpolation_is_linear_and_restriction_its_transpose() {
        let fine = Stencil::around(CellRows::cuboid([-3, 2, -6], [14, 11, 7]), 1);
        let coarse = Stencil::around(CellRows::cuboid([-4, -1, -5], [10, 9, 8]), 1);
        for place in [Place::Centre, Place::Face(0), Place::Face(1), Place::Face(2)] {
            let position = |cell: Cell, size: f32| {
                let at = |axis| cell[axis] as f32 + if place.is_on_faces(axis) { 0.0 } else { 0.5 };
                [at(0), at(1), at(2)].map(|x| size * x)
            };
            let linear = |[x, y, z]: [f32; 3]| 3.0 * x - 2.0 * y + 0.5 * z + 1.0;
            let values = coarse.rows().tabulate(|cell| linear(position(cell, 2.0)));
            let ones = vec![1.0; fine.rows().len()];
            let mut interpolated = vec![0.0; fine.rows().len()];
            add_interpolated(place, &fine, coarse.rows(), &ones, &values, &mut interpolated);
            for cell in fine.active().iter() {
                let value = interpolated[fine.rows().find(cell).unwrap()];
                assert!((value - linear(position(cell, 1.0))).abs() < 1e-4, "{place:?} {cell:?}");
                let mut sum = 0.0;
                each_parent(place, cell, |parent, weight| sum += weight * linear(position(parent, 2.0)));
                assert!((value - sum).abs() < 1e-4, "{place:?} {cell:?}");
            }
            // Small whole numbers: sums are exact.
            let number = |cell: Cell| ((cell[0] * 5 + cell[1] * 3 + cell[2]).rem_euclid(7) - 3) as f32;
            let active = |stencil: &Stencil| -> Vec<f32> {
                stencil.rows().tabulate(|cell| if stencil.active().find(cell).is_some() { number(cell) } else { 0.0 })
            };
            let (a, b) = (active(&fine), active(&coarse));
            let (mut up, mut down) = (vec![0.0; b.len()], vec![0.0; a.len()]);
            restrict(place, fine.rows(), &coarse, &a, &mut up);
            add_interpolated(place, &fine, coarse.rows(), &ones, &b, &mut down);
            let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
            assert_eq!(dot(&a, &down), dot(&up, &b), "{place:?}");
        }
    }
}
