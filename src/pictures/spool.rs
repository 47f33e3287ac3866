//! Frames on disk until all are known: a movie has one camera, which depends on the last frame too.
//!
//! Guarantees: memory holds one frame; the file has no name, so a killed cook leaves nothing. Limit: it takes about as
//! much disk as the outputs in the folder it lies in.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::sync::Arc;

use engine::geometry::Geometry;
use engine::time::Frame;

use super::moments::Shot;

/// Geometry of frames in a temporary file.
pub(super) struct Spool {
    file: BufWriter<File>,
    end: u64,
    /// Offset and length of each output at each frame.
    entries: BTreeMap<Frame, BTreeMap<usize, (u64, usize)>>,
}

impl Spool {
    /// A new file in `folder`.
    ///
    /// # Errors
    /// If it cannot be created.
    pub(super) fn create(folder: &Path) -> io::Result<Self> {
        Ok(Self { file: BufWriter::new(tempfile::tempfile_in(folder)?), end: 0, entries: BTreeMap::new() })
    }

    /// Appends an output at a frame.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn add(&mut self, frame: Frame, output: usize, geometry: &Geometry) -> io::Result<()> {
        let bytes = geometry.to_bytes();
        self.file.write_all(&bytes)?;
        self.entries.entry(frame).or_default().insert(output, (self.end, bytes.len()));
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// The frames in it, ascending.
    pub(super) fn frames(&self) -> Vec<Frame> {
        self.entries.keys().copied().collect()
    }

    /// Everything of a frame.
    ///
    /// # Errors
    /// If it cannot be read back.
    pub(super) fn read(&mut self, frame: Frame) -> io::Result<Shot> {
        self.file.flush()?;
        let mut shot = Shot::new();
        for (output, (offset, length)) in self.entries.get(&frame).into_iter().flatten() {
            let mut bytes = vec![0; *length];
            let file = self.file.get_mut();
            file.seek(SeekFrom::Start(*offset))?;
            file.read_exact(&mut bytes)?;
            let geometry = Geometry::from_bytes(&bytes).ok_or(io::ErrorKind::InvalidData)?;
            shot.insert(*output, Arc::new(geometry));
        }
        Ok(shot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::Component;

    #[test]
    fn frames_read_back_and_the_folder_stays_empty() {
        let folder = tempfile::tempdir().unwrap();
        let mut spool = Spool::create(folder.path()).unwrap();
        let points = |x: f32| Geometry::from(Component::points(vec![[x, 0.0, 1.0]]));
        for frame in [1, 2, 3] {
            spool.add(Frame::whole(frame), 0, &points(frame as f32)).unwrap();
            spool.add(Frame::whole(frame), 4, &points(-1.0)).unwrap();
        }
        assert_eq!(spool.frames(), [1, 2, 3].map(Frame::whole));
        let shot = spool.read(Frame::whole(2)).unwrap();
        assert_eq!(shot[&0].points().unwrap().positions(), [[2.0, 0.0, 1.0]]);
        assert_eq!(shot[&4].points().unwrap().positions(), [[-1.0, 0.0, 1.0]]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
