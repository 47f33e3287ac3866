//! Components of liquid that meet no air: there the pressure is known but for a constant, and what flows in must flow
//! out.

use std::ops::Range;

use crate::sets::Sets;
use crate::stencil::Stencil;

use super::level::{CellKind, Level};

/// The cells of each component that meets no air, as ranges of a field.
#[derive(Clone, Debug, Default)]
pub(super) struct Closed(Vec<Vec<Range<usize>>>);

impl Closed {
    pub(super) fn find(level: &Level) -> Self {
        let pieces = pieces(level);
        let mut sets = Sets::new(pieces.len());
        let mut meets_air = vec![false; pieces.len()];
        let mut number = vec![u32::MAX; level.rows().len()];
        pieces.iter().enumerate().for_each(|(n, piece)| number[piece.clone()].fill(n as u32));
        for_each_face(&level.stencil, |axis, below, above| {
            let [below, above] = [below, above].map(|at| level.images.home(at));
            if level.weights[axis][above] > 0.0 {
                match (number[below], number[above]) {
                    (u32::MAX, n) | (n, u32::MAX) if n != u32::MAX => {
                        let outside = if number[below] == u32::MAX { below } else { above };
                        meets_air[n as usize] |= level.kinds[outside] == CellKind::Air;
                    }
                    (a, b) if a != b => sets.join(a, b),
                    _ => {}
                }
            }
        });
        let mut open = vec![false; pieces.len()];
        for n in 0..pieces.len() {
            open[sets.first(n as u32) as usize] |= meets_air[n];
        }
        let mut components: Vec<Vec<Range<usize>>> = vec![Vec::new(); pieces.len()];
        for (n, piece) in pieces.into_iter().enumerate() {
            let first = sets.first(n as u32) as usize;
            if !open[first] {
                components[first].push(piece);
            }
        }
        components.retain(|component| !component.is_empty());
        Self(components)
    }

    pub(super) fn components(&self) -> &[Vec<Range<usize>>] {
        &self.0
    }

    /// Subtracts its mean from each component of `field`; returns the largest mean, by magnitude.
    pub(super) fn subtract_means(&self, field: &mut [f64]) -> f64 {
        let mut largest = 0.0_f64;
        for component in &self.0 {
            let cells: usize = component.iter().map(ExactSizeIterator::len).sum();
            let sum: f64 = component.iter().map(|piece| field[piece.clone()].iter().sum::<f64>()).sum();
            let mean = sum / cells as f64;
            component.iter().for_each(|piece| field[piece.clone()].iter_mut().for_each(|value| *value -= mean));
            if mean.abs() > largest.abs() {
                largest = mean;
            }
        }
        largest
    }
}

/// Liquid cells next to each other along x with open faces between them.
fn pieces(level: &Level) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for run in level.stencil.runs() {
        for at in run.range() {
            match out.last_mut() {
                Some(last) if last.end == at && level.weights[0][at] > 0.0 => last.end += 1,
                _ => out.push(at..at + 1),
            }
        }
    }
    out
}

/// Calls `f` with the axis of each face of an active cell and the cells below and above it; faces between two active
/// cells come twice.
fn for_each_face(stencil: &Stencil, mut f: impl FnMut(usize, usize, usize)) {
    for run in stencil.runs() {
        for n in 0..run.len as usize {
            let at = run.at as usize + n;
            let below = [at - 1, run.y[0] as usize + n, run.z[0] as usize + n];
            let above = [at + 1, run.y[1] as usize + n, run.z[1] as usize + n];
            for axis in 0..3 {
                f(axis, below[axis], at);
                f(axis, at, above[axis]);
            }
        }
    }
}
