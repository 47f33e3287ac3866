//! Goal shapes: the interior of a body for a given shape of its surface.
//!
//! The surface is fixed to the shape and the interior takes its static equilibrium: each coordinate minimises the
//! Dirichlet energy of linear finite elements on the rest tets (cotangent weights). These reproduce linear functions,
//! so if the surface moves by an affine map, the interior moves by the same map on any mesh. Springs of weight E·ΣV ÷
//! L² do not, and would imprint the mesh on the goal; they are used for the motion, not for goals. The affine part of
//! each piece's motion is removed first, so that it costs no iterations and no precision.
//!
//! Guarantees: affine maps are exact to f32 rounding; a body whose surface does not move keeps its bits; connected
//! pieces are independent of each other; results are finite for any finite points, with the same bits for any number
//! of threads. Limits: harmonic maps can fold where a shape is far from convex, which [`GoalShape::inverted`]
//! reports; a tet flatter than [`FLAT`] at rest is treated as if it were that thick, which costs about that much
//! linear precision; tets that are inverted at rest cost it too. Metres.

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

/// Six times the volume of a tet ÷ the cube of its longest edge: flatter tets count neither in volumes nor with more
/// than this thickness in weights. Rounding of f32 moves points by 1e-7 of the body, 1e-5 of an edge that is a
/// hundredth of it.
pub const FLAT: f64 = 1e-6;

/// A body at rest and the target of its surface.
#[derive(Clone, Copy, Debug)]
pub struct HeldBody<'a> {
    /// Rest positions.
    pub points: &'a [[f32; 3]],
    /// Corners of each tet.
    pub tets: &'a [[u32; 4]],
    /// For each point its row in `shape`; negative for free points.
    pub rows: &'a [i32],
    /// Target positions of the surface.
    pub shape: &'a [[f32; 3]],
}

/// A goal shape, with measures of its quality.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct GoalShape {
    /// Positions of all points.
    pub points: Vec<[f32; 3]>,
    /// Iterations of conjugate gradients.
    pub steps: usize,
    /// Remaining force on free points, relative to that of the surface on them.
    pub residual: f64,
    /// Tets that are inverted or flat in the goal, but not at rest.
    pub inverted: usize,
    /// Free points of pieces without fixed points, or in no tet: they stay.
    pub loose: usize,
    /// Volume ÷ rest volume; `None` without a rest volume.
    pub volume_ratio: Option<f64>,
}

/// Computes the goal shape.
///
/// # Panics
/// If an index is out of range or a point has no row.
pub fn goal_shape(held: &HeldBody<'_>, limits: GoalLimits) -> GoalShape {
    let pieces = ConnectedPieces::of(held.points.len(), held.tets);
    let fits = Affine::of_pieces(held, &pieces);
    let mut loose = 0;
    // Affine part of each position; fixed points differ from it by `held_by`.
    let mut positions: Vec<DVec3> = Vec::with_capacity(held.points.len());
    let mut held_by: Vec<Option<DVec3>> = Vec::with_capacity(held.points.len());
    for (point, rest) in held.points.iter().enumerate() {
        let fit = &fits[pieces.of_point[point] as usize];
        let position = fit.as_ref().map_or(to_f64(*rest), |fit| fit.map(*rest));
        let target = target(held, point);
        loose += usize::from(target.is_none() && fit.is_none());
        held_by.push(match target {
            Some(target) => Some(to_f64(target) - position),
            // Nothing moves if the surface is at rest, or if no point is fixed.
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

/// Target of a fixed point.
fn target(held: &HeldBody<'_>, point: usize) -> Option<[f32; 3]> {
    usize::try_from(held.rows[point]).ok().map(|row| held.shape[row])
}

/// Tets that are upright at rest and inverted or flat in `points`.
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
