//! The options of `cook` for pictures.

use preview::{Clip, Image};

use crate::args::Frames;

/// The arguments of `cook` for pictures.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Pictures")]
// Otherwise this group and the enclosing one would have the same name.
#[group(skip)]
pub struct PictureArgs {
    /// Draw a contact sheet of the six frames that show most of the motion, DIR/GRAPH.preview.png
    #[arg(long)]
    pub(super) preview: bool,
    /// Draw these frames instead of a contact sheet, one PNG each: DIR/GRAPH.preview.0024.png
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    pub(super) preview_frames: Option<Frames>,
    /// Draw all frames as a movie, DIR/GRAPH.preview.apng, which web browsers play
    #[arg(long)]
    pub(super) movie: bool,
    /// Draw each output in its own panel instead of all in one
    #[arg(long)]
    pub(super) preview_split: bool,
    /// Width and height of a panel in pixels [default: 640x480]
    #[arg(long, value_name = "WxH")]
    pub(super) preview_size: Option<String>,
    /// Camera: eye=1,2,3 target=0,0,0 fov=35 [default: shows everything drawn]
    #[arg(long, value_name = "CAMERA")]
    pub(super) camera: Option<String>,
    /// Numeric attribute, or component of one, to show as colour: width, P.y
    #[arg(long, value_name = "ATTRIBUTE")]
    pub(super) color_by: Option<String>,
    /// Cut pictures open at a plane, such as x=0; geometry beyond it, at x > 0, is not drawn
    #[arg(long, value_name = "AXIS=VALUE", allow_hyphen_values = true)]
    pub(super) clip: Option<Clip>,
}

impl PictureArgs {
    /// Any of these options requests pictures, so that none is silently ignored.
    pub(super) fn asks_for_pictures(&self) -> bool {
        self.movie || self.preview_frames.is_some() || self.asks_for_a_sheet()
    }

    pub(super) fn asks_for_a_sheet(&self) -> bool {
        let asks_how = self.preview_size.is_some()
            || self.preview_split
            || self.camera.is_some()
            || self.color_by.is_some()
            || self.clip.is_some();
        self.preview_frames.is_none() && (self.preview || (asks_how && !self.movie))
    }
}

/// Parses `WxH`; `None` if it is invalid or too large.
pub(super) fn size(text: &str) -> Option<(usize, usize)> {
    let (width, height) = text.split_once('x')?;
    let (width, height): (usize, usize) = (width.parse().ok()?, height.parse().ok()?);
    let pixels = width.checked_mul(height)?;
    (1..=Image::MOST_PIXELS).contains(&pixels).then_some((width, height))
}
