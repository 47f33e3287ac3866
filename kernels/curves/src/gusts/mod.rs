//! Gusts: regions that pass over points and let the wind in (W5).
//!
//! What a point gets is `clamp(base + Σ influences, 0, 1)`: of the spheres that gusts are, in their
//! order, then of the controls, in theirs. A sphere's influence is 1 at its centre and falls off to 0
//! at its boundary; a control's is its ramp over the distance in its own space.
//!
//! Promise: a point outside of everything gets `base` to the bit; the same bits on every SIMD path
//! and number of threads, whatever was culled; finite for any finite points; at most one pass over
//! points × regions, less where whole blocks of points are beyond a region or full already. Limit:
//! culling lives from neighbours in the list being neighbours in space, as the CVs of a groom are.
//! Distances are differences from a point near by, so the scene's place costs no digit but those
//! that its f32 positions have lost. Positions in metres, times in frames.

mod block;
mod control;
mod cull;
mod draw;
mod launch;
mod profile;

use block::block_values;
pub use control::{AXIS_ROWS, Control, Shape, outline};
use cull::{Boxes, NOWHERE, bounds_of, join, meeting};
pub use draw::{Draw, Gust, Living, MOST_LIVING};
pub use launch::Plane;
use numerics::ramp::Ramp;
use numerics::simd::Path;
use numerics::vector::DVec3;
use profile::Profile;
use rayon::prelude::*;

/// A procedural gust at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Where it is.
    pub centre: [f64; 3],
    /// Nothing farther from the centre is touched; below [`SMALLEST`] nothing is.
    pub radius: f32,
    /// What its influence is multiplied by, 0..1.
    pub strength: f32,
    /// Share of the radius that noise may take away, 0..1.
    pub noise: f32,
    /// Which noise it has.
    pub salt: u32,
}

/// Everything that is felt.
#[derive(Clone, Debug)]
pub struct Gusts<'a> {
    /// What a point gets that nothing reaches, 0..1.
    pub base: f32,
    /// Influence of a sphere from its centre (0) to its boundary (1).
    pub falloff: &'a Ramp,
    /// The gusts.
    pub spheres: &'a [Sphere],
    /// What an artist placed by hand.
    pub controls: &'a [Control],
    /// What scales each point's value: below 0 or NaN counts as 0; none is 1 everywhere.
    pub incoming: Option<&'a [f32]>,
}

/// What every point gets.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Felt {
    /// One value a point.
    pub values: Vec<f32>,
    /// Points that some influence other than 0 reaches.
    pub reached: usize,
}

/// The least radius of a gust, in metres: its inverse and its square are still numbers.
pub const SMALLEST: f32 = 1e-36;

/// Points of a task: some 30 µs of work where gusts are, against a few for handing it to a thread.
const TASK: usize = 2048;

/// Points that are culled together: a dozen hairs.
const BLOCK: usize = 64;

/// Cells of noise across a sphere's radius: four or so lumps around it.
const LUMPS: f32 = 1.5;

/// How far a region reaches past its bounds for culling: more than all rounding together.
const MARGIN: f64 = 1e-4;

/// What each point feels.
///
/// # Panics
/// Where `incoming` is shorter than `points`.
pub fn feel(points: &[[f32; 3]], gusts: &Gusts<'_>) -> Felt {
    feel_on(Path::chosen(), points, gusts)
}

/// [`feel()`] on a given SIMD path.
///
/// # Panics
/// As [`feel()`].
pub fn feel_on(path: Path, points: &[[f32; 3]], gusts: &Gusts<'_>) -> Felt {
    let scene = Scene::new(gusts);
    let mut values = vec![scene.gusts.base.clamp(0.0, 1.0); points.len()];
    let reached = values
        .par_chunks_mut(TASK)
        .zip(points.par_chunks(TASK))
        .enumerate()
        .map(|(task, (out, points))| {
            let incoming = gusts.incoming.map(|incoming| &incoming[task * TASK..][..points.len()]);
            let reached = if scene.boxes.len() > 0 { scene.task(path, points, out) } else { 0 };
            if let Some(incoming) = incoming {
                scale(out, incoming);
            }
            reached
        })
        .sum();
    Felt { values, reached }
}

/// The gusts, and what of them is the same for all points.
struct Scene<'a> {
    gusts: &'a Gusts<'a>,
    falloff: Profile,
    /// Of the controls.
    ramps: Vec<Profile>,
    /// Where each region ends, spheres first.
    boxes: Boxes,
    /// No influence is below 0: a point that has 1 keeps it.
    only_adds: bool,
}

impl<'a> Scene<'a> {
    fn new(gusts: &'a Gusts<'a>) -> Self {
        let mut boxes = Boxes::default();
        let mut add = |region: usize, centre: DVec3, reach: DVec3| {
            boxes.push(region as u32, centre, reach * (1.0 + MARGIN));
        };
        for (region, sphere) in gusts.spheres.iter().enumerate() {
            if sphere.radius >= SMALLEST && sphere.strength != 0.0 {
                add(region, sphere.centre.into(), DVec3::repeat(sphere.radius.into()));
            }
        }
        for (place, control) in gusts.controls.iter().enumerate() {
            if let Some(reach) = control.reach() {
                add(gusts.spheres.len() + place, control.centre(), reach);
            }
        }
        let falloff_adds = gusts.spheres.is_empty() || gusts.falloff.min() >= 0.0;
        let only_adds = falloff_adds && gusts.controls.iter().all(Control::only_adds);
        let ramps = gusts.controls.iter().map(|control| Profile::new(control.ramp())).collect();
        Self { gusts, falloff: Profile::new(gusts.falloff), ramps, boxes, only_adds }
    }

    /// The values of a task's points; gives how many were reached.
    fn task(&self, path: Path, points: &[[f32; 3]], out: &mut [f32]) -> usize {
        let mut bounds = [NOWHERE; TASK / BLOCK];
        let mut whole = NOWHERE;
        for (points, bounds) in points.chunks(BLOCK).zip(&mut bounds) {
            *bounds = bounds_of(path, points);
            whole = join(whole, *bounds);
        }
        let near = meeting(path, &self.boxes, &whole);
        let mut reached = 0;
        for (block, (points, out)) in points.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).enumerate() {
            reached += block_values(path, self, &near, &bounds[block], points, out);
        }
        reached
    }
}

/// Multiplies by what came in.
fn scale(values: &mut [f32], incoming: &[f32]) {
    for (value, incoming) in values.iter_mut().zip(incoming) {
        *value *= if *incoming > 0.0 { *incoming } else { 0.0 };
    }
}

#[cfg(test)]
mod tests;
