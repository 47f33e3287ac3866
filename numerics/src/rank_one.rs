//! Sums of rank-one terms, H = Σ g gᵀ, where each g involves several particles.
//!
//! Region volumes, thin tetrahedra and contacts between bodies are such terms. A product reads each term twice: by
//! term, for g·p, and by particle, for Σ g (g·p). Nothing is scattered, so the order of every sum is fixed. Stored in
//! f32: rigid motions are resisted only to 1e-7.

use crate::partition::{Partition, RaggedSlice};
use crate::quad::Quad;
use crate::simd::{Path, kernel};
use crate::vector::{DVec3, to_f32};

/// Rank-one terms, stored by term and by particle.
#[derive(Clone, Debug, Default)]
pub struct RankOneTerms {
    /// Whether they are ignored.
    pub idle: bool,
    /// Start of each term's entries.
    starts: Vec<u32>,
    /// Each term's entries: √weight·gradient, and the particle.
    entries: Vec<Entry>,
    /// Start of each particle's entries in `at`; empty without terms.
    at_starts: Vec<u32>,
    /// Each particle's entries: the same vectors, and the term.
    at: Vec<Entry>,
    /// The index in `entries` of each of them.
    at_entries: Vec<u32>,
    /// The particles with entries, ascending.
    members: Vec<u32>,
    partition: Option<Partition>,
    /// g·p of each term in the current product.
    change: Vec<f64>,
}

/// A vector, with an index in the bits of the fourth lane: 16 bytes, which a product reads at once.
#[derive(Clone, Copy, Debug, Default)]
struct Entry([f32; 4]);

impl Entry {
    /// Added to indices, so that their bits are those of a normal number: others may take long to convert.
    const NORMAL: u32 = 2.0_f32.to_bits();

    fn new(index: u32) -> Self {
        Self([0.0, 0.0, 0.0, f32::from_bits(Self::NORMAL + index)])
    }

    fn set(&mut self, along: [f32; 3]) {
        self.0[..3].copy_from_slice(&along);
    }

    #[inline(always)]
    fn index(&self) -> usize {
        (self.0[3].to_bits() - Self::NORMAL) as usize
    }

    /// The vector; the fourth lane is finite.
    #[inline(always)]
    fn along(&self) -> Quad {
        Quad::widened(self.0)
    }
}

impl RankOneTerms {
    /// Sets the particles of each term, whose entries begin at `starts`, for a body of `count` particles.
    pub fn set_topology(&mut self, count: usize, starts: &[u32], particles: &[u32], partition: Partition) {
        self.starts.clear();
        self.entries.clear();
        self.at_starts.clear();
        self.at.clear();
        self.at_entries.clear();
        self.members.clear();
        self.change.clear();
        if particles.is_empty() {
            return;
        }
        self.starts.extend_from_slice(starts);
        self.entries.extend(particles.iter().map(|particle| Entry::new(*particle)));
        self.at_starts.resize(count + 1, 0);
        particles.iter().for_each(|particle| self.at_starts[*particle as usize + 1] += 1);
        for particle in 0..count {
            if self.at_starts[particle + 1] > 0 {
                self.members.push(particle as u32);
            }
            self.at_starts[particle + 1] += self.at_starts[particle];
        }
        let mut next = self.at_starts.clone();
        self.at.resize(particles.len(), Entry::default());
        self.at_entries.resize(particles.len(), 0);
        for row in 0..starts.len() - 1 {
            for entry in starts[row]..starts[row + 1] {
                let slot = &mut next[particles[entry as usize] as usize];
                self.at[*slot as usize] = Entry::new(row as u32);
                self.at_entries[*slot as usize] = entry;
                *slot += 1;
            }
        }
        self.change.resize(starts.len() - 1, 0.0);
        self.partition = Some(partition);
    }

    /// Whether there are no terms to apply.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.idle || self.at_starts.is_empty()
    }

    /// Number of terms.
    pub fn len(&self) -> usize {
        self.change.len()
    }

    /// Range of a term's entries.
    pub fn row(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// The particles and vectors of a term.
    pub fn entries(&self, row: usize) -> impl Iterator<Item = (usize, DVec3)> + Clone {
        self.entries[self.row(row)].iter().map(|entry| (entry.index(), entry.along().xyz()))
    }

    /// Those of some `particles` that have entries, ascending.
    #[inline]
    pub fn members(&self, particles: std::ops::Range<usize>) -> &[u32] {
        if self.idle { &[] } else { part_of(&self.members, particles) }
    }

    /// The terms in fixed parts; `None` without terms to apply.
    pub fn partition(&self) -> Option<&Partition> {
        self.partition.as_ref().filter(|_| !self.is_empty())
    }

    /// Sets the vectors: √`weights` of the term times the entry's gradient.
    pub fn set(&mut self, weights: &[f64], gradients: &[DVec3], clusters: &Partition) {
        if self.is_empty() {
            return;
        }
        if let Some(partition) = &self.partition {
            let starts = &self.starts;
            partition.for_each(RaggedSlice::new(starts, &mut self.entries), |part, mut entries| {
                for (row, entries) in partition.range(part).zip(entries.iter_mut()) {
                    let root = weights[row].max(0.0).sqrt();
                    for (gradient, entry) in gradients[starts[row] as usize..].iter().zip(entries) {
                        entry.set(to_f32(gradient * root));
                    }
                }
            });
        }
        let (all, at_starts, at_entries) = (&self.entries, &self.at_starts, &self.at_entries);
        clusters.for_each(RaggedSlice::new(at_starts, &mut self.at), |cluster, mut mine| {
            let entries = &at_entries[at_starts[clusters.range(cluster).start] as usize..];
            for (at, entry) in mine.iter_mut().flatten().zip(entries) {
                let [x, y, z, _] = all[*entry as usize].0;
                at.set([x, y, z]);
            }
        });
    }

    /// Computes g·p of each term, for [`RankOneTerms::push`]. Fourth lanes of `p` are finite.
    pub fn measure(&mut self, p: &[Quad]) {
        if self.is_empty() {
            return;
        }
        let Some(partition) = &self.partition else { return };
        let (starts, entries) = (&self.starts, &self.entries);
        partition.for_each(&mut self.change[..], |part, mine: &mut [f64]| {
            let range = partition.range(part);
            measure_terms(Path::chosen(), &starts[range.start..=range.end], entries, p, mine);
        });
    }

    /// The entries of a particle.
    #[inline(always)]
    fn at(&self, particle: usize) -> std::ops::Range<usize> {
        if self.is_empty() {
            return 0..0;
        }
        self.at_starts[particle] as usize..self.at_starts[particle + 1] as usize
    }

    /// Σ g·(g·p) at `particle`.
    #[inline(always)]
    pub fn push(&self, particle: usize) -> Quad {
        let each = self.at[self.at(particle)].iter();
        each.fold(Quad::default(), |sum, at| sum + at.along() * self.change[at.index()])
    }

    /// Adds `weight` times the diagonal block of `particle` to `block`, of the terms before `end`.
    #[inline(always)]
    pub fn add_block(&self, particle: usize, weight: f64, end: usize, block: &mut [f64; 6]) {
        for at in self.at[self.at(particle)].iter().take_while(|at| at.index() < end) {
            add_square(block, at.along().xyz(), weight);
        }
    }

    /// Σ of `values` (by term) times `gradients` (by entry): a force on `particle`.
    #[inline(always)]
    pub fn gather(&self, particle: usize, values: &[f64], gradients: &[DVec3]) -> DVec3 {
        let range = self.at(particle);
        let each = self.at[range.clone()].iter().zip(&self.at_entries[range]);
        each.fold(DVec3::zeros(), |sum, (at, entry)| sum + gradients[*entry as usize] * values[at.index()])
    }
}

/// The part of an ascending list that is in a range.
#[inline]
pub fn part_of(list: &[u32], range: std::ops::Range<usize>) -> &[u32] {
    let from = list.partition_point(|index| (*index as usize) < range.start);
    let count = list[from..].partition_point(|index| (*index as usize) < range.end);
    &list[from..from + count]
}

kernel! {
    /// g·p of the terms that begin at `starts` in `entries`.
    fn measure_terms(starts: &[u32], entries: &[Entry], p: &[Quad], out: &mut [f64]) = measure_terms_body;
}

#[inline(always)]
fn measure_terms_body(starts: &[u32], entries: &[Entry], p: &[Quad], out: &mut [f64]) {
    for (ends, out) in starts.windows(2).zip(out) {
        let mut sum = Quad::default();
        for entry in &entries[ends[0] as usize..ends[1] as usize] {
            sum += entry.along() * p[entry.index()];
        }
        *out = sum.total();
    }
}

/// Adds s·v vᵀ to a symmetric block, stored as xx, xy, xz, yy, yz, zz.
#[inline(always)]
pub fn add_square(block: &mut [f64; 6], v: DVec3, s: f64) {
    block[0] += s * v.x * v.x;
    block[1] += s * v.x * v.y;
    block[2] += s * v.x * v.z;
    block[3] += s * v.y * v.y;
    block[4] += s * v.y * v.z;
    block[5] += s * v.z * v.z;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terms on some of the particles, whose last is beyond all of them.
    #[test]
    fn a_product_is_the_sum_over_terms_by_particle() {
        let (starts, particles) = ([0, 3, 5], [4, 1, 2, 2, 0]);
        let clusters = Partition::new(vec![0, 2, 6]);
        let mut terms = RankOneTerms::default();
        assert!(terms.members(0..6).is_empty() && terms.is_empty());
        terms.set_topology(6, &starts, &particles, Partition::even(2, 1, 1));
        let gradients: Vec<DVec3> = (0..5).map(|k| DVec3::new(1.0, f64::from(k), -0.5)).collect();
        let weights = [4.0, 9.0];
        terms.set(&weights, &gradients, &clusters);
        let p: Vec<DVec3> = (0..6).map(|k| DVec3::new(f64::from(k), 1.0, 0.25 * f64::from(k * k))).collect();
        terms.measure(&p.iter().copied().map(Quad::new).collect::<Vec<_>>());
        let mut expected = [DVec3::zeros(); 6];
        let mut own = [[0.0; 6]; 6];
        for (row, weight) in weights.into_iter().enumerate() {
            let entries = starts[row] as usize..starts[row + 1] as usize;
            let change: f64 = entries.clone().map(|entry| gradients[entry].dot(&p[particles[entry] as usize])).sum();
            for entry in entries {
                expected[particles[entry] as usize] += gradients[entry] * (weight * change);
                add_square(&mut own[particles[entry] as usize], gradients[entry], weight);
            }
        }
        for particle in 0..6 {
            assert_eq!(terms.push(particle).xyz(), expected[particle], "all these numbers are exact");
            let mut block = [0.0; 6];
            terms.add_block(particle, 1.0, usize::MAX, &mut block);
            assert_eq!(block, own[particle]);
        }
        assert_eq!((terms.members(0..2), terms.members(2..6)), (&[0, 1][..], &[2, 4][..]));
        assert_eq!(terms.entries(1).collect::<Vec<_>>(), [(2, gradients[3] * 3.0), (0, gradients[4] * 3.0)]);
        assert_eq!(terms.gather(2, &[2.0, 3.0], &gradients), gradients[2] * 2.0 + gradients[3] * 3.0);
    }
}
