//! Turns with coherence: to the target itself where that is free, however the segment gets there.
//!
//! A first contact depends on the whole way from rest: a way that grazes the skin is blocked or free by a hair's breadth.
//! Where something lies depends on the target alone, continuously. So a segment takes its target if nothing is within the
//! angle kept there; else the first direction without anything, from the target towards the skin's normal; else towards
//! its direction at rest. Only where there is none does it turn from rest until it meets something. It may so come to the
//! other side of a fold of the skin, but of no other obstacle: against those it turns from rest first.

use super::ContactMethod;
use super::segment_turn::{Nearby, Segment, Turned, first_gap, gather};
use numerics::tree::TriangleTree;
use numerics::vector::DVec3;

/// The way of a segment out of the skin.
pub(super) struct WayOut<'a> {
    /// The skin's normal under it, unit.
    pub(super) up: DVec3,
    /// Its direction at rest, not carried along by earlier segments, unit.
    pub(super) rest: DVec3,
    /// Obstacles besides the skin.
    pub(super) others: &'a [&'a TriangleTree],
}

impl Segment<'_> {
    /// Turns with coherence; `None` where it has to turn from rest. Afterwards `nearby` holds everything that the segment may
    /// cross in its new direction.
    #[inline(always)]
    pub(super) fn turn_coherently<'t>(
        &self,
        method: ContactMethod,
        way_out: &WayOut<'t>,
        obstacles: &[&'t TriangleTree],
        nearby: &mut Nearby<'t>,
    ) -> Option<Turned> {
        let before = match way_out.others {
            [] => Turned { direction: self.to, met: false, clear: true },
            others => self.turn(method, others, nearby),
        };
        let target = before.direction;
        for towards in [way_out.up, way_out.rest] {
            let Some((angle, direction)) = self.first_free(&target, &towards, obstacles, nearby) else { continue };
            let met = before.met || angle > 0.0;
            return Some(Turned { direction, met, clear: nearby.is_empty() });
        }
        None
    }

    /// The first direction from one unit vector to another at which nothing is near, and its angle.
    #[inline(always)]
    fn first_free<'t>(
        &self,
        target: &DVec3,
        towards: &DVec3,
        obstacles: &[&'t TriangleTree],
        nearby: &mut Nearby<'t>,
    ) -> Option<(f64, DVec3)> {
        let sector = self.sector(*target, *towards);
        let (low, high) = sector.bounds(towards);
        gather(obstacles, low, high, nearby);
        // At all radii alike: written positions differ by an angle. An arc would be a large angle next to the pivot,
        // where a face in a crease comes and goes with rounding.
        let gap = self.gap / self.length;
        let angle = first_gap(&sector, nearby, sector.angle_of(towards), |_| 1.001 * gap)?;
        Some((angle, sector.direction(angle)))
    }
}
