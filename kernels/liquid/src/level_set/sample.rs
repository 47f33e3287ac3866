//! φ between the centres of cells.

use numerics::vector::Vec3;

use super::PhiView;
use crate::rows::RowSpan;

/// Reads φ at points: trilinear between centres; beyond the outermost ones of the domain as there. Fast where successive
/// points lie in the same rows.
#[derive(Clone, Debug)]
pub struct PhiSampler<'a> {
    view: PhiView<'a>,
    y: i32,
    z: i32,
    /// The spans of the last rows read: of y and y + 1 at z, then at z + 1.
    spans: [RowSpan; 4],
}

const NONE: RowSpan = RowSpan { start: 0, end: 0, base: 0 };

/// The largest whole number that is not above `x`.
#[inline(always)]
pub(crate) fn floor(x: f32) -> i32 {
    let toward_zero = x as i32;
    toward_zero.saturating_sub(i32::from((toward_zero as f32) > x))
}

impl<'a> PhiSampler<'a> {
    /// Reads a level set.
    pub fn new(view: PhiView<'a>) -> Self {
        Self { view, y: 0, z: 0, spans: [NONE; 4] }
    }

    /// φ at a point.
    #[inline]
    pub fn at(&mut self, point: Vec3) -> f32 {
        let (cell, share) = self.split(point);
        self.values(cell, share).0
    }

    /// φ and its gradient at a point.
    #[inline]
    pub fn gradient(&mut self, point: Vec3) -> (f32, Vec3) {
        let (cell, share) = self.split(point);
        self.values(cell, share)
    }

    /// The first cell of the cube around a point, and where in the cube the point is.
    #[inline(always)]
    fn split(&self, point: Vec3) -> ([i32; 3], Vec3) {
        let (mut cell, mut share) = ([0; 3], [0.0; 3]);
        for axis in 0..3 {
            let (low, high) = (self.view.low[axis], self.view.high[axis]);
            cell[axis] = floor(point[axis] - 0.5).clamp(low, (high - 2).max(low));
            share[axis] = (point[axis] - 0.5 - cell[axis] as f32).clamp(0.0, if high - low > 1 { 1.0 } else { 0.0 });
        }
        (cell, share)
    }

    #[inline(always)]
    fn values(&mut self, [x, y, z]: [i32; 3], [u, v, w]: Vec3) -> (f32, Vec3) {
        if self.y != y || self.z != z {
            (self.y, self.z, self.spans) = (y, z, [NONE; 4]);
        }
        let [a, b, c, d] = std::array::from_fn(|row| self.pair(x, row));
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let along = [a, b, c, d].map(|[low, high]| mix(low, high, u));
        let slope_x = [a, b, c, d].map(|[low, high]| high - low);
        let (below, above) = (mix(along[0], along[1], v), mix(along[2], along[3], v));
        let gradient = [
            mix(mix(slope_x[0], slope_x[1], v), mix(slope_x[2], slope_x[3], v), w),
            mix(along[1] - along[0], along[3] - along[2], w),
            above - below,
        ];
        (mix(below, above, w), gradient)
    }

    /// φ of the cells x and x + 1 of one of the four rows.
    #[inline(always)]
    fn pair(&mut self, x: i32, row: usize) -> [f32; 2] {
        let span = self.spans[row];
        if span.start <= x && x + 1 < span.end {
            let at = span.at(x);
            return [self.view.phi[at], self.view.phi[at + 1]];
        }
        self.pair_of_another_span(x, row)
    }

    #[inline(never)]
    fn pair_of_another_span(&mut self, x: i32, row: usize) -> [f32; 2] {
        let spans = self.view.rows.row(self.y + (row as i32 & 1), self.z + (row as i32 >> 1));
        let next = spans.partition_point(|span| span.end <= x);
        let Some(span) = spans.get(next) else { return [self.view.outside; 2] };
        self.spans[row] = *span;
        [x, x + 1].map(|x| if span.start <= x && x < span.end { self.view.phi[span.at(x)] } else { self.view.outside })
    }
}
