//! Components of liquid that meet no air: there the pressure is known but for a constant, and what flows in must flow
//! out.

use std::ops::Range;

use crate::sets::Sets;
use crate::stencil::Run;

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
        for contacts in level.stencil.fold(|runs| Contacts::of(level, &number, runs)) {
            contacts.with_air.iter().for_each(|piece| meets_air[*piece as usize] = true);
            contacts.joined.iter().flatten().for_each(|[a, b]| sets.join(*a, *b));
        }
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
    let is_open = |at: usize| level.weights[0][at] > 0.0;
    let of_chunks = level.stencil.fold(|runs| {
        let mut out: Vec<Range<usize>> = Vec::new();
        for at in runs.iter().flat_map(Run::range) {
            match out.last_mut() {
                Some(last) if last.end == at && is_open(at) => last.end += 1,
                _ => out.push(at..at + 1),
            }
        }
        out
    });
    let mut all: Vec<Range<usize>> = Vec::new();
    for mut pieces in of_chunks {
        // A piece may go on from one chunk to the next.
        match (all.last_mut(), pieces.first_mut()) {
            (Some(last), Some(first)) if last.end == first.start && is_open(first.start) => {
                first.start = last.start;
                all.pop();
            }
            _ => {}
        }
        all.extend(pieces);
    }
    all
}

/// What the pieces of a chunk have open faces to.
#[derive(Default)]
struct Contacts {
    with_air: Vec<u32>,
    /// Along each axis.
    joined: [Vec<[u32; 2]>; 3],
}

impl Contacts {
    /// `number`: the piece of each cell, `u32::MAX` where it is not liquid.
    fn of(level: &Level, number: &[u32], runs: &[Run]) -> Self {
        let mut contacts = Self::default();
        for run in runs {
            for n in 0..run.len as usize {
                let (at, below, above) = run.neighbours(n);
                for axis in 0..3 {
                    contacts.add(level, number, axis, [at, below[axis]], at);
                    // The face to a liquid cell above is that one's, too.
                    if number[above[axis]] == u32::MAX {
                        contacts.add(level, number, axis, [at, above[axis]], above[axis]);
                    }
                }
            }
        }
        contacts
    }

    /// Of a liquid cell and one beside it, with the low face of `face` between them.
    #[inline(always)]
    fn add(&mut self, level: &Level, number: &[u32], axis: usize, [at, beside]: [usize; 2], face: usize) {
        let [beside, face] = [beside, face].map(|at| level.images.home(at));
        let [own, other] = [at, beside].map(|at| number[at]);
        if own == other || level.weights[axis][face] <= 0.0 {
            return;
        }
        if other != u32::MAX {
            // Pieces lie beside each other over many cells.
            let joined = &mut self.joined[axis];
            if joined.last() != Some(&[own, other]) {
                joined.push([own, other]);
            }
        } else if level.kinds[beside] == CellKind::Air && self.with_air.last() != Some(&own) {
            self.with_air.push(own);
        }
    }
}
