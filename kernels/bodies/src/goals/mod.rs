//! Where the inside of a body belongs when its surface is brought into another shape.
//!
//! The surface is held at the shape and the inside takes its static equilibrium: each coordinate the least Dirichlet energy
//! of linear finite elements on the tets at rest (cotangent weights). Those have linear precision: the inside of a body
//! whose surface is moved by an affine map moves by that map, however its tets lie. Springs of weight E·ΣV ÷ L² have not,
//! and leave on any unstructured mesh a grain of its own in the goal; so they are for the motion, not for the goal. What is
//! affine in the motion of each body is taken off first, so that turns and stretches cost no step and lose no digit.
//!
//! Promise: affine maps to the rounding of f32; a body whose surface is not moved keeps its bits; pieces of a body that
//! hang together are solved as if they were alone; finite for any finite points; the same bits on any number of threads.
//! Limits: harmonic maps can fold where a shape is far from convex, and [`Goal::inverted`] tells; a tet flatter than
//! [`FLAT`] at rest counts as if it were so thick, which costs linear precision about as much as that share; tets inside
//! out at rest cost it. Metres.

mod equations;
mod fit;
mod pieces;
mod solve;

use equations::Equations;
use fit::Affine;
use numerics::vector::{DVec3, to_f32, to_f64};
use numerics::volume::{of_tets, six_volumes};
use pieces::ConnectedPieces;
use solve::solve;

pub use solve::GoalLimits;

/// Of the cube of a tet's longest edge, a sixth of it: what is flatter has no say in volumes, and no more weight than
/// this gives it. The rounding of f32 moves a point by 1e-7 of a body, so by 1e-5 of an edge of one in a hundred.
pub const FLAT: f64 = 1e-6;

/// A body at rest, and which of its points are held where.
#[derive(Clone, Copy, Debug)]
pub struct HeldBody<'a> {
    /// Positions at rest.
    pub points: &'a [[f32; 3]],
    /// Four points each.
    pub tets: &'a [[u32; 4]],
    /// Which row of `shape` each point is brought to; below 0 it is free. One a point.
    pub rows: &'a [i32],
    /// Where the surface belongs.
    pub shape: &'a [[f32; 3]],
}

/// The body in its goal shape, and what was reached.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct GoalShape {
    /// One point for every one at rest.
    pub points: Vec<[f32; 3]>,
    /// Steps of conjugate gradients.
    pub steps: usize,
    /// What is left of the forces on free points, as a share of what the surface exerts on them.
    pub residual: f64,
    /// Tets that are inside out or flat there and were neither at rest.
    pub inverted: usize,
    /// Free points of pieces that are held nowhere, or in no tet: they stay.
    pub loose: usize,
    /// Volume of all tets there, as a share of that at rest; none where they have none at rest.
    pub volume_ratio: Option<f64>,
}

/// Brings a body into a shape.
///
/// # Panics
/// Where a tet has a corner that is no point, a point has no row, or a row is not of the shape.
pub fn goal_shape(held: &HeldBody<'_>, limits: GoalLimits) -> GoalShape {
    let pieces = ConnectedPieces::of(held.points.len(), held.tets);
    let fits = Affine::of_pieces(held, &pieces);
    let mut loose = 0;
    // The affine part of each point's place; what is held differs from it by `held_by`.
    let mut positions: Vec<DVec3> = Vec::with_capacity(held.points.len());
    let mut held_by: Vec<Option<DVec3>> = Vec::with_capacity(held.points.len());
    for (point, rest) in held.points.iter().enumerate() {
        let fit = &fits[pieces.of_point[point] as usize];
        let position = fit.as_ref().map_or(to_f64(*rest), |fit| fit.map(*rest));
        let target = target(held, point);
        loose += usize::from(target.is_none() && fit.is_none());
        held_by.push(match target {
            Some(target) => Some(to_f64(target) - position),
            // Nothing pulls where the surface rests, or nothing is held.
            None if fit.as_ref().is_none_or(Affine::rests) => Some(DVec3::zeros()),
            None => None,
        });
        positions.push(position);
    }

    let equations = Equations::of(held.points, held.tets, &held_by);
    let solved = solve(&equations, limits);
    let mut points: Vec<[f32; 3]> = Vec::with_capacity(positions.len());
    for (point, position) in positions.iter().enumerate() {
        points.push(match (target(held, point), equations.free[point]) {
            (Some(target), _) => target,
            (None, None) => to_f32(*position),
            (None, Some(row)) => to_f32(position + solved.rows[row as usize]),
        });
    }
    let rest_volume = of_tets(held.points, held.tets);
    let volume_ratio = (rest_volume != 0.0).then(|| of_tets(&points, held.tets) / rest_volume);
    let inverted = inverted(held, &points);
    GoalShape { points, steps: solved.steps, residual: solved.residual, inverted, loose, volume_ratio }
}

/// Where a point is held.
fn target(held: &HeldBody<'_>, point: usize) -> Option<[f32; 3]> {
    usize::try_from(held.rows[point]).ok().map(|row| held.shape[row])
}

/// Tets that were upright at rest and are not in `points`.
fn inverted(held: &HeldBody<'_>, points: &[[f32; 3]]) -> usize {
    let corners = |points: &[[f32; 3]], tet: &[u32; 4]| tet.map(|corner| points[corner as usize]);
    let upright = |tet: &&[u32; 4]| {
        let corners = corners(held.points, tet);
        let edge = equations::longest_edge(&corners);
        six_volumes(corners) > FLAT * edge * edge * edge
    };
    held.tets.iter().filter(upright).filter(|tet| six_volumes(corners(points, tet)) <= 0.0).count()
}

#[cfg(test)]
mod tests;
