//! Attributes of new markers, from the markers around them on the same side of the liquid.

use numerics::parallel;
use numerics::point_tree::PointTree;
use numerics::vector::{DMat3, DVec3, Vec3, dot, sub, to_f64};

use super::bins::Bins;
use super::{Marker, ONE_SIDED, one_sided};
use crate::level_set::floor;
use crate::rows::CellRows;

/// Cubes around a new marker's own in which neighbours are looked for, nearest first.
const RINGS: [i32; 3] = [1, 2, 4];
/// Neighbours that are enough, if they lie all around.
const ENOUGH: usize = 6;
/// Of a marker that has no neighbours, so many of the nearest markers are asked whether they are on its side.
const NEAREST: usize = 12;
/// New markers that a thread handles at a time.
const CHUNK: usize = 32;

/// For each attribute, its values at the markers `new`, within those of all markers. One that has no neighbours, as on a drop that
/// has just become liquid again, has the values of the nearest marker; 0 where there is none.
pub(super) fn interpolate(
    rows: &CellRows,
    bins: &Bins,
    markers: &[Marker],
    attributes: &[Vec<f32>],
    new: &[Marker],
) -> Vec<Vec<f32>> {
    if attributes.is_empty() {
        return Vec::new();
    }
    let mut weights = parallel::tabulate(new.len(), CHUNK, |n| weights(rows, bins, markers, &new[n]));
    if !markers.is_empty() && weights.iter().any(Vec::is_empty) {
        let places: Vec<Vec3> = markers.iter().map(|marker| marker.point).collect();
        let tree = PointTree::new(&places);
        let alone = weights.iter_mut().zip(new).filter(|(weights, _)| weights.is_empty());
        alone.for_each(|(weights, new)| weights.extend(nearest(&tree, markers, new).map(|n| (n, 1.0))));
    }
    let value = |values: &[f32], [low, high]: [f32; 2], weights: &[(u32, f32)]| {
        let [least, most] = range(weights.iter().map(|(n, _)| values[*n as usize]));
        let half = 0.5 * (most - least);
        let sum = weights.iter().fold(0.0, |sum, (n, weight)| sum + weight * values[*n as usize]);
        if weights.is_empty() { 0.0 } else { sum.clamp(least - half, most + half).clamp(low, high) }
    };
    let at_new = |values: &Vec<f32>| {
        let all = range(values.iter().copied());
        weights.iter().map(|weights| value(values, all, weights)).collect()
    };
    attributes.iter().map(at_new).collect()
}

/// The least and the largest.
fn range(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Neighbours and what each contributes: 1 altogether.
fn weights(rows: &CellRows, bins: &Bins, markers: &[Marker], new: &Marker) -> Vec<(u32, f32)> {
    let mut near = Vec::new();
    for ring in RINGS {
        near = neighbours(rows, bins, markers, new, ring);
        let ways = near.iter().map(|(n, weight)| (sub(markers[*n as usize].point, new.point), *weight));
        if near.len() >= ENOUGH && one_sided(ways) <= ONE_SIDED {
            break;
        }
    }
    linear_fit(markers, new, near)
}

/// The nearest marker on the side of `new`, or the nearest of all.
fn nearest(tree: &PointTree, markers: &[Marker], new: &Marker) -> Option<u32> {
    let mut near = Vec::new();
    tree.nearest(new.point, NEAREST, &mut near);
    let of_side = near.iter().find(|found| dot(markers[found.number as usize].normal, new.normal) > 0.0);
    Some(of_side.or(near.first())?.number)
}

/// The markers at most `ring` cubes away whose normals are less than 90° from that of `new`, with their weights: less
/// with distance and with the angle.
fn neighbours(rows: &CellRows, bins: &Bins, markers: &[Marker], new: &Marker, ring: i32) -> Vec<(u32, f32)> {
    let radius = ring as f32 + 0.5;
    let weight = |n: &u32| {
        let marker = &markers[*n as usize];
        let way = sub(marker.point, new.point);
        let facing = dot(marker.normal, new.normal).max(0.0);
        let near = (1.0 - dot(way, way) * (1.0 / (radius * radius))).max(0.0);
        (*n, near * near * facing * facing)
    };
    let cube = new.point.map(|x| floor(x - 0.5));
    bins.around(rows, cube, ring).map(weight).filter(|(_, weight)| *weight > 0.0).collect()
}

/// Turns weights of neighbours into what each contributes to the value at `new` of the linear function that fits them best
/// (moving least squares).
pub(super) fn linear_fit(markers: &[Marker], new: &Marker, mut near: Vec<(u32, f32)>) -> Vec<(u32, f32)> {
    let sum = near.iter().fold(0.0, |sum, (_, weight)| sum + f64::from(*weight));
    // Of a fit on [1, x, y, z] about the weighted centre only the slopes are left to solve for.
    let way = |n: u32| to_f64(sub(markers[n as usize].point, new.point));
    let centre = near.iter().fold(DVec3::zeros(), |c, (n, weight)| c + way(*n) * f64::from(*weight)) / sum;
    let mut matrix = DMat3::zeros();
    for (n, weight) in &near {
        let from_centre = way(*n) - centre;
        matrix += from_centre * from_centre.transpose() * (f64::from(*weight) / sum);
    }
    // A little of the trace makes it solvable where the neighbours lie in a plane.
    matrix += DMat3::identity() * (1e-4 * matrix.trace());
    let slope = matrix.try_inverse().map_or(DVec3::zeros(), |inverse| inverse * centre);
    for (n, weight) in &mut near {
        let share = 1.0 - (way(*n) - centre).dot(&slope);
        *weight = (f64::from(*weight) / sum * share) as f32;
    }
    near
}
