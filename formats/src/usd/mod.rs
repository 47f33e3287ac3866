//! USD files without Pixar's library: `.usda` (text) and `.usdc` (crate 0.8.0) written, and read by [`UsdStage`].
//!
//! A [`UsdWriter`] is given one geometry per frame, or one for each of several outputs, and keeps only the last one in memory, plus 8 bytes per attribute
//! and frame. An array that equals the previous one of its attribute, by address or bit for bit, is stored once; what
//! never changes is written as a default value instead of time samples, unless [`UsdWriter::sample_all`] is called. Both file formats are written from one
//! description of the stage (`layout` maps arrays to attributes, `stage` is the description), and every f32 and i32 is
//! read back bit for bit, except the payload of a NaN in text. Limits: a volume is refused, a USD attribute has one
//! type in all frames, and nothing is readable before [`UsdWriter::finish`].
//!
//! The content of a file, for an output called NAME:
//! * `/NAME` (Xform, the default prim; translated to the scene's origin if it has one) with `curves` (BasisCurves,
//!   linear), `mesh`, `points` and `tets` under it; metres, Y up, time code = frame.
//! * With several outputs in one stage, each is an Xform `/NAME/OUTPUT` with its components under it.
//! * In a frame without a component its arrays are empty; in a frame without an attribute that other frames have, it is
//!   a value block. Components are not blocked, because a reader that keeps the last value at a block would keep showing
//!   them.
//! * Curves without `width` get a width of 0.001 m ([`lacks_width`]): for all of them if no frame has widths, otherwise
//!   for each CV of the frames without. Readers would take 1 m.
//! * `velocities` have samples at the same times as `points`, even if they never change: USD uses them only then.
//! * An attribute or output whose name is not an ASCII identifier gets one (`names`), with its own as `displayName`.
//!
//! Blender 4.5 reads all of it, and warns only about `int3` and `int4` attributes of curves and meshes, types that it
//! does not have.

mod coding;
mod extent;
mod layout;
mod names;
mod read;
mod recorder;
mod stage;
mod structure;
mod surface;
mod usda;
mod usdc;

use std::io::{self, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use engine::geometry::{ColumnType, Geometry, Kind, Name, WIDTH};

use crate::atomic::{AtomicFile, FileError};
use recorder::{Header, Recorder};
use stage::Encoder;

pub use layout::DEFAULT_WIDTH;
pub use read::{ClipPiece, NoAssets, UsdAssets, UsdReading, UsdStage};

/// The two file formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Flavour {
    /// Text, for people and tools; about ten characters per number.
    Usda,
    /// Binary: four bytes per number, read without copying.
    Usdc,
}

/// Statistics of a finished file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Length of the file.
    pub bytes: u64,
    /// Frames in it.
    pub frames: usize,
    /// Arrays that were stored.
    pub stored: u64,
    /// Arrays that were not stored, because they equalled the previous ones of their attributes.
    pub shared: u64,
}

/// A USD file being written: one geometry per frame, then [`UsdWriter::finish`]. Dropped before that, it leaves
/// nothing.
pub struct UsdWriter {
    path: PathBuf,
    recorder: Recorder<AtomicFile>,
}

impl UsdWriter {
    /// Starts the file at `path`, which appears only when it is finished.
    ///
    /// `name` is the output's name, `fps` the frames (and time codes) per second, and `origin` the scene's origin in
    /// metres, to which positions are relative.
    ///
    /// # Errors
    /// If the file cannot be created, or `fps` is not a positive number.
    pub fn create(
        path: impl Into<PathBuf>,
        flavour: Flavour,
        name: &str,
        fps: f64,
        origin: [f64; 3],
    ) -> Result<Self, UsdError> {
        Self::create_set(path, flavour, (name, &[]), fps, origin)
    }

    /// Like [`UsdWriter::create`], for a stage with several geometries: each has a prim of its own under the root, of those
    /// names in `set`, and [`UsdWriter::frames`] takes them in that order. Without names it is a stage of one.
    ///
    /// # Errors
    /// As for [`UsdWriter::create`].
    pub fn create_set(
        path: impl Into<PathBuf>,
        flavour: Flavour,
        set: (&str, &[&str]),
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
        let members = set.1.iter().map(|name| (*name).to_owned()).collect();
        let header = Header { name: set.0.into(), fps, origin, members };
        Ok(Self { path, recorder: Recorder::new(encoder, header) })
    }

    /// Adds a frame. Time codes are frame numbers, whole or not, each greater than the one before.
    ///
    /// # Errors
    /// If the file cannot be written, the frame does not follow the last one, the geometry has a volume, or an
    /// attribute changed its type. A refused frame does not change the writer; after a failed write all calls fail.
    pub fn frame(&mut self, time_code: f64, geometry: &Geometry) -> Result<(), UsdError> {
        self.frames(time_code, &[geometry])
    }

    /// Adds a frame of a stage with several geometries, one for each.
    ///
    /// # Errors
    /// As for [`UsdWriter::frame`]; and if there are not as many geometries as the stage has.
    pub fn frames(&mut self, time_code: f64, geometries: &[&Geometry]) -> Result<(), UsdError> {
        self.recorder.frame(time_code, geometries).map_err(|fault| located(&self.path, fault))
    }

    /// Writes time samples of every attribute, even of those that have one value in all frames. Parts of a sequence can
    /// be joined only if they sample the same attributes.
    pub fn sample_all(&mut self) {
        self.recorder.sample_all();
    }

    /// Writes the structure, syncs the file to disk and renames it. A file without frames is valid: an empty `/NAME`.
    ///
    /// # Errors
    /// If the file cannot be written, or an earlier write failed; the file is removed then.
    pub fn finish(self) -> Result<Summary, UsdError> {
        let Self { path, recorder } = self;
        let (mut file, counts) = recorder.finish().map_err(|fault| located(&path, fault))?;
        let bytes = file.seek(SeekFrom::End(0)).map_err(|source| written(&path, source))?;
        file.commit()?;
        Ok(Summary { bytes, frames: counts.frames, stored: counts.stored, shared: counts.shared })
    }
}

/// Whether a USD file gets a width for curves of `geometry` because they have none.
pub fn lacks_width(geometry: &Geometry) -> bool {
    geometry.curves().is_some_and(|curves| curves.point_count() > 0 && curves.get(WIDTH).is_none())
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
    /// An error of the file system.
    #[error(transparent)]
    File(#[from] FileError),
    /// The data cannot be stored in a USD file.
    #[error("`{}` could not be written: {fault}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// The reason.
        fault: UsdFault,
    },
}

/// What a USD file cannot hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UsdFault {
    /// An invalid number of frames per second.
    #[error("`fps` is {fps}, expected a positive number")]
    Fps {
        /// The value.
        fps: f64,
    },
    /// An invalid frame number.
    #[error("the frame number is {time}, expected a finite number")]
    Time {
        /// The value.
        time: f64,
    },
    /// A frame with another number of geometries than the stage has.
    #[error("frame {time} has {found} geometries and the stage has {expected}")]
    Members {
        /// The frame.
        time: f64,
        /// How many it has.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A frame that does not follow the last one.
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
    /// More points or corners than an `int` can count.
    #[error("`{kind}` has {rows} points or corners at frame {time}, expected at most 2,147,483,647")]
    TooMany {
        /// Component.
        kind: Kind,
        /// Rows it has.
        rows: usize,
        /// The frame.
        time: f64,
    },
    /// An attribute with another type than in previous frames.
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
