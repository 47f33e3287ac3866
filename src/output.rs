//! Files of outputs: one USD file with all frames, or one file per frame.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Seek as _, Write as _};
use std::path::{Path, PathBuf};

use engine::cook::Delivered;
use engine::frames::FrameSet;
use engine::geometry::Geometry;
use engine::graph::Graph;
use engine::note::FrameRanges;
use engine::time::Frame;
use formats::atomic::{AtomicFile, FileError};
use formats::usd::{Flavour, UsdError, UsdWriter, lacks_width};
use formats::{Format, FormatError, FrameStamp};
use numerics::parallel;

use crate::failure::{Exit, Failure};
use crate::targets::Targets;

/// What was written for one output, or for several that share a file.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// The outputs, by index.
    pub outputs: Vec<usize>,
    /// Files, in the order of frames.
    pub files: Vec<PathBuf>,
    /// Their size in bytes.
    pub bytes: u64,
    /// Frames in them.
    pub frames: Vec<Frame>,
    /// What the format dropped.
    pub lost: Vec<String>,
    /// By output the frames whose curves have no widths, so that the file got a width for them.
    pub without_width: BTreeMap<usize, Vec<Frame>>,
}

impl Written {
    /// The name of the outputs' file.
    pub fn name<'g>(&self, graph: &'g Graph) -> &'g str {
        self.outputs.first().map_or("", |output| graph.outputs[*output].file())
    }

    /// Forgets what would be in a file that is not written.
    fn forget(&mut self) {
        self.frames.clear();
        self.lost.clear();
        self.without_width.clear();
    }
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
    files: Vec<(Target, Written)>,
}

impl<'g> Writers<'g> {
    /// Writers that only count the frames of `outputs`.
    pub fn none(graph: &'g Graph, outputs: &[usize], format: Format) -> Self {
        let files = by_file(graph, outputs).into_iter();
        let files = files.map(|outputs| (Target::Nothing, Written { outputs, ..Written::default() })).collect();
        Self { graph, folder: PathBuf::new(), format, files }
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
        let files = by_file(graph, outputs).into_iter();
        let files = files.map(|outputs| (target(), Written { outputs, ..Written::default() })).collect();
        Ok(Self { graph, folder: folder.to_owned(), format, files })
    }

    /// Writes finished frames: of outputs that share a file all at once, in the order of the graph's outputs.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn take(&mut self, finished: &[Delivered]) -> Result<(), Failure> {
        let (graph, folder, format) = (self.graph, &self.folder, self.format);
        for (target, written) in &mut self.files {
            let outputs = &written.outputs;
            let mine: Vec<&Delivered> =
                finished.iter().filter(|one| outputs.binary_search(&one.output).is_ok()).collect();
            // A frame that one of the outputs lacks is not written: the file will not be, either.
            let whole = mine.chunk_by(|a, b| a.frame == b.frame).filter(|frame| frame.len() == outputs.len());
            if let Target::Nothing = target {
                written.frames.extend(whole.map(|frame| frame[0].frame));
                continue;
            }
            for lost in mine.iter().flat_map(|one| formats::lost(format, &one.geometry)) {
                if !written.lost.contains(&lost) {
                    written.lost.push(lost);
                }
            }
            match target {
                Target::Sequence { flavour, writer } => {
                    for frame in whole {
                        let at = frame[0].frame;
                        for one in frame.iter().filter(|one| lacks_width(&one.geometry)) {
                            written.without_width.entry(one.output).or_default().push(at);
                        }
                        let writer = match writer {
                            Some(writer) => writer,
                            None => writer.insert(Box::new(sequence(graph, outputs, *flavour, folder, format)?)),
                        };
                        let geometries: Vec<&Geometry> = frame.iter().map(|one| &*one.geometry).collect();
                        writer.frames(at.number(), &geometries).map_err(usd_failed)?;
                        written.frames.push(at);
                    }
                }
                Target::Nothing => {}
                Target::PerFrame => {
                    let files = parallel::map(&mine, |_, one| write_frame(graph, folder, format, one));
                    let mut failed = Ok(());
                    for (file, one) in files.into_iter().zip(mine) {
                        match file {
                            Ok((path, bytes)) => {
                                written.files.push(path);
                                written.bytes += bytes;
                                written.frames.push(one.frame);
                            }
                            Err(failure) => failed = failed.and(Err(failure)),
                        }
                    }
                    failed?;
                }
            }
        }
        Ok(())
    }

    /// Finishes files with all frames, except those of outputs in `incomplete`: a file with missing frames could be
    /// mistaken for a complete one. Those in `sampled` get time samples of every attribute. Returns what was written, and
    /// why other files could not be finished.
    pub fn finish(self, incomplete: &[usize], sampled: &[usize]) -> (Vec<Written>, Option<Failure>) {
        let (mut all, mut failed): (Vec<Written>, Option<Failure>) = (Vec::new(), None);
        for (target, mut written) in self.files {
            if let Target::Sequence { writer: Some(mut writer), .. } = target {
                let are_of = |some: &[usize]| written.outputs.iter().any(|output| some.contains(output));
                if are_of(incomplete) {
                    written.forget();
                } else {
                    if are_of(sampled) {
                        writer.sample_all();
                    }
                    match writer.finish().map_err(usd_failed) {
                        Ok(summary) => {
                            written.files.push(sequence_path(&self.folder, written.name(self.graph), self.format));
                            written.bytes = summary.bytes;
                        }
                        Err(failure) => {
                            written.forget();
                            failed.get_or_insert(Failure { lines: Vec::new(), ..failure }).lines.extend(failure.lines);
                        }
                    }
                }
            }
            all.push(written);
        }
        (all, failed)
    }

    /// For each file what there is of it after writing has failed, a line each.
    pub fn after_failure(&self) -> Vec<String> {
        let line = |(target, written): &(Target, Written)| {
            let name = written.name(self.graph);
            match target {
                Target::Nothing => None,
                Target::PerFrame if !written.files.is_empty() => {
                    let s = if written.frames.len() == 1 { "" } else { "s" };
                    Some(format!("output `{name}` was written at frame{s} {} only", FrameRanges(&written.frames)))
                }
                _ => Some(format!("output `{name}` was not written")),
            }
        };
        self.files.iter().filter_map(line).collect()
    }
}

/// Outputs, those in one file together.
pub fn by_file(graph: &Graph, outputs: &[usize]) -> Vec<Vec<usize>> {
    let file = |output: &usize| graph.outputs[*output].file();
    outputs.chunk_by(|a, b| file(a) == file(b)).map(<[usize]>::to_vec).collect()
}

/// Starts the USD file of outputs.
fn sequence(
    graph: &Graph,
    outputs: &[usize],
    flavour: Flavour,
    folder: &Path,
    format: Format,
) -> Result<UsdWriter, Failure> {
    let prims: Vec<&str> = outputs.iter().filter_map(|output| graph.outputs[*output].prim()).collect();
    let name = outputs.first().map_or("", |output| graph.outputs[*output].file());
    let path = sequence_path(folder, name, format);
    UsdWriter::create_set(path, flavour, (name, &prims), graph.scene.fps, graph.scene.origin).map_err(usd_failed)
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
    for name in by_file(graph, outputs).iter().map(|outputs| graph.outputs[outputs[0]].file()) {
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
