//! Guarantees of every reader.

use formats::{Format, FrameStamp, read, write};

/// Reads `bytes`; what loads is written as json, which holds everything, and must be read back unchanged.
///
/// # Panics
/// If it is not.
pub(crate) fn check(format: Format, bytes: &[u8]) {
    let Ok(geometry) = read(format, bytes) else { return };
    let mut json = Vec::new();
    write(Format::Json, &geometry, &FrameStamp { frame: 1.0, seconds: 0.0 }, &mut json).expect("what loads is finite");
    let again = read(Format::Json, &json).expect("what convect writes loads");
    let has_rows = geometry.parts().all(|part| part.columns().all(|(_, _, column)| !column.is_empty()));
    // In json an empty column has no type.
    assert!(again == geometry || !has_rows, "json reads back what was written");
}
