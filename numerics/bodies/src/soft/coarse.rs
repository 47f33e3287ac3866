//! The coarse half of the preconditioner: each cluster of particles may shift and turn as one, and these six motions a
//! cluster are solved for exactly.
//!
//! They are what conjugate gradients find last, as news of them travels one spring an iteration; springs inside a cluster
//! do not resist them. Bodies that do not hang together are factored apart, so a thousand small ones cost what they are.

use super::V3;
use super::body::Body;
use super::cholesky::{self, row};
use super::order::Order;
use super::parts::Parts;
use super::rows::Rows;
use super::system::{System, halfway, rest_of_the_way, times};
use nalgebra::Matrix3;
use numerics::simd::Path;
use serde::{Deserialize, Serialize};

type M3 = Matrix3<f64>;

/// Motions of a cluster: three shifts, three turns.
const MODES: usize = 6;

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
        if system.blocks.is_empty() && system.loose.is_empty() && system.alone.is_empty() {
            return anchors;
        }
        for place in 0..system.inertia.len() {
            if system.alone.get(place) == Some(&true) {
                anchors.hold(place, system.inertia.len(), [[0.0; 3]; 3]);
                continue;
            }
            let mut block = system.blocks.get(place).copied().unwrap_or_default();
            if !system.loose.is_empty() {
                system.loose.add_block(place, 1.0, &mut block);
            }
            if system.held[place] || block.iter().all(|x| *x == 0.0) {
                continue;
            }
            let smoother = &system.smoother[place];
            let taken = [V3::x(), V3::y(), V3::z()]
                .map(|axis| rest_of_the_way(smoother, halfway(smoother, times(&block, axis))));
            if taken.iter().all(|column| column.amax() < LITTLE) {
                continue;
            }
            let way = std::array::from_fn(|k| {
                let mut column = -taken[k];
                column[k] += 1.0;
                column.into()
            });
            anchors.hold(place, system.inertia.len(), way);
        }
        anchors
    }

    fn hold(&mut self, place: usize, count: usize, way: [[f64; 3]; 3]) {
        self.of.resize(count, FREE);
        self.of[place] = self.ways.len() as u32;
        self.ways.push(way);
    }

    /// How much others differ from these: 1 where all of them let go, say.
    pub(super) fn change(&self, others: &Self) -> f64 {
        let most = self.ways.len().max(others.ways.len());
        let way = |anchors: &Self, place: usize| anchors.at(place).unwrap_or_else(M3::identity);
        let held = |place: &usize| [self, others].iter().any(|anchors| anchors.at(*place).is_some());
        let places = (0..self.of.len().max(others.of.len())).filter(held);
        let sum: f64 = places.map(|place| (way(self, place) - way(others, place)).norm()).sum();
        if most > 0 { sum / most as f64 } else { 0.0 }
    }

    /// F of a particle that is held.
    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> Option<M3> {
        let way = self.ways.get(*self.of.get(place)? as usize)?;
        Some(M3::from_columns(&way.map(V3::from)))
    }
}

/// No entry.
const FREE: u32 = u32::MAX;

/// Which entries of the factor belong to which cluster.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    /// Of each piece: its first cluster, how many, and where its packed matrix begins.
    pieces: Vec<(usize, usize, usize)>,
    /// The piece of each cluster.
    piece: Vec<u32>,
    /// The cluster of each particle.
    pub(super) cluster: Vec<u32>,
    /// Rows of each cluster as parts of the packed matrices.
    bands: Option<Parts>,
    size: usize,
}

impl Layout {
    pub(super) fn new(order: &Order) -> Self {
        let mut layout = Self::default();
        let mut bands = vec![0];
        for (index, clusters) in order.pieces.iter().enumerate() {
            layout.pieces.push((clusters.start, clusters.len(), layout.size));
            bands.extend((1..=clusters.len()).map(|local| layout.size + row(MODES * local)));
            layout.piece.extend(clusters.clone().map(|_| index as u32));
            layout.size += row(MODES * clusters.len());
        }
        for cluster in 0..order.clusters.len() {
            layout.cluster.extend(order.clusters.range(cluster).map(|_| cluster as u32));
        }
        layout.bands = Some(Parts::new(bands));
        layout
    }

    /// Numbers a factor has.
    pub(super) fn size(&self) -> usize {
        self.size
    }
}

/// Where each particle is seen from its cluster's middle, in units of the cluster's radius; the turns' lever.
pub(super) fn arms(clusters: &Parts, x: &[V3], arms: &mut Vec<[f32; 3]>) {
    arms.resize(x.len(), [0.0; 3]);
    clusters.each(&mut arms[..], |cluster, mine: &mut [[f32; 3]]| {
        let points = &x[clusters.range(cluster)];
        let middle = points.iter().sum::<V3>() / points.len().max(1) as f64;
        let radius = points.iter().map(|p| (p - middle).amax()).fold(0.0, f64::max);
        let scale = if radius > 0.0 { 1.0 / radius } else { 0.0 };
        for (arm, p) in mine.iter_mut().zip(points) {
            let lever = (p - middle) * scale;
            *arm = [lever.x as f32, lever.y as f32, lever.z as f32];
        }
    });
}

#[inline(always)]
pub(super) fn lever(arm: [f32; 3]) -> V3 {
    V3::new(f64::from(arm[0]), f64::from(arm[1]), f64::from(arm[2]))
}

/// What a cluster's motion does to a particle.
#[inline(always)]
pub(super) fn moved(modes: &[f64], arm: V3) -> V3 {
    V3::new(modes[0], modes[1], modes[2]) + V3::new(modes[3], modes[4], modes[5]).cross(&arm)
}

/// The factor of Pᵀ·A·P, P the clusters' motions, and what of them particles in contact follow.
pub(super) fn factor(layout: &Layout, body: &Body, system: &System, arms: &[[f32; 3]], anchors: &Anchors) -> Vec<f64> {
    let mut matrix = vec![0.0; layout.size];
    if let Some(bands) = &layout.bands {
        bands.each(&mut matrix[..], |cluster, mine: &mut [f64]| {
            band(layout, body, system, arms, anchors, cluster, mine);
        });
    }
    for rows in [&system.regions, &system.loose] {
        if !rows.is_empty() {
            add_rows(layout, system, rows, arms, anchors, &mut matrix);
        }
    }
    for (_, count, first) in &layout.pieces {
        let n = MODES * count;
        cholesky::factor(&mut matrix[*first..first + row(n)], n);
    }
    matrix
}

/// Solves with the factor: forces on the clusters become their motions.
pub(super) fn solve(layout: &Layout, factor: &[f64], modes: &mut [f64]) {
    let path = Path::chosen();
    let mut left = modes;
    for (_, count, first) in &layout.pieces {
        let n = MODES * count;
        let (mine, rest) = left.split_at_mut(n);
        cholesky::solve(path, &factor[*first..first + row(n)], mine);
        left = rest;
    }
}

/// −[r]×: what a turn does at `r`.
#[inline(always)]
fn turn(r: V3) -> M3 {
    M3::new(0.0, r.z, -r.y, -r.z, 0.0, r.x, r.y, -r.x, 0.0)
}

/// The rows of one cluster: springs and what each particle resists alone.
fn band(
    layout: &Layout,
    body: &Body,
    system: &System,
    arms: &[[f32; 3]],
    anchors: &Anchors,
    cluster: usize,
    out: &mut [f64],
) {
    let (first, _, _) = layout.pieces[layout.piece[cluster] as usize];
    let local = cluster - first;
    let base = row(MODES * local);
    let mut add = |other: usize, i: usize, j: usize, value: f64| {
        let (i, j) = (MODES * local + i, MODES * other + j);
        if j <= i {
            out[row(i) + j - base] += value;
        }
    };
    for place in body.order.clusters.range(cluster) {
        if system.held[place] {
            continue;
        }
        let mine = lever(arms[place]);
        let anchor = anchors.at(place);
        let shift = anchor.unwrap_or_else(M3::identity);
        let sway = shift * turn(mine);
        let mut own = M3::identity() * system.inertia[place];
        if let Some([xx, xy, xz, yy, yz, zz]) = system.blocks.get(place) {
            own += M3::new(*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz);
        }
        for record in &system.records[body.starts[place] as usize..body.starts[place + 1] as usize] {
            let (other, alpha) = (record.other as usize, f64::from(record.alpha));
            let w = V3::new(f64::from(record.w[0]), f64::from(record.w[1]), f64::from(record.w[2]));
            let home = layout.cluster[other] as usize;
            let far_anchor = anchors.at(other);
            if home == cluster && !system.held[other] && anchor.is_none() && far_anchor.is_none() {
                if other > place {
                    // Springs inside resist a turn as far as they are stretched, and no shift.
                    let d = mine - lever(arms[other]);
                    let u = d.cross(&w);
                    let h = (M3::identity() * d.norm_squared() - d * d.transpose()) * alpha + u * u.transpose();
                    for i in 0..3 {
                        (0..=i).for_each(|j| add(local, 3 + i, 3 + j, h[(i, j)]));
                    }
                }
                continue;
            }
            let h = M3::identity() * alpha + w * w.transpose();
            own += h;
            // Within the cluster each pair is met twice, once a side, as its product and the transpose of it.
            if home <= cluster && !system.held[other] {
                let far_shift = far_anchor.unwrap_or_else(M3::identity);
                let far = [far_shift, far_shift * turn(lever(arms[other]))];
                add_product(&mut |i, j, value| add(home - first, i, j, -value), [shift, sway], &h, far);
            }
        }
        add_product(&mut |i, j, value| add(local, i, j, value), [shift, sway], &own, [shift, sway]);
    }
}

/// Pᵀ·h·Q of two particles' motions, shifts and turns, entry by entry.
fn add_product(add: &mut impl FnMut(usize, usize, f64), p: [M3; 2], h: &M3, q: [M3; 2]) {
    for (row, p) in p.iter().enumerate() {
        let left = p.transpose() * h;
        for (column, q) in q.iter().enumerate() {
            let both = left * q;
            for i in 0..3 {
                (0..3).for_each(|j| add(3 * row + i, 3 * column + j, both[(i, j)]));
            }
        }
    }
}

/// What rows that span clusters resist; between pieces that do not hang together it is left out.
fn add_rows(layout: &Layout, system: &System, rows: &Rows, arms: &[[f32; 3]], anchors: &Anchors, matrix: &mut [f64]) {
    let mut pushes: Vec<(usize, [f64; MODES])> = Vec::new();
    for index in 0..rows.len() {
        pushes.clear();
        for (place, g) in rows.entries(index).filter(|(place, _)| !system.held[*place as usize]) {
            let cluster = layout.cluster[place as usize] as usize;
            let at = pushes.iter().position(|known| known.0 == cluster).unwrap_or_else(|| {
                pushes.push((cluster, [0.0; MODES]));
                pushes.len() - 1
            });
            let g = anchors.at(place as usize).map_or(g, |way| way.tr_mul(&g));
            let torque = lever(arms[place as usize]).cross(&g);
            for axis in 0..3 {
                pushes[at].1[axis] += g[axis];
                pushes[at].1[3 + axis] += torque[axis];
            }
        }
        if pushes.len() < 2 && pushes.iter().all(|push| push.1.iter().all(|p| p.abs() == 0.0)) {
            continue;
        }
        for (cluster, push) in &pushes {
            let piece = layout.piece[*cluster];
            let (first, _, base) = layout.pieces[piece as usize];
            let others = pushes.iter().filter(|(other, _)| other <= cluster && layout.piece[*other] == piece);
            for (other, far) in others {
                for i in 0..MODES {
                    let at = MODES * (cluster - first) + i;
                    for j in 0..MODES {
                        let column = MODES * (other - first) + j;
                        if column <= at {
                            matrix[base + row(at) + column] += push[i] * far[j];
                        }
                    }
                }
            }
        }
    }
}
