//! The lighting: a key from the upper left of the camera with shadows, a fill from the right, and sky and floor.
//!
//! Surfaces are matt with a faint gloss. Strands are lit along their tangent (Kajiya and Kay, "Rendering fur with three
//! dimensional textures", 1989): by the sine between tangent and light, with a highlight where the tangent reflects the
//! light to the eye. Guarantees: colours that show an attribute keep their order, as they are lit with less contrast
//! and no gloss. Limit: one bounce; shadows have a resolution of `MAP_PIXELS` pixels over the scene, and there are none
//! beyond its bounds.

use crate::raster::{self, DepthOnly, Lanes, SAMPLES, Screen, TILE};
use crate::scene::{Corner, Scene};
use crate::vector::{mix, times};
use crate::view::View;
use numerics::parallel;
use numerics::vector::{Vec3, add, cross, dot, scale, sub, unit};

/// Directions to the lights, by the camera's right, the world's up and the camera's level back.
const KEY: Vec3 = [-0.55, 0.95, 0.62];
const FILL: Vec3 = [0.85, 0.25, 0.50];
/// Linear light, near white: a warm key, a cool fill, a sky a little blue over a floor that reflects.
const KEY_LIGHT: Vec3 = [1.04, 1.00, 0.94];
const FILL_LIGHT: Vec3 = [0.17, 0.18, 0.20];
const SKY_LIGHT: Vec3 = [0.36, 0.37, 0.40];
const FLOOR_LIGHT: Vec3 = [0.20, 0.19, 0.18];
/// How far the key light wraps around a surface, as from a large lamp.
const WRAP: f32 = 0.12;
const GLOSS: f32 = 0.04;
const HAIR_GLOSS: f32 = 0.22;
/// Light on a colour that shows an attribute: from this in the dark to 1 in full light, so that it never gets brighter.
const MEASURED: f32 = 0.45;
/// Light above which [`exposed`] compresses.
const SHOULDER: f32 = 0.6;
/// Full light: key, sky and fill on a surface that faces them.
const FULL: f32 = 1.45;

/// Pixels per side of a light's view, each of 16 samples.
const MAP_PIXELS: usize = 192;
/// Half the side of a light's view, stage units: the scene's bounds lie within 1.
const MAP_HALF: f32 = 1.05;
/// Number of knots or balls that a thread lights at a time.
const TASK: usize = 128;

/// Lights and their shadows.
pub(crate) struct Light {
    key: Vec3,
    fill: Vec3,
    eye: Vec3,
    shadow: DepthMap,
    /// Whether colours are values of an attribute.
    measured: bool,
}

impl Light {
    /// Lights `scene` for a camera. The key light on strands and balls is computed here, that on surfaces when they are
    /// drawn.
    pub(crate) fn set_up(scene: &mut Scene, view: &View, measured: bool) -> Self {
        let right = view.axes()[0];
        let back = unit(cross(right, [0.0, 1.0, 0.0])).unwrap_or(scale(view.axes()[2], -1.0));
        let direction = |by: Vec3| {
            let sum = add(add(scale(right, by[0]), [0.0, by[1], 0.0]), scale(back, by[2]));
            unit(sum).unwrap_or([0.0, 1.0, 0.0])
        };
        let (key, fill) = (direction(KEY), direction(FILL));
        let shadow = DepthMap::towards(scene, scale(key, -1.0));
        let light = Self { key, fill, eye: view.eye(), shadow, measured };
        parallel::for_each(scene.knots.chunks_mut(TASK), |_, knots| {
            knots.iter_mut().for_each(|knot| knot.color = light.strand(knot.at, knot.tangent, knot.color));
        });
        parallel::for_each(scene.dots.chunks_mut(TASK), |_, balls| {
            for ball in balls {
                let skin = add(ball.at, scale(key, 1.1 * ball.radius));
                ball.lit = light.reaching(skin);
            }
        });
        light
    }

    /// Fraction of the key light that reaches a point of the stage.
    pub(crate) fn reaching(&self, at: Vec3) -> f32 {
        // The size of a pixel of the map: closer geometry may be the point's own.
        self.shadow.clear(at, self.shadow.pixel())
    }

    /// A point of a surface; `normal` is on the visible side.
    pub(crate) fn surface(&self, at: Vec3, normal: Vec3, color: Vec3) -> Vec3 {
        if normal == Corner::UNLIT {
            return color;
        }
        let to_eye = unit(sub(self.eye, at)).unwrap_or(self.key);
        let normal = unit(normal).unwrap_or(to_eye);
        let off_skin = add(at, scale(normal, 1.5 * self.shadow.pixel()));
        self.matt(normal, to_eye, color, self.shadow.clear(off_skin, 0.5 * self.shadow.pixel()))
    }

    /// A point of a matt surface with a faint gloss, `lit` by that fraction of the key light.
    pub(crate) fn matt(&self, normal: Vec3, to_eye: Vec3, color: Vec3, lit: f32) -> Vec3 {
        let key = ((dot(normal, self.key) + WRAP) / (1.0 + WRAP)).max(0.0) * lit;
        let fill = dot(normal, self.fill).max(0.0);
        let around = mix(FLOOR_LIGHT, SKY_LIGHT, 0.5 + 0.5 * normal[1]);
        let light = add(add(scale(KEY_LIGHT, key), scale(FILL_LIGHT, fill)), around);
        if self.measured {
            return measured(color, light);
        }
        let half = unit(add(self.key, to_eye)).unwrap_or(normal);
        let gloss = GLOSS * lit * sixteenth_power(dot(normal, half).max(0.0));
        exposed(add(times(color, light), [gloss; 3]))
    }

    /// A CV of a strand.
    fn strand(&self, at: Vec3, tangent: Vec3, color: Vec3) -> Vec3 {
        let lit = self.reaching(at);
        let to_eye = unit(sub(self.eye, at)).unwrap_or(self.key);
        let (along_key, along_fill, along_eye) =
            (dot(tangent, self.key), dot(tangent, self.fill), dot(tangent, to_eye));
        let sine = |cosine: f32| (1.0 - cosine * cosine).max(0.0).sqrt();
        let key = sine(along_key) * lit;
        let fill = sine(along_fill);
        let around = mix(FLOOR_LIGHT, SKY_LIGHT, 0.7);
        let light = add(add(scale(KEY_LIGHT, key), scale(FILL_LIGHT, fill)), around);
        if self.measured {
            return measured(color, light);
        }
        let mirrored = (sine(along_key) * sine(along_eye) - along_key * along_eye).max(0.0);
        let gloss = HAIR_GLOSS * lit * sixteenth_power(mirrored);
        // Hair's highlight is half its own colour, half the lamp's.
        exposed(add(times(color, light), scale(mix(KEY_LIGHT, color, 0.6), gloss)))
    }
}

/// Light as the picture shows it: unchanged to `SHOULDER`, then ever less, so that white in full light stays below 1
/// and keeps its shading, and a bright colour its hue.
fn exposed(light: Vec3) -> Vec3 {
    let most = light[0].max(light[1]).max(light[2]);
    if most <= SHOULDER || most.is_nan() {
        return light;
    }
    let above = (most - SHOULDER) / (1.0 - SHOULDER);
    scale(light, (SHOULDER + (1.0 - SHOULDER) * above / (1.0 + above)) / most)
}

/// A colour that shows an attribute, in `light`; full light gives the colour itself.
fn measured(color: Vec3, light: Vec3) -> Vec3 {
    times(color, mix(light.map(|x| (x / FULL).min(1.0)), [1.0; 3], MEASURED))
}

fn sixteenth_power(x: f32) -> f32 {
    let square = x * x;
    let fourth = square * square;
    let eighth = fourth * fourth;
    eighth * eighth
}

/// Depth of the scene in a parallel view: as seen by a lamp, or from the floor.
pub(crate) struct DepthMap {
    view: View,
    pixels: Vec<Lanes>,
}

impl DepthMap {
    /// The view of the scene's bounds from a lamp that shines along `direction`.
    pub(crate) fn towards(scene: &Scene, direction: Vec3) -> Self {
        let aside = if direction[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let right = unit(cross(direction, aside)).unwrap_or([1.0, 0.0, 0.0]);
        Self::from(scene, [0.0; 3], [right, cross(right, direction), direction])
    }

    /// The view from the plane through `eye` along `axes[2]`.
    pub(crate) fn from(scene: &Scene, eye: Vec3, axes: [Vec3; 3]) -> Self {
        let view = View::parallel(eye, axes, MAP_HALF, MAP_PIXELS);
        let tiles = raster::draw(&Screen::of(scene, &view, [MAP_PIXELS; 2]), &DepthOnly, |tile| tile);
        let mut pixels = vec![[raster::UNCOVERED; SAMPLES]; MAP_PIXELS * MAP_PIXELS];
        for tile in tiles {
            for (row, depths) in tile.depth.chunks(TILE).enumerate() {
                let start = (tile.top + row) * MAP_PIXELS + tile.left;
                pixels[start..start + TILE].copy_from_slice(depths);
            }
        }
        Self { view, pixels }
    }

    /// Side of a pixel, stage units.
    pub(crate) fn pixel(&self) -> f32 {
        2.0 * MAP_HALF / MAP_PIXELS as f32
    }

    /// Fraction of the samples in which the point is not hidden; geometry less than `slack` in front of it does not
    /// count.
    pub(crate) fn clear(&self, at: Vec3, slack: f32) -> f32 {
        let [x, y, nearness] = self.view.project(at);
        self.blend([x, y], 1.0, |lanes| {
            let clear: u32 = lanes.iter().map(|depth| u32::from(*depth <= nearness + slack)).sum();
            clear as f32 / SAMPLES as f32
        })
    }

    /// A pixel's `value`, blended over the nine around x, y by a quadratic B-spline, so that it is smooth; `beyond`
    /// outside.
    fn blend(&self, at: [f32; 2], beyond: f32, value: impl Fn(&Lanes) -> f32) -> f32 {
        if !at.iter().all(|x| *x >= 1.0 && *x < (MAP_PIXELS - 1) as f32) {
            return beyond;
        }
        let middle = at.map(|x| x as usize);
        let weights = at.map(|x| {
            let off = x - x.floor() - 0.5;
            [0.5 * (0.5 - off) * (0.5 - off), 0.75 - off * off, 0.5 * (0.5 + off) * (0.5 + off)]
        });
        let mut sum = 0.0;
        for (dy, down) in weights[1].iter().enumerate() {
            let row = (middle[1] + dy - 1) * MAP_PIXELS + middle[0] - 1;
            for (lanes, across) in self.pixels[row..row + 3].iter().zip(&weights[0]) {
                sum += down * across * value(lanes);
            }
        }
        sum
    }

    /// Mean of `value` applied to the distance from the map's plane to the visible geometry, over the samples near
    /// `at`; 0 for empty samples.
    pub(crate) fn seen(&self, at: Vec3, value: impl Fn(f32) -> f32) -> f32 {
        let [x, y, _] = self.view.project(at);
        self.blend([x, y], 0.0, |lanes| {
            let seen = |depth: &f32| if *depth > raster::UNCOVERED { value(-*depth) } else { 0.0 };
            lanes.iter().fold(0.0, |sum, depth| sum + seen(depth)) / SAMPLES as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of side 1 at height 0.5 over the middle.
    fn roof() -> Scene {
        let corner = |x: f32, z: f32| Corner { at: [x, 0.5, z], normal: [0.0, 1.0, 0.0], color: [0.5; 3] };
        let [a, b, c, d] = [corner(-0.5, -0.5), corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5)];
        Scene { triangles: vec![[a, b, c], [a, c, d]], ..Scene::default() }
    }

    #[test]
    fn full_light_clips_no_color_and_keeps_hue_and_order() {
        let full = add(add(KEY_LIGHT, FILL_LIGHT), SKY_LIGHT);
        let shown = |color: Vec3| exposed(times(color, full));
        assert!(shown([1.0; 3]).iter().all(|x| *x < 0.95));
        assert!(shown([1.0; 3])[1] > shown([0.9; 3])[1] + 0.005);
        let [r, g, _] = shown([1.0, 0.5, 0.0]);
        assert!((g / r - 0.5 * full[1] / full[0]).abs() < 1e-5);
        assert_eq!(exposed([0.5, 0.2, 0.1]), [0.5, 0.2, 0.1]);
    }

    #[test]
    fn a_roof_shades_points_under_it_and_half_at_its_edge() {
        let map = DepthMap::towards(&roof(), [0.0, -1.0, 0.0]);
        assert_eq!(map.clear([0.0, 0.0, 0.0], 0.0), 0.0);
        assert_eq!(map.clear([0.0, 0.6, 0.0], 0.0), 1.0);
        assert_eq!(map.clear([0.8, 0.0, 0.0], 0.0), 1.0);
        assert_eq!(map.clear([9.0, 0.0, 0.0], 0.0), 1.0);
        assert!((map.clear([0.5, 0.0, 0.0], 0.0) - 0.5).abs() < 0.2);
    }

    #[test]
    fn distance_to_visible_geometry_is_measured_from_the_plane() {
        let up = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
        let map = DepthMap::from(&roof(), [0.0, -1.0, 0.0], up);
        assert!((map.seen([0.1, -1.0, 0.2], |distance| distance) - 1.5).abs() < 1e-5);
        assert_eq!(map.seen([0.9, -1.0, 0.2], |distance| distance), 0.0);
    }
}
