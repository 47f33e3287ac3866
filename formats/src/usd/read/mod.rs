//! Reads USD: crate files of versions 0.4 to 0.12, text, and archives of them.
//!
//! A [`UsdStage`] keeps a file's structure and its bytes; arrays are decoded when a time is read. Of each prim, what did
//! not change since the last reading shares its arrays with it. Read are curves, meshes, points and tets with their
//! primvars, transforms baked into positions, visibility, one level of references (each may be of this file, or of
//! another one), and value clips in the form that convect writes. Values between two samples are interpolated as USD
//! does; where topology changes between them, points move along their velocities from the sample before.
//!
//! What is composed otherwise (sublayers, variants, inherited classes, references of references, splines, templates of
//! clips) is refused by name. Prims and attributes that have no place in a geometry are left out, and said.
//!
//! Promise: damaged bytes are an error. No size in a file is believed before the bytes that it counts were seen, so
//! memory follows the file's size: an array takes at most what its bytes decompress to.

mod bytes;
mod clips;
mod coding;
mod crate_arrays;
mod crate_layer;
mod crate_values;
mod half;
mod join;
mod layer;
mod lerp;
mod matrix;
mod order;
mod parts;
mod pieces;
mod primvars;
mod sample;
mod stage;
mod text;
mod walk;
mod xform;
mod zip;

use std::sync::Arc;

use engine::geometry::Geometry;

use crate::{FormatError, Result};

pub use pieces::ClipPiece;
pub use stage::UsdStage;

/// Opens the files that a stage names.
pub trait UsdAssets: Send + Sync {
    /// The bytes of the file that the stage calls `name`, relative to its own folder.
    ///
    /// # Errors
    /// If it cannot be read.
    fn open(&self, name: &str) -> Result<Arc<[u8]>>;
}

/// No other files: a stage that names one is refused.
#[derive(Clone, Copy, Debug)]
pub struct NoAssets;

impl UsdAssets for NoAssets {
    fn open(&self, name: &str) -> Result<Arc<[u8]>> {
        let fact = format!("it references `{name}`, which cannot be opened here");
        Err(FormatError::with_hint(crate::FilePosition::File, fact, stage::FLATTEN))
    }
}

/// What was read at a time.
#[derive(Clone, Debug, Default)]
pub struct UsdReading {
    /// All curves as one component, all meshes as one, and so on, in the order of the stage.
    pub geometry: Geometry,
    /// What was left out and why, a sentence each.
    pub notes: Vec<String>,
    /// Whether prims are left out that are invisible at this time, and perhaps not at others.
    pub hides_some: bool,
}

impl UsdStage {
    /// The geometry at a time code, of the prim at path `prim` and all under it; an empty path is the whole stage.
    /// Attributes for whose name `wants` is false are not decoded.
    ///
    /// # Errors
    /// If there is no such prim, it is composed in a way that is not read, or the file is damaged there.
    pub fn read(&self, prim: &str, time: f64, wants: &dyn Fn(&str) -> bool) -> Result<UsdReading> {
        let mut notes = Vec::new();
        let (placed, hides_some) = self.placed_prims(prim, time, &mut notes)?;
        let mut parts = Vec::with_capacity(placed.len());
        for placed in &placed {
            parts.extend(self.part(placed, time, wants, &mut notes)?);
        }
        let geometry = join::joined(parts, &mut notes)?;
        Ok(UsdReading { geometry, notes, hides_some })
    }

    /// Frames and time codes a second.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn fps(&self) -> Result<f64> {
        stage::rate(self.root())
    }
}

#[cfg(test)]
mod tests;
