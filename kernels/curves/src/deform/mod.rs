//! A groom that follows guides: the kernel of Curve_Deform.
//!
//! Each segment of a guide has a rotation since rest, in the frame of the guide's root: along the guide it is the product
//! of the smallest rotations that bring its segments to their directions ([`GuideTurns`]), so it does not twist. A hair's
//! segment turns by the weighted mean of its guides' rotations at the same fraction of their lengths, as quaternions,
//! each rotated from the guide's frame to the hair's; then by the rotation of the hair's own root. Weights are those of
//! [`crate::guides`]: they change continuously over the skin.
//!
//! Without a skin, a guide's root turns as the roots of the guides around it do ([`guide_poses`]), and hairs are carried
//! by the weighted mean of their guides' motions ([`carried_poses`]).
//!
//! Guarantees: guides and skin at rest change no bit; if all of them move rigidly, so do hairs; segments keep their
//! lengths up to the rounding of positions and of a rotation in f32, 3e-7 of a segment; a hair that is a guide, alone at
//! its root, becomes that guide to the same rounding; the same bits on any number of threads. Turns of guides are found in
//! f64, those of hairs blended in f32, sixteen side by side; displacements are summed, and lengths measured, in f64.
//! Metres.

mod hair_guides;
mod hair_lanes;
mod hairs;
mod roots;
mod turns;

pub use hair_guides::HairGuides;
pub use hairs::{CurveDeform, DeformedCurves, deform_curves};
pub use roots::{carried_poses, guide_poses};
pub use turns::{GuideSegments, GuideTurns};

#[cfg(test)]
mod tests;
