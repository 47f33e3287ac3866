//! USD files, `.usda` (text) and `.usdc` (crate 0.8.0), written without Pixar's library.
//!
//! A [`UsdWriter`] takes one geometry per frame and keeps no more than one in memory, beside 8 bytes per attribute and
//! frame. An array that equals its attribute's last one, by address or else bit for bit, is stored once; what never
//! changes becomes a default instead of time samples. Both flavours are written from one description of the stage
//! (`layout` says which array becomes which attribute, `stage` what a flavour is told), and every f32 and i32 comes
//! back bit for bit, but a NaN's payload from text. The limits: a volume is refused, a USD attribute has one type
//! through all frames, and nothing is readable before [`UsdWriter::finish`].
//!
//! What a reader finds, for an output called NAME:
//! * `/NAME` (Xform, the default prim; moved to the scene's origin where it has one) with `curves` (BasisCurves, linear),
//!   `mesh`, `points` and `tets` under it; metres, Y up, time code = frame.
//! * A frame without a component has one with no points and no elements; a frame without an attribute that other frames
//!   have holds a value block. Empty arrays rather than blocks for a component, because a reader that keeps its last
//!   value at a block would keep showing what is gone.
//! * `velocities` have samples wherever `points` have, even if they never change: USD uses them only then.
//! * An attribute or output whose name is not an ASCII identifier gets one (`names`), with its own as `displayName`.
//!
//! Blender 4.5 reads all of it, and warns only of `int3` and `int4` attributes of curves and meshes, types it does not
//! have.

mod coding;
mod extent;
mod layout;
mod names;
mod recorder;
mod stage;
mod structure;
mod surface;
mod usda;
mod usdc;

use std::io::{self, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use engine::geometry::{ColumnType, Geometry, Kind, Name};

use crate::atomic::{AtomicFile, FileError};
use recorder::{Header, Recorder};
use stage::Encoder;

/// Which of the two file formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Flavour {
    /// Text: for reading and for tools; about ten characters per number.
    Usda,
    /// Binary: four bytes per number, read without copying.
    Usdc,
}

/// What a finished file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Length of the file.
    pub bytes: u64,
    /// Frames in it.
    pub frames: usize,
    /// Arrays that were stored.
    pub stored: u64,
    /// Arrays that were not, as they equalled their attribute's last.
    pub shared: u64,
}

/// A USD file being written: one geometry per frame, then [`UsdWriter::finish`]. Dropped before that, it leaves nothing.
pub struct UsdWriter {
    path: PathBuf,
    recorder: Recorder<AtomicFile>,
}

impl UsdWriter {
    /// Starts the file at `path`, which appears only when it is finished.
    ///
    /// `name` is the output's name, `fps` the frames (and time codes) per second, `origin` the scene's in metres, to
    /// which positions are relative.
    ///
    /// # Errors
    /// Where the file cannot be created, or `fps` is not a positive number.
    pub fn create(
        path: impl Into<PathBuf>,
        flavour: Flavour,
        name: &str,
        fps: f64,
        origin: [f64; 3],
    ) -> Result<Self, UsdError> {
        let path = path.into();
        if !(fps.is_finite() && fps > 0.0) {
            return Err(UsdError::Refused { path, fault: UsdFault::Fps { fps } });
        }
        let file = AtomicFile::create(&path)?;
        let encoder: Box<dyn Encoder<AtomicFile>> = match flavour {
            Flavour::Usda => {
                let spool = tempfile::tempfile_in(folder_of(&path)).map_err(|source| file.failed(source))?;
                Box::new(usda::Writer::new(file, spool))
            }
            Flavour::Usdc => Box::new(usdc::Writer::new(file).map_err(|source| written(&path, source))?),
        };
        Ok(Self { path, recorder: Recorder::new(encoder, Header { name: name.into(), fps, origin }) })
    }

    /// Adds a frame. Time codes are frame numbers, whole or not, each greater than the one before.
    ///
    /// # Errors
    /// Where the file cannot be written, the frame does not follow the last one, the geometry has a volume, or an attribute changed its
    /// type. After a refused frame the writer is as it was before; after a failed write it only fails.
    pub fn frame(&mut self, time_code: f64, geometry: &Geometry) -> Result<(), UsdError> {
        self.recorder.frame(time_code, geometry).map_err(|fault| located(&self.path, fault))
    }

    /// Writes what describes the arrays, syncs the file to disk and renames it. A file without frames is valid: an
    /// empty `/NAME`.
    ///
    /// # Errors
    /// Where the file cannot be written, or an earlier write failed; nothing is left behind then.
    pub fn finish(self) -> Result<Summary, UsdError> {
        let Self { path, recorder } = self;
        let (mut file, counts) = recorder.finish().map_err(|fault| located(&path, fault))?;
        let bytes = file.seek(SeekFrom::End(0)).map_err(|source| written(&path, source))?;
        file.commit()?;
        Ok(Summary { bytes, frames: counts.frames, stored: counts.stored, shared: counts.shared })
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn written(path: &Path, source: io::Error) -> FileError {
    FileError::new(path, "written", source)
}

fn located(path: &Path, fault: recorder::Fault) -> UsdError {
    match fault {
        recorder::Fault::Write(source) => written(path, source).into(),
        recorder::Fault::Refused(fault) => UsdError::Refused { path: path.to_path_buf(), fault },
    }
}

/// Why a USD file was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UsdError {
    /// The file system said no.
    #[error(transparent)]
    File(#[from] FileError),
    /// What was given cannot be put into a USD file.
    #[error("`{}` could not be written: {fault}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// What cannot be put into it.
        fault: UsdFault,
    },
}

/// What a USD file cannot hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UsdFault {
    /// Frames per second that are none.
    #[error("`fps` is {fps}, expected a positive number")]
    Fps {
        /// What was given.
        fps: f64,
    },
    /// A frame number that is none.
    #[error("the frame number is {time}, expected a finite number")]
    Time {
        /// What was given.
        time: f64,
    },
    /// A frame that does not come after the last one.
    #[error("frame {time} follows frame {last}, expected frames in ascending order")]
    Order {
        /// The frame.
        time: f64,
        /// The frame before it.
        last: f64,
    },
    /// A volume.
    #[error("frame {time} has a `volume`, which usda and usdc cannot hold; json can")]
    Volume {
        /// The frame.
        time: f64,
    },
    /// More points or corners than an `int` counts.
    #[error("`{kind}` has {rows} points or corners at frame {time}, expected at most 2,147,483,647")]
    TooMany {
        /// Component.
        kind: Kind,
        /// Rows it has.
        rows: usize,
        /// The frame.
        time: f64,
    },
    /// An attribute with another type than in the frames before.
    #[error(
        "`{name}` of `{kind}` is {found} at frame {time} and was {expected} before; a USD attribute has one type in all frames"
    )]
    Type {
        /// Attribute.
        name: Name,
        /// Component.
        kind: Kind,
        /// Type it has now.
        found: ColumnType,
        /// Type it had.
        expected: ColumnType,
        /// The frame.
        time: f64,
    },
}

#[cfg(test)]
mod tests;
