//! Pairs the files to compare: two files, two folders by file name (of another format if need be), or two numbered
//! sequences by frame.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use formats::Format;
use formats::atomic::FileError;

use crate::failure::{Exit, Failure};
use crate::geometry_file::{Numbered, stem_and_frame};

/// Two files to compare; one of them may be missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pair {
    pub(super) a: Option<PathBuf>,
    pub(super) b: Option<PathBuf>,
    /// The time at which USD files are compared.
    pub(super) time: Option<f64>,
}

/// The pairs of `a` and `b`, by name or frame; not empty.
///
/// # Errors
/// If one is a folder or a sequence and the other is not, one cannot be listed, or there is no file.
pub(super) fn pairs(a: &Path, b: &Path) -> Result<Vec<Pair>, Failure> {
    match (Numbered::of(a)?, Numbered::of(b)?) {
        (Some(a), Some(b)) => return Ok(joined(a.find()?, b.find()?)),
        (Some(_), None) => return Err(not_a_pair(a, b, "a numbered sequence")),
        (None, Some(_)) => return Err(not_a_pair(b, a, "a numbered sequence")),
        (None, None) => {}
    }
    match (a.is_dir(), b.is_dir()) {
        (false, false) => return Ok(vec![Pair { a: Some(a.to_owned()), b: Some(b.to_owned()), time: None }]),
        (true, false) => return Err(not_a_pair(a, b, "a folder")),
        (false, true) => return Err(not_a_pair(b, a, "a folder")),
        (true, true) => {}
    }
    let pairs = of_other_formats(joined(geometry_files(a)?, geometry_files(b)?));
    if pairs.is_empty() {
        let line = format!("neither `{}` nor `{}` has a geometry file", a.display(), b.display());
        return Err(Failure::new(Exit::CommandLine, line));
    }
    Ok(pairs)
}

/// A file, folder or sequence on one side, or the times of a USD file.
pub(super) enum DiffSide<'a> {
    Files(&'a Path),
    Usd(&'a Path, &'a [f64]),
}

/// The pairs where at least one side is a USD file: by time. A USD file that does not move, and a file without a number in
/// its name, have all times of the other side.
///
/// # Errors
/// If the other side is a folder, or a sequence that cannot be listed.
pub(super) fn usd_pairs(a: &DiffSide<'_>, b: &DiffSide<'_>) -> Result<Vec<Pair>, Failure> {
    let [a, b] = [timed_files(a)?, timed_files(b)?];
    // Ordered like the numbers, which are finite.
    let key = |time: f64| (time + 0.0).to_bits() ^ (((time.to_bits().cast_signed() >> 63).cast_unsigned()) | 1 << 63);
    let keyed = |files: &[(Option<f64>, PathBuf)], other: &[(Option<f64>, PathBuf)]| -> Vec<(u64, (f64, PathBuf))> {
        let times: Vec<f64> = other.iter().filter_map(|(time, _)| *time).collect();
        let times = if times.is_empty() { vec![1.0] } else { times };
        let at = |(time, path): &(Option<f64>, PathBuf)| match time {
            Some(time) => vec![(key(*time), (*time, path.clone()))],
            None => times.iter().map(|time| (key(*time), (*time, path.clone()))).collect(),
        };
        files.iter().flat_map(at).collect()
    };
    let mut pairs: BTreeMap<u64, Pair> = BTreeMap::new();
    for (key, (time, path)) in keyed(&a, &b) {
        pairs.insert(key, Pair { a: Some(path), b: None, time: Some(time) });
    }
    for (key, (time, path)) in keyed(&b, &a) {
        pairs.entry(key).or_insert(Pair { a: None, b: None, time: Some(time) }).b = Some(path);
    }
    Ok(pairs.into_values().collect())
}

fn timed_files(side: &DiffSide<'_>) -> Result<Vec<(Option<f64>, PathBuf)>, Failure> {
    match side {
        DiffSide::Usd(path, []) => Ok(vec![(None, (*path).to_owned())]),
        DiffSide::Usd(path, times) => Ok(times.iter().map(|time| (Some(*time), (*path).to_owned())).collect()),
        DiffSide::Files(path) if path.is_dir() => {
            let line = format!("`{}` is a folder and the other is a USD file; compare with a sequence", path.display());
            Err(Failure::new(Exit::CommandLine, line))
        }
        DiffSide::Files(path) => match Numbered::of(path)? {
            Some(numbered) => {
                Ok(numbered.find()?.into_iter().map(|(frame, path)| (Some(frame.number()), path)).collect())
            }
            None => {
                let frame = stem_and_frame(path).1.map(engine::time::Frame::number);
                Ok(vec![(frame, (*path).to_owned())])
            }
        },
    }
}

fn not_a_pair(one: &Path, other: &Path, what: &str) -> Failure {
    let line = format!(
        "`{}` is {what} and `{}` is not; compare two files, two folders or two sequences",
        one.display(),
        other.display()
    );
    Failure::new(Exit::CommandLine, line)
}

/// The files of both sides, paired and sorted by key.
fn joined<K: Ord>(a: Vec<(K, PathBuf)>, b: Vec<(K, PathBuf)>) -> Vec<Pair> {
    let mut pairs: BTreeMap<K, Pair> = BTreeMap::new();
    for (key, path) in a {
        pairs.insert(key, Pair { a: Some(path), b: None, time: None });
    }
    for (key, path) in b {
        pairs.entry(key).or_insert(Pair { a: None, b: None, time: None }).b = Some(path);
    }
    pairs.into_values().collect()
}

/// Joins what is alone on its side with the file of the other side that has the same name in another format, if there is
/// one only.
fn of_other_formats(mut pairs: Vec<Pair>) -> Vec<Pair> {
    let stem = |path: &Option<PathBuf>| path.as_ref().and_then(|path| path.file_stem()).map(ToOwned::to_owned);
    let mut alone: BTreeMap<_, [Vec<usize>; 2]> = BTreeMap::new();
    for (place, pair) in pairs.iter().enumerate() {
        match (stem(&pair.a), stem(&pair.b)) {
            (Some(stem), None) => alone.entry(stem).or_default()[0].push(place),
            (None, Some(stem)) => alone.entry(stem).or_default()[1].push(place),
            _ => {}
        }
    }
    for sides in alone.into_values() {
        if let [[a], [b]] = sides.each_ref().map(Vec::as_slice) {
            pairs[*a].b = pairs[*b].b.take();
        }
    }
    pairs.retain(|pair| pair.a.is_some() || pair.b.is_some());
    pairs
}

/// The geometry files in a folder by name, without hidden ones, which are temporary.
fn geometry_files(folder: &Path) -> Result<Vec<(String, PathBuf)>, Failure> {
    let unread = |error| Failure::file(FileError::new(folder, "read", error).to_string());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unread)? {
        let path = entry.map_err(unread)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !name.starts_with('.') && Format::of_path(&path).is_ok() && path.is_file() {
            files.push((name, path));
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        names.iter().for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
        folder
    }

    fn names(pairs: &[Pair]) -> Vec<[Option<&str>; 2]> {
        fn name(path: &Option<PathBuf>) -> Option<&str> {
            path.as_ref()?.file_name()?.to_str()
        }
        pairs.iter().map(|pair| [name(&pair.a), name(&pair.b)]).collect()
    }

    #[test]
    fn folders_are_paired_by_name_and_other_files_ignored() {
        let a = folder(&["fur.0001.json", "fur.0002.json", "preview.png", ".fur.0003.json"]);
        let b = folder(&["fur.0002.json", "skin.0001.obj", "log.txt"]);
        let pairs = pairs(a.path(), b.path()).unwrap();
        let expected = [[Some("fur.0001.json"), None], [Some("fur.0002.json"); 2], [None, Some("skin.0001.obj")]];
        assert_eq!(names(&pairs), expected);
    }

    #[test]
    fn what_has_the_same_name_in_another_format_is_a_pair() {
        let a = folder(&["fur.0001.json", "fur.0002.json", "skin.obj", "fur.0003.ply"]);
        let b = folder(&["fur.0001.ply", "fur.0002.json", "skin.ply", "skin.json", "fur.0003.json"]);
        let pairs = pairs(a.path(), b.path()).unwrap();
        let expected = [
            [Some("fur.0001.json"), Some("fur.0001.ply")],
            [Some("fur.0002.json"); 2],
            [Some("fur.0003.ply"), Some("fur.0003.json")],
            // Either could be meant.
            [None, Some("skin.json")],
            [Some("skin.obj"), None],
            [None, Some("skin.ply")],
        ];
        assert_eq!(names(&pairs), expected);
    }

    #[test]
    fn sequences_are_paired_by_frame() {
        let a = folder(&["fur.0001.json", "fur.0010.json"]);
        let b = folder(&["fur_10.ply"]);
        let pairs = pairs(&a.path().join("fur.####.json"), &b.path().join("fur_##.ply")).unwrap();
        assert_eq!(names(&pairs), [[Some("fur.0001.json"), None], [Some("fur.0010.json"), Some("fur_10.ply")]]);
    }

    #[test]
    fn a_folder_and_a_file_are_not_compared() {
        let a = folder(&["fur.json"]);
        let error = pairs(a.path(), &a.path().join("fur.json")).unwrap_err();
        assert!(
            error.lines[0].ends_with("fur.json` is not; compare two files, two folders or two sequences"),
            "{error:?}"
        );
        assert!(pairs(&folder(&[]).path().join("a.#.json"), a.path()).is_err());
        let error = pairs(folder(&["a.txt"]).path(), folder(&[]).path()).unwrap_err();
        assert!(error.lines[0].ends_with("has a geometry file"), "{error:?}");
    }
}
