//! One multigrid V-cycle: an approximate solution of A·q = b, symmetric in b, in `f32`.

use crate::rows::Finder;
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
    pub(super) fn new(finest: Level, distances: SurfaceDistances) -> Self {
        let (mut levels, mut distances) = (vec![finest], distances);
        loop {
            let fine = &levels[levels.len() - 1];
            let cells = fine.stencil.active().len();
            if cells <= DIRECT {
                break;
            }
            let Some((coarse, coarse_distances)) = coarsened(fine, &distances) else { break };
            // Scattered drops, or a grid that is one cell wide, do not get coarser.
            if coarse.stencil.active().len() * 10 > cells * 9 {
                break;
            }
            levels.push(coarse);
            distances = coarse_distances;
        }
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

    /// `out` ≈ A⁻¹·`b`. `b` is 0 where the cell is not liquid.
    pub(super) fn solve(&self, workspace: &mut Workspace, b: &[f64], largest: f64, out: &mut [f64]) {
        // Largest entry 1: neither overflow nor denormals, whatever the unit.
        let finest = &mut workspace.0[0];
        for (to, from) in finest.b.iter_mut().zip(b) {
            *to = (from / largest) as f32;
        }
        self.cycle(0, &mut workspace.0);
        for (to, from) in out.iter_mut().zip(&workspace.0[0].q) {
            *to = f64::from(*from) * largest;
        }
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
/// out, so that walls do not pull the pressure down; air counts, with pressure 0.
fn scales(fine: &Level, coarse: &Level) -> Vec<f32> {
    let scale = |finder: &mut Finder<'_>, cell| {
        let (mut sum, mut reaches_liquid) = (0.0, false);
        Place::Centre.each_parent(cell, |parent, weight| {
            let kind = finder.find(parent).map_or(CellKind::Air, |at| coarse.kinds[at]);
            reaches_liquid |= kind == CellKind::Liquid;
            if kind != CellKind::Solid {
                sum += weight;
            }
        });
        if reaches_liquid { 1.0 / sum } else { 0.0 }
    };
    let liquid = fine.stencil.active();
    let [scales] = liquid.tabulate_with(|| Finder::new(coarse.rows()), |finder, cell, _| [scale(finder, cell)]);
    fine.rows().resampled(liquid, &scales, 0.0)
}
