//! Points inside of bodies: a body-centred cubic lattice, each moved a little, all well away from the surface.
//!
//! Such a lattice is its own Delaunay complex of equal tets, each with edges of two nearly equal lengths, and no five of
//! its points are on an empty sphere, so a small move changes no tet. The moves take away the lattice's planes: springs
//! in a dozen directions only would show.

use rayon::prelude::*;

use super::closed::ClosedSurface;
use super::grid::{GridPoint, SIDE};
use super::winding::Winding;
use numerics::random::Key;

/// Side of a lattice's cube by mean length of its edges: 8 of √3⁄2 sides and 6 of one side meet in a point.
pub(super) const SIDE_BY_EDGE: f64 = 14.0 / (4.0 * 1.732_050_807_568_877_2 + 6.0);

/// Points a cube.
pub(super) const POINTS_A_CUBE: f64 = 2.0;

/// How far points stay from the surface, by the mean length of their edges or the longest side of the nearest triangle:
/// nearer, tets at the surface become flat and the triangle may no longer be a face of theirs; farther, they become long.
const CLEAR: f64 = 0.5;

/// Triangles longer than this many mean edges count as this long: what has few faces is filled too.
const LONGEST: f64 = 2.0;

/// How far a point is moved along each axis at most, by the side of a cube.
const MOVE: f64 = 0.05;

/// Any fixed number.
const SEED: u64 = 0xbcc;

/// A point inside of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct InteriorPoint {
    pub(super) grid_point: GridPoint,
    /// No surface is nearer than this, in steps of the lattice.
    pub(super) clear: f32,
    pub(super) body: u32,
}

/// All points of the lattice with edges `spacing` (steps) long on average that are inside of a body.
pub(super) fn interior(closed: &ClosedSurface, winding: &Winding, spacing: f64) -> Vec<InteriorPoint> {
    if closed.grid_points.is_empty() {
        return Vec::new();
    }
    let side = SIDE_BY_EDGE * spacing;
    let (low, high) =
        closed.grid_points.iter().fold(([SIDE; 3], [0; 3]), |(low, high): (GridPoint, GridPoint), grid_point| {
            ([0, 1, 2].map(|k| low[k].min(grid_point[k])), [0, 1, 2].map(|k| high[k].max(grid_point[k])))
        });
    // Cubes to either side of the bounds' middle, so that what is symmetric is cut so.
    let reach = [0, 1, 2].map(|k| (0.5 * f64::from(high[k] - low[k]) / side).ceil() as i64);
    let middle = [0, 1, 2].map(|k| 0.5 * f64::from(high[k] + low[k]));
    let layer = |z: i64| {
        let mut tally = Vec::new();
        let mut found = Vec::new();
        for (y, x) in (-reach[1]..=reach[1]).flat_map(|y| (-reach[0]..=reach[0]).map(move |x| (y, x))) {
            for centre in 0..2 {
                let key = [x, y, z, centre].iter().fold(Key::new(SEED), |key, k| key.of(*k as u64));
                let at = [0, 1, 2].map(|k| {
                    let moved = MOVE * (2.0 * key.of(k).f64() - 1.0);
                    middle[k as usize] + side * ([x, y, z][k as usize] as f64 + 0.5 * centre as f64 + moved)
                });
                if !(0..3).all(|k| at[k] >= f64::from(low[k]) && at[k] <= f64::from(high[k])) {
                    continue;
                }
                let grid_point = at.map(|x| x.round_ties_even() as i32);
                winding.around(grid_point.map(i64::from), 1, &mut tally);
                let Some(body) = closed.body(&tally) else { continue };
                let (clear, needed) = clearance(closed, grid_point, spacing);
                if clear >= needed {
                    found.push(InteriorPoint { grid_point, clear: clear as f32, body });
                }
            }
        }
        found
    };
    (-reach[2]..reach[2] + 1).into_par_iter().flat_map_iter(layer).collect()
}

/// Distance of a place from the surface, as far as it matters, and how much it should be. Steps.
fn clearance(closed: &ClosedSurface, grid_point: GridPoint, spacing: f64) -> (f64, f64) {
    let reach = SIDE_BY_EDGE.max(CLEAR * LONGEST) * spacing;
    match closed.tree.closest(grid_point.map(|x| x as f32), reach as f32) {
        None => (reach, CLEAR * spacing),
        Some(found) => {
            let side = closed.longest_side(found.triangle);
            (f64::from(found.distance), CLEAR * side.clamp(spacing, LONGEST * spacing))
        }
    }
}
