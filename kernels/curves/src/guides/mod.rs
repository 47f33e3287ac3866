//! Hairs between guides: each a weighted mix of the guides nearest to its root.
//!
//! Weights are those of Franke & Little's modified Shepard method, ((R − d) ÷ (R·d))², d the distance of a guide's root
//! and R that of the first guide that is *not* mixed: a guide's weight is 0 before another takes its place, so a mix is
//! continuous over the skin for three guides and more (with one it is the nearest guide's, with two it turns quickly
//! where three are equally near). Distances are straight through space, times 2 ÷ (1 + cos) of the angle between the
//! skin's normals: a guide on the other side of a thin sheet is far away, and none comes or goes as the skin curves.
//!
//! Shapes are mixed segment by segment: each guide's is turned from the frame of its root to that of the hair's, by
//! the least turn from normal to normal at rest and by how both roots have turned since; directions are mixed with the
//! segments' lengths, then the length is set to the mix of the lengths, so guides that disagree make a hair of their
//! mean length and not a shorter one. Where they cancel, the heaviest guide gives the direction.
//!
//! Promise: a hair at a guide's root is the guide; hairs that follow a skin are what hairs mixed at rest are after they
//! are carried by it ([`crate::attach`]); weights are a pure function of places at rest; the same bits on any number of
//! threads and every SIMD path. Metres.

mod blend;
mod near;
mod shape;

pub use blend::{Blend, Blended, Poses, Rows, blend};
pub use near::{MOST_GUIDES, Mix, Share, Stand, mix};
pub use shape::Shapes;

#[cfg(test)]
mod tests;
