//! Pairs the files to compare: two files, two folders by file name, or two numbered sequences by frame.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use formats::Format;
use formats::atomic::FileError;

use crate::failure::{Exit, Failure};
use crate::geometry_file::Numbered;

/// Two files to compare; one of them may be missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    pub(super) a: Option<PathBuf>,
    pub(super) b: Option<PathBuf>,
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
        (false, false) => return Ok(vec![Pair { a: Some(a.to_owned()), b: Some(b.to_owned()) }]),
        (true, false) => return Err(not_a_pair(a, b, "a folder")),
        (false, true) => return Err(not_a_pair(b, a, "a folder")),
        (true, true) => {}
    }
    let pairs = joined(geometry_files(a)?, geometry_files(b)?);
    if pairs.is_empty() {
        let line = format!("neither `{}` nor `{}` has a geometry file", a.display(), b.display());
        return Err(Failure::new(Exit::CommandLine, line));
    }
    Ok(pairs)
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
        pairs.insert(key, Pair { a: Some(path), b: None });
    }
    for (key, path) in b {
        pairs.entry(key).or_insert(Pair { a: None, b: None }).b = Some(path);
    }
    pairs.into_values().collect()
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
