//! From the stage to the screen and back: a camera's perspective, or the parallel view of a light.
//!
//! The stage is the scene moved and scaled so that its bounds have their centre at 0 and half a diagonal of 1:
//! everything that follows works with numbers near 1, whatever the scene's scale. The screen is pixels, x right, y
//! down, and a *nearness* that is linear on the screen and larger for closer points: 1/z in perspective, −z in
//! parallel.

use crate::camera::{BoundingBox, Camera, proper};
use numerics::vector::{DVec3, Vec3, add, dot, scale, sub, to_f32, to_f64};

/// Nothing nearer to a perspective eye than this is drawn, stage units: a thousandth of half the scene's diagonal.
pub(crate) const NEAR: f32 = 1e-3;

/// The map from the scene to the stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stage {
    centre: DVec3,
    /// Metres per stage unit.
    size: f64,
}

impl Stage {
    pub(crate) fn of(bounds: BoundingBox) -> Self {
        let [low, high] = proper(bounds);
        Self { centre: (low + high) * 0.5, size: (high - low).norm() * 0.5 }
    }

    /// Maps a position in metres to the stage; non-finite positions stay non-finite.
    pub(crate) fn place(&self, p: Vec3) -> Vec3 {
        self.place_exact(to_f64(p))
    }

    fn place_exact(&self, p: DVec3) -> Vec3 {
        to_f32((p - self.centre) * (1.0 / self.size))
    }

    /// Maps a length in metres to the stage; 0 if it is negative or not finite.
    pub(crate) fn length(&self, metres: f32) -> f32 {
        let length = (f64::from(metres) / self.size) as f32;
        if length.is_finite() { length.max(0.0) } else { 0.0 }
    }
}

/// Perspective or parallel projection.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lens {
    Perspective,
    Parallel,
}

/// A view of the stage.
#[derive(Clone, Debug)]
pub(crate) struct View {
    eye: Vec3,
    /// Right, up, forward.
    axes: [Vec3; 3],
    /// Pixel of the view's axis.
    middle: [f32; 2],
    /// Pixels per stage unit, at distance 1 in perspective.
    zoom: f32,
    lens: Lens,
}

impl View {
    /// The view of `camera` in a picture of `width` × `height` pixels.
    pub(crate) fn perspective(camera: &Camera, stage: &Stage, width: usize, height: usize) -> Self {
        Self {
            eye: stage.place_exact(camera.eye().into()),
            axes: camera.axes().map(to_f32),
            middle: [width as f32 / 2.0, height as f32 / 2.0],
            zoom: (height as f64 / 2.0 / camera.half_tangent()) as f32,
            lens: Lens::Perspective,
        }
    }

    /// A parallel view along `axes[2]` that covers `half` to each side of `eye` with `size` × `size` pixels.
    pub(crate) fn parallel(eye: Vec3, axes: [Vec3; 3], half: f32, size: usize) -> Self {
        let middle = size as f32 / 2.0;
        Self { eye, axes, middle: [middle; 2], zoom: middle / half, lens: Lens::Parallel }
    }

    pub(crate) fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Right, up, forward.
    pub(crate) fn axes(&self) -> [Vec3; 3] {
        self.axes
    }

    /// Distance along the view, stage units.
    pub(crate) fn distance(&self, p: Vec3) -> f32 {
        dot(self.axes[2], sub(p, self.eye))
    }

    /// Whether `p` is too close to a perspective eye, or behind it.
    pub(crate) fn is_behind(&self, p: Vec3) -> bool {
        self.lens == Lens::Perspective && self.distance(p) < NEAR
    }

    /// x, y in pixels and nearness; meaningless if [`View::is_behind`].
    pub(crate) fn project(&self, p: Vec3) -> Vec3 {
        let [x, y, z] = self.axes.map(|axis| dot(axis, sub(p, self.eye)));
        let (shrink, nearness) = match self.lens {
            Lens::Perspective => (1.0 / z, 1.0 / z),
            Lens::Parallel => (1.0, -z),
        };
        [self.middle[0] + self.zoom * shrink * x, self.middle[1] - self.zoom * shrink * y, nearness]
    }

    /// Position on the stage of a point on the screen: the inverse of [`View::project`].
    pub(crate) fn unproject(&self, [x, y, nearness]: Vec3) -> Vec3 {
        let z = match self.lens {
            Lens::Perspective => 1.0 / nearness,
            Lens::Parallel => -nearness,
        };
        let side = match self.lens {
            Lens::Perspective => z / self.zoom,
            Lens::Parallel => 1.0 / self.zoom,
        };
        let at = [(x - self.middle[0]) * side, (self.middle[1] - y) * side, z];
        (0..3).fold(self.eye, |p, k| add(p, scale(self.axes[k], at[k])))
    }

    /// Pixels of a stage length at `p`.
    pub(crate) fn pixels(&self, p: Vec3, length: f32) -> f32 {
        match self.lens {
            Lens::Perspective => length * self.zoom / self.distance(p).max(NEAR),
            Lens::Parallel => length * self.zoom,
        }
    }

    /// Difference in nearness between `p` and a point `length` in front of it.
    pub(crate) fn nearer(&self, p: Vec3, length: f32) -> f32 {
        match self.lens {
            Lens::Perspective => {
                let z = self.distance(p).max(NEAR);
                1.0 / (z - length).max(z * 0.5) - 1.0 / z
            }
            Lens::Parallel => length,
        }
    }
}

#[cfg(test)]
mod tests {
    use numerics::vector::length;

    use super::*;

    fn head_on() -> (Stage, View) {
        let stage = Stage::of([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]);
        let camera = Camera::new([0.0, 0.0, 10.0], [0.0; 3], [0.0, 1.0, 0.0], 90.0).unwrap();
        (stage, View::perspective(&camera, &stage, 200, 100))
    }

    #[test]
    fn at_ninety_degrees_half_the_height_equals_the_distance() {
        let (stage, view) = head_on();
        let [x, y, _] = view.project(stage.place([5.0, 10.0, 0.0]));
        assert!((x - 125.0).abs() < 1e-3 && y.abs() < 1e-3, "{x} {y}");
        assert!(view.project(stage.place([0.0, 0.0, 1.0]))[2] > view.project(stage.place([0.0; 3]))[2]);
        assert!(view.is_behind(stage.place([0.0, 0.0, 11.0])));
    }

    #[test]
    fn unprojecting_undoes_projecting() {
        let (stage, view) = head_on();
        let lamp = View::parallel([0.0, 1.0, 0.0], view.axes(), 2.0, 64);
        for view in [view, lamp] {
            let p = stage.place([1.0, 2.0, -3.0]);
            let back = view.unproject(view.project(p));
            assert!(length(sub(p, back)) < 1e-4, "{p:?} {back:?}");
        }
    }

    #[test]
    fn the_stage_is_the_same_at_any_scale() {
        for scale in [1e-3_f32, 1.0, 1e3] {
            let stage = Stage::of([[0.0; 3], [2.0 * scale, 0.0, 0.0]]);
            assert_eq!(stage.place([2.0 * scale, scale, 0.0]), [1.0, 1.0, 0.0]);
            assert_eq!(stage.length(f32::NAN), 0.0);
        }
    }
}
