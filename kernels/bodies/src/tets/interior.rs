//! Interior points: a jittered body-centred cubic lattice, at some distance from the surface.
//!
//! This lattice is its own Delaunay tetrahedralisation, with congruent tets of two nearly equal edge lengths. No
//! empty sphere passes through five of its points, so a small jitter does not change the tets. It hides the lattice
//! planes: springs in a dozen directions only would be visible.

use super::closed::ClosedSurface;
use super::grid::{GridPoint, SIDE};
use super::winding::Winding;
use numerics::parallel;
use numerics::random::Key;

/// Side of the lattice's cube ÷ mean edge length: at each point 8 edges of √3⁄2 sides and 6 of one side meet.
pub(super) const SIDE_BY_EDGE: f64 = 14.0 / (4.0 * 1.732_050_807_568_877_2 + 6.0);

/// Lattice points in a cube.
pub(super) const POINTS_A_CUBE: f64 = 2.0;

/// Clearance from the surface, relative to the mean edge length or the longest side of the nearest triangle. With
/// less, tets at the surface become flat and may miss the triangle as a face; with more, they become elongated.
const CLEAR: f64 = 0.5;

/// Triangles count as at most this many mean edges long, so that coarse surfaces get interior points too.
const LONGEST: f64 = 2.0;

/// Largest jitter along each axis, relative to the side of a cube.
const MOVE: f64 = 0.05;

/// An arbitrary constant.
const SEED: u64 = 0xbcc;

/// An interior point.
#[derive(Clone, Copy, Debug)]
pub(super) struct InteriorPoint {
    pub(super) grid_point: GridPoint,
    /// Distance from the surface, in grid steps; possibly larger.
    pub(super) clear: f32,
    pub(super) body: u32,
}

/// All interior lattice points for a mean edge length of `spacing` grid steps.
pub(super) fn interior(closed: &ClosedSurface, winding: &Winding, spacing: f64) -> Vec<InteriorPoint> {
    if closed.grid_points.is_empty() {
        return Vec::new();
    }
    let side = SIDE_BY_EDGE * spacing;
    let (low, high) =
        closed.grid_points.iter().fold(([SIDE; 3], [0; 3]), |(low, high): (GridPoint, GridPoint), grid_point| {
            ([0, 1, 2].map(|k| low[k].min(grid_point[k])), [0, 1, 2].map(|k| high[k].max(grid_point[k])))
        });
    // The lattice is centred on the bounds, so that symmetric bodies are filled symmetrically.
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
    parallel::map(-reach[2]..=reach[2], |_, z| layer(z)).concat()
}

/// Distance from the surface, as far as it matters, and the required clearance, in grid steps.
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
