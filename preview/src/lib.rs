//! Pictures of geometry, drawn by a small z-buffer rasteriser without GPU or window.
//!
//! Curves have width and are shaded along their tangent, meshes and the skins of tets are lit, points are balls,
//! volumes show their zero level; an attribute, or a component of one, can be shown as colour. [`render`] draws one panel;
//! [`contact_sheet`] joins panels; [`Image::write_png`] and [`Movie`] write them. For a sequence, give every frame the
//! camera and the bounds of one [`Framing`], and the same [`PictureSettings::range`].
//!
//! Guarantees: the same bits on any number of threads and any CPU; no panic and bounded work for any geometry. Limit: a
//! preview, not a renderer: no textures, and transparency only for things thinner than a pixel.

mod arrow;
mod camera;
mod clip;
mod color;
mod framing;
mod ground;
mod image;
mod light;
mod movie;
mod picture;
mod raster;
mod scene;
mod shape;
mod text;
mod vector;
mod view;

use engine::geometry::Geometry;

pub use camera::{BoundingBox, Camera, CameraError};
pub use clip::Clip;
pub use color::{attribute_names, attribute_range, color_map, palette};
pub use framing::Framing;
pub use image::{Image, contact_sheet, side_by_side};
pub use movie::Movie;
pub use picture::render;
pub use scene::{bounds, memory, union};

/// A geometry in a picture.
#[derive(Clone, Copy, Debug)]
pub struct Layer<'a> {
    /// Its name in the label: an output's name.
    pub name: &'a str,
    /// What is drawn.
    pub geometry: &'a Geometry,
    /// Linear light 0…1, used without a colour attribute; each kind of component has its own default. The caption shows
    /// it beside the name.
    pub color: Option<[f32; 3]>,
    /// Whether it only helps to read the picture: its curves are thin lines without light or shadow, which the camera does
    /// not frame.
    pub is_guide: bool,
}

impl<'a> Layer<'a> {
    /// A layer in default colours.
    pub fn new(name: &'a str, geometry: &'a Geometry) -> Self {
        Self { name, geometry, color: None, is_guide: false }
    }

    /// A layer of thin lines: the curves of `geometry`.
    pub fn guide(name: &'a str, geometry: &'a Geometry) -> Self {
        Self { is_guide: true, ..Self::new(name, geometry) }
    }
}

/// How a panel is drawn. Lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureSettings {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// The camera; by default [`Camera::fit`] around the bounds.
    pub camera: Option<Camera>,
    /// Bounds for the camera, the floor and the lights; by default those of the layers.
    pub bounds: Option<BoundingBox>,
    /// Attribute that gives the colour: a number, a vector by its length, a component like `P.y`, or a colour by its name
    /// (`Cd`, `color`, `displayColor`). Components without it are grey. If `None`, a colour attribute is drawn if there is one.
    pub color_by: Option<String>,
    /// Values at the ends of the colour map; by default the layers' [`attribute_range`].
    pub range: Option<[f32; 2]>,
    /// Width of all curves; overrides their `width`.
    pub curve_width: Option<f32>,
    /// Diameter of all points; overrides their `width`.
    pub point_width: Option<f32>,
    /// Brightest colour of the backdrop, sRGB.
    pub background: [u8; 3],
    /// Whether a floor under the bounds receives shadows.
    pub ground: bool,
    /// Whether the layers' names, and the attribute that colours them, are written into the upper left.
    pub names: bool,
    /// Text that is written after the names: the frame.
    pub note: Option<String>,
    /// Whether a bar explains the colours of `color_by`.
    pub legend: bool,
    /// Direction of the wind, for an arrow in the lower right.
    pub wind: Option<[f32; 3]>,
    /// A plane that cuts the scene open.
    pub clip: Option<Clip>,
}

impl Default for PictureSettings {
    fn default() -> Self {
        Self {
            width: 960,
            height: 720,
            camera: None,
            bounds: None,
            color_by: None,
            range: None,
            curve_width: None,
            point_width: None,
            background: [232, 230, 226],
            ground: true,
            names: true,
            note: None,
            legend: true,
            wind: None,
            clip: None,
        }
    }
}

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PreviewError {
    /// No pixel, or too many.
    #[error("the picture is {width} × {height} pixels, expected 1 to {most} in all", most = Image::MOST_PIXELS)]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A movie with no frame, or more pixels in all than [`Movie::MOST_PIXELS`].
    #[error(
        "the movie is {frames} frames of {width} × {height} pixels, expected at least 1 frame and at most {most} pixels in \
         all",
        most = Movie::<std::io::Sink>::MOST_PIXELS
    )]
    Length {
        /// Frames.
        frames: usize,
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A sheet without a picture or a column.
    #[error("a sheet of {panels} pictures in {columns} columns, expected at least 1 of each")]
    EmptySheet {
        /// Pictures given.
        panels: usize,
        /// Requested columns.
        columns: usize,
    },
    /// The file could not be written.
    #[error("the picture could not be written: {0}")]
    Write(#[source] std::io::Error),
}

impl From<png::EncodingError> for PreviewError {
    fn from(error: png::EncodingError) -> Self {
        Self::Write(error.into())
    }
}
