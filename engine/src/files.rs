//! Files a graph reads. The engine reads them, so that the bytes that were hashed are the bytes a node gets.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::key::ContentKey;

/// A file whose contents are known by key. Its bytes are at hand until the store drops them, and read again then.
#[derive(Clone, Debug)]
pub struct File {
    path: Arc<PathBuf>,
    key: ContentKey,
    store: Arc<Files>,
}

impl PartialEq for File {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key && self.path == other.path
    }
}

impl File {
    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What follows the last dot of its name; empty where there is none.
    pub fn extension(&self) -> &str {
        self.path.extension().and_then(|e| e.to_str()).unwrap_or_default()
    }

    /// The key of its contents.
    pub fn key(&self) -> ContentKey {
        self.key
    }

    /// Its bytes, the very ones that were hashed.
    ///
    /// # Errors
    /// Where they had to be read again and have changed, or cannot be read any more.
    pub fn bytes(&self) -> Result<Arc<[u8]>> {
        let (bytes, key) = self.store.load(&self.path)?;
        if key != self.key {
            let fact = format!("`{}` changed while the graph was cooked", self.path.display());
            return Err(Error::file(fact).hint("cook again, once nothing writes to it"));
        }
        Ok(bytes)
    }
}

type Loaded = (Arc<[u8]>, ContentKey);

/// The files of one cook. Bytes are kept until [`Files::release`]; keys as long as the store lives.
#[derive(Debug, Default)]
pub struct Files {
    keys: Mutex<BTreeMap<PathBuf, ContentKey>>,
    bytes: Mutex<BTreeMap<PathBuf, Loaded>>,
}

impl Files {
    /// The file at `path`.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn open(self: &Arc<Self>, path: &Path) -> Result<File> {
        let known = self.keys.lock().unwrap_or_else(PoisonError::into_inner).get(path).copied();
        let key = match known {
            Some(key) => key,
            None => self.load(path)?.1,
        };
        Ok(File { path: Arc::new(path.to_owned()), key, store: self.clone() })
    }

    /// Drops all bytes; they are read again where someone asks, and must be the same then.
    pub fn release(&self) {
        self.bytes.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    fn load(&self, path: &Path) -> Result<Loaded> {
        let mut bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(loaded) = bytes.get(path) {
            return Ok(loaded.clone());
        }
        let mut read = Vec::new();
        let file = open(path).and_then(|mut file| file.read_to_end(&mut read));
        file.map_err(|error| unreadable(path, &error))?;
        let key = ContentKey::of(&read);
        let loaded = (Arc::from(read), key);
        bytes.insert(path.to_owned(), loaded.clone());
        self.keys.lock().unwrap_or_else(PoisonError::into_inner).entry(path.to_owned()).or_insert(key);
        Ok(loaded)
    }
}

/// `path` with each run of `#` in its file name replaced by the frame number, as many digits at least.
pub(crate) fn numbered_path(path: &Path, frame: i64) -> PathBuf {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut numbered = String::new();
    let mut rest = name.as_str();
    while let Some(at) = rest.find('#') {
        let width = rest[at..].bytes().take_while(|byte| *byte == b'#').count();
        let sign = if frame < 0 { "-" } else { "" };
        numbered.push_str(&rest[..at]);
        numbered.push_str(&format!("{sign}{:0width$}", frame.unsigned_abs()));
        rest = &rest[at + width..];
    }
    path.with_file_name(numbered + rest)
}

/// Whether that is what the program was started with, such as `/dev/stdin` and `/dev/fd/3`: it is in no folder of its own.
pub fn is_handed_over(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd")
}

/// Opens a file to be read, without ever waiting for one: folders, pipes and devices are refused, but what is handed over
/// has its writer already.
///
/// # Errors
/// Where it is no file, does not exist or may not be read.
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

/// The error of a file that cannot be read, with what to do about the commonest causes.
pub fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    use std::io::ErrorKind as K;
    let path = path.display();
    match error.kind() {
        K::NotFound => Error::file(format!("`{path}` does not exist")).hint("paths are relative to the graph file"),
        K::PermissionDenied => Error::file(format!("`{path}` may not be read")).hint("ask for read permission"),
        K::IsADirectory => Error::file(format!("`{path}` is a folder, expected a file")),
        _ => Error::file(format!("`{path}` could not be read: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_run_of_hashes_becomes_the_frame_number() {
        let path = |text: &str, frame| numbered_path(Path::new(text), frame).display().to_string();
        assert_eq!(path("in/fur.####.obj", 7), "in/fur.0007.obj");
        assert_eq!(path("fur_##.obj", 123), "fur_123.obj");
        assert_eq!(path("fur.####.obj", -3), "fur.-0003.obj");
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
        assert_eq!(&*file.bytes().unwrap(), b"v 0 0 0", "bytes at hand are the ones that were hashed");
        files.release();
        assert!(file.bytes().unwrap_err().fact.ends_with("changed while the graph was cooked"));
    }

    #[test]
    fn what_cannot_be_read_says_why() {
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
