//! Directions as artists write them: vectors of any length.

use numerics::vector::direction;

/// `v`, not zero, scaled to length 1.
pub(crate) fn unit_direction(v: [f64; 3]) -> [f64; 3] {
    direction(v.into()).unwrap_or_default().into()
}
