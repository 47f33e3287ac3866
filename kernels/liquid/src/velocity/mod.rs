//! Velocity on the faces of cells: sampled anywhere, continued past the liquid, carried along with it.
//!
//! A value is stored in the cell whose low face it lies on, one field an axis (marker-and-cell grid: Harlow and Welch
//! 1965). Positions are in cells: cell [x, y, z] reaches from there to [x + 1, y + 1, z + 1]. Values are in any unit of
//! speed; functions that move something get the number of cells that it moves at speed 1.

mod advect;
mod around;
mod batch;
mod extrapolate;
mod sampler;
#[cfg(test)]
mod tests;

pub use advect::{Advection, Method, Scheme, Tracer};
pub(crate) use around::Around;
pub use extrapolate::{Slopes, extrapolate};
pub use sampler::{Corners, Sampler, Site, trilinear};

use numerics::vector::Vec3;
use serde::{Deserialize, Serialize};

use crate::rows::CellRows;

/// One value for each face: of the low faces of cells along x, y and z.
pub type FaceFields<T> = [Vec<T>; 3];

/// Which low faces of a cell count: bit 0 along x, bit 1 along y, bit 2 along z.
pub type FaceMask = u8;

/// All three low faces.
pub const ALL_FACES: FaceMask = 7;

/// A velocity on the low faces of stored cells.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MacVelocity {
    rows: CellRows,
    faces: FaceFields<f32>,
}

impl MacVelocity {
    /// The velocity `faces` on `rows`.
    ///
    /// # Panics
    /// Where a field does not have one value a cell.
    pub fn new(rows: CellRows, faces: FaceFields<f32>) -> Self {
        assert!(faces.iter().all(|field| field.len() == rows.len()), "a velocity has one value a cell and axis");
        Self { rows, faces }
    }

    /// The stored cells.
    pub fn rows(&self) -> &CellRows {
        &self.rows
    }

    /// The values on low faces along x, y and z.
    pub fn faces(&self) -> &FaceFields<f32> {
        &self.faces
    }

    /// The stored cells and the values.
    pub fn into_parts(self) -> (CellRows, FaceFields<f32>) {
        (self.rows, self.faces)
    }

    /// The velocity at `point`, by a sampler of these rows.
    #[inline(always)]
    pub fn at(&self, sampler: &mut Sampler<'_>, point: Vec3) -> Vec3 {
        sampler.velocity(&self.faces, point)
    }
}

/// These fields on other rows; 0 where `from` has no cell.
pub fn resampled(rows: &CellRows, from: &CellRows, faces: &FaceFields<f32>) -> FaceFields<f32> {
    faces.each_ref().map(|field| rows.resampled(from, field, 0.0))
}

/// `low` where `x` is NaN.
#[inline(always)]
fn within(x: f32, low: f32, high: f32) -> f32 {
    let x = if x > low { x } else { low };
    if x < high { x } else { high }
}
