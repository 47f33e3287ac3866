//! The guides of hairs as the kernel reads them: sixteen hairs side by side, each segment's place on its guides looked up
//! once, since both are the same at every frame.

use super::turns::{GuideSegments, NO_GUIDE, segment_middles};
use crate::guides::GuideWeights;
use numerics::lanes::{F32x16, LANES, Lanes, set};
use numerics::parallel;

/// The guides of hairs, where along them the hairs' segments are, and the hairs at rest.
///
/// 24 bytes for each guide of a hair, 8 for each guide of a segment, and 12 for each CV; hairs with fewer than the longest
/// of the sixteen beside them take as much as that one.
#[derive(Clone, Debug, PartialEq)]
pub struct HairGuides {
    per_hair: usize,
    /// Of each sixteen hairs, the guides by decreasing weight.
    guides: Vec<LaneGuides>,
    /// Of each sixteen hairs and each of their segments, one for each guide.
    places: Vec<LanePlaces>,
    /// The first of each sixteen hairs' places, and their number.
    firsts: Vec<usize>,
    /// Of each sixteen hairs the CVs at rest, metres; hairs with fewer repeat their last.
    rest: Vec<Lanes<3>>,
    /// The first of each sixteen hairs' CVs, and their number.
    rest_firsts: Vec<usize>,
}

/// What is known of sixteen hairs.
pub(super) struct KnownLanes<'a> {
    pub(super) guides: &'a [LaneGuides],
    pub(super) places: &'a [LanePlaces],
    pub(super) rest: &'a [Lanes<3>],
}

/// One guide of each of sixteen hairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LaneGuides {
    /// 1 + the index of the guide; 0 for none.
    pub(super) guide: [u32; LANES],
    pub(super) weight: F32x16,
    /// From the guide's frame to the hair's, at rest: x, y, z, w.
    pub(super) rotation: [F32x16; 4],
}

/// Places on one guide of each of sixteen hairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LanePlaces {
    /// Rows of [`GuideSegments`].
    pub(super) rows: [u32; LANES],
    /// How far each is towards the row after it, 0..1.
    pub(super) shares: F32x16,
}

/// Sixteens of hairs in a task.
const TASK: usize = 16;

impl HairGuides {
    /// Those of the hairs `rest[starts[i]..starts[i + 1]]`, with these weights of guides with these segments.
    ///
    /// # Panics
    /// If `starts` does not run from 0 to the number of points, or if there are weights of other hairs or guides.
    pub fn of(weights: &GuideWeights, segments: &GuideSegments, starts: &[u32], rest: &[[f32; 3]]) -> Self {
        let hairs = starts.len().saturating_sub(1);
        let per_hair = if weights.hairs() == 0 { 0 } else { weights.of(0).len() };
        let middles = segment_middles(starts, rest);
        let parts = parallel::tabulate(hairs.div_ceil(LANES), TASK, |sixteen| {
            let first = sixteen * LANES;
            let hairs = first..hairs.min(first + LANES);
            let of_hair = |hair: usize| {
                // Hairs before this one have a segment less than CVs.
                let (from, to) =
                    (starts[hair] as usize - hair, (starts[hair + 1] as usize).max(starts[hair] as usize + 1));
                &middles[from..to - 1 - hair]
            };
            let cvs = lanes_of(hairs.clone().map(|hair| &rest[starts[hair] as usize..starts[hair + 1] as usize]));
            let mut guides = vec![LaneGuides::NONE; per_hair];
            let most = hairs.clone().map(|hair| of_hair(hair).len()).max().unwrap_or(0);
            let mut places = vec![LanePlaces::NONE; most * per_hair];
            for (lane, hair) in hairs.enumerate().filter(|_| per_hair > 0) {
                for (rank, weight) in weights.of(hair).iter().enumerate().filter(|(_, weight)| weight.weight > 0.0) {
                    let mine = &mut guides[rank];
                    mine.guide[lane] = weight.guide + 1;
                    mine.weight.0[lane] = weight.weight;
                    for part in 0..4 {
                        mine.rotation[part].0[lane] = weight.rotation[part];
                    }
                    let mut row = segments.first(weight.guide as usize);
                    for (segment, middle) in of_hair(hair).iter().enumerate() {
                        let place = &mut places[segment * per_hair + rank];
                        let share;
                        (row, share) = segments.place(row, *middle);
                        (place.rows[lane], place.shares.0[lane]) = (row, share as f32);
                    }
                }
            }
            (guides, places, cvs)
        });
        let (guides, places, cvs) = (Vec::new(), Vec::new(), Vec::new());
        let mut all = Self { per_hair, guides, places, firsts: vec![0], rest: cvs, rest_firsts: vec![0] };
        all.guides.reserve_exact(parts.len() * per_hair);
        all.places.reserve_exact(parts.iter().map(|(_, places, _)| places.len()).sum());
        all.rest.reserve_exact(parts.iter().map(|(.., cvs)| cvs.len()).sum());
        for (guides, places, cvs) in parts {
            all.guides.extend(guides);
            all.places.extend(places);
            all.firsts.push(all.places.len());
            all.rest.extend(cvs);
            all.rest_firsts.push(all.rest.len());
        }
        all
    }

    /// The hairs from `first`, a multiple of sixteen, on.
    #[inline(always)]
    pub(super) fn lanes(&self, first: usize) -> KnownLanes<'_> {
        let sixteen = first / LANES;
        KnownLanes {
            guides: &self.guides[sixteen * self.per_hair..(sixteen + 1) * self.per_hair],
            places: &self.places[self.firsts[sixteen]..self.firsts[sixteen + 1]],
            rest: &self.rest[self.rest_firsts[sixteen]..self.rest_firsts[sixteen + 1]],
        }
    }
}

/// Up to sixteen curves side by side; those with fewer CVs repeat their last.
fn lanes_of<'a>(curves: impl Iterator<Item = &'a [[f32; 3]]> + Clone) -> Vec<Lanes<3>> {
    let most = curves.clone().map(<[_]>::len).max().unwrap_or(0);
    let mut lanes = vec![[F32x16::splat(0.0); 3]; most];
    for (lane, curve) in curves.enumerate() {
        for (k, cv) in lanes.iter_mut().enumerate() {
            if let Some(point) = curve.get(k).or(curve.last()) {
                set(cv, lane, *point);
            }
        }
    }
    lanes
}

impl LaneGuides {
    const NONE: Self = Self {
        guide: [0; LANES],
        weight: F32x16([0.0; LANES]),
        rotation: [F32x16([0.0; LANES]), F32x16([0.0; LANES]), F32x16([0.0; LANES]), F32x16([1.0; LANES])],
    };
}

impl LanePlaces {
    const NONE: Self = Self { rows: [NO_GUIDE; LANES], shares: F32x16([0.0; LANES]) };
}
