//! The sector that a segment sweeps when it turns about its pivot, and where a triangle blocks it.
//!
//! A triangle intersects the sector's plane in a line segment, here called a piece. Along the part of it inside the
//! circle the angle seen from the pivot is monotonic, so that part blocks one interval of angles, which its ends give
//! in closed form. A thick segment is a slab: it is blocked by the triangle's part between two planes, whose outline is
//! up to five such pieces.
//!
//! Computed in f64 relative to the pivot: exact up to f64 rounding. Angles in radians, lengths in metres.

use numerics::vector::DVec3;

/// A segment about to turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sector {
    /// The point about which it turns.
    pub(super) pivot: DVec3,
    /// Its direction, unit.
    pub(super) u: DVec3,
    /// Unit, perpendicular to `u`, in the direction it turns.
    pub(super) v: DVec3,
    /// u × v.
    pub(super) n: DVec3,
    /// Obstacles farther from the pivot are ignored: the length of the segment plus a margin.
    pub(super) reach: f64,
    /// Obstacles closer to the pivot are ignored.
    pub(super) inner: f64,
    /// Half the thickness across the plane; 0 tests the plane itself.
    pub(super) half: f64,
    /// Arc length kept from contacts.
    pub(super) back: f64,
}

/// An interval of angles that a triangle blocks: lo ≤ hi, lo in −π…π; and the distances of its ends from the pivot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blocked {
    pub(super) lo: f64,
    pub(super) hi: f64,
    pub(super) lo_radius: f64,
    pub(super) hi_radius: f64,
}

/// A point of the plane, along u and v.
pub(super) type P2 = [f64; 2];

impl Sector {
    /// The direction after a turn by `angle`.
    pub(super) fn direction(&self, angle: f64) -> DVec3 {
        if angle == 0.0 {
            return self.u;
        }
        let (sine, cosine) = libm::sincos(angle);
        self.u * cosine + self.v * sine
    }

    /// Calls `found` with each interval of angles that the triangle blocks; may leave out intervals behind the segment
    /// and those that stop no turn before the direction `until`.
    pub(super) fn blocked_before(&self, until: P2, corners: &[DVec3; 3], mut found: impl FnMut(Blocked)) {
        // A point at radius r that lies `back` beyond the ray at angle α is past α by asin(back/r) ≥ back/r.
        let over = |p: P2| until[0] * p[1] - until[1] * p[0] >= self.back;
        let counts = |p: P2, q: P2| match [p[1] < 0.0, q[1] < 0.0] {
            [true, true] => false,
            [false, false] => !(over(p) && over(q)),
            // A piece from behind to the front passes the start or, on its left, the opposite direction.
            [true, false] => p[0] * q[1] >= q[0] * p[1] || !over(q),
            [false, true] => q[0] * p[1] >= p[0] * q[1] || !over(p),
        };
        self.blocked(corners, counts, &mut found);
    }

    /// Calls `found` with each interval of angles that the triangle blocks.
    pub(super) fn blocked_by(&self, corners: &[DVec3; 3], mut found: impl FnMut(Blocked)) {
        self.blocked(corners, |_, _| true, &mut found);
    }

    /// As [`Sector::blocked_by`], restricted to pieces for which `counts` holds where the segment has no thickness.
    fn blocked(&self, corners: &[DVec3; 3], counts: impl Fn(P2, P2) -> bool, mut found: impl FnMut(Blocked)) {
        let heights = corners.map(|corner| self.n.dot(&(corner - self.pivot)));
        let flat = |k: usize| {
            let from_pivot = corners[k] - self.pivot;
            [self.u.dot(&from_pivot), self.v.dot(&from_pivot)]
        };
        if self.half == 0.0 {
            if let Some(piece) = slice(&heights, 0.0, flat) {
                self.within_reach(piece, |p, q| {
                    if counts(p, q) {
                        found(Blocked::between(p, q));
                    }
                });
            }
            return;
        }
        let low = heights.iter().fold(f64::INFINITY, |low, h| low.min(*h));
        let high = heights.iter().fold(f64::NEG_INFINITY, |high, h| high.max(*h));
        if low > self.half || high < -self.half {
            return;
        }
        self.blocked_in_slab(
            &heights,
            corners.each_ref().map(|corner| {
                let from_pivot = *corner - self.pivot;
                [self.u.dot(&from_pivot), self.v.dot(&from_pivot)]
            }),
            found,
        );
    }

    /// As [`Sector::blocked_by`] for a thick segment.
    fn blocked_in_slab(&self, heights: &[f64; 3], flat: [P2; 3], mut found: impl FnMut(Blocked)) {
        let mut intervals: [Option<Blocked>; 10] = [None; 10];
        let mut count = 0;
        let mut add = |blocked: Blocked| {
            intervals[count] = Some(blocked);
            count += 1;
        };
        for level in [-self.half, self.half] {
            if let Some(piece) = slice(heights, level, |k| flat[k]) {
                self.within_reach(piece, |p, q| add(Blocked::between(p, q)));
            }
        }
        for k in 0..3 {
            let (a, b) = (k, (k + 1) % 3);
            if let Some(piece) = between_levels([flat[a], flat[b]], [heights[a], heights[b]], self.half) {
                self.within_reach(piece, |p, q| add(Blocked::between(p, q)));
            }
        }
        // The outline is one closed curve: seen from a pivot outside it, its pieces form one interval.
        let pieces = || intervals.iter().flatten();
        let Some(first) = pieces().next() else { return };
        let all = pieces().fold(*first, |all, piece| {
            let turns = if piece.lo - all.lo > std::f64::consts::PI {
                -std::f64::consts::TAU
            } else if all.lo - piece.lo > std::f64::consts::PI {
                std::f64::consts::TAU
            } else {
                0.0
            };
            let piece = Blocked { lo: piece.lo + turns, hi: piece.hi + turns, ..*piece };
            let (lo, lo_radius) = if piece.lo < all.lo { (piece.lo, piece.lo_radius) } else { (all.lo, all.lo_radius) };
            let (hi, hi_radius) = if piece.hi > all.hi { (piece.hi, piece.hi_radius) } else { (all.hi, all.hi_radius) };
            Blocked { lo, hi, lo_radius, hi_radius }
        });
        if all.hi - all.lo > std::f64::consts::PI {
            pieces().copied().for_each(found);
        } else if all.lo < 0.0 && all.hi >= 0.0 {
            // It touches the thick segment at the start: its intersection with the middle plane decides which side it
            // is on.
            if let Some(piece) = slice(heights, 0.0, |k| flat[k]) {
                self.within_reach(piece, |p, q| found(Blocked::between(p, q)));
            }
        } else {
            found(all);
        }
    }

    /// Calls `found` with the ends of each part of a straight piece inside the circle of `reach` and outside that of
    /// `inner`.
    fn within_reach(&self, [p, q]: [P2; 2], mut found: impl FnMut(P2, P2)) {
        let Some([from, to]) = inside_circle(p, q, self.reach) else { return };
        let at = |t: f64| [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
        let mut part = |from: f64, to: f64| {
            if from <= to {
                found(at(from), at(to));
            }
        };
        match inside_circle(p, q, self.inner) {
            Some([near, far]) if self.inner > 0.0 => {
                if near > from {
                    part(from, near.min(to));
                }
                if far < to {
                    part(far.max(from), to);
                }
            }
            _ => part(from, to),
        }
    }
}

impl Blocked {
    /// The angles of a straight piece between two points, neither at the pivot.
    fn between(p: P2, q: P2) -> Self {
        let left = p[0] * q[1] - p[1] * q[0] >= 0.0;
        let (first, last) = if left { (p, q) } else { (q, p) };
        let angle = |p: P2| libm::atan2(p[1], p[0]);
        let radius = |p: P2| (p[0] * p[0] + p[1] * p[1]).sqrt();
        let (lo, hi) = (angle(first), angle(last));
        // An interval across the opposite direction continues past π.
        let hi = if hi < lo { hi + std::f64::consts::TAU } else { hi };
        Self { lo, hi, lo_radius: radius(first), hi_radius: radius(last) }
    }
}

/// Where the plane at height `level` cuts a triangle with corners at these heights. A corner at the level counts as
/// above it in every triangle, so that a closed surface is cut along closed lines.
fn slice(heights: &[f64; 3], level: f64, flat: impl Fn(usize) -> P2) -> Option<[P2; 2]> {
    let above = heights.map(|height| height >= level);
    let alone = match above {
        [a, b, c] if a == b && b == c => return None,
        [a, b, c] if b == c && a != b => 0,
        [a, b, c] if a == c && b != c => 1,
        _ => 2,
    };
    let cut = |other: usize| {
        let share = (level - heights[alone]) / (heights[other] - heights[alone]);
        let (from, to) = (flat(alone), flat(other));
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
    };
    Some([cut((alone + 1) % 3), cut((alone + 2) % 3)])
}

/// The part of an edge between the levels −half and half.
fn between_levels([p, q]: [P2; 2], [a, b]: [f64; 2], half: f64) -> Option<[P2; 2]> {
    if a.max(b) < -half || a.min(b) > half {
        return None;
    }
    let rise = b - a;
    let at = |level: f64| ((level - a) / rise).clamp(0.0, 1.0);
    let (from, to) = if rise == 0.0 { (0.0, 1.0) } else { (at(-half).min(at(half)), at(-half).max(at(half))) };
    let point = |t: f64| [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
    Some([point(from), point(to)])
}

/// The parameters, 0..1, at which the piece from p to q enters and leaves the circle about the origin.
fn inside_circle(p: P2, q: P2, radius: f64) -> Option<[f64; 2]> {
    let side = [q[0] - p[0], q[1] - p[1]];
    let square = side[0] * side[0] + side[1] * side[1];
    let along = p[0] * side[0] + p[1] * side[1];
    let outside = p[0] * p[0] + p[1] * p[1] - radius * radius;
    if square == 0.0 {
        return (outside <= 0.0).then_some([0.0, 0.0]);
    }
    let under = along * along - square * outside;
    if under < 0.0 {
        return None;
    }
    let root = under.sqrt();
    let (from, to) = (((-along - root) / square).max(0.0), ((-along + root) / square).min(1.0));
    (from <= to).then_some([from, to])
}
