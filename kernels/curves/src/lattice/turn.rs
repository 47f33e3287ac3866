//! Vectors, normals and orientations carried along by a map of space, given its derivative at each row.

use crate::attach::nearest_rotation;
use rayon::prelude::*;

/// Row by row.
pub type Matrix = [[f64; 3]; 3];

pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Rows a thread takes at a time.
const CHUNK: usize = 4096;

/// Differences of positions, such as velocities: J·v.
///
/// # Panics
/// Where there are fewer matrices than rows.
pub fn turn_vectors(rows: &mut [[f32; 3]], jacobians: &[Matrix]) {
    each(rows, jacobians, |v, jacobian| times(jacobian, v.map(f64::from)).map(|x| x as f32));
}

/// Normals: still perpendicular to the surface that has moved along, on the side where its winding says outside is, of
/// length 1. What has no direction afterwards, the surface being squeezed to a line there, stays.
///
/// # Panics
/// Where there are fewer matrices than rows.
pub fn turn_normals(rows: &mut [[f32; 3]], jacobians: &[Matrix]) {
    each(rows, jacobians, |n, jacobian| {
        // (J·a) × (J·b) is the matrix of J's cofactors times a × b.
        let [x, y, z] = jacobian;
        unit(times(&[cross(y, z), cross(z, x), cross(x, y)], n.map(f64::from))).map_or(n, |n| n.map(|x| x as f32))
    });
}

/// Orientations (quaternions x, y, z, w): turned by the rotation nearest to the derivative, where there is one.
///
/// # Panics
/// Where there are fewer matrices than rows.
pub fn turn_orientations(rows: &mut [[f32; 4]], jacobians: &[Matrix]) {
    each(rows, jacobians, |q, jacobian| {
        nearest_rotation(jacobian).map_or(q, |turn| product(turn, q.map(f64::from)).map(|x| x as f32))
    });
}

/// Maps rows; where the derivative is none, they keep their bits.
fn each<T: Copy + Send + Sync>(rows: &mut [T], jacobians: &[Matrix], map: impl Fn(T, &Matrix) -> T + Sync) {
    assert!(jacobians.len() >= rows.len(), "{} rows and {} matrices", rows.len(), jacobians.len());
    rows.par_chunks_mut(CHUNK).zip(jacobians.par_chunks(CHUNK)).for_each(|(rows, jacobians)| {
        for (row, jacobian) in rows.iter_mut().zip(jacobians).filter(|(_, jacobian)| **jacobian != IDENTITY) {
            *row = map(*row, jacobian);
        }
    });
}

fn times(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// First `b`, then `a`.
fn product([ax, ay, az, aw]: [f64; 4], [bx, by, bz, bw]: [f64; 4]) -> [f64; 4] {
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// `v` at length 1; `None` where it has no direction.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let v = v.map(|x| x / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (largest > 0.0 && largest.is_finite()).then(|| v.map(|x| x / length))
}
