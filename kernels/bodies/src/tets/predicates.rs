//! Exact geometric predicates on grid points.
//!
//! The sign of the result is exact for grid coordinates as f64 (integers from 0 to 2²⁴), its magnitude approximate.
//! Differences have 24 bits, 2 × 2 minors 49 and squared distances 50, all exact in f64. The rounding of later
//! operations is bounded, and where the bound is not decisive, 128-bit integers are used.

use nalgebra::Vector3;
use numerics::vector::DVec3;

/// A grid point as f64.
pub(crate) type At = DVec3;

/// Above the rounding of [`orient`]: three products below 2⁷³ and two sums below 2⁷⁵, each with a relative error of
/// 2⁻⁵³.
const ORIENT_ROUNDING: f64 = (1_u64 << 24) as f64;

/// Above the rounding of [`in_sphere`] for differences up to 2²⁴: minors with errors of 2²⁴ times squares below 2⁵⁰,
/// and products and sums below 2¹²⁷ with a relative error of 2⁻⁵³.
const SPHERE_ROUNDING: f64 = (1_u128 << 77) as f64;

/// The same for differences up to m, relative to m⁵: the determinant is of degree 5.
const SPHERE_SHARE: f64 = SPHERE_ROUNDING / (1_u128 << 120) as f64;

/// (b−a)×(c−a)·(d−a), six times the volume of a tet; positive if `abc` runs clockwise seen from `d`.
#[inline(always)]
pub(crate) fn orient(a: &At, b: &At, c: &At, d: &At) -> f64 {
    let (b, c, d) = (b - a, c - a, d - a);
    let det = b.dot(&c.cross(&d));
    if det.abs() > ORIENT_ROUNDING { det } else { orient_exactly(b, c, d) }
}

#[cold]
fn orient_exactly(b: At, c: At, d: At) -> f64 {
    let [b, c, d] = [b, c, d].map(whole);
    determinant(&b, &c, &d) as f64
}

/// Positive if `e` is inside the circumsphere of the positive tet `abcd`, 0 if it is on it.
#[inline(always)]
pub(crate) fn in_sphere(a: &At, b: &At, c: &At, d: &At, e: &At) -> f64 {
    let rows = [a - e, b - e, c - e, d - e];
    let [a, b, c, d] = &rows;
    let minor = |p: &At, q: &At| p[0] * q[1] - q[0] * p[1];
    let (ab, bc, cd, da, ac, bd) = (minor(a, b), minor(b, c), minor(c, d), minor(d, a), minor(a, c), minor(b, d));
    let abc = a[2] * bc - b[2] * ac + c[2] * ab;
    let bcd = b[2] * cd - c[2] * bd + d[2] * bc;
    let cda = c[2] * da + d[2] * ac + a[2] * cd;
    let dab = d[2] * ab + a[2] * bd + b[2] * da;
    let det = (a.norm_squared() * bcd - b.norm_squared() * cda) + (c.norm_squared() * dab - d.norm_squared() * abc);
    if det.abs() > SPHERE_ROUNDING { det } else { in_small_sphere(&rows, det) }
}

/// Decides by a bound for the actual size of the differences, else exactly.
#[inline(never)]
fn in_small_sphere(rows: &[At; 4], det: f64) -> f64 {
    let m = rows.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    if det.abs() > SPHERE_SHARE * (m * m) * (m * m) * m { det } else { in_sphere_exactly(rows) }
}

#[cold]
fn in_sphere_exactly(rows: &[At; 4]) -> f64 {
    let [a, b, c, d] = rows.map(whole);
    let square = |p: &Vector3<i64>| i128::from(p.dot(p));
    let det = square(&a) * determinant(&b, &c, &d) - square(&b) * determinant(&a, &c, &d)
        + square(&c) * determinant(&a, &b, &d)
        - square(&d) * determinant(&a, &b, &c);
    det as f64
}

/// p·(q×r), exactly.
fn determinant(p: &Vector3<i64>, q: &Vector3<i64>, r: &Vector3<i64>) -> i128 {
    p.map(i128::from).dot(&q.cross(r).map(i128::from))
}

fn whole(p: At) -> Vector3<i64> {
    p.map(|x| x as i64)
}
