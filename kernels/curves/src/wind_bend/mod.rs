//! Wind on curves: the kernel of Curve_Wind (W2), sixteen curves side by side.
//!
//! Root to tip, one pivot at a time, the rest of the curve rotates about the pivot, from the direction of its *current*
//! tip towards the wind. The accumulated rotation is one quaternion carried down the curve, so the cost is linear in
//! the number of CVs; moving all later points would be quadratic.
//!
//! Guarantees: the root keeps its bits; segments keep their lengths within 1e-5 of the curve's plus 4 ulp of the
//! positions, at any number of CVs; CVs that do not move keep their bits; the same bits on every SIMD path and number
//! of threads; finite for any finite positions below 1e37. All arithmetic is on differences of CVs, scaled to 1…2 by a
//! power of two, so precision does not depend on the scene's position and scale beyond that of f32 positions. Limit:
//! between exactly opposite directions the axis of rotation is undefined; within 1e-6 rad of that it is taken from the
//! curve. Metres, radians.

mod chain;
mod curve_group;
mod share;
mod tally;
mod wind_direction;

use curve_group::{CurveGroup, Scratch, bend_group};
use numerics::lanes::LANES;
use numerics::masked::Masked;
use numerics::noise::Field;
use numerics::parallel;
use numerics::ramp::Ramp;
use numerics::simd::Path;

/// The fraction of the angle to the wind by which a pivot rotates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BendMode {
    /// As in the paper: g at every pivot. Segment k of a straight curve ends at an angle of θ₀(1−g)ᵏ⁺¹, k from 0, so
    /// curves with more CVs bend more.
    Paper,
    /// θ₀(1−g)^(u·n) at a segment whose middle is at u, n this number: the same shape for any number of CVs. With g ≥ 1
    /// the whole curve lies along the wind.
    ResolutionFree {
        /// The number of segments for which it bends as the paper does.
        reference_segments: f32,
    },
}

/// Settings of the bend. Slices have one value for each CV unless stated.
#[derive(Clone, Debug)]
pub struct Bend<'a> {
    /// Direction that the wind blows towards, of length 1.
    pub wind: [f32; 3],
    /// Fraction g of the angle by which a pivot turns: 0 none, 1 all of it.
    pub rotate: Masked<'a, f32>,
    /// Scales `rotate`; below 0 or NaN counts as 0.
    pub envelope: Option<&'a [f32]>,
    /// Scales `rotate` along u, the rest arc length ÷ curve length.
    pub ramp: &'a Ramp,
    /// How g acts along the curve.
    pub mode: BendMode,
    /// Fraction of each segment's turn that is applied, 0..1; 0 gives the input bits.
    pub blend: Masked<'a, f32>,
    /// Noise that varies the wind's direction.
    pub noise: Option<BendNoise<'a>>,
    /// Added to the wind's direction at each CV: what gusts add to a wind of length 1.
    pub gusts: Option<&'a [[f32; 3]]>,
}

/// Noise added to the wind's direction: `wind + amplitude · field(frequency · (root + origin +
/// waviness · arc length · wind))`; with `other` the field is a blend of itself and its value at another origin.
#[derive(Clone, Debug)]
pub struct BendNoise<'a> {
    /// The field.
    pub field: &'a Field,
    /// Amplitude of the noise, relative to a wind of length 1; a value of 0 costs nothing. Masked for each CV.
    pub amplitude: Masked<'a, f32>,
    /// Cells of the field per metre.
    pub frequency: f64,
    /// A CV samples this many times its arc length downwind of its root; at 0 one sample for each curve is enough. Masked
    /// for each CV.
    pub waviness: Masked<'a, f32>,
    /// Added to the root, in metres: the scene's origin minus the offset of the scroll.
    pub origin: [f64; 3],
    /// Another origin, and the share of it, 0..1. Squares of both parts sum to 1, so that the mean strength is that of one
    /// where both are not correlated.
    pub other: Option<([f64; 3], f32)>,
    /// Position at which each curve's noise is sampled; `None`: its own root.
    pub roots: Option<&'a [[f32; 3]]>,
}

/// Bent curves, and how far they bent.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Bent {
    /// One point for each input point.
    pub points: Vec<[f32; 3]>,
    /// Largest rotation of a segment, in radians, 0..π.
    pub max_angle: f32,
    /// Largest |length − input length| ÷ curve length, of segments and of whole curves, measured on the result.
    pub length_error: f32,
}

/// Largest values over some curves.
#[derive(Clone, Copy, Default)]
struct Reached {
    max_angle: f32,
    /// The squared tangent of half the largest angle.
    ratio: f32,
    length_error: f32,
}

impl Reached {
    fn max(self, other: Self) -> Self {
        Self {
            max_angle: self.max_angle.max(other.max_angle),
            ratio: self.ratio.max(other.ratio),
            length_error: self.length_error.max(other.length_error),
        }
    }
}

/// Minimum number of CVs in a task: some 30 µs of work, against a few for handing it to a thread.
const TASK_CVS: usize = 2048;

/// Bends curves `points[starts[i]..starts[i + 1]]`; curves of one CV pass through unchanged.
///
/// # Panics
/// If `starts` decreases or does not run from 0 to the number of points, or a slice of `bend` is
/// shorter than its points or curves.
pub fn bend(starts: &[u32], points: &[[f32; 3]], bend: &Bend<'_>) -> Bent {
    bend_on(Path::chosen(), starts, points, bend)
}

/// Whether an envelope is 1 everywhere, as a node leaves it that has no effect: then it need not be gathered.
fn is_full(envelope: &[f32]) -> bool {
    /// Values compared at once, without a branch between them.
    const BLOCK: usize = 64;
    envelope.chunks(BLOCK).all(|block| block.iter().fold(true, |full, x| full & (*x == 1.0)))
}

/// [`bend()`] on a given SIMD path.
///
/// # Panics
/// As [`bend()`].
pub fn bend_on(path: Path, starts: &[u32], points: &[[f32; 3]], bend: &Bend<'_>) -> Bent {
    if bend.rotate.value == 0.0 || bend.blend.value <= 0.0 || bend.ramp.is_constant() == Some(0.0) {
        return Bent { points: points.to_vec(), max_angle: 0.0, length_error: 0.0 };
    }
    let bend = &Bend { envelope: bend.envelope.filter(|envelope| !is_full(envelope)), ..bend.clone() };
    // All are written. A copy takes the same time whatever memory it gets; zeros depend on whether that was used before.
    let mut out = points.to_vec();
    let reached = parallel::map(tasks(starts, &mut out), |_, task| {
        let mut scratch = Scratch::default();
        let (mut reached, mut out) = (Reached::default(), task.out);
        for first in (task.first..task.end).step_by(LANES) {
            let end = task.end.min(first + LANES);
            let (mine, rest) = out.split_at_mut((starts[end] - starts[first]) as usize);
            let group = CurveGroup { first, starts: &starts[first..=end], points };
            reached = bend_group(path, bend, &group, &reached, &mut scratch, mine);
            out = rest;
        }
        reached
    });
    let reached = reached.into_iter().fold(Reached::default(), Reached::max);
    Bent { points: out, max_angle: reached.max_angle, length_error: reached.length_error }
}

/// Whole groups of curves for one task, and the points that it writes.
struct Task<'a> {
    first: usize,
    end: usize,
    out: &'a mut [[f32; 3]],
}

/// Splits the curves, and `out` with them, into tasks of at least `TASK_CVS` points.
fn tasks<'a>(starts: &[u32], mut out: &'a mut [[f32; 3]]) -> Vec<Task<'a>> {
    let curves = starts.len().saturating_sub(1);
    let mut tasks = Vec::new();
    let mut first = 0;
    while first < curves {
        let mut end = first;
        while end < curves && ((starts[end] - starts[first]) as usize) < TASK_CVS {
            end = curves.min(end + LANES);
        }
        let (mine, rest) = out.split_at_mut((starts[end] - starts[first]) as usize);
        tasks.push(Task { first, end, out: mine });
        (out, first) = (rest, end);
    }
    assert!(out.is_empty(), "`starts` covers all but {} points", out.len());
    tasks
}

#[cfg(test)]
mod tests;
