//! Liquid that comes out of liquid, or vanishes in it.

use crate::carried::{LiquidMaterial, Stir};
use crate::pressure::PressureSolver;
use crate::rows::Cell;
use crate::step::motion::Motion;

/// Share of a rate that rounding may withhold.
const ROUNDING: f64 = 1e-9;

/// Whose account a volume goes to.
#[derive(Clone, Copy, Debug)]
pub(super) enum Holder {
    Source(usize),
    Sink(usize),
}

/// Divergence of liquid cells.
#[derive(Clone, Debug)]
pub(super) struct Pour {
    holder: Holder,
    cells: Vec<Cell>,
    /// What is to come out of them, m³/s; below 0 it vanishes.
    wanted: f64,
    /// What does.
    granted: f64,
    /// Whether the pressure decides about the velocity of none of them.
    is_imposed: bool,
    /// What it is made of.
    material: LiquidMaterial,
}

impl Pour {
    pub(super) fn new(holder: Holder, cells: Vec<Cell>, wanted: f64) -> Self {
        Self { holder, cells, wanted, granted: 0.0, is_imposed: false, material: LiquidMaterial::default() }
    }

    /// The same of this material.
    pub(super) fn of(self, material: LiquidMaterial) -> Self {
        Self { material, ..self }
    }

    /// The speed of the liquid around it, m/s; `cell`: the side of a cell, m.
    pub(super) fn speed(&self, cell: f64) -> f64 {
        let side = libm::cbrt(self.cells.len() as f64) * cell;
        self.wanted.abs() / (6.0 * side * side)
    }

    /// Enters what was granted, in a substep of so many seconds, into its account.
    pub(super) fn enter(&self, motion: &mut Motion, seconds: f64) {
        let account = match self.holder {
            Holder::Source(n) => &mut motion.sources[n],
            Holder::Sink(n) => &mut motion.sinks[n],
        };
        account.pouring = self.granted.abs();
        if motion.materials.is_some() && self.granted > 0.0 {
            motion.stirred.push(Stir::new(self.cells.clone(), self.granted, self.material));
        }
        // What nothing gives way to is not made good later. Where a nozzle imposes the velocity of all of its liquid, nothing was
        // asked: there is room again once that has moved on, for what the rate gives until then.
        if self.granted / self.wanted < 1.0 - ROUNDING {
            account.withhold_beyond(if self.is_imposed { account.expected * seconds } else { 0.0 });
        }
    }

    /// Where its liquid cells are in a solver's fields, and the net outflow that each is to have, m/s.
    fn targets(&self, solver: &PressureSolver, cell: f64) -> Vec<(usize, f64)> {
        let found = self.cells.iter().filter_map(|cell| solver.rows().find(*cell));
        let liquid: Vec<usize> = found.filter(|at| solver.is_liquid(*at)).collect();
        let target = self.wanted / (cell * cell * liquid.len() as f64);
        liquid.into_iter().map(|at| (at, target)).collect()
    }
}

/// Adds to the net inflow of each cell, m/s, what comes out of it, less what vanishes, and grants that. Liquid that meets no
/// air gives way only to what it loses elsewhere. Returns the net inflow beyond that, m/s a cell; the largest.
pub(super) fn pour(pours: &mut [Pour], solver: &PressureSolver, cell: f64, inflow: &mut [f64]) -> f64 {
    let mut targets: Vec<Vec<(usize, f64)>> = pours.iter().map(|pour| pour.targets(solver, cell)).collect();
    let mut unbalanced = 0.0_f64;
    if !pours.is_empty() {
        for component in solver.closed_components() {
            let is_in = |at: usize| {
                let piece = component.get(component.partition_point(|piece| piece.end <= at));
                piece.is_some_and(|piece| piece.contains(&at))
            };
            let own: Vec<&mut f64> =
                targets.iter_mut().flatten().filter(|(at, _)| is_in(*at)).map(|(_, target)| target).collect();
            if own.is_empty() {
                continue;
            }
            let driven: f64 = component.iter().map(|piece| inflow[piece.clone()].iter().sum::<f64>()).sum();
            let excess = balance(own, driven);
            let count: usize = component.iter().map(ExactSizeIterator::len).sum();
            let mean = excess / count as f64;
            unbalanced = if mean.abs() > unbalanced.abs() { mean } else { unbalanced };
        }
    }
    for (pour, targets) in pours.iter_mut().zip(targets) {
        pour.is_imposed = targets.is_empty();
        for (at, target) in targets {
            inflow[at] += target;
            pour.granted += target * cell * cell;
        }
    }
    unbalanced
}

/// Where too much flows in, makes what comes out less; where too much vanishes, that. `driven`: what flows in besides.
/// Returns by how much it was too much.
fn balance(targets: Vec<&mut f64>, driven: f64) -> f64 {
    let excess = driven + targets.iter().map(|target| **target).sum::<f64>();
    let adds_to_it = |target: f64| target * excess > 0.0;
    let total: f64 = targets.iter().map(|target| **target).filter(|target| adds_to_it(*target)).sum();
    let share = if total == 0.0 { 1.0 } else { (1.0 - excess / total).max(0.0) };
    targets.into_iter().filter(|target| adds_to_it(**target)).for_each(|target| *target *= share);
    excess
}
