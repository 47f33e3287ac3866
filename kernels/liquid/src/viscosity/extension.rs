//! Velocities of coarse faces in air, extended linearly from those of free faces.
//!
//! A coarse cell that the surface cuts has stresses, which need all its faces; without them a body that is thin on the
//! coarse grid would twist freely there. And interpolation takes a rigid motion of the coarse grid to one of the fine
//! grid: a merely constant extension strains it, and what a high viscosity makes of that strain stops the iteration.

use std::collections::BTreeMap;

use numerics::parallel;

use crate::rows::{Cell, CellRows, Finder, Images};

use super::level::{FaceKind, Real};
use crate::velocity::FaceFields;

/// Steps outwards from free faces: along one axis, then along another.
const LAYERS: usize = 2;

/// Weights that one thread goes through faster than two.
const FEW: usize = 4096;

/// Of the faces along all three axes.
#[derive(Clone, Debug)]
pub(super) struct Extensions([Extension; 3]);

impl Extensions {
    pub(super) fn new(rows: &CellRows, images: &Images, kinds: &FaceFields<FaceKind>) -> Self {
        let mut extensions = Self(Default::default());
        let of_axes = extensions.0.iter_mut().zip(kinds);
        parallel::for_each(of_axes, |_, (extension, kinds)| *extension = Extension::new(rows, images, kinds));
        extensions
    }

    /// Whether a face is extended.
    pub(super) fn reaches(&self, axis: usize, at: usize) -> bool {
        self.0[axis].reaches(at)
    }

    /// Sets the velocities of extended faces.
    pub(super) fn extend<T: Real>(&self, u: &mut FaceFields<T>) {
        self.for_each_axis(u, Extension::extend);
    }

    /// The transpose: moves the forces on extended faces to free ones.
    pub(super) fn gather<T: Real>(&self, force: &mut FaceFields<T>) {
        self.for_each_axis(force, Extension::gather);
    }

    /// Sets the velocities of extended faces back to 0.
    pub(super) fn clear<T: Real>(&self, u: &mut FaceFields<T>) {
        self.0.iter().zip(u).for_each(|(extension, u)| extension.clear(u));
    }

    /// Calls `f` with the extension along each axis and the field there; in parallel where that is worth it.
    fn for_each_axis<T: Real>(&self, fields: &mut FaceFields<T>, f: impl Fn(&Extension, &mut [T]) + Sync) {
        let pairs = self.0.iter().zip(fields);
        if self.0.iter().map(|extension| extension.sources.len()).sum::<usize>() < FEW {
            pairs.for_each(|(extension, field)| f(extension, field));
        } else {
            parallel::for_each(pairs, |_, (extension, field)| f(extension, field));
        }
    }

    /// Adds to the diagonal of free faces a bound of what extended ones add to their rows.
    pub(super) fn add_diagonal(&self, diagonal: &mut FaceFields<f64>) {
        for (extension, diagonal) in self.0.iter().zip(diagonal) {
            for (target, mix) in extension.mixes() {
                let sum: f32 = mix.iter().map(|(_, weight)| weight.abs()).sum();
                let own = diagonal[target];
                for (source, weight) in mix {
                    diagonal[*source as usize] += own * f64::from(weight.abs() * sum);
                }
            }
        }
    }
}

/// For each extended face, its weights of free faces.
#[derive(Clone, Debug, Default)]
struct Extension {
    targets: Vec<(u32, u32)>,
    sources: Vec<(u32, f32)>,
}

impl Extension {
    fn new(rows: &CellRows, images: &Images, kinds: &[FaceKind]) -> Self {
        // The extended faces so far with what they are a mix of, and the number of each in this list.
        let mut known: Vec<(u32, Vec<(u32, f32)>)> = Vec::new();
        let mut number: Vec<Option<u32>> = vec![None; rows.len()];
        let cells = Finder::new(rows);
        let near = |cell: Cell, along: usize, by: i32| {
            let mut cell = cell;
            cell[along] += by;
            cells.find(cell).map(|at| images.home(at) as u32)
        };
        for _ in 0..LAYERS {
            // What a face is a mix of, if it has a velocity so far.
            let mix = |at: u32| match kinds[at as usize] {
                FaceKind::Free => Some(vec![(at, 1.0)]),
                FaceKind::Solid => Some(Vec::new()),
                FaceKind::Air => number[at as usize].map(|number| known[number as usize].1.clone()),
            };
            let mut layer = Vec::new();
            for (at, cell) in (0_u32..).zip(rows.iter()) {
                if kinds[at as usize] != FaceKind::Air || number[at as usize].is_some() || !images.is_home(at as usize)
                {
                    continue;
                }
                let mut lines: Vec<Vec<(u32, f32)>> = Vec::new();
                for (along, by) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
                    let first = near(cell, along, by).filter(|at| kinds[*at as usize] != FaceKind::Solid);
                    if let Some(first) = first.and_then(&mix)
                        && let Some(second) = near(cell, along, 2 * by).and_then(&mix)
                    {
                        let twice = first.into_iter().map(|(source, weight)| (source, 2.0 * weight));
                        lines.push(twice.chain(second.into_iter().map(|(source, weight)| (source, -weight))).collect());
                    }
                }
                if !lines.is_empty() {
                    layer.push((at, mean(&lines)));
                }
            }
            for (at, mix) in layer {
                number[at as usize] = Some(known.len() as u32);
                known.push((at, mix));
            }
        }
        known.sort_unstable_by_key(|(target, _)| *target);
        let mut extension = Self::default();
        for (target, mix) in known {
            extension.sources.extend(mix);
            extension.targets.push((target, extension.sources.len() as u32));
        }
        extension
    }

    /// The extended faces, with their weights of free faces.
    fn mixes(&self) -> impl Iterator<Item = (usize, &[(u32, f32)])> {
        let starts = [0].into_iter().chain(self.targets.iter().map(|(_, end)| *end as usize));
        self.targets
            .iter()
            .zip(starts)
            .map(|((target, end), start)| (*target as usize, &self.sources[start..*end as usize]))
    }

    fn reaches(&self, at: usize) -> bool {
        self.targets.binary_search_by_key(&(at as u32), |(target, _)| *target).is_ok()
    }

    fn extend<T: Real>(&self, u: &mut [T]) {
        for (target, mix) in self.mixes() {
            let add = |sum: T, (source, weight): &(u32, f32)| sum + T::from(*weight) * u[*source as usize];
            u[target] = mix.iter().fold(T::default(), add);
        }
    }

    fn gather<T: Real>(&self, force: &mut [T]) {
        for (target, mix) in self.mixes() {
            let value = std::mem::take(&mut force[target]);
            for (source, weight) in mix {
                force[*source as usize] = force[*source as usize] + T::from(*weight) * value;
            }
        }
    }

    fn clear<T: Real>(&self, u: &mut [T]) {
        self.targets.iter().for_each(|(target, _)| u[*target as usize] = T::default());
    }
}

/// The mean of several mixes, each source once.
fn mean(lines: &[Vec<(u32, f32)>]) -> Vec<(u32, f32)> {
    let mut sum: BTreeMap<u32, f32> = BTreeMap::new();
    for (source, weight) in lines.iter().flatten() {
        *sum.entry(*source).or_default() += weight / lines.len() as f32;
    }
    sum.into_iter().filter(|(_, weight)| *weight != 0.0).collect()
}
