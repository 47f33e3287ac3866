//! The cache on disk: states of solvers and windows, finished frames of outputs and results of nodes, so that a killed cook
//! resumes and a changed graph cooks only what changed.
//!
//! Several processes and versions share a cache folder: each version owns one subfolder (`folder`). An entry is written
//! beside its name and renamed, and is ignored if it is not whole (`entry`). Whatever lies in a cache, a cook's results
//! are those of a cook without it, and whatever goes wrong with it is a note.

mod bytes;
mod entry;
mod folder;

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use self::folder::{CHECKPOINT, FRAME, Folder, RESULT, remove_if_there};
use super::store::Cooked;
use crate::geometry::Geometry;
use crate::key::ContentKey;

/// Whose state a checkpoint holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum StateOf {
    /// The last two stay, and those of every eighth frame: later frames need the state at an earlier one.
    Solver,
    /// The last two of both states that run side by side stay: any other frame has a window of its own.
    Window,
}

impl StateOf {
    fn last_staying(self) -> usize {
        match self {
            Self::Solver => 2,
            Self::Window => 4,
        }
    }

    fn stays(self, frame: i64) -> bool {
        self == Self::Solver && frame % 8 == 0
    }
}

/// Nanoseconds of cooking that make a byte of a result worth keeping: twice what writing and reading it takes.
const COST_PER_BYTE: u32 = 2;

/// Nanoseconds that reading a byte of a result takes.
const READ_PER_BYTE: u32 = 1;

/// What a result must take at least to be kept: an entry is a file.
const LEAST_COST: Duration = Duration::from_millis(1);

/// How much more warming a window up again must take than a result to be worth saving its state: it is needed only where
/// a cook is interrupted, and the next one replaces it.
const STATE_COST: u32 = 4;

/// A folder with checkpoints, finished frames and results.
pub struct DiskCache {
    /// As the user gave it.
    name: PathBuf,
    folder: Folder,
    /// Checkpoints that were there when it was opened, and those saved since.
    checkpoints: BTreeSet<ContentKey>,
    /// Recent checkpoints of each node, oldest first.
    recent: BTreeMap<(String, StateOf), Vec<(i64, PathBuf)>>,
    /// Whether there is a folder to read from.
    is_there: bool,
    /// Whether it could not be written: nothing more is kept then, but what is there is still taken.
    is_broken: bool,
    /// Whether results are kept whatever they cost.
    keeps_all: bool,
    notes: Vec<String>,
    /// The first entry that was there and could not be used, and how many there were.
    unusable: Option<(String, u64)>,
}

/// A metric that belongs to a finished frame: the key of the result it was published with, its name and value.
pub(crate) type KeptMetric = (ContentKey, String, f64);

impl DiskCache {
    /// Opens a cache, making its folder if it is missing, with room for `limit` bytes. If that fails nothing is kept,
    /// with a note.
    pub fn open(cache: &Path, limit: u64) -> Self {
        let mut opened = Self {
            name: cache.to_owned(),
            folder: Folder::of(cache, limit),
            checkpoints: BTreeSet::new(),
            recent: BTreeMap::new(),
            is_there: false,
            is_broken: false,
            keeps_all: false,
            notes: Vec::new(),
            unusable: None,
        };
        let others = opened.folder.other_versions();
        if !others.is_empty() {
            let (cache, others) = (cache.display(), others.join("`, `"));
            opened
                .notes
                .push(format!("the cache `{cache}` was made by another version (`{others}`), which is not used"));
        }
        opened.keep(|cache| {
            cache.folder.prepare()?;
            cache.checkpoints = cache.folder.keys(CHECKPOINT)?;
            Ok(())
        });
        opened.is_there = opened.folder.is_there();
        opened
    }

    /// Keeps the results of all nodes, whatever they cost, so that tests need no expensive ones.
    #[must_use]
    pub fn keeping_all(mut self) -> Self {
        self.keeps_all = true;
        self
    }

    /// What is worth telling: about the cache that was found, and whether it could be read and written.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.notes.clone();
        if let Some((why, count)) = &self.unusable {
            let entries = if *count == 1 { "an entry".into() } else { format!("{count} entries") };
            let cache = self.name.display();
            notes.push(format!("{entries} of the cache `{cache}` could not be used; cooked again instead: {why}"));
        }
        notes
    }

    /// Keeps nothing more. A cook can do without its cache.
    fn give_up(&mut self, error: &io::Error) {
        let folder = self.name.display();
        let why = match error.kind() {
            io::ErrorKind::StorageFull => "the disk is full".to_owned(),
            io::ErrorKind::FileTooLarge => "an entry is larger than files may be here".to_owned(),
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

    /// Takes an entry; one that cannot be used counts as missing.
    fn read(&mut self, kind: &str, key: ContentKey) -> Option<Vec<u8>> {
        if !self.is_there {
            return None;
        }
        let path = self.folder.entry(kind, key);
        match entry::read(&path, key) {
            Ok(None) => None,
            Ok(Some(bytes)) => {
                self.folder.used(&path);
                Some(bytes)
            }
            Err(why) => {
                let first = || format!("`{}`: {why}", path.display());
                self.unusable.get_or_insert_with(|| (first(), 0)).1 += 1;
                None
            }
        }
    }

    fn write(&mut self, kind: &str, key: ContentKey, bytes: &[u8]) -> io::Result<()> {
        let size = entry::size(bytes.len());
        if !self.folder.holds(size) {
            return Ok(());
        }
        match entry::write(&self.folder.entry(kind, key), key, bytes) {
            // What has its name is not convect's, and concerns this entry alone.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            Err(error) => Err(error),
            Ok(()) => self.folder.added(size),
        }
    }

    /// Whether there are checkpoints at all: if not, no key need be found.
    pub(crate) fn has_checkpoints(&self) -> bool {
        !self.checkpoints.is_empty()
    }

    /// Whether there was a checkpoint under that key when the cache was opened, or one was saved since.
    pub(crate) fn has_checkpoint(&self, key: ContentKey) -> bool {
        self.checkpoints.contains(&key)
    }

    /// The state a node was saved in under that key.
    pub(crate) fn checkpoint(&mut self, of: (&str, StateOf), frame: i64, key: ContentKey) -> Option<Vec<u8>> {
        let state = self.read(CHECKPOINT, key)?;
        self.note_checkpoint(of, frame, key);
        Some(state)
    }

    /// Saves a node's state.
    pub(crate) fn save_checkpoint(&mut self, of: (&str, StateOf), frame: i64, key: ContentKey, state: &[u8]) {
        self.keep(|cache| cache.write(CHECKPOINT, key, state));
        self.checkpoints.insert(key);
        self.note_checkpoint(of, frame, key);
    }

    fn note_checkpoint(&mut self, (node, of): (&str, StateOf), frame: i64, key: ContentKey) {
        let path = self.folder.entry(CHECKPOINT, key);
        let recent = self.recent.entry((node.to_owned(), of)).or_default();
        recent.retain(|(_, known)| *known != path);
        recent.push((frame, path));
    }

    /// Removes checkpoints that need not stay, once the frames up to the last ones are finished: until then a cook that
    /// is killed resumes from an earlier one.
    pub(crate) fn prune_checkpoints(&mut self) {
        let mut old = Vec::new();
        for ((_, of), recent) in &mut self.recent {
            let before_last = recent.len().saturating_sub(of.last_staying());
            old.extend(recent.drain(..before_last).filter(|(frame, _)| !of.stays(*frame)));
        }
        self.keep(|_| old.iter().try_for_each(|(_, path)| remove_if_there(path)));
    }

    /// Whether a result of `bytes` that takes `cost` to make is worth its place.
    pub(crate) fn is_worth(&self, cost: Duration, bytes: usize) -> bool {
        self.keeps_all || cost > Duration::from_nanos(bytes as u64) * COST_PER_BYTE + LEAST_COST
    }

    /// Whether a state of `bytes` that takes `cost` to move to where it is again is worth its place.
    pub(crate) fn is_worth_state(&self, cost: Duration, bytes: usize) -> bool {
        self.is_worth(cost / STATE_COST, bytes)
    }

    /// About what it takes to read a result of `bytes`.
    pub(crate) fn read_in(bytes: usize) -> Duration {
        Duration::from_nanos(bytes as u64) * READ_PER_BYTE
    }

    /// A result of a node, and the metrics that were kept with it.
    pub(crate) fn result(&mut self, key: ContentKey) -> Option<(Cooked, Vec<KeptMetric>)> {
        bytes::decode_result(&self.read(RESULT, key)?)
    }

    /// Keeps a result of a node, and the metrics of what went into it.
    pub(crate) fn save_result(&mut self, key: ContentKey, cooked: &Cooked, metrics: &[KeptMetric]) {
        self.keep(|cache| cache.write(RESULT, key, &bytes::encode_result(cooked, metrics)));
    }

    /// A finished frame of an output, and the metrics that were kept with it.
    pub(crate) fn frame(&mut self, key: ContentKey) -> Option<(Geometry, Vec<KeptMetric>)> {
        bytes::decode(&self.read(FRAME, key)?)
    }

    /// Keeps a finished frame of an output, and the metrics of what went into it.
    pub(crate) fn save_frame(&mut self, key: ContentKey, geometry: &Geometry, metrics: &[KeptMetric]) {
        self.keep(|cache| cache.write(FRAME, key, &bytes::encode(geometry, metrics)));
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

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
        let mut cache = DiskCache::open(folder.path(), u64::MAX);
        let key = ContentKey::of(b"a");
        let metrics = [(ContentKey::of(b"node"), "max_angle".to_owned(), 0.1)];
        cache.save_frame(key, &sample(), &metrics);
        let path = cache.folder.entry(FRAME, key);
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
        let mut cache = DiskCache::open(folder.path(), u64::MAX);
        let (a, b) = (ContentKey::of(b"a"), ContentKey::of(b"b"));
        cache.save_frame(a, &sample(), &[]);
        fs::rename(cache.folder.entry(FRAME, a), cache.folder.entry(FRAME, b)).unwrap();
        assert!(cache.frame(b).is_none());
    }

    #[test]
    fn the_last_two_checkpoints_and_every_eighth_stay() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), u64::MAX);
        let key = |frame: i64| ContentKey::of(&frame.to_le_bytes());
        for frame in 1..=20 {
            cache.save_checkpoint(("body", StateOf::Solver), frame, key(frame), &[1, 2, 3]);
        }
        let staying = |cache: &mut DiskCache| -> Vec<i64> {
            (1..=20)
                .filter(|frame| cache.checkpoint(("body", StateOf::Solver), *frame, key(*frame)).is_some())
                .collect()
        };
        assert_eq!(staying(&mut cache).len(), 20, "until their frames are finished");
        cache.prune_checkpoints();
        assert_eq!(staying(&mut DiskCache::open(folder.path(), u64::MAX)), [8, 16, 19, 20]);
    }

    #[test]
    fn the_last_four_states_of_a_window_stay() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), u64::MAX);
        let key = |frame: i64| ContentKey::of(&frame.to_le_bytes());
        for frame in 1..=20 {
            cache.save_checkpoint(("swing", StateOf::Window), frame, key(frame), &[1, 2, 3]);
        }
        cache.prune_checkpoints();
        let cache = DiskCache::open(folder.path(), u64::MAX);
        let staying: Vec<i64> = (1..=20).filter(|frame| cache.has_checkpoint(key(*frame))).collect();
        assert_eq!(staying, [17, 18, 19, 20]);
    }

    #[test]
    fn a_limit_removes_the_oldest() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = DiskCache::open(folder.path(), 3 * 164);
        for frame in 0..10_i64 {
            cache.save_checkpoint(
                ("body", StateOf::Solver),
                frame * 8,
                ContentKey::of(&frame.to_le_bytes()),
                &[0; 100],
            );
        }
        let left = cache.folder.entries().unwrap();
        assert!(left.len() <= 3 && !left.is_empty(), "{}", left.len());
    }

    #[test]
    fn a_cache_that_cannot_be_written_is_given_up_once() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("cache");
        let mut cache = DiskCache::open(&place, u64::MAX);
        cache.save_frame(ContentKey::of(b"a"), &sample(), &[]);
        fs::rename(&place, folder.path().join("gone")).unwrap();
        for key in [b"b", b"c"] {
            cache.save_frame(ContentKey::of(key), &sample(), &[]);
            cache.save_checkpoint(("body", StateOf::Solver), 1, ContentKey::of(key), &[1]);
        }
        assert_eq!(cache.notes().len(), 1, "{:?}", cache.notes());
        assert!(cache.notes()[0].contains("could not be written"), "{:?}", cache.notes());
        fs::rename(folder.path().join("gone"), &place).unwrap();
        assert!(cache.frame(ContentKey::of(b"a")).is_some() && cache.frame(ContentKey::of(b"b")).is_none());
    }
}
