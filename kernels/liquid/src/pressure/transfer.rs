//! Between a grid and the next coarser one: trilinear interpolation, and its transpose.
//!
//! Weights of coarse cells that are solid are left out and the others scaled up to a sum of 1, so that walls do not pull
//! the pressure down; air counts, with pressure 0. That halves the number of iterations.

use std::cmp::{max, min};

use numerics::simd::{Path, kernel};

use crate::rows::{Cell, CellRows};
use crate::stencil::Run;

use super::level::{CellKind, Level};

/// Trilinear weights of the nearest coarse row and of the next, along an axis.
const NEAR: f32 = 0.75;
const FAR: f32 = 0.25;

/// What the weights of each fine cell are multiplied by; 0 where it is not liquid.
pub(super) fn scales(fine: &Level, coarse: &Level) -> Vec<f32> {
    let mut out = vec![0.0; fine.rows().len()];
    fine.stencil.update([&mut out], |runs, first, [out]| {
        for run in runs {
            for n in 0..run.len as usize {
                let cell = [run.cell[0] + n as i32, run.cell[1], run.cell[2]];
                out[run.at as usize - first + n] = scale(coarse, cell);
            }
        }
    });
    out
}

fn scale(coarse: &Level, cell: Cell) -> f32 {
    let near = cell.map(|n| n.div_euclid(2));
    let step = cell.map(|n| 2 * n.rem_euclid(2) - 1);
    let (mut sum, mut liquid) = (0.0, false);
    for corner in 0..8 {
        let is_far = [corner & 1, corner >> 1 & 1, corner >> 2];
        let at = coarse.rows().find([0, 1, 2].map(|axis| near[axis] + is_far[axis] * step[axis]));
        let kind = at.map_or(CellKind::Air, |at| coarse.kinds[at]);
        liquid |= kind == CellKind::Liquid;
        if kind != CellKind::Solid {
            sum += is_far.iter().map(|far| if *far == 1 { FAR } else { NEAR }).product::<f32>();
        }
    }
    if liquid { 1.0 / sum } else { 0.0 }
}

/// The coarse right-hand side of a fine residual that is already multiplied by [`scales`].
pub(super) fn restrict(fine: &Level, coarse: &Level, residual: &[f32], out: &mut [f32]) {
    let path = Path::chosen();
    coarse.stencil.update([out], |runs, first, [out]| restrict_chunk(path, runs, first, fine.rows(), residual, out));
}

/// `q` += `scale` · the interpolated `correction`.
pub(super) fn add_interpolated(fine: &Level, coarse: &Level, scale: &[f32], correction: &[f32], q: &mut [f32]) {
    let path = Path::chosen();
    fine.stencil
        .update([q], |runs, first, [q]| interpolate_chunk(path, runs, first, coarse.rows(), scale, correction, q));
}

kernel! {
    fn restrict_chunk(runs: &[Run], first: usize, fine: &CellRows, residual: &[f32], out: &mut [f32]) = restrict_body;
}

kernel! {
    fn interpolate_chunk(
        runs: &[Run], first: usize, coarse: &CellRows, scale: &[f32], correction: &[f32], q: &mut [f32],
    ) = interpolate_body;
}

#[inline(always)]
fn restrict_body(runs: &[Run], first: usize, fine: &CellRows, residual: &[f32], out: &mut [f32]) {
    let mut line = Vec::new();
    for run in runs {
        let n = run.len as usize;
        let [x, y, z] = run.cell.map(|n| 2 * n);
        line.clear();
        line.resize(2 * n + 2, 0.0);
        for (step_z, weight_z) in [(-1, FAR), (0, NEAR), (1, NEAR), (2, FAR)] {
            for (step_y, weight_y) in [(-1, FAR), (0, NEAR), (1, NEAR), (2, FAR)] {
                add_row(fine, residual, [x - 1, y + step_y, z + step_z], weight_y * weight_z, &mut line);
            }
        }
        let out = &mut out[run.at as usize - first..][..n];
        for (out, line) in out.iter_mut().zip(line.windows(4).step_by(2)) {
            *out = (FAR * line[0] + NEAR * line[1]) + (NEAR * line[2] + FAR * line[3]);
        }
    }
}

#[inline(always)]
fn interpolate_body(runs: &[Run], first: usize, coarse: &CellRows, scale: &[f32], correction: &[f32], q: &mut [f32]) {
    let (mut line, mut fine_line) = (Vec::new(), Vec::new());
    for run in runs {
        let n = run.len as usize;
        let low = run.cell.map(|n| n.div_euclid(2));
        let odd = run.cell.map(|n| n.rem_euclid(2));
        let pairs = (odd[0] as usize + n).div_ceil(2);
        line.clear();
        line.resize(pairs + 2, 0.0);
        for (step_z, weight_z) in [(0, NEAR), (2 * odd[2] - 1, FAR)] {
            for (step_y, weight_y) in [(0, NEAR), (2 * odd[1] - 1, FAR)] {
                let from = [low[0] - 1, low[1] + step_y, low[2] + step_z];
                add_row(coarse, correction, from, weight_y * weight_z, &mut line);
            }
        }
        fine_line.clear();
        fine_line.resize(2 * pairs, 0.0);
        let (twos, _) = fine_line.as_chunks_mut::<2>();
        for i in 0..pairs {
            let middle = NEAR * line[i + 1];
            twos[i] = [middle + FAR * line[i], middle + FAR * line[i + 2]];
        }
        let (q, scale) = (&mut q[run.at as usize - first..][..n], &scale[run.range()]);
        let values = &fine_line[odd[0] as usize..][..n];
        for i in 0..n {
            q[i] += scale[i] * values[i];
        }
    }
}

/// `line` += `weight` · the values of the cells from `from` on along x, 0 where they are not stored.
#[inline(always)]
fn add_row(rows: &CellRows, field: &[f32], from: Cell, weight: f32, line: &mut [f32]) {
    let end = from[0] + line.len() as i32;
    let row = rows.row(from[1], from[2]);
    let next = row.partition_point(|span| span.end <= from[0]);
    for span in row[next..].iter().take_while(|span| span.start < end) {
        let (start, end) = (max(span.start, from[0]), min(span.end, end));
        let values = &field[span.at(start)..][..(end - start) as usize];
        let line = &mut line[(start - from[0]) as usize..][..values.len()];
        for i in 0..values.len() {
            line[i] += weight * values[i];
        }
    }
}
