//! New markers where the surface has none: points of φ = 0, moved to where the markers around them see the surface.

use std::ops::Range;

use numerics::parallel;
use numerics::random::Key;
use numerics::vector::{Vec3, add, dot, scale, sub, unit};

use super::attributes::linear_fit;
use super::bins::Bins;
use super::{Marker, ONE_SIDED, one_sided};
use crate::level_set::cubic::cubic;
use crate::level_set::{LevelSet, RowBlocks};
use crate::rows::Cell;

/// Squares of |∇φ| between which φ is a distance. Elsewhere, as between two sheets, a projection misses the surface.
pub(super) const DISTANCE: Range<f32> = 0.64..1.56;
/// Points tried for each marker.
const TRIES: usize = 3;
/// Steps of Newton's method onto the surface.
const STEPS: usize = 3;
/// How far off the surface, in cells, a new marker may be.
const OFF: f32 = 0.02;
/// Distance, in cells, that a new marker keeps from those of its side.
const GAP: f32 = 0.7;
/// Distance within which markers of its side say where a new one belongs.
const RADIUS: f32 = 1.5;
/// Markers that can say so.
const ENOUGH: usize = 4;
/// Distance of a marker of the other side within which only they can.
const SHEET: f32 = 2.0;
/// The farthest, in cells, that they move it.
const MOVED: f32 = 0.3;
/// Cubes that one thread seeds at a time.
const CHUNK: usize = 64;

/// Up to `count` markers in each cube that the surface passes and that has none.
pub(super) fn seed(set: &LevelSet, bins: &Bins, markers: &[Marker], count: usize, key: Key) -> Vec<Marker> {
    let holes = holes(set, bins);
    let parts = parallel::map(holes.chunks(CHUNK), |_, cubes| {
        let mut out = Vec::new();
        for row in cubes.chunk_by(|a, b| a[1..] == b[1..]) {
            let [_, y, z] = row[0];
            let mut blocks = RowBlocks::new(set.view(), y, z);
            for cube in row {
                let block = blocks.at(cube[0]);
                let key = cube.iter().fold(key, |key, x| key.of(*x as u64));
                let found = (0..TRIES * count).filter_map(|n| {
                    let key = key.of(n as u64);
                    let start = [0, 1, 2].map(|axis| key.of(axis).f32());
                    on_surface(&block, start).map(|(at, normal)| {
                        let point = add(cube.map(|x| x as f32 + 0.5), at);
                        Marker { point, normal }
                    })
                });
                out.extend(found.filter_map(|new| placed(set, bins, markers, *cube, new)).take(count));
            }
        }
        out
    });
    parallel::concat(parts)
}

/// The cubes with corners on both sides and no marker, in the order of fields.
fn holes(set: &LevelSet, bins: &Bins) -> Vec<Cell> {
    let (stencil, phi) = (set.stencil(), set.phi());
    let (_, high) = set.domain();
    let found = stencil.fold(|runs| {
        let mut out = Vec::new();
        for run in runs {
            let [x, y, z] = run.cell;
            if y + 1 >= high[1] || z + 1 >= high[2] {
                continue;
            }
            let Some(diagonal) = stencil.rows().find([x, y + 1, z + 1]) else { continue };
            let rows = [run.at as usize, run.y[1] as usize, run.z[1] as usize, diagonal];
            for n in 0..run.len as usize {
                let inside = rows.map(|row| u8::from(phi[row + n] < 0.0) + u8::from(phi[row + n + 1] < 0.0));
                let inside: u8 = inside.iter().sum();
                let here = run.at as usize + n;
                if !inside.is_multiple_of(8) && x + (n as i32) + 1 < high[0] && bins.of(here, here + 1).is_empty() {
                    out.push([x + n as i32, y, z]);
                }
            }
        }
        out
    });
    found.concat()
}

/// Where a marker at `new`, a point of φ = 0 in a cube, belongs by the markers of its side; `None` where one is too close or
/// where they do not say. A sheet's φ has a ridge within a cell of its zero, which makes that one too thick.
fn placed(set: &LevelSet, bins: &Bins, markers: &[Marker], cube: Cell, new: Marker) -> Option<Marker> {
    let (mut same, mut opposite) = (Vec::new(), false);
    for n in bins.around(set.rows(), cube, 2) {
        let marker = &markers[*n as usize];
        let way = sub(marker.point, new.point);
        let (square, facing) = (dot(way, way), dot(marker.normal, new.normal));
        if facing > 0.0 && square < GAP * GAP {
            return None;
        }
        opposite |= facing < 0.0 && square < SHEET * SHEET;
        let near = 1.0 - square * (1.0 / (RADIUS * RADIUS));
        if facing > 0.5 && near > 0.0 {
            same.push((*n, near * near * facing * facing));
        }
    }
    let along = same.iter().map(|(n, weight)| {
        let way = sub(markers[*n as usize].point, new.point);
        (sub(way, scale(new.normal, dot(new.normal, way))), *weight)
    });
    if same.len() < ENOUGH || one_sided(along) > ONE_SIDED {
        return (!opposite).then_some(new);
    }
    let shares = linear_fit(markers, &new, same);
    let normals = shares.iter().map(|(n, share)| scale(markers[*n as usize].normal, *share));
    let normal = unit(normals.fold([0.0; 3], add))?;
    // Of two points of a sphere, the mean normal is at right angles to the way between them.
    let off = shares.iter().fold(0.0, |off, (n, share)| {
        let marker = &markers[*n as usize];
        off + share * 0.5 * dot(add(marker.normal, normal), sub(new.point, marker.point))
    });
    (off.abs() < MOVED).then(|| Marker { point: sub(new.point, scale(normal, off)), normal })
}

/// The point of φ = 0 nearest to `start`, if it is in the cube, and its normal.
fn on_surface(block: &[f32; 64], start: Vec3) -> Option<(Vec3, Vec3)> {
    let mut at = start;
    for _ in 0..STEPS {
        let (value, gradient) = cubic(block, at);
        let square = dot(gradient, gradient);
        if !DISTANCE.contains(&square) {
            return None;
        }
        at = sub(at, scale(gradient, value / square));
        if at.iter().any(|x| !(-0.5..1.5).contains(x)) {
            return None;
        }
    }
    let (value, gradient) = cubic(block, at);
    let square = dot(gradient, gradient);
    let within = at.iter().all(|x| (0.0..=1.0).contains(x));
    if !within || !DISTANCE.contains(&square) || value.abs() > OFF {
        return None;
    }
    Some((at, unit(gradient)?))
}
