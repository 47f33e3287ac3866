//! Pictures of a cook: a contact sheet, one PNG per frame, or a movie.
//!
//! All outputs are drawn together, or each in its own panel; guides (see `guides`) help to read them. All frames of a
//! picture file have one camera and one range of colours. A contact sheet holds a few frames in memory, frames and movies
//! none.

mod args;
mod guides;
mod moments;
mod spool;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use engine::cook::Delivered;
use engine::frames::FrameSet;
use engine::geometry::Geometry;
use engine::graph::Graph;
use engine::memory::{Ceiling, size_text};
use engine::plan::Request;
use engine::time::Frame;
use formats::atomic::{AtomicFile, FileError};
use preview::{
    Camera, Framing, Image, Layer, Movie, PictureSettings, attribute_names, attribute_range, palette, render,
};

use crate::failure::{Exit, Failure};
use crate::output::{failed, write_whole};
use crate::targets::Targets;
pub use args::PictureArgs;
use guides::Guides;
use moments::{Moments, Shot};
use spool::Spool;

/// Frames of a contact sheet.
const SHEET_FRAMES: usize = 6;
/// Brightness of lines relative to surfaces of the same colour: they are thin, and the backdrop is light.
const LINE: f32 = 0.4;
/// Share of two outputs' joint bounds above which they are taken to lie in the same place.
const SAME_PLACE: f64 = 0.85;

/// A graph with the guides of its pictures as further outputs, and the request that cooks them along.
pub struct Staged {
    /// The graph; its first outputs are those of the original.
    pub graph: Graph,
    /// The request.
    pub request: Request,
    guides: Guides,
}

impl Staged {
    /// What to cook for the pictures of `request`; `None` if no pictures are requested.
    pub fn of(args: &PictureArgs, graph: &Graph, request: &Request) -> Option<Self> {
        args.asks_for_pictures().then(|| {
            let (mut graph, mut request) = (graph.clone(), request.clone());
            let guides = Guides::add_to(&mut graph, &request.outputs);
            request.outputs.extend(guides.outputs());
            Self { graph, request, guides }
        })
    }
}

/// Collects the frames to draw.
pub struct Pictures<'g> {
    staged: &'g Staged,
    /// Outputs to draw, by their position in the graph.
    outputs: Vec<usize>,
    split: bool,
    settings: PictureSettings,
    ceiling: Ceiling,
    /// DIR/GRAPH.preview, to which endings are added.
    stem: PathBuf,
    sheet: Option<Moments>,
    /// Frames that are drawn one by one, and all of a movie.
    stills: Option<FrameSet>,
    movie: bool,
    film: Option<Film>,
}

/// Frames on disk, with what all of them share.
struct Film {
    spool: Spool,
    common: Common,
}

/// What is the same in all frames of a picture file.
struct Common {
    /// Of the outputs; and of those that are controls, which only count where there are no others.
    subjects: Framing,
    controls: Framing,
    range: Option<[f32; 2]>,
    attributes: Vec<String>,
}

impl<'g> Pictures<'g> {
    /// What to draw; pictures are written into `folder` and named after the file of the graph.
    ///
    /// # Errors
    /// If the size or the camera is invalid, a frame to draw is not cooked, or a movie would be too large.
    pub fn new(
        args: &PictureArgs,
        staged: &'g Staged,
        file: &Path,
        folder: &Path,
        ceiling: Ceiling,
    ) -> Result<Self, Failure> {
        let wrong = |text: String| Failure::new(Exit::CommandLine, text);
        let text = args.preview_size.as_deref().unwrap_or("640x480");
        let (width, height) =
            args::size(text).ok_or_else(|| wrong(format!("`{text}` is not a size in pixels; write 640x480")))?;
        let camera = args.camera.as_deref().map(str::parse::<Camera>).transpose();
        let camera = camera.map_err(|error| wrong(format!("--camera: {error}")))?;
        let asked = &staged.request.frames;
        let stills = args.preview_frames.as_ref().map(|frames| frames.of(&staged.graph.scene)).transpose()?;
        if let Some(frame) = stills.iter().flat_map(FrameSet::iter).find(|frame| !asked.contains(*frame)) {
            return Err(wrong(format!("--preview-frames: frame {frame} is not among the frames to cook")));
        }
        let settings = PictureSettings {
            width,
            height,
            camera,
            color_by: args.color_by.clone(),
            clip: args.clip,
            ..PictureSettings::default()
        };
        let guides = staged.guides.outputs();
        let outputs: Vec<usize> =
            staged.request.outputs.iter().copied().filter(|output| !guides.contains(output)).collect();
        if args.movie {
            let panels = if args.preview_split { outputs.len().max(1) } else { 1 };
            Movie::check(width.saturating_mul(panels), height, asked.len()).map_err(|error| {
                wrong(format!("--movie: {error}; choose fewer --frames or a smaller --preview-size"))
            })?;
        }
        let name = file.file_stem().filter(|name| *name != "-").unwrap_or("graph".as_ref());
        let mut stem = name.to_owned();
        stem.push(".preview");
        Ok(Self {
            staged,
            outputs,
            split: args.preview_split,
            settings,
            ceiling,
            stem: folder.join(stem),
            sheet: args.asks_for_a_sheet().then(Moments::default),
            stills,
            movie: args.movie,
            film: None,
        })
    }

    /// Adds the pictures to what a command writes.
    pub fn add_targets(&self, targets: &mut Targets) {
        let wanted = [(self.sheet.is_some(), "png"), (self.movie, "apng")];
        for (_, ending) in wanted.into_iter().filter(|(is_wanted, _)| *is_wanted) {
            targets.writes("--preview", Exit::File, &self.path(ending));
        }
        if let Some(stills) = &self.stills {
            let (folder, stem) =
                (self.stem.parent().unwrap_or(Path::new(".")), self.stem.file_name().unwrap_or_default());
            targets.writes_frames("--preview", folder, &stem.to_string_lossy(), "png", stills);
        }
    }

    fn path(&self, ending: &str) -> PathBuf {
        let mut path = self.stem.clone().into_os_string();
        path.push(".");
        path.push(ending);
        path.into()
    }

    fn still_path(&self, frame: Frame) -> PathBuf {
        self.path(&format!("{}.png", frame.file_label()))
    }

    /// Keeps the frames to draw.
    ///
    /// # Errors
    /// If they cannot be kept on disk.
    pub fn take(&mut self, finished: &[Delivered]) -> Result<(), Failure> {
        let guides = self.staged.guides.outputs();
        let mut frames: BTreeMap<Frame, Shot> = BTreeMap::new();
        for one in finished {
            let lines = || guides::lines_of(&one.geometry).map(Arc::new);
            let bare = || guides::without_controls(&one.geometry).filter(|_| self.staged.guides.has_controls());
            let output = || bare().map_or_else(|| one.geometry.clone(), Arc::new);
            let kept = if guides.contains(&one.output) { lines() } else { Some(output()) };
            if let Some(kept) = kept {
                frames.entry(one.frame).or_default().insert(one.output, kept);
            }
        }
        for (frame, shot) in frames {
            if self.movie || self.stills.as_ref().is_some_and(|stills| stills.contains(frame)) {
                self.film(frame, &shot)?;
            }
            if let Some(sheet) = &mut self.sheet {
                sheet.add(frame, shot, |output| !guides.contains(&output));
            }
        }
        Ok(())
    }

    /// Keeps a frame on disk.
    fn film(&mut self, frame: Frame, shot: &Shot) -> Result<(), Failure> {
        let folder = self.stem.parent().unwrap_or(Path::new("."));
        let unwritable = |error| failed(&FileError::new(folder, "used for the frames of pictures", error));
        if self.film.is_none() {
            let spool = Spool::create(folder).map_err(unwritable)?;
            self.film = Some(Film { spool, common: Common::new(&self.settings) });
        }
        let Some(film) = &mut self.film else { return Ok(()) };
        film.common.add(shot, &self.outputs, &self.settings);
        shot.iter().try_for_each(|(output, geometry)| film.spool.add(frame, *output, geometry)).map_err(unwritable)
    }

    /// Draws and writes the pictures; returns their paths. After an interruption there is no movie, and once `cancel` is
    /// set while pictures are drawn, no more.
    ///
    /// # Errors
    /// If a picture cannot be drawn or written.
    pub fn write(mut self, interrupted: bool, cancel: &AtomicBool) -> Result<Vec<PathBuf>, Failure> {
        let stopped = || !interrupted && cancel.load(Ordering::Relaxed);
        let mut written = Vec::new();
        if let Some(sheet) = self.sheet.take() {
            let shots = sheet.chosen(SHEET_FRAMES);
            if !shots.is_empty() {
                written.push(self.write_sheet(shots.into_iter().collect())?);
            }
        }
        if let Some(mut film) = self.film.take() {
            self.report_unknown_attribute(&film.common);
            for frame in self.stills.iter().flat_map(FrameSet::iter) {
                if stopped() {
                    return Ok(written);
                }
                let shot = film.spool.read(frame).map_err(unreadable)?;
                if !shot.is_empty() {
                    written.push(save(&self.panels(frame, &shot, &film.common)?, self.still_path(frame))?);
                }
            }
            if self.movie && !interrupted {
                written.extend(self.write_movie(&mut film, &stopped)?);
            }
        }
        Ok(written)
    }

    fn write_sheet(&self, shots: Vec<(Frame, Shot)>) -> Result<PathBuf, Failure> {
        let mut common = Common::new(&self.settings);
        for (_, shot) in &shots {
            common.add(shot, &self.outputs, &self.settings);
        }
        self.report_unknown_attribute(&common);
        self.report_outputs_in_one_place(&shots[0].1);
        let panels =
            shots.iter().map(|(frame, shot)| self.panels(*frame, shot, &common)).collect::<Result<Vec<_>, _>>()?;
        let columns = if self.split && self.outputs.len() > 1 { 1 } else { columns(panels.len()) };
        let sheet = preview::contact_sheet(&panels, columns).map_err(drawing)?;
        save(&sheet, self.path("png"))
    }

    /// Draws the movie and writes it; `None` if it is stopped.
    fn write_movie(&self, film: &mut Film, stopped: &dyn Fn() -> bool) -> Result<Option<PathBuf>, Failure> {
        let frames = film.spool.frames();
        let mut draw = |frame: Frame| {
            let shot = film.spool.read(frame).map_err(unreadable)?;
            self.panels(frame, &shot, &film.common)
        };
        let mut image = draw(frames[0])?;
        let mut file = AtomicFile::create(self.path("apng")).map_err(|error| failed(&error))?;
        let movie = Movie::start(&mut file, image.width(), image.height(), frames.len());
        let mut movie = movie.map_err(drawing)?;
        for (index, frame) in frames.iter().enumerate() {
            if stopped() {
                return Ok(None);
            }
            if index > 0 {
                image = draw(*frame)?;
            }
            movie.frame(&image, self.shown(&frames, index)).map_err(drawing)?;
        }
        movie.finish().map_err(drawing)?;
        let path = file.path().to_owned();
        file.commit().map_err(|error| failed(&error))?;
        Ok(Some(path))
    }

    /// Seconds from a frame to the next; the last one is shown as long as the one before.
    fn shown(&self, frames: &[Frame], index: usize) -> f64 {
        let fps = self.staged.graph.scene.fps;
        let first = index.min(frames.len().saturating_sub(2));
        match frames.get(first + 1) {
            Some(next) => next.seconds(fps) - frames[first].seconds(fps),
            None => 1.0 / fps,
        }
    }

    /// A frame: one panel with all outputs, or a row with one each.
    fn panels(&self, frame: Frame, shot: &Shot, common: &Common) -> Result<Image, Failure> {
        if !self.split {
            return self.panel(frame, shot, &self.outputs, common);
        }
        let panels = self.outputs.iter().map(|output| self.panel(frame, shot, &[*output], common));
        preview::side_by_side(&panels.collect::<Result<Vec<_>, _>>()?).map_err(drawing)
    }

    fn panel(&self, frame: Frame, shot: &Shot, outputs: &[usize], common: &Common) -> Result<Image, Failure> {
        let guides = &self.staged.guides;
        let controls: Vec<Option<Geometry>> = outputs
            .iter()
            .map(|output| shot.get(output).filter(|geometry| guides::is_control(geometry)))
            .map(|control| control.and_then(|control| guides::lines_of(control)))
            .collect();
        let lattices = guides.lattices(&self.staged.graph, frame);
        // A single subject keeps the colours of its kind.
        let subjects = controls.iter().filter(|control| control.is_none()).count();
        let mut layers = Vec::new();
        for (index, (output, control)) in outputs.iter().zip(&controls).enumerate() {
            let Some(geometry) = shot.get(output) else { continue };
            let name: &str = &self.staged.graph.outputs[*output].name;
            let color = (subjects > 1).then(|| palette(index));
            layers.push(match control {
                Some(lines) => Layer { color: Some(palette(index).map(|x| x * LINE)), ..Layer::guide(name, lines) },
                None => Layer { color, ..Layer::new(name, geometry) },
            });
        }
        for (output, geometry) in guides.outputs().filter_map(|output| Some((output, shot.get(&output)?))) {
            if !guides::is_visible(geometry, &layers) {
                layers.push(Layer::guide(guides.name(output), geometry));
            }
        }
        layers.extend(lattices.as_ref().map(|lines| Layer::guide("lattice", lines)));
        self.fits(frame, shot, &layers)?;
        let settings = PictureSettings {
            camera: Some(self.settings.camera.unwrap_or_else(|| common.framing().camera())),
            bounds: common.framing().bounds(),
            range: common.range,
            note: Some(format!("frame {frame}")),
            wind: guides.wind(&self.staged.graph, frame),
            ..self.settings.clone()
        };
        render(&layers, &settings).map_err(drawing)
    }

    /// Refuses a picture that memory cannot hold besides what it shows.
    fn fits(&self, frame: Frame, shot: &Shot, layers: &[Layer<'_>]) -> Result<(), Failure> {
        let bytes = preview::memory(layers);
        let shown = shot.values().map(|geometry| geometry.bytes()).fold(0, usize::saturating_add);
        if self.ceiling.allows(bytes.saturating_add(shown)) {
            return Ok(());
        }
        let line = format!(
            "a picture of frame {frame} would take {} besides the {} that it shows, but {}; leave out --preview, name \
             smaller outputs with --output, or raise --memory",
            size_text(bytes),
            size_text(shown),
            self.ceiling.describe()
        );
        Err(Failure::file(line))
    }

    fn report_unknown_attribute(&self, common: &Common) {
        if let (Some(name), None) = (&self.settings.color_by, common.range) {
            let names: Vec<String> = common.attributes.iter().map(|name| format!("`{name}`")).collect();
            let available = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            crate::say!("note: no output has a numeric attribute `{name}` to colour by; available: {available}");
        }
    }

    /// In one panel, outputs that lie in the same place hide each other.
    fn report_outputs_in_one_place(&self, shot: &Shot) {
        if self.split {
            return;
        }
        let bounds = |output: &usize| preview::bounds(&[Layer::new("", shot.get(output)?)]);
        let all: Vec<_> = self.outputs.iter().filter_map(|output| Some((*output, bounds(output)?))).collect();
        let pairs = all.iter().enumerate().flat_map(|(index, a)| all[index + 1..].iter().map(move |b| (a, b)));
        if let Some((a, b)) = pairs.into_iter().find(|(a, b)| overlap(a.1, b.1) > SAME_PLACE) {
            let name = |output: usize| &self.staged.graph.outputs[output].name;
            let (a, b) = (name(a.0), name(b.0));
            crate::say!(
                "note: outputs `{a}` and `{b}` lie in the same place and hide each other in the picture; --preview-split \
                 draws each output in its own panel"
            );
        }
    }
}

impl Common {
    fn new(settings: &PictureSettings) -> Self {
        let framing = || Framing::new(settings.width, settings.height, settings.clip);
        Self { subjects: framing(), controls: framing(), range: None, attributes: Vec::new() }
    }

    /// What the camera frames.
    fn framing(&self) -> &Framing {
        if self.subjects.bounds().is_some() { &self.subjects } else { &self.controls }
    }

    fn add(&mut self, shot: &Shot, outputs: &[usize], settings: &PictureSettings) {
        let layer = |output: &usize| shot.get(output).map(|geometry| Layer::new("", geometry));
        let layers = outputs.iter().filter_map(layer);
        let (controls, subjects): (Vec<_>, Vec<_>) = layers.partition(|layer| guides::is_control(layer.geometry));
        self.controls.add(&controls);
        self.subjects.add(&subjects);
        let Some(name) = &settings.color_by else { return };
        if let Some([low, high]) = attribute_range(&subjects, name) {
            self.range = Some(self.range.map_or([low, high], |range| [range[0].min(low), range[1].max(high)]));
        }
        for name in attribute_names(&subjects) {
            if !self.attributes.iter().any(|known| known == name) {
                self.attributes.push(name.to_owned());
            }
        }
        self.attributes.sort_unstable();
    }
}

/// Columns of a sheet whose rows are all full.
fn columns(panels: usize) -> usize {
    match panels {
        4 => 2,
        6 => 3,
        few => few.max(1),
    }
}

/// Volume that two boxes share, as a fraction of that of the box around both; flat boxes count as a little thick.
fn overlap(a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> f64 {
    let side = |low: f32, high: f32| f64::from(high) - f64::from(low);
    let sides = |k: usize| {
        let (shared, around) =
            (side(a[0][k].max(b[0][k]), a[1][k].min(b[1][k])), side(a[0][k].min(b[0][k]), a[1][k].max(b[1][k])));
        if around > 0.0 { shared.max(0.0) / around } else { 1.0 }
    };
    sides(0) * sides(1) * sides(2)
}

fn drawing(error: preview::PreviewError) -> Failure {
    match error {
        preview::PreviewError::Write(_) => Failure::file(error.to_string()),
        _ => Failure::new(Exit::CommandLine, format!("the picture could not be drawn: {error}")),
    }
}

fn unreadable(error: std::io::Error) -> Failure {
    Failure::file(format!("the frames of pictures could not be read back: {error}"))
}

fn save(image: &Image, path: PathBuf) -> Result<PathBuf, Failure> {
    let mut bytes = Vec::new();
    image.write_png(&mut bytes).map_err(drawing)?;
    write_whole(&path, &bytes)?;
    Ok(path)
}
