//! Sums of rank-one terms, H = Σ g gᵀ, where each g involves several particles.
//!
//! Region volumes, thin tetrahedra and contacts between bodies are such terms. A product reads each term twice: by
//! term, for g·p, and by particle, for Σ g (g·p). Nothing is scattered, so the order of every sum is fixed. Stored in
//! f32: rigid motions are resisted only to 1e-7.

use crate::partition::{Partition, RaggedSlice};
use crate::quad::Quad;
use crate::vector::{DVec3, Vec3, to_f32, to_f64};

/// Rank-one terms, stored by term and by particle.
#[derive(Clone, Debug, Default)]
pub struct RankOneTerms {
    /// Whether they are ignored.
    pub idle: bool,
    /// Start of each term's entries.
    starts: Vec<u32>,
    /// Particle of each entry.
    particles: Vec<u32>,
    /// √weight·gradient of each entry.
    along: Vec<Vec3>,
    /// Start of each particle's entries in `at`; empty without terms.
    at_starts: Vec<u32>,
    at: Vec<At>,
    partition: Option<Partition>,
    /// g·p of each term in the current product.
    change: Vec<f64>,
}

/// An entry as stored for its particle.
#[derive(Clone, Copy, Debug, Default)]
struct At {
    /// With a fourth lane of 0.
    along: [f32; 4],
    row: u32,
    entry: u32,
}

impl At {
    #[inline(always)]
    fn along(&self) -> DVec3 {
        Quad::widened(self.along).xyz()
    }
}

impl RankOneTerms {
    /// Sets the particles of each term, whose entries begin at `starts`, for a body of `count` particles.
    pub fn set_topology(&mut self, count: usize, starts: &[u32], particles: &[u32], partition: Partition) {
        self.starts.clear();
        self.particles.clear();
        self.at_starts.clear();
        if particles.is_empty() {
            self.at.clear();
            self.along.clear();
            self.change.clear();
            return;
        }
        self.starts.extend_from_slice(starts);
        self.particles.extend_from_slice(particles);
        self.at_starts.resize(count + 1, 0);
        particles.iter().for_each(|particle| self.at_starts[*particle as usize + 1] += 1);
        for particle in 0..count {
            self.at_starts[particle + 1] += self.at_starts[particle];
        }
        let mut next = self.at_starts.clone();
        self.at.clear();
        self.at.resize(particles.len(), At::default());
        for row in 0..starts.len() - 1 {
            for entry in starts[row]..starts[row + 1] {
                let slot = &mut next[particles[entry as usize] as usize];
                self.at[*slot as usize] = At { row: row as u32, entry, ..At::default() };
                *slot += 1;
            }
        }
        self.along.clear();
        self.along.resize(particles.len(), [0.0; 3]);
        self.change.clear();
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

    /// The particles of a term.
    pub fn particles(&self, row: usize) -> &[u32] {
        &self.particles[self.row(row)]
    }

    /// The particles and vectors of a term.
    pub fn entries(&self, row: usize) -> impl Iterator<Item = (usize, DVec3)> {
        self.row(row).map(|entry| (self.particles[entry] as usize, to_f64(self.along[entry])))
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
            partition.for_each(RaggedSlice::new(starts, &mut self.along), |part, mut along| {
                for (row, along) in partition.range(part).zip(along.iter_mut()) {
                    let root = weights[row].max(0.0).sqrt();
                    for (entry, along) in (starts[row] as usize..).zip(along) {
                        *along = to_f32(gradients[entry] * root);
                    }
                }
            });
        }
        let along = &self.along;
        clusters.for_each(RaggedSlice::new(&self.at_starts, &mut self.at), |_, mut mine| {
            mine.iter_mut().flatten().for_each(|at| at.along[..3].copy_from_slice(&along[at.entry as usize]));
        });
    }

    /// Computes g·p of each term, for [`RankOneTerms::push`].
    pub fn measure(&mut self, p: &[Quad]) {
        if self.is_empty() {
            return;
        }
        let Some(partition) = &self.partition else { return };
        let (starts, particles, along) = (&self.starts, &self.particles, &self.along);
        partition.for_each(&mut self.change[..], |part, mine: &mut [f64]| {
            for (row, change) in partition.range(part).zip(mine) {
                let entries = starts[row] as usize..starts[row + 1] as usize;
                let each = particles[entries.clone()].iter().zip(&along[entries]);
                *change = each.fold(0.0, |sum, (particle, g)| sum + to_f64(*g).dot(&p[*particle as usize].xyz()));
            }
        });
    }

    /// The entries of a particle.
    #[inline(always)]
    fn at(&self, particle: usize) -> &[At] {
        if self.is_empty() {
            return &[];
        }
        &self.at[self.at_starts[particle] as usize..self.at_starts[particle + 1] as usize]
    }

    /// Σ g·(g·p) at `particle`.
    #[inline(always)]
    pub fn push(&self, particle: usize) -> Quad {
        let mut sum = Quad::default();
        for at in self.at(particle) {
            sum += Quad::widened(at.along) * self.change[at.row as usize];
        }
        sum
    }

    /// Adds `weight` times the diagonal block of `particle` to `block`, of the terms before `end`.
    #[inline(always)]
    pub fn add_block(&self, particle: usize, weight: f64, end: usize, block: &mut [f64; 6]) {
        for at in self.at(particle).iter().take_while(|at| (at.row as usize) < end) {
            add_square(block, at.along(), weight);
        }
    }

    /// Σ of `values` (by term) times `gradients` (by entry): a force on `particle`.
    #[inline(always)]
    pub fn gather(&self, particle: usize, values: &[f64], gradients: &[DVec3]) -> DVec3 {
        self.at(particle)
            .iter()
            .fold(DVec3::zeros(), |sum, at| sum + gradients[at.entry as usize] * values[at.row as usize])
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
