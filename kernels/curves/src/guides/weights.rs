//! The guides that each hair is blended from, and their weights.

use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::tree::{Block, NONE, TriangleTree};
use numerics::vector::{self, Quat, Vec3, largest, power_of_two_to_one, to_f64};

/// Largest number of guides that a hair is blended from.
pub const MAX_GUIDES: usize = 32;

/// A point with the skin's unit normal there; a zero normal is unknown and counts as perpendicular to all others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedPoint {
    /// Metres.
    pub position: Vec3,
    /// Of length 1, or zero.
    pub normal: Vec3,
}

/// The contribution of one guide to a hair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideWeight {
    /// Index of the guide.
    pub guide: u32,
    /// Its weight; those of one hair sum to 1, or to less after [`GuideWeights::within`].
    pub weight: f32,
    /// Rotation from the guide's frame to the hair's, at rest.
    pub rotation: Quat,
}

/// The guides that each hair is blended from, and their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct GuideWeights {
    per_hair: usize,
    weights: Vec<GuideWeight>,
}

impl GuideWeights {
    /// The guides of a hair, by decreasing weight.
    pub fn of(&self, hair: usize) -> &[GuideWeight] {
        &self.weights[hair * self.per_hair..(hair + 1) * self.per_hair]
    }

    /// The weights that are left where guides act within `radius` metres alone: each is scaled by (1 − (d ÷ radius)²)²,
    /// d being the distance of the guide as weights count it. `guides` and `hairs` are those of the weights.
    ///
    /// # Panics
    /// If there are fewer `guides` or `hairs`.
    #[must_use]
    pub fn within(mut self, guides: &[OrientedPoint], hairs: &[OrientedPoint], radius: f32) -> Self {
        if self.per_hair > 0 {
            for (weights, hair) in self.weights.chunks_mut(self.per_hair).zip(hairs) {
                for weight in weights {
                    let guide = &guides[weight.guide as usize];
                    let away = vector::length(vector::sub(guide.position, hair.position));
                    let share = apparent(away, vector::dot(guide.normal, hair.normal)) / radius;
                    let left = if share < 1.0 { 1.0 - share * share } else { 0.0 };
                    weight.weight *= left * left;
                }
            }
        }
        self
    }

    /// Number of hairs; 0 without guides.
    pub fn hairs(&self) -> usize {
        self.weights.len().checked_div(self.per_hair).unwrap_or(0)
    }
}

/// Number of hairs in a task: some 50 µs of work.
const TASK: usize = 128;

/// Added to 1 + cos: a guide that faces the opposite direction counts as two thousand times as far, not as infinitely
/// far.
const BEHIND: f32 = 1e-3;

/// For each of `hairs` the weights of its `count` (1 to [`MAX_GUIDES`]) nearest guides, or of all if there are fewer.
pub fn guide_weights(guides: &[OrientedPoint], hairs: &[OrientedPoint], count: usize) -> GuideWeights {
    guide_weights_on(Path::chosen(), guides, hairs, count)
}

/// [`guide_weights`] on a given SIMD path.
pub(super) fn guide_weights_on(
    path: Path,
    guides: &[OrientedPoint],
    hairs: &[OrientedPoint],
    count: usize,
) -> GuideWeights {
    let per_hair = count.clamp(1, MAX_GUIDES).min(guides.len());
    let blank = GuideWeight { guide: 0, weight: 0.0, rotation: vector::IDENTITY };
    let mut weights = vec![blank; per_hair * hairs.len()];
    if per_hair > 0 {
        let search = GuideSearch::new(guides, hairs);
        let tasks = weights.chunks_mut(per_hair * TASK).zip(hairs.chunks(TASK));
        parallel::for_each(tasks, |_, (weights, hairs)| weigh_chunk(path, &search, hairs, per_hair, weights));
    }
    GuideWeights { per_hair, weights }
}

kernel! {
    fn weigh_chunk(
        search: &GuideSearch<'_>,
        hairs: &[OrientedPoint],
        per_hair: usize,
        weights: &mut [GuideWeight],
    ) -> () = chunk;
}

#[inline(always)]
fn chunk(search: &GuideSearch<'_>, hairs: &[OrientedPoint], per_hair: usize, weights: &mut [GuideWeight]) {
    let mut reach = search.first_reach;
    let mut before = hairs.first().map_or([0.0; 3], |hair| hair.position);
    for (hair, weights) in hairs.iter().zip(weights.chunks_mut(per_hair)) {
        // First guess of the search radius: that of the previous hair plus the distance from it. It does not affect
        // results.
        let moved = vector::length(vector::scale(vector::sub(hair.position, before), search.unit));
        let moved = if moved < reach { moved } else { reach };
        let nearest = search.nearest(hair, per_hair + 1, (reach + moved) * GUESS);
        reach = nearest.reach();
        before = hair.position;
        weigh(&nearest, search.guides, hair, weights);
    }
}

/// On a curved skin distances grow by more than the distance between two hairs.
const GUESS: f32 = 1.05;

/// The guides' roots, to be searched.
struct GuideSearch<'a> {
    guides: &'a [OrientedPoint],
    tree: TriangleTree,
    /// Positions and normals of the guides in each block of the tree.
    normals: Vec<Lanes<3>>,
    /// In which block each guide is.
    block_of: Vec<u32>,
    origin: Vec3,
    /// Scales the whole to a size of about 1.
    unit: f32,
    first_reach: f32,
}

impl<'a> GuideSearch<'a> {
    fn new(guides: &'a [OrientedPoint], hairs: &[OrientedPoint]) -> Self {
        let finite = |point: &&OrientedPoint| point.position.iter().all(|x| x.is_finite());
        let origin = guides.iter().find(finite).map_or([0.0; 3], |guide| guide.position);
        let all = guides.iter().chain(hairs).filter(finite);
        let size = all.map(|point| largest(vector::sub(point.position, origin))).fold(0.0, f32::max);
        let (unit, _) = power_of_two_to_one(size);
        let points: Vec<Vec3> =
            guides.iter().map(|guide| vector::scale(vector::sub(guide.position, origin), unit)).collect();
        let corners: Vec<[u32; 3]> = (0..guides.len() as u32).map(|guide| [guide; 3]).collect();
        let tree = TriangleTree::build(&points, &corners);
        let mut normals = vec![[F32x16::splat(0.0); 3]; tree.blocks().len()];
        let mut block_of = vec![0; guides.len()];
        for (row, block) in tree.blocks().iter().enumerate() {
            for (lane, guide) in block.triangle.into_iter().enumerate().filter(|(_, guide)| *guide != NONE) {
                set(&mut normals[row], lane, guides[guide as usize].normal);
                block_of[guide as usize] = row as u32;
            }
        }
        let first_reach = 4.0 / (guides.len() as f32).sqrt();
        Self { guides, tree, normals, block_of, origin, unit, first_reach }
    }

    /// The `count` nearest guides, or all if there are fewer; of equally near ones the first.
    #[inline(always)]
    fn nearest(&self, hair: &OrientedPoint, count: usize, guess: f32) -> Nearest {
        let at = vector::scale(vector::sub(hair.position, self.origin), self.unit);
        let mut reach = guess;
        loop {
            // Everything lies within 8 of everything else.
            let all = reach >= FARTHEST || !reach.is_finite();
            // Finite, because an infinite box would meet blank lanes.
            let reached = if all { f32::MAX } else { reach };
            let mut nearest = Nearest::new(count, reached);
            self.tree.visit_box(at.map(|x| x - reached), at.map(|x| x + reached), |block, lanes| {
                let distances = self.distances(block, hair.normal, at);
                for lane in 0..LANES {
                    if lanes >> lane & 1 == 1 && distances.0[lane] <= nearest.limit {
                        nearest.add(block.triangle[lane], distances.0[lane]);
                    }
                }
            });
            if nearest.len == nearest.count || all {
                return nearest;
            }
            reach = if reach > 0.0 { 2.0 * reach } else { self.first_reach };
        }
    }

    /// The distance at which each guide of a block counts.
    #[inline(always)]
    fn distances(&self, block: &Block, normal: Vec3, at: Vec3) -> F32x16 {
        // A guide that is not finite leaves its lane blank; a block of blank lanes is never met.
        let guide = block.triangle.into_iter().find(|guide| *guide != NONE);
        let normals = &self.normals[guide.map_or(0, |guide| self.block_of[guide as usize] as usize)];
        let mut distances = F32x16::splat(0.0);
        for lane in 0..LANES {
            let away = vector::length(vector::sub(get(&block.corners[0], lane), at));
            distances.0[lane] = apparent(away, vector::dot(get(normals, lane), normal));
        }
        distances
    }
}

/// The distance at which a guide counts that is `away`, given the cosine of the angle between the normals.
#[inline(always)]
fn apparent(away: f32, cosine: f32) -> f32 {
    let cosine = if cosine < 1.0 { cosine } else { 1.0 };
    let cosine = if cosine > -1.0 { cosine } else { -1.0 };
    away * ((2.0 + BEHIND) / (1.0 + cosine + BEHIND))
}

/// Larger than any distance between two points, in units of the search.
const FARTHEST: f32 = 8.0;

/// The nearest guides so far, nearest first.
struct Nearest {
    found: [(f32, u32); MAX_GUIDES + 1],
    len: usize,
    count: usize,
    /// Guides farther than this are ignored.
    limit: f32,
}

impl Nearest {
    #[inline(always)]
    fn new(count: usize, reach: f32) -> Self {
        Self { found: [(f32::INFINITY, u32::MAX); MAX_GUIDES + 1], len: 0, count, limit: reach }
    }

    #[inline(always)]
    fn add(&mut self, guide: u32, distance: f32) {
        let new = (distance, guide);
        if self.len == self.count && new >= self.found[self.len - 1] {
            return;
        }
        let mut rank = self.len.min(self.count - 1);
        self.len = rank + 1;
        while rank > 0 && new < self.found[rank - 1] {
            self.found[rank] = self.found[rank - 1];
            rank -= 1;
        }
        self.found[rank] = new;
        if self.len == self.count {
            self.limit = self.found[self.len - 1].0;
        }
    }

    /// Distance of the farthest of them.
    #[inline(always)]
    fn reach(&self) -> f32 {
        if self.len == 0 { 0.0 } else { self.found[self.len - 1].0 }
    }
}

/// Fills in a hair's weights.
#[inline(always)]
fn weigh(nearest: &Nearest, guides: &[OrientedPoint], hair: &OrientedPoint, out: &mut [GuideWeight]) {
    let found = &nearest.found[..out.len().min(nearest.len)];
    let weights = shepard_weights(found, (nearest.len > out.len()).then(|| nearest.reach()));
    for (out, ((_, guide), weight)) in out.iter_mut().zip(found.iter().zip(weights)) {
        let rotation = least_rotation(guides[*guide as usize].normal, hair.normal);
        *out = GuideWeight { guide: *guide, weight: weight as f32, rotation };
    }
}

/// Weights of guides, nearest first; `beyond` is the distance of the next one, if any.
#[inline(always)]
fn shepard_weights(found: &[(f32, u32)], beyond: Option<f32>) -> [f64; MAX_GUIDES] {
    let mut weights = [0.0; MAX_GUIDES];
    let least = f64::from(found.first().map_or(0.0, |nearest| nearest.0));
    let mut sum = 0.0;
    for (weight, (distance, _)) in weights.iter_mut().zip(found) {
        let distance = f64::from(*distance);
        *weight = if least == 0.0 {
            // The hair is rooted where one or several guides are.
            if distance == 0.0 { 1.0 } else { 0.0 }
        } else {
            // Scaled by the square of the smallest distance, so that none overflows.
            let fade = beyond.map_or(1.0, |beyond| 1.0 - distance / f64::from(beyond));
            let share = fade * (least / distance);
            share * share
        };
        sum += *weight;
    }
    let equal = 1.0 / found.len() as f64;
    for weight in &mut weights[..found.len()] {
        *weight = if sum > 0.0 { *weight / sum } else { equal };
    }
    weights
}

/// The smallest rotation from one unit vector to another; about any perpendicular axis if they are opposite, the
/// identity if one is zero.
fn least_rotation(from: Vec3, to: Vec3) -> Quat {
    if from == to || from == [0.0; 3] || to == [0.0; 3] {
        return vector::IDENTITY;
    }
    let (a, b) = (to_f64(from), to_f64(to));
    let axis = a.cross(&b);
    let w = 1.0 + a.dot(&b);
    let square = axis.norm_squared() + w * w;
    if square < OPPOSITE {
        let [x, y, z] = vector::perpendicular(from);
        return [x, y, z, 0.0];
    }
    let length = square.sqrt();
    [axis.x, axis.y, axis.z, w].map(|part| (part / length) as f32)
}

/// Below this, of the square of the unnormalised quaternion's length (4 for equal directions): directions are 1e-5 rad
/// from opposite, and their cross product has lost half of its digits.
const OPPOSITE: f64 = 1e-10;

#[cfg(test)]
pub(super) fn weights_of(distances: &[f32], beyond: Option<f32>) -> Vec<f64> {
    let found: Vec<(f32, u32)> = distances.iter().enumerate().map(|(k, d)| (*d, k as u32)).collect();
    shepard_weights(&found, beyond)[..found.len()].to_vec()
}
