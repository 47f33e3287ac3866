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
use super::system::System;
use nalgebra::Matrix3;
use numerics::simd::Path;

type M3 = Matrix3<f64>;

/// Motions of a cluster: three shifts, three turns.
const MODES: usize = 6;

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

/// The factor of Pᵀ·A·P, P the clusters' motions.
pub(super) fn factor(layout: &Layout, body: &Body, system: &System, arms: &[[f32; 3]]) -> Vec<f64> {
    let mut matrix = vec![0.0; layout.size];
    if let Some(bands) = &layout.bands {
        bands.each(&mut matrix[..], |cluster, mine: &mut [f64]| {
            band(layout, body, system, arms, cluster, mine);
        });
    }
    for rows in [&system.regions, &system.loose] {
        if !rows.is_empty() {
            add_rows(layout, system, rows, arms, &mut matrix);
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
fn band(layout: &Layout, body: &Body, system: &System, arms: &[[f32; 3]], cluster: usize, out: &mut [f64]) {
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
        let mut own = M3::identity() * system.inertia[place];
        if let Some([xx, xy, xz, yy, yz, zz]) = system.blocks.get(place) {
            own += M3::new(*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz);
        }
        for record in &system.records[body.starts[place] as usize..body.starts[place + 1] as usize] {
            let (other, alpha) = (record.other as usize, f64::from(record.alpha));
            let w = V3::new(f64::from(record.w[0]), f64::from(record.w[1]), f64::from(record.w[2]));
            let home = layout.cluster[other] as usize;
            if home == cluster && !system.held[other] {
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
            if home < cluster && !system.held[other] {
                let (mine, far) = (turn(mine), turn(lever(arms[other])));
                let (h_far, left) = (h * far, mine.transpose() * h);
                let both = left * far;
                for i in 0..3 {
                    for j in 0..3 {
                        let home = home - first;
                        add(home, i, j, -h[(i, j)]);
                        add(home, i, 3 + j, -h_far[(i, j)]);
                        add(home, 3 + i, j, -left[(i, j)]);
                        add(home, 3 + i, 3 + j, -both[(i, j)]);
                    }
                }
            }
        }
        let mine = turn(mine);
        let left = mine.transpose() * own;
        let both = left * mine;
        for i in 0..3 {
            for j in 0..3 {
                add(local, i, j, own[(i, j)]);
                add(local, 3 + i, j, left[(i, j)]);
                add(local, 3 + i, 3 + j, both[(i, j)]);
            }
        }
    }
}

/// What rows that span clusters resist; between pieces that do not hang together it is left out.
fn add_rows(layout: &Layout, system: &System, rows: &Rows, arms: &[[f32; 3]], matrix: &mut [f64]) {
    let mut pushes: Vec<(usize, [f64; MODES])> = Vec::new();
    for index in 0..rows.len() {
        pushes.clear();
        for (place, g) in rows.entries(index).filter(|(place, _)| !system.held[*place as usize]) {
            let cluster = layout.cluster[place as usize] as usize;
            let at = pushes.iter().position(|known| known.0 == cluster).unwrap_or_else(|| {
                pushes.push((cluster, [0.0; MODES]));
                pushes.len() - 1
            });
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
