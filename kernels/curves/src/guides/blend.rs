//! Blending the shapes and attributes of guides.

use super::resample::ResampledGuides;
use super::weights::{GuideWeight, GuideWeights};
use crate::attach::{RootPose, rotate_orientation};
use nalgebra::{Quaternion, Unit};
use numerics::parallel;
use numerics::vector::{DQuat, DVec3, Quat, to_f32, to_f64};

/// What hairs are blended from, and their current positions.
#[derive(Clone, Copy, Debug)]
pub struct HairBlend<'a> {
    /// The guides of each hair.
    pub weights: &'a GuideWeights,
    /// The hairs' roots now, metres.
    pub roots: &'a [DVec3],
    /// How the roots of hairs and guides have moved and rotated since rest; `None` if the skin is at rest.
    pub poses: Option<HairAndGuidePoses<'a>>,
}

/// Poses of the hairs, and of the guides.
pub type HairAndGuidePoses<'a> = (&'a [RootPose], &'a [RootPose]);

/// Blended hairs, and how well their lengths are kept.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct BlendedHairs {
    /// The hairs' points, root first, hair by hair, metres.
    pub points: Vec<[f32; 3]>,
    /// Largest difference between a hair's length, measured on the result, and the blend of its guides' lengths,
    /// relative to the latter.
    pub length_error: f64,
}

/// Number of hairs in a task, and of rows of an attribute: some 30 µs of work.
const TASK: usize = 64;
const ROW_TASK: usize = 512;

/// Below this fraction of the guides' own lengths the sum of their segments is rounding error and has no direction.
const CANCELLED: f64 = 1e-9;

/// Hairs blended from the current shapes of `guides`.
///
/// # Panics
/// If a slice is shorter than the hairs or guides.
pub fn blend_hairs(guides: ResampledGuides, blend: &HairBlend) -> BlendedHairs {
    // The rotation of each guide's own root is undone, so that shapes are blended at rest.
    let guides = match blend.poses {
        None => guides,
        Some((_, poses)) => guides.with_chords(|guide, chord| poses[guide].rotation.inverse() * chord),
    };
    let cvs = guides.segments() + 1;
    let mut points = vec![[0.0; 3]; blend.roots.len() * cvs];
    let blend_hair = |(hair, points): (usize, &mut [[f32; 3]])| {
        let mut at = blend.roots[hair];
        points[0] = to_f32(at);
        let (mut asked, mut written) = (0.0, 0.0);
        for segment in 0..guides.segments() {
            let (direction, length) = mixed_segment(&guides, blend.weights.of(hair), segment);
            let direction = match blend.poses {
                None => direction,
                Some((poses, _)) => poses[hair].rotation * direction,
            };
            at += direction * length;
            points[segment + 1] = to_f32(at);
            asked += length;
            written += (to_f64(points[segment + 1]) - to_f64(points[segment])).norm();
        }
        if asked > 0.0 { ((written - asked) / asked).abs() } else { 0.0 }
    };
    let errors = parallel::map(points.chunks_mut(TASK * cvs), |task, points| {
        (task * TASK..).zip(points.chunks_mut(cvs)).map(blend_hair).fold(0.0, f64::max)
    });
    BlendedHairs { points, length_error: errors.into_iter().fold(0.0, f64::max) }
}

/// Direction and length of a hair's segment in its frame at rest.
#[inline(always)]
fn mixed_segment(guides: &ResampledGuides, weights: &[GuideWeight], segment: usize) -> (DVec3, f64) {
    let (mut sum, mut lengths, mut chords) = (DVec3::zeros(), 0.0, 0.0);
    let mut heaviest = DVec3::zeros();
    for guide in weights.iter().filter(|guide| guide.weight > 0.0) {
        let weight = f64::from(guide.weight);
        let piece = &guides.pieces(guide.guide as usize)[segment];
        let chord = to_rotation(guide.rotation) * piece.chord;
        if heaviest == DVec3::zeros() {
            heaviest = chord;
        }
        sum += chord * weight;
        lengths += weight * piece.length;
        chords += weight * piece.chord.norm();
    }
    let size = sum.norm();
    if size > CANCELLED * chords {
        return (sum * (1.0 / size), lengths);
    }
    let size = heaviest.norm();
    (if size > 0.0 { heaviest * (1.0 / size) } else { heaviest }, lengths)
}

fn to_rotation(rotation: Quat) -> DQuat {
    let [x, y, z, w] = rotation.map(f64::from);
    Unit::new_unchecked(Quaternion::new(w, x, y, z))
}

/// The owner of an attribute's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveDomain {
    /// One row for each CV.
    Point,
    /// One row for each curve.
    Curve,
}

impl HairBlend<'_> {
    /// Blended numbers.
    ///
    /// # Panics
    /// As [`blend_hairs`].
    pub fn numbers<const N: usize>(
        &self,
        guides: &ResampledGuides,
        rows: &[[f32; N]],
        of: CurveDomain,
    ) -> Vec<[f32; N]> {
        self.each(guides, of, [0.0; N], |hair, cv| {
            let mut sum = [0.0_f64; N];
            for guide in self.weights.of(hair).iter().filter(|guide| guide.weight > 0.0) {
                let row = row_at(guides, rows, of, guide.guide, cv);
                for k in 0..N {
                    sum[k] += f64::from(guide.weight) * row[k];
                }
            }
            sum.map(|x| x as f32)
        })
    }

    /// Blended vectors, rotated from frame to frame as segments are.
    ///
    /// # Panics
    /// As [`blend_hairs`].
    pub fn vectors(&self, guides: &ResampledGuides, rows: &[[f32; 3]], of: CurveDomain) -> Vec<[f32; 3]> {
        self.each(guides, of, [0.0; 3], |hair, cv| {
            let mut sum = DVec3::zeros();
            for guide in self.weights.of(hair).iter().filter(|guide| guide.weight > 0.0) {
                let row = DVec3::from(row_at(guides, rows, of, guide.guide, cv));
                sum += self.rotation(hair, guide) * row * f64::from(guide.weight);
            }
            to_f32(sum)
        })
    }

    /// Orientations (quaternions x, y, z, w): those of the guide with the largest weight, rotated from frame to frame.
    ///
    /// # Panics
    /// As [`blend_hairs`].
    pub fn orientations(&self, guides: &ResampledGuides, rows: &[[f32; 4]], of: CurveDomain) -> Vec<[f32; 4]> {
        let heaviest = self.heaviest(guides, of);
        let per_hair = if of == CurveDomain::Point { guides.segments() + 1 } else { 1 };
        let mut rotated = vec![[0.0; 4]; heaviest.len()];
        parallel::fill(&mut rotated, ROW_TASK, |at| {
            let hair = at / per_hair;
            rotate_orientation(&self.rotation(hair, &self.weights.of(hair)[0]), rows[heaviest[at] as usize])
        });
        rotated
    }

    /// For values that cannot be blended: for each row of the hairs, the row of the guide with the largest weight.
    ///
    /// # Panics
    /// As [`blend_hairs`].
    pub fn heaviest(&self, guides: &ResampledGuides, of: CurveDomain) -> Vec<u32> {
        self.each(guides, of, 0, |hair, cv| {
            let guide = self.weights.of(hair)[0].guide;
            match of {
                CurveDomain::Curve => guide,
                CurveDomain::Point => {
                    let sample = guides.samples(guide as usize)[cv];
                    if sample.fraction < 0.5 { sample.before } else { sample.after }
                }
            }
        })
    }

    /// The rotation from a guide's current frame to a hair's.
    fn rotation(&self, hair: usize, guide: &GuideWeight) -> DQuat {
        let rest = to_rotation(guide.rotation);
        match self.poses {
            None => rest,
            Some((hairs, guides)) => hairs[hair].rotation * (rest * guides[guide.guide as usize].rotation.inverse()),
        }
    }

    /// Evaluates a row for each CV of the hairs, given the index of its hair and that of the CV within it; `blank` is
    /// any row.
    fn each<T: Copy + Send>(
        &self,
        guides: &ResampledGuides,
        of: CurveDomain,
        blank: T,
        row: impl Fn(usize, usize) -> T + Sync,
    ) -> Vec<T> {
        let per_hair = if of == CurveDomain::Point { guides.segments() + 1 } else { 1 };
        let mut rows = vec![blank; self.roots.len() * per_hair];
        parallel::fill(&mut rows, ROW_TASK, |at| row(at / per_hair, at % per_hair));
        rows
    }
}

/// The row of a guide at a hair's CV.
fn row_at<const N: usize>(
    guides: &ResampledGuides,
    rows: &[[f32; N]],
    of: CurveDomain,
    guide: u32,
    cv: usize,
) -> [f64; N] {
    match of {
        CurveDomain::Curve => rows[guide as usize].map(f64::from),
        CurveDomain::Point => {
            let sample = guides.samples(guide as usize)[cv];
            let (before, after) = (rows[sample.before as usize], rows[sample.after as usize]);
            std::array::from_fn(|k| {
                let before = f64::from(before[k]);
                before + (f64::from(after[k]) - before) * f64::from(sample.fraction)
            })
        }
    }
}
