//! Directions as artists write them: vectors of any length.

use engine::prelude::Attr;
use numerics::vector::direction;

/// What gusts add to a wind of length 1 at a CV.
pub(crate) const GUST_DIR: Attr<[f32; 3]> = Attr::point("gust_dir");

/// `v`, not zero, scaled to length 1.
pub(crate) fn unit_direction(v: [f64; 3]) -> [f64; 3] {
    direction(v.into()).unwrap_or_default().into()
}
