//! Straight curves that grow from points on triangles.
//!
//! Guarantees: a root lies on its triangle to the rounding of f32; a curve has the requested length; both move and
//! rotate with the triangle. Limit: curves are straight, and may cross each other and the surface.

use super::{area_vector, corners_of};
use crate::surface::SurfacePoint;
use numerics::parallel;
use numerics::trig::sin_cos;
use numerics::vector::{DVec3, direction, to_f32};

/// A curve to grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// Its root.
    pub root: SurfacePoint,
    /// Length from root to tip, metres.
    pub length: f32,
    /// Angle to the surface's normal, radians.
    pub lean: f32,
    /// Direction of the lean: the angle about the normal from the triangle's first edge, radians.
    pub around: f32,
}

/// Number of blades in a task: some 20 µs of work.
const TASK: usize = 64;

/// Unit normals of the points: the mean over the triangles around each, weighted by area; zero if undefined.
pub fn vertex_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::zeros(); positions.len()];
    for triangle in triangles {
        let normal = area_vector(corners_of(positions, *triangle));
        for corner in triangle {
            sums[*corner as usize] += normal;
        }
    }
    sums.into_iter().map(|sum| direction(sum).unwrap_or_else(DVec3::zeros)).collect()
}

/// The CVs of the blades, `cvs` (2 or more) each, root to tip and evenly spaced. `normals` are those of the points, of
/// any length, and are interpolated over a triangle; if they cancel, the triangle's own normal is used, or y if it has
/// no area.
///
/// # Panics
/// If a corner is out of range.
pub fn grow(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    normals: &[DVec3],
    blades: &[Blade],
    cvs: usize,
) -> Vec<[f32; 3]> {
    let mut points = vec![[0.0; 3]; blades.len() * cvs];
    let grow_one = |points: &mut [[f32; 3]], blade: &Blade| {
        let triangle = triangles[blade.root.triangle as usize];
        let corners = corners_of(positions, triangle);
        let root = blade.root.position(positions, triangles);
        let up = direction(blade.root.interpolate(triangle.map(|corner| normals[corner as usize].into())).into())
            .or_else(|| direction(area_vector(corners)))
            .unwrap_or_else(DVec3::y);
        let towards_tip = leaning(up, corners[1] - corners[0], blade);
        for (k, point) in points.iter_mut().enumerate() {
            let along = f64::from(blade.length) * k as f64 / (cvs - 1) as f64;
            *point = to_f32(root + towards_tip * along);
        }
    };
    parallel::for_each(points.chunks_mut(TASK * cvs).zip(blades.chunks(TASK)), |_, (points, blades)| {
        points.chunks_mut(cvs).zip(blades).for_each(|(points, blade)| grow_one(points, blade));
    });
    points
}

/// `up` rotated by the blade's lean towards its side.
fn leaning(up: DVec3, edge: DVec3, blade: &Blade) -> DVec3 {
    let along = edge.dot(&up);
    let side = direction(edge - up * along).unwrap_or_else(|| perpendicular(up));
    let across = up.cross(&side);
    let [(sin, cos), (s, c)] = [blade.lean, blade.around].map(|angle| {
        let (sin, cos) = sin_cos(angle);
        (f64::from(sin), f64::from(cos))
    });
    up * cos + (side * c + across * s) * sin
}

/// A unit vector perpendicular to `up`, towards the axis with its smallest component.
fn perpendicular(up: DVec3) -> DVec3 {
    let axis = DVec3::ith(up.iamin(), 1.0);
    direction(up.cross(&axis.cross(&up))).unwrap_or(axis)
}
