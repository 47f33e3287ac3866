//! Closest points of triangles and segments, in f64.

use crate::vector::DVec3;

/// The closest point of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct ClosestPoint {
    /// Index of the triangle, as given.
    pub face: u32,
    /// Barycentric weights, non-negative, with sum 1; exactly 0 away from a corner or its sides.
    pub weights: [f64; 3],
    /// Its position.
    pub point: DVec3,
    /// Its distance.
    pub distance: f64,
}

/// Part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriangleFeature {
    /// Its interior.
    Inside,
    /// The side opposite to this corner.
    Side(usize),
    /// This corner.
    Corner(usize),
}

impl ClosestPoint {
    /// The point of `face` with these corners that is closest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
    #[inline]
    pub fn on(face: u32, p: DVec3, corners: [DVec3; 3]) -> Self {
        let weights = weights(p, corners);
        let point = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        Self { face, weights, point, distance: (p - point).norm() }
    }

    /// The part of the triangle that it is on, by its weights.
    #[inline]
    pub fn feature(&self) -> TriangleFeature {
        match self.weights.map(|weight| weight > 0.0) {
            [true, true, true] => TriangleFeature::Inside,
            [false, true, true] => TriangleFeature::Side(0),
            [true, false, true] => TriangleFeature::Side(1),
            [true, true, false] => TriangleFeature::Side(2),
            [true, _, _] => TriangleFeature::Corner(0),
            [_, true, _] => TriangleFeature::Corner(1),
            _ => TriangleFeature::Corner(2),
        }
    }
}

fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[inline]
fn weights(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = share(d1, d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = share(d2, d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    let (on_b, on_c) = (d4 - d3, d5 - d6);
    if va <= 0.0 && on_b >= 0.0 && on_c >= 0.0 {
        let w = share(on_b, on_b + on_c);
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    let (v, w) = (share(vb, sum), share(vc, sum));
    [(1.0 - v - w).max(0.0), v, w]
}

/// Barycentric weights of the projection of `p` to the plane of a triangle; negative beyond a side.
pub fn projected(p: DVec3, [a, b, c]: [DVec3; 3], normal: DVec3) -> [f64; 3] {
    let area = (b - a).cross(&(c - a)).dot(&normal);
    let v = (p - a).cross(&(c - a)).dot(&normal) / area;
    let w = (b - a).cross(&(p - a)).dot(&normal) / area;
    [1.0 - v - w, v, w]
}

/// Parameters of the closest points of two segments, 0…1 (Ericson, 5.1.9).
pub fn along([p, q]: [DVec3; 2], [a, b]: [DVec3; 2]) -> [f64; 2] {
    let (d, e, r) = (q - p, b - a, p - a);
    let (dd, ee, er) = (d.norm_squared(), e.norm_squared(), e.dot(&r));
    let dr = d.dot(&r);
    let de = d.dot(&e);
    let under = dd * ee - de * de;
    let mut s = if under > 1e-24 * dd * ee { share_signed(de * er - dr * ee, under) } else { 0.0 };
    let mut t = share_signed(de * s + er, ee);
    let free = if ee > 0.0 { (de * s + er) / ee } else { 0.0 };
    if free < 0.0 {
        (s, t) = (share_signed(-dr, dd), 0.0);
    } else if free > 1.0 {
        (s, t) = (share_signed(de - dr, dd), 1.0);
    }
    [s, t]
}

fn share_signed(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Key;

    fn random(seed: u64, k: u64) -> DVec3 {
        let key = Key::new(seed).of(k);
        DVec3::new(key.of(0).f64(), key.of(1).f64(), key.of(2).f64())
    }

    #[test]
    fn closest_points_are_closer_than_random_ones() {
        for case in 0..300 {
            let corners = [0, 1, 2].map(|k| random(1, 4 * case + k));
            let p = random(1, 4 * case + 3) * 3.0 - DVec3::repeat(1.0);
            let best = ClosestPoint::on(0, p, corners);
            assert!((best.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for k in 0..400 {
                let [u, v] = [random(2, k).x, random(2, k).y];
                let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
                let q = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                assert!(best.distance <= (p - q).norm() + 1e-12);
            }
            let others = [p, random(3, case)];
            let [s, t] = along([corners[0], corners[1]], others);
            let gap = |s: f64, t: f64| (corners[0].lerp(&corners[1], s) - others[0].lerp(&others[1], t)).norm();
            for k in 0..400 {
                assert!(gap(s, t) <= gap(random(2, k).x, random(2, k).y) + 1e-12);
            }
        }
    }

    #[test]
    fn degenerate_triangles_and_segments_give_finite_results() {
        let p = DVec3::new(1.0, 2.0, 3.0);
        for corners in [
            [DVec3::zeros(); 3],
            [DVec3::zeros(), DVec3::x(), DVec3::x()],
            [DVec3::zeros(), DVec3::x(), DVec3::x() * 2.0],
        ] {
            assert!(ClosestPoint::on(0, p, corners).distance.is_finite());
        }
        assert_eq!(along([p, p], [p, p]), [0.0, 0.0]);
        assert!(along([p, p * 2.0], [p, p * 2.0]).iter().all(|x| x.is_finite()));
    }
}
