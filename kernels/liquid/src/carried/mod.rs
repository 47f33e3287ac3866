//! Points that a liquid carries: tracers, and the points that say what each part of a liquid is made of
//! ([`MaterialPoints`]). They move by the velocity of each substep, to third order in it.
//!
//! Places are in cells. Bits are the same on any number of threads.

mod material;
mod phases;
#[cfg(test)]
mod tests;

pub(crate) use material::{CellMaterials, Filled, Stir};
pub use material::{LiquidMaterial, MaterialPoints};
pub(crate) use phases::PhaseReader;
pub use phases::PhaseShares;

use numerics::parallel;
use numerics::vector::{Vec3, add};
use serde::{Deserialize, Serialize};

use crate::level_set::{PhiSampler, PhiView, displacement};
use crate::step::{Domain, Moving, Wall};

/// Points that one thread moves at a time.
const CHUNK: usize = 512;

/// Distance from the liquid, in cells, up to which its velocity carries a tracer.
const CARRIED: f32 = 2.0;

/// Points that follow the liquid and do nothing to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TracerPoints {
    points: Vec<Vec3>,
    numbers: Vec<u32>,
}

impl TracerPoints {
    /// Tracers at these places, numbered from 0.
    pub fn new(points: Vec<Vec3>) -> Self {
        let numbers = (0..points.len() as u32).collect();
        Self { points, numbers }
    }

    /// Where they are, in cells.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// The number of each at the start; ascending.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Which of them a liquid carries; others stay where they are, whatever the velocity there is.
    pub fn carried(&self, view: PhiView<'_>, domain: &Domain) -> Vec<bool> {
        let is_carried = |sampler: &mut PhiSampler<'_>, n: usize| is_carried(sampler, self.points[n], domain);
        parallel::tabulate_with(self.points.len(), CHUNK, || PhiSampler::new(view), is_carried)
    }

    /// Moves those that are in the liquid or next to it; others stay. What leaves through an open wall is dropped.
    pub(crate) fn advance(&mut self, flow: &Moving<'_>, view: PhiView<'_>, domain: &Domain) {
        parallel::for_each(self.points.chunks_mut(CHUNK), |_, points| {
            let (mut way, mut sampler) = (flow.reader(), PhiSampler::new(view));
            for point in points {
                if is_carried(&mut sampler, *point, domain) {
                    let moved = displacement(&mut way, *point);
                    let moved = flow.held(*point, moved, 1.0).map_or(moved, |held| held.way);
                    *point = kept_in(add(*point, moved), domain);
                }
            }
        });
        if self.points.iter().any(|point| is_outside(*point, domain) == Some(Wall::Open)) {
            let stays: Vec<bool> =
                self.points.iter().map(|point| is_outside(*point, domain) != Some(Wall::Open)).collect();
            let (mut point, mut number) = (stays.iter(), stays.iter());
            self.points.retain(|_| point.next() == Some(&true));
            self.numbers.retain(|_| number.next() == Some(&true));
        }
    }
}

/// Whether the liquid carries a tracer at a place: it is in the liquid or next to it.
fn is_carried(sampler: &mut PhiSampler<'_>, point: Vec3, domain: &Domain) -> bool {
    is_outside(point, domain).is_none() && sampler.at(point) < CARRIED
}

/// The wall that a place is beyond.
fn is_outside(point: Vec3, domain: &Domain) -> Option<Wall> {
    let [low, high] = domain.bounds();
    (0..3).find_map(|axis| {
        let beyond = [point[axis] < low[axis], point[axis] > high[axis]];
        (0..2).find(|side| beyond[*side]).map(|side| domain.walls[axis][side])
    })
}

/// A place, moved back to the walls that nothing passes, and in at the other side of those that repeat.
fn kept_in(point: Vec3, domain: &Domain) -> Vec3 {
    let [low, high] = domain.bounds();
    let mut point = domain.periods().home_point(point);
    for axis in 0..3 {
        let [below, above] = domain.walls[axis].map(Wall::is_solid);
        if below && point[axis] < low[axis] {
            point[axis] = low[axis];
        }
        if above && point[axis] > high[axis] {
            point[axis] = high[axis];
        }
    }
    point
}
