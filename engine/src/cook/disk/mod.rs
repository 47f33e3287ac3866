//! The cache on disk: checkpoints of solvers and finished frames of outputs, so that a killed cook resumes.
//!
//! Every file is written beside its name and renamed, carries its format and a checksum, and is ignored where either does
//! not fit: whatever a cache holds, a cook's results are those of a cook without it.

mod bytes;

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::geometry::Geometry;
use crate::key::ContentKey;

/// Changes whenever files of an older convect can no longer be used.
const FORMAT: &str = concat!("convect ", env!("CARGO_PKG_VERSION"), " cache 4");

/// Which checkpoints of a solver stay: the last two, and those of every eighth frame.
const EVERY: i64 = 8;

/// A folder with checkpoints and finished frames.
pub struct DiskCache {
    folder: PathBuf,
    limit: u64,
    /// Recent checkpoints of each node, oldest first.
    recent: BTreeMap<String, Vec<(i64, PathBuf)>>,
    /// Whether it could not be written: nothing more is kept then, but what is there is still taken.
    is_broken: bool,
    notes: Vec<String>,
}

/// A metric that belongs to a finished frame: the key of the result it was published with, its name and value.
pub(crate) type KeptMetric = (ContentKey, String, f64);

impl DiskCache {
    /// Opens a cache, making the folder where it is missing. One that another version made is emptied, and on a full disk
    /// nothing is kept, with a note.
    ///
    /// # Errors
    /// Where the folder cannot be made, read or written.
    pub fn open(folder: &Path, limit: u64) -> io::Result<Self> {
        let recent = BTreeMap::new();
        let mut cache = Self { folder: folder.to_owned(), limit, recent, is_broken: false, notes: Vec::new() };
        match cache.prepare() {
            Err(error) if matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded) => {
                cache.give_up(&error);
            }
            prepared => prepared?,
        }
        Ok(cache)
    }

    fn prepare(&mut self) -> io::Result<()> {
        let folder = &self.folder;
        fs::create_dir_all(folder)?;
        let mark = folder.join("version");
        let is_ours = match fs::read_to_string(&mark) {
            Ok(text) if text == FORMAT => true,
            Ok(_) => {
                let note = format!("the cache `{}` was made by another version and is not used", folder.display());
                self.notes.push(note);
                for (path, _, _) in files(folder)? {
                    fs::remove_file(path)?;
                }
                false
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => false,
            Err(error) => return Err(error),
        };
        sweep(folder)?;
        if !is_ours {
            write_whole(&mark, FORMAT.as_bytes())?;
        }
        self.trim()
    }

    /// What is worth telling: about the cache that was found, and whether it could be written.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Keeps nothing more. A cook can do without its cache.
    fn give_up(&mut self, error: &io::Error) {
        let folder = self.folder.display();
        let why = match error.kind() {
            io::ErrorKind::StorageFull => "the disk is full".to_owned(),
            _ => error.to_string(),
        };
        self.notes.push(format!("the cache `{folder}` could not be written: {why}; cooking continues without it"));
        self.is_broken = true;
    }

    /// Writes, unless that failed before.
    fn keep(&mut self, write: impl FnOnce(&mut Self) -> io::Result<()>) {
        if !self.is_broken
            && let Err(error) = write(self)
        {
            self.give_up(&error);
        }
    }

    fn path(&self, kind: &str, key: ContentKey) -> PathBuf {
        self.folder.join(format!("{key}.{kind}"))
    }

    /// The state a solver was saved in under that key.
    pub(crate) fn checkpoint(&self, key: ContentKey) -> Option<Vec<u8>> {
        read_entry(&self.path("checkpoint", key), key)
    }

    /// Saves a solver's state, and removes older ones that need not stay.
    pub(crate) fn save_checkpoint(&mut self, node: &str, frame: i64, key: ContentKey, state: &[u8]) {
        let path = self.path("checkpoint", key);
        self.keep(|cache| {
            write_entry(&path, key, state)?;
            let recent = cache.recent.entry(node.to_owned()).or_default();
            recent.push((frame, path));
            if recent.len() > 2 {
                let (frame, path) = recent.remove(0);
                if frame % EVERY != 0 {
                    remove_if_there(&path)?;
                }
            }
            cache.trim()
        });
    }

    /// A finished frame of an output, and the metrics that were kept with it.
    pub(crate) fn frame(&self, key: ContentKey) -> Option<(Geometry, Vec<KeptMetric>)> {
        bytes::decode(&read_entry(&self.path("frame", key), key)?)
    }

    /// Keeps a finished frame of an output, and the metrics of what went into it.
    pub(crate) fn save_frame(&mut self, key: ContentKey, geometry: &Geometry, metrics: &[KeptMetric]) {
        let path = self.path("frame", key);
        self.keep(|cache| {
            write_entry(&path, key, &bytes::encode(geometry, metrics))?;
            cache.trim()
        });
    }

    /// Removes the oldest files while there are more bytes than the limit.
    fn trim(&mut self) -> io::Result<()> {
        if self.limit == u64::MAX {
            return Ok(());
        }
        let mut files = files(&self.folder)?;
        files.sort_by(|(a, _, s), (b, _, t)| s.cmp(t).then(a.cmp(b)));
        let mut total: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
        for (path, bytes, _) in files {
            if total <= self.limit {
                break;
            }
            remove_if_there(&path)?;
            total -= bytes;
        }
        Ok(())
    }
}

fn files(folder: &Path) -> io::Result<Vec<(PathBuf, u64, SystemTime)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let ours = path.extension().is_some_and(|e| e == "checkpoint" || e == "frame" || e == "part");
        if ours && let Ok(facts) = fs::metadata(&path) {
            found.push((path, facts.len(), facts.modified().unwrap_or(SystemTime::UNIX_EPOCH)));
        }
    }
    Ok(found)
}

/// Removes what processes that are gone were writing. Where the system does not tell who lives, it stays until the limit
/// takes it.
fn sweep(folder: &Path) -> io::Result<()> {
    let proc = Path::new("/proc");
    if !proc.join("self").exists() {
        return Ok(());
    }
    for (path, _, _) in files(folder)? {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let owner =
            name.strip_suffix(".part").and_then(|name| name.rsplit_once('.')).map(|(_, owner)| owner.to_owned());
        if owner.is_some_and(|owner| owner.parse::<u32>().is_ok() && !proc.join(owner).exists()) {
            remove_if_there(&path)?;
        }
    }
    Ok(())
}

fn remove_if_there(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Writes an entry, in front of it a checksum of its key and itself: what was damaged or exchanged is not taken.
fn write_entry(path: &Path, key: ContentKey, bytes: &[u8]) -> io::Result<()> {
    write_whole(path, &[checksum(key, bytes).as_bytes().as_slice(), bytes].concat())
}

fn read_entry(path: &Path, key: ContentKey) -> Option<Vec<u8>> {
    let bytes = fs::read(path).ok()?;
    let (sum, rest) = bytes.split_at_checked(blake3::OUT_LEN)?;
    (checksum(key, rest).as_bytes().as_slice() == sum).then(|| rest.to_vec())
}

fn checksum(key: ContentKey, bytes: &[u8]) -> blake3::Hash {
    blake3::Hasher::new().update(&key.0).update(bytes).finalize()
}

/// Writes beside the name and renames. Killed at any moment, the name holds nothing or all.
fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let part = PathBuf::from(part);
    fs::write(&part, bytes).and_then(|()| fs::rename(&part, path)).inspect_err(|_| drop(fs::remove_file(&part)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Column, Component, ENVELOPE, Grid, Owner, SHIELDED, Volume};

    fn sample() -> Geometry {
        let mut curves = Component::curves(vec![2, 1], vec![[0.1, -0.0, 1e-40], [1.0; 3], [2.0; 3]]).unwrap();
        curves.set(ENVELOPE, vec![0.5, 1.0, 0.25]).unwrap();
        curves.set(SHIELDED, vec![0.5, 0.0]).unwrap();
        curves.set_column(Owner::Once, "step", Column::new(vec![[1, 2, 3]])).unwrap();
        let mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3]; 3]).unwrap();
        let tets = Component::tets(vec![[0, 1, 2, 3]], vec![[0.0; 3]; 4]).unwrap();
        let grid = Grid { origin: [1.0, 2.0, 3.0], cell: 0.5, size: [1, 1, 2] };
        let volume = Volume::new(grid, vec![0.5, -0.5], [vec![1.0; 4], vec![2.0; 4], vec![3.0; 3]]).unwrap();
        let mut geometry = Geometry::from(curves).with(mesh).with(tets).with(Component::points(vec![[9.0; 3]]));
        geometry.put_volume(volume);
        geometry
    }

    #[test]
    fn a_geometry_comes_back_bit_for_bit() {
        let geometry = sample();
        let bytes = bytes::encode(&geometry, &[]);
        let (back, _) = bytes::decode(&bytes).unwrap();
        assert_eq!(back, geometry);
        assert_eq!(bytes::encode(&back, &[]), bytes);
    }

    #[test]
    fn a_file_cut_anywhere_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), u64::MAX).unwrap();
        let key = ContentKey::of(b"a");
        let metrics = [(ContentKey::of(b"node"), "max_angle".to_owned(), 0.1)];
        cache.save_frame(key, &sample(), &metrics);
        let path = cache.path("frame", key);
        let whole = fs::read(&path).unwrap();
        assert_eq!(cache.frame(key).unwrap(), (sample(), metrics.to_vec()));
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(cache.frame(key).is_none(), "{length} bytes");
        }
    }

    #[test]
    fn exchanged_files_are_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), u64::MAX).unwrap();
        let (a, b) = (ContentKey::of(b"a"), ContentKey::of(b"b"));
        cache.save_frame(a, &sample(), &[]);
        fs::rename(cache.path("frame", a), cache.path("frame", b)).unwrap();
        assert!(cache.frame(b).is_none());
    }

    #[test]
    fn the_last_two_checkpoints_and_every_eighth_stay() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), u64::MAX).unwrap();
        let key = |frame: i64| ContentKey::of(&frame.to_le_bytes());
        for frame in 1..=20 {
            cache.save_checkpoint("body", frame, key(frame), &[1, 2, 3]);
        }
        let stay: Vec<i64> = (1..=20).filter(|frame| cache.checkpoint(key(*frame)).is_some()).collect();
        assert_eq!(stay, [8, 16, 19, 20]);
    }

    #[test]
    fn a_limit_removes_the_oldest() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), 3 * 132).unwrap();
        for frame in 0..10_i64 {
            cache.save_checkpoint("body", frame * 8, ContentKey::of(&frame.to_le_bytes()), &[0; 100]);
        }
        let left = files(folder.path()).unwrap();
        assert!(left.len() <= 3 && !left.is_empty(), "{}", left.len());
    }

    #[test]
    fn a_cache_of_another_version_is_not_used_and_said() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), u64::MAX).unwrap();
        cache.save_frame(ContentKey::of(b"a"), &sample(), &[]);
        fs::write(folder.path().join("version"), "convect 0.0.1 cache 0").unwrap();
        let cache = DiskCache::open(folder.path(), u64::MAX).unwrap();
        assert!(cache.notes()[0].ends_with("was made by another version and is not used"));
        assert!(cache.frame(ContentKey::of(b"a")).is_none());
    }

    #[test]
    fn a_cache_that_cannot_be_written_is_given_up_once() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("cache");
        let mut cache = DiskCache::open(&place, u64::MAX).unwrap();
        cache.save_frame(ContentKey::of(b"a"), &sample(), &[]);
        fs::rename(&place, folder.path().join("gone")).unwrap();
        for key in [b"b", b"c"] {
            cache.save_frame(ContentKey::of(key), &sample(), &[]);
            cache.save_checkpoint("body", 1, ContentKey::of(key), &[1]);
        }
        assert_eq!(cache.notes().len(), 1, "{:?}", cache.notes());
        assert!(cache.notes()[0].contains("could not be written"), "{:?}", cache.notes());
        fs::rename(folder.path().join("gone"), &place).unwrap();
        assert!(cache.frame(ContentKey::of(b"a")).is_some() && cache.frame(ContentKey::of(b"b")).is_none());
    }
}
