//! Sixteen rays at once, each a lane, against one triangle after another; or, where they are far apart, one ray after
//! another against sixteen triangles.

use super::views::View;
use super::{Fade, Obstacle, Reach};
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::simd::kernel;
use numerics::tree::Cuboid;
use numerics::vector::{Vec3, sub};

kernel! { avx512
    /// Sets `covered` to 1 for each of up to sixteen CVs, those of `views` with the indices `cvs`, that has a collider within
    /// its reach upwind.
    pub(super) fn cover(
        obstacles: &[Obstacle],
        views: &[View],
        cvs: &[u32],
        covered: &mut [f32],
    ) = body;
}

kernel! { avx512
    /// Sets `covered` for each of up to sixteen CVs, those of `views` with the indices `cvs`, to how much the nearest collider
    /// within its reach upwind counts.
    pub(super) fn cover_nearest(
        obstacles: &[Obstacle],
        views: &[View],
        cvs: &[u32],
        fade: Fade,
        covered: &mut [f32],
    ) = body_of_nearest;
}

#[inline(always)]
fn body(obstacles: &[Obstacle], views: &[View], cvs: &[u32], covered: &mut [f32]) {
    let mut rays = Rays::of(views, cvs, None);
    let mut hit = [0; LANES];
    for obstacle in obstacles {
        rays.set_gaps(views, cvs, obstacle);
        if rays.meet(obstacle, &mut hit) {
            break;
        }
    }
    for (covered, hit) in covered.iter_mut().zip(hit) {
        *covered = hit as f32;
    }
}

#[inline(always)]
fn body_of_nearest(obstacles: &[Obstacle], views: &[View], cvs: &[u32], fade: Fade, covered: &mut [f32]) {
    let mut rays = Rays::of(views, cvs, Some(fade));
    let mut nearest = F32x16::splat(f32::INFINITY);
    for obstacle in obstacles {
        rays.set_gaps(views, cvs, obstacle);
        rays.find_nearest(obstacle, &mut nearest);
    }
    for (covered, distance) in covered.iter_mut().zip(nearest.0) {
        *covered = fade.weight(distance);
    }
}

/// Expected number of triangles between sixteen rays from which on each ray is followed alone: that takes a walk through
/// the tree for each, but meets few triangles.
const MANY_TRIANGLES: f32 = 160.0;

/// The view of a lane; that of the first where there is none.
#[inline(always)]
fn of_lane<'a>(views: &'a [View], cvs: &[u32], lane: usize) -> &'a View {
    &views[cvs[if lane < cvs.len() { lane } else { 0 }] as usize]
}

/// Sixteen rays upwind, by their starts.
struct Rays {
    at: Lanes<3>,
    gap: F32x16,
    /// Beyond these distances nothing counts, and the largest of them.
    reach: F32x16,
    farthest: f32,
}

impl Rays {
    /// The rays of up to sixteen CVs; a lane without a CV repeats the first.
    #[inline(always)]
    fn of(views: &[View], cvs: &[u32], fade: Option<Fade>) -> Self {
        let zero = F32x16::splat(0.0);
        let mut rays = Self { at: [zero; 3], gap: zero, reach: zero, farthest: 0.0 };
        for lane in 0..LANES {
            let view = of_lane(views, cvs, lane);
            set(&mut rays.at, lane, view.at);
            let reach = Reach { end: view.reach, fade }.farthest();
            rays.reach.0[lane] = reach;
            rays.farthest = if reach > rays.farthest { reach } else { rays.farthest };
        }
        rays
    }

    #[inline(always)]
    fn set_gaps(&mut self, views: &[View], cvs: &[u32], obstacle: &Obstacle) {
        for lane in 0..LANES {
            self.gap.0[lane] = of_lane(views, cvs, lane).gap.at(obstacle.size);
        }
    }

    /// The space that the rays pass through.
    #[inline(always)]
    fn swept(&self) -> Cuboid {
        let Cuboid { low, high } = self.bounds();
        Cuboid { low, high: [high[0], high[1], high[2] + self.farthest] }
    }

    /// Lowers `nearest` to the distance at which each ray meets the tree.
    #[inline(always)]
    fn find_nearest(&self, obstacle: &Obstacle, nearest: &mut F32x16) {
        let tree = &obstacle.tree;
        for (block, mut lanes) in tree.walk(self.swept()) {
            let (areas, [a, b, c]) = (&obstacle.areas[block], &tree.blocks()[block].corners);
            while lanes != 0 {
                let triangle = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                for lane in 0..LANES {
                    let at = get(&self.at, lane);
                    let seen = Seen::from([a, b, c].map(|corner| sub(get(corner, triangle), at)));
                    let far = seen.towards > self.gap.0[lane] * areas.0[triangle];
                    let near = seen.towards <= self.reach.0[lane] * seen.across;
                    let distance = seen.towards / seen.across;
                    let closer = seen.inside & far & near & (distance < nearest.0[lane]);
                    nearest.0[lane] = if closer { distance } else { nearest.0[lane] };
                }
            }
        }
    }

    /// Sets `hit` to 1 for each ray that meets the tree; returns whether all do.
    #[inline(always)]
    fn meet(&self, obstacle: &Obstacle, hit: &mut [u32; LANES]) -> bool {
        let (tree, swept) = (&obstacle.tree, self.swept());
        let area = (swept.high[0] - swept.low[0]) * (swept.high[1] - swept.low[1]);
        if (area * obstacle.density).min(obstacle.triangles) > MANY_TRIANGLES {
            let mut all = true;
            for lane in 0..LANES {
                if hit[lane] == 0 {
                    hit[lane] = u32::from(self.meets_alone(lane, &swept, obstacle));
                }
                all &= hit[lane] == 1;
            }
            return all;
        }
        for (block, mut lanes) in tree.walk(swept) {
            let (areas, [a, b, c]) = (&obstacle.areas[block], &tree.blocks()[block].corners);
            while lanes != 0 {
                let triangle = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let corners = [get(a, triangle), get(b, triangle), get(c, triangle)];
                self.meet_triangle(corners, areas.0[triangle], hit);
            }
            let mut all = 1;
            for lane in 0..LANES {
                all &= hit[lane];
            }
            if all == 1 {
                return true;
            }
        }
        false
    }

    /// Whether one ray meets the tree: the same tests as side by side, of those triangles only whose boxes its line meets.
    #[inline(always)]
    fn meets_alone(&self, lane: usize, swept: &Cuboid, obstacle: &Obstacle) -> bool {
        let (tree, at) = (&obstacle.tree, get(&self.at, lane));
        let (gap, reach) = (self.gap.0[lane], self.reach.0[lane]);
        let line = Cuboid { low: at, high: [at[0], at[1], swept.high[2]] };
        for (block, lanes) in tree.walk(line) {
            let (areas, [a, b, c]) = (&obstacle.areas[block], &tree.blocks()[block].corners);
            let mut met = 0;
            for triangle in 0..LANES {
                let corners = [get(a, triangle), get(b, triangle), get(c, triangle)];
                met |= u16::from(meets(corners, areas.0[triangle], at, gap, reach)) << triangle;
            }
            if met & lanes != 0 {
                return true;
            }
        }
        false
    }

    /// Sets `hit` to 1 for each ray that meets the triangle, whose area is half of `area`.
    #[inline(always)]
    fn meet_triangle(&self, corners: [Vec3; 3], area: f32, hit: &mut [u32; LANES]) {
        for lane in 0..LANES {
            let at = get(&self.at, lane);
            hit[lane] |= u32::from(meets(corners, area, at, self.gap.0[lane], self.reach.0[lane]));
        }
    }

    /// The box around the starts.
    #[inline(always)]
    fn bounds(&self) -> Cuboid {
        let (mut low, mut high) = (get(&self.at, 0), get(&self.at, 0));
        for lane in 1..LANES {
            let at = get(&self.at, lane);
            for axis in 0..3 {
                low[axis] = if at[axis] < low[axis] { at[axis] } else { low[axis] };
                high[axis] = if at[axis] > high[axis] { at[axis] } else { high[axis] };
            }
        }
        Cuboid { low, high }
    }
}

/// Whether the ray from `at` meets a triangle, whose area is half of `area`, farther than `gap` and within its reach.
#[inline(always)]
fn meets([a, b, c]: [Vec3; 3], area: f32, at: Vec3, gap: f32, reach: f32) -> bool {
    let seen = Seen::from([sub(a, at), sub(b, at), sub(c, at)]);
    seen.inside & (seen.towards > gap * area) & (seen.towards <= reach * seen.across)
}

/// A triangle as seen from the start of a ray along the third axis.
pub(super) struct Seen {
    /// Whether the line of the ray passes through it, sides included. Two triangles compute a shared side as the same
    /// number, so no ray passes between them.
    pub(super) inside: bool,
    /// Twice its area across the ray, ≥ 0 where inside.
    pub(super) across: f32,
    /// `across` times the distance along the ray; also twice its area times the distance of its plane; negative if the
    /// triangle is behind the start.
    pub(super) towards: f32,
    /// Six times the volume of the tetrahedron that it spans with the start.
    pub(super) volume: f32,
}

impl Seen {
    /// From the corners relative to the start.
    #[inline(always)]
    pub(super) fn from([a, b, c]: [Vec3; 3]) -> Self {
        let [x, y, z] = [beside(b, c), beside(c, a), beside(a, b)];
        let positive = (x >= 0.0) & (y >= 0.0) & (z >= 0.0);
        let negative = (x <= 0.0) & (y <= 0.0) & (z <= 0.0);
        let sum = x + y + z;
        let volume = x * a[2] + y * b[2] + z * c[2];
        let towards = if sum < 0.0 { -volume } else { volume };
        Self { inside: positive | negative, across: sum.abs(), towards, volume }
    }
}

/// Twice the signed area that a side spans with the axis, seen along the axis: negative if the axis is to the right of
/// the side from `p` to `q`.
#[inline(always)]
pub(super) fn beside(p: Vec3, q: Vec3) -> f32 {
    p[0] * q[1] - p[1] * q[0]
}
