//! The axes about which segments turn whose goals are opposite to them.

use super::perpendicular;
use numerics::vector::DVec3;
use std::cell::Cell;

/// The axis of each segment of a curve, perpendicular to it and as near to that of the segment before as that allows. They
/// are computed when one is asked for, which is rare.
#[derive(Debug, Default)]
pub(super) struct TurnAxes {
    /// The directions from which segments turn, from the root on.
    directions: Vec<DVec3>,
    /// Number of segments whose axes are known, and the axis of the last of them.
    known: Cell<(usize, DVec3)>,
}

impl TurnAxes {
    /// Forgets all segments.
    pub(super) fn clear(&mut self) {
        self.directions.clear();
        self.known.set((0, DVec3::zeros()));
    }

    /// Adds a segment that turns from this direction, unit.
    #[inline(always)]
    pub(super) fn push(&mut self, direction: DVec3) {
        self.directions.push(direction);
    }

    /// The axis of the last segment, unit.
    #[cold]
    pub(super) fn last(&self) -> DVec3 {
        let (known, axis) = self.known.get();
        let axis = self.directions[known..].iter().fold(axis, |axis, direction| perpendicular(direction, &axis));
        self.known.set((self.directions.len(), axis));
        axis
    }
}
