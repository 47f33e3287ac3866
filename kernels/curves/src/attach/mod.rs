//! Curves that hang on a skin and follow it: each turns and moves as one, so its lengths stay.
//!
//! A root is bound to its nearest point of the skin at rest, and to how far it is from it. From there the skin's own
//! motion is read off: the deformation gradient of each triangle, normals to normals, averaged by area over the
//! triangles around each point, interpolated between the three points around a root, and the rotation nearest to it
//! taken. Averaging matrices, not rotations, makes this robust: a triangle counts by how large it was and by how far it
//! is stretched, so one that was nothing, or has become nothing, has no say and its neighbours speak; what the rounding
//! of a sliver does is bounded by its longest side, as nothing is divided by an area.
//!
//! Promise: a skin that turns and moves rigidly carries its curves exactly so, to the rounding of f32; the turn is
//! continuous across edges and in time, wherever the mean has one nearest rotation; mirroring and scaling everything
//! mirrors and scales the result; the same bits on any number of threads. f64 inside. Limits: across points that are
//! doubled along a seam, nothing is averaged; a face turned inside out turns its curves inwards. Metres.

mod binding;
mod carry;
mod rotation;
pub(crate) mod vectors;

pub use binding::Binding;
pub use carry::{Carried, Pose, carry_curves, turn_orientations, turn_vectors};
pub use rotation::nearest_rotation;

#[cfg(test)]
mod tests;
