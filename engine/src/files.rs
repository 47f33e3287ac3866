//! Files that a graph reads. The engine reads them, so that nodes get the same bytes that were hashed for keys.

use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::error::{Error, Result};
use crate::key::{ContentKey, Hasher};
use crate::memory::{Ceiling, size_text};

/// A file identified by the hash of its contents. Its bytes stay in memory until the store releases them, and are read
/// again when needed after that.
#[derive(Clone, Debug)]
pub struct File {
    path: Arc<PathBuf>,
    /// Of its contents.
    content: ContentKey,
    /// Of its contents and those of all files that it is read with.
    key: ContentKey,
    store: Arc<Files>,
}

impl PartialEq for File {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key && self.path == other.path
    }
}

impl File {
    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The extension of its name without the dot; empty if there is none.
    pub fn extension(&self) -> &str {
        self.path.extension().and_then(|e| e.to_str()).unwrap_or_default()
    }

    /// The key of its contents, and of those of the files that it is read with.
    pub fn key(&self) -> ContentKey {
        self.key
    }

    /// The folder that it is in, from which files that it names are opened.
    pub fn folder(&self) -> FileFolder {
        let folder = self.path.parent().unwrap_or(Path::new("")).to_owned();
        FileFolder { folder, store: Arc::downgrade(&self.store) }
    }

    /// What `make` makes of its bytes, made once and kept as long as the store: the structure of a file from which a part
    /// is read at each frame.
    ///
    /// # Errors
    /// Those of `make`, which are not kept.
    pub fn derived<T: Send + Sync + 'static>(&self, make: impl FnOnce(&Self) -> Result<T>) -> Result<Arc<T>> {
        let place = (self.path.to_path_buf(), TypeId::of::<T>());
        let kept = self.store.derived.lock().unwrap_or_else(PoisonError::into_inner).get(&place).cloned();
        let kept = kept.filter(|(content, _)| *content == self.content);
        if let Some(kept) = kept.and_then(|(_, kept)| kept.downcast::<T>().ok()) {
            return Ok(kept);
        }
        // Two threads may both make it.
        let made = Arc::new(make(self)?);
        let mut derived = self.store.derived.lock().unwrap_or_else(PoisonError::into_inner);
        derived.insert(place, (self.content, made.clone()));
        Ok(made)
    }

    /// This file, read with others: its key is that of all of them.
    pub(crate) fn read_with(mut self, others: &[Self]) -> Self {
        if !others.is_empty() {
            let mut hasher = Hasher::default();
            hasher.key(self.content);
            for other in others {
                hasher.key(other.key);
            }
            self.key = hasher.finish();
        }
        self
    }

    /// Its bytes, which are the ones that were hashed.
    ///
    /// # Errors
    /// If they had to be read again and have changed, or can no longer be read.
    pub fn bytes(&self) -> Result<Arc<[u8]>> {
        let (bytes, key) = self.store.load(&self.path)?;
        if key != self.content {
            let fact = format!("`{}` changed while the graph was cooked", self.path.display());
            return Err(Error::file(fact).hint("cook again when no other program writes to it"));
        }
        Ok(bytes)
    }
}

/// The folder of a file. It does not keep the store.
#[derive(Clone, Debug)]
pub struct FileFolder {
    folder: PathBuf,
    store: Weak<Files>,
}

impl FileFolder {
    /// The file that a file in this folder calls `name`.
    ///
    /// # Errors
    /// If it cannot be read, or the cook is over.
    pub fn open(&self, name: &str) -> Result<File> {
        let store = self.store.upgrade().ok_or_else(|| Error::contract("a file was opened after the cook"))?;
        store.open(&self.folder.join(name))
    }
}

type Loaded = (Arc<[u8]>, ContentKey);

/// What was made of files, by path and type.
type DerivedFiles = BTreeMap<(PathBuf, TypeId), (ContentKey, Arc<dyn Any + Send + Sync>)>;

/// The files of one cook. Bytes are kept until [`Files::release`]; keys for the lifetime of the store.
#[derive(Debug)]
pub struct Files {
    ceiling: Ceiling,
    keys: Mutex<BTreeMap<PathBuf, ContentKey>>,
    bytes: Mutex<BTreeMap<PathBuf, Loaded>>,
    derived: Mutex<DerivedFiles>,
}

impl Default for Files {
    fn default() -> Self {
        Self::within(Ceiling::NONE)
    }
}

impl Files {
    /// A store that refuses files larger than the ceiling.
    pub fn within(ceiling: Ceiling) -> Self {
        Self { ceiling, keys: Mutex::default(), bytes: Mutex::default(), derived: Mutex::default() }
    }

    /// The file at `path`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(self: &Arc<Self>, path: &Path) -> Result<File> {
        let hashed = self.keys.lock().unwrap_or_else(PoisonError::into_inner).get(path).copied();
        let key = match hashed {
            Some(key) => key,
            None => self.load(path)?.1,
        };
        Ok(File { path: Arc::new(path.to_owned()), content: key, key, store: self.clone() })
    }

    /// Drops all bytes. They are read again when needed, and must then be unchanged.
    pub fn release(&self) {
        self.bytes.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    fn load(&self, path: &Path) -> Result<Loaded> {
        let mut bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(loaded) = bytes.get(path) {
            return Ok(loaded.clone());
        }
        let read = self.read(path)?;
        let key = ContentKey::of(&read);
        let loaded = (Arc::from(read), key);
        bytes.insert(path.to_owned(), loaded.clone());
        self.keys.lock().unwrap_or_else(PoisonError::into_inner).entry(path.to_owned()).or_insert(key);
        Ok(loaded)
    }
}

impl Files {
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        let too_large = |bytes: String| {
            let fact = format!("`{}` has {bytes}, but {}", path.display(), self.ceiling.describe());
            Error::file(fact).hint("split the file, or raise --memory")
        };
        let failed = |error: io::Error| unreadable(path, &error);
        let file = open(path).map_err(failed)?;
        let length = file.metadata().map_or(0, |about| about.len());
        if !self.ceiling.allows(usize::try_from(length).unwrap_or(usize::MAX)) {
            return Err(too_large(size_text(usize::try_from(length).unwrap_or(usize::MAX))));
        }
        // A file that grows, or a stream, may have more than it says.
        let most = self.ceiling.bytes.max(Ceiling::LEAST);
        let mut read = Vec::new();
        file.take(most as u64).read_to_end(&mut read).map_err(failed)?;
        match read.len() < most {
            true => Ok(read),
            false => Err(too_large("more".into())),
        }
    }
}

/// `path` with each run of `#` in its file name replaced by the frame number, padded with zeros to the length of the
/// run.
pub(crate) fn numbered_path(path: &Path, frame: i64) -> PathBuf {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut numbered = String::new();
    let mut rest = name.as_str();
    while let Some(at) = rest.find('#') {
        let width = rest[at..].bytes().take_while(|byte| *byte == b'#').count();
        let sign = if frame < 0 { "-" } else { "" };
        let digits = frame.unsigned_abs().to_string();
        numbered.push_str(&rest[..at]);
        numbered.push_str(sign);
        // Not by a width of `format!`, which has a limit.
        numbered.extend(std::iter::repeat_n('0', width.saturating_sub(digits.len())));
        numbered.push_str(&digits);
        rest = &rest[at + width..];
    }
    path.with_file_name(numbered + rest)
}

/// The existing files of the sequence at `path`, in no particular order.
pub(crate) fn existing_files(path: &Path) -> Vec<PathBuf> {
    numbered_files(path).map(|(_, path)| path).collect()
}

/// The first and the last number of the files of the sequence at `path`.
pub(crate) fn existing_frames(path: &Path) -> Option<(i64, i64)> {
    let numbers = || numbered_files(path).map(|(frame, _)| frame);
    numbers().min().zip(numbers().max())
}

/// The existing files of a sequence with their numbers.
fn numbered_files(path: &Path) -> impl Iterator<Item = (i64, PathBuf)> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let before = &name[..name.find('#').unwrap_or(name.len())];
    let number = move |found: &str| {
        let rest = found.strip_prefix(before)?;
        let sign = usize::from(rest.starts_with('-'));
        let digits = rest[sign..].bytes().take_while(u8::is_ascii_digit).count();
        // Digits may follow the number in the name.
        let mut numbers = (1..=digits).filter_map(|count| rest[..sign + count].parse::<i64>().ok());
        numbers.find(|frame| numbered_path(path, *frame).file_name().is_some_and(|name| name == found))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(move |entry| Some((number(entry.file_name().to_str()?)?, entry.path())))
}

/// Whether `path` is a stream that the program inherited, such as `/dev/stdin` or `/dev/fd/3`. Such a path has no
/// folder that others could be relative to.
pub fn is_handed_over(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd")
}

/// Opens a file for reading without blocking: folders, pipes and devices are refused, except inherited streams, which
/// already have a writer.
///
/// # Errors
/// If it is not a file, does not exist, or reading it is not permitted.
pub fn open(path: &Path) -> io::Result<fs::File> {
    let about = fs::metadata(path)?;
    if about.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !about.is_file() && !is_handed_over(path) {
        return Err(io::Error::other("it is a pipe or a device, not a file"));
    }
    fs::File::open(path)
}

/// The hint of a file that does not exist.
pub const RELATIVE_PATHS: &str = "paths are relative to the graph file";

/// The error of a file that cannot be read, with hints for the most common causes.
pub fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    use std::io::ErrorKind as K;
    let path = path.display();
    match error.kind() {
        K::NotFound => Error::file(format!("`{path}` does not exist")).hint(RELATIVE_PATHS),
        K::PermissionDenied => {
            Error::file(format!("no permission to read `{path}`")).hint("change the file's permissions")
        }
        K::IsADirectory => Error::file(format!("`{path}` is a folder, expected a file")),
        K::InvalidFilename => {
            let text = path.to_string();
            let start: String = text.chars().take(60).collect();
            Error::file(format!("the name `{start}…` of {} letters is too long for a file", text.chars().count()))
                .hint("the system allows 255 bytes for each part of a path, and about 4,000 in all")
        }
        _ => Error::file(format!("`{path}` could not be read: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_too_long_is_not_repeated_in_full() {
        let path = "a/".to_owned() + &"x".repeat(70_000);
        let error = unreadable(Path::new(&path), &std::io::ErrorKind::InvalidFilename.into());
        assert!(error.fact.ends_with("…` of 70002 letters is too long for a file"), "{}", error.fact);
        assert!(error.fact.len() < 200);
    }

    #[test]
    fn each_run_of_hashes_becomes_the_frame_number() {
        let path = |text: &str, frame| numbered_path(Path::new(text), frame).display().to_string();
        assert_eq!(path("in/fur.####.obj", 7), "in/fur.0007.obj");
        assert_eq!(path("fur_##.obj", 123), "fur_123.obj");
        assert_eq!(path("fur.####.obj", -3), "fur.-0003.obj");
        for width in [65_535, 65_536, 1_000_000] {
            assert_eq!(path(&"#".repeat(width), -7), format!("-{}7", "0".repeat(width - 1)));
        }
    }

    #[test]
    fn the_files_of_a_sequence_are_found_in_their_folder() {
        let folder = tempfile::tempdir().unwrap();
        let all = ["a.0001.obj", "a.-0002.obj", "a.12345.obj", "a.1.obj", "a.0001.ply", "b.0001.obj", "a.00011.obj"];
        all.iter().for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
        let found = |name: &str| {
            let files = existing_files(&folder.path().join(name));
            let mut names: Vec<String> =
                files.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect();
            names.sort();
            names
        };
        assert_eq!(found("a.####.obj"), ["a.-0002.obj", "a.0001.obj", "a.12345.obj"]);
        assert_eq!(found("a.####1.obj"), ["a.00011.obj"]);
        assert_eq!(found("a.#.obj"), ["a.1.obj", "a.12345.obj"]);
        assert!(found("none.#.obj").is_empty() && existing_files(Path::new("missing/a.#.obj")).is_empty());
        let frames = |name: &str| existing_frames(&folder.path().join(name));
        assert_eq!((frames("a.####.obj"), frames("none.#.obj")), (Some((-2, 12345)), None));
    }

    #[test]
    fn a_file_that_changes_after_it_was_hashed_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0").unwrap();
        let files = Arc::new(Files::default());
        let file = files.open(&path).unwrap();
        assert_eq!(&*file.bytes().unwrap(), b"v 0 0 0");
        std::fs::write(&path, "v 1 1 1").unwrap();
        assert_eq!(&*file.bytes().unwrap(), b"v 0 0 0", "bytes in memory are the ones that were hashed");
        files.release();
        assert!(file.bytes().unwrap_err().fact.ends_with("changed while the graph was cooked"));
    }

    #[test]
    fn what_is_made_of_a_file_is_kept_and_its_key_covers_what_it_is_read_with() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("a", "1"), ("b", "2"), ("c", "3")] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let files = Arc::new(Files::default());
        let file = files.open(&folder.path().join("a")).unwrap();
        let length = |file: &File| file.derived(|file| Ok(file.bytes()?.len())).unwrap();
        let first = length(&file);
        files.release();
        assert!(Arc::ptr_eq(&first, &length(&file)));
        let [b, c] = ["b", "c"].map(|name| file.folder().open(name).unwrap());
        let key = |others: &[File]| file.clone().read_with(others).key();
        assert_eq!(key(&[]), file.key());
        let (b, c) = (std::slice::from_ref(&b), std::slice::from_ref(&c));
        assert!(key(b) != key(c) && key(b) != file.key());
        assert_eq!(&*file.clone().read_with(c).bytes().unwrap(), b"1");
        assert!(file.folder().open("none").is_err());
    }

    #[test]
    fn an_unreadable_file_gives_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let files = Arc::new(Files::default());
        let error = files.open(&folder.path().join("none.obj")).unwrap_err();
        assert!(error.fact.ends_with("none.obj` does not exist"), "{error}");
        assert!(files.open(folder.path()).unwrap_err().fact.ends_with("is a folder, expected a file"));
        if cfg!(unix) {
            let error = files.open(Path::new("/dev/null")).unwrap_err();
            assert_eq!(error.fact, "`/dev/null` could not be read: it is a pipe or a device, not a file");
        }
    }
}
