//! Vectors, normals and orientations under a deformation of space, given its Jacobian at each row.

use crate::attach::{nearest_rotation, rotate_orientation};
use numerics::parallel;
use numerics::vector::{DMat3, DVec3, direction, to_f32, to_f64};

/// Number of rows that a thread takes at a time.
const CHUNK: usize = 4096;

/// Differences of positions, such as velocities: J·v.
///
/// # Panics
/// If there are fewer matrices than rows.
pub fn map_vectors(rows: &mut [[f32; 3]], jacobians: &[DMat3]) {
    each(rows, jacobians, |v, jacobian| to_f32(jacobian * to_f64(v)));
}

/// Unit normals: perpendicular to the deformed surface, on the side that its winding defines as outside. A normal
/// without a direction after the deformation, because the surface is squeezed to a line, is left unchanged.
///
/// # Panics
/// If there are fewer matrices than rows.
pub fn map_normals(rows: &mut [[f32; 3]], jacobians: &[DMat3]) {
    each(rows, jacobians, |row, jacobian| {
        // (J·a) × (J·b) is the cofactor matrix of J times a × b.
        let [x, y, z] = [0, 1, 2].map(|row| jacobian.row(row).transpose());
        let n = to_f64(row);
        let mapped = DVec3::new(y.cross(&z).dot(&n), z.cross(&x).dot(&n), x.cross(&y).dot(&n));
        direction(mapped).map_or(row, to_f32)
    });
}

/// Orientations (quaternions x, y, z, w): rotated by the rotation nearest to the Jacobian, if there is one.
///
/// # Panics
/// If there are fewer matrices than rows.
pub fn map_orientations(rows: &mut [[f32; 4]], jacobians: &[DMat3]) {
    each(rows, jacobians, |q, jacobian| {
        nearest_rotation(jacobian).map_or(q, |rotation| rotate_orientation(&rotation, q))
    });
}

/// Maps rows; those with the identity as Jacobian keep their bits.
fn each<T: Copy + Send + Sync>(rows: &mut [T], jacobians: &[DMat3], map: impl Fn(T, &DMat3) -> T + Sync) {
    assert!(jacobians.len() >= rows.len(), "{} rows and {} matrices", rows.len(), jacobians.len());
    parallel::for_each(rows.chunks_mut(CHUNK).zip(jacobians.chunks(CHUNK)), |_, (rows, jacobians)| {
        for (row, jacobian) in rows.iter_mut().zip(jacobians).filter(|(_, jacobian)| **jacobian != DMat3::identity()) {
            *row = map(*row, jacobian);
        }
    });
}
