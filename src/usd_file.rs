//! USD files named on the command line, read at times.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::atomic::FileError;
use formats::usd::{UsdAssets, UsdReading, UsdStage};
use formats::{FilePosition, FormatError};

use crate::failure::Failure;
use crate::geometry_file::{folder_of, refused};

/// Whether a file is USD, by its extension.
pub fn is_usd(path: &Path) -> bool {
    ending(path).is_some()
}

/// The extension of a USD file.
fn ending(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_string_lossy().to_lowercase();
    ["usd", "usda", "usdc", "usdz"].into_iter().find(|known| *known == ending)
}

/// A USD file and the part of it that is read.
#[derive(Debug)]
pub struct UsdFile {
    path: PathBuf,
    prim: String,
    stage: UsdStage,
    /// Its extension.
    pub format: &'static str,
    /// Its size.
    pub bytes: u64,
    /// The times at which anything has a sample, ascending; empty if nothing moves.
    pub times: Vec<f64>,
}

/// The folder that the names in a stage are relative to.
struct Folder(PathBuf);

impl UsdAssets for Folder {
    fn open(&self, name: &str) -> Result<Arc<[u8]>, FormatError> {
        let path = self.0.join(name);
        read(&path).map(Arc::from).map_err(|error| FormatError::Content {
            position: FilePosition::File,
            fact: format!("it references `{name}`, which could not be read: {error}"),
            hint: Some("paths in a stage are relative to its file"),
        })
    }
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    io::Read::read_to_end(&mut engine::files::open(path)?, &mut bytes)?;
    Ok(bytes)
}

impl UsdFile {
    /// Opens the file at `path`, of which the prim at the path `prim` and all under it are read; all if it is empty.
    ///
    /// # Errors
    /// If the file cannot be read, is no USD that is read, or has no such prim.
    pub fn open(path: &Path, prim: &str) -> Result<Self, Failure> {
        let unread = |error: io::Error| Failure::file(FileError::new(path, "read", error).to_string());
        let bytes = read(path).map_err(unread)?;
        let size = bytes.len() as u64;
        let refused = |error| refused(path, &error);
        let stage = UsdStage::open(bytes.into(), Folder(folder_of(path).to_owned())).map_err(refused)?;
        let times = stage.times(prim).map_err(refused)?;
        let format = ending(path).unwrap_or("usd");
        Ok(Self { path: path.to_owned(), prim: prim.to_owned(), stage, format, bytes: size, times })
    }

    /// The geometry at a time code, and what was left out.
    ///
    /// # Errors
    /// If the file is damaged, or composed in a way that is not read.
    pub fn read(&self, time: f64) -> Result<UsdReading, Failure> {
        self.read_prim(&self.prim, time)
    }

    /// The outputs that convect wrote into the file as prims of their own: the name and path of each; none where that is
    /// not how it was written, or only a part of it is read.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn members(&self) -> Result<Vec<(String, String)>, Failure> {
        let stage = &self.stage;
        let members = || -> Result<Vec<(String, String)>, FormatError> {
            let names = if self.prim.is_empty() { stage.members()? } else { Vec::new() };
            names.into_iter().enumerate().map(|(place, name)| Ok((name, stage.member_path(place)?))).collect()
        };
        members().map_err(|error| self.refused(&error))
    }

    /// Like [`UsdFile::read`], of the prim at `path`.
    ///
    /// # Errors
    /// As for [`UsdFile::read`]; or if there is no such prim.
    pub fn read_prim(&self, path: &str, time: f64) -> Result<UsdReading, Failure> {
        self.stage.read(path, time, &|_| true).map_err(|error| self.refused(&error))
    }

    /// The stage itself.
    pub fn stage(&self) -> &UsdStage {
        &self.stage
    }

    /// The failure of an error of this file.
    pub fn refused(&self, error: &FormatError) -> Failure {
        refused(&self.path, error)
    }

    /// Time codes a second.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn fps(&self) -> Result<f64, Failure> {
        self.stage.fps().map_err(|error| refused(&self.path, &error))
    }

    /// The first time; 1 if nothing moves.
    pub fn first(&self) -> f64 {
        self.times.first().copied().unwrap_or(1.0)
    }
}
