//! A moving edge against a moving edge of another surface: whether they crossed, and how close they are.
//!
//! Two edges are in contact if each is its own surface's closest feature to the other. A pair therefore counts only
//! if the direction between them points out of both surfaces, away from the triangles adjacent to the edges.

use super::surface::{Edge, Moment, NONE, TriangleSurface};
use super::vertex::{ContactRules, MovingSurface, ON};
use numerics::closest_point::along;
use numerics::coplanarity::{MotionSeparation, edge_separation, sign_changes};
use numerics::vector::DVec3;

/// Two edges that may be in contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Weights of the ends of the first and the second edge.
    pub(super) weights: [[f64; 2]; 2],
    /// Unit normal from the second to the first edge, at the end of the motion.
    pub(super) normal: DVec3,
}

/// Sine of the angle by which adjacent triangles may lie on the wrong side, for edges that crossed: more than the
/// dent that an edge makes in a flat surface.
const LEAN_THROUGH: f64 = 0.5;
/// The same for edges that are close.
const LEAN_NEAR: f64 = 0.1;

/// Tests two edges of different surfaces for contact.
pub(super) fn hit(surfaces: [&MovingSurface<'_>; 2], edges: [&Edge; 2], rules: &ContactRules) -> Option<Hit> {
    let pair = Pair { surfaces, edges };
    let last = pair.last();
    let mut far = true;
    for piece in 0..last {
        let configuration = [pair.configuration(piece), pair.configuration(piece + 1)];
        let apart = edge_separation(&configuration[0], &configuration[1], rules.reach);
        far &= apart == MotionSeparation::Far;
        if apart == MotionSeparation::Unknown
            && let Some(hit) = pair.through(piece, &configuration)
        {
            return Some(hit);
        }
    }
    if far {
        return None;
    }
    pair.near(last, rules.reach).or_else(|| pair.near(0, rules.reach))
}

struct Pair<'a> {
    surfaces: [&'a MovingSurface<'a>; 2],
    edges: [&'a Edge; 2],
}

impl Pair<'_> {
    /// Index of the last pose.
    fn last(&self) -> usize {
        self.surfaces[0].poses.len() - 1
    }

    fn segments(&self, pose: usize) -> [[DVec3; 2]; 2] {
        [0, 1].map(|side| {
            let at = Moment::of(self.surfaces[side].poses[pose]);
            self.edges[side].ends.map(|end| at.position(end))
        })
    }

    /// Both edge vectors and the offset between their first ends.
    #[inline]
    fn configuration(&self, pose: usize) -> [DVec3; 3] {
        let [[p, q], [a, b]] = self.segments(pose);
        [q - p, b - a, a - p]
    }

    /// A crossing during one interval of the motion.
    fn through(&self, piece: usize, [start, end]: &[[DVec3; 3]; 2]) -> Option<Hit> {
        for (t, above) in sign_changes(start, end).iter() {
            let [d, e, r] = [0, 1, 2].map(|k| start[k].lerp(&end[k], t));
            let size = d.norm().max(e.norm()).max(start[2].norm()).max(end[2].norm());
            let [s, u] = along([DVec3::zeros(), d], [r, r + e]);
            let side = if above { -1.0 } else { 1.0 };
            let Some(normal) = (d.cross(&e) * side).try_normalize(1e-12 * d.norm() * e.norm()) else { continue };
            let time = piece as f64 + t;
            if (d * s - r - e * u).norm() <= ON * size && self.faces(time, [s, u], normal, LEAN_THROUGH) {
                let [d, e, _] = self.configuration(self.last());
                let last = (d.cross(&e) * side).try_normalize(1e-12 * d.norm() * e.norm());
                // The edges may have rotated past each other; then the normal at the crossing is kept.
                let normal = last.filter(|last| last.dot(&normal) > 0.5).unwrap_or(normal);
                return Some(Hit { weights: weights([s, u]), normal });
            }
        }
        None
    }

    /// Closeness at one pose, reported for the last.
    fn near(&self, pose: usize, reach: f64) -> Option<Hit> {
        let inner = |share: f64| share > ON && share < 1.0 - ON;
        let segments = self.segments(pose);
        let shares = along(segments[0], segments[1]);
        let away = between(segments, shares);
        let distance = away.norm();
        if !(distance <= reach && distance > 0.0 && shares.into_iter().all(inner)) {
            return None;
        }
        let normal = away / distance;
        if !self.faces(pose as f64, shares, normal, LEAN_NEAR) {
            return None;
        }
        let last = between(self.segments(self.last()), shares);
        let turned = last.try_normalize(0.0).filter(|last| last.dot(&normal) > 0.0);
        Some(Hit { weights: weights(shares), normal: turned.unwrap_or(normal) })
    }

    /// Whether the normal points out of the second surface at its edge, and into the first.
    fn faces(&self, time: f64, shares: [f64; 2], normal: DVec3, lean: f64) -> bool {
        let is_ridge = |side: usize, out: DVec3| {
            let on = self.surfaces[side];
            is_ridge(on.surface, &on.moment(time), self.edges[side], shares[side], out, lean)
        };
        is_ridge(1, normal) && is_ridge(0, -normal)
    }
}

/// Weights of the ends of two edges at parameters along them.
fn weights(shares: [f64; 2]) -> [[f64; 2]; 2] {
    shares.map(|share| [1.0 - share, share])
}

fn between([[p, q], [a, b]]: [[DVec3; 2]; 2], [s, u]: [f64; 2]) -> DVec3 {
    p.lerp(&q, s) - a.lerp(&b, u)
}

/// Whether the adjacent triangles fall away from an edge as seen along `out`, which has to point outwards.
fn is_ridge(surface: &TriangleSurface, at: &Moment<'_>, edge: &Edge, share: f64, out: DVec3, lean: f64) -> bool {
    let point = at.position(edge.ends[0]).lerp(&at.position(edge.ends[1]), share);
    let falls = |third: u32| {
        let direction = at.position(third) - point;
        out.dot(&direction) <= lean * direction.norm()
    };
    if !edge.opposite.into_iter().all(|third| third == NONE || falls(third)) {
        return false;
    }
    let outward = || edge.faces.into_iter().filter_map(|face| surface.normal(at, face)).sum::<DVec3>();
    !surface.closed || outward().dot(&out) > 0.0
}
