//! Where a thick segment, a capsule of its half thickness, is too near to a triangle as it turns.
//!
//! Turns are followed by separating planes. At an angle at which the segment is clear, the plane across the shortest line
//! between both has the triangle on one side; how far the segment can turn before it comes nearer to that plane than it may
//! is a closed form, and safe, because the triangle is behind it. From there the next plane is found. Against a face the
//! first plane is the answer; against sides and corners the steps converge quadratically, always from the clear side.
//!
//! A triangle blocks one interval of angles, of less than π, if the pivot is farther from it than the segment has to be.
//! Of a pivot that is nearer, as next to a root on the skin, the segment comes no nearer than the pivot, and its end
//! alone keeps the whole distance.

use super::crossing::crossing;
use super::sector::{Blocked, Obstruction, Sector};
use numerics::closest_point::{ClosestPoint, along};
use numerics::vector::DVec3;
use std::f64::consts::{PI, TAU};

/// Steps of a turn; contacts take 2 to 6. After them it counts as stopped where it is, which is clear.
const STEPS: usize = 48;

/// Arc of the end, in distances to be kept, below which a step ends at a contact.
const LAST_STEP: f64 = 1e-4;

/// Distance that planes keep beyond the one asked for, and that pivots have beyond the one asked of segments, relative.
const BEYOND: [f64; 2] = [1e-6, 1e-5];

/// Share of the thickness below which a pivot counts as on the triangle: there only crossings of the axis count.
const ON_IT: f64 = 1e-3;

/// Least step through angles at which the end is too near, radians. What is passed over is closed to it.
const LEAST_STEP: f64 = 2e-3;

/// Part of a segment, from one distance from the pivot to another, that stays this far from a triangle.
#[derive(Clone, Copy)]
struct Part {
    from: f64,
    to: f64,
    kept: f64,
}

/// The shortest line from a triangle to a segment: its length, and its direction if that is not 0.
#[derive(Clone, Copy)]
struct Shortest {
    distance: f64,
    towards: DVec3,
}

/// What a triangle asks of a segment.
struct Asked {
    /// Of the axis; none if the pivot is on the triangle.
    axis: Option<Part>,
    /// Of the end; none if the axis asks as much.
    end: Option<Part>,
}

impl Sector {
    /// What is asked of a thick segment; `None` where the triangle is out of reach.
    fn asked(&self, length: f64, corners: &[DVec3; 3]) -> Option<Asked> {
        let away = ClosestPoint::on(0, self.pivot, *corners).distance;
        if away > length + self.half * (1.0 + BEYOND[1]) {
            return None;
        }
        let kept = self.half.min(away * (1.0 - BEYOND[1]));
        Some(Asked {
            axis: (kept > ON_IT * self.half).then_some(Part { from: 0.0, to: length, kept }),
            end: (kept < self.half).then_some(Part { from: length, to: length, kept: self.half }),
        })
    }

    /// What a triangle does to the turn of a thick segment, up to π.
    pub(super) fn capsule_obstruction(&self, length: f64, corners: &[DVec3; 3]) -> Obstruction {
        let mut found = Obstruction::default();
        let Some(asked) = self.asked(length, corners) else { return found };
        if asked.axis.is_none() {
            self.pieces(corners, |p, q| found.add_piece(p, q, self.back));
        }
        for part in [asked.axis, asked.end].into_iter().flatten() {
            if self.is_too_near(part, 0.0, corners) {
                found.at_start = true;
            } else if let Some(turned) = self.turned(part, 0.0, 1.0, PI, corners) {
                found.stop_at(turned, part.to, self.back);
            }
        }
        found
    }

    /// Calls `found` with each interval of angles at which a thick segment is too near to a triangle.
    pub(super) fn capsule_blocked_by(&self, length: f64, corners: &[DVec3; 3], mut found: impl FnMut(Blocked)) {
        let Some(asked) = self.asked(length, corners) else { return };
        match asked.axis {
            None => self.pieces(corners, |p, q| found(Blocked::between(p, q))),
            Some(axis) => {
                if let Some([lo, hi]) = self.interval(axis, corners) {
                    found(Blocked { lo, hi, lo_radius: axis.to, hi_radius: axis.to }.wrapped());
                }
            }
        }
        if let Some(end) = asked.end {
            self.intervals_of_end(end, corners, |lo, hi| {
                found(Blocked { lo, hi, lo_radius: end.to, hi_radius: end.to }.wrapped());
            });
        }
    }

    /// The one interval at which an axis is too near whose pivot is not.
    fn interval(&self, axis: Part, corners: &[DVec3; 3]) -> Option<[f64; 2]> {
        // It is shorter than π, so half a turn from one of its angles is clear.
        let [below, above] = if self.is_too_near(axis, 0.0, corners) {
            [-PI, PI]
        } else {
            let lo = self.turned(axis, 0.0, 1.0, TAU, corners)?;
            [lo, lo + PI]
        };
        let lo = if below < 0.0 { below + self.turned(axis, below, 1.0, PI, corners).unwrap_or(PI) } else { below };
        let hi = above - self.turned(axis, above, -1.0, PI, corners).unwrap_or(PI);
        Some([lo, hi.max(lo)])
    }

    /// Calls `found` with the start and the end of each interval at which an end is too near.
    fn intervals_of_end(&self, end: Part, corners: &[DVec3; 3], mut found: impl FnMut(f64, f64)) {
        // From a clear angle once around, or all around if there is none.
        let Some(first) = self.next_clear(end, 0.0, TAU, corners) else { return found(-PI, PI) };
        let mut angle = first;
        while angle < first + TAU {
            let Some(turned) = self.turned(end, angle, 1.0, first + TAU - angle, corners) else { break };
            let lo = angle + turned;
            let after = self.next_clear(end, lo + LEAST_STEP, first + TAU, corners).unwrap_or(first + TAU);
            // Back from there, as exactly as the start.
            let hi = after - self.turned(end, after, -1.0, after - lo, corners).unwrap_or(0.0);
            found(lo, hi);
            angle = after;
        }
    }

    /// The first clear angle from one to another, but for some in gaps of less than the least step.
    fn next_clear(&self, part: Part, from: f64, until: f64, corners: &[DVec3; 3]) -> Option<f64> {
        let mut angle = from;
        while angle < until {
            let lacks = part.kept - self.shortest(part, angle, corners).distance;
            if lacks <= 0.0 {
                return Some(angle);
            }
            angle += (lacks / part.to).max(LEAST_STEP);
        }
        None
    }

    fn is_too_near(&self, part: Part, angle: f64, corners: &[DVec3; 3]) -> bool {
        self.shortest(part, angle, corners).distance < part.kept
    }

    /// How far a part turns, forwards or backwards by the `sign`, from an angle at which it is clear until it meets the
    /// triangle; more than 0. `None` if it turns by `most`.
    fn turned(&self, part: Part, angle: f64, sign: f64, most: f64, corners: &[DVec3; 3]) -> Option<f64> {
        let mut turned = 0.0;
        for _ in 0..STEPS {
            let at = angle + sign * turned;
            let step = self.safe_step(part, at, sign, corners);
            if step * part.to <= LAST_STEP * part.kept {
                break;
            }
            turned += step;
            if turned >= most {
                return None;
            }
        }
        Some(f64::max(turned, f64::MIN_POSITIVE))
    }

    /// How far a part can turn before it comes too near to the plane that separates it from the triangle.
    fn safe_step(&self, part: Part, angle: f64, sign: f64, corners: &[DVec3; 3]) -> f64 {
        let normal = self.shortest(part, angle, corners).towards;
        let behind = corners.iter().map(|corner| normal.dot(&(corner - self.pivot))).fold(f64::NEG_INFINITY, f64::max);
        // Heights are linear along the segment, so those of its two ends count.
        let lacks = part.kept * (1.0 + BEYOND[0]) + behind;
        if part.from == 0.0 && lacks > 0.0 {
            return 0.0;
        }
        let slope = lacks / part.to;
        let direction = self.direction(angle);
        let (ahead, aside) = (normal.dot(&direction), sign * normal.dot(&self.n.cross(&direction)));
        let steepest = (ahead * ahead + aside * aside).sqrt();
        if slope <= -steepest {
            return TAU;
        }
        if slope >= steepest {
            return 0.0;
        }
        libm::atan2(aside, ahead) + libm::acos(slope / steepest)
    }

    /// The shortest line from a triangle to a part of the segment.
    fn shortest(&self, part: Part, angle: f64, corners: &[DVec3; 3]) -> Shortest {
        let direction = self.direction(angle);
        let at = |radius: f64| self.pivot + direction * radius;
        let end = at(part.to);
        if part.from == part.to {
            return Shortest::between(end, ClosestPoint::on(0, end, *corners).point);
        }
        shortest(&at(part.from), &end, corners)
    }
}

impl Shortest {
    fn between(segment: DVec3, triangle: DVec3) -> Self {
        let line = segment - triangle;
        let distance = line.norm();
        Self { distance, towards: if distance > 0.0 { line / distance } else { DVec3::zeros() } }
    }

    fn or(self, other: Self) -> Self {
        if other.distance < self.distance { other } else { self }
    }
}

/// The shortest line from a triangle to the segment from `a` to `b`.
fn shortest(a: &DVec3, b: &DVec3, corners: &[DVec3; 3]) -> Shortest {
    if crossing(a, b, corners).is_some() {
        return Shortest { distance: 0.0, towards: DVec3::zeros() };
    }
    let of_end = |end: &DVec3| Shortest::between(*end, ClosestPoint::on(0, *end, *corners).point);
    let mut least = of_end(b).or(of_end(a));
    for k in 0..3 {
        let side = [corners[k], corners[(k + 1) % 3]];
        let [s, t] = along([*a, *b], side);
        least = least.or(Shortest::between(a.lerp(b, s), side[0].lerp(&side[1], t)));
    }
    least
}

/// Distance of the segment from `a` to `b` from a triangle, metres.
pub(super) fn distance(a: &DVec3, b: &DVec3, corners: &[DVec3; 3]) -> f64 {
    shortest(a, b, corners).distance
}
