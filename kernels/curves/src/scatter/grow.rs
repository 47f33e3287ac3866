//! Straight curves that grow from spots on triangles.
//!
//! Promise: a root lies on its triangle to the rounding of f32; a curve has the length asked for; both turn and move
//! with the triangle. Limit: nothing bends, and curves may cross each other and the surface.

use super::{Spot, corners_of, cross, dot, length, normal, sub};
use numerics::trig::sin_cos;
use rayon::prelude::*;

/// A curve to grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// Where its root is.
    pub root: Spot,
    /// Root to tip, metres.
    pub length: f32,
    /// Angle to the surface's normal, radians.
    pub lean: f32,
    /// Where to it leans: the angle about the normal from the triangle's first edge, radians.
    pub around: f32,
}

/// Unit normals of the points (f64): the mean of the triangles around each, weighted by area; zero where there is none.
pub fn vertex_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; positions.len()];
    for triangle in triangles {
        let normal = normal(corners_of(positions, *triangle));
        for corner in triangle {
            let sum: &mut [f64; 3] = &mut sums[*corner as usize];
            *sum = std::array::from_fn(|k| sum[k] + normal[k]);
        }
    }
    sums.into_iter().map(|sum| unit(sum).unwrap_or([0.0; 3])).collect()
}

/// The CVs of the blades, `cvs` (2 or more) each, root to tip and evenly apart. `normals` are the points', of any length
/// and interpolated over a triangle; where they cancel, the triangle's own counts, and y where it has no area.
///
/// # Panics
/// Where a corner is out of range.
pub fn grow(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    normals: &[[f64; 3]],
    blades: &[Blade],
    cvs: usize,
) -> Vec<[f32; 3]> {
    let mut points = vec![[0.0; 3]; blades.len() * cvs];
    points.par_chunks_mut(cvs).zip(blades).with_min_len(64).for_each(|(points, blade)| {
        let triangle = triangles[blade.root.triangle as usize];
        let corners = corners_of(positions, triangle);
        let root = blade.root.mix(corners);
        let up = unit(blade.root.mix(triangle.map(|corner| normals[corner as usize])))
            .or_else(|| unit(normal(corners)))
            .unwrap_or([0.0, 1.0, 0.0]);
        let direction = leaning(up, sub(corners[1], corners[0]), blade);
        for (k, point) in points.iter_mut().enumerate() {
            let along = f64::from(blade.length) * k as f64 / (cvs - 1) as f64;
            *point = std::array::from_fn(|axis| (root[axis] + along * direction[axis]) as f32);
        }
    });
    points
}

/// `up` turned by the blade's lean towards its side.
fn leaning(up: [f64; 3], edge: [f64; 3], blade: &Blade) -> [f64; 3] {
    let along = dot(edge, up);
    let side = unit([0, 1, 2].map(|k| edge[k] - along * up[k])).unwrap_or_else(|| perpendicular(up));
    let across = cross(up, side);
    let [(sin, cos), (s, c)] = [blade.lean, blade.around].map(|angle| {
        let (sin, cos) = sin_cos(angle);
        (f64::from(sin), f64::from(cos))
    });
    std::array::from_fn(|k| cos * up[k] + sin * (c * side[k] + s * across[k]))
}

/// Perpendicular to the unit vector `up`, towards the axis it is least along.
fn perpendicular(up: [f64; 3]) -> [f64; 3] {
    let least = (0..3).fold(0, |least, k| if up[k].abs() < up[least].abs() { k } else { least });
    let axis = std::array::from_fn(|k| if k == least { 1.0 } else { 0.0 });
    unit(cross(up, cross(axis, up))).unwrap_or(axis)
}

/// `v` at length 1; `None` where it has no direction.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    // Brought near 1 first, so that squares of tiny edges do not vanish.
    let v = v.map(|x| x / largest);
    (largest > 0.0).then(|| v.map(|x| x / length(v)))
}
