//! The closest point of a surface for each cell near it.

use std::mem::take;

use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::tree::{NONE, TriangleTree};
use numerics::vector::{Vec3, length, sub};

use crate::rows::{Cell, CellRows, RowSpan};

use super::topology::Part;

/// The closest point of a surface, and how far away it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    pub(super) triangle: u32,
    pub(super) weights: [f32; 3],
    pub(super) point: Vec3,
    pub(super) distance: f32,
}

impl Default for Foot {
    fn default() -> Self {
        Self { triangle: NONE, weights: [0.0; 3], point: [0.0; 3], distance: f32::INFINITY }
    }
}

kernel! {
    fn feet_of_span(tree: &TriangleTree, row: [i32; 2], span: RowSpan, reach: f32, out: &mut [Foot]) = span_body;
}

/// Above the rounding of a distance, as a share of it.
const ROUNDING: f32 = 1e-5;

#[inline(always)]
fn span_body(tree: &TriangleTree, [y, z]: [i32; 2], span: RowSpan, reach: f32, out: &mut [Foot]) {
    let mut last: Option<Vec3> = None;
    for (foot, x) in out.iter_mut().zip(span.start..span.end) {
        let middle = middle([x, y, z]);
        // The last cell's closest point bounds the distance of this one.
        let near = last.map_or(reach, |point| (length(sub(point, middle)) * (1.0 + ROUNDING) + ROUNDING).min(reach));
        let found = tree.closest(middle, near).filter(|found| found.distance < reach);
        last = found.map(|found| found.point);
        if let Some(found) = found {
            *foot =
                Foot { triangle: found.triangle, weights: found.weights, point: found.point, distance: found.distance };
        }
    }
}

/// The middle of a cell.
pub(super) fn middle(cell: Cell) -> Vec3 {
    cell.map(|x| x as f32 + 0.5)
}

/// The cells among `candidates` that are less than `reach` from the triangles, and the closest point of each; triangles
/// are numbered as in the mesh, and the first of equally close ones counts.
pub(super) fn feet(points: &[Vec3], part: &Part, candidates: &CellRows, reach: f32) -> (CellRows, Vec<Foot>) {
    if candidates.is_empty() {
        return (CellRows::default(), Vec::new());
    }
    let tree = TriangleTree::build(points, &part.corners);
    let mut feet = vec![Foot::default(); candidates.len()];
    let mut rest = &mut feet[..];
    let spans = candidates.spans().map(|(row, span)| {
        let (own, after) = take(&mut rest).split_at_mut(span.len());
        rest = after;
        (row, span, own)
    });
    let path = Path::chosen();
    parallel::for_each(spans, |_, (row, span, out)| feet_of_span(path, &tree, row, span, reach, out));
    let band = candidates.filtered(|_, at| feet[at].triangle != NONE);
    let mut found = band.resampled(candidates, &feet, Foot::default());
    found.iter_mut().for_each(|foot| foot.triangle = part.numbers[foot.triangle as usize]);
    (band, found)
}
