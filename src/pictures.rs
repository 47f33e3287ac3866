//! Pictures of a cook: a contact sheet, or one PNG per frame, with outputs side by side.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use engine::cook::Delivered;
use engine::frames::FrameSet;
use engine::geometry::Geometry;
use engine::graph::Graph;
use engine::plan::Request;
use engine::time::Frame;
use preview::{Camera, Image, Layer, PictureSettings, attribute_names, attribute_range, bounds, render, union};

use crate::args::Frames;
use crate::failure::{Exit, Failure};
use crate::output::write_whole;

/// The arguments of `cook` for pictures.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Pictures")]
// Otherwise this group and the enclosing one would have the same name.
#[group(skip)]
pub struct PictureArgs {
    /// Draw a contact sheet of six frames, DIR/preview.png
    #[arg(long)]
    preview: bool,
    /// Draw these frames instead of a contact sheet, one PNG each: DIR/preview.0024.png
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    preview_frames: Option<Frames>,
    /// Width and height of a panel in pixels [default: 640x480]
    #[arg(long, value_name = "WxH")]
    preview_size: Option<String>,
    /// Camera: eye=1,2,3 target=0,0,0 fov=35 [default: shows everything drawn]
    #[arg(long, value_name = "CAMERA")]
    camera: Option<String>,
    /// Numeric attribute to show as colour
    #[arg(long, value_name = "ATTRIBUTE")]
    color_by: Option<String>,
}

impl PictureArgs {
    /// Any of these options requests pictures, so that none is silently ignored.
    fn asks_for_pictures(&self) -> bool {
        self.preview
            || self.preview_frames.is_some()
            || self.preview_size.is_some()
            || self.camera.is_some()
            || self.color_by.is_some()
    }
}

/// Frames of a contact sheet.
const SHEET_FRAMES: usize = 6;

/// Columns of a contact sheet with one output.
const SHEET_COLUMNS: usize = 3;

/// Collects the frames to draw.
pub struct Pictures {
    names: Vec<(usize, String)>,
    frames: Vec<Frame>,
    sheet: bool,
    settings: PictureSettings,
    folder: PathBuf,
    kept: BTreeMap<(Frame, usize), Arc<Geometry>>,
}

impl Pictures {
    /// What to draw; `None` if no pictures are requested.
    ///
    /// # Errors
    /// If the size or the camera is invalid, or a frame to draw is not cooked.
    pub fn new(args: &PictureArgs, graph: &Graph, request: &Request, folder: &Path) -> Result<Option<Self>, Failure> {
        if !args.asks_for_pictures() {
            return Ok(None);
        }
        let wrong = |text: String| Failure::new(Exit::CommandLine, text);
        let text = args.preview_size.as_deref().unwrap_or("640x480");
        let (width, height) =
            size(text).ok_or_else(|| wrong(format!("`{text}` is not a size in pixels; write 640x480")))?;
        let camera = args.camera.as_deref().map(str::parse::<Camera>).transpose();
        let camera = camera.map_err(|error| wrong(format!("--camera: {error}")))?;
        let frames = match &args.preview_frames {
            None => spread(&request.frames),
            Some(frames) => frames.frames().iter().collect(),
        };
        if let Some(frame) = frames.iter().find(|frame| !request.frames.contains(**frame)) {
            return Err(wrong(format!("--preview-frames: frame {frame} is not among the frames to cook")));
        }
        let settings =
            PictureSettings { width, height, camera, color_by: args.color_by.clone(), ..PictureSettings::default() };
        let names = request.outputs.iter().map(|index| (*index, graph.outputs[*index].name.to_string())).collect();
        let sheet = args.preview_frames.is_none();
        Ok(Some(Self { names, frames, sheet, settings, folder: folder.to_owned(), kept: BTreeMap::new() }))
    }

    /// Keeps the frames to draw.
    pub fn take(&mut self, finished: &[Delivered]) {
        for one in finished.iter().filter(|one| self.frames.contains(&one.frame)) {
            self.kept.insert((one.frame, one.output), one.geometry.clone());
        }
    }

    /// Draws and writes the pictures; returns their paths.
    ///
    /// # Errors
    /// If a picture cannot be drawn or written.
    pub fn write(mut self) -> Result<Vec<PathBuf>, Failure> {
        if self.kept.is_empty() {
            return Ok(Vec::new());
        }
        let names = self.frame_all();
        if let (Some(name), None) = (&self.settings.color_by, self.settings.range) {
            let available = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            crate::say!("note: no output has a numeric attribute `{name}` to colour by; available: {available}");
        }
        let drawn: Vec<Frame> =
            self.frames.iter().copied().filter(|frame| self.kept.keys().any(|(at, _)| at == frame)).collect();
        let mut rows = Vec::new();
        for frame in drawn {
            let panels =
                self.names.iter().map(|(output, name)| self.panel(frame, *output, name)).collect::<Result<Vec<_>, _>>();
            rows.push((frame, panels.map_err(drawing)?));
        }
        if self.sheet {
            let columns = if self.names.len() == 1 { SHEET_COLUMNS } else { self.names.len() };
            let panels: Vec<Image> = rows.into_iter().flat_map(|(_, panels)| panels).collect();
            let sheet = preview::contact_sheet(&panels, columns).map_err(drawing)?;
            return Ok(vec![save(&sheet, self.folder.join("preview.png"))?]);
        }
        let each = rows.into_iter().map(|(frame, panels)| {
            let picture = preview::side_by_side(&panels).map_err(drawing)?;
            save(&picture, self.folder.join(format!("preview.{}.png", frame.file_label())))
        });
        each.collect()
    }

    /// Sets one camera and one range of colours for all panels. Returns the names of the existing attributes.
    fn frame_all(&mut self) -> Vec<String> {
        let layers: Vec<Layer<'_>> = self.kept.values().map(|geometry| Layer::new("", geometry)).collect();
        let all = layers.iter().map(|layer| bounds(std::slice::from_ref(layer))).fold(None, union);
        let range = self.settings.color_by.as_ref().and_then(|name| attribute_range(&layers, name));
        let names = attribute_names(&layers).into_iter().map(|name| format!("`{name}`")).collect();
        self.settings.bounds = all;
        self.settings.range = range;
        names
    }

    fn panel(&self, frame: Frame, output: usize, name: &str) -> Result<Image, preview::PreviewError> {
        let geometry = self.kept.get(&(frame, output));
        let layers: Vec<Layer<'_>> = geometry.map(|geometry| Layer::new(name, geometry)).into_iter().collect();
        let settings = PictureSettings { note: Some(frame.to_string()), ..self.settings.clone() };
        render(&layers, &settings)
    }
}

/// Parses `WxH`; `None` if it is invalid or too large.
fn size(text: &str) -> Option<(usize, usize)> {
    let (width, height) = text.split_once('x')?;
    let (width, height): (usize, usize) = (width.parse().ok()?, height.parse().ok()?);
    let pixels = width.checked_mul(height)?;
    (1..=Image::MOST_PIXELS).contains(&pixels).then_some((width, height))
}

fn drawing(error: preview::PreviewError) -> Failure {
    Failure::new(Exit::CommandLine, format!("the picture could not be drawn: {error}"))
}

fn save(image: &Image, path: PathBuf) -> Result<PathBuf, Failure> {
    let mut bytes = Vec::new();
    image.write_png(&mut bytes).map_err(drawing)?;
    write_whole(&path, &bytes)?;
    Ok(path)
}

/// The frames of a contact sheet: evenly spaced, including the first and the last.
fn spread(frames: &FrameSet) -> Vec<Frame> {
    if frames.len() <= SHEET_FRAMES {
        return frames.iter().collect();
    }
    (0..SHEET_FRAMES).filter_map(|k| frames.get(k * (frames.len() - 1) / (SHEET_FRAMES - 1))).collect()
}
