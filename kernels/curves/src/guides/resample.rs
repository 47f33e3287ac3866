//! Guides resampled to the number of segments of a hair.

use numerics::parallel;
use numerics::vector::{DVec3, to_f64};

/// Guides with as many segments as a hair. A guide with as many CVs keeps them; any other is resampled evenly along its
/// length.
#[derive(Clone, Debug, PartialEq)]
pub struct ResampledGuides {
    segments: usize,
    pieces: Vec<GuideSegment>,
    samples: Vec<CurveSample>,
}

/// A segment of a guide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GuideSegment {
    /// From end to end, metres.
    pub(super) chord: DVec3,
    /// Along the guide, metres.
    pub(super) length: f64,
}

/// A position along a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveSample {
    /// The CV before, as a row of the curves' points.
    pub before: u32,
    /// The CV after.
    pub after: u32,
    /// Interpolation: 0 at the CV before, 1 at the one after.
    pub fraction: f32,
}

/// `counts[i]` positions (1 or more) on each of the curves `points[starts[i]..starts[i + 1]]`, evenly spaced along its length,
/// from exactly its root to exactly its tip; of one, the tip. All are at the root where a curve has no length, but the last.
///
/// # Panics
/// If `starts` does not run from 0 to the number of points, a curve has no point, or there are fewer `counts`.
pub fn even_samples(starts: &[u32], points: &[[f32; 3]], counts: &[u32]) -> Vec<CurveSample> {
    let curves: Vec<usize> = (0..starts.len().saturating_sub(1)).collect();
    let of_task = |_, curves: &[usize]| {
        let mut samples = Vec::new();
        for curve in curves {
            let first = samples.len();
            samples.resize(first + counts[*curve] as usize, CurveSample { before: 0, after: 0, fraction: 0.0 });
            let cvs = starts[*curve] as usize..starts[*curve + 1] as usize;
            cut_evenly(starts[*curve], &points[cvs], &mut samples[first..]);
        }
        samples
    };
    parallel::concat(parallel::map(curves.chunks(TASK), of_task))
}

/// Number of guides in a task.
const TASK: usize = 32;

impl ResampledGuides {
    /// Resamples guides `points[starts[i]..starts[i + 1]]` to `cvs` (1 or more) CVs.
    ///
    /// # Panics
    /// If `starts` does not run from 0 to the number of points.
    pub fn new(starts: &[u32], points: &[[f32; 3]], cvs: usize) -> Self {
        let segments = cvs.saturating_sub(1);
        let guides = starts.len().saturating_sub(1);
        let mut samples = vec![CurveSample { before: 0, after: 0, fraction: 0.0 }; guides * cvs];
        let mut pieces = vec![GuideSegment { chord: DVec3::zeros(), length: 0.0 }; guides * segments];
        parallel::for_each(samples.chunks_mut(TASK * cvs), |task, samples| {
            for (guide, samples) in (task * TASK..).zip(samples.chunks_mut(cvs)) {
                cut(starts[guide], &points[starts[guide] as usize..starts[guide + 1] as usize], samples);
            }
        });
        if segments > 0 {
            let tasks = pieces.chunks_mut(TASK * segments).zip(samples.chunks(TASK * cvs));
            parallel::for_each(tasks, |_, (pieces, samples)| {
                let guides = pieces.chunks_mut(segments).zip(samples.chunks(cvs));
                guides.for_each(|(pieces, samples)| measure(points, samples, pieces));
            });
        }
        Self { segments, pieces, samples }
    }

    /// Segments of a hair.
    pub fn segments(&self) -> usize {
        self.segments
    }

    pub(super) fn pieces(&self, guide: usize) -> &[GuideSegment] {
        &self.pieces[guide * self.segments..(guide + 1) * self.segments]
    }

    pub(super) fn samples(&self, guide: usize) -> &[CurveSample] {
        &self.samples[guide * (self.segments + 1)..(guide + 1) * (self.segments + 1)]
    }

    /// The guides with their chords mapped.
    pub(super) fn with_chords(mut self, map: impl Fn(usize, DVec3) -> DVec3 + Sync) -> Self {
        if self.segments > 0 {
            parallel::for_each(self.pieces.chunks_mut(TASK * self.segments), |task, pieces| {
                for (guide, pieces) in (task * TASK..).zip(pieces.chunks_mut(self.segments)) {
                    pieces.iter_mut().for_each(|piece| piece.chord = map(guide, piece.chord));
                }
            });
        }
        self
    }
}

/// The positions of the CVs of a hair on a guide whose first CV is row `start`.
fn cut(start: u32, points: &[[f32; 3]], samples: &mut [CurveSample]) {
    if points.len() == samples.len() {
        for (k, sample) in samples.iter_mut().enumerate() {
            *sample = CurveSample { before: start + k as u32, after: start + k as u32, fraction: 0.0 };
        }
        return;
    }
    cut_evenly(start, points, samples);
}

/// The same for any number of CVs: evenly spaced.
fn cut_evenly(start: u32, points: &[[f32; 3]], samples: &mut [CurveSample]) {
    let last = points.len() - 1;
    let segment = |k: usize| (to_f64(points[k + 1]) - to_f64(points[k])).norm();
    let whole: f64 = (0..last).map(segment).sum();
    let steps = (samples.len() - 1).max(1) as f64;
    let (mut k, mut passed) = (0, 0.0);
    let mut here = if last > 0 { segment(0) } else { 0.0 };
    for (step, sample) in samples.iter_mut().enumerate() {
        let target = whole * (step as f64 / steps);
        while k + 1 < last && passed + here < target {
            passed += here;
            k += 1;
            here = segment(k);
        }
        let fraction = if here > 0.0 { ((target - passed) / here).clamp(0.0, 1.0) } else { 0.0 };
        let after = (k + 1).min(last) as u32;
        *sample = CurveSample { before: start + k as u32, after: start + after, fraction: fraction as f32 };
    }
    // Exactly the tip, whatever rounding the sum has.
    if let [_, .., tip] = samples {
        *tip = CurveSample { before: start + last as u32, after: start + last as u32, fraction: 0.0 };
    }
}

/// The segments between `samples`.
fn measure(points: &[[f32; 3]], samples: &[CurveSample], pieces: &mut [GuideSegment]) {
    let at = |sample: &CurveSample| {
        let (before, after) = (to_f64(points[sample.before as usize]), to_f64(points[sample.after as usize]));
        before + (after - before) * f64::from(sample.fraction)
    };
    for (piece, ends) in pieces.iter_mut().zip(samples.windows(2)) {
        piece.chord = at(&ends[1]) - at(&ends[0]);
        piece.length = along(points, &ends[0], &ends[1], &at);
    }
}

/// Length along a guide from one sample to another, metres.
fn along(points: &[[f32; 3]], from: &CurveSample, to: &CurveSample, at: &impl Fn(&CurveSample) -> DVec3) -> f64 {
    let between = from.before + 1..=to.before;
    let mut here = at(from);
    let mut sum = 0.0;
    for cv in between {
        let next = to_f64(points[cv as usize]);
        sum += (next - here).norm();
        here = next;
    }
    sum + (at(to) - here).norm()
}
