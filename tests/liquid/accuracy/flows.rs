//! Flows that carry a surface along.

use std::f32::consts::PI;

use numerics::vector::{Vec3, length, scale, sub};
use numerics::{parallel, trig};

/// Movements in a step on the faces of a cube of cells, read trilinearly, as a solver's velocity is.
pub(crate) struct FaceMovement {
    size: usize,
    along: [Vec<f32>; 3],
}

impl FaceMovement {
    /// From a velocity in a unit cube, times `dt`, in cells.
    pub(crate) fn new(size: usize, dt: f32, velocity: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        let n = size + 1;
        let h = 1.0 / size as f32;
        let along = [0, 1, 2].map(|axis| {
            let face = |at: usize| {
                let mut point = [at % n, at / n % n, at / n / n].map(|x| (x as f32 + 0.5) * h);
                point[axis] -= 0.5 * h;
                velocity(point)[axis] * dt / h
            };
            parallel::tabulate(n * n * n, parallel::CHUNK, face)
        });
        Self { size, along }
    }

    /// At a place in cells.
    pub(crate) fn at(&self, point: Vec3) -> Vec3 {
        let n = self.size + 1;
        std::array::from_fn(|axis| {
            let (mut index, mut share) = (0, [0.0; 3]);
            for (along, stride) in [1, n, n * n].into_iter().enumerate() {
                let x = (point[along] - if along == axis { 0.0 } else { 0.5 }).clamp(0.0, self.size as f32 - 0.001);
                index += (x as usize) * stride;
                share[along] = x - (x as usize) as f32;
            }
            let [u, v, w] = share;
            let value = |more: usize| self.along[axis][index + more];
            let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
            let row = |more: usize| mix(value(more), value(more + 1), u);
            mix(mix(row(0), row(n), v), mix(row(n * n), row(n * n + n), v), w)
        })
    }
}

/// LeVeque's flow (1996) in a box of cells: a ball becomes a sheet, and a ball again.
pub(crate) struct Deformation {
    faces: FaceMovement,
    size: f32,
    /// Steps there and back; no point moves farther than a cell in one.
    pub(crate) steps: u32,
}

impl Deformation {
    /// In a box of `size` cells, over `period` s; LeVeque's is 3.
    pub(crate) fn new(size: u32, period: f32) -> Self {
        let steps = (2.0 * period * size as f32).ceil() as u32;
        let faces = FaceMovement::new(size as usize, period / steps as f32, |p| {
            let [a, b, c] = p.map(|x| trig::sin(PI * x));
            let [d, e, f] = p.map(|x| trig::sin(2.0 * PI * x));
            [2.0 * a * a * e * f, -d * b * b * f, -d * e * c * c]
        });
        Self { faces, size: size as f32, steps }
    }

    /// The movement in a step.
    pub(crate) fn step(&self, step: u32) -> impl Fn(Vec3) -> Vec3 + Sync {
        let pulse = trig::cos(PI * (step as f32 + 0.5) / self.steps as f32);
        move |point| scale(self.faces.at(point), pulse)
    }

    /// The distance from the ball at the start.
    pub(crate) fn start(&self, point: Vec3) -> f32 {
        length(sub(point, [0.35 * self.size; 3])) - 0.15 * self.size
    }
}
