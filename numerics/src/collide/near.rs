//! Which triangles of a block may matter: sixteen at a time, in f32, letting pass what rounding leaves in doubt.

use super::sector::{Sector, V3};
use crate::lanes::{F32x16, LANES, get};
use crate::tree::Block;
use crate::vec3::{self, Vec3, cross, dot, sub};

/// Rounding of a few products of differences, as a share of the largest difference.
const ROUNDING: f32 = 2e-6;

/// The part of a sector that is still of interest: angles from 0 to that of `until`, at most π.
pub(super) struct Wedge {
    pivot: Vec3,
    axes: [Vec3; 3],
    until: [f32; 2],
    half: f32,
    back: f32,
    slack: f32,
}

/// A vector's nearest f32 one.
#[inline(always)]
pub(super) fn narrow(v: &V3) -> Vec3 {
    [v.x as f32, v.y as f32, v.z as f32]
}

impl Wedge {
    /// The wedge of `sector` up to `angle`.
    #[inline(always)]
    pub(super) fn new(sector: &Sector, angle: f64) -> Self {
        let (sine, cosine) = libm::sincos(angle);
        let pivot = narrow(&sector.pivot);
        Self {
            axes: [narrow(&sector.u), narrow(&sector.v), narrow(&sector.n)],
            until: [cosine as f32, sine as f32],
            half: sector.half as f32,
            back: sector.back as f32,
            slack: ROUNDING * (sector.reach as f32 + 0.1 * vec3::largest(pivot)),
            pivot,
        }
    }

    /// A bit for each lane whose triangle may be met within the wedge.
    #[inline(always)]
    pub(super) fn may_meet(&self, block: &Block) -> u16 {
        let [along, up, height] = [0, 1, 2].map(|axis| {
            block.corners.each_ref().map(|corner| {
                let mut out = F32x16::splat(0.0);
                for lane in 0..LANES {
                    out.0[lane] = dot(sub(get(corner, lane), self.pivot), self.axes[axis]);
                }
                out
            })
        });
        let mut mask = 0;
        for lane in 0..LANES {
            let [x, y, s] = [&along, &up, &height].map(|values| values.each_ref().map(|value| value.0[lane]));
            let size = most(most3(x.map(f32::abs)), most(most3(y.map(f32::abs)), most3(s.map(f32::abs))));
            let slack = self.slack + ROUNDING * size;
            let across = (most3(s) >= -(self.half + slack)) & (least3(s) <= self.half + slack);
            let ahead = most3(y) >= -(self.back + slack);
            let side = |k: usize| x[k] * self.until[1] - y[k] * self.until[0];
            let before = most3([side(0), side(1), side(2)]) >= -(self.back + slack);
            mask |= u16::from(across & ahead & before) << lane;
        }
        mask
    }
}

/// A bit for each lane whose triangle the segment from `a` to `b` may cross.
#[inline(always)]
pub(super) fn may_cross(block: &Block, a: Vec3, b: Vec3) -> u16 {
    let way = sub(b, a);
    let slack = ROUNDING * (vec3::largest(way) + 0.1 * vec3::largest(a));
    let mut mask = 0;
    for lane in 0..LANES {
        let [p, q, r] = block.corners.each_ref().map(|corner| sub(get(corner, lane), a));
        let (pq, pr) = (sub(q, p), sub(r, p));
        let normal = cross(pq, pr);
        let size = most3([p, q, r].map(vec3::largest));
        // Heights over the plane, times twice the area; volumes with each edge.
        let start = -dot(normal, p);
        let end = dot(normal, sub(way, p));
        let doubt = (ROUNDING * size + slack) * (most(vec3::largest(pq), vec3::largest(pr))) * 4.0 * size;
        let passes = !((start > doubt) & (end > doubt)) & !((start < -doubt) & (end < -doubt));
        let volume = |a: Vec3, b: Vec3| dot(way, cross(a, b));
        let volumes = [volume(p, q), volume(q, r), volume(r, p)];
        let doubt = (ROUNDING * size + slack) * vec3::largest(way) * 8.0 * size;
        let around = !((most3(volumes) > doubt) & (least3(volumes) < -doubt));
        mask |= u16::from(passes & around) << lane;
    }
    mask
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
