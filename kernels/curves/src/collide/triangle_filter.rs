//! Which triangles of a block may be met: sixteen at a time, in f32, conservative with regard to rounding.

use super::sector::Sector;
use numerics::lanes::LANES;
use numerics::tree::Block;
use numerics::vector::{self, Vec3, cross, dot, sub, to_f32};

/// Rounding error of a few products of differences, relative to the largest difference.
const ROUNDING: f32 = 2e-6;

/// The part of a sector that is still to be tested: angles from 0 to that of `until`, at most π.
pub(super) struct Wedge {
    pivot: Vec3,
    axes: [Vec3; 3],
    until: [f32; 2],
    half: f32,
    back: f32,
    slack: f32,
}

impl Wedge {
    /// The wedge of `sector` up to an angle of this cosine and sine.
    #[inline(always)]
    pub(super) fn new(sector: &Sector, [cosine, sine]: [f64; 2]) -> Self {
        let pivot = to_f32(sector.pivot);
        Self {
            axes: [to_f32(sector.u), to_f32(sector.v), to_f32(sector.n)],
            until: [cosine as f32, sine as f32],
            half: sector.half as f32,
            back: (sector.back + sector.half) as f32,
            slack: ROUNDING * (sector.reach as f32 + 0.1 * vector::largest(pivot)),
            pivot,
        }
    }

    /// A bit for each lane whose triangle may be met within the wedge.
    #[inline(always)]
    pub(super) fn may_meet(&self, block: &Block) -> u16 {
        let (until, slack) = (self.until, self.slack);
        let mut mask = 0;
        for lane in 0..LANES {
            let corners = block.around(lane, self.pivot);
            let (x, y, s) = (
                coordinates(corners, self.axes[0]),
                coordinates(corners, self.axes[1]),
                coordinates(corners, self.axes[2]),
            );
            let size = most(most(vector::largest(x), vector::largest(y)), vector::largest(s));
            let slack = slack + ROUNDING * size;
            let across = (most3(s) >= -(self.half + slack)) & (least3(s) <= self.half + slack);
            let ahead = most3(y) >= -(self.back + slack);
            let sides = [
                x[0] * until[1] - y[0] * until[0],
                x[1] * until[1] - y[1] * until[0],
                x[2] * until[1] - y[2] * until[0],
            ];
            let before = most3(sides) >= -(self.back + slack);
            mask |= u16::from(across & ahead & before) << lane;
        }
        mask
    }
}

/// A bit for each lane whose triangle the segment from `a` to `b` may cross.
#[inline(always)]
pub(super) fn may_cross(block: &Block, a: Vec3, b: Vec3) -> u16 {
    let along = sub(b, a);
    let slack = ROUNDING * (vector::largest(along) + 0.1 * vector::largest(a));
    let mut mask = 0;
    for lane in 0..LANES {
        let [p, q, r] = block.around(lane, a);
        let (pq, pr) = (sub(q, p), sub(r, p));
        let normal = cross(pq, pr);
        let size = most3([vector::largest(p), vector::largest(q), vector::largest(r)]);
        // Heights above the plane, times twice the area; volumes with each edge.
        let start = -dot(normal, p);
        let end = dot(normal, sub(along, p));
        let doubt = (ROUNDING * size + slack) * (most(vector::largest(pq), vector::largest(pr))) * 4.0 * size;
        let passes = !((start > doubt) & (end > doubt)) & !((start < -doubt) & (end < -doubt));
        let volumes = [dot(along, cross(p, q)), dot(along, cross(q, r)), dot(along, cross(r, p))];
        let doubt = (ROUNDING * size + slack) * vector::largest(along) * 8.0 * size;
        let around = !((most3(volumes) > doubt) & (least3(volumes) < -doubt));
        mask |= u16::from(passes & around) << lane;
    }
    mask
}

/// The corners' coordinates along `axis`.
#[inline(always)]
fn coordinates(corners: [Vec3; 3], axis: Vec3) -> Vec3 {
    [dot(corners[0], axis), dot(corners[1], axis), dot(corners[2], axis)]
}

#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn most3([a, b, c]: [f32; 3]) -> f32 {
    most(most(a, b), c)
}

#[inline(always)]
fn least3([a, b, c]: [f32; 3]) -> f32 {
    let ab = if a < b { a } else { b };
    if ab < c { ab } else { c }
}
