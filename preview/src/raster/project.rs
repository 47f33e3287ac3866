//! The scene in a view: triangles, segments and discs on the screen, clipped behind the eye.
//!
//! Guarantees: nothing on the screen is closer than [`crate::view::NEAR`] or not finite. Anything thinner than a pixel
//! is drawn one pixel wide with proportionally less coverage, so that a line of any width has the light of its area.
//! Limit: a ball or CV is dropped if its centre is behind the eye.

use super::bins::PixelBox;
use crate::scene::{Corner, Dot, Knot, Scene, Strand};
use crate::vector::{finite, mix};
use crate::view::{NEAR, View};
use numerics::parallel;
use numerics::vector::Vec3;

/// Half a pixel: nothing is drawn thinner.
const LEAST_RADIUS: f32 = 0.5;
/// Number of triangles or balls in a task, and of strands.
const TASK: usize = 512;
const STRAND_TASK: usize = 64;

/// A triangle with x, y in pixels and nearness at its corners.
#[derive(Clone, Copy)]
pub(crate) struct ScreenTriangle {
    pub(crate) at: [Vec3; 3],
    pub(crate) corners: [Corner; 3],
    pub(crate) pixels: PixelBox,
}

/// A piece of a strand between two knots.
#[derive(Clone, Copy)]
pub(crate) struct ScreenSegment {
    pub(crate) at: [Vec3; 2],
    /// Pixels, at each end.
    pub(crate) radius: [f32; 2],
    /// Fraction of the samples inside that are covered, at each end.
    pub(crate) cover: [f32; 2],
    pub(crate) color: [Vec3; 2],
    /// Whether the strand ends there: an end is flat, a joint round.
    pub(crate) ends: [bool; 2],
    pub(crate) seed: u32,
    pub(crate) pixels: PixelBox,
}

/// A ball.
#[derive(Clone, Copy)]
pub(crate) struct ScreenDot {
    pub(crate) at: Vec3,
    pub(crate) radius: f32,
    pub(crate) cover: f32,
    /// Difference in nearness between its front and its centre.
    pub(crate) bulge: f32,
    pub(crate) color: Vec3,
    pub(crate) lit: f32,
    pub(crate) seed: u32,
    pub(crate) pixels: PixelBox,
}

/// All primitives that may touch the picture.
pub(crate) struct Screen {
    /// Width and height, pixels.
    pub(crate) size: [usize; 2],
    pub(crate) triangles: Vec<ScreenTriangle>,
    pub(crate) segments: Vec<ScreenSegment>,
    pub(crate) dots: Vec<ScreenDot>,
}

impl Screen {
    pub(crate) fn of(scene: &Scene, view: &View, size: [usize; 2]) -> Self {
        let triangles = parallel::map(scene.triangles.chunks(TASK), |_, triangles| {
            let parts = triangles.iter().flat_map(|corners| clip(corners, view).into_iter().flatten());
            parts.filter_map(|corners| triangle(corners, view, size)).collect::<Vec<_>>()
        });
        let segments = parallel::map(scene.strands.chunks(STRAND_TASK), |_, strands| {
            let segments = strands.iter().flat_map(|strand| {
                let knots = &scene.knots[strand.knots.clone()];
                (1..knots.len()).filter_map(move |k| segment(knots, k, strand, view, size))
            });
            segments.collect::<Vec<_>>()
        });
        let dots = parallel::map(scene.dots.chunks(TASK), |_, balls| {
            balls.iter().filter_map(|ball| dot(ball, view, size)).collect::<Vec<_>>()
        });
        Self { size, triangles: triangles.concat(), segments: segments.concat(), dots: dots.concat() }
    }
}

/// The part of a triangle in front of the eye: none, one or two triangles.
fn clip(corners: &[Corner; 3], view: &View) -> [Option<[Corner; 3]>; 2] {
    let behind = corners.map(|corner| view.is_behind(corner.at));
    if behind == [false; 3] {
        return [Some(*corners), None];
    }
    let mut kept = Vec::with_capacity(4);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if !behind[k] {
            kept.push(a);
        }
        if behind[k] != behind[(k + 1) % 3] {
            let t = crossing(a.at, b.at, view);
            kept.push(Corner {
                at: mix(a.at, b.at, t),
                normal: mix(a.normal, b.normal, t),
                color: mix(a.color, b.color, t),
            });
        }
    }
    let part = |k: usize| kept.get(k + 1).map(|last| [kept[0], kept[k], *last]);
    if kept.len() < 3 { [None, None] } else { [part(1), part(2)] }
}

/// Position of the near plane between a and b.
fn crossing(a: Vec3, b: Vec3, view: &View) -> f32 {
    let (from, to) = (view.distance(a), view.distance(b));
    ((NEAR - from) / (to - from)).clamp(0.0, 1.0)
}

fn triangle(corners: [Corner; 3], view: &View, size: [usize; 2]) -> Option<ScreenTriangle> {
    let at = corners.map(|corner| view.project(corner.at));
    let low = [0, 1].map(|k| at[0][k].min(at[1][k]).min(at[2][k]));
    let high = [0, 1].map(|k| at[0][k].max(at[1][k]).max(at[2][k]));
    let pixels = PixelBox::within(low, high, size)?;
    at.iter().all(|p| finite(*p)).then_some(ScreenTriangle { at, corners, pixels })
}

fn segment(knots: &[Knot], k: usize, strand: &Strand, view: &View, size: [usize; 2]) -> Option<ScreenSegment> {
    let (mut a, mut b) = (knots[k - 1], knots[k]);
    match [view.is_behind(a.at), view.is_behind(b.at)] {
        [true, true] => return None,
        [false, false] => {}
        [is_a, _] => {
            let t = crossing(a.at, b.at, view);
            let cut = Knot { at: mix(a.at, b.at, t), ..if is_a { a } else { b } };
            *(if is_a { &mut a } else { &mut b }) = cut;
        }
    }
    let at = [a, b].map(|knot| view.project(knot.at));
    let drawn = [a, b].map(|knot| view.pixels(knot.at, knot.radius));
    let radius = drawn.map(|radius| radius.max(LEAST_RADIUS));
    let widest = radius[0].max(radius[1]);
    let low = [0, 1].map(|k| at[0][k].min(at[1][k]) - widest);
    let high = [0, 1].map(|k| at[0][k].max(at[1][k]) + widest);
    let pixels = PixelBox::within(low, high, size)?;
    (at.iter().all(|p| finite(*p)) && widest.is_finite() && drawn != [0.0; 2]).then(|| ScreenSegment {
        at,
        radius,
        cover: drawn.map(|drawn| (drawn / LEAST_RADIUS).min(1.0)),
        color: [a.color, b.color],
        ends: [k == 1, k + 1 == knots.len()],
        seed: strand.seed,
        pixels,
    })
}

fn dot(dot: &Dot, view: &View, size: [usize; 2]) -> Option<ScreenDot> {
    if view.is_behind(dot.at) {
        return None;
    }
    let at = view.project(dot.at);
    let drawn = view.pixels(dot.at, dot.radius);
    let radius = drawn.max(LEAST_RADIUS);
    let pixels = PixelBox::within([at[0] - radius, at[1] - radius], [at[0] + radius, at[1] + radius], size)?;
    let share = (drawn / LEAST_RADIUS).min(1.0);
    (finite(at) && radius.is_finite() && drawn > 0.0).then(|| ScreenDot {
        at,
        radius,
        cover: share * share,
        bulge: view.nearer(dot.at, dot.radius),
        color: dot.color,
        lit: dot.lit,
        seed: dot.seed,
        pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::view::Stage;

    fn view() -> View {
        let camera = Camera::new([0.0, 0.0, 1.0], [0.0; 3], [0.0, 1.0, 0.0], 90.0).unwrap();
        View::perspective(&camera, &Stage::of([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 64, 64)
    }

    fn corners(z: [f32; 3]) -> [Corner; 3] {
        let at = [[0.0, 0.0, z[0]], [0.1, 0.0, z[1]], [0.0, 0.1, z[2]]];
        at.map(|at| Corner { at, normal: [0.0, 0.0, 1.0], color: [0.5; 3] })
    }

    #[test]
    fn a_triangle_through_the_eye_is_clipped() {
        let count = |z| clip(&corners(z), &view()).into_iter().flatten().count();
        assert_eq!(count([0.0, 0.0, 0.0]), 1);
        assert_eq!(count([0.0, 0.0, 2.0]), 2);
        assert_eq!(count([0.0, 2.0, 2.0]), 1);
        assert_eq!(count([2.0, 2.0, 2.0]), 0);
        for part in clip(&corners([0.0, 0.0, 2.0]), &view()).into_iter().flatten().flatten() {
            assert!(view().distance(part.at) > 0.99 * NEAR);
        }
    }

    #[test]
    fn a_thin_strand_is_a_pixel_wide_with_reduced_coverage() {
        let knot = |y: f32| Knot { at: [0.0, y, 0.0], tangent: [0.0, 1.0, 0.0], radius: 0.1 / 64.0, color: [1.0; 3] };
        let knots = [knot(-0.5), knot(0.5)];
        let strand = Strand { knots: 0..2, seed: 0 };
        // At distance 1 the picture is 2 stage units high: 32 pixels each.
        let segment = segment(&knots, 1, &strand, &view(), [64, 64]).unwrap();
        assert_eq!(segment.radius, [LEAST_RADIUS; 2]);
        assert!((segment.cover[0] - 0.1).abs() < 1e-6);
        assert_eq!(segment.ends, [true, true]);
    }
}
