//! One camera for a whole sequence, close enough that the subject fills the picture.
//!
//! Guarantees: every point that was added is in the picture; the subject spans `FILL` of its width or height and is in the
//! middle of both; frames can be added one at a time, in any order, without keeping them. Flat scenes are seen from higher
//! up. Limit: the width of curves and points is not counted; the margin holds it.

use numerics::vector::{DVec3, direction, to_f64};

use crate::Layer;
use crate::camera::{BoundingBox, Camera, FOV, THREE_QUARTER, axes, half_tangent, proper};
use crate::clip::Clip;
use crate::scene::{each_point, union};

/// Fraction of the picture's width or height that the subject spans.
const FILL: f64 = 0.82;
/// Nearest that the eye comes to the subject, as a fraction of its diagonal: a line seen end-on has no width to fit.
const NEAREST: f64 = 0.25;
/// Direction from the subject to the eye for flat scenes: from 35 degrees above.
const FROM_ABOVE: [f64; 3] = [0.52, 0.67, 0.80];
/// Height relative to the larger horizontal side below which a scene is flat.
const FLAT: f64 = 0.25;
/// Slopes of the planes that touch the subject, spread evenly from one border of the picture to the other.
const SLOPES: usize = 9;

/// What a camera must show: the frames added so far.
#[derive(Clone, Debug)]
pub struct Framing {
    aspect: f64,
    clip: Option<Clip>,
    bounds: Option<BoundingBox>,
    /// From the side, and from above.
    hulls: [Hull; 2],
}

/// What a view sees of the subject: planes through the picture's sides that touch it.
#[derive(Clone, Debug)]
struct Hull {
    /// Right, up and forward.
    view: [DVec3; 3],
    /// Half the width and height of the filled part of the picture at distance 1.
    tangents: [f64; 2],
    /// For x and y: the largest x − z·t and −x − z·t for each slope t.
    touching: [[[f64; SLOPES]; 2]; 2],
    /// Smallest z along the view.
    nearest: f64,
}

impl Framing {
    /// A framing for panels of this size, of what `clip` leaves.
    pub fn new(width: usize, height: usize, clip: Option<Clip>) -> Self {
        let aspect = width.max(1) as f64 / height.max(1) as f64;
        let hulls = [THREE_QUARTER, FROM_ABOVE].map(|back| Hull::new(back, aspect));
        Self { aspect, clip, bounds: None, hulls }
    }

    /// Adds a frame. Guides are not counted: they may lie far outside.
    pub fn add(&mut self, layers: &[Layer<'_>]) {
        for layer in layers.iter().filter(|layer| !layer.is_guide) {
            each_point(layer.geometry, |p| {
                let p = self.clip.map_or(p, |clip| clip.nearest_kept(p));
                self.bounds = union(self.bounds, Some([p; 2]));
                self.hulls.iter_mut().for_each(|hull| hull.add(to_f64(p)));
            });
        }
    }

    /// Bounds of everything added, metres; `None` if there was nothing.
    pub fn bounds(&self) -> Option<BoundingBox> {
        self.bounds
    }

    /// A view of everything added, from the front right.
    pub fn camera(&self) -> Camera {
        let Some(bounds) = self.bounds else { return Camera::fit([[-0.5; 3], [0.5; 3]], self.aspect) };
        let [low, high] = proper(bounds);
        if to_f64(bounds[0]) != low || to_f64(bounds[1]) != high {
            // Without extent.
            return Camera::fit(bounds, self.aspect);
        }
        let size = high - low;
        let hull = &self.hulls[usize::from(size.y < FLAT * size.x.max(size.z))];
        let [eye, target] = hull.eye_and_target((low + high) * 0.5, size.norm());
        Camera::new(eye.into(), target.into(), [0.0, 1.0, 0.0], FOV)
            .unwrap_or_else(|_| Camera::fit(bounds, self.aspect))
    }
}

impl Hull {
    fn new(back: [f64; 3], aspect: f64) -> Self {
        let tan = half_tangent(FOV) * FILL;
        Self {
            view: axes(-direction(back.into()).unwrap_or(DVec3::z()), DVec3::y()),
            tangents: [tan * aspect, tan],
            touching: [[[f64::NEG_INFINITY; SLOPES]; 2]; 2],
            nearest: f64::INFINITY,
        }
    }

    fn slope(&self, axis: usize, k: usize) -> f64 {
        self.tangents[axis] * (2.0 * k as f64 / (SLOPES - 1) as f64 - 1.0)
    }

    fn add(&mut self, p: DVec3) {
        let [x, y, z] = self.view.map(|axis| axis.dot(&p));
        for (axis, x) in [x, y].into_iter().enumerate() {
            for k in 0..SLOPES {
                let down = z * self.slope(axis, k);
                let [right, left] = &mut self.touching[axis];
                right[k] = right[k].max(x - down);
                left[k] = left[k].max(-x - down);
            }
        }
        self.nearest = self.nearest.min(z);
    }

    /// The closest eye that sees everything, and the point it looks at, for a subject of this centre and diagonal.
    fn eye_and_target(&self, centre: DVec3, diagonal: f64) -> [DVec3; 2] {
        // A point (x, z) is inside if |x − eye_x| ≤ (z − eye_z)·t, so the largest x − z·t and −x − z·t bound the eye.
        let fits = |axis: usize| {
            let [right, left] = &self.touching[axis];
            -(right[SLOPES - 1] + left[SLOPES - 1]) / (2.0 * self.tangents[axis])
        };
        let z = fits(0).min(fits(1)).min(self.nearest - NEAREST * diagonal);
        let at = [self.middle(0, z), self.middle(1, z), z];
        let eye = (0..3).fold(DVec3::zeros(), |eye, k| eye + self.view[k] * at[k]);
        let distance = (self.view[2].dot(&centre) - z).max(NEAREST * diagonal);
        [eye, eye + self.view[2] * distance]
    }

    /// Position of the eye on an axis, at depth z, from which the subject reaches equally far to both sides.
    fn middle(&self, axis: usize, z: f64) -> f64 {
        let [right, left] = &self.touching[axis];
        let tan = self.tangents[axis];
        let (mut low, mut high) = (right[SLOPES - 1] + z * tan, -left[SLOPES - 1] - z * tan);
        for _ in 0..50 {
            let eye = 0.5 * (low + high);
            if self.reach(axis, right, eye, z) > self.reach(axis, left, -eye, z) {
                low = eye;
            } else {
                high = eye;
            }
        }
        0.5 * (low + high)
    }

    /// The slope at which the subject ends on one side, seen from the eye.
    fn reach(&self, axis: usize, touching: &[f64; SLOPES], eye: f64, z: f64) -> f64 {
        // Positive as long as something is beyond the slope; falls evenly with the slope.
        let beyond = |k: usize| touching[k] + self.slope(axis, k) * z - eye;
        let Some(k) = (1..SLOPES).find(|k| beyond(*k) <= 0.0) else { return self.tangents[axis] };
        let (a, b) = (beyond(k - 1), beyond(k));
        let share = if a > b { (a / (a - b)).clamp(0.0, 1.0) } else { 1.0 };
        self.slope(axis, k - 1) + (self.slope(axis, k) - self.slope(axis, k - 1)) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::{Component, Geometry};

    /// How far the points reach on the screen: to the right, left, top and bottom, 1 at the border.
    fn reaches(points: &[[f32; 3]], camera: &Camera, aspect: f64) -> [f64; 4] {
        let (view, tan) = (camera.axes(), camera.half_tangent());
        points.iter().fold([f64::NEG_INFINITY; 4], |most, p| {
            let [x, y, z] = view.map(|axis| axis.dot(&(to_f64(*p) - DVec3::from(camera.eye()))));
            assert!(z > 0.0);
            let at = [x / (z * tan * aspect), -x / (z * tan * aspect), y / (z * tan), -y / (z * tan)];
            std::array::from_fn(|k| most[k].max(at[k]))
        })
    }

    #[test]
    fn the_subject_spans_the_picture_over_all_frames_and_is_in_its_middle() {
        let ball = |at: [f32; 3], size: f32| -> Vec<[f32; 3]> {
            (0..200)
                .map(|k| {
                    let (sin, cos) = libm::sincos(f64::from(k) * 2.4);
                    let y = f64::from(k) / 100.0 - 1.0;
                    let round = (1.0 - y * y).max(0.0).sqrt();
                    [at[0] + size * (sin * round) as f32, at[1] + size * y as f32, at[2] + size * (cos * round) as f32]
                })
                .collect()
        };
        for (frames, aspect) in [
            (vec![ball([0.0; 3], 1.0)], [640, 480]),
            (vec![ball([1e3, 0.0, 5.0], 0.01), ball([1e3, 0.05, 5.0], 0.01)], [640, 480]),
            (vec![ball([0.0; 3], 1.0), ball([9.0, 0.0, 0.0], 1.0)], [300, 600]),
            (vec![(0..400).map(|k| [(k % 20) as f32, 0.0, (k / 20) as f32]).collect()], [640, 480]),
        ] {
            let mut framing = Framing::new(aspect[0], aspect[1], None);
            for frame in &frames {
                let geometry = Geometry::from(Component::points(frame.clone()));
                framing.add(&[Layer::new("ball", &geometry)]);
            }
            let [right, left, top, bottom] =
                reaches(&frames.concat(), &framing.camera(), aspect[0] as f64 / aspect[1] as f64);
            assert!((right.max(left).max(top).max(bottom) - FILL).abs() < 0.01);
            assert!((right - left).abs() < 0.05 && (top - bottom).abs() < 0.05, "{right} {left} {top} {bottom}");
        }
    }

    #[test]
    fn guides_and_clipped_parts_are_not_framed_and_nothing_is_a_unit_cube() {
        let near = Geometry::from(Component::points(vec![[0.0; 3], [1.0, 1.0, 1.0]]));
        let far = Geometry::from(Component::points(vec![[0.0; 3], [100.0, 0.0, 0.0]]));
        let mut framing = Framing::new(4, 3, None);
        framing.add(&[Layer::new("a", &near), Layer::guide("b", &far)]);
        assert_eq!(framing.bounds(), Some([[0.0; 3], [1.0; 3]]));
        let mut cut = Framing::new(4, 3, Some(Clip { axis: 0, value: 2.0 }));
        cut.add(&[Layer::new("b", &far)]);
        assert_eq!(cut.bounds(), Some([[0.0; 3], [2.0, 0.0, 0.0]]));
        assert_eq!(Framing::new(1, 1, None).camera(), Camera::fit([[-0.5; 3], [0.5; 3]], 1.0));
        let line = Geometry::from(Component::points(vec![[0.0; 3], THREE_QUARTER.map(|x| x as f32)]));
        let mut end_on = Framing::new(4, 3, None);
        end_on.add(&[Layer::new("line", &line)]);
        assert!(DVec3::from(end_on.camera().eye()).norm() > 1.2);
    }
}
