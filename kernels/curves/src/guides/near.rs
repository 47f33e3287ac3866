//! Which guides a hair is made of, and how much of each.

use super::Share as Part;
use crate::attach::vectors::{cross, dot, wide};
use numerics::lanes::{F32x16, LANES, Lanes, get, set};
use numerics::simd::{Path, kernel};
use numerics::tree::{Block, NONE, TriangleTree};
use numerics::vector::{self, Vec3, largest, power_of_two_to_one};
use rayon::prelude::*;

/// Most guides that a hair is mixed of.
pub const MOST_GUIDES: usize = 32;

/// Where a root is at rest, and the skin's unit normal there (zero: unknown, taken to lie across all others).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// Metres.
    pub at: Vec3,
    /// Of length 1.
    pub normal: Vec3,
}

/// What one guide gives to one hair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Which guide.
    pub guide: u32,
    /// Of all its hair's shares, which are 1 together.
    pub weight: f32,
    /// From the guide's frame to the hair's, at rest: a unit quaternion x, y, z, w.
    pub turn: [f32; 4],
}

/// What hairs are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Mix {
    per_hair: usize,
    shares: Vec<Share>,
}

impl Mix {
    /// The shares of a hair, heaviest first.
    pub fn of(&self, hair: usize) -> &[Share] {
        &self.shares[hair * self.per_hair..(hair + 1) * self.per_hair]
    }

    /// Number of hairs; none without guides.
    pub fn hairs(&self) -> usize {
        self.shares.len().checked_div(self.per_hair).unwrap_or(0)
    }
}

/// Hairs that a task looks around from: some 50 µs of work.
const TASK: usize = 128;

/// Added to 1 + cos: a guide that faces exactly the other way is two thousand times as far, not infinitely.
const BEHIND: f32 = 1e-3;

/// The mix of each of `hairs` from its `count` (1 to [`MOST_GUIDES`]) nearest guides, or all where they are fewer.
pub fn mix(guides: &[Stand], hairs: &[Stand], count: usize) -> Mix {
    mix_on(Path::chosen(), guides, hairs, count)
}

/// [`mix()`] on a given SIMD path.
pub(super) fn mix_on(path: Path, guides: &[Stand], hairs: &[Stand], count: usize) -> Mix {
    let per_hair = count.clamp(1, MOST_GUIDES).min(guides.len());
    let blank = Share { guide: 0, weight: 0.0, turn: vector::IDENTITY };
    let mut shares = vec![blank; per_hair * hairs.len()];
    if per_hair > 0 {
        let field = Field::new(guides, hairs);
        let tasks = shares.par_chunks_mut(per_hair * TASK).zip(hairs.par_chunks(TASK));
        tasks.for_each(|(shares, hairs)| mix_chunk(path, &field, hairs, per_hair, shares));
    }
    Mix { per_hair, shares }
}

kernel! {
    fn mix_chunk(field: &Field<'_>, hairs: &[Stand], per_hair: usize, shares: &mut [Part]) = chunk;
}

#[inline(always)]
fn chunk(field: &Field<'_>, hairs: &[Stand], per_hair: usize, shares: &mut [Share]) {
    let mut reach = field.first_reach;
    let mut before = hairs.first().map_or([0.0; 3], |hair| hair.at);
    for (hair, shares) in hairs.iter().zip(shares.chunks_mut(per_hair)) {
        // As far as the hair before had to look, and as far as this one is from it: a guess, which changes no answer.
        let moved = vector::length(vector::scale(vector::sub(hair.at, before), field.unit));
        let moved = if moved < reach { moved } else { reach };
        let nearest = field.nearest(hair, per_hair + 1, (reach + moved) * GUESS);
        reach = nearest.reach();
        before = hair.at;
        weigh(&nearest, field.guides, hair, shares);
    }
}

/// On a curved skin distances grow by more than the way between two hairs.
const GUESS: f32 = 1.05;

/// The guides' roots, to be searched.
struct Field<'a> {
    guides: &'a [Stand],
    tree: TriangleTree,
    /// Of the guides of each block of the tree.
    normals: Vec<Lanes<3>>,
    /// Which block a guide is in.
    row_of: Vec<u32>,
    from: Vec3,
    /// Brings the field to a size of about 1.
    unit: f32,
    first_reach: f32,
}

impl<'a> Field<'a> {
    fn new(guides: &'a [Stand], hairs: &[Stand]) -> Self {
        let finite = |stand: &&Stand| stand.at.iter().all(|x| x.is_finite());
        let from = guides.iter().find(finite).map_or([0.0; 3], |stand| stand.at);
        let all = guides.iter().chain(hairs).filter(finite);
        let size = all.map(|stand| largest(vector::sub(stand.at, from))).fold(0.0, f32::max);
        let (unit, _) = power_of_two_to_one(size);
        let points: Vec<Vec3> = guides.iter().map(|guide| vector::scale(vector::sub(guide.at, from), unit)).collect();
        let spots: Vec<[u32; 3]> = (0..guides.len() as u32).map(|guide| [guide; 3]).collect();
        let tree = TriangleTree::build(&points, &spots);
        let mut normals = vec![[F32x16::splat(0.0); 3]; tree.blocks().len()];
        let mut row_of = vec![0; guides.len()];
        for (row, block) in tree.blocks().iter().enumerate() {
            for (lane, guide) in block.triangle.into_iter().enumerate().filter(|(_, guide)| *guide != NONE) {
                set(&mut normals[row], lane, guides[guide as usize].normal);
                row_of[guide as usize] = row as u32;
            }
        }
        let first_reach = 4.0 / (guides.len() as f32).sqrt();
        Self { guides, tree, normals, row_of, from, unit, first_reach }
    }

    /// The `count` nearest guides (all, where they are fewer), of equals the first.
    #[inline(always)]
    fn nearest(&self, hair: &Stand, count: usize, guess: f32) -> Nearest {
        let at = vector::scale(vector::sub(hair.at, self.from), self.unit);
        let mut reach = guess;
        loop {
            // Everything lies within 8 of everything else.
            let all = reach >= FARTHEST || !reach.is_finite();
            // Not infinite: a blank box would meet that.
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

    /// How far each guide of a block counts as being.
    #[inline(always)]
    fn distances(&self, block: &Block, normal: Vec3, at: Vec3) -> F32x16 {
        // A guide that is not finite leaves its lane blank; a block of such alone is never met.
        let guide = block.triangle.into_iter().find(|guide| *guide != NONE);
        let normals = &self.normals[guide.map_or(0, |guide| self.row_of[guide as usize] as usize)];
        let mut distances = F32x16::splat(0.0);
        for lane in 0..LANES {
            let away = vector::length(vector::sub(get(&block.corners[0], lane), at));
            let cosine = vector::dot(get(normals, lane), normal);
            let cosine = if cosine < 1.0 { cosine } else { 1.0 };
            let cosine = if cosine > -1.0 { cosine } else { -1.0 };
            distances.0[lane] = away * ((2.0 + BEHIND) / (1.0 + cosine + BEHIND));
        }
        distances
    }
}

/// Above what any two places of a field are apart, in its unit.
const FARTHEST: f32 = 8.0;

/// The nearest guides so far, nearest first.
struct Nearest {
    found: [(f32, u32); MOST_GUIDES + 1],
    len: usize,
    count: usize,
    /// What is farther has no place.
    limit: f32,
}

impl Nearest {
    #[inline(always)]
    fn new(count: usize, reach: f32) -> Self {
        Self { found: [(f32::INFINITY, u32::MAX); MOST_GUIDES + 1], len: 0, count, limit: reach }
    }

    #[inline(always)]
    fn add(&mut self, guide: u32, distance: f32) {
        let new = (distance, guide);
        if self.len == self.count && new >= self.found[self.len - 1] {
            return;
        }
        let mut place = self.len.min(self.count - 1);
        self.len = place + 1;
        while place > 0 && new < self.found[place - 1] {
            self.found[place] = self.found[place - 1];
            place -= 1;
        }
        self.found[place] = new;
        if self.len == self.count {
            self.limit = self.found[self.len - 1].0;
        }
    }

    /// Distance of the farthest.
    #[inline(always)]
    fn reach(&self) -> f32 {
        if self.len == 0 { 0.0 } else { self.found[self.len - 1].0 }
    }
}

/// Fills in a hair's shares.
#[inline(always)]
fn weigh(nearest: &Nearest, guides: &[Stand], hair: &Stand, shares: &mut [Share]) {
    let found = &nearest.found[..shares.len().min(nearest.len)];
    let weights = weights(found, (nearest.len > shares.len()).then(|| nearest.reach()));
    for (share, ((_, guide), weight)) in shares.iter_mut().zip(found.iter().zip(weights)) {
        let turn = least_turn(guides[*guide as usize].normal, hair.normal);
        *share = Share { guide: *guide, weight: weight as f32, turn };
    }
}

/// Weights of guides, nearest first, where `beyond` is the distance of the next one, if there is one.
#[inline(always)]
fn weights(found: &[(f32, u32)], beyond: Option<f32>) -> [f64; MOST_GUIDES] {
    let mut weights = [0.0; MOST_GUIDES];
    let least = f64::from(found.first().map_or(0.0, |nearest| nearest.0));
    let mut sum = 0.0;
    for (weight, (distance, _)) in weights.iter_mut().zip(found) {
        let distance = f64::from(*distance);
        *weight = if least == 0.0 {
            // The hair stands where a guide does, or several.
            if distance == 0.0 { 1.0 } else { 0.0 }
        } else {
            // Times the square of the least distance, so that none overflows.
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

/// The least turn that brings one unit vector to another; about any axis across where they are opposite, none where one
/// is unknown.
fn least_turn(from: Vec3, to: Vec3) -> [f32; 4] {
    if from == to || from == [0.0; 3] || to == [0.0; 3] {
        return vector::IDENTITY;
    }
    let (a, b) = (wide(from), wide(to));
    let [x, y, z] = cross(a, b);
    let w = 1.0 + dot(a, b);
    let square = x * x + y * y + z * z + w * w;
    if square < OPPOSITE {
        let [x, y, z] = vector::perpendicular(from);
        return [x, y, z, 0.0];
    }
    let length = square.sqrt();
    [x, y, z, w].map(|part| (part / length) as f32)
}

/// Of the square of the half turn's length, 4 where there is no turn: here directions are 1e-5 rad from opposite, and
/// their cross product has lost half of its digits.
const OPPOSITE: f64 = 1e-10;

#[cfg(test)]
pub(super) fn weights_of(distances: &[f32], beyond: Option<f32>) -> Vec<f64> {
    let found: Vec<(f32, u32)> = distances.iter().enumerate().map(|(k, d)| (*d, k as u32)).collect();
    weights(&found, beyond)[..found.len()].to_vec()
}
