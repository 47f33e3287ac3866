//! Vectors of three `f64`, 3×3 matrices (row by row) and unit quaternions (x, y, z, w), as plain arrays.

pub(crate) type Vec3 = [f64; 3];
pub(crate) type Matrix = [[f64; 3]; 3];
pub(crate) type Quat = [f64; 4];

/// No turn.
pub(crate) const IDENTITY: Quat = [0.0, 0.0, 0.0, 1.0];

#[inline(always)]
pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// `a` at length 1; zero where it has no direction.
#[inline(always)]
pub(crate) fn unit(a: Vec3) -> Vec3 {
    let length = length(a);
    scale(a, if length > 0.0 { 1.0 / length } else { 0.0 })
}

/// f64 from f32, component by component.
#[inline(always)]
pub(crate) fn wide(a: [f32; 3]) -> Vec3 {
    [f64::from(a[0]), f64::from(a[1]), f64::from(a[2])]
}

/// Weighted sum of three.
#[inline(always)]
pub(crate) fn mix(weights: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    add(scale(a, weights[0]), add(scale(b, weights[1]), scale(c, weights[2])))
}

/// How far the turn `q` moves the end of `v`: exactly 0 for no turn.
#[inline(always)]
pub(crate) fn moved(q: Quat, v: Vec3) -> Vec3 {
    let axis = [q[0], q[1], q[2]];
    let once = scale(cross(axis, v), 2.0);
    add(scale(once, q[3]), cross(axis, once))
}

/// `v` turned by `q`.
#[inline(always)]
pub(crate) fn turned(q: Quat, v: Vec3) -> Vec3 {
    add(v, moved(q, v))
}

/// First `b`, then `a`.
#[inline(always)]
pub(crate) fn compose(a: Quat, b: Quat) -> Quat {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + bw * ax + (ay * bz - az * by),
        aw * by + bw * ay + (az * bx - ax * bz),
        aw * bz + bw * az + (ax * by - ay * bx),
        aw * bw - (ax * bx + ay * by + az * bz),
    ]
}

/// The turn back.
#[inline(always)]
pub(crate) fn inverse([x, y, z, w]: Quat) -> Quat {
    [-x, -y, -z, w]
}
