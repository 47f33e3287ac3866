//! The subfolder of a cache that this version of convect owns. Nothing outside it is read, written or removed, and of
//! what lies in it only what has the name of an entry or of a temporary.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::clock;
use crate::key::ContentKey;

/// The subfolder. It changes whenever entries of an older convect can no longer be used.
pub(super) const NAME: &str = concat!("convect-", env!("CARGO_PKG_VERSION"), "-cache-5");

/// The names of all such subfolders start with this.
const ANY_VERSION: &str = "convect-";

/// Temporaries that nobody has written to for so long are left-overs: an entry takes seconds. Their process number
/// says nothing, as it may be that of another machine.
const LEFT_OVER: Duration = Duration::from_secs(3600);

/// The kinds of entries, which are the extensions of their names.
pub(super) const CHECKPOINT: &str = "checkpoint";
pub(super) const FRAME: &str = "frame";
pub(super) const RESULT: &str = "result";

/// The subfolder, and the most bytes to keep there.
pub(super) struct Folder {
    path: PathBuf,
    limit: u64,
    /// Bytes there when it was last listed, and those added since; other processes add to it too.
    listed: u64,
    added: u64,
}

impl Folder {
    /// The subfolder of `cache`, not yet made.
    pub(super) fn of(cache: &Path, limit: u64) -> Self {
        Self { path: cache.join(NAME), limit, listed: 0, added: 0 }
    }

    /// Makes the subfolder and removes what is too much or left over.
    ///
    /// # Errors
    /// If it cannot be made or listed, or is not a folder.
    pub(super) fn prepare(&mut self) -> io::Result<()> {
        let cache = self.path.parent().unwrap_or(Path::new("."));
        if fs::metadata(cache).is_ok_and(|there| !there.is_dir()) {
            return Err(io::Error::other("it is not a folder"));
        }
        fs::create_dir_all(cache)?;
        match fs::create_dir(&self.path) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
            _ => {}
        }
        if !self.is_there() {
            return Err(io::Error::other(format!("`{}` is not a folder", self.path.display())));
        }
        self.sweep()?;
        self.trim()
    }

    /// Whether the subfolder is one, and not a link to another.
    pub(super) fn is_there(&self) -> bool {
        fs::symlink_metadata(&self.path).is_ok_and(|there| there.is_dir())
    }

    /// The subfolders of other versions, if this version has none yet.
    pub(super) fn other_versions(&self) -> Vec<String> {
        let cache = self.path.parent().unwrap_or(Path::new("."));
        if self.path.exists() {
            return Vec::new();
        }
        let names = fs::read_dir(cache).into_iter().flatten().flatten().filter_map(|entry| {
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            entry.file_name().into_string().ok().filter(|name| is_folder && name.starts_with(ANY_VERSION))
        });
        let mut names: Vec<String> = names.filter(|name| name.contains("-cache-")).collect();
        names.sort();
        names
    }

    /// Where the entry of that key lies.
    pub(super) fn entry(&self, kind: &str, key: ContentKey) -> PathBuf {
        self.path.join(format!("{key}.{kind}"))
    }

    /// Whether an entry of that size may be kept.
    pub(super) fn holds(&self, bytes: u64) -> bool {
        bytes <= self.limit
    }

    /// Marks an entry as used, so that it is removed late.
    pub(super) fn used(&self, path: &Path) {
        if self.limit < u64::MAX
            && let Ok(file) = fs::File::options().append(true).open(path)
        {
            // It may belong to another user: then its age stays.
            let _ = file.set_modified(clock::now());
        }
    }

    /// Counts a new entry, and removes the entries unused for longest where there is more than the limit.
    ///
    /// # Errors
    /// If the subfolder cannot be listed, or an entry cannot be removed.
    pub(super) fn added(&mut self, bytes: u64) -> io::Result<()> {
        self.added += bytes;
        // Others fill the folder too; listing it for every entry would cost more than the entry.
        let is_due = self.added > self.limit / 16 || self.listed.saturating_add(self.added) > self.limit;
        if is_due { self.trim() } else { Ok(()) }
    }

    fn trim(&mut self) -> io::Result<()> {
        if self.limit == u64::MAX {
            return Ok(());
        }
        let mut entries = self.entries()?;
        entries.sort_by(|(a, _, s), (b, _, t)| s.cmp(t).then(a.cmp(b)));
        let mut total: u64 = entries.iter().map(|(_, bytes, _)| bytes).sum();
        for (path, bytes, _) in entries {
            if total <= self.limit {
                break;
            }
            remove_if_there(&path)?;
            total -= bytes;
        }
        (self.listed, self.added) = (total, 0);
        Ok(())
    }

    /// Files with the name of an entry: path, size, when it was last used.
    pub(super) fn entries(&self) -> io::Result<Vec<(PathBuf, u64, SystemTime)>> {
        self.files(is_entry)
    }

    /// The keys of the entries of one kind.
    ///
    /// # Errors
    /// If the subfolder cannot be listed.
    pub(super) fn keys(&self, kind: &str) -> io::Result<BTreeSet<ContentKey>> {
        let key = |path: &Path| {
            let name = path.file_name()?.to_str()?;
            ContentKey::parse(name.strip_suffix(kind)?.strip_suffix('.')?)
        };
        Ok(self.entries()?.iter().filter_map(|(path, ..)| key(path)).collect())
    }

    fn files(&self, is_ours: impl Fn(&str) -> bool) -> io::Result<Vec<(PathBuf, u64, SystemTime)>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.path)? {
            let entry = entry?;
            // Of the entry itself, not of what a link leads to.
            let Ok(facts) = entry.metadata() else { continue };
            if facts.is_file() && entry.file_name().to_str().is_some_and(&is_ours) {
                found.push((entry.path(), facts.len(), facts.modified().unwrap_or(SystemTime::UNIX_EPOCH)));
            }
        }
        Ok(found)
    }

    fn sweep(&self) -> io::Result<()> {
        let now = clock::now();
        for (path, _, modified) in self.files(is_temporary)? {
            if now.duration_since(modified).is_ok_and(|age| age > LEFT_OVER) {
                remove_if_there(&path)?;
            }
        }
        Ok(())
    }
}

/// `KEY.KIND`.
fn is_entry(name: &str) -> bool {
    name.split_once('.')
        .is_some_and(|(key, kind)| ContentKey::parse(key).is_some() && [CHECKPOINT, FRAME, RESULT].contains(&kind))
}

/// `.KEY.KIND.HOST-PID-RANDOM.part`.
fn is_temporary(name: &str) -> bool {
    let inner = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
    inner
        .and_then(|inner| inner.rsplit_once('.'))
        .is_some_and(|(entry, owner)| is_entry(entry) && owner.split('-').count() == 3)
}

pub(super) fn remove_if_there(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
