//! Geometry files named on the command line, and the frame numbers in their names.
//!
//! A run of `#` in a [`Numbered`] name is replaced by the frame number, as in a graph. USD files are read at one time here;
//! see [`UsdFile`] for all. Limit: other files are read as a whole.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use engine::geometry::Geometry;
use engine::time::Frame;
use formats::Format;
use formats::atomic::FileError;

use crate::failure::{Exit, Failure};
use crate::usd_file::{UsdFile, is_usd};

/// A geometry file that was read.
#[derive(Debug)]
pub struct GeometryFile {
    /// Its format, by its extension.
    pub format: &'static str,
    /// Its size.
    pub bytes: u64,
    /// Its geometry.
    pub geometry: Geometry,
    /// Of a USD file, the time at which it was read and how many it has samples at.
    pub time: Option<(f64, usize)>,
    /// What of a USD file was left out.
    pub notes: Vec<String>,
}

/// Reads the file at `path`; a USD file at its first time.
///
/// # Errors
/// If it cannot be read or is not a file of the format of its extension.
pub fn read(path: &Path) -> Result<GeometryFile, Failure> {
    if is_usd(path) { read_usd(path, "", None) } else { read_whole(path) }
}

/// Reads the prim at the path `prim` of a USD file and all under it, at a time code; at its first one if none is given.
///
/// # Errors
/// If it cannot be read or has no such prim.
pub fn read_usd(path: &Path, prim: &str, time: Option<f64>) -> Result<GeometryFile, Failure> {
    let file = UsdFile::open(path, prim)?;
    let time = time.unwrap_or(file.first());
    let formats::usd::UsdReading { geometry, notes, .. } = file.read(time)?;
    Ok(GeometryFile { format: file.format, bytes: file.bytes, geometry, time: Some((time, file.times.len())), notes })
}

fn read_whole(path: &Path) -> Result<GeometryFile, Failure> {
    let unread = |error: io::Error| Failure::file(FileError::new(path, "read", error).to_string());
    let mut file = engine::files::open(path).map_err(unread)?;
    let refused = |error| refused(path, &error);
    let format = Format::of_path(path).map_err(refused)?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(unread)?;
    let geometry = formats::read(format, &bytes).map_err(refused)?;
    let (format, bytes) = (format.name(), bytes.len() as u64);
    Ok(GeometryFile { format, bytes, geometry, time: None, notes: Vec::new() })
}

/// The failure of a file that its format refuses, with the hint.
pub fn refused(path: &Path, error: &formats::FormatError) -> Failure {
    let hint = error.hint().map(|hint| format!("; {hint}")).unwrap_or_default();
    Failure::file(format!("`{}`: {error}{hint}", path.display()))
}

/// A path with a run of `#` in its file name, which is replaced by the frame number, padded with zeros to the length of
/// the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Numbered {
    path: PathBuf,
    before: String,
    digits: usize,
    after: String,
}

impl Numbered {
    /// Parses a numbered path; `None` if its name has no `#`.
    ///
    /// # Errors
    /// If the name has several runs of `#`.
    pub fn of(path: &Path) -> Result<Option<Self>, Failure> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some(start) = name.find('#') else { return Ok(None) };
        let after = name[start..].trim_start_matches('#');
        if after.contains('#') {
            let line = format!("`{}` has several runs of `#`, expected one for the frame number", path.display());
            return Err(Failure::new(Exit::CommandLine, line));
        }
        let digits = name.len() - start - after.len();
        Ok(Some(Self { path: path.to_owned(), before: name[..start].into(), digits, after: after.into() }))
    }

    /// The file of `frame`.
    pub fn at(&self, frame: Frame) -> PathBuf {
        let number = frame.number().abs().to_string();
        let (whole, fraction) = number.split_once('.').unwrap_or((&number, ""));
        let sign = if frame < Frame::whole(0) { "-" } else { "" };
        let point = if fraction.is_empty() { "" } else { "_" };
        // Not by a width of `format!`, which has a limit.
        let zeros = "0".repeat(self.digits.saturating_sub(whole.len()));
        self.path.with_file_name(format!("{}{sign}{zeros}{whole}{point}{fraction}{}", self.before, self.after))
    }

    /// The existing files, frames ascending.
    ///
    /// # Errors
    /// If the folder cannot be listed, or there is no such file.
    pub fn find(&self) -> Result<Vec<(Frame, PathBuf)>, Failure> {
        let folder = folder_of(&self.path);
        let unread = |error| Failure::file(FileError::new(folder, "read", error).to_string());
        let mut found = Vec::new();
        for entry in fs::read_dir(folder).map_err(unread)? {
            let name = entry.map_err(unread)?.file_name();
            if let Some(frame) = name.to_str().and_then(|name| self.frame_in(name)) {
                found.push((frame, self.path.with_file_name(name)));
            }
        }
        found.sort_unstable();
        if found.is_empty() {
            return Err(Failure::file(format!("no file matches `{}`", self.path.display())));
        }
        Ok(found)
    }

    /// The frame of the file with that name; `None` if it is not part of the sequence. Each frame has exactly one name.
    fn frame_in(&self, name: &str) -> Option<Frame> {
        let label = name.strip_prefix(&*self.before)?.strip_suffix(&*self.after)?;
        let frame = parse_label(label)?;
        (self.at(frame).file_name()?.to_str()? == name).then_some(frame)
    }

    /// The name without the frame and the separator before it: `fur` of `fur.####.json`.
    pub fn stem(&self) -> &str {
        self.before.trim_end_matches(SEPARATORS)
    }
}

/// Separators between a name and its frame.
const SEPARATORS: [char; 3] = ['.', '_', '-'];

/// The name of a file without extension and frame, and its frame if the name ends with one: (`fur`, 12) of
/// `fur.0012.json`.
pub fn stem_and_frame(path: &Path) -> (String, Option<Frame>) {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    // A fractional frame contains a separator (`fur.0010_5`), so the dot is tried first.
    for separator in ['.', '_'] {
        if let Some((name, label)) = stem.rsplit_once(separator)
            && let Some(frame) = parse_label(label)
        {
            return (name.to_owned(), Some(frame));
        }
    }
    (stem, None)
}

/// The files of the one sequence, or the one file, in a folder; frames ascend. Files that cannot be read as geometry do
/// not count.
///
/// # Errors
/// If the folder cannot be listed, or holds no file or several sequences.
pub fn sequence_in(folder: &Path) -> Result<Vec<(Frame, PathBuf)>, Failure> {
    let unread = |error| Failure::file(FileError::new(folder, "read", error).to_string());
    let mut sequences: BTreeMap<String, Vec<(Frame, PathBuf)>> = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(unread)? {
        let path = entry.map_err(unread)?.path();
        let Some(format) = Format::of_path(&path).ok().filter(|format| format.is_read() && path.is_file()) else {
            continue;
        };
        let (stem, frame) = stem_and_frame(&path);
        let name = match frame {
            Some(_) => folder.join(format!("{stem}.####.{format}")),
            None => path.clone(),
        };
        let frame = frame.unwrap_or(Frame::whole(1));
        sequences.entry(name.display().to_string()).or_default().push((frame, path));
    }
    let names: Vec<String> = sequences.keys().take(8).map(|name| format!("`{name}`")).collect();
    let mut files = match (sequences.pop_first(), sequences.is_empty()) {
        (Some((_, files)), true) => files,
        (None, _) => return Err(Failure::file(format!("`{}` holds no obj, ply or json file", folder.display()))),
        (Some(_), false) => {
            let fact = format!("`{}` holds several sequences", folder.display());
            return Err(Failure::new(Exit::CommandLine, format!("{fact}; convert one of {}", names.join(", "))));
        }
    };
    files.sort_unstable();
    match files.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => {
            let (one, other) = (pair[0].1.display(), pair[1].1.display());
            Err(Failure::new(
                Exit::CommandLine,
                format!("`{one}` and `{other}` are the same frame; remove one of them"),
            ))
        }
        None => Ok(files),
    }
}

/// The inverse of [`Frame::file_label`].
fn parse_label(label: &str) -> Option<Frame> {
    if label.contains('.') { None } else { label.replacen('_', ".", 1).parse().ok() }
}

/// The folder of a path.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(path: &str) -> Numbered {
        Numbered::of(Path::new(path)).unwrap().unwrap()
    }

    fn frame(number: f64) -> Frame {
        Frame::exactly(number).unwrap()
    }

    #[test]
    fn a_run_of_hashes_is_the_frame_padded_to_its_length() {
        let at = |path: &str, number: f64| numbered(path).at(frame(number)).display().to_string();
        assert_eq!(at("in/fur.####.json", 7.0), "in/fur.0007.json");
        assert_eq!(at("fur.####.json", 10.5), "fur.0010_5.json");
        assert_eq!(at("fur.####.json", -3.25), "fur.-0003_25.json");
        assert_eq!(at("fur_#.obj", 1234.0), "fur_1234.obj");
        assert_eq!(Numbered::of(Path::new("a#/fur.json")).unwrap(), None, "folders are not numbered");
        let error = Numbered::of(Path::new("a.##.##.json")).unwrap_err();
        assert_eq!(error.lines, ["`a.##.##.json` has several runs of `#`, expected one for the frame number"]);
    }

    #[test]
    fn a_frame_has_exactly_one_name() {
        let frame_in = |name: &str| numbered("fur.####.json").frame_in(name).map(Frame::number);
        assert_eq!(frame_in("fur.0007.json"), Some(7.0));
        assert_eq!(frame_in("fur.0010_5.json"), Some(10.5));
        assert_eq!(frame_in("fur.-0003.json"), Some(-3.0));
        assert_eq!(frame_in("fur.12345.json"), Some(12345.0));
        for name in ["fur.7.json", "fur.00007.json", "fur.0007.obj", "fur.0007.5.json", "fur..json", "skin.0007.json"] {
            assert_eq!(frame_in(name), None, "{name}");
        }
    }

    #[test]
    fn the_frame_of_a_name_is_the_number_at_its_end() {
        let of = |path: &str| {
            let (stem, frame) = stem_and_frame(Path::new(path));
            (stem, frame.map(Frame::number))
        };
        assert_eq!(of("in/fur.0012.json"), ("fur".into(), Some(12.0)));
        assert_eq!(of("fur.0010_5.json"), ("fur".into(), Some(10.5)));
        assert_eq!(of("fur.-0003.json"), ("fur".into(), Some(-3.0)));
        assert_eq!(of("fur_0012.obj"), ("fur".into(), Some(12.0)));
        assert_eq!(of("fur_bear_10k.obj"), ("fur_bear_10k".into(), None));
        assert_eq!(of("bear2.obj"), ("bear2".into(), None));
        assert_eq!(of("fur.json"), ("fur".into(), None));
    }

    #[test]
    fn files_of_a_sequence_are_sorted_by_frame() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.0010.obj", "a.0002.obj", "a.0002_5.obj", "a.obj", "b.0001.obj"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let found = numbered(&folder.path().join("a.####.obj").display().to_string()).find().unwrap();
        let frames: Vec<f64> = found.iter().map(|(frame, _)| frame.number()).collect();
        assert_eq!(frames, [2.0, 2.5, 10.0]);
        let error = numbered(&folder.path().join("c.##.obj").display().to_string()).find().unwrap_err();
        assert!(error.lines[0].ends_with("c.##.obj`"), "{error:?}");
    }
}
