//! USD files as the engine opens them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use engine::files::{File, FileFolder};
use engine::prelude::*;
use formats::usd::{UsdAssets, UsdStage};
use formats::{FilePosition, FormatError};

/// A USD file with what it references.
pub(crate) struct UsdSource {
    pub(crate) stage: UsdStage,
    /// What [`UsdSource::span`] found, by prim.
    spans: Mutex<BTreeMap<String, Option<[f64; 2]>>>,
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
            Ok(Self { stage: stage.map_err(|error| refused(file, &error))?, spans: Mutex::default() })
        })
    }

    /// The first and the last time at which what is read at `prim` has samples; `None` if it does not move.
    ///
    /// # Errors
    /// If the file is damaged.
    pub(crate) fn span(&self, prim: &str) -> std::result::Result<Option<[f64; 2]>, FormatError> {
        let known = || self.spans.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(span) = known().get(prim).copied() {
            return Ok(span);
        }
        let span = if self.stage.moves(prim)? { self.stage.span(prim)? } else { None };
        known().insert(prim.to_owned(), span);
        Ok(span)
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
