//! One multigrid V-cycle: an approximate solution of A·q = b, symmetric in b, in `f32`.

use crate::fields::{divide_into, multiply_into};
use crate::grids::coarsened_to;
use crate::stencil::Run;
use crate::transfer::{Place, add_interpolated, restrict};

use super::coarsen::coarsened;
use super::dense::Factors;
use super::level::{CellKind, Level, SurfaceDistances};

/// Cells of the coarsest grid that are solved for directly, at most.
const DIRECT: usize = 160;

/// Times that the coarsest grid is smoothed where it is not solved for directly.
const SMOOTHED: usize = 8;

#[derive(Clone, Debug)]
pub(super) struct Multigrid {
    levels: Vec<Level>,
    /// Of each level but the coarsest, towards the next.
    scales: Vec<Vec<f32>>,
    /// Of the coarsest level.
    factors: Option<Factors>,
}

/// The fields of a level during a cycle.
#[derive(Clone, Debug)]
struct Scratch {
    q: Vec<f32>,
    b: Vec<f32>,
    spare: Vec<f32>,
    step: Vec<f32>,
}

/// The fields of all levels during a cycle.
#[derive(Clone, Debug)]
pub(super) struct Workspace(Vec<Scratch>);

impl Multigrid {
    /// `distances`: of the surface, on the finest grid.
    pub(super) fn new(finest: Level, distances: &SurfaceDistances) -> Self {
        let mut coarser = None;
        let coarsen = |fine: &Level| {
            let (coarse, distances) = coarsened(fine, coarser.as_ref().unwrap_or(distances))?;
            coarser = Some(distances);
            Some(coarse)
        };
        let levels = coarsened_to(DIRECT, finest, |level| level.stencil.active().len(), coarsen);
        let scales = levels.windows(2).map(|pair| scales(&pair[0], &pair[1])).collect();
        let coarsest = &levels[levels.len() - 1];
        let factors = (coarsest.stencil.active().len() <= DIRECT).then(|| Factors::new(coarsest));
        Self { levels, scales, factors }
    }

    pub(super) fn finest(&self) -> &Level {
        &self.levels[0]
    }

    pub(super) fn workspace(&self) -> Workspace {
        let scratch = |level: &Level| {
            let zero = vec![0.0; level.rows().len()];
            Scratch { q: zero.clone(), b: zero.clone(), spare: zero.clone(), step: zero }
        };
        Workspace(self.levels.iter().map(scratch).collect())
    }

    /// `out` ≈ A⁻¹·`b`, whose largest entry is `largest`; Σ b·out. `b` is 0 where the cell is not liquid.
    pub(super) fn solve(&self, workspace: &mut Workspace, b: &[f64], largest: f64, out: &mut [f64]) -> f64 {
        // Largest entry 1: neither overflow nor denormals, whatever the unit.
        divide_into(&mut workspace.0[0].b, b, largest);
        self.cycle(0, &mut workspace.0);
        multiply_into(out, &workspace.0[0].q, largest, b)
    }

    fn cycle(&self, number: usize, scratch: &mut [Scratch]) {
        let level = &self.levels[number];
        let (fine, coarser) = scratch.split_at_mut(1);
        let Scratch { q, b, spare, step } = &mut fine[0];
        let Some(scale) = self.scales.get(number) else {
            match &self.factors {
                Some(factors) => factors.solve(b, q),
                None => (0..SMOOTHED).for_each(|turn| level.smooth(turn == 0, b, q, spare, step)),
            }
            return;
        };
        let coarse = &self.levels[number + 1];
        level.smooth(true, b, q, spare, step);
        level.scaled_residual(q, b, scale, spare);
        level.images.fill_for_sums(spare, None);
        restrict(Place::Centre, level.rows(), &coarse.stencil, spare, &mut coarser[0].b);
        self.cycle(number + 1, coarser);
        coarse.images.fill(&mut coarser[0].q);
        add_interpolated(Place::Centre, &level.stencil, coarse.rows(), scale, &coarser[0].q, q);
        level.smooth(false, b, q, spare, step);
    }
}

/// What the weights of interpolation are multiplied by in each fine cell; 0 where it is not liquid. Solid cells are left
/// out, so that walls do not pull the pressure down; air counts, with pressure 0 at the centres of its cells. The surface may
/// be much nearer, at θ cells: a cell whose neighbours keep their pressure then has less of it, by the share of the surface in
/// the diagonal, and so has what is interpolated there. Without that a correction is too large by 1/θ next to the surface, and
/// a splash takes twice the iterations.
fn scales(fine: &Level, coarse: &Level) -> Vec<f32> {
    let interpolated = |kind: CellKind| {
        let is_kind: Vec<f32> = coarse.kinds.iter().map(|other| f32::from(*other == kind)).collect();
        let (mut shares, ones) = (vec![0.0; fine.rows().len()], vec![1.0; fine.rows().len()]);
        add_interpolated(Place::Centre, &fine.stencil, coarse.rows(), &ones, &is_kind, &mut shares);
        shares
    };
    // Shares are multiples of 1/64, so no sum of them is rounded.
    let (mut scales, solid) = (interpolated(CellKind::Liquid), interpolated(CellKind::Solid));
    fine.stencil.update([&mut scales], |runs, first, [scales]| {
        for at in runs.iter().flat_map(Run::range) {
            let scale = &mut scales[at - first];
            let held = (1.0 - fine.surface[at] * fine.inverse_diagonal[at]).min(1.0);
            *scale = if *scale > 0.0 { held / (1.0 - solid[at]) } else { 0.0 };
        }
    });
    scales
}
