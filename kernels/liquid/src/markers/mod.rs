//! Markers on the surface of a liquid: points with unit normals that the flow carries, from which φ next to the surface
//! is made anew each step. They keep volume and shape where a level set alone wears away.
//!
//! Promise: a marker keeps its `id` and its attributes for as long as it lives; markers that fill holes get new ids and
//! attributes from those around them on the same side of the liquid. The bits are the same on any number of threads.
//! The unit of length is the cell, as in [`crate::level_set`].
//!
//! Figures of `examples/surface_study.rs`: V and L1 are the changes of the volume and of what is inside, ÷ the volume at
//! the start. LeVeque's flow (1996) draws a ball of radius 0.15 into a sheet at T/2 and back at the end:
//!
//! | | V | L1 | pieces | V at T/2 | pieces at T/2 |
//! |---|---|---|---|---|---|
//! | slotted disk (Zalesak 1979), 100², 1 turn | −0.06 % | 1.08 % | 1 | | |
//! | the same, 10 turns | −0.11 % | 1.11 % | 1 | | |
//! | slotted ball, 64³, 2 turns | −0.11 % | 0.64 % | 2 | | |
//! | LeVeque, 64³ | −0.00 % | 0.24 % | 2 | −9.0 % | 92 |
//! | LeVeque, 100³ | −0.02 % | 0.06 % | 2 | −3.4 % | 3 |
//! | LeVeque, 128³ | −0.01 % | 0.02 % | 2 | −1.2 % | 2 |
//!
//! A slotted shape has its L1 within a cell of its edges, which the first steps round; from then on it is nearly constant.
//! At 100³ and 128³ the other pieces of LeVeque's flow are single cells of less than a tenth of a cell's volume: the sheet
//! holds.
//!
//! Limit: a sheet thinner than about a cell tears, as at T/2 of 64³. Where the flow turns back that is undone; elsewhere its
//! volume is lost.

mod attributes;
pub(crate) mod bins;
mod correct;
mod seed;
#[cfg(test)]
mod tests;

use numerics::parallel;
use numerics::random::Key;
use numerics::vector::{Vec3, add, cross, dot, length, perpendicular, scale, sub, unit};
use serde::{Deserialize, Serialize};

use crate::level_set::{Flow, LevelSet, PhiChange, PhiSampler, PhiView, displacements};
use crate::rows::{Cell, Periods};
use bins::Bins;
pub(crate) use correct::FARTHEST;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Where it is, in cells.
    pub point: Vec3,
    /// Unit, out of the liquid.
    pub normal: Vec3,
}

/// The markers of a liquid. Marker n has `ids[n]`, and in each attribute the value n.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Markers {
    /// Points and normals.
    pub markers: Vec<Marker>,
    /// Who is who: no id is given twice.
    pub ids: Vec<u64>,
    /// Numbers that ride on the markers, one list each.
    pub attributes: Vec<Vec<f32>>,
    /// The piece of the liquid that each was on when [`crate::volumes`] last looked; [`NO_PIECE`] for newer ones.
    pieces: Vec<u32>,
    next_id: u64,
    steps: u64,
    seed: u64,
}

/// No piece of the liquid.
pub(crate) const NO_PIECE: u32 = u32::MAX;

/// Markers that a cell on the surface gets.
const PER_CELL: usize = 3;
/// Steps between two looks for markers that are lost, too many or missing.
const UPKEEP: u64 = 5;
/// |φ| beyond which a marker is no longer on the surface.
const LOST: f32 = 1.5;
/// Change of φ at a marker from which on it is off the surface.
const CHANGED: f32 = 0.05;
/// Distance from a marker at which that counts, too.
const BESIDE: f32 = 0.5;
/// φ of liquid so deep that only what cuts it away decides what it is changed to: minus this.
const DEEP: f32 = 1e3;
/// Distance from the face of a cut at which a marker is on it.
const CLOSE: f32 = 0.3;
/// Markers that one thread moves at a time.
const CHUNK: usize = 512;
/// Beyond this much [`one_sided`], a point lies beyond the rim of the markers around it.
const ONE_SIDED: f32 = 0.6;
/// Distance at which the ends of a marker's tangents are carried.
const TANGENT: f32 = 0.25;

impl Markers {
    /// Markers on the surface of a level set, with as many attributes as `attributes`, all 0.
    pub fn new(set: &LevelSet, attributes: usize, seed: u64) -> Self {
        let attributes = vec![Vec::new(); attributes];
        let (markers, ids, pieces) = (Vec::new(), Vec::new(), Vec::new());
        let mut markers = Self { markers, ids, attributes, pieces, next_id: 0, steps: 0, seed };
        markers.fill_holes(set);
        markers
    }

    /// The piece that each was on.
    pub(crate) fn pieces(&self) -> &[u32] {
        &self.pieces
    }

    /// Says which piece each is on.
    pub(crate) fn set_pieces(&mut self, pieces: Vec<u32>) {
        assert_eq!(pieces.len(), self.markers.len(), "one piece for each marker");
        self.pieces = pieces;
    }

    /// Drops markers of which `keep` is false.
    pub(crate) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let order: Vec<u32> = (0..self.markers.len()).filter(|n| keep(*n)).map(|n| n as u32).collect();
        self.reorder(&order);
    }

    /// Appends what repeats the markers between two corners.
    pub(crate) fn repeat(&mut self, periods: Periods, [low, high]: [Cell; 2]) {
        for n in 0..self.markers.len() {
            let Marker { point, normal } = self.markers[n];
            periods.each_repeat(point, [low, high].map(|corner| corner.map(|x| x as f32)), |point| {
                self.markers.push(Marker { point, normal });
                self.ids.push(self.ids[n]);
                self.pieces.push(self.pieces[n]);
                self.attributes.iter_mut().for_each(|values| values.push(values[n]));
            });
        }
    }

    /// Drops what repeats other markers.
    pub(crate) fn retain_homes(&mut self, periods: Periods) {
        let mut inside: Vec<u32> = (0..self.markers.len() as u32)
            .filter(|n| periods.home_point(self.markers[*n as usize].point) == self.markers[*n as usize].point)
            .collect();
        // Rounding may leave one on both sides.
        inside.sort_by_key(|n| self.ids[*n as usize]);
        inside.dedup_by_key(|n| self.ids[*n as usize]);
        inside.sort_unstable();
        self.reorder(&inside);
    }

    /// Moves marker n along its normal by `by[n]` cells.
    pub(crate) fn shift(&mut self, by: &[f32]) {
        for (marker, by) in self.markers.iter_mut().zip(by) {
            marker.point = add(marker.point, scale(marker.normal, *by));
        }
    }

    /// One step of the surface: moves the level set and the markers by `flow`, which moves nothing farther than `reach`
    /// cells, and makes φ from both.
    pub fn step(&mut self, set: &mut LevelSet, flow: &impl Flow, reach: f32) {
        set.advect(flow, reach);
        self.advect(flow);
        correct::correct(set, &self.markers, reach);
        set.fill();
        self.steps += 1;
        if self.steps.is_multiple_of(UPKEEP) {
            self.upkeep(set);
        }
    }

    /// Moves points, and normals as the cross product of two tangents.
    fn advect(&mut self, flow: &impl Flow) {
        parallel::for_each(self.markers.chunks_mut(CHUNK), |_, markers| {
            let mut reader = flow.reader();
            for marker in markers {
                let [middle, way] = displacements(&mut reader, marker.point);
                let first = perpendicular(marker.normal);
                let [a, b] = [first, cross(marker.normal, first)].map(|tangent| {
                    // Normals need no more than the second order.
                    let start = add(marker.point, scale(tangent, TANGENT));
                    let half = scale(reader(start), 0.5);
                    add(tangent, scale(sub(reader(add(start, half)), middle), 1.0 / TANGENT))
                });
                let held = flow.held(marker.point, way, 1.0);
                marker.point = add(marker.point, held.map_or(way, |held| held.way));
                marker.normal = unit(cross(a, b)).unwrap_or(marker.normal);
            }
        });
    }

    /// Changes a level set as [`LevelSet::change`] does, and makes it a distance again. Markers in the box that are then off
    /// the surface are dropped.
    pub fn change(&mut self, set: &mut LevelSet, low: Cell, high: Cell, change: &PhiChange<'_>) {
        let view = set.view();
        let is_in = |at: Vec3| (0..3).all(|axis| low[axis] as f32 <= at[axis] && at[axis] <= high[axis] as f32);
        // Beside the surface, too: a marker on the edge of what is added would look along the old surface.
        let stays = |marker: &Marker, sampler: &mut PhiSampler<'_>| {
            [-BESIDE, 0.0, BESIDE].into_iter().all(|way| {
                let point = add(marker.point, scale(marker.normal, way));
                let phi = sampler.at(point);
                (change(point, phi) - phi).abs() < CHANGED
            })
        };
        let on_surface = self.tested(view, |sampler, marker| !is_in(marker.point) || stays(marker, sampler));
        let order: Vec<u32> = (0..self.markers.len() as u32).filter(|n| on_surface[*n as usize]).collect();
        self.reorder(&order);
        // On the face of a cut: what markers kept of an older one there would come back after each cut.
        let is_on_cut = |at: Vec3| is_in(at) && change(at, -DEEP).abs() < CLOSE;
        let on_cut = self.tested(view, |_, marker| is_on_cut(marker.point));
        set.change(low, high, change);
        set.fill();
        self.project(set, &on_cut);
        self.upkeep(set);
    }

    /// Moves those of the markers onto φ = 0, where φ is smooth, and turns them its way.
    fn project(&mut self, set: &LevelSet, which: &[bool]) {
        let view = set.view();
        let chunks = self.markers.chunks_mut(CHUNK).zip(which.chunks(CHUNK));
        parallel::for_each(chunks, |_, (markers, which)| {
            let mut sampler = PhiSampler::new(view);
            for (marker, _) in markers.iter_mut().zip(which).filter(|(_, which)| **which) {
                let (phi, gradient) = sampler.gradient(marker.point);
                if let Some(normal) = unit(gradient).filter(|_| seed::DISTANCE.contains(&dot(gradient, gradient))) {
                    *marker = Marker { point: sub(marker.point, scale(normal, phi)), normal };
                }
            }
        });
    }

    /// Changes the attributes of each marker, one number after the other, to what `edit` makes of its place and of them.
    pub fn edit_attributes(&mut self, edit: impl Fn(Vec3, &mut [f32]) + Sync) {
        if self.attributes.is_empty() {
            return;
        }
        let attributes = &self.attributes;
        let rows = parallel::tabulate(self.markers.len(), CHUNK, |n| {
            let mut row: Vec<f32> = attributes.iter().map(|values| values[n]).collect();
            edit(self.markers[n].point, &mut row);
            row
        });
        for (n, values) in self.attributes.iter_mut().enumerate() {
            values.iter_mut().zip(&rows).for_each(|(value, row)| *value = row[n]);
        }
    }

    /// Drops markers that are not on the surface, thins them where they crowd, and fills holes. A step does so now and
    /// then; call it after a shape was added to the level set or cut away.
    pub fn upkeep(&mut self, set: &LevelSet) {
        let view = set.view();
        let lost = |marker: &Marker, sampler: &mut PhiSampler<'_>| {
            let outside = |axis: usize| {
                let at = marker.point[axis];
                at < view.low[axis] as f32 - 1.0 || at > view.high[axis] as f32 + 1.0
            };
            (0..3).any(outside) || sampler.at(marker.point).abs() > LOST
        };
        let on_surface = self.tested(view, |sampler, marker| !lost(marker, sampler));
        let bins = Bins::new(set.rows(), (view.low, view.high), &self.markers, |n| on_surface[n]);
        self.reorder(&bins.thinned(3 * PER_CELL, 2 * PER_CELL));
        self.fill_holes(set);
    }

    /// Whether each marker passes a test, which may sample φ.
    fn tested(&self, view: PhiView<'_>, test: impl Fn(&mut PhiSampler<'_>, &Marker) -> bool + Sync) -> Vec<bool> {
        let passes = |sampler: &mut PhiSampler<'_>, n: usize| test(sampler, &self.markers[n]);
        parallel::tabulate_with(self.markers.len(), CHUNK, || PhiSampler::new(view), passes)
    }

    /// Keeps the markers of a list, in its order.
    fn reorder(&mut self, order: &[u32]) {
        fn pick<T: Copy>(order: &[u32], from: &[T]) -> Vec<T> {
            order.iter().map(|n| from[*n as usize]).collect()
        }
        self.markers = pick(order, &self.markers);
        self.ids = pick(order, &self.ids);
        self.pieces = pick(order, &self.pieces);
        self.attributes = self.attributes.iter().map(|values| pick(order, values)).collect();
    }

    fn fill_holes(&mut self, set: &LevelSet) {
        let (low, high) = set.domain();
        let bins = Bins::new(set.rows(), (low, high), &self.markers, |_| true);
        let new = seed::seed(set, &bins, &self.markers, PER_CELL, Key::new(self.seed).of(self.next_id));
        let values = attributes::interpolate(set.rows(), &bins, &self.markers, &self.attributes, &new);
        for (all, new) in self.attributes.iter_mut().zip(values) {
            all.extend(new);
        }
        self.ids.extend(self.next_id..self.next_id + new.len() as u64);
        self.next_id += new.len() as u64;
        self.pieces.resize(self.pieces.len() + new.len(), NO_PIECE);
        self.markers.extend(new);
    }
}

/// How far ways lie to one side: 0 all around, 1 all in one direction. Each has a weight.
fn one_sided(ways: impl Iterator<Item = (Vec3, f32)>) -> f32 {
    let (sum, lengths) = ways.fold(([0.0; 3], 0.0), |(sum, lengths), (way, weight)| {
        (add(sum, scale(way, weight)), lengths + weight * length(way))
    });
    length(sum) / lengths
}
