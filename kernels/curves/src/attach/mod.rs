//! Roots bound to a skin, and curves that follow it: each rotates and moves rigidly, so its lengths are kept.
//!
//! This is the one definition of how a root follows its skin. Curve_Attach moves whole curves by it, Curve_Interpolate
//! blends guides in the frames it gives, and Curve_Jiggle obtains the inherited motion from it.
//!
//! A root is bound to the closest point of the skin at rest and keeps its offset from there. Its frame follows the
//! skin's own motion: the deformation gradient of each triangle (normals to normals), averaged by area over the
//! triangles around each vertex, interpolated between the three vertices around the root, and the rotation nearest to
//! it. Averaging matrices and not rotations makes this robust: a triangle counts by its rest area and its stretch, so
//! one that was or has become degenerate does not count and its neighbours decide; the rounding error of a sliver is
//! bounded by its longest side, as nothing is divided by an area.
//!
//! Special cases:
//! * **Roots on edges and corners**: of the faces that meet there the one listed first is used. The frame is the same
//!   on all of them, as it is continuous across faces.
//! * **Faces without area at rest** hold no roots, unless the skin has no others. Then curves are translated but not
//!   rotated.
//! * **Faces that lose their area**: the faces around them determine the rotation. If all faces around a root lose
//!   theirs, or collapse to a line, the pose is `lost`: translated, not rotated.
//! * **Faces that turn inside out** turn their curves inwards, following the normals.
//! * **Holes and borders**: vertices there average over the faces that they have. There is no averaging across points
//!   that are doubled along a seam, so the frame may jump there.
//! * **Roots and points that are not finite**: the root is bound to the first face; a face with such a point holds no
//!   root, and curves bound near it are `lost` as long as it is not finite.
//!
//! Guarantees: rigid motion of the skin moves its curves by the same motion, up to rounding in f32; the rotation is
//! continuous across faces and in time as long as the mean has a unique nearest rotation; mirroring or scaling
//! everything mirrors or scales the result; the same bits on any number of threads. f64 inside. Metres.

mod binding;
mod closest;
mod pose;
mod root_positions;
mod rotation;
mod triangle_lanes;

pub use binding::{SkinBinding, closest_triangles};
pub use pose::{AttachedCurves, RootPose, attach_curves, rotate_orientations, rotate_vectors};
pub(crate) use pose::{attach_curve, relative_stretch, rotate_orientation};
pub use root_positions::RootPositions;
pub use rotation::nearest_rotation;

#[cfg(test)]
mod tests;
