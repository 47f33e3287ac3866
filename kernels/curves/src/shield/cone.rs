//! The fraction of a cone that a mesh covers, sixteen triangles at a time.
//!
//! The cone's cross-section is a disc. The number of times that a mesh covers a point of the disc, counting triangles
//! that show the same face, changes only across silhouette edges as seen from the cone's tip. Its mean over the disc is
//! therefore its value at the centre plus, for each such edge, an integral along the part of the edge inside the disc
//! (Green's theorem): half the area it spans with the centre minus that of the disc's sector, divided by the disc's
//! area. When an edge crosses the centre, both terms jump by opposite amounts, and an edge contributes nothing when it
//! enters the disc, so the mean is continuous in the wind.
//!
//! Where shelter fades with distance, the value at the centre has the weight of its distance and each edge that of its
//! nearest point: exact for a surface across the wind that covers the disc, continuous always.
//!
//! Front and back faces are counted separately. If each is at most one layer the larger mean is taken: exact. What
//! layers behind one another add too much is taken off, to 0.03 (see [`super::layers`]).

use super::cone_blocks::ConeBlocks;
use super::layers::{Edge, Layers};
use super::rays::{Seen, beside};
use super::views::View;
use super::{Fade, Obstacle, Reach};
use numerics::lanes::{F32x16, LANES, Lanes, get};
use numerics::simd::kernel;
use numerics::tree::Boxes;
use numerics::trig;
use numerics::vector::{self, Vec3, cross, sub};
use std::f32::consts::PI;

/// Fraction of the offset, at its far end, over which shelter fades out: a collider that moves past the end would
/// otherwise appear and vanish abruptly.
const FADE: f32 = 0.1;

/// A fraction this close to 0 or 1 is rounded to it: above the rounding of the sums.
const ROUNDING: f32 = 2e-5;

/// Offset of the disc's centre from the ray, in radii along both axes: meshes are often symmetric, and a corner exactly
/// at the centre would have no angle.
const ASIDE: [f32; 2] = [3e-5, 2e-5];

/// Distance outside the disc at which edges are clipped before the perspective division, in radii.
const MARGIN: f32 = 2.0;

kernel! { avx512
    /// Writes the covered fraction of the cone of each CV, with half angle `cone`, to `covered`.
    pub(super) fn cover(
        obstacles: &[Obstacle],
        views: &[View],
        cone: f32,
        covered: &mut [f32],
    ) = body_without_fade;
}

kernel! { avx512
    /// The same where what is covered counts by its distance.
    pub(super) fn cover_fading(
        obstacles: &[Obstacle],
        views: &[View],
        fade: Fade,
        cone: f32,
        covered: &mut [f32],
    ) = body_with_fade;
}

#[inline(always)]
fn body_without_fade(obstacles: &[Obstacle], views: &[View], cone: f32, covered: &mut [f32]) {
    body(obstacles, views, NoFade, cone, covered);
}

#[inline(always)]
fn body_with_fade(obstacles: &[Obstacle], views: &[View], fade: Fade, cone: f32, covered: &mut [f32]) {
    body(obstacles, views, fade, cone, covered);
}

/// How much what is covered counts by its distance. A type and not an `Option`, so that without it nothing is computed:
/// a branch within a loop over lanes computes both sides.
pub(super) trait DistanceWeight: Copy {
    /// Beyond this distance nothing counts, of at most `end`.
    fn farthest(self, end: f32) -> f32;

    /// `weight`, by the distance.
    fn weigh(self, weight: f32, distance: f32) -> f32;
}

/// All distances count alike.
#[derive(Clone, Copy)]
struct NoFade;

impl DistanceWeight for NoFade {
    #[inline(always)]
    fn farthest(self, end: f32) -> f32 {
        end
    }

    #[inline(always)]
    fn weigh(self, weight: f32, _: f32) -> f32 {
        weight
    }
}

impl DistanceWeight for Fade {
    #[inline(always)]
    fn farthest(self, end: f32) -> f32 {
        Reach { end, fade: Some(self) }.farthest()
    }

    #[inline(always)]
    fn weigh(self, weight: f32, distance: f32) -> f32 {
        weight * self.weight(distance)
    }
}

#[inline(always)]
fn body<W: DistanceWeight>(obstacles: &[Obstacle], views: &[View], fade: W, cone: f32, covered: &mut [f32]) {
    let (sine, cosine) = trig::sin_cos(cone);
    let slope = sine / cosine;
    let mut nearby = Vec::new();
    for obstacle in obstacles {
        let mut blocks = ConeBlocks::default();
        blocks.gather(obstacle, views, slope, fade);
        nearby.push(blocks);
    }
    let mut alone = ConeBlocks::default();
    let mut layers = Layers::default();
    for (view, covered) in views.iter().zip(covered) {
        layers.clear();
        let mut sums = [F32x16::splat(0.0); 2];
        for (obstacle, shared) in obstacles.iter().zip(&nearby) {
            let gap = view.gap.at(obstacle.size);
            let farthest = fade.farthest(view.reach);
            let cone = Cone { at: view.at, slope, end: view.reach, fade, farthest, gap };
            let blocks = if shared.are_all() {
                shared
            } else {
                alone.gather(obstacle, std::slice::from_ref(view), slope, fade);
                &alone
            };
            cone.look(obstacle, blocks, &mut sums, &mut layers);
        }
        let (mut front, mut back) = (0.0, 0.0);
        for lane in 0..LANES {
            front += sums[0].0[lane];
            back += sums[1].0[lane];
        }
        let share = (layers.covered([front, back]) - ROUNDING) / (1.0 - 2.0 * ROUNDING);
        let share = if share > 0.0 { share } else { 0.0 };
        *covered = if share < 1.0 { share } else { 1.0 };
    }
}

/// An edge as seen in a cone.
struct SeenEdge {
    /// Its contribution to the mean over the disc.
    share: f32,
    /// Whether a part of it is inside the disc.
    is_met: bool,
    /// The ends of that part, in radii of the disc.
    ends: [[f32; 2]; 2],
    /// How much a surface at its distance counts.
    weight: f32,
}

/// A cone upwind of a CV.
struct Cone<W> {
    at: Vec3,
    /// Radius ÷ distance.
    slope: f32,
    /// Where the offset ends.
    end: f32,
    fade: W,
    /// Beyond this distance nothing counts.
    farthest: f32,
    gap: f32,
}

impl<W: DistanceWeight> Cone<W> {
    /// Adds how many times the mesh covers the disc with front and with back faces, on average; spread over the lanes.
    #[inline(always)]
    fn look(&self, obstacle: &Obstacle, nearby: &ConeBlocks, sums: &mut [F32x16; 2], layers: &mut Layers) {
        let Some(edges) = &obstacle.edges else { return };
        for group in nearby.groups() {
            let mut met = self.meeting(&group.boxes);
            if met == 0 {
                continue;
            }
            let [one_sided, beside] = group.facings.seen_from(&group.boxes, self.at, self.gap, ASIDE[0] * self.slope);
            met &= !(one_sided & beside);
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                let index = group.blocks[lane] as usize;
                let block = &obstacle.tree.blocks()[index];
                let lanes = self.meeting(&block.boxes()) & block.filled();
                if lanes == 0 {
                    continue;
                }
                let corners = self.seen(&block.corners);
                if one_sided >> lane & 1 == 1 {
                    self.add_centre(&corners, lanes, sums, layers);
                } else {
                    self.add(&corners, &self.seen(edges.of_block(index)), lanes, sums, layers);
                }
            }
        }
    }

    /// Points relative to the tip, sheared so that the disc's centre is on the axis.
    #[inline(always)]
    fn seen(&self, points: &[Lanes<3>; 3]) -> [Lanes<3>; 3] {
        let mut seen = *points;
        let (x, y) = (ASIDE[0] * self.slope, ASIDE[1] * self.slope);
        for point in &mut seen {
            for lane in 0..LANES {
                let upwind = point[2].0[lane] - self.at[2];
                point[0].0[lane] = (point[0].0[lane] - self.at[0]) - x * upwind;
                point[1].0[lane] = (point[1].0[lane] - self.at[1]) - y * upwind;
                point[2].0[lane] = upwind;
            }
        }
        seen
    }

    /// Adds sixteen triangles.
    #[inline(always)]
    fn add(
        &self,
        corners: &[Lanes<3>; 3],
        thirds: &[Lanes<3>; 3],
        lanes: u16,
        sums: &mut [F32x16; 2],
        layers: &mut Layers,
    ) {
        let mut count = F32x16::splat(0.0);
        let mut at_centre = 0;
        let (mut front, mut open) = ([false; LANES], [[false; LANES]; 3]);
        for lane in 0..LANES {
            let at @ [a, b, c] = [get(&corners[0], lane), get(&corners[1], lane), get(&corners[2], lane)];
            let seen = Seen::from(at);
            let counts = self.counts(seen.volume, [a, b, c]) & (lanes >> lane & 1 == 1);
            front[lane] = seen.volume > 0.0;

            let [x, y, z] = [is_left(a, b), is_left(b, c), is_left(c, a)];
            let inside = ((x & y & z) | !(x | y | z)) & (seen.towards > 0.0);
            let weight = self.weight(seen.towards / seen.across);
            count.0[lane] = if inside & counts { weight } else { 0.0 };
            at_centre |= u16::from(inside & counts) << lane;

            for side in 0..3 {
                let (from, to) = (at[side], at[(side + 1) % 3]);
                let third = get(&thirds[side], lane);
                let volume = vector::dot(cross(to, from), third);
                let continues = self.counts(volume, [to, from, third]) & ((volume > 0.0) == (seen.volume > 0.0));
                open[side][lane] = counts & !continues;
            }
        }
        add_centres(at_centre, &front, &count, layers);
        for side in 0..3 {
            let mut any = false;
            for lane in 0..LANES {
                any |= open[side][lane];
            }
            if any {
                let mut meets = 0;
                let mut seen = [F32x16::splat(0.0); 6];
                for lane in 0..LANES {
                    let (from, to) = (get(&corners[side], lane), get(&corners[(side + 1) % 3], lane));
                    let edge = self.edge(from, to);
                    let share = if front[lane] { edge.share } else { -edge.share };
                    count.0[lane] += if open[side][lane] { share } else { 0.0 };
                    meets |= u16::from(edge.is_met & open[side][lane]) << lane;
                    let [[ax, ay], [bx, by]] = edge.ends;
                    let change = if is_left(from, to) == front[lane] { -1.0 } else { 1.0 };
                    for (seen, number) in seen.iter_mut().zip([ax, ay, bx, by, change, edge.weight]) {
                        seen.0[lane] = number;
                    }
                }
                while meets != 0 {
                    let lane = meets.trailing_zeros() as usize;
                    meets &= meets - 1;
                    let [ax, ay, bx, by, change, weight] = seen.map(|seen| seen.0[lane]);
                    layers.add_edge(front[lane], Edge { from: [ax, ay], to: [bx, by], change, weight });
                }
            }
        }
        add_counts(&front, &count, sums);
    }

    /// Adds sixteen triangles that count and have no open sides.
    #[inline(always)]
    fn add_centre(&self, corners: &[Lanes<3>; 3], lanes: u16, sums: &mut [F32x16; 2], layers: &mut Layers) {
        let mut count = F32x16::splat(0.0);
        let (mut front, mut at_centre) = ([false; LANES], 0);
        for lane in 0..LANES {
            let [a, b, c] = [get(&corners[0], lane), get(&corners[1], lane), get(&corners[2], lane)];
            let seen = Seen::from([a, b, c]);
            front[lane] = seen.volume > 0.0;
            let [x, y, z] = [is_left(a, b), is_left(b, c), is_left(c, a)];
            let inside = ((x & y & z) | !(x | y | z)) & (seen.towards > 0.0) & (lanes >> lane & 1 == 1);
            let weight = self.weight(seen.towards / seen.across);
            count.0[lane] = if inside { weight } else { 0.0 };
            at_centre |= u16::from(inside) << lane;
        }
        if at_centre != 0 {
            add_centres(at_centre, &front, &count, layers);
            add_counts(&front, &count, sums);
        }
    }

    /// Whether a triangle with this volume with the tip has an area and is not one that the CV lies on.
    #[inline(always)]
    fn counts(&self, volume: f32, [a, b, c]: [Vec3; 3]) -> bool {
        let area = vector::length(cross(sub(b, a), sub(c, a)));
        (area > 0.0) & (volume.abs() > self.gap * area)
    }

    /// The fraction of the wind that is stopped by a surface at a distance: 1 except near the end of the offset, unless
    /// it fades.
    #[inline(always)]
    fn weight(&self, distance: f32) -> f32 {
        let weight = (1.0 - distance / self.end) * (1.0 / FADE);
        let weight = if weight > 0.0 { weight } else { 0.0 };
        let weight = if weight < 1.0 { weight } else { 1.0 };
        self.fade.weigh(weight, distance)
    }

    /// Contribution of an edge to the mean over the disc: an integral over the part of it inside the disc, as seen from
    /// the centre. The surface is on the left of the edge.
    #[inline(always)]
    fn edge(&self, from: Vec3, to: Vec3) -> SeenEdge {
        let (start, end) = self.near_the_cone(from, to);
        let along = sub(to, from);
        // An end that is not clipped keeps its bits, since the next edge begins there.
        let p = vector::add(from, vector::scale(along, start));
        let q = vector::sub(to, vector::scale(along, 1.0 - end));
        let in_front = (start < end) & (p[2] > 0.0) & (q[2] > 0.0);
        let (near, far) = (1.0 / (p[2] * self.slope), 1.0 / (q[2] * self.slope));
        let ([px, py], [qx, qy]) = ([p[0] * near, p[1] * near], [q[0] * far, q[1] * far]);

        // The part of the line from p to q inside the unit disc.
        let [dx, dy] = [qx - px, qy - py];
        let square = dx * dx + dy * dy;
        let half = px * dx + py * dy;
        let inside = half * half - square * (px * px + py * py - 1.0);
        let root = if inside > 0.0 { inside.sqrt() } else { 0.0 };
        let (enters, leaves) = ((-half - root) / square, (root - half) / square);
        let enters = if enters > 0.0 { enters } else { 0.0 };
        let leaves = if leaves < 1.0 { leaves } else { 1.0 };
        let [ax, ay] = [px + enters * dx, py + enters * dy];
        let [bx, by] = [qx - (1.0 - leaves) * dx, qy - (1.0 - leaves) * dy];
        let twice_area = (ax * by - ay * bx).abs();
        let angle = trig::atan2(twice_area, ax * bx + ay * by);

        // Along a line in perspective the inverse of the distance is linear.
        let nearest = -half / square;
        let nearest = if nearest > enters { nearest } else { enters };
        let nearest = if nearest < leaves { nearest } else { leaves };
        let distance = 1.0 / ((1.0 - nearest) / p[2] + nearest / q[2]);

        let weight = self.weight(distance);
        let share = (twice_area - angle) * (0.5 / PI) * weight;
        let share = if is_left(from, to) { share } else { -share };
        let sound = in_front & (inside > 0.0) & (square > 0.0) & (enters < leaves) & (share.abs() <= 1.0);
        SeenEdge { share: if sound { share } else { 0.0 }, is_met: sound, ends: [[ax, ay], [bx, by]], weight }
    }

    /// The interval of an edge, 0…1, inside the pyramid around the cone; start ≥ end if it is outside.
    #[inline(always)]
    fn near_the_cone(&self, from: Vec3, to: Vec3) -> (f32, f32) {
        let (mut start, mut end) = (0.0, 1.0);
        let slope = MARGIN * self.slope;
        for axis in 0..2 {
            for side in [-1.0, 1.0] {
                let (a, b) = (slope * from[2] - side * from[axis], slope * to[2] - side * to[axis]);
                let crosses = a / (a - b);
                start = if (a < 0.0) & (b >= 0.0) & (crosses > start) { crosses } else { start };
                end = if (a >= 0.0) & (b < 0.0) & (crosses < end) { crosses } else { end };
                end = if (a < 0.0) & (b < 0.0) { -1.0 } else { end };
            }
        }
        (start, end)
    }
}

impl<W> Cone<W> {
    /// A bit for each lane whose box meets the cone.
    #[inline(always)]
    fn meeting(&self, boxes: &Boxes) -> u16 {
        meeting_cones(boxes, [self.at; 2], self.slope, self.farthest)
    }
}

/// A bit for each lane whose box meets one of the cones whose tips lie between two corners.
#[inline(always)]
pub(super) fn meeting_cones(boxes: &Boxes, [low, high]: [Vec3; 2], slope: f32, farthest: f32) -> u16 {
    let mut mask = 0;
    for lane in 0..LANES {
        let mut square = 0.0;
        for axis in 0..2 {
            let below = boxes.low[axis].0[lane] - high[axis];
            let above = low[axis] - boxes.high[axis].0[lane];
            let outside = if below > above { below } else { above };
            let outside = if outside > 0.0 { outside } else { 0.0 };
            square += outside * outside;
        }
        let far = boxes.high[2].0[lane] - low[2];
        let near = boxes.low[2].0[lane] - high[2];
        // A little wider than the cone, to allow for rounding and `ASIDE`.
        let radius = slope * 1.001 * far;
        let meets = (far > 0.0) & (near <= farthest) & (square <= radius * radius);
        mask |= u16::from(meets) << lane;
    }
    mask
}

/// Adds the layers that triangles are at the centre of the disc.
#[inline(always)]
fn add_centres(mut at_centre: u16, front: &[bool; LANES], count: &F32x16, layers: &mut Layers) {
    while at_centre != 0 {
        let lane = at_centre.trailing_zeros() as usize;
        at_centre &= at_centre - 1;
        layers.add_centre(front[lane], count.0[lane]);
    }
}

/// Adds what each triangle counts to the sum of front or of back faces.
#[inline(always)]
fn add_counts(front: &[bool; LANES], count: &F32x16, sums: &mut [F32x16; 2]) {
    for lane in 0..LANES {
        let (to_front, to_back) = if front[lane] { (count.0[lane], 0.0) } else { (0.0, count.0[lane]) };
        sums[0].0[lane] += to_front;
        sums[1].0[lane] += to_back;
    }
}

/// Whether the axis is to the left of an edge, seen along the axis. If it lies on the edge, that holds for exactly one
/// of the edge's two directions, so exactly one of two neighbouring triangles contains it.
#[inline(always)]
fn is_left(from: Vec3, to: Vec3) -> bool {
    let side = beside(from, to);
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    (side > 0.0) | ((side == 0.0) & ((dx > 0.0) | ((dx == 0.0) & (dy > 0.0))))
}
