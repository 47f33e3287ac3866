//! `convect merge`: joins the parts of a job into whole outputs.
//!
//! A part is a folder `DIR/parts/A-B` with the files of its outputs and a report (any `report*.json`). That a file is there
//! proves nothing, because an interrupted part has a valid file of fewer frames: the reports say which frames it has, and
//! every frame must be in exactly one part.

mod notes;
mod reports;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use engine::geometry::Geometry;
use engine::time::Frame;
use formats::FormatError;
use formats::usd::{ClipPiece, Flavour, UsdReading, UsdWriter};

use crate::args::PartRange;
use crate::failure::{Exit, Failure, cancelled_by_signal};
use crate::output::{create_folder, usd_failed, write_whole};
use crate::targets::Targets;
use crate::usd_file::{UsdFile, is_usd};
use reports::merged;

/// The arguments of `merge`.
#[derive(Debug, clap::Args)]
pub struct MergeArgs {
    /// The folder of a job: its parts are in FOLDER/parts
    folder: PathBuf,
    /// Merge only this output; repeatable
    #[arg(long = "output", value_name = "NAME")]
    outputs: Vec<String>,
    /// The frames that must be present [default: from the first to the last frame of the parts]
    #[arg(long, value_name = "A-B", allow_hyphen_values = true)]
    frames: Option<PartRange>,
    /// Write one usdc file for each output, instead of a stage that reads the parts as value clips
    #[arg(long)]
    one_file: bool,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
}

/// An output in one part.
#[derive(Clone, Debug)]
struct Piece {
    frames: Vec<Frame>,
    files: Vec<PathBuf>,
}

/// Merges the parts of a job.
///
/// # Errors
/// If frames are missing or in two parts, parts do not fit together, or a file cannot be read or written.
pub fn run(args: &MergeArgs) -> Result<(), Failure> {
    let cancel = cancelled_by_signal();
    let reports = reports::of(&args.folder.join("parts"))?;
    reports::are_of_one_recipe(&reports)?;
    let mut outputs: BTreeMap<String, Vec<Piece>> = BTreeMap::new();
    for report in &reports {
        for (name, piece) in report.pieces()? {
            outputs.entry(name).or_default().push(piece);
        }
    }
    if let Some(missing) = args.outputs.iter().find(|name| !outputs.contains_key(*name)) {
        let there: Vec<&str> = outputs.keys().map(String::as_str).collect();
        let line = format!("no part has an output `{missing}`; outputs: `{}`", there.join("`, `"));
        return Err(Failure::new(Exit::CommandLine, line));
    }
    if !args.outputs.is_empty() {
        outputs.retain(|name, _| args.outputs.contains(name));
    }
    for (name, pieces) in &mut outputs {
        pieces.sort_by_key(|piece| piece.frames.first().copied());
        complete(name, pieces, args.frames)?;
    }
    let mut lines = Vec::new();
    for (name, pieces) in &outputs {
        if cancel.load(std::sync::atomic::Ordering::Relaxed) {
            return Err(Failure::new(Exit::Interrupted, "interrupted; the outputs merged so far are complete"));
        }
        lines.push(merge(args, name, pieces)?);
    }
    let text = serde_json::to_string_pretty(&merged(&reports)).unwrap_or_default() + "\n";
    write_whole(&args.folder.join("report.json"), text.as_bytes())?;
    if !args.quiet {
        lines.iter().for_each(|line| crate::say!("{line}"));
    }
    Ok(())
}

/// Refuses pieces that lack frames, or have one twice.
fn complete(name: &str, pieces: &[Piece], wanted: Option<PartRange>) -> Result<(), Failure> {
    let mut there: Vec<Frame> = pieces.iter().flat_map(|piece| piece.frames.iter().copied()).collect();
    there.sort_unstable();
    if let Some(pair) = there.windows(2).find(|pair| pair[0] == pair[1]) {
        let line = format!("output `{name}`: frame {} is in two parts; remove one of them", pair[0]);
        return Err(Failure::new(Exit::File, line));
    }
    let (Some(first), Some(last)) = (there.first(), there.last()) else {
        return Err(Failure::new(Exit::File, format!("output `{name}` has no frame")));
    };
    let wanted = match wanted {
        Some(range) => range.frames(),
        None => engine::frames::FrameSet::whole(first.number().ceil() as i64, last.number().floor() as i64),
    };
    let missing: Vec<Frame> = wanted.iter().filter(|frame| there.binary_search(frame).is_err()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let line = format!("output `{name}` lacks {}; cook the parts that have them again", listed(&missing));
    Err(Failure::new(Exit::File, line))
}

/// `frames 9-16, 20`.
fn listed(frames: &[Frame]) -> String {
    let mut runs: Vec<[Frame; 2]> = Vec::new();
    for frame in frames {
        match runs.last_mut() {
            Some([_, last]) if frame.number() - last.number() == 1.0 => *last = *frame,
            _ => runs.push([*frame; 2]),
        }
    }
    let run = |[first, last]: &[Frame; 2]| if first == last { first.to_string() } else { format!("{first}-{last}") };
    let s = if frames.len() == 1 { "" } else { "s" };
    format!("frame{s} {}", runs.iter().map(run).collect::<Vec<String>>().join(", "))
}

/// Merges one output and says what was written.
fn merge(args: &MergeArgs, name: &str, pieces: &[Piece]) -> Result<String, Failure> {
    let frames: usize = pieces.iter().map(|piece| piece.frames.len()).sum();
    let [s, of_parts] = [frames, pieces.len()].map(|count| if count == 1 { "" } else { "s" });
    let is_stage = pieces.iter().all(|piece| matches!(&piece.files[..], [file] if is_usd(file)));
    let path = match (is_stage, args.one_file) {
        (true, true) => one_file(&args.folder, name, pieces)?,
        (true, false) => clips(&args.folder, name, pieces)?,
        (false, _) => sequence(&args.folder, name, pieces)?,
    };
    Ok(format!("wrote {}: {frames} frame{s} of {} part{of_parts}", path.display(), pieces.len()))
}

fn opened(pieces: &[Piece]) -> Result<Vec<UsdFile>, Failure> {
    let stages =
        pieces.iter().map(|piece| UsdFile::open(&piece.files[0], "")).collect::<Result<Vec<UsdFile>, Failure>>()?;
    for (stage, piece) in stages.iter().zip(pieces).skip(1) {
        stages[0].stage().matches(stage.stage()).map_err(|error| {
            let hint = error.hint().map(|hint| format!("; {hint}")).unwrap_or_default();
            let (a, b) = (pieces[0].files[0].display(), piece.files[0].display());
            Failure::file(format!("`{a}` and `{b}` do not fit together: {error}{hint}"))
        })?;
    }
    Ok(stages)
}

/// All frames in one file, as a cook of all of them writes it.
fn one_file(folder: &Path, name: &str, pieces: &[Piece]) -> Result<PathBuf, Failure> {
    let stages = opened(pieces)?;
    let path = folder.join(format!("{name}.usdc"));
    let fps = stages[0].fps()?;
    let origin = stages[0].stage().origin().map_err(|error| stages[0].refused(&error))?;
    let members = stages[0].stage().members().map_err(|error| stages[0].refused(&error))?;
    let named: Vec<&str> = members.iter().map(|name| &**name).collect();
    let set = (name, &named[..]);
    let mut writer = UsdWriter::create_set(&path, Flavour::Usdc, set, fps, origin).map_err(usd_failed)?;
    let places: Vec<Option<usize>> =
        if members.is_empty() { vec![None] } else { (0..members.len()).map(Some).collect() };
    for (stage, piece) in stages.iter().zip(pieces) {
        for frame in &piece.frames {
            let read = |place: &Option<usize>| stage.stage().read_member(*place, frame.number());
            let read = places.iter().map(read).collect::<Result<Vec<UsdReading>, FormatError>>();
            let read = read.map_err(|error| stage.refused(&error))?;
            let geometries: Vec<&Geometry> = read.iter().map(|one| &one.geometry).collect();
            writer.frames(frame.number(), &geometries).map_err(usd_failed)?;
        }
    }
    writer.finish().map_err(usd_failed)?;
    Ok(path)
}

/// A stage that reads the parts where they are.
fn clips(folder: &Path, name: &str, pieces: &[Piece]) -> Result<PathBuf, Failure> {
    let stages = opened(pieces)?;
    let file = |path: &Path| {
        let relative = path.strip_prefix(folder).unwrap_or(path);
        format!("./{}", relative.display())
    };
    let clips: Vec<ClipPiece> = pieces
        .iter()
        .map(|piece| ClipPiece {
            file: file(&piece.files[0]),
            start: piece.frames.first().map_or(0.0, |frame| frame.number()),
        })
        .collect();
    let last = pieces.iter().filter_map(|piece| piece.frames.last()).max().map_or(0.0, |frame| frame.number());
    let manifest = format!("{name}.manifest.usda");
    let text = stages[0].stage().clip_stage(&clips, last, &format!("./{manifest}"));
    let [stage, declared] = text.map_err(|error| stages[0].refused(&error))?;
    write_whole(&folder.join(manifest), declared.as_bytes())?;
    let path = folder.join(format!("{name}.usda"));
    write_whole(&path, stage.as_bytes())?;
    Ok(path)
}

/// Files of frames, copied beside each other.
fn sequence(folder: &Path, name: &str, pieces: &[Piece]) -> Result<PathBuf, Failure> {
    create_folder(folder)?;
    let mut targets = Targets::default();
    let mut copies = Vec::new();
    for path in pieces.iter().flat_map(|piece| &piece.files) {
        let to = folder.join(path.file_name().unwrap_or_default());
        targets.reads(path, "it is a part");
        targets.writes("merged file", Exit::File, &to);
        copies.push((path, to));
    }
    targets.check()?;
    let Some((_, first)) = copies.first().cloned() else {
        return Err(Failure::file(format!("output `{name}` has no file")));
    };
    for (from, to) in copies {
        let bytes = std::fs::read(from)
            .map_err(|error| Failure::file(formats::atomic::FileError::new(from, "read", error).to_string()))?;
        write_whole(&to, &bytes)?;
    }
    Ok(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(first: i64, last: i64) -> Piece {
        Piece { frames: (first..=last).map(Frame::whole).collect(), files: vec!["a.usdc".into()] }
    }

    #[test]
    fn frames_must_be_there_once_and_missing_ones_are_named() {
        let wanted: Option<PartRange> = Some("1-24".parse().unwrap());
        assert!(complete("fur", &[piece(1, 16), piece(17, 24)], wanted).is_ok());
        let fault = |pieces: &[Piece], wanted| complete("fur", pieces, wanted).unwrap_err().lines.concat();
        assert_eq!(
            fault(&[piece(1, 8), piece(17, 23)], wanted),
            "output `fur` lacks frames 9-16, 24; cook the parts that have them again"
        );
        assert_eq!(
            fault(&[piece(1, 8), piece(10, 12)], None),
            "output `fur` lacks frame 9; cook the parts that have them again"
        );
        assert_eq!(
            fault(&[piece(1, 8), piece(8, 12)], None),
            "output `fur`: frame 8 is in two parts; remove one of them"
        );
    }
}
