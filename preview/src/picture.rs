//! One panel: the layers staged, lit, drawn over the backdrop, and labelled.

use crate::camera::Camera;
use crate::color::{attribute_range, decode, encode, own_color_name};
use crate::ground::Ground;
use crate::image::Image;
use crate::light::Light;
use crate::raster::{self, SAMPLES, Screen, Shader, TILE, Tile, UNCOVERED};
use crate::scene::{self, GUIDE, Scene};
use crate::text::Phrase;
use crate::vector::{finite, mix};
use crate::view::{Stage, View};
use crate::{Layer, PictureSettings, PreviewError, arrow, text};
use numerics::vector::{Vec3, add, scale, sub, unit};

/// Bounds of an empty scene: a metre around the origin.
const NOTHING: crate::BoundingBox = [[-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]];
/// Fraction of the backdrop's light that is missing in the corners of the picture.
const VIGNETTE: f32 = 0.30;
/// Fraction of light that a thick strand loses towards its edges, as it is round.
const ROUND: f32 = 0.45;

/// Draws the layers into one picture. An empty scene gives the backdrop.
///
/// # Errors
/// If the picture would have no pixel, or too many.
pub fn render(layers: &[Layer<'_>], settings: &PictureSettings) -> Result<Image, PreviewError> {
    let size = [settings.width, settings.height];
    let mut image = Image::filled(size[0], size[1], settings.background)?;
    let bounds = settings.bounds.or_else(|| scene::bounds(layers)).unwrap_or(NOTHING);
    let range = settings.range.or_else(|| attribute_range(layers, settings.color_by.as_deref()?));
    let camera = settings.camera.unwrap_or_else(|| Camera::fit(bounds, size[0] as f64 / size[1] as f64));

    let stage = Stage::of(bounds);
    let view = View::perspective(&camera, &stage, size[0], size[1]);
    let mut scene = Scene::of(layers, settings, range.unwrap_or([0.0, 1.0]), &stage);
    let light = Light::set_up(&mut scene, &view, settings.color_by.is_some());
    let floor = stage.place(bounds[0])[1];
    let ground = (settings.ground && finite([floor; 3])).then(|| Ground::of(&scene, &light, floor));
    scene.add_guides(layers, settings.clip, &stage);
    let backdrop = Backdrop { light: settings.background.map(|byte| decode(f32::from(byte) / 255.0)), ground, size };

    let screen = Screen::of(&scene, &view, size);
    let tiles = raster::draw(&screen, &Studio { view: &view, light: &light }, |tile| resolve(&tile, &backdrop, &view));
    for (index, pixels) in tiles.iter().enumerate() {
        let columns = size[0].div_ceil(TILE);
        let (left, top) = (index % columns * TILE, index / columns * TILE);
        let across = TILE.min(size[0] - left);
        for (y, row) in pixels.chunks(TILE).enumerate().take(size[1] - top) {
            image.row_mut(top + y)[left..left + across].copy_from_slice(&row[..across]);
        }
    }

    text::caption(&mut image, &caption(layers, settings));
    if let (Some(name), Some(range), true) = (&settings.color_by, range, settings.legend) {
        text::legend(&mut image, name, range);
    }
    if let Some(wind) = settings.wind {
        arrow::draw(&mut image, &camera, wind);
    }
    Ok(image)
}

/// The names of the layers, the note, and what colours them.
fn caption(layers: &[Layer<'_>], settings: &PictureSettings) -> Vec<Phrase> {
    let drawn = || layers.iter().filter(|layer| !layer.is_guide);
    let mut phrases: Vec<Phrase> = Vec::new();
    for layer in layers.iter().filter(|_| settings.names) {
        let has_own = !layer.is_guide && (settings.color_by.is_some() || own_color_name(layer).is_some());
        let color = if layer.is_guide { Some(layer.color.unwrap_or(GUIDE)) } else { layer.color };
        let phrase = Phrase { color: color.filter(|_| !has_own).map(encode), text: layer.name.to_owned() };
        // Several guides may have one name.
        if !phrases.contains(&phrase) {
            phrases.push(phrase);
        }
    }
    phrases.extend(settings.note.iter().map(|note| Phrase { color: None, text: note.clone() }));
    let colored_by = match &settings.color_by {
        // The legend names it.
        Some(_) => None,
        None => drawn().find_map(own_color_name),
    };
    phrases.extend(
        colored_by.filter(|_| settings.names).map(|name| Phrase { color: None, text: format!("coloured by {name}") }),
    );
    phrases
}

/// The camera's shader.
struct Studio<'a> {
    view: &'a View,
    light: &'a Light,
}

impl Shader for Studio<'_> {
    type Color = Vec3;

    fn surface(&self, at: Vec3, normal: Vec3, color: Vec3) -> Vec3 {
        self.light.surface(self.view.unproject(at), normal, color)
    }

    fn strand(&self, color: Vec3, across: f32, radius: f32) -> Vec3 {
        // Below a width of two pixels no edge is visible.
        let seen = ((radius - 1.0) * 0.5).clamp(0.0, 1.0);
        let height = (1.0 - across * across).max(0.0).sqrt();
        scale(color, 1.0 - ROUND * seen * (1.0 - height))
    }

    fn ball(&self, [x, y]: [f32; 2], color: Vec3, lit: f32) -> Vec3 {
        let [right, up, forward] = self.view.axes();
        let height = (1.0 - x * x - y * y).max(0.0).sqrt();
        let normal = sub(add(scale(right, x), scale(up, y)), scale(forward, height));
        let to_eye = scale(forward, -1.0);
        self.light.matt(unit(normal).unwrap_or(to_eye), to_eye, color, lit)
    }
}

/// The background.
struct Backdrop {
    light: Vec3,
    ground: Option<Ground>,
    size: [usize; 2],
}

impl Backdrop {
    fn at(&self, view: &View, x: f32, y: f32) -> Vec3 {
        let [u, v] = [x / self.size[0] as f32 - 0.5, y / self.size[1] as f32 - 0.55];
        let dim = 1.0 - VIGNETTE * (1.6 * (u * u + v * v)).min(1.0);
        let shadow = self.ground.as_ref().map_or(1.0, |ground| ground.light(view, x, y));
        // Shadow on the backdrop is not quite grey: the fill light is cool.
        let tint = mix([0.97, 0.985, 1.0], [1.0; 3], shadow);
        [0, 1, 2].map(|k| self.light[k] * dim * shadow * tint[k])
    }
}

/// The mean of each pixel's samples, as bytes.
fn resolve(tile: &Tile<Vec3>, backdrop: &Backdrop, view: &View) -> Vec<[u8; 3]> {
    let pixel = |index: usize| {
        let behind =
            || backdrop.at(view, (tile.left + index % TILE) as f32 + 0.5, (tile.top + index / TILE) as f32 + 0.5);
        let bare = tile.depth[index].iter().filter(|depth| **depth == UNCOVERED).count();
        if bare == SAMPLES {
            return encode(behind());
        }
        // Values above white are clamped before the mean, otherwise their edges would have steps.
        let sum = tile.color[index].iter().fold([0.0; 3], |sum, color| add(sum, color.map(|x| x.min(1.0))));
        let sum = if bare > 0 { add(sum, scale(behind(), bare as f32)) } else { sum };
        encode(scale(sum, 1.0 / SAMPLES as f32))
    };
    (0..TILE * TILE).map(pixel).collect()
}

#[cfg(test)]
mod tests;
