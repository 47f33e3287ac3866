//! Hairs between guide curves: each is a weighted mix of the guides nearest to its root.
//!
//! Weights are those of Franke & Little's modified Shepard method, ((R − d) ÷ (R·d))², where d is the distance of a
//! guide's root and R that of the nearest guide that is *not* mixed in. A guide's weight is 0 when another takes its
//! place, so a mix is continuous over the skin for three guides or more (with one it is the nearest guide; with two it
//! changes quickly where three are equally near). Distances are straight through space, times 2 ÷ (1 + cos) of the angle
//! between the skin's normals: a guide on the other side of a thin sheet is far away, and none appears or vanishes as the
//! skin curves.
//!
//! Shapes are mixed segment by segment. Each guide's segment is rotated from the frame of its root to that of the hair's,
//! by the least rotation between their normals at rest and by how both roots have rotated since. Directions are mixed
//! by the segments' lengths; then the length is set to the mix of the lengths, so guides that disagree give a hair of
//! their mean length and not a shorter one. Where they cancel, the heaviest guide gives the direction.
//!
//! Promise: a hair at a guide's root is the guide; hairs that follow a skin equal hairs mixed at rest and then attached to
//! it ([`crate::attach`]); weights are a pure function of positions at rest; the same bits on any number of threads and
//! every SIMD path. Metres.

mod blend;
mod resample;
mod weights;

pub use blend::{BlendedHairs, CurveDomain, HairAndGuidePoses, HairBlend, blend_hairs};
pub use resample::ResampledGuides;
pub use weights::{GuideWeight, GuideWeights, MAX_GUIDES, OrientedPoint, guide_weights};

#[cfg(test)]
mod tests;
