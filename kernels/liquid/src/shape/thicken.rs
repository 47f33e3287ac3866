//! Shapes made thick enough that no face of a cell is open through them.
//!
//! A cell's extent along a unit normal n is |n₁| + |n₂| + |n₃|. Where the distance is below 0 at both ends of every cell
//! that a plane crosses, all paths from cell to cell across it are closed; half that extent on each side is enough.

use numerics::parallel;
use numerics::vector::{Vec3, dot, scale, sub, unit};

use crate::rows::{Cell, CellRows};

use super::nearest::{Foot, middle};

/// Added on each side. The distance of a moving shape is sampled between the middles of cells of another time, where
/// trilinear values at the corner of a cell around a plane are too large by up to ⅛.
const MARGIN: f32 = 0.15;

/// Steps across a thin solid, in cells, and how many.
const STEP: f32 = 0.5;
const STEPS: i32 = 5;

/// A surface bends away from its tangent plane by at most this times the square of the distance along it: radii of 5 cells.
const BEND: f32 = 0.1;

/// Opposite sides of a thin solid are at most this far apart sideways, in cells: a diagonal.
const SIDEWAYS: f32 = 1.75;

/// Cosine of the angle between normals from which two sides are opposite.
const OPPOSITE: f32 = -0.5;

/// Distance from a surface, in cells, up to which the way to it is rounding: its triangle says where it faces.
const ON_SURFACE: f32 = 1e-2;

/// Half of the thickness that a plane needs.
fn half_thickness(normal: Option<Vec3>) -> f32 {
    let [x, y, z] = normal.unwrap_or([1.0 / 1.732_050_8; 3]).map(f32::abs);
    0.5 * (x + y + z) + MARGIN
}

/// 1, but falling to 0 at the end of the band, so that distances stay continuous there.
fn fading(distance: f32, band: f32) -> f32 {
    (0.5 * (band - distance)).clamp(0.0, 1.0)
}

/// The distance of sheets: |d| less half of their thickness.
pub(super) fn sheet(band: &CellRows, feet: &[Foot], reach: f32) -> Vec<f32> {
    let [thick] = band.tabulate_with(
        || (),
        |(), cell, at| {
            let foot = &feet[at];
            let half = half_thickness(unit(sub(middle(cell), foot.point)));
            [foot.distance - half * fading(foot.distance, reach)]
        },
    );
    thick
}

/// The distance of solids, given `distance`: thin places grow evenly on both sides until they are thick enough.
/// `normal` gives the normal of a triangle, of any length, out of the solid.
pub(super) fn solid(
    band: &CellRows,
    feet: &[Foot],
    distance: &[f32],
    reach: f32,
    normal: impl Fn(u32) -> Vec3 + Sync,
) -> Vec<f32> {
    let cells: Vec<Cell> = band.iter().collect();
    let solid = Solid { band, feet, distance, cells: &cells, normal };
    let thick = |at: usize| {
        let growth = solid.growth(at);
        distance[at] - growth * fading(distance[at].abs(), reach)
    };
    parallel::tabulate(cells.len(), parallel::CHUNK, thick)
}

struct Solid<'a, N> {
    band: &'a CellRows,
    feet: &'a [Foot],
    distance: &'a [f32],
    cells: &'a [Cell],
    normal: N,
}

impl<N: Fn(u32) -> Vec3> Solid<'_, N> {
    /// The normal, out of the solid, at the closest point of a cell; `None` on a triangle without area.
    fn outward(&self, at: usize) -> Option<Vec3> {
        if self.distance[at].abs() < ON_SURFACE {
            return unit((self.normal)(self.feet[at].triangle));
        }
        let away = sub(middle(self.cells[at]), self.feet[at].point);
        unit(if self.distance[at] < 0.0 { scale(away, -1.0) } else { away })
    }

    /// By how much the surface closest to a cell is to be moved outwards.
    fn growth(&self, at: usize) -> f32 {
        let Some(outward) = self.outward(at) else { return 0.0 };
        let half = half_thickness(Some(outward));
        let from = self.feet[at].point;
        let mut least = 2.0 * half;
        for step in 1..=STEPS {
            let beyond = sub(from, scale(outward, STEP * step as f32));
            let Some(other) = self.band.find(beyond.map(|x| x.floor() as i32)) else { break };
            let apart = sub(from, self.feet[other].point);
            let thickness = dot(apart, outward);
            let sideways = (dot(apart, apart) - thickness * thickness).max(0.0);
            let is_behind = thickness > -1e-3 - BEND * sideways;
            let is_opposite = self.outward(other).is_some_and(|normal| dot(normal, outward) < OPPOSITE);
            if is_opposite && is_behind && thickness < least && sideways < SIDEWAYS * SIDEWAYS {
                least = thickness.max(0.0);
            }
        }
        half - 0.5 * least
    }
}
