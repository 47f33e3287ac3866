//! The coarse (Galerkin) matrix PᵀAP, where P maps rigid motions of clusters to particles.

use super::body::SoftBody;
use super::coarse::{ClusterMotions, Layout, MODES, modes};
use super::springs::Record;
use super::system::System;
use numerics::cholesky::EnvelopeMatrix;
use numerics::partition::Partition;
use numerics::quad::Quad;
use numerics::rank_one::{RankOneTerms, add_square};
use numerics::simd::{Path, kernel};
use numerics::vector::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Contacts between bodies are left out where they make factoring more than this many times as dear.
const DEARER: f64 = 8.0;
/// Cost of factoring that is never too much: the sum of the squared numbers of clusters in each row, worth a few
/// milliseconds.
const CHEAP: f64 = 2e4;

/// What the matrix is assembled from.
#[derive(Clone, Copy)]
pub(super) struct Galerkin<'a> {
    pub(super) body: &'a SoftBody,
    pub(super) system: &'a System,
    pub(super) motions: ClusterMotions<'a>,
}

impl Galerkin<'_> {
    /// Assembles the matrix and factors it.
    pub(super) fn factor(&self) -> EnvelopeMatrix {
        let (layout, transient) = (&self.body.layout, &self.system.transient);
        let (rows, first) = envelope(layout, self.system);
        let begin = |row: usize| MODES * first[row / MODES] as usize;
        let mut matrix = EnvelopeMatrix::zeros((0..layout.rows()).map(begin));
        let bands = Partition::new(matrix.bands(MODES));
        bands.for_each(matrix.values_mut(), |cluster, out: &mut [f64]| {
            write(&band(Path::chosen(), self, first[cluster] as usize, cluster), out);
        });
        self.add_rank_one_terms(&self.system.regions, usize::MAX, &mut matrix);
        self.add_rank_one_terms(transient, rows, &mut matrix);
        matrix.factor();
        matrix
    }

    /// The blocks of a cluster's row from cluster `first` to the diagonal: springs and diagonal terms.
    #[inline(always)]
    fn band_body(&self, first: usize, cluster: usize) -> Vec<Block> {
        let Self { body, system, motions } = self;
        let filters = motions.filters;
        let mut blocks = vec![Block::default(); cluster + 1 - first];
        let last = cluster - first;
        for particle in body.order.clusters.range(cluster) {
            let [inside, across] = body.adjacency.of(particle, &system.records);
            for record in inside {
                self.add_inside(particle, record, &mut blocks[last]);
            }
            if system.held[particle] {
                continue;
            }
            let mine = motions.offset(particle).xyz();
            let filter = filters.at(particle);
            // Stiffness and inertia of the particle itself.
            let mut own = system.blocks.get(particle).copied().unwrap_or_default();
            let mut alike = system.inertia[particle];
            for record in across {
                let (other, alpha, w) = (record.other as usize, record.alpha(), record.along());
                alike += alpha;
                add_square(&mut own, w, 1.0);
                let home = body.layout.cluster[other] as usize;
                if home < cluster && !system.held[other] {
                    let (block, far) = (&mut blocks[home - first], motions.offset(other).xyz());
                    if filter.is_none() && filters.at(other).is_none() {
                        block.add_alike(-alpha, mine, far);
                        block.add_along(-1.0, w, mine, far);
                    } else {
                        for (scale, direction) in directions(record) {
                            let [near, far] = [particle, other].map(|end| self.along(end, direction));
                            block.add(-scale, &near, &far);
                        }
                    }
                }
            }
            if own == [0.0; 6] && filter.is_none() {
                blocks[last].add_alike(alike, mine, mine);
            } else {
                let [xx, xy, xz, yy, yz, zz] = own;
                let h = DMat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) + DMat3::from_diagonal_element(alike);
                let motion = motion(filter, mine);
                blocks[last].add_product(motion, &h, motion);
            }
        }
        blocks
    }

    /// Displacement of a particle along `direction` by each rigid motion of its cluster.
    #[inline(always)]
    fn along(&self, particle: usize, direction: DVec3) -> [f64; MODES] {
        modes(self.motions.along(particle, Quad::new(direction)))
    }

    /// Adds a spring within a cluster, listed at `particle`.
    #[inline(always)]
    fn add_inside(&self, particle: usize, record: &Record, block: &mut Block) {
        let ends = [particle, record.other as usize];
        let filters = ends.map(|end| self.motions.filters.at(end));
        let held = ends.map(|end| self.system.held[end]);
        if held == [false; 2] && filters == [None; 2] {
            let [here, there] = ends.map(|end| self.motions.offset(end).xyz());
            block.add_turn(record.alpha(), record.along(), here - there);
            return;
        }
        for (scale, direction) in directions(record) {
            let [here, there] =
                ends.map(|end| if self.system.held[end] { [0.0; MODES] } else { self.along(end, direction) });
            let apart = std::array::from_fn(|mode| here[mode] - there[mode]);
            block.add(scale, &apart, &apart);
        }
    }

    /// Adds rank-one terms, those before `end`.
    fn add_rank_one_terms(&self, rows: &RankOneTerms, end: usize, matrix: &mut EnvelopeMatrix) {
        let Some(partition) = rows.partition() else { return };
        let of_part = |part, ()| -> Vec<BTreeMap<usize, [f64; MODES]>> {
            partition.range(part).filter(|row| *row < end).map(|row| self.couplings(rows, row)).collect()
        };
        for couplings in partition.map((), of_part).iter().flatten() {
            for (near, pushes) in couplings {
                for (far, others) in couplings.range(..=near) {
                    for (i, push) in pushes.iter().enumerate() {
                        let count = if far == near { i + 1 } else { MODES };
                        for (j, other) in others[..count].iter().enumerate() {
                            matrix.add(MODES * near + i, MODES * far + j, push * other);
                        }
                    }
                }
            }
        }
    }

    /// Change of a rank-one term by the rigid motions of each cluster. Empty if all its particles are in one cluster
    /// and unfiltered, since rigid motions change neither volumes nor gaps.
    fn couplings(&self, rows: &RankOneTerms, row: usize) -> BTreeMap<usize, [f64; MODES]> {
        let Self { body, system, motions } = self;
        let mut couplings = BTreeMap::new();
        let home = |particle: usize| body.layout.cluster[particle] as usize;
        let mut entries = rows.entries(row).peekable();
        let first = entries.peek().map(|entry| home(entry.0));
        let free = |particle: usize| !system.held[particle] && motions.filters.at(particle).is_none();
        if entries.all(|(particle, _)| Some(home(particle)) == first && free(particle)) {
            return couplings;
        }
        for (particle, g) in rows.entries(row).filter(|(particle, _)| !system.held[*particle]) {
            let sums = couplings.entry(home(particle)).or_insert([0.0; MODES]);
            sums.iter_mut().zip(self.along(particle, g)).for_each(|(sum, along)| *sum += along);
        }
        couplings
    }
}

kernel! {
    /// [`Galerkin::band_body`].
    fn band(matrix: &Galerkin<'_>, first: usize, cluster: usize) -> Vec<Block> = Galerkin::band_body;
}

/// The number of transient terms that the matrix has, and for each cluster the first one it is coupled to by them.
pub(super) fn envelope(layout: &Layout, system: &System) -> (usize, Vec<u32>) {
    let joined = |rows: usize| {
        let mut first = layout.first.clone();
        (0..rows).for_each(|row| layout.join(&mut first, system.transient.entries(row).map(|entry| entry.0)));
        let widths = first.iter().enumerate().map(|(cluster, first)| (cluster + 1 - *first as usize) as f64);
        (widths.map(|width| width * width).sum::<f64>(), (rows, first))
    };
    let (anchors, all) = (joined(system.anchors), joined(system.transient.len()));
    if all.0 <= f64::max(DEARER * anchors.0, CHEAP) { all.1 } else { anchors.1 }
}

/// The directions in which a spring has stiffness, each with that stiffness.
#[inline(always)]
fn directions(record: &Record) -> impl Iterator<Item = (f64, DVec3)> {
    let alpha = record.alpha();
    let alike = [DVec3::x(), DVec3::y(), DVec3::z()].map(|axis| (alpha, axis));
    std::iter::once((1.0, record.along())).chain(alike.into_iter().take(if alpha > 0.0 { 3 } else { 0 }))
}

/// Writes the block row of a cluster in envelope order, up to the diagonal.
fn write(blocks: &[Block], out: &mut [f64]) {
    let before = MODES * (blocks.len() - 1);
    let mut left = out.iter_mut();
    for row in 0..MODES {
        let entries = blocks.iter().flat_map(|block| block.0[row]).take(before + row + 1);
        entries.zip(&mut left).for_each(|(entry, out)| *out = entry);
    }
}

/// Displacement at `offset` for translations and rotations, filtered.
#[inline(always)]
fn motion(filter: Option<DMat3>, offset: DVec3) -> [DMat3; 2] {
    let shift = filter.unwrap_or_else(DMat3::identity);
    [shift, shift * offset.cross_matrix().transpose()]
}

/// Coupling of the rigid motions of two clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Block([[f64; MODES]; MODES]);

impl Block {
    /// A spring within a cluster, with `d` the offset between its ends: it resists rotation as far as it is
    /// stretched, and no translation.
    #[inline(always)]
    fn add_turn(&mut self, alpha: f64, w: DVec3, d: DVec3) {
        let (u, square) = (d.cross(&w), d.norm_squared());
        for i in 0..3 {
            for j in 0..3 {
                let turned = if i == j { square } else { 0.0 } - d[i] * d[j];
                self.0[3 + i][3 + j] += alpha * turned + u[i] * u[j];
            }
        }
    }

    /// Pᵀ·αI·Q for unfiltered particles at `p` and `q`. Written out, as `add_along` is: the general product rounds so that
    /// springs of 1e12 N/m beside others of 1e-6 N/m end at the bound of Newton iterations.
    #[inline(always)]
    fn add_alike(&mut self, alpha: f64, p: DVec3, q: DVec3) {
        let (p, dot) = (p * alpha, p.dot(&q) * alpha);
        let q_alpha = q * alpha;
        let shift_turn = [[0.0, q_alpha.z, -q_alpha.y], [-q_alpha.z, 0.0, q_alpha.x], [q_alpha.y, -q_alpha.x, 0.0]];
        let turn_shift = [[0.0, -p.z, p.y], [p.z, 0.0, -p.x], [-p.y, p.x, 0.0]];
        for i in 0..3 {
            self.0[i][i] += alpha;
            self.0[3 + i][3 + i] += dot;
            for j in 0..3 {
                self.0[i][3 + j] += shift_turn[i][j];
                self.0[3 + i][j] += turn_shift[i][j];
                self.0[3 + i][3 + j] -= q[i] * p[j];
            }
        }
    }

    /// Pᵀ·s·wwᵀ·Q for unfiltered particles at `p` and `q`.
    #[inline(always)]
    fn add_along(&mut self, s: f64, w: DVec3, p: DVec3, q: DVec3) {
        let (p, q) = (p.cross(&w), q.cross(&w));
        self.add(s, &[w.x, w.y, w.z, p.x, p.y, p.z], &[w.x, w.y, w.z, q.x, q.y, q.z]);
    }

    /// s·p·qᵀ.
    #[inline(always)]
    fn add(&mut self, s: f64, p: &[f64; MODES], q: &[f64; MODES]) {
        for (row, p) in self.0.iter_mut().zip(p) {
            let left = s * p;
            row.iter_mut().zip(q).for_each(|(sum, q)| *sum += left * q);
        }
    }

    /// Pᵀ·h·Q for translations and rotations of two particles.
    fn add_product(&mut self, p: [DMat3; 2], h: &DMat3, q: [DMat3; 2]) {
        for (row, p) in p.iter().enumerate() {
            let left = p.transpose() * h;
            for (column, q) in q.iter().enumerate() {
                let both = left * q;
                for i in 0..3 {
                    (0..3).for_each(|j| self.0[3 * row + i][3 * column + j] += both[(i, j)]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortcuts_for_unfiltered_particles_equal_the_full_product() {
        let [p, q, w] = [[0.3, -0.8, 0.5], [-0.9, 0.1, 0.7], [1.2, 0.4, -2.0]].map(DVec3::from);
        let (mut short, mut long) = (Block::default(), Block::default());
        short.add_alike(1.7, p, q);
        short.add_along(-0.6, w, p, q);
        let h = DMat3::from_diagonal_element(1.7) - w * w.transpose() * 0.6;
        long.add_product(motion(None, p), &h, motion(None, q));
        // All four blocks of a spring within one cluster.
        short.add_turn(0.9, w, p - q);
        let h = DMat3::from_diagonal_element(0.9) + w * w.transpose();
        for (a, b, sign) in [(p, p, 1.0), (q, q, 1.0), (p, q, -1.0), (q, p, -1.0)] {
            long.add_product(motion(None, a), &(h * sign), motion(None, b));
        }
        for (short, long) in short.0.as_flattened().iter().zip(long.0.as_flattened()) {
            assert!((short - long).abs() < 1e-14, "{short} for {long}");
        }
    }
}
