//! The pressure equation on a grid with cells twice as large.
//!
//! Two details keep the number of iterations the same at any size. A coarse cell is liquid only if at least as many of
//! its children are liquid as air. And the distance of the surface from a coarse cell is kept for each face apart: the
//! mean over the four columns of children that cross the face.

use crate::grids::{Children, at_low_face};
use crate::rows::{Cell, CellRows, Finder};
use crate::stencil::Stencil;

use super::level::{CellKind, HALO, Level, SurfaceDistances};

/// Least distance of the surface from the centre of a coarse cell, in its cells.
const LEAST_DISTANCE: f32 = 0.1;

/// The next coarser grid; `None` where no cell of it is liquid.
pub(super) fn coarsened(fine: &Level, distances: &SurfaceDistances) -> Option<(Level, SurfaceDistances)> {
    let candidates = fine.rows().halved();
    let finder = || Finder::new(fine.rows());
    let [kinds] = candidates.tabulate_with(finder, |finder, cell, _| [kind(fine, finder, cell)]);
    let periods = fine.images.periods().halved();
    let liquid = candidates.filtered(|cell, at| kinds[at] == CellKind::Liquid && periods.holds(cell));
    if liquid.is_empty() {
        return None;
    }
    let stencil = Stencil::within(periods.stored(liquid.dilated(HALO), HALO), liquid);
    let images = periods.images(stencil.rows());
    let mut kinds = stencil.rows().resampled(&candidates, &kinds, CellKind::Air);
    images.fill(&mut kinds);
    let mut weights = stencil
        .rows()
        .tabulate_with(finder, |finder, cell, _| [0, 1, 2].map(|axis| weight(&fine.weights[axis], finder, cell, axis)));
    images.fill_each(&mut weights);
    let mut coarse_distances = coarse_distances(fine, distances, stencil.rows(), &kinds);
    images.fill_each(&mut coarse_distances);
    let level = Level::new(stencil, kinds, weights, &coarse_distances, images);
    Some((level, coarse_distances))
}

fn kind(fine: &Level, finder: &Finder<'_>, coarse: Cell) -> CellKind {
    let is = |kind: CellKind| move |at: usize| fine.kinds[at] == kind;
    let children = Children::of(finder, coarse, is(CellKind::Liquid), is(CellKind::Air));
    match children {
        _ if children.are_liquid() => CellKind::Liquid,
        Children { air: 0, .. } => CellKind::Solid,
        _ => CellKind::Air,
    }
}

/// Four children's faces, with four times the area over twice the distance. Where none is stored the face is far from
/// any liquid, and open.
fn weight(weights: &[f32], finder: &Finder<'_>, coarse: Cell, axis: usize) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for column in at_low_face(coarse, axis) {
        if let Some(at) = finder.find(column) {
            sum += weights[at];
            count += 1.0;
        }
    }
    if count > 0.0 { 2.0 * sum / count } else { 2.0 }
}

fn coarse_distances(
    fine: &Level,
    distances: &SurfaceDistances,
    rows: &CellRows,
    kinds: &[CellKind],
) -> SurfaceDistances {
    let start = || (Finder::new(rows), Finder::new(fine.rows()));
    rows.tabulate_with(start, |(coarse, finder), cell, at| {
        [0, 1, 2].map(|axis| {
            let mut below = cell;
            below[axis] -= 1;
            let distance = |towards: i32| distance(fine, finder, &distances[axis], cell, axis, towards);
            match (coarse.find(below).map(|at| kinds[at]), kinds[at]) {
                (Some(CellKind::Liquid), CellKind::Air) => distance(1),
                (Some(CellKind::Air), CellKind::Liquid) => distance(-1),
                _ => 1.0,
            }
        })
    })
}

/// The distance of the surface from the centre of the liquid cell beside the low face of `coarse`, in coarse cells; the
/// liquid is below the face where `towards` is 1, above it where −1.
fn distance(fine: &Level, finder: &Finder<'_>, distances: &[f32], coarse: Cell, axis: usize, towards: i32) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for column in at_low_face(coarse, axis) {
        // Four cells from within the liquid outwards, the face between the second and the third.
        let first = if towards > 0 { column[axis] - 2 } else { column[axis] + 1 };
        let child = |n: usize| {
            let mut cell = column;
            cell[axis] = first + towards * n as i32;
            finder.find(cell)
        };
        let kinds = [0, 1, 2, 3].map(|n| child(n).map_or(CellKind::Air, |at| fine.kinds[at]));
        let Some(inside) = kinds.iter().position(|kind| *kind == CellKind::Liquid) else {
            count += 1.0;
            continue;
        };
        let end = (inside..4).find(|n| kinds[*n] != CellKind::Liquid).unwrap_or(4);
        if end < 4 && kinds[end] == CellKind::Solid {
            continue;
        }
        // The low face of the upper of the two cells.
        let face = if towards > 0 { child(end) } else { child(end - 1) };
        let beyond = face.map_or(1.0, |at| distances[at]);
        sum += (0.5 * (end as f32 - 1.0) - 0.25 + 0.5 * beyond).clamp(0.0, 1.0);
        count += 1.0;
    }
    if count > 0.0 { (sum / count).clamp(LEAST_DISTANCE, 1.0) } else { 1.0 }
}
