//! The coarse (Galerkin) matrix PᵀAP, where P maps rigid motions of clusters to particles.

use super::body::SoftBody;
use super::coarse::{ContactFilters, Layout, MODES};
use super::springs::Record;
use super::system::System;
use numerics::cholesky::EnvelopeMatrix;
use numerics::partition::Partition;
use numerics::rank_one::RankOneTerms;
use numerics::vector::{DMat3, DVec3, Vec3, to_f64};

/// Contacts between bodies are left out where they make factoring more than this many times as dear.
const DEARER: f64 = 8.0;
/// Cost of factoring that is never too much: the sum of the squared numbers of clusters in each row, worth a few
/// milliseconds.
const CHEAP: f64 = 2e4;

/// What the matrix is assembled from.
#[derive(Clone, Copy)]
pub(super) struct Galerkin<'a> {
    pub(super) layout: &'a Layout,
    pub(super) body: &'a SoftBody,
    pub(super) system: &'a System,
    pub(super) offset_from_centroid: &'a [Vec3],
    /// Filters of the rigid motions at particles in contact.
    pub(super) filters: &'a ContactFilters,
}

impl Galerkin<'_> {
    /// Assembles the matrix and factors it.
    pub(super) fn factor(&self) -> EnvelopeMatrix {
        let (layout, transient) = (self.layout, &self.system.transient);
        let (rows, first) = envelope(layout, self.system);
        let begin = |row: usize| MODES * first[row / MODES] as usize;
        let mut matrix = EnvelopeMatrix::zeros((0..layout.rows()).map(begin));
        let bands = Partition::new(matrix.bands(MODES));
        bands.for_each(matrix.values_mut(), |cluster, out: &mut [f64]| {
            write(&self.band(first[cluster] as usize, cluster), out);
        });
        self.add_rank_one_terms(&self.system.regions, usize::MAX, &mut matrix);
        self.add_rank_one_terms(transient, rows, &mut matrix);
        matrix.factor();
        matrix
    }

    /// The blocks of a cluster's row from cluster `first` to the diagonal: springs and diagonal terms.
    fn band(&self, first: usize, cluster: usize) -> Vec<Block> {
        let Self { layout, body, system, .. } = self;
        let mut blocks = vec![Block::default(); cluster + 1 - first];
        let last = cluster - first;
        for particle in body.order.clusters.range(cluster) {
            let [inside, across] = body.adjacency.of(particle, &system.records);
            inside.iter().for_each(|record| self.add_inside(particle, record, &mut blocks[last]));
            if system.held[particle] {
                continue;
            }
            // Stiffness and inertia of the particle itself.
            let mut own = DMat3::from_diagonal_element(system.inertia[particle]);
            for record in across {
                let (other, h) = (record.other as usize, record.stiffness());
                own += h;
                let home = layout.cluster[other] as usize;
                if home < cluster && !system.held[other] {
                    self.couple(&-h, [particle, other], &mut blocks[home - first]);
                }
            }
            self.couple(&own, [particle; 2], &mut blocks[last]);
        }
        blocks
    }

    /// Adds a spring within a cluster, listed at `particle`.
    #[inline(always)]
    fn add_inside(&self, particle: usize, record: &Record, block: &mut Block) {
        let ends = [particle, record.other as usize];
        let free = |end: &usize| !self.system.held[*end];
        if ends.iter().all(|end| free(end) && self.filters.at(*end).is_none()) {
            let [here, there] = ends.map(|end| to_f64(self.offset_from_centroid[end]));
            block.add_turn(f64::from(record.alpha), record.along(), here - there);
            return;
        }
        let h = record.stiffness();
        for (first, second) in ends.into_iter().flat_map(|first| ends.map(|second| (first, second))) {
            if free(&first) && free(&second) {
                self.couple(&if first == second { h } else { -h }, [first, second], block);
            }
        }
    }

    /// Adds the stiffness `h` between two particles, filtered.
    #[inline(always)]
    fn couple(&self, h: &DMat3, ends: [usize; 2], block: &mut Block) {
        let [left, right] = ends.map(|end| self.filters.at(end));
        let h = left.map_or(*h, |filter| filter.transpose() * h);
        let [p, q] = ends.map(|end| to_f64(self.offset_from_centroid[end]));
        block.add_stiffness(&right.map_or(h, |filter| h * filter), p, q);
    }

    /// Displacement of a particle along `direction` by each rigid motion of its cluster.
    #[inline(always)]
    fn along(&self, particle: usize, direction: DVec3) -> [f64; MODES] {
        let direction = self.filters.at(particle).map_or(direction, |follows| follows.tr_mul(&direction));
        let turned = to_f64(self.offset_from_centroid[particle]).cross(&direction);
        [direction.x, direction.y, direction.z, turned.x, turned.y, turned.z]
    }

    /// Adds rank-one terms, those before `end`.
    fn add_rank_one_terms(&self, rows: &RankOneTerms, end: usize, matrix: &mut EnvelopeMatrix) {
        let Some(partition) = rows.partition() else { return };
        let of_part = |part, ()| -> Vec<Vec<Coupling>> {
            partition.range(part).filter(|row| *row < end).map(|row| self.couplings(rows, row)).collect()
        };
        let each = partition.map((), of_part);
        for couplings in each.iter().flatten() {
            for near in couplings {
                for far in couplings.iter().filter(|far| far.cluster <= near.cluster) {
                    for (i, push) in near.along.iter().enumerate() {
                        let count = if far.cluster == near.cluster { i + 1 } else { MODES };
                        for (j, other) in far.along[..count].iter().enumerate() {
                            matrix.add(MODES * near.cluster + i, MODES * far.cluster + j, push * other);
                        }
                    }
                }
            }
        }
    }

    /// Change of a rank-one term by the rigid motions of each cluster. Empty for several particles that are in one cluster
    /// and unfiltered, since rigid motions change neither volumes nor gaps.
    fn couplings(&self, rows: &RankOneTerms, row: usize) -> Vec<Coupling> {
        let Self { layout, system, filters, .. } = self;
        let mut couplings: Vec<Coupling> = Vec::new();
        let home = |particle: usize| layout.cluster[particle] as usize;
        let particles = rows.particles(row);
        let free = |particle: usize| !system.held[particle] && filters.at(particle).is_none();
        let inside =
            |particle: &u32| home(*particle as usize) == home(particles[0] as usize) && free(*particle as usize);
        if particles.len() > 1 && particles.iter().all(inside) {
            return couplings;
        }
        for (particle, g) in rows.entries(row).filter(|(particle, _)| !system.held[*particle]) {
            let cluster = home(particle);
            let at = couplings.iter().position(|known| known.cluster == cluster).unwrap_or_else(|| {
                couplings.push(Coupling { cluster, along: [0.0; MODES] });
                couplings.len() - 1
            });
            couplings[at].along.iter_mut().zip(self.along(particle, g)).for_each(|(sum, along)| *sum += along);
        }
        couplings
    }
}

/// The number of transient terms that the matrix has, and for each cluster the first one it is coupled to by them.
pub(super) fn envelope(layout: &Layout, system: &System) -> (usize, Vec<u32>) {
    let joined = |rows: usize| {
        let mut first = layout.first.clone();
        (0..rows).for_each(|row| layout.join(&mut first, system.transient.particles(row)));
        let widths = first.iter().enumerate().map(|(cluster, first)| (cluster + 1 - *first as usize) as f64);
        (widths.map(|width| width * width).sum::<f64>(), (rows, first))
    };
    let count = if system.transient.is_empty() { 0 } else { system.transient.len() };
    let (anchors, all) = (joined(system.anchors.min(count)), joined(count));
    if all.0 <= f64::max(DEARER * anchors.0, CHEAP) { all.1 } else { anchors.1 }
}

/// Change of a rank-one term by the rigid motions of one cluster.
struct Coupling {
    cluster: usize,
    along: [f64; MODES],
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

/// The cross product matrix −r×, which maps a rotation vector to the displacement at `r`.
#[inline(always)]
fn turn(r: DVec3) -> DMat3 {
    DMat3::new(0.0, r.z, -r.y, -r.z, 0.0, r.x, r.y, -r.x, 0.0)
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

    /// Pᵀ·h·Q, with P and Q the translations and rotations of particles at `p` and `q`.
    #[inline(always)]
    fn add_stiffness(&mut self, h: &DMat3, p: DVec3, q: DVec3) {
        let (back, turned) = (turn(p).transpose(), h * turn(q));
        for (row, column, part) in [(0, 0, *h), (0, 3, turned), (3, 0, back * h), (3, 3, back * turned)] {
            for i in 0..3 {
                (0..3).for_each(|j| self.0[row + i][column + j] += part[(i, j)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_within_a_cluster_resists_rotation_as_its_four_blocks_do() {
        let [p, q, w] = [[0.3, -0.8, 0.5], [-0.9, 0.1, 0.7], [1.2, 0.4, -2.0]].map(DVec3::from);
        let (mut short, mut long) = (Block::default(), Block::default());
        short.add_turn(0.9, w, p - q);
        let h = DMat3::from_diagonal_element(0.9) + w * w.transpose();
        for (a, b, sign) in [(p, p, 1.0), (q, q, 1.0), (p, q, -1.0), (q, p, -1.0)] {
            long.add_stiffness(&(h * sign), a, b);
        }
        for (short, long) in short.0.as_flattened().iter().zip(long.0.as_flattened()) {
            assert!((short - long).abs() < 1e-14, "{short} for {long}");
        }
    }
}
