//! How a surface goes on into a solid that the liquid touches.
//!
//! Pressure next to a solid knows where the surface is by φ in the solid. A flat surface must be flat there, too, or it would
//! push liquid that is at rest; but liquid that lies against a side touches it, and each side of a thin solid has its own.

use numerics::vector::{Vec3, add, dot, length, scale, sub};

use super::sides::{Sides, into, is_edge, may_be_thin, outward};
use super::{Distance, PhiSampler, PhiView};

/// Depth in a solid, in cells, to which liquid that touches it goes on.
pub const CONTACT: f32 = 2.5;

/// Heights above a solid, in cells, at which φ says how it goes on inside.
const ABOVE: [f32; 2] = [0.5, 1.5];

/// The same above a thin solid: φ between these cells has nothing of what is in it, which may be of the other side.
pub(super) const ABOVE_THIN: [f32; 2] = [1.0, 2.0];

/// |Cosine| between the normals of a surface and of a solid: below the first they meet at an angle, from the second on one lies
/// along the other.
const ALONG: [f32; 2] = [0.8, 0.95];

/// Share of an angle from which on a surface on one side of a thin solid is that on the other.
const SAME: f32 = 0.75;

/// Distance between a solid and a surface along it, in cells, from which on they are apart.
const APART: f32 = 0.25;

/// Depth in a solid up to which φ is the liquid's own.
const SKIN: f32 = 0.25;

/// How much larger φ may be there than where the liquid above goes on to. A solid holds what touches it, so that air below
/// liquid that rolls over it would never leave: drops that spread lost 4 % of their volume to it.
const LAG: f32 = 0.25;

/// Height above a thin solid up to which a cell may be next to one that goes on from the other side: half a cell, and half of
/// what the ways out of both sides differ by where the middle of a cell counts as half-way.
const NEXT_TO: f32 = 0.61;

/// Distance from an edge of a solid within which a face of a cell inside may be open, ÷ the width of a face: half of it, the
/// width over which a distance that is sampled at cells is rounded off, and some room.
const EDGE: f32 = 1.75;

/// A solid, and the surface that meets it.
pub(super) struct Contact<'a> {
    solid: &'a Distance<'a>,
    sampler: PhiSampler<'a>,
    /// Distance from an edge of the solid within which faces of cells in it may be open.
    edge: f32,
}

impl<'a> Contact<'a> {
    /// `face`: the width of the faces that the solid may leave open, in cells of the surface.
    pub(super) fn new(solid: &'a Distance<'a>, surface: PhiView<'a>, face: f32) -> Self {
        Self { solid, sampler: PhiSampler::new(surface), edge: EDGE * face }
    }

    /// φ at a place once the surface has met the solid, where it is `own` before.
    pub(super) fn phi(&mut self, at: Vec3, own: f32) -> f32 {
        let depth = -(self.solid)(at);
        if depth > CONTACT {
            own.max(depth - CONTACT)
        } else if depth >= 0.0 {
            self.continued(at, depth, own)
        } else if depth > -NEXT_TO && own > 0.0 && own < 1.0 {
            self.parted(at, -depth, own)
        } else {
            own
        }
    }

    /// φ at a place in the solid, whose distance there is −`depth`, as the liquid outside goes on.
    fn continued(&mut self, at: Vec3, depth: f32, own: f32) -> f32 {
        let Some(sides) = Sides::of(self.solid, at, depth) else { return own };
        if sides.is_thin() && !sides.are_at_rim(self.solid, at, self.edge) {
            // What is the liquid's own may be that of the other side.
            let of_side = |Sides { normal, depth, .. }| {
                let [at_wall, slope] = self.at_thin(add(at, scale(normal, depth)), normal);
                at_wall - slope * depth
            };
            let both = [sides, sides.other()].map(of_side);
            return sides.joined(both);
        }
        let [near, slope] = self.fall(add(at, scale(sides.normal, sides.depth)), sides.normal, ABOVE);
        let on = near - slope * (ABOVE[0] + sides.depth);
        if depth < SKIN { own.min(on + LAG) } else { on }
    }

    /// φ at a place without liquid, `height` above the solid: without what is on the other side, where that is thin. Else
    /// each shift of the liquid's surface would move it closer, until it came out there.
    fn parted(&mut self, at: Vec3, height: f32, own: f32) -> f32 {
        let Some(normal) = outward(self.solid, at) else { return own };
        if self.sampler.at(sub(at, normal)) >= 0.0 || !may_be_thin(self.solid, at, height, normal) {
            return own;
        }
        let Some((inside, depth)) = into(self.solid, at, height, normal) else { return own };
        let sides = Sides::of(self.solid, inside, depth).filter(Sides::is_thin);
        if sides.is_none_or(|sides| sides.are_at_rim(self.solid, inside, self.edge)) {
            return own;
        }
        let above = add(at, normal);
        let is_film = self.at_thin(sub(at, scale(normal, height)), normal)[0] < 0.0;
        // A surface that meets the solid at an angle goes through it from one side to the other.
        let is_same = self.angle(above, normal) > SAME;
        if is_film || is_same { own } else { own.max(self.sampler.at(above).min(1.0)) }
    }

    /// φ at a place on a side of the solid where that is thin, and how it falls into it. If positive, that at the lower
    /// height, unless it is of a surface that lies apart from the solid.
    fn at_thin(&mut self, place: Vec3, normal: Vec3) -> [f32; 2] {
        let [near, slope] = self.fall(place, normal, ABOVE_THIN);
        let at_wall = near - slope * ABOVE_THIN[0];
        if at_wall < 0.0 || slope < 0.0 { [at_wall, slope] } else { [near.max(f32::MIN_POSITIVE), 0.0] }
    }

    /// φ at the lower of two heights above a place on a side, and how it falls from there into the solid: straight on, as a
    /// flat surface does, whether it leans over the liquid or away, unless the liquid touches the side with all of its
    /// surface.
    fn fall(&mut self, place: Vec3, normal: Vec3, heights: [f32; 2]) -> [f32; 2] {
        let [near, far] = heights.map(|height| self.sampler.at(add(place, scale(normal, height))));
        let slope = ((far - near) / (heights[1] - heights[0])).clamp(-1.0, 1.0);
        if slope >= 0.0 {
            return [near, slope];
        }
        let apart = ((near - slope * heights[0]) / APART).clamp(0.0, 1.0);
        let share = self.angle(add(place, scale(normal, heights[0])), normal).max(apart);
        [near, if share < 1.0 && is_edge(self.solid, place, normal, self.edge) { slope } else { slope * share }]
    }

    /// How the surface at a place lies to a side: from 0, along it, to 1, at an angle.
    fn angle(&mut self, at: Vec3, normal: Vec3) -> f32 {
        let slope = [0, 1, 2].map(|axis| {
            let (mut below, mut above) = (at, at);
            (below[axis], above[axis]) = (at[axis] - 0.5, at[axis] + 0.5);
            self.sampler.at(above) - self.sampler.at(below)
        });
        let cosine = dot(slope, normal).abs() / length(slope).max(f32::MIN_POSITIVE);
        ((ALONG[1] - cosine) / (ALONG[1] - ALONG[0])).clamp(0.0, 1.0)
    }
}
