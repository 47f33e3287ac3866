//! The coarse level of the preconditioner: exact solution for the six rigid motions of each cluster of particles.
//!
//! Conjugate gradients find these motions last, because information travels one spring an iteration, and springs
//! within a cluster do not resist them. Clusters are ordered so that neighbours have near indices, which keeps the
//! factor's envelope narrow; for a thousand separate small bodies it is block-diagonal.

use super::galerkin::envelope;
use super::regions::Regions;
use super::system::{System, solve_lower, solve_lower_transpose, times};
use numerics::adjacency::Adjacency;
use numerics::cluster_order::ClusterOrder;
use numerics::partition::Partition;
use numerics::quad::Quad;
use numerics::vector::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Rigid motions of a cluster: three translations, three rotations.
pub(super) const MODES: usize = 6;

/// Filter of the rigid motions for particles in contact.
///
/// The stiffness of a contact on many particles of a cluster would lock the whole cluster in the coarse system,
/// including particles that are free to move. One smoothing step with the contact stiffness, F = 1 − D⁻¹C, avoids
/// that: F is near 0 in the directions a contact resists and 1 elsewhere.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ContactFilters {
    /// Index in `filters` for each particle; empty if no particle is filtered.
    of: Vec<u32>,
    /// F, column by column.
    filters: Vec<[[f64; 3]; 3]>,
}

impl ContactFilters {
    /// The filters of a linear system; isolated particles (without springs) take no part in cluster motions.
    pub(super) fn new(system: &System, layout: &Layout) -> Self {
        /// Contact stiffness below this fraction of a particle's total stiffness is ignored.
        const NEGLIGIBLE: f64 = 0.1;
        let mut filters = Self::default();
        if system.blocks.is_empty() && system.transient.is_empty() && !system.isolated.contains(&true) {
            return filters;
        }
        // Terms that the coarse matrix leaves out anchor both their sides.
        let end = if envelope(layout, system).0 < system.transient.len() { usize::MAX } else { system.anchors };
        let filter = |particle: usize| {
            if system.isolated[particle] {
                return Some(DMat3::zeros());
            }
            let mut block = system.blocks.get(particle).copied().unwrap_or_default();
            system.transient.add_block(particle, 1.0, end, &mut block);
            if system.held[particle] || block.iter().all(|x| *x == 0.0) {
                return None;
            }
            let smoother = &system.smoother[particle];
            let resisted = [DVec3::x(), DVec3::y(), DVec3::z()]
                .map(|axis| solve_lower_transpose(smoother, solve_lower(smoother, times(&block, axis))));
            let is_free = resisted.iter().all(|column| column.amax() < NEGLIGIBLE);
            (!is_free).then(|| DMat3::identity() - DMat3::from_columns(&resisted))
        };
        for particle in 0..system.inertia.len() {
            if let Some(filter) = filter(particle) {
                filters.of.resize(system.inertia.len(), FREE);
                filters.of[particle] = filters.filters.len() as u32;
                filters.filters.push(filter.data.0);
            }
        }
        filters
    }

    /// Mean difference from `others`: 1 if, for example, all contacts have opened.
    pub(super) fn change(&self, others: &Self) -> f64 {
        let most = self.filters.len().max(others.filters.len());
        let filter = |filters: &Self, particle: usize| filters.at(particle).unwrap_or_else(DMat3::identity);
        let held = |particle: &usize| [self, others].iter().any(|filters| filters.at(*particle).is_some());
        let particles = (0..self.of.len().max(others.of.len())).filter(held);
        let sum: f64 = particles.map(|particle| (filter(self, particle) - filter(others, particle)).norm()).sum();
        if most > 0 { sum / most as f64 } else { 0.0 }
    }

    /// F of a filtered particle.
    #[inline(always)]
    pub(super) fn at(&self, particle: usize) -> Option<DMat3> {
        let filter = self.filters.get(*self.of.get(particle)? as usize)?;
        Some(DMat3::from_columns(&filter.map(DVec3::from)))
    }
}

/// A particle without filter.
const FREE: u32 = u32::MAX;

/// Coupling structure of the clusters.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    /// Cluster of each particle.
    pub(super) cluster: Vec<u32>,
    /// Piece of each cluster.
    pub(super) piece: Vec<u32>,
    /// For each cluster, the first one it is coupled to by springs or regions.
    pub(super) first: Vec<u32>,
}

impl Layout {
    pub(super) fn new(order: &ClusterOrder, adjacency: &Adjacency, regions: &Regions) -> Self {
        let mut layout = Self::default();
        for cluster in 0..order.clusters.len() {
            layout.cluster.extend(order.clusters.range(cluster).map(|_| cluster as u32));
        }
        for (index, clusters) in order.pieces.iter().enumerate() {
            layout.piece.extend(clusters.clone().map(|_| index as u32));
        }
        let mut first: Vec<u32> = (0..order.clusters.len() as u32).collect();
        for particle in 0..order.caller_of.len() {
            let [_, across] = adjacency.of(particle, &adjacency.incident);
            across.iter().for_each(|incident| layout.join(&mut first, [particle, incident.other as usize].into_iter()));
        }
        for region in 0..regions.len() {
            layout.join(&mut first, regions.of(region).iter().map(|particle| *particle as usize));
        }
        layout.first = first;
        layout
    }

    /// Extends the envelope `first` by the coupling between the clusters of `particles`.
    pub(super) fn join(&self, first: &mut [u32], particles: impl Iterator<Item = usize> + Clone) {
        let clusters = particles.map(|particle| self.cluster[particle]);
        let Some(least) = clusters.clone().min() else { return };
        clusters.for_each(|cluster| first[cluster as usize] = first[cluster as usize].min(least));
    }

    /// The piece of a particle.
    pub(super) fn piece_of(&self, particle: usize) -> usize {
        self.piece[self.cluster[particle] as usize] as usize
    }

    /// Number of rows of the coarse matrix.
    pub(super) fn rows(&self) -> usize {
        MODES * self.first.len()
    }
}

/// Offset of each particle from the centroid of its cluster, in units of the cluster's radius: the lever arm of
/// rotations.
pub(super) fn offset_from_centroid(clusters: &Partition, x: &[DVec3], offset_from_centroid: &mut Vec<[f32; 4]>) {
    offset_from_centroid.resize(x.len(), [0.0; 4]);
    clusters.for_each(&mut offset_from_centroid[..], |cluster, mine: &mut [[f32; 4]]| {
        let points = &x[clusters.range(cluster)];
        let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let radius = points.iter().map(|p| (p - middle).amax()).fold(0.0, f64::max);
        let scale = if radius > 0.0 { 1.0 / radius } else { 0.0 };
        for (offset, p) in mine.iter_mut().zip(points) {
            *offset = Quad::new((p - middle) * scale).narrowed();
        }
    });
}

/// Rigid motions of clusters, as particles follow them.
#[derive(Clone, Copy)]
pub(super) struct ClusterMotions<'a> {
    pub(super) offset_from_centroid: &'a [[f32; 4]],
    pub(super) filters: &'a ContactFilters,
}

impl ClusterMotions<'_> {
    /// Offset of a particle from the centroid of its cluster.
    #[inline(always)]
    pub(super) fn offset(&self, particle: usize) -> Quad {
        Quad::widened(self.offset_from_centroid[particle])
    }

    /// Displacement of a particle along `direction` by each rigid motion of its cluster, the translations and the rotations;
    /// the force and torque on the cluster by a force on it.
    #[inline(always)]
    pub(super) fn along(&self, particle: usize, direction: Quad) -> [Quad; 2] {
        let filter = self.filters.at(particle);
        let direction = filter.map_or(direction, |filter| Quad::new(filter.tr_mul(&direction.xyz())));
        [direction, self.offset(particle).cross(direction)]
    }

    /// Displacement of a particle by a rigid motion of its cluster.
    #[inline(always)]
    pub(super) fn moved(&self, [shift, turn]: [Quad; 2], particle: usize) -> Quad {
        let free = shift + turn.cross(self.offset(particle));
        self.filters.at(particle).map_or(free, |filter| Quad::new(filter * free.xyz()))
    }
}

/// The numbers of translations and rotations.
#[inline(always)]
pub(super) fn modes([shift, turn]: [Quad; 2]) -> [f64; MODES] {
    let [shift, turn] = [shift.xyz(), turn.xyz()];
    [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z]
}
