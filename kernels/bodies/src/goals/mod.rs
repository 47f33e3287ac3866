//! Goal shapes: all points of a body for a given shape of its surface, or of a mesh that rides along.
//!
//! The surface is fixed to the shape and the interior takes its static equilibrium: each coordinate minimises the
//! Dirichlet energy of linear finite elements on the rest tets (cotangent weights). These reproduce linear functions,
//! so if the surface moves by an affine map, the interior moves by the same map on any mesh. Springs of weight E·ΣV ÷
//! L² do not, and would imprint the mesh on the goal; they are used for the motion, not for goals. The affine part of
//! each piece's motion is removed first, so that it costs no iterations and no precision.
//!
//! The points of a mesh that rides along are weighted sums of particles, in general more than the particles can meet: a
//! stiff spring draws each to its target ([`RIDING_STIFFNESS`]), so that together they come as close as the tets allow.
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

use crate::embedding::EmbeddedPoint;
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

/// Stiffness of the springs that draw a mesh that rides along, relative to that of the tets at its points. Of a bent ball
/// (see the tests) the rms distance of the mesh from its target is then 4 % larger than with ten times the stiffness, with
/// a tenth 11 %; it takes 40 iterations, 44 and 35.
pub const RIDING_STIFFNESS: f64 = 1e3;

/// A body at rest and the target of its surface.
#[derive(Clone, Copy, Debug)]
pub struct HeldBody<'a> {
    /// Rest positions.
    pub points: &'a [[f32; 3]],
    /// Corners of each tet.
    pub tets: &'a [[u32; 4]],
    /// What has a target.
    pub by: HeldBy<'a>,
}

/// What of a body has a target.
#[derive(Clone, Copy, Debug)]
pub enum HeldBy<'a> {
    /// Points of the body.
    Points {
        /// For each point of the body its row in `shape`; negative for free points.
        rows: &'a [i32],
        /// Target positions.
        shape: &'a [[f32; 3]],
    },
    /// Points of a mesh that rides along.
    Riding {
        /// Where each is in the body.
        carriers: &'a [EmbeddedPoint],
        /// Rest position of each.
        rest: &'a [[f32; 3]],
        /// Target position of each.
        shape: &'a [[f32; 3]],
    },
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
    /// Largest distance of a mesh that rides along from its target, metres; 0 where points of the body are fixed.
    pub missed: f64,
}

/// Computes the goal shape.
///
/// # Panics
/// If an index is out of range, or a point has no row, carrier or target.
pub fn goal_shape(held: &HeldBody<'_>, limits: GoalLimits) -> GoalShape {
    let pieces = ConnectedPieces::of(held.points.len(), held.tets);
    let fits = Affine::of_pieces(held, &pieces);
    let fit_of = |point: usize| fits[pieces.of_point[point] as usize].as_ref();
    let mut loose = 0;
    // Affine part of each position; fixed points differ from it by `held_by`.
    let mut positions: Vec<DVec3> = Vec::with_capacity(held.points.len());
    let mut held_by: Vec<Option<DVec3>> = Vec::with_capacity(held.points.len());
    for (point, rest) in held.points.iter().enumerate() {
        let fit = fit_of(point);
        let position = fit.map_or(to_f64(*rest), |fit| fit.map(*rest));
        let target = held.target(point);
        loose += usize::from(target.is_none() && fit.is_none());
        held_by.push(match target {
            Some(target) => Some(to_f64(target) - position),
            // Nothing moves if the surface is at rest, or if no point is fixed.
            None if fit.is_none_or(Affine::rests) => Some(DVec3::zeros()),
            None => None,
        });
        positions.push(position);
    }
    let ties = held.ties(&positions, &mut held_by);

    let equations = Equations::of(held.points, held.tets, &ties, &held_by);
    let solved = solve(&equations, limits);
    let mut points: Vec<[f32; 3]> = Vec::with_capacity(positions.len());
    for (point, position) in positions.iter().enumerate() {
        points.push(match (held.target(point), equations.free[point]) {
            (Some(target), _) => target,
            (None, None) => to_f32(*position),
            (None, Some(row)) => to_f32(position + solved.rows[row as usize]),
        });
    }
    let rest_volume = of_tets(held.points, held.tets);
    let volume_ratio = (rest_volume != 0.0).then(|| of_tets(&points, held.tets) / rest_volume);
    let (inverted, missed) = (inverted(held, &points), held.missed(&points));
    GoalShape { points, steps: solved.steps, residual: solved.residual, inverted, loose, volume_ratio, missed }
}

impl HeldBody<'_> {
    /// Target of a fixed point.
    fn target(&self, point: usize) -> Option<[f32; 3]> {
        let HeldBy::Points { rows, shape } = self.by else { return None };
        usize::try_from(rows[point]).ok().map(|row| shape[row])
    }

    /// A point of the piece, the rest position and the target of each thing that has one.
    fn targets(&self) -> Vec<(usize, [f32; 3], [f32; 3])> {
        match self.by {
            HeldBy::Points { .. } => {
                let all = self.points.iter().enumerate();
                all.filter_map(|(point, rest)| Some((point, *rest, self.target(point)?))).collect()
            }
            HeldBy::Riding { carriers, rest, shape } => {
                let piece = carriers.iter().map(|carrier| carrier.particles[0] as usize);
                piece.zip(rest).zip(shape).map(|((point, rest), target)| (point, *rest, *target)).collect()
            }
        }
    }

    /// Largest distance from its target of a mesh that rides along on `points`.
    fn missed(&self, points: &[[f32; 3]]) -> f64 {
        let HeldBy::Riding { carriers, shape, .. } = self.by else { return 0.0 };
        let away = |(carrier, target): (&EmbeddedPoint, &[f32; 3])| {
            let at = carrier.sides().map(|(a, share)| to_f64(points[a as usize]) * share).sum::<DVec3>();
            (at - to_f64(*target)).norm()
        };
        carriers.iter().zip(shape).map(away).fold(0.0, f64::max)
    }

    /// Springs to the targets of a mesh that rides along: edges and their weights. A target is a fixed point, added to
    /// `held_by`, at its displacement from where the affine part of the motion, `positions`, brings its carrier.
    ///
    /// A spring of weight w from Σ ωₐ xₐ, Σ ωₐ = 1, to y is springs of weights w·ωₐ from the particles to y less springs
    /// of weights w·ωₐ·ω_b between them: Σ ωₐ |xₐ − y|² − Σ_{a<b} ωₐ ω_b |xₐ − x_b|² = |Σ ωₐ xₐ − y|².
    fn ties(&self, positions: &[DVec3], held_by: &mut Vec<Option<DVec3>>) -> Vec<([u32; 2], f64)> {
        let HeldBy::Riding { carriers, shape, .. } = self.by else { return Vec::new() };
        let stiffness = equations::stiffness(self.points, self.tets);
        let mut ties = Vec::with_capacity(10 * carriers.len());
        for (carrier, target) in carriers.iter().zip(shape) {
            let sides: Vec<(u32, f64)> = carrier.sides().collect();
            let sum = |of: &dyn Fn(usize) -> f64| sides.iter().map(|(a, share)| share * of(*a as usize)).sum::<f64>();
            let weight = RIDING_STIFFNESS * sum(&|a| stiffness[a]).abs();
            let at = DVec3::from_fn(|axis, _| sum(&|a| positions[a][axis]));
            let end = held_by.len() as u32;
            held_by.push(Some(to_f64(*target) - at));
            for (k, (a, share)) in sides.iter().enumerate() {
                ties.push(([*a, end], weight * share));
                for (b, other) in &sides[..k] {
                    ties.push(([*a.min(b), *a.max(b)], -weight * share * other));
                }
            }
        }
        ties
    }
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
