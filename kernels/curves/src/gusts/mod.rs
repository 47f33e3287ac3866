//! Gusts: regions that pass over points and raise the wind there (W5).
//!
//! The value at a point is `clamp(base + Σ influences, 0, 1)`, times an incoming value and at most 1: first the gusts' spheres, then the controls, each in
//! their order. The influence of a sphere is 1 at its centre and falls off to 0 at its boundary; that of a control is
//! its ramp over the distance in the control's own space.
//!
//! Guarantees: a point that no region reaches gets exactly `base`; the same bits on every SIMD path and number of
//! threads, whatever was culled; finite for any finite points; at most points × regions evaluations, fewer if whole
//! blocks of points are outside a region or already saturated. Limit: culling is efficient only if neighbours in the
//! list are neighbours in space, as the CVs of a groom are. Distances are computed relative to a nearby point, so
//! precision does not depend on the scene's distance from the origin beyond that of f32 positions. Positions in metres,
//! times in frames.

mod block;
mod control;
mod cull;
mod draw;
mod launch;
mod profile;
mod shear;

use block::block_values;
pub use control::{AXIS_ROWS, Control, ControlShape, outline};
use cull::{Bounds, Boxes, all_beside, bounds_of, meeting};
pub use draw::{Draw, Gust, Living, MOST_LIVING};
pub use launch::Plane;
use numerics::parallel;
use numerics::ramp::Ramp;
use numerics::simd::Path;
use numerics::vector::DVec3;
use profile::Profile;
pub use shear::{sideways, sideways_on};

/// A procedural gust at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub centre: [f64; 3],
    /// Points farther from the centre are not reached. A gust with a radius below [`SMALLEST`] reaches none.
    pub radius: f32,
    /// Factor of its influence, 0 or more.
    pub strength: f32,
    /// Fraction of the radius by which noise may dent the sphere, 0..1.
    pub noise: f32,
    /// Seed of its noise.
    pub salt: u32,
}

/// Everything that influences points.
#[derive(Clone, Debug)]
pub struct Gusts<'a> {
    /// The value of a point that no region reaches, 0..1.
    pub base: f32,
    /// Influence within a sphere, from its centre (0) to its boundary (1).
    pub falloff: &'a Ramp,
    /// The gusts.
    pub spheres: &'a [Sphere],
    /// Regions placed by hand.
    pub controls: &'a [Control],
    /// Factors of single points.
    pub masks: GustMasks<'a>,
    /// Factor on each point's value: below 0 or NaN counts as 0; `None` is 1 everywhere.
    pub incoming: Option<&'a [f32]>,
}

/// Factors, one for each point; below 0 or NaN counts as 0, `None` is 1 everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GustMasks<'a> {
    /// On `base`; products above 1 count as 1.
    pub base: Option<&'a [f32]>,
    /// On every influence.
    pub strength: Option<&'a [f32]>,
}

impl GustMasks<'_> {
    /// None.
    pub const NONE: Self = Self { base: None, strength: None };

    /// Those of the points from `first` on.
    fn from(&self, first: usize) -> Self {
        Self { base: self.base.map(|mask| &mask[first..]), strength: self.strength.map(|mask| &mask[first..]) }
    }
}

/// The values of all points.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Influence {
    /// One value for each point.
    pub values: Vec<f32>,
    /// Points with an influence other than 0.
    pub reached: usize,
}

/// The smallest radius of a gust, in metres, whose inverse and square are still finite.
pub const SMALLEST: f32 = 1e-36;

/// Number of points in a task: some 30 µs of work if there are gusts, against a few for handing it to a thread.
const TASK: usize = 2048;

/// Number of points that are culled together: about a dozen hairs.
const BLOCK: usize = 64;

/// Cells of noise across a sphere's radius: about four lumps around it.
const LUMPS: f32 = 1.5;

/// Fraction by which bounds are enlarged for culling: more than all rounding errors together.
const MARGIN: f64 = 1e-4;

/// The least and largest coordinates of points; `None` without points.
pub fn bounds(points: &[[f32; 3]]) -> Option<[[f32; 3]; 2]> {
    (!points.is_empty()).then(|| bounds_of(Path::chosen(), points))
}

/// The value of each point.
///
/// # Panics
/// If `incoming` or a mask is shorter than `points`.
pub fn evaluate(points: &[[f32; 3]], gusts: &Gusts<'_>) -> Influence {
    evaluate_on(Path::chosen(), points, gusts)
}

/// [`evaluate()`] on a given SIMD path.
///
/// # Panics
/// As [`evaluate()`].
pub fn evaluate_on(path: Path, points: &[[f32; 3]], gusts: &Gusts<'_>) -> Influence {
    let prepared = Prepared::new(gusts);
    // Never −0: blocks that no gust reaches keep it.
    let base = gusts.base.clamp(0.0, 1.0) + 0.0;
    let mut values = match gusts.masks.base {
        Some(mask) => mask[..points.len()].iter().map(|factor| (base * at_least_0(*factor)).min(1.0)).collect(),
        None => vec![base; points.len()],
    };
    let tasks = values.chunks_mut(TASK).zip(points.chunks(TASK));
    let reached = parallel::map(tasks, |task, (out, points)| {
        let incoming = gusts.incoming.map(|incoming| &incoming[task * TASK..][..points.len()]);
        let factors = gusts.masks.from(task * TASK).strength;
        let reached = if prepared.boxes.len() > 0 { prepared.task(path, points, factors, out) } else { 0 };
        if let Some(incoming) = incoming {
            scale(out, incoming);
        }
        reached
    });
    Influence { values, reached: reached.into_iter().sum() }
}

/// The gusts, with everything that can be computed once for all points.
struct Prepared<'a> {
    gusts: &'a Gusts<'a>,
    falloff: Profile,
    /// Ramps of the controls.
    ramps: Vec<Profile>,
    /// Bounds of the regions, spheres first.
    boxes: Boxes,
    /// Bounds of all of them.
    reach: Bounds,
    /// No influence is negative, so a point that has reached 1 stays there.
    only_adds: bool,
}

impl<'a> Prepared<'a> {
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
        for (index, control) in gusts.controls.iter().enumerate() {
            if let Some(reach) = control.reach() {
                add(gusts.spheres.len() + index, control.centre(), reach);
            }
        }
        let falloff_adds = gusts.spheres.is_empty() || gusts.falloff.min() >= 0.0;
        let only_adds = falloff_adds && gusts.controls.iter().all(Control::only_adds);
        let ramps = gusts.controls.iter().map(|control| Profile::new(control.ramp())).collect();
        let reach = boxes.bounds();
        Self { gusts, falloff: Profile::new(gusts.falloff), ramps, boxes, reach, only_adds }
    }

    /// The regions that may reach any of a task's points.
    fn near(&self, path: Path, points: &[[f32; 3]]) -> Boxes {
        if all_beside(path, points, &self.reach) {
            return Boxes::default();
        }
        meeting(path, &self.boxes, &bounds_of(path, points))
    }

    /// Adds to the values of a task's points, which are their `base`; returns how many of them any influence reaches.
    fn task(&self, path: Path, points: &[[f32; 3]], factors: Option<&[f32]>, out: &mut [f32]) -> usize {
        // Of most tasks no gust is near: then blocks need no bounds of their own.
        let near = self.near(path, points);
        if near.len() == 0 {
            return 0;
        }
        let mut reached = 0;
        for (block, (points, out)) in points.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).enumerate() {
            let factors = factors.map(|factors| &factors[block * BLOCK..]);
            reached += block_values(path, self, &near, &bounds_of(path, points), points, factors, out);
        }
        reached
    }
}

/// Multiplies values by those incoming, of which below 0 or NaN counts as 0; none is above 1 then.
pub fn scale(values: &mut [f32], incoming: &[f32]) {
    for (value, incoming) in values.iter_mut().zip(incoming) {
        *value = scaled_by(*value, *incoming);
    }
}

/// [`scale()`] of a copy.
pub fn scaled(values: &[f32], incoming: &[f32]) -> Vec<f32> {
    values.iter().zip(incoming).map(|(value, incoming)| scaled_by(*value, *incoming)).collect()
}

#[inline(always)]
fn scaled_by(value: f32, incoming: f32) -> f32 {
    let product = value * at_least_0(incoming);
    if product > 1.0 { 1.0 } else { product }
}

/// The number; below 0 or NaN counts as 0, infinity as the largest, whose product with 0 is 0.
#[inline(always)]
fn at_least_0(factor: f32) -> f32 {
    let factor = if factor > 0.0 { factor } else { 0.0 };
    if factor < f32::MAX { factor } else { f32::MAX }
}

#[cfg(test)]
mod tests;
