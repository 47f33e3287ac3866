//! The coarse half of the preconditioner: each cluster of particles may shift and turn as one, and these six motions a
//! cluster are solved for exactly.
//!
//! They are what conjugate gradients find last, as news of them travels one spring an iteration; springs inside a cluster
//! do not resist them. Clusters stand in an order in which neighbours are near each other, so that the factor is a narrow
//! band; a thousand small bodies cost what they are.

use super::body::SoftBody;
use super::partition::Partition;
use super::system::{System, solve_lower, solve_lower_transpose, times};
use numerics::vector::{DMat3, DVec3, Vec3, to_f32};
use serde::{Deserialize, Serialize};

/// Motions of a cluster: three shifts, three turns.
pub(super) const MODES: usize = 6;

/// How far particles that contacts hold follow their clusters' motions.
///
/// A surface that many particles press on would hold their whole cluster, and what lies above them could not be told to
/// move. One step of the smoother on what contacts resist, F = 1 − D⁻¹C, leaves it free: F is near 0 along a contact and 1
/// where there is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Anchors {
    /// Of each particle the entry in `ways`; empty where nothing is held.
    of: Vec<u32>,
    /// F, column by column.
    ways: Vec<[[f64; 3]; 3]>,
}

impl Anchors {
    /// Of a system; particles that hang on nothing follow nobody.
    pub(super) fn new(system: &System) -> Self {
        /// Share of a particle's resistance below which contacts do not count.
        const LITTLE: f64 = 0.1;
        let mut anchors = Self::default();
        if system.blocks.is_empty() && system.transient.is_empty() && system.alone.is_empty() {
            return anchors;
        }
        for particle in 0..system.inertia.len() {
            if system.alone.get(particle) == Some(&true) {
                anchors.hold(particle, system.inertia.len(), [[0.0; 3]; 3]);
                continue;
            }
            let mut block = system.blocks.get(particle).copied().unwrap_or_default();
            if !system.transient.is_empty() {
                system.transient.add_block(particle, 1.0, &mut block);
            }
            if system.held[particle] || block.iter().all(|x| *x == 0.0) {
                continue;
            }
            let smoother = &system.smoother[particle];
            let gap_fraction = [DVec3::x(), DVec3::y(), DVec3::z()]
                .map(|axis| solve_lower_transpose(smoother, solve_lower(smoother, times(&block, axis))));
            if gap_fraction.iter().all(|column| column.amax() < LITTLE) {
                continue;
            }
            let way = std::array::from_fn(|k| {
                let mut column = -gap_fraction[k];
                column[k] += 1.0;
                column.into()
            });
            anchors.hold(particle, system.inertia.len(), way);
        }
        anchors
    }

    fn hold(&mut self, particle: usize, count: usize, way: [[f64; 3]; 3]) {
        self.of.resize(count, FREE);
        self.of[particle] = self.ways.len() as u32;
        self.ways.push(way);
    }

    /// How much others differ from these: 1 where all of them let go, say.
    pub(super) fn change(&self, others: &Self) -> f64 {
        let most = self.ways.len().max(others.ways.len());
        let way = |anchors: &Self, particle: usize| anchors.at(particle).unwrap_or_else(DMat3::identity);
        let held = |particle: &usize| [self, others].iter().any(|anchors| anchors.at(*particle).is_some());
        let particles = (0..self.of.len().max(others.of.len())).filter(held);
        let sum: f64 = particles.map(|particle| (way(self, particle) - way(others, particle)).norm()).sum();
        if most > 0 { sum / most as f64 } else { 0.0 }
    }

    /// F of a particle that is held.
    #[inline(always)]
    pub(super) fn at(&self, particle: usize) -> Option<DMat3> {
        let way = self.ways.get(*self.of.get(particle)? as usize)?;
        Some(DMat3::from_columns(&way.map(DVec3::from)))
    }
}

/// No entry.
const FREE: u32 = u32::MAX;

/// Which clusters have to do with which.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    /// The cluster of each particle.
    pub(super) cluster: Vec<u32>,
    /// The piece of each cluster.
    pub(super) piece: Vec<u32>,
    /// The first cluster that each is joined with, by springs and regions.
    pub(super) first: Vec<u32>,
}

impl Layout {
    pub(super) fn new(body: &SoftBody) -> Self {
        let order = &body.order;
        let mut layout = Self { first: (0..order.clusters.len() as u32).collect(), ..Self::default() };
        for cluster in 0..order.clusters.len() {
            layout.cluster.extend(order.clusters.range(cluster).map(|_| cluster as u32));
        }
        for (index, clusters) in order.pieces.iter().enumerate() {
            layout.piece.extend(clusters.clone().map(|_| index as u32));
        }
        let mut first = std::mem::take(&mut layout.first);
        for particle in 0..body.len() {
            let [_, across] = body.adjacency.of(particle, &body.adjacency.incident);
            across.iter().for_each(|incident| layout.join(&mut first, &[particle as u32, incident.other]));
        }
        let regions = &body.regions;
        for ends in regions.starts.windows(2) {
            layout.join(&mut first, &regions.particles[ends[0] as usize..ends[1] as usize]);
        }
        layout.first = first;
        layout
    }

    /// Has `first` reach the first cluster of the same piece that one of `places` is in, for the clusters of all of them.
    pub(super) fn join(&self, first: &mut [u32], particles: &[u32]) {
        let clusters = || particles.iter().map(|particle| self.cluster[*particle as usize]);
        let Some(least) = clusters().min() else { return };
        for cluster in clusters() {
            if self.piece[cluster as usize] == self.piece[least as usize] {
                first[cluster as usize] = first[cluster as usize].min(least);
            }
        }
    }

    /// How many rows a factor has.
    pub(super) fn rows(&self) -> usize {
        MODES * self.first.len()
    }
}

/// Where each particle is seen from its cluster's middle, in units of the cluster's radius; the turns' lever.
pub(super) fn offset_from_centroid(clusters: &Partition, x: &[DVec3], offset_from_centroid: &mut Vec<Vec3>) {
    offset_from_centroid.resize(x.len(), [0.0; 3]);
    clusters.for_each(&mut offset_from_centroid[..], |cluster, mine: &mut [Vec3]| {
        let points = &x[clusters.range(cluster)];
        let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let radius = points.iter().map(|p| (p - middle).amax()).fold(0.0, f64::max);
        let scale = if radius > 0.0 { 1.0 / radius } else { 0.0 };
        for (offset, p) in mine.iter_mut().zip(points) {
            *offset = to_f32((p - middle) * scale);
        }
    });
}

/// What a cluster's motion does to a particle.
#[inline(always)]
pub(super) fn moved(modes: &[f64], offset: DVec3) -> DVec3 {
    DVec3::new(modes[0], modes[1], modes[2]) + DVec3::new(modes[3], modes[4], modes[5]).cross(&offset)
}
