//! Vertices moved off φ = 0, so that the mesh encloses the volume that φ < 0 has.
//!
//! A mesh whose vertices lie on a ball of radius R encloses less than the ball, by 1/(2 R²) of it where R is counted in
//! cells: a drop of 2 cells would miss an eighth of its volume.

use numerics::parallel;
use numerics::vector::{add, dot, scale, sub};

use super::QuadMesh;
use super::smooth::Walls;
use crate::level_set::PhiView;

/// Cosine between the normals at the ends of an edge from which it spans a curve, and no kink.
const SMOOTH: f32 = 0.7;
/// The farthest, in cells, that a vertex is moved: on a ball of 1.7 cells radius.
const FARTHEST: f32 = 0.1;
/// Quads that one thread looks at at a time.
const CHUNK: usize = 4096;

impl QuadMesh {
    /// Moves each vertex along its normal, so that quads bulge out of φ = 0 at their corners by what they miss in their
    /// middles. Vertices on the ends of the domain stay on them, those beside kinks where they are.
    pub(crate) fn bulge(&mut self, view: &PhiView<'_>) {
        let walls = Walls::new(view.low, view.high);
        let is_free = |quad: [u32; 4]| !walls.hold(quad.map(|at| self.points[at as usize]));
        let missed = |quad: [u32; 4]| is_free(quad).then(|| self.missed(quad));
        let heights = parallel::tabulate(self.quads.len(), CHUNK, |n| missed(self.quads[n]));
        let mut sums = vec![[0.0_f32; 2]; self.points.len()];
        for (quad, height) in self.quads.iter().zip(heights).filter_map(|(quad, height)| Some((quad, height?))) {
            for at in quad {
                let [sum, count] = &mut sums[*at as usize];
                (*sum, *count) = (*sum + height, *count + 1.0);
            }
        }
        for ((point, normal), [sum, count]) in self.points.iter_mut().zip(&self.normals).zip(sums) {
            let way = sum / count;
            let way = if way.is_nan() { 0.0 } else { way.clamp(-FARTHEST, FARTHEST) };
            *point = add(*point, scale(walls.along(*point, *normal), way));
        }
    }

    /// The mean height of a surface over a quad whose corners and normals are the surface's: along an edge e it rises by
    /// Δn·e/12 over its chord. Not a number where it has a kink.
    fn missed(&self, quad: [u32; 4]) -> f32 {
        let mut sum = 0.0;
        for n in 0..4 {
            let [from, to] = [quad[n], quad[(n + 1) % 4]].map(|at| at as usize);
            let [start, end] = [self.normals[from], self.normals[to]];
            if dot(start, end) < SMOOTH {
                return f32::NAN;
            }
            sum += dot(sub(end, start), sub(self.points[to], self.points[from]));
        }
        sum * (1.0 / 24.0)
    }
}
