//! Atomic file writing: a file appears under its name complete or not at all.
//!
//! An [`AtomicFile`] is written to a hidden temporary file in the same folder and renamed once it is complete and on
//! disk, so a killed program leaves no partial file under a final name. [`sweep`] removes temporaries of dead
//! processes; one belongs to a live process as long as that process holds its lock or has its process number. Of
//! another machine, where neither says anything, they are left-overs after a day. Limit: the file system's rename must
//! replace a file atomically, as on all local file systems.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use engine::{clock, host};

/// Separates the final name and the owner in the name of a temporary.
const MARK: &str = ".tmp-";

/// Temporaries of another machine that nobody has written to for so long are left-overs.
const LEFT_OVER: Duration = Duration::from_secs(24 * 3600);

/// A file that takes its final name when it is committed; dropped without that, it is removed.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    // Before `temporary`, so that it is closed when that is removed.
    file: BufWriter<File>,
    temporary: Temporary,
}

impl AtomicFile {
    /// Starts writing a file at `path`, whose folder must exist. An existing file at `path` is kept until the commit.
    ///
    /// # Errors
    /// If `path` exists and is not a file, or its folder cannot be written to.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, FileError> {
        let path = path.into();
        match Self::beside(&path) {
            Ok((file, temporary)) => Ok(Self { path, file: BufWriter::with_capacity(1 << 16, file), temporary }),
            Err(source) => Err(FileError { path, action: "created", source }),
        }
    }

    fn beside(path: &Path) -> io::Result<(File, Temporary)> {
        let name = path.file_name().ok_or(ErrorKind::IsADirectory)?;
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => return Err(ErrorKind::IsADirectory.into()),
            Ok(found) if !found.is_file() => return Err(io::Error::other("it is a device or a pipe, not a file")),
            _ => {}
        }
        loop {
            let path = path.with_file_name(temporary_name(name));
            match File::options().read(true).write(true).create_new(true).open(&path) {
                Ok(file) => {
                    // The lock only protects from other processes' sweeps; some file systems have none.
                    let _ = file.try_lock();
                    return Ok((file, Temporary { path, kept: false }));
                }
                // Left by an earlier process with the same number: try the next name.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// An I/O error of this file, with its final name.
    pub fn failed(&self, source: io::Error) -> FileError {
        FileError { path: self.path.clone(), action: "written", source }
    }

    /// Syncs the file to disk and renames it to its final name.
    ///
    /// # Errors
    /// If the last bytes cannot be written or the file cannot be renamed; it is removed then.
    pub fn commit(self) -> Result<(), FileError> {
        let Self { path, mut file, mut temporary } = self;
        let mut finish = || {
            file.flush()?;
            file.get_ref().sync_all()?;
            fs::rename(&temporary.path, &path)?;
            temporary.kept = true;
            sync_folder_of(&path)
        };
        finish().map_err(|source| FileError { path, action: "written", source })
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file.seek(position)
    }
}

/// A file that is removed when this is dropped, unless it was kept.
#[derive(Debug)]
struct Temporary {
    path: PathBuf,
    kept: bool,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.kept {
            // A failure here is not fatal: a later sweep tries again.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// `.NAME.tmp-HOST-PID-COUNT`, a new one for each call.
fn temporary_name(name: &OsStr) -> OsString {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!("{MARK}{}-{}-{count}", host::tag(), std::process::id()));
    hidden
}

/// Whose temporary a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    /// A process of this machine.
    Process(u32),
    /// One of another machine.
    Elsewhere,
}

/// The owner in a temporary's name; `None` for any other name.
fn owner_of(name: &str) -> Option<Owner> {
    let (name, owner) = name.strip_prefix('.')?.rsplit_once(MARK)?;
    let (host, numbers) = owner.split_once('-')?;
    let (process, count) = numbers.split_once('-')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_host = host.len() == 8 && host.bytes().all(|byte| byte.is_ascii_hexdigit());
    let process = (!name.is_empty() && is_host && digits(process) && digits(count)).then_some(process)?;
    let process = process.parse().ok()?;
    Some(if host == host::tag() { Owner::Process(process) } else { Owner::Elsewhere })
}

/// A rename is durable only after its folder is synced. Where folders cannot be opened, this is left to the system.
fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        Err(error) if matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::NotFound) => Err(error),
        _ => Ok(()),
    }
}

/// Removes the temporaries that dead processes left in `folder`, and returns their number.
///
/// # Errors
/// If the folder cannot be listed or a stale temporary cannot be removed.
pub fn sweep(folder: &Path) -> Result<usize, FileError> {
    let failed = |source| FileError { path: folder.to_path_buf(), action: "swept", source };
    let mut swept = 0;
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let Some(owner) = entry.file_name().to_str().and_then(owner_of) else { continue };
        let path = entry.path();
        if !entry.file_type().map_err(failed)?.is_file() || !is_stale(&path, owner) {
            continue;
        }
        match fs::remove_file(&path) {
            Ok(()) => swept += 1,
            // Another process has removed it.
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(source) => return Err(FileError { path, action: "removed", source }),
        }
    }
    Ok(swept)
}

/// Whether no live process owns a temporary. The lock decides, also across containers; the process number decides
/// between creation and locking, and on file systems without locks. Our own number proves nothing, because an earlier
/// process may have had it.
fn is_stale(path: &Path, owner: Owner) -> bool {
    let Owner::Process(owner) = owner else {
        let modified = fs::metadata(path).and_then(|about| about.modified());
        let age = modified.ok().and_then(|modified| clock::now().duration_since(modified).ok());
        return age.is_some_and(|age| age > LEFT_OVER);
    };
    let locks = match File::open(path).map(|file| file.try_lock()) {
        Ok(Ok(())) => true,
        Ok(Err(TryLockError::Error(_))) => false,
        Ok(Err(TryLockError::WouldBlock)) | Err(_) => return false,
    };
    if owner == std::process::id() {
        return locks;
    }
    let numbers = Path::new("/proc/self").exists();
    let alive = numbers && Path::new("/proc").join(owner.to_string()).exists();
    !alive && (locks || numbers)
}

/// An operation on a file or folder that failed.
#[derive(Debug, thiserror::Error)]
#[error("`{}` could not be {action}: {}", path.display(), cause(source))]
pub struct FileError {
    path: PathBuf,
    action: &'static str,
    source: io::Error,
}

impl FileError {
    /// `path` could not be `action` (a participle: "read", "created").
    pub fn new(path: impl Into<PathBuf>, action: &'static str, source: io::Error) -> Self {
        Self { path: path.into(), action, source }
    }

    /// The file or folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The kind of the I/O error.
    pub fn kind(&self) -> ErrorKind {
        self.source.kind()
    }

    /// How to fix it, if known.
    pub fn hint(&self) -> Option<&'static str> {
        match self.source.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Some("free some space, or write to another disk"),
            ErrorKind::FileTooLarge => Some("raise the limit (`ulimit -f`), write fewer frames, or one file per frame"),
            ErrorKind::NotFound | ErrorKind::NotADirectory => Some("check the path, or create the folder first"),
            ErrorKind::IsADirectory => Some("give the path of a file"),
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                Some("choose a folder you may write to, or change its permissions")
            }
            _ => None,
        }
    }
}

fn cause(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::StorageFull => "the disk is full".into(),
        ErrorKind::QuotaExceeded => "the disk quota is used up".into(),
        ErrorKind::FileTooLarge => "it is larger than the system lets a file be".into(),
        ErrorKind::PermissionDenied => "permission denied".into(),
        ErrorKind::ReadOnlyFilesystem => "the file system is read-only".into(),
        ErrorKind::IsADirectory => "it is a folder".into(),
        ErrorKind::NotADirectory => "a part of the path is not a folder".into(),
        ErrorKind::NotFound => "no such file or folder".into(),
        ErrorKind::AlreadyExists => "a file with that name already exists".into(),
        ErrorKind::InvalidFilename => "the name is too long or not allowed".into(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_committed_file_leaves_no_temporary() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fur.0001.obj");
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"v 0 0 1\n").unwrap();
        file.seek(SeekFrom::Start(2)).unwrap();
        file.write_all(b"7").unwrap();
        assert!(!path.exists(), "not before the commit");
        assert!(names(folder.path())[0].starts_with(".fur.0001.obj.tmp-"));
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"v 7 0 1\n");
        assert_eq!(names(folder.path()), ["fur.0001.obj"]);
    }

    #[test]
    fn a_dropped_file_keeps_the_existing_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fur.usda");
        fs::write(&path, "old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["fur.usda"]);
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_failed_commit_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fur.usda");
        let file = AtomicFile::create(&path).unwrap();
        fs::create_dir(&path).unwrap();
        let error = file.commit().unwrap_err();
        assert_eq!(error.to_string(), format!("`{}` could not be written: it is a folder", path.display()));
        assert_eq!(names(folder.path()), ["fur.usda"], "the folder remains, but no temporary");
    }

    #[test]
    fn an_impossible_path_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let text = |path: &Path| AtomicFile::create(path).unwrap_err().to_string();
        let here = folder.path().display().to_string();
        assert_eq!(text(folder.path()), format!("`{here}` could not be created: it is a folder"));
        let missing = folder.path().join("no/fur.obj");
        assert_eq!(text(&missing), format!("`{}` could not be created: no such file or folder", missing.display()));
        assert_eq!(
            AtomicFile::create(&missing).unwrap_err().hint(),
            Some("check the path, or create the folder first")
        );
        fs::write(folder.path().join("file"), "").unwrap();
        let inside = folder.path().join("file/fur.obj");
        assert!(text(&inside).ends_with("could not be created: a part of the path is not a folder"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_not_replaced_and_a_full_disk_is_reported() {
        let error = AtomicFile::create("/dev/full").unwrap_err();
        assert_eq!(error.to_string(), "`/dev/full` could not be created: it is a device or a pipe, not a file");
        let source = File::create("/dev/full").unwrap().write(b"x").unwrap_err();
        let error = FileError::new("out/fur.obj", "written", source);
        assert_eq!(error.to_string(), "`out/fur.obj` could not be written: the disk is full");
        assert_eq!(error.hint(), Some("free some space, or write to another disk"));
    }

    #[test]
    fn a_sweep_removes_only_temporaries_of_dead_processes() {
        let folder = tempfile::tempdir().unwrap();
        let mine = AtomicFile::create(folder.path().join("mine.obj")).unwrap();
        let (own, host) = (std::process::id(), host::tag());
        let stale =
            [format!(".a.obj.tmp-{host}-4294967294-0"), format!(".b.obj.tmp-{host}-{own}-18446744073709551615")];
        let kept = [
            &format!("a.obj.tmp-{host}-4294967294-0"),
            &format!(".tmp-{host}-4294967294-0"),
            &format!(".a.obj.tmp-{host}-x-0"),
            // Of another machine: it may live.
            ".a.obj.tmp-0badcafe-4294967294-0",
            ".a.obj.tmp-4294967294-0",
            ".a.obj.tmp-1",
            "a.obj",
        ];
        for name in stale.iter().map(String::as_str).chain(kept) {
            fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(sweep(folder.path()).unwrap(), 2);
        for name in kept {
            assert!(folder.path().join(name).exists(), "{name} is not a temporary");
        }
        mine.commit().unwrap();
        assert_eq!(names(folder.path()).len(), kept.len() + 1);
        let elsewhere = File::options().append(true).open(folder.path().join(kept[3])).unwrap();
        elsewhere.set_modified(clock::now() - 2 * LEFT_OVER).unwrap();
        assert_eq!(sweep(folder.path()).unwrap(), 1, "nobody has written to it for two days");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_live_process_keeps_its_temporaries() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!(".a.obj.tmp-{}-1-0", host::tag()));
        fs::write(&path, "").unwrap();
        assert_eq!(sweep(folder.path()).unwrap(), 0, "process 1 lives");
        let path = folder.path().join(format!(".a.obj.tmp-{}-4294967294-0", host::tag()));
        let file = File::create(&path).unwrap();
        file.try_lock().unwrap();
        assert_eq!(sweep(folder.path()).unwrap(), 0, "its lock is held");
        drop(file);
        assert_eq!(sweep(folder.path()).unwrap(), 1);
    }
}
