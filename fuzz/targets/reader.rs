//! What every reader promises.

use formats::{Format, FrameStamp, read, write};

/// Reads `bytes`; what loads is written as json, which holds everything, and must come back from it.
///
/// # Panics
/// Where it does not.
pub(crate) fn check(format: Format, bytes: &[u8]) {
    let Ok(geometry) = read(format, bytes) else { return };
    let mut json = Vec::new();
    write(Format::Json, &geometry, &FrameStamp { frame: 1.0, seconds: 0.0 }, &mut json).expect("what loads is finite");
    let again = read(Format::Json, &json).expect("what convect writes loads");
    let has_rows = geometry.parts().all(|part| part.columns().all(|(_, _, column)| !column.is_empty()));
    // An empty column does not show its type in json.
    assert!(again == geometry || !has_rows, "json gives back what it was given");
}
