//! USD files as the engine opens them.

use std::sync::Arc;

use engine::files::{File, FileFolder};
use engine::prelude::*;
use formats::usd::{UsdAssets, UsdStage};
use formats::{FilePosition, FormatError};

/// A USD file with what it references.
pub(crate) struct UsdSource {
    pub(crate) stage: UsdStage,
}

/// The folder of a stage.
struct StageFolder(FileFolder);

impl UsdAssets for StageFolder {
    fn open(&self, name: &str) -> std::result::Result<Arc<[u8]>, FormatError> {
        self.0.open(name).and_then(|file| file.bytes()).map_err(|error| FormatError::Content {
            position: FilePosition::File,
            fact: format!("it references `{name}`: {}", error.fact),
            hint: Some("paths in a stage are relative to its file"),
        })
    }
}

impl UsdSource {
    /// The stage of a file, whose structure is read once.
    ///
    /// # Errors
    /// If it is damaged, or composed in a way that is not read.
    pub(crate) fn of(file: &File) -> Result<Arc<Self>> {
        file.derived(|file| {
            let stage = UsdStage::open(file.bytes()?, StageFolder(file.folder()));
            Ok(Self { stage: stage.map_err(|error| refused(file, &error))? })
        })
    }
}

/// The error of a file that is not read.
pub(crate) fn refused(file: &File, error: &FormatError) -> Error {
    let fact = Error::file(format!("`{}`: {error}", file.path().display()));
    match error.hint() {
        Some(hint) => fact.hint(hint),
        None => fact,
    }
}
