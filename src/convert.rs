//! `convect convert`: converts a geometry file or a numbered sequence to another format.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use engine::geometry::Geometry;
use engine::time::Frame;
use formats::usd::{DEFAULT_WIDTH, Flavour, UsdWriter, lacks_width};
use formats::{Format, FormatError, FrameStamp};
use numerics::parallel;

use crate::failure::{Exit, Failure, cancelled_by_signal};
use crate::geometry_file::{Numbered, folder_of, read, refused, sequence_in, stem_and_frame};
use crate::output::{create_folder, usd_failed, write_whole};
use crate::targets::Targets;
use crate::usd_file::{UsdFile, is_usd};

/// The arguments of `convert`.
#[derive(Debug, clap::Args)]
pub struct ConvertArgs {
    /// An obj, ply, json or USD file, a numbered sequence: fur.####.json, or a folder that holds one sequence. A USD file
    /// has a frame for each time at which it has samples
    from: PathBuf,
    /// The file to write; its extension selects the format. A sequence becomes one usdc or usda file, or one file per
    /// frame: fur.####.ply. Its folder is created if it is missing
    to: PathBuf,
    /// Factor for lengths and velocities, such as 0.01 for a file in centimetres
    #[arg(long, value_name = "S", default_value_t = 1.0, hide_default_value = true, value_parser = positive)]
    scale: f64,
    /// Frames per second, for the time in usdc, usda and json files [default: 24, or the USD file's own]
    #[arg(long, value_name = "N", value_parser = positive)]
    fps: Option<f64>,
    /// The prim of a USD file that is converted, with all under it: /set/fur
    #[arg(long, value_name = "PATH")]
    prim: Option<String>,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| format!("`{text}` is not a number above 0"))
}

/// Converts geometry files.
///
/// # Errors
/// If a file cannot be read or written, or the format cannot hold its geometry.
pub fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let command_line = |line: String| Failure::new(Exit::CommandLine, line);
    let format =
        Format::of_path(&args.to).map_err(|error| command_line(format!("`{}`: {error}", args.to.display())))?;
    let stage = match is_usd(&args.from) && Numbered::of(&args.from)?.is_none() {
        true => Some(UsdFile::open(&args.from, args.prim.as_deref().unwrap_or_default())?),
        false if args.prim.is_some() => return Err(command_line("only a USD file has prims".into())),
        false => None,
    };
    let files = match Numbered::of(&args.from)? {
        _ if stage.is_some() => moments(stage.as_ref(), &args.from)?,
        Some(numbered) => numbered.find()?,
        None if args.from.is_dir() => sequence_in(&args.from)?,
        None => vec![(stem_and_frame(&args.from).1.unwrap_or(Frame::whole(1)), args.from.clone())],
    };
    let to = Numbered::of(&args.to)?;
    if to.is_none() && !format.is_sequence() && files.len() > 1 {
        let (stem, ending) = (stem_and_frame(&args.to).0, format.name());
        let line = format!("cannot convert {} files to one {format} file; write {stem}.####.{ending}", files.len());
        return Err(command_line(line));
    }
    let cancel = cancelled_by_signal();
    let targets = targets(&args.to, &files, to.as_ref());
    targets.check()?;
    targets.sweep();
    create_folder(folder_of(&args.to))?;
    let fps = match (args.fps, &stage) {
        (Some(fps), _) => fps,
        (None, Some(stage)) => stage.fps()?,
        (None, None) => 24.0,
    };
    let members = stage.as_ref().filter(|_| format.is_sequence()).map_or_else(|| Ok(Vec::new()), UsdFile::members)?;
    let conversion = Conversion { format, scale: args.scale, fps, cancel, stage, members, left_out: Mutex::default() };
    let written = match &to {
        Some(to) => conversion.file_per_frame(&files, |frame| to.at(frame), to.stem())?,
        None if format.is_sequence() => conversion.one_file(&files, &args.to, &stem_and_frame(&args.to).0)?,
        None => conversion.file_per_frame(&files, |_| args.to.clone(), "")?,
    };
    if !args.quiet {
        print_summary(&written);
        let left_out = conversion.left_out.into_inner().unwrap_or_else(PoisonError::into_inner);
        left_out.iter().for_each(|note| crate::say!("note: {note}"));
    }
    Ok(())
}

/// The frames of a USD file: its times, or 1 if nothing moves.
fn moments(stage: Option<&UsdFile>, path: &Path) -> Result<Vec<(Frame, PathBuf)>, Failure> {
    let times = stage.map_or(&[][..], |stage| &stage.times);
    let frame = |time: &f64| {
        let frame = Frame::exactly(*time).map(|frame| (frame, path.to_owned()));
        frame.map_err(|error| {
            Failure::file(format!("`{}`: it has a sample at {time}, which is no frame: {error}", path.display()))
        })
    };
    if times.is_empty() { Ok(vec![(Frame::whole(1), path.to_owned())]) } else { times.iter().map(frame).collect() }
}

/// Everything that the conversion reads and writes.
fn targets(path: &Path, files: &[(Frame, PathBuf)], to: Option<&Numbered>) -> Targets {
    let mut targets = Targets::default();
    for (frame, from) in files {
        targets.reads(from, "it is to be converted");
        if let Some(to) = to {
            targets.writes("target", Exit::CommandLine, &to.at(*frame));
        }
    }
    if to.is_none() {
        targets.writes("target", Exit::CommandLine, path);
    }
    targets
}

/// Prints what was written to stderr.
fn print_summary(written: &Written) {
    let files = match written.files.as_slice() {
        [] => return,
        [one] => one.display().to_string(),
        [first, .., last] => format!("{} … {} ({} files)", first.display(), last.display(), written.files.len()),
    };
    let s = if written.frames == 1 { "" } else { "s" };
    crate::say!("wrote {files}: {} frame{s}, {}", written.frames, indicatif::HumanBytes(written.bytes));
    if !written.lost.is_empty() {
        crate::say!("note: written without {}, which the format cannot hold", written.lost.join(", "));
    }
    if written.without_width {
        crate::say!("note: there are curves without `width`, so the file got {DEFAULT_WIDTH} m for them");
    }
}

/// What a conversion wrote.
#[derive(Default)]
struct Written {
    files: Vec<PathBuf>,
    frames: usize,
    bytes: u64,
    /// What the format dropped.
    lost: Vec<String>,
    /// Whether curves without widths got one in the file.
    without_width: bool,
}

struct Conversion {
    format: Format,
    scale: f64,
    fps: f64,
    /// Set by Ctrl-C.
    cancel: Arc<AtomicBool>,
    /// The USD file that is converted.
    stage: Option<UsdFile>,
    /// Its outputs, by name and path, if it has several and is converted to USD.
    members: Vec<(String, String)>,
    /// What of it was left out.
    left_out: Mutex<BTreeSet<String>>,
}

impl Conversion {
    /// Writes all frames to one file. Several are read in parallel and written in order.
    fn one_file(&self, files: &[(Frame, PathBuf)], to: &Path, name: &str) -> Result<Written, Failure> {
        let flavour = if self.format == Format::Usda { Flavour::Usda } else { Flavour::Usdc };
        let members: Vec<&str> = self.members.iter().map(|(name, _)| &**name).collect();
        let mut writer =
            UsdWriter::create_set(to, flavour, (name, &members), self.fps, [0.0; 3]).map_err(usd_failed)?;
        let mut without_width = false;
        for some in files.chunks(rayon::current_num_threads()) {
            let read = parallel::map(some, |_, (frame, path)| self.read_all(*frame, path));
            for (geometries, (frame, _)) in read.into_iter().zip(some) {
                let geometries = geometries?;
                without_width |= geometries.iter().any(lacks_width);
                let geometries: Vec<&Geometry> = geometries.iter().collect();
                writer.frames(frame.number(), &geometries).map_err(usd_failed)?;
            }
        }
        let bytes = writer.finish().map_err(usd_failed)?.bytes;
        Ok(Written { files: vec![to.to_owned()], frames: files.len(), bytes, lost: Vec::new(), without_width })
    }

    /// Writes one file per frame, at the path given by `to`.
    fn file_per_frame(
        &self,
        files: &[(Frame, PathBuf)],
        to: impl Fn(Frame) -> PathBuf + Sync,
        name: &str,
    ) -> Result<Written, Failure> {
        let convert = |from: &(Frame, PathBuf)| {
            let to = to(from.0);
            match self.format.is_sequence() {
                true => self.one_file(std::slice::from_ref(from), &to, name),
                false => self.one_frame(from, to),
            }
        };
        let converted = parallel::map(files, |_, from| convert(from));
        converted.into_iter().try_fold(Written::default(), |mut all, one| {
            let one = one?;
            all.files.extend(one.files);
            all.frames += one.frames;
            all.bytes += one.bytes;
            all.without_width |= one.without_width;
            let new = one.lost.into_iter().filter(|lost| !all.lost.contains(lost)).collect::<Vec<_>>();
            all.lost.extend(new);
            Ok(all)
        })
    }

    fn one_frame(&self, (frame, from): &(Frame, PathBuf), to: PathBuf) -> Result<Written, Failure> {
        let geometry = self.read(*frame, from, None)?;
        let stamp = FrameStamp { frame: frame.number(), seconds: frame.seconds(self.fps) };
        let mut bytes = Vec::new();
        formats::write(self.format, &geometry, &stamp, &mut bytes).map_err(|error| refused(&to, &error))?;
        let lost = formats::lost(self.format, &geometry);
        write_whole(&to, &bytes)?;
        Ok(Written { files: vec![to], frames: 1, bytes: bytes.len() as u64, lost, without_width: false })
    }

    /// The geometries of a frame: one, or that of each output of a USD file with several.
    fn read_all(&self, frame: Frame, path: &Path) -> Result<Vec<Geometry>, Failure> {
        match &self.members[..] {
            [] => Ok(vec![self.read(frame, path, None)?]),
            members => members.iter().map(|(_, prim)| self.read(frame, path, Some(prim))).collect(),
        }
    }

    /// Reads a file, or a frame of a USD file or of a prim in it, and scales it; fails after Ctrl-C.
    fn read(&self, frame: Frame, path: &Path, prim: Option<&str>) -> Result<Geometry, Failure> {
        if self.cancel.load(Ordering::Relaxed) {
            return Err(Failure::new(Exit::Interrupted, "interrupted; the files written so far are complete"));
        }
        let (mut geometry, notes) = match (&self.stage, prim) {
            (Some(stage), Some(prim)) => {
                stage.read_prim(prim, frame.number()).map(|reading| (reading.geometry, reading.notes))?
            }
            (Some(stage), None) => stage.read(frame.number()).map(|reading| (reading.geometry, reading.notes))?,
            (None, _) => read(path).map(|file| (file.geometry, file.notes))?,
        };
        self.left_out.lock().unwrap_or_else(PoisonError::into_inner).extend(notes);
        if let Some(kind) = geometry.kinds().find(|kind| !self.format.holds(*kind)) {
            return Err(refused(path, &FormatError::CannotHold { format: self.format, kind }));
        }
        geometry.scale_lengths(self.scale);
        let overflowing = geometry.parts().find_map(|part| {
            let found = part.columns().find(|(.., column)| column.first_not_finite().is_some());
            found.map(|(_, name, _)| format!("`{name}` of {}", part.kind()))
        });
        match overflowing {
            Some(what) => {
                let fact = format!("{what} scaled by {:?} is out of the range of f32", self.scale);
                Err(Failure::file(format!("`{}`: {fact}", path.display())))
            }
            None => Ok(geometry),
        }
    }
}
