//! Geometry files: obj, ply, json and USD in and out.
//!
//! [`read`] converts the bytes of a file to a geometry with all components of the file; [`write()`] writes a geometry
//! so that it reads back bit for bit, as far as the format can store it (the module of each format says what it drops).
//! Readers never panic, their memory is a small multiple of the file's size, whatever counts the file declares, and
//! their time is linear in it.
//!
//! Readers do not change coordinates, because obj, ply and json declare neither unit nor axes; USD does, and is converted
//! ([`usd::UsdStage`], which reads it by prim and time).

pub mod atomic;
mod error;
mod format;
mod json;
mod lost;
mod obj;
mod out;
mod ply;
mod text;
pub mod usd;

use std::io::Write;

use engine::geometry::{Geometry, Kind};

pub use error::{FilePosition, FormatError};
pub use format::Format;
pub use lost::lost;

pub(crate) type Result<T, E = FormatError> = std::result::Result<T, E>;

/// The frame of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameStamp {
    /// The frame number, whole or not.
    pub frame: f64,
    /// Its time, seconds.
    pub seconds: f64,
}

/// The geometry in the bytes of a file, with every component the file has.
///
/// # Errors
/// If the bytes are not a file of that format, and for USD, which is read by [`usd::UsdStage`].
pub fn read(format: Format, bytes: &[u8]) -> Result<Geometry, FormatError> {
    match format {
        Format::Obj => obj::read(text::opened(format, bytes)?),
        Format::Ply => ply::read(text::opened(format, bytes)?),
        Format::Json => json::read(text::opened(format, bytes)?),
        Format::Usdc | Format::Usda => Err(FormatError::UsdIsAStage),
    }
}

/// Writes one frame of a geometry as a file of that format. The same geometry gives the same bytes.
///
/// # Errors
/// If the format cannot hold a component or keeps all frames in one file (see [`usd`]), a number is not finite, or the
/// bytes cannot be written.
pub fn write(format: Format, geometry: &Geometry, stamp: &FrameStamp, sink: &mut dyn Write) -> Result<(), FormatError> {
    let FrameStamp { frame, seconds } = *stamp;
    if !(frame.is_finite() && seconds.is_finite()) {
        return Err(FormatError::Stamp { frame, seconds });
    }
    if let Some(kind) = geometry.kinds().find(|kind| !format.holds(*kind)) {
        return Err(FormatError::CannotHold { format, kind });
    }
    all_finite(geometry)?;
    match format {
        Format::Obj => obj::write(geometry, stamp, sink),
        Format::Ply => ply::write(geometry, stamp, sink),
        Format::Json => json::write(geometry, stamp, sink),
        Format::Usdc | Format::Usda => Err(FormatError::OneFile { format }),
    }
}

fn all_finite(geometry: &Geometry) -> Result<(), FormatError> {
    for part in geometry.parts() {
        for (_, name, column) in part.columns() {
            if let Some(row) = column.first_not_finite() {
                return Err(FormatError::NotFinite { kind: part.kind(), name: name.clone(), row });
            }
        }
    }
    if let Some(volume) = geometry.volume() {
        let once = volume.once().iter().map(|(name, column)| (name.clone(), column.first_not_finite()));
        let (level, velocity) = (volume.level_grid(), volume.velocity_grid());
        let finite = |numbers: &[f32]| numbers.iter().position(|x| !x.is_finite());
        let numbers: [(&str, &[f32]); 5] = [
            ("origin", &level.origin),
            ("cell", &[level.cell]),
            ("background", &[volume.level_set().background()]),
            ("velocity_origin", &velocity.origin),
            ("velocity_cell", &[velocity.cell]),
        ];
        let numbers = numbers.map(|(name, numbers)| (name.into(), finite(numbers)));
        let fields = volume.fields().map(|(name, field)| {
            let row =
                if finite(field.values()).is_none() { None } else { field.iter_dense().position(|x| !x.is_finite()) };
            (name.into(), row)
        });
        if let Some((name, Some(row))) = numbers.into_iter().chain(fields).chain(once).find(|(_, row)| row.is_some()) {
            return Err(FormatError::NotFinite { kind: Kind::Volume, name, row });
        }
    }
    Ok(())
}
