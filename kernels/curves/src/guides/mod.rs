//! Hairs between guide curves: each is a weighted blend of the guides nearest to its root.
//!
//! Weights are those of Franke & Little's modified Shepard method, ((R − d) ÷ (R·d))², where d is the distance of a
//! guide's root and R that of the nearest guide that is *not* used. A guide's weight is 0 when another takes its place,
//! so the blend is continuous over the skin for three guides or more (with one it is the nearest guide; with two it
//! changes quickly where three are equally near). Distances are Euclidean, times 2 ÷ (1 + cos) of the angle between the
//! skin's normals: a guide on the other side of a thin sheet is far away, and none appears or vanishes as the skin
//! curves.
//!
//! Shapes are blended segment by segment. Each guide's segment is rotated from the frame of its root to that of the
//! hair's, by the smallest rotation between their normals at rest and by the rotations of both roots since. Directions
//! are weighted by the segments' lengths; then the length is set to the blended length, so guides that point in
//! different directions give a hair of their mean length, not a shorter one. If they cancel, the guide with the largest
//! weight gives the direction.
//!
//! Guarantees: a hair at a guide's root equals the guide; hairs on a moving skin equal hairs blended at rest and then
//! attached to it ([`crate::attach`]); weights are a pure function of positions at rest; the same bits on any number of
//! threads and every SIMD path. Metres.

mod blend;
mod resample;
mod weights;

pub use blend::{BlendedHairs, CurveDomain, HairAndGuidePoses, HairBlend, blend_hairs};
pub use resample::{CurveSample, ResampledGuides, even_samples};
pub use weights::{GuideWeight, GuideWeights, MAX_GUIDES, OrientedPoint, guide_weights};

#[cfg(test)]
mod tests;
