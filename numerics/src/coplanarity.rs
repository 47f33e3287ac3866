//! Times at which four linearly moving points are coplanar: the roots of a cubic, each isolated in a monotone
//! interval. 0 counts as positive.
//!
//! Every sign change during the motion is found, up to rounding of its time. Limit: a plane that is touched and left
//! again within rounding may count as two crossings or none.

use crate::vector::DVec3;

/// Up to three times in 0…1, ascending, and whether the value was positive before each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrossingTimes {
    times: [f64; 3],
    above: [bool; 3],
    count: usize,
}

impl CrossingTimes {
    /// The times, and whether the value was positive before each.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (f64, bool)> {
        self.times.into_iter().zip(self.above).take(self.count)
    }
}

/// Result of a separating-axis test of two linearly moving elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionSeparation {
    /// Always farther apart than the given distance.
    Far,
    /// Possibly close, but they never cross.
    Near,
    /// Undecided.
    Unknown,
}

/// Separating-axis test of a point and a triangle, given the triangle's sides and the offset of the point: along the
/// initial normal, and then, only for distance, along the in-plane normals of its sides and the directions normal to
/// a side and the relative displacement.
#[inline]
pub fn face_separation(start: &[DVec3; 3], end: &[DVec3; 3], reach: f64) -> MotionSeparation {
    let normal = start[0].cross(&start[1]);
    let separation = face_separation_along(&normal, start, end, reach);
    if separation == MotionSeparation::Unknown {
        let pass = end[2] - start[2];
        for side in [start[0], start[1], start[1] - start[0]] {
            for axis in [normal.cross(&side), pass.cross(&side)] {
                if face_separation_along(&axis, start, end, reach) == MotionSeparation::Far {
                    return MotionSeparation::Far;
                }
            }
        }
    }
    separation
}

/// The same along one axis.
#[inline]
fn face_separation_along(axis: &DVec3, start: &[DVec3; 3], end: &[DVec3; 3], reach: f64) -> MotionSeparation {
    let range = |[b, c, p]: &[DVec3; 3]| {
        let (one, two, offset) = (-axis.dot(b), -axis.dot(c), axis.dot(p));
        (offset + one.min(two).min(0.0), offset + one.max(two).max(0.0))
    };
    let (first, last) = (range(start), range(end));
    classify(first.0.min(last.0), first.1.max(last.1), reach, axis)
}

/// Separating-axis test of two edges, given both edge vectors and the offset between their first ends: along their
/// initial common normal, and then, only for distance, along in-plane normals and directions normal to an edge and
/// the relative displacement.
///
/// Edges that stay parallel cannot cross unless their ends cross too.
#[inline]
pub fn edge_separation(start: &[DVec3; 3], end: &[DVec3; 3], reach: f64) -> MotionSeparation {
    /// Largest sine of the angle between parallel edges.
    const PARALLEL: f64 = 1e-9;
    let normal = start[0].cross(&start[1]);
    let separation = edge_separation_along(&normal, start, end, reach);
    if separation != MotionSeparation::Unknown {
        return separation;
    }
    let pass = end[2] - start[2];
    let axes = [normal.cross(&start[0]), normal.cross(&start[1]), pass.cross(&start[0]), pass.cross(&start[1])];
    if axes.iter().any(|axis| edge_separation_along(axis, start, end, reach) == MotionSeparation::Far) {
        return MotionSeparation::Far;
    }
    let parallel =
        |[d, e, _]: &[DVec3; 3]| d.cross(e).norm_squared() <= PARALLEL * PARALLEL * d.norm_squared() * e.norm_squared();
    if parallel(start) && parallel(end) { MotionSeparation::Near } else { MotionSeparation::Unknown }
}

/// The same along one axis.
#[inline]
fn edge_separation_along(axis: &DVec3, start: &[DVec3; 3], end: &[DVec3; 3], reach: f64) -> MotionSeparation {
    let range = |[d, e, r]: &[DVec3; 3]| {
        let (one, two, offset) = (-axis.dot(d), axis.dot(e), axis.dot(r));
        (offset + one.min(0.0) + two.min(0.0), offset + one.max(0.0) + two.max(0.0))
    };
    let (first, last) = (range(start), range(end));
    classify(first.0.min(last.0), first.1.max(last.1), reach, axis)
}

/// Classifies by the range of signed distances, each multiplied by the length of the axis.
#[inline]
fn classify(low: f64, high: f64, reach: f64, normal: &DVec3) -> MotionSeparation {
    let nearest = low.max(-high);
    let far = reach * (1.0 + 1e-9);
    if nearest > 0.0 && nearest * nearest > far * far * normal.norm_squared() {
        MotionSeparation::Far
    } else if nearest > 0.0 {
        MotionSeparation::Near
    } else {
        MotionSeparation::Unknown
    }
}

fn det(a: &DVec3, b: &DVec3, c: &DVec3) -> f64 {
    a.cross(b).dot(c)
}

/// Times at which the determinant of three linearly moving vectors changes sign.
#[inline]
pub fn sign_changes(start: &[DVec3; 3], end: &[DVec3; 3]) -> CrossingTimes {
    let [a, b, c] = start;
    let [p, q, r] = [end[0] - a, end[1] - b, end[2] - c];
    let (ab, aq, pb, pq) = (a.cross(b), a.cross(&q), p.cross(b), p.cross(&q));
    let c0 = ab.dot(c);
    let c1 = ab.dot(&r) + (aq + pb).dot(c);
    let c2 = (aq + pb).dot(&r) + pq.dot(c);
    let c3 = pq.dot(&r);
    let last = det(&end[0], &end[1], &end[2]);
    // The cubic stays within the range of its Bernstein coefficients.
    let held = [c0, c0 + c1 / 3.0, c0 + (2.0 * c1 + c2) / 3.0, last];
    let mut roots = CrossingTimes::default();
    if held.iter().all(|x| *x > 0.0) || held.iter().all(|x| *x < 0.0) {
        return roots;
    }
    let value = |t: f64| if t >= 1.0 { last } else { c0 + t * (c1 + t * (c2 + t * c3)) };
    let (turns, count) = turning_points(c1, c2, c3);
    let mut from = (0.0, c0);
    for to in turns[..count].iter().copied().chain([1.0]) {
        let to = (to, value(to));
        if (from.1 >= 0.0) != (to.1 >= 0.0) {
            roots.times[roots.count] = root(&value, from, to);
            roots.above[roots.count] = from.1 >= 0.0;
            roots.count += 1;
        }
        from = to;
    }
    roots
}

/// CrossingTimes of c₁ + 2c₂t + 3c₃t² in 0…1, ascending.
fn turning_points(c1: f64, c2: f64, c3: f64) -> ([f64; 2], usize) {
    let (mut out, mut count) = ([0.0; 2], 0);
    let under = c2 * c2 - 3.0 * c1 * c3;
    if under > 0.0 {
        // Compute the root without cancellation first.
        let sum = -(c2 + under.sqrt().copysign(c2));
        for t in [sum / (3.0 * c3), c1 / sum] {
            if t > 0.0 && t < 1.0 {
                out[count] = t;
                count += 1;
            }
        }
    }
    if count == 2 && out[0] > out[1] {
        out.swap(0, 1);
    }
    (out, count)
}

/// Root of a monotone function between two arguments: regula falsi with the Illinois modification, then bisection.
fn root(value: &impl Fn(f64) -> f64, mut low: (f64, f64), mut high: (f64, f64)) -> f64 {
    let above = low.1 >= 0.0;
    let mut kept = 0;
    for round in 0..100 {
        if high.0 - low.0 <= 4.0 * f64::EPSILON * high.0 {
            break;
        }
        let guess = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
        let middle = 0.5 * (low.0 + high.0);
        let t = if round < 40 && guess > low.0 && guess < high.0 { guess } else { middle };
        let now = value(t);
        if (now >= 0.0) == above {
            low = (t, now);
            high.1 *= if kept == 1 { 0.5 } else { 1.0 };
            kept = 1;
        } else {
            high = (t, now);
            low.1 *= if kept == 2 { 0.5 } else { 1.0 };
            kept = 2;
        }
    }
    0.5 * (low.0 + high.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sign changes of (t − a)(t − b)(t − c), as the determinant of a diagonal matrix.
    fn of_roots(roots: [f64; 3]) -> Vec<(f64, bool)> {
        let at = |t: f64| {
            let [a, b, c] = roots.map(|root| t - root);
            [DVec3::x() * a, DVec3::y() * b, DVec3::z() * c]
        };
        sign_changes(&at(0.0), &at(1.0)).iter().collect()
    }

    #[test]
    fn a_product_of_three_linear_factors_changes_sign_at_each_root() {
        let found = of_roots([0.2, 0.5, 0.9]);
        assert_eq!(found.len(), 3);
        for ((t, above), (want, side)) in found.into_iter().zip([(0.2, false), (0.5, true), (0.9, false)]) {
            assert!((t - want).abs() < 1e-14 && above == side, "{t} is not {want}");
        }
        assert_eq!(of_roots([-1.0, 2.0, 3.0]).len(), 0);
        assert_eq!(of_roots([0.3, 7.0, -9.0]).len(), 1);
    }
}
