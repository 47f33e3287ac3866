//! φ next to the surface from the planes of its markers.

use numerics::vector::{Vec3, add, dot, length, scale, sub};

use super::bins::Bins;
use super::{Marker, ONE_SIDED, one_sided};
use crate::level_set::{LevelSet, far_from_surface};

/// Markers count that are at most this much farther than the closest.
const SPREAD: f32 = 0.5;
/// Distance of the closest marker beyond which markers say nothing.
pub(crate) const FARTHEST: f32 = 0.9;
/// Distance of the closest marker up to which its plane is the surface, wherever the others are.
const NEXT_TO: f32 = 0.3;
/// Share of the distance from the closest marker from which the distance from planes is one from the surface.
const STRAIGHT: f32 = 0.9;
/// Cosine to the closest marker's normal below which a marker belongs to the other side of a sheet.
const OPPOSITE: f32 = -0.5;
/// Length of the mean of unit normals from which the surface is smooth there.
const SMOOTH: f32 = 0.97;
/// The mean square of the distance of markers from each other, from which on they tell how the surface bends.
const LEAST_SPREAD: f32 = 0.01;
/// The largest curvature, of a ball of a cell's radius.
const STEEPEST: f32 = 1.0;
/// Depth of φ, as the flow carried it, from which markers do not make a cell air. They are left over from surfaces that
/// met: liquid around would fill that air, lose its volume, and the markers bring it back each step.
const INSIDE: f32 = 0.2;
/// Distance up to which markers show where the surface ends.
const AROUND: f32 = 1.5;

/// At cells with markers around them, makes φ the distance from the surface through those closest.
pub(super) fn correct(set: &mut LevelSet, markers: &[Marker], reach: f32) {
    let bins = Bins::new(set.rows(), set.domain(), markers, |_| true);
    let sorted: Vec<Marker> = bins.order.iter().map(|n| markers[*n as usize]).collect();
    let (stencil, phi) = set.parts();
    let far = far_from_surface(reach);
    let first = &bins.first;
    stencil.update([phi], |runs, start, [phi]| {
        for run in runs {
            let ([x, y, z], len) = (run.cell, run.len as usize);
            // All 26 cells around an active one are stored, so the places of their rows are constant along a run.
            let Some(diagonal) = stencil.rows().find([x, y - 1, z - 1]) else { continue };
            let rows = [run.at as usize, run.y[0] as usize, run.z[0] as usize, diagonal];
            if rows.iter().all(|row| first[row - 1] == first[row + len]) {
                continue;
            }
            for n in 0..len {
                let value = &mut phi[run.at as usize + n - start];
                if value.abs() >= far {
                    continue;
                }
                let near = rows.map(|row| &sorted[first[row + n - 1] as usize..first[row + n + 1] as usize]);
                let centre = [x + n as i32, y, z].map(|x| x as f32 + 0.5);
                let is_liquid = *value < -INSIDE;
                if let Some(distance) = surface_distance(centre, near).filter(|far| !is_liquid || *far <= 0.0) {
                    *value = distance;
                }
            }
        }
    });
}

/// The mean distance of a point from the surface by the closest markers, where the surface reaches that far.
#[inline]
fn surface_distance(point: Vec3, near: [&[Marker]; 4]) -> Option<f32> {
    let (mut closest, mut side) = (f32::INFINITY, [0.0; 3]);
    for marker in near.into_iter().flatten() {
        let way = sub(point, marker.point);
        let square = dot(way, way);
        if square < closest {
            (closest, side) = (square, marker.normal);
        }
    }
    if closest > FARTHEST * FARTHEST {
        return None;
    }
    let closest = closest.sqrt();
    let (mut planes, mut ways, mut normals, mut weights) = (0.0, [0.0; 3], [0.0; 3], 0.0);
    let (mut squares, mut heights) = (0.0, 0.0);
    for marker in near.into_iter().flatten() {
        let way = sub(point, marker.point);
        let square = dot(way, way);
        let share = 1.0 - (square.sqrt() - closest) * (1.0 / SPREAD);
        if share > 0.0 && dot(marker.normal, side) > OPPOSITE {
            let (weight, height) = (share * share, dot(marker.normal, way));
            planes += weight * height;
            ways = add(ways, scale(way, weight));
            normals = add(normals, scale(marker.normal, weight));
            weights += weight;
            squares += weight * square;
            heights += weight * height * height;
        }
    }
    // Where the surface is bent, it leaves the plane of a marker by half the curvature times the square of the way along it:
    // by as much as normals turn from marker to marker. Edges have no curvature.
    let is_smooth = length(normals) > SMOOTH * weights;
    let spread = squares - dot(ways, ways) / weights;
    let turn = dot(normals, ways) / weights - planes;
    let bent = if is_smooth && spread > LEAST_SPREAD * weights { turn / spread } else { 0.0 };
    let distance = (planes + 0.5 * bent.clamp(-STEEPEST, STEEPEST) * (squares - heights)) / weights;
    let beside = closest > NEXT_TO && distance.abs() < STRAIGHT * closest;
    (!(beside && is_beyond(point, near))).then_some(distance)
}

/// Whether a point lies beyond the rim of the markers. There both sides of a sheet would make it thicker and longer.
#[cold]
fn is_beyond(point: Vec3, near: [&[Marker]; 4]) -> bool {
    let ways = near.into_iter().flatten().map(|marker| {
        let way = sub(point, marker.point);
        let weight = (1.0 - dot(way, way) * (1.0 / (AROUND * AROUND))).max(0.0);
        (sub(way, scale(marker.normal, dot(marker.normal, way))), weight)
    });
    one_sided(ways) > ONE_SIDED
}
