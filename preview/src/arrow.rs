//! An arrow in the lower right that shows where the wind blows to, seen by the camera.
//!
//! Guarantees: the same bits on any machine; an arrow that points along the view is short, but never vanishes. Limit: it
//! shows the direction, not the strength.

use crate::camera::Camera;
use crate::image::Image;
use crate::text;
use numerics::vector::{DVec3, direction};

/// Sizes in dots of the text: half the arrow's length, half its shaft's width, and its head.
const HALF: f64 = 16.0;
const SHAFT: f64 = 1.2;
const HEAD: [f64; 2] = [9.0, 4.5];
/// Distance of its middle from the right and lower borders, dots.
const MIDDLE: [f64; 2] = [26.0, 31.0];
/// Dots from the lower border to the label's.
const LABEL: usize = 6;
/// Length of an arrow along the view, as a fraction of one across it.
const LEAST: f64 = 0.35;
/// Samples of a pixel along each side.
const SAMPLES: usize = 4;
/// Dark blue, sRGB.
const INK: [f64; 3] = [32.0, 62.0, 104.0];

/// Draws the arrow and its label; nothing for a wind without direction, or into a picture without room for it.
pub(crate) fn draw(image: &mut Image, camera: &Camera, wind: [f32; 3]) {
    let Some(wind) = direction(DVec3::from(wind.map(f64::from))) else { return };
    let dot = text::dot_size(image);
    let size = [image.width(), image.height()];
    let room = 2 * (MIDDLE[0] * dot as f64) as usize;
    if size.iter().any(|side| *side < 2 * room) {
        return;
    }
    let [right, up, _] = camera.axes();
    let across = [right.dot(&wind), -up.dot(&wind)];
    let seen = (across[0] * across[0] + across[1] * across[1]).sqrt();
    // Straight along the view: drawn upwards if it blows away from the eye, downwards if towards it.
    let along = if seen > 1e-6 { across.map(|x| x / seen) } else { [0.0, -camera.axes()[2].dot(&wind).signum()] };
    let arrow = Arrow {
        middle: [0, 1].map(|k| size[k] as f64 - MIDDLE[k] * dot as f64),
        along,
        half: HALF * dot as f64 * seen.max(LEAST),
        dot: dot as f64,
    };
    for y in size[1] - room..size[1] {
        for x in size[0] - room..size[0] {
            let cover = arrow.cover(x, y);
            let pixel = &mut image.row_mut(y)[x];
            *pixel = [0, 1, 2].map(|k| (f64::from(pixel[k]) * (1.0 - cover) + INK[k] * cover + 0.5) as u8);
        }
    }
    let half_word = 13 * dot;
    text::label(image, "wind", [(arrow.middle[0] as usize + half_word).min(size[0]), size[1] - LABEL * dot]);
}

/// An arrow on the picture, pixels.
struct Arrow {
    middle: [f64; 2],
    along: [f64; 2],
    half: f64,
    dot: f64,
}

impl Arrow {
    /// Fraction of a pixel that it covers.
    fn cover(&self, x: usize, y: usize) -> f64 {
        let at = |pixel: usize, k: usize| pixel as f64 + (k as f64 + 0.5) / SAMPLES as f64;
        let inside = (0..SAMPLES * SAMPLES).filter(|k| self.contains([at(x, k % SAMPLES), at(y, k / SAMPLES)])).count();
        inside as f64 / (SAMPLES * SAMPLES) as f64
    }

    fn contains(&self, at: [f64; 2]) -> bool {
        let [x, y] = [0, 1].map(|k| at[k] - self.middle[k]);
        let along = x * self.along[0] + y * self.along[1];
        let aside = (y * self.along[0] - x * self.along[1]).abs();
        let [length, width] = HEAD.map(|dots| dots * self.dot);
        let neck = self.half - length;
        let in_shaft = along >= -self.half && along <= neck && aside <= SHAFT * self.dot;
        in_shaft || (along >= neck && along <= self.half && aside <= width * (self.half - along) / length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The picture's ink, as its centre of mass relative to the arrow's middle weighted by the distance from it.
    fn ink(wind: [f32; 3]) -> (usize, [f64; 2]) {
        let mut image = Image::filled(320, 240, [255; 3]).unwrap();
        let camera = Camera::new([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0], 30.0).unwrap();
        draw(&mut image, &camera, wind);
        let dark = |k: &usize| image.pixels()[*k][2] < 200;
        let mut sum = [0.0; 2];
        let arrow = (0..320 * 240).filter(dark).filter(|k| k / 320 < 240 - 15).collect::<Vec<_>>();
        for k in &arrow {
            sum[0] += (k % 320) as f64 + 0.5 - (320.0 - MIDDLE[0]);
            sum[1] += (k / 320) as f64 + 0.5 - (240.0 - MIDDLE[1]);
        }
        (arrow.len(), sum)
    }

    #[test]
    fn the_head_is_where_the_wind_blows_to() {
        let (count, [x, y]) = ink([1.0, 0.0, 0.0]);
        assert!(count > 60 && x > 150.0 && y.abs() < 30.0, "{count} {x} {y}");
        let (_, [x, y]) = ink([0.0, 2.0, 0.0]);
        assert!(y < -150.0 && x.abs() < 60.0, "{x} {y}");
        let (along, _) = ink([0.0, 0.0, -1.0]);
        assert!(along > 30 && along < count);
        assert_eq!(ink([0.0; 3]).0, 0);
        assert_eq!(ink([f32::NAN, 0.0, 0.0]).0, 0);
    }
}
