//! Files of outputs: one USD file with all frames, or one file per frame.

use std::fs;
use std::io::{Seek as _, Write as _};
use std::path::{Path, PathBuf};

use engine::cook::Delivered;
use engine::frames::FrameSet;
use engine::graph::Graph;
use engine::time::Frame;
use formats::atomic::{AtomicFile, FileError};
use formats::usd::{Flavour, UsdError, UsdWriter, lacks_width};
use formats::{Format, FormatError, FrameStamp};
use numerics::parallel;

use crate::failure::{Exit, Failure};
use crate::targets::Targets;

/// What was written for one output.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// Files, in the order of frames.
    pub files: Vec<PathBuf>,
    /// Their size in bytes.
    pub bytes: u64,
    /// Frames in them.
    pub frames: Vec<Frame>,
    /// What the format dropped.
    pub lost: Vec<String>,
    /// Frames whose curves have no widths, so that the file got a width for them.
    pub without_width: Vec<Frame>,
}

enum Target {
    /// All frames in one file. Open from the first frame on.
    Sequence { flavour: Flavour, writer: Option<Box<UsdWriter>> },
    /// One file per frame.
    PerFrame,
    /// No file: frames are only counted.
    Nothing,
}

/// The files of all outputs of a cook.
pub struct Writers<'g> {
    graph: &'g Graph,
    folder: PathBuf,
    format: Format,
    outputs: Vec<(usize, Target, Written)>,
}

impl<'g> Writers<'g> {
    /// Writers that only count the frames of `outputs`.
    pub fn none(graph: &'g Graph, outputs: &[usize], format: Format) -> Self {
        let outputs = outputs.iter().map(|output| (*output, Target::Nothing, Written::default())).collect();
        Self { graph, folder: PathBuf::new(), format, outputs }
    }

    /// Writers for `outputs` into `folder`, which is created if it is missing.
    ///
    /// # Errors
    /// If the folder cannot be created or written to.
    pub fn new(graph: &'g Graph, outputs: &[usize], folder: &Path, format: Format) -> Result<Self, Failure> {
        create_folder(folder)?;
        let target = || match format {
            Format::Usdc => Target::Sequence { flavour: Flavour::Usdc, writer: None },
            Format::Usda => Target::Sequence { flavour: Flavour::Usda, writer: None },
            Format::Obj | Format::Ply | Format::Json => Target::PerFrame,
        };
        let outputs = outputs.iter().map(|output| (*output, target(), Written::default())).collect();
        Ok(Self { graph, folder: folder.to_owned(), format, outputs })
    }

    /// Writes finished frames.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn take(&mut self, finished: &[Delivered]) -> Result<(), Failure> {
        let (graph, folder, format) = (self.graph, &self.folder, self.format);
        for (output, target, written) in &mut self.outputs {
            let mine: Vec<&Delivered> = finished.iter().filter(|one| one.output == *output).collect();
            let name = &graph.outputs[*output].name;
            if let Target::Nothing = target {
                written.frames.extend(mine.iter().map(|one| one.frame));
                continue;
            }
            for lost in mine.iter().flat_map(|one| formats::lost(format, &one.geometry)) {
                if !written.lost.contains(&lost) {
                    written.lost.push(lost);
                }
            }
            match target {
                Target::Sequence { flavour, writer } => {
                    for one in mine {
                        if lacks_width(&one.geometry) {
                            written.without_width.push(one.frame);
                        }
                        if writer.is_none() {
                            let path = sequence_path(folder, name, format);
                            let scene = &graph.scene;
                            let new = UsdWriter::create(path, *flavour, name, scene.fps, scene.origin);
                            *writer = Some(Box::new(new.map_err(usd_failed)?));
                        }
                        let Some(writer) = writer else { continue };
                        writer.frame(one.frame.number(), &one.geometry).map_err(usd_failed)?;
                        written.frames.push(one.frame);
                    }
                }
                Target::Nothing => {}
                Target::PerFrame => {
                    let files = parallel::map(&mine, |_, one| write_frame(graph, folder, format, one));
                    for (file, one) in files.into_iter().zip(mine) {
                        let (path, bytes) = file?;
                        written.files.push(path);
                        written.bytes += bytes;
                        written.frames.push(one.frame);
                    }
                }
            }
        }
        Ok(())
    }

    /// Finishes files with all frames, except those of outputs in `incomplete`: a file with missing frames could be
    /// mistaken for a complete one. Those in `sampled` get time samples of every attribute. Returns what was written, by
    /// index of the output.
    ///
    /// # Errors
    /// If a file cannot be finished.
    pub fn finish(self, incomplete: &[usize], sampled: &[usize]) -> Result<Vec<(usize, Written)>, Failure> {
        let mut all = Vec::new();
        for (output, target, mut written) in self.outputs {
            if let Target::Sequence { writer: Some(mut writer), .. } = target {
                if incomplete.contains(&output) {
                    written.frames.clear();
                } else {
                    if sampled.contains(&output) {
                        writer.sample_all();
                    }
                    let name = &self.graph.outputs[output].name;
                    let summary = writer.finish().map_err(usd_failed)?;
                    written.files.push(sequence_path(&self.folder, name, self.format));
                    written.bytes = summary.bytes;
                }
            }
            all.push((output, written));
        }
        Ok(all)
    }
}

/// Adds the files of `outputs` to what a command writes.
pub fn add_targets(
    targets: &mut Targets,
    graph: &Graph,
    outputs: &[usize],
    folder: &Path,
    format: Format,
    frames: &FrameSet,
) {
    for name in outputs.iter().map(|output| &graph.outputs[*output].name) {
        match format.is_sequence() {
            true => targets.writes("--out", Exit::File, &sequence_path(folder, name, format)),
            false => targets.writes_frames("--out", folder, name, format.name(), frames),
        }
    }
}

fn sequence_path(folder: &Path, name: &str, format: Format) -> PathBuf {
    folder.join(format!("{name}.{format}"))
}

fn frame_path(folder: &Path, name: &str, frame: Frame, format: Format) -> PathBuf {
    folder.join(format!("{name}.{}.{format}", frame.file_label()))
}

fn write_frame(graph: &Graph, folder: &Path, format: Format, one: &Delivered) -> Result<(PathBuf, u64), Failure> {
    let name = &graph.outputs[one.output].name;
    let path = frame_path(folder, name, one.frame, format);
    let stamp = FrameStamp { frame: one.frame.number(), seconds: one.frame.seconds(graph.scene.fps) };
    // Not by way of a buffer: a frame as text is several times as large as in memory.
    let mut file = AtomicFile::create(&path).map_err(|error| failed(&error))?;
    formats::write(format, &one.geometry, &stamp, &mut file).map_err(|error| match error {
        FormatError::Io(error) => failed(&file.failed(error)),
        error => Failure::file(format!("`{}` could not be written: {error}", path.display())),
    })?;
    let bytes = file.stream_position().map_err(|error| failed(&file.failed(error)))?;
    file.commit().map_err(|error| failed(&error))?;
    Ok((path, bytes))
}

/// Creates a folder and those above it, where they are missing.
///
/// # Errors
/// If it cannot be created.
pub fn create_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| failed(&FileError::new(folder, "created", error)))
}

/// Writes a whole file atomically.
///
/// # Errors
/// If the file cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    fill(AtomicFile::create(path).map_err(|error| failed(&error))?, bytes)
}

/// Writes the bytes of a file and renames it to its final name.
///
/// # Errors
/// If it cannot be written.
pub fn fill(mut file: AtomicFile, bytes: &[u8]) -> Result<(), Failure> {
    file.write_all(bytes).map_err(|error| failed(&file.failed(error)))?;
    file.commit().map_err(|error| failed(&error))
}

/// The failure of a file, with its hint.
pub fn failed(error: &FileError) -> Failure {
    match error.hint() {
        Some(hint) => Failure::file(format!("{error}; {hint}")),
        None => Failure::file(error.to_string()),
    }
}

/// The failure of a USD file, with a hint for errors of the file system.
pub fn usd_failed(error: UsdError) -> Failure {
    match error {
        UsdError::File(error) => failed(&error),
        refused => Failure::file(refused.to_string()),
    }
}
