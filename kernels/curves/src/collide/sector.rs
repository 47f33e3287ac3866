//! The sector that a segment sweeps when it turns about its pivot, and where a triangle blocks it.
//!
//! A triangle intersects the sector's plane in a line segment, here called a piece. Along the part of it inside the
//! circle the angle seen from the pivot is monotonic, so that part blocks one interval of angles, which its ends give
//! in closed form. A round segment, of a curve with a width, is a capsule (see [`super::capsule`]). One that is thickened
//! by rounding only is blocked by the triangle's part between two planes at half its thickness, whose outline is up to
//! five such pieces, and by what is nearer to it than that in the plane: a point at radius r blocks the angles up to
//! asin(half/r) around it. Where the pivot itself is nearer to a piece than that, as next to a root on the skin, only the end
//! of the segment is kept away.
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
    /// Half the thickness; 0 tests the plane itself.
    pub(super) half: f64,
    /// The length of a capsule, with the rounding of its end; `None` of a segment that is not one.
    pub(super) capsule: Option<f64>,
    /// Arc length kept from contacts, beyond the thickness.
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

/// What a triangle does to a turn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Obstruction {
    /// Whether it blocks the turn at its start.
    pub(super) at_start: bool,
    /// The least angle ahead at which it stops the turn, `back` before a contact.
    pub(super) stop: Option<f64>,
}

/// A point of the plane, along u and v.
pub(super) type P2 = [f64; 2];

/// Sine of the angle between the ends of a piece above which rounding does not decide on which side of each other they lie.
const CLEARLY_APART: f64 = 1e-12;

/// An interval of parameters that is empty.
const NO_PART: [f64; 2] = [1.0, 0.0];

impl Sector {
    /// The direction after a turn by `angle`.
    pub(super) fn direction(&self, angle: f64) -> DVec3 {
        if angle == 0.0 {
            return self.u;
        }
        let (sine, cosine) = libm::sincos(angle);
        self.u * cosine + self.v * sine
    }

    /// What the triangle does to a turn to the direction `until`; may leave out where it stops no turn before that.
    #[inline(always)]
    pub(super) fn obstruction(&self, until: P2, corners: &[DVec3; 3]) -> Obstruction {
        if let Some(length) = self.capsule {
            return self.capsule_obstruction(length, corners);
        }
        let mut found = Obstruction::default();
        if self.half == 0.0 {
            let Some(piece) = slice(&self.heights(corners), 0.0, |k| self.flat(&corners[k])) else { return found };
            if self.inner > 0.0 {
                self.within_reach(piece, |p, q| found.add_before(self, p, q, until));
                return found;
            }
            // No closure here: it is not compiled for a kernel's path.
            let Some(part) = inside_circle(piece[0], piece[1], self.reach) else { return found };
            let [p, q] = part_of(piece, part);
            found.add_before(self, p, q, until);
        } else {
            self.blocked_by(corners, |blocked| found.add(&blocked, self.back));
        }
        found
    }

    /// Whether a piece between two points may stop a turn to the direction `until`.
    #[inline(always)]
    fn may_stop(&self, p: P2, q: P2, until: P2) -> bool {
        match [p[1] < 0.0, q[1] < 0.0] {
            [true, true] => false,
            [false, false] => !(self.is_beyond(p, until) && self.is_beyond(q, until)),
            // A piece from behind to the front passes the start or, on its left, the opposite direction.
            [true, false] => p[0] * q[1] >= q[0] * p[1] || !self.is_beyond(q, until),
            [false, true] => q[0] * p[1] >= p[0] * q[1] || !self.is_beyond(p, until),
        }
    }

    /// Whether a point lies `back` beyond the ray in the direction `until`: at radius r it is past that by
    /// asin(back/r) ≥ back/r.
    #[inline(always)]
    fn is_beyond(&self, p: P2, until: P2) -> bool {
        until[0] * p[1] - until[1] * p[0] >= self.back
    }

    /// Calls `found` with each interval of angles that the triangle blocks.
    #[inline(always)]
    pub(super) fn blocked_by(&self, corners: &[DVec3; 3], mut found: impl FnMut(Blocked)) {
        if let Some(length) = self.capsule {
            return self.capsule_blocked_by(length, corners, found);
        }
        if self.half == 0.0 {
            self.pieces(corners, |p, q| found(Blocked::between(p, q)));
            return;
        }
        let heights = self.heights(corners);
        let low = heights.iter().fold(f64::INFINITY, |low, h| low.min(*h));
        let high = heights.iter().fold(f64::NEG_INFINITY, |high, h| high.max(*h));
        if low <= self.half && high >= -self.half {
            self.blocked_in_slab(&heights, corners.each_ref().map(|corner| self.flat(corner)), found);
        }
    }

    /// Calls `found` with the ends of each piece in which the triangle cuts the plane of the turn.
    #[inline(always)]
    pub(super) fn pieces(&self, corners: &[DVec3; 3], found: impl FnMut(P2, P2)) {
        if let Some(piece) = slice(&self.heights(corners), 0.0, |k| self.flat(&corners[k])) {
            self.within_reach(piece, found);
        }
    }

    /// Heights above the plane.
    #[inline(always)]
    fn heights(&self, corners: &[DVec3; 3]) -> [f64; 3] {
        corners.map(|corner| self.n.dot(&(corner - self.pivot)))
    }

    /// A point, projected to the plane.
    #[inline(always)]
    fn flat(&self, point: &DVec3) -> P2 {
        let from_pivot = point - self.pivot;
        [self.u.dot(&from_pivot), self.v.dot(&from_pivot)]
    }

    /// As [`Sector::blocked_by`] for a thick segment.
    fn blocked_in_slab(&self, heights: &[f64; 3], flat: [P2; 3], mut found: impl FnMut(Blocked)) {
        // Each with the angles that it blocks around it.
        let mut intervals: [Option<[Blocked; 2]>; 10] = [None; 10];
        let mut count = 0;
        let mut add = |p: P2, q: P2| {
            intervals[count] = Some([Blocked::between(p, q), self.around(p, q)]);
            count += 1;
        };
        for level in [-self.half, self.half] {
            if let Some(piece) = slice(heights, level, |k| flat[k]) {
                self.within_reach(piece, &mut add);
            }
        }
        for k in 0..3 {
            let (a, b) = (k, (k + 1) % 3);
            if let Some(piece) = between_levels([flat[a], flat[b]], [heights[a], heights[b]], self.half) {
                self.within_reach(piece, &mut add);
            }
        }
        // The outline is one closed curve: seen from a pivot outside it, its pieces form one interval.
        let pieces = || intervals.iter().flatten();
        let Some([first, around]) = pieces().next() else { return };
        let (all, around) = pieces().fold((*first, *around), |(all, wide), [piece, around]| {
            let turns = if piece.lo - all.lo > std::f64::consts::PI {
                -std::f64::consts::TAU
            } else if all.lo - piece.lo > std::f64::consts::PI {
                std::f64::consts::TAU
            } else {
                0.0
            };
            (all.with(&piece.turned(turns)), wide.with(&around.turned(turns)))
        });
        if all.hi - all.lo > std::f64::consts::PI {
            pieces().for_each(|[_, around]| found(around.wrapped()));
        } else if all.lo < 0.0 && all.hi >= 0.0 {
            // It touches the thick segment at the start: its intersection with the middle plane decides which side it
            // is on.
            if let Some(piece) = slice(heights, 0.0, |k| flat[k]) {
                self.within_reach(piece, |p, q| found(self.around(p, q).wrapped()));
            }
        } else {
            found(around.wrapped());
        }
    }

    /// The angles at which a thick segment is too near to a straight piece between two points.
    fn around(&self, p: P2, q: P2) -> Blocked {
        let piece = Blocked::between(p, q);
        let is_clear = nearest(p, q) >= self.half;
        let by =
            |radius: f64| libm::asin((self.half / if is_clear { radius } else { self.reach - self.half }).min(1.0));
        Blocked { lo: piece.lo - by(piece.lo_radius), hi: piece.hi + by(piece.hi_radius), ..piece }
    }

    /// Calls `found` with the ends of each part of a straight piece inside the circle of `reach` and outside that of
    /// `inner`.
    #[inline(always)]
    fn within_reach(&self, piece: [P2; 2], mut found: impl FnMut(P2, P2)) {
        let [p, q] = piece;
        let Some([from, to]) = inside_circle(p, q, self.reach) else { return };
        let skipped = if self.inner > 0.0 { inside_circle(p, q, self.inner) } else { None };
        let parts = match skipped {
            Some([near, far]) => [
                if near > from { [from, near.min(to)] } else { NO_PART },
                if far < to { [far.max(from), to] } else { NO_PART },
            ],
            None => [[from, to], NO_PART],
        };
        // One call for both: a closure called from several places is not compiled for a kernel's path.
        for [from, to] in parts {
            if from <= to {
                let [p, q] = part_of(piece, [from, to]);
                found(p, q);
            }
        }
    }
}

/// The ends of a part of a straight piece, 0…1.
#[inline(always)]
fn part_of([p, q]: [P2; 2], [from, to]: [f64; 2]) -> [P2; 2] {
    let side = [q[0] - p[0], q[1] - p[1]];
    [[p[0] + from * side[0], p[1] + from * side[1]], [p[0] + to * side[0], p[1] + to * side[1]]]
}

impl Blocked {
    /// The angles of a straight piece between two points, neither at the pivot.
    #[inline(always)]
    pub(super) fn between(p: P2, q: P2) -> Self {
        let (first, last) = in_order(p, q);
        let (lo, hi) = (angle(first), angle(last));
        // An interval across the opposite direction continues past π.
        let hi = if hi < lo { hi + std::f64::consts::TAU } else { hi };
        Self { lo, hi, lo_radius: radius(first), hi_radius: radius(last) }
    }

    fn turned(&self, by: f64) -> Self {
        Self { lo: self.lo + by, hi: self.hi + by, ..*self }
    }

    /// The same interval with `lo` in −π…π.
    pub(super) fn wrapped(&self) -> Self {
        let turns = match self.lo {
            lo if lo < -std::f64::consts::PI => std::f64::consts::TAU,
            lo if lo > std::f64::consts::PI => -std::f64::consts::TAU,
            _ => 0.0,
        };
        self.turned(turns)
    }

    /// The interval from the lesser start to the greater end of both.
    fn with(&self, other: &Self) -> Self {
        let (lo, lo_radius) = if other.lo < self.lo { (other.lo, other.lo_radius) } else { (self.lo, self.lo_radius) };
        let (hi, hi_radius) = if other.hi > self.hi { (other.hi, other.hi_radius) } else { (self.hi, self.hi_radius) };
        Self { lo, hi, lo_radius, hi_radius }
    }
}

impl Obstruction {
    /// Adds the piece between two points in the plane of a sector if it may stop a turn to the direction `until`.
    #[inline(always)]
    fn add_before(&mut self, sector: &Sector, p: P2, q: P2, until: P2) {
        if sector.may_stop(p, q, until) {
            self.add_piece(p, q, sector.back);
        }
    }

    /// Adds the piece between two points, neither at the pivot: as [`Obstruction::add`] of [`Blocked::between`], but finds
    /// only the angles that count.
    #[inline(always)]
    pub(super) fn add_piece(&mut self, p: P2, q: P2, back: f64) {
        let ([x, y], [last_x, last_y]) = in_order(p, q);
        // It runs from behind the start to its front, on the side that the turn leaves.
        if y < 0.0 && last_y > 0.0 {
            self.at_start = true;
            return;
        }
        let lo = if y > 0.0 { angle([x, y]) } else { 0.0 };
        let sizes = (x.abs() + y.abs()) * (last_x.abs() + last_y.abs());
        // From an angle in 0…π it runs to a larger one, less than π farther: never around to the start.
        if lo > 0.0 && x * last_y - y * last_x > CLEARLY_APART * sizes {
            self.stop_at(lo, radius([x, y]), back);
        } else {
            self.add(&Blocked::between(p, q), back);
        }
    }

    /// Adds an interval.
    #[inline(always)]
    fn add(&mut self, blocked: &Blocked, back: f64) {
        // It contains the angle 0, or a full turn.
        self.at_start |= (blocked.lo <= 0.0 && blocked.hi >= 0.0) || blocked.hi >= std::f64::consts::TAU;
        if blocked.lo > 0.0 {
            self.stop_at(blocked.lo, blocked.lo_radius, back);
        }
    }

    /// Adds a contact at an angle, at a distance from the pivot.
    #[inline(always)]
    pub(super) fn stop_at(&mut self, angle: f64, radius: f64, back: f64) {
        let angle = (angle - back / radius).max(0.0);
        self.stop = Some(self.stop.map_or(angle, |least| least.min(angle)));
    }
}

/// The ends of a straight piece, counter-clockwise.
#[inline(always)]
fn in_order(p: P2, q: P2) -> (P2, P2) {
    if p[0] * q[1] - p[1] * q[0] >= 0.0 { (p, q) } else { (q, p) }
}

#[inline(always)]
fn angle(p: P2) -> f64 {
    libm::atan2(p[1], p[0])
}

#[inline(always)]
fn radius(p: P2) -> f64 {
    (p[0] * p[0] + p[1] * p[1]).sqrt()
}

/// Distance of a straight piece from the pivot.
fn nearest(p: P2, q: P2) -> f64 {
    let side = [q[0] - p[0], q[1] - p[1]];
    let square = side[0] * side[0] + side[1] * side[1];
    let along = if square > 0.0 { (-(p[0] * side[0] + p[1] * side[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    radius([p[0] + along * side[0], p[1] + along * side[1]])
}

/// Where the plane at height `level` cuts a triangle with corners at these heights. A corner at the level counts as
/// above it in every triangle, so that a closed surface is cut along closed lines.
#[inline(always)]
fn slice(heights: &[f64; 3], level: f64, flat: impl Fn(usize) -> P2) -> Option<[P2; 2]> {
    let above = heights.map(|height| height >= level);
    let alone = match above {
        [a, b, c] if a == b && b == c => return None,
        [a, b, c] if b == c && a != b => 0,
        [a, b, c] if a == c && b != c => 1,
        _ => 2,
    };
    let from = flat(alone);
    let cut = |other: usize| {
        let share = (level - heights[alone]) / (heights[other] - heights[alone]);
        let to = flat(other);
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
#[inline(always)]
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
