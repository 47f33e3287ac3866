//! Points spread evenly over triangles: no two close together, no hole where one more had room.
//!
//! Relaxation dart throwing (McCool & Fiume 1992): candidate i, uniform over the area, is kept where no point kept
//! before it is nearer than `SPACING · √(area ÷ i)`. Distances are straight through space; points on triangles that
//! face apart do not see each other, so the two sides of a thin sheet fill alike.
//!
//! Promise: progressive, the points of a shorter list are the first of a longer one, each list as even as the other,
//! so a density may vary over the surface by keeping fewer of the first; a pure function of positions, triangles and
//! key, for any number of threads. Limit: a list is shorter than asked where the surface has no area, or where
//! `MOST_TRIES` candidates a point were not enough (about 3 are).

mod grow;

pub use grow::{Blade, grow, vertex_normals};

use crate::random::Key;
use rayon::prelude::*;

/// Of √(area ÷ candidates). n points on a plane come to lie ½·√(area ÷ n) apart at least, and ¾ of it on average
/// (random ones 0 and ½). 0.6 lets them half as evenly, 1.2 costs twice as many candidates for 0.05 more.
const SPACING: f64 = 0.8;

/// Candidates a point, before the search ends.
const MOST_TRIES: u64 = 32;

/// Candidates of the first round; each later one adds a quarter of all so far.
const FIRST_ROUND: u64 = 256;

/// Golden ratio × 2⁶⁴: multiples of it, modulo 1, fill a line evenly however many there are.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A place on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Which triangle.
    pub triangle: u32,
    /// Share of each corner: none negative, 1 together.
    pub weights: [f64; 3],
}

impl Spot {
    /// The weighted sum of the corners' values.
    pub fn mix<const N: usize>(&self, corners: [[f64; N]; 3]) -> [f64; N] {
        let [a, b, c] = self.weights;
        std::array::from_fn(|k| a * corners[0][k] + b * corners[1][k] + c * corners[2][k])
    }
}

/// Triangles to spread points over.
pub struct Surface<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
    /// Area of the triangles up to and including each, m².
    ends: Vec<f64>,
    /// Of each triangle, not normalised.
    normals: Vec<[f64; 3]>,
}

/// A candidate and where it lies.
#[derive(Clone, Copy)]
struct Candidate {
    spot: Spot,
    at: [f64; 3],
}

impl<'a> Surface<'a> {
    /// The triangles, rows of `positions` (metres).
    ///
    /// # Panics
    /// Where a corner is out of range.
    pub fn new(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]]) -> Self {
        let normals: Vec<[f64; 3]> = triangles.par_iter().map(|corners| normal(corners_of(positions, *corners))).collect();
        let mut area = 0.0;
        let ends = normals.iter().map(|normal| {
            area += 0.5 * length(*normal);
            area
        });
        let ends = ends.collect();
        Self { positions, triangles, ends, normals }
    }

    /// Area of all triangles, m².
    pub fn area(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// `count` spots, in the order in which they were found.
    pub fn spread(&self, count: usize, key: Key) -> Vec<Spot> {
        let mut kept: Vec<Candidate> = Vec::with_capacity(count);
        let last = MOST_TRIES * count as u64;
        let mut tried = 0;
        while self.area() > 0.0 && kept.len() < count && tried < last {
            let round = tried..(tried + FIRST_ROUND.max(tried / 4)).min(last);
            let mut grid = Grid::of(&kept, self.spacing(round.start));
            // First, on all threads, against what earlier rounds kept; then, in order, against this round's own.
            let found: Vec<(u64, Candidate)> = round
                .clone()
                .into_par_iter()
                .map(|i| (i, self.candidate(i, key)))
                .filter(|(i, candidate)| !self.is_crowded(&grid, &kept, candidate, self.spacing(*i)))
                .collect();
            for (i, candidate) in found {
                if kept.len() < count && !self.is_crowded(&grid, &kept, &candidate, self.spacing(i)) {
                    grid.add(kept.len(), candidate.at);
                    kept.push(candidate);
                }
            }
            tried = round.end;
        }
        kept.into_iter().map(|candidate| candidate.spot).collect()
    }

    /// How far candidate `i` must be from all kept before it, metres.
    fn spacing(&self, i: u64) -> f64 {
        SPACING * (self.area() / (i + 1) as f64).sqrt()
    }

    /// Candidate `i`: along the list of triangles by multiples of the golden ratio, within its triangle's rows too, and
    /// at random across.
    fn candidate(&self, i: u64, key: Key) -> Candidate {
        let along = key.u64().wrapping_add(i.wrapping_mul(GOLDEN));
        let target = (along >> 11) as f64 / (1_u64 << 53) as f64 * self.area();
        let triangle = self.ends.partition_point(|end| *end <= target).min(self.ends.len() - 1);
        let start = if triangle == 0 { 0.0 } else { self.ends[triangle - 1] };
        let share = ((target - start) / (self.ends[triangle] - start)).clamp(0.0, 1.0);
        let (down, across) = (share.sqrt(), key.of(i).f64());
        let spot = Spot { triangle: triangle as u32, weights: [1.0 - down, down * (1.0 - across), down * across] };
        Candidate { spot, at: spot.mix(corners_of(self.positions, self.triangles[triangle])) }
    }

    fn is_crowded(&self, grid: &Grid, kept: &[Candidate], candidate: &Candidate, spacing: f64) -> bool {
        let facing = self.normals[candidate.spot.triangle as usize];
        grid.near(candidate.at).any(|place| {
            let other = &kept[place];
            let apart = sub(other.at, candidate.at);
            dot(apart, apart) < spacing * spacing && dot(facing, self.normals[other.spot.triangle as usize]) > 0.0
        })
    }
}

/// Which points lie near a place: cubes twice as wide as the spacing, so that eight of them hold all that is nearer.
/// Cubes share chains by chance, which costs time and no answer.
struct Grid {
    cubes_per_metre: f64,
    /// Last point of each chain.
    heads: Vec<u32>,
    /// The point before each in its chain.
    before: Vec<u32>,
}

/// The end of a chain.
const NONE: u32 = u32::MAX;

impl Grid {
    fn of(kept: &[Candidate], spacing: f64) -> Self {
        let chains = (2 * kept.len()).max(FIRST_ROUND as usize).next_power_of_two();
        let mut grid = Self { cubes_per_metre: 0.5 / spacing, heads: vec![NONE; chains], before: Vec::new() };
        for (place, candidate) in kept.iter().enumerate() {
            grid.add(place, candidate.at);
        }
        grid
    }

    fn add(&mut self, place: usize, at: [f64; 3]) {
        let chain = self.chain(at.map(|x| (x * self.cubes_per_metre).floor() as i64));
        self.before.push(self.heads[chain]);
        self.heads[chain] = place as u32;
    }

    fn near(&self, at: [f64; 3]) -> impl Iterator<Item = usize> + '_ {
        let lowest = at.map(|x| (x * self.cubes_per_metre - 0.5).floor() as i64);
        (0..8).flat_map(move |corner: i64| {
            let cube = std::array::from_fn(|k| lowest[k].wrapping_add(corner >> k & 1));
            let mut place = self.heads[self.chain(cube)];
            std::iter::from_fn(move || {
                let found = (place != NONE).then_some(place as usize)?;
                place = self.before[found];
                Some(found)
            })
        })
    }

    fn chain(&self, [x, y, z]: [i64; 3]) -> usize {
        let mixed = [(x, 0x9e37_79b9_7f4a_7c15), (y, 0xc2b2_ae3d_27d4_eb4f), (z, 0x1656_67b1_9e37_79f9)]
            .into_iter()
            .fold(0_u64, |sum, (cell, factor)| sum.wrapping_add((cell as u64).wrapping_mul(factor)));
        ((mixed ^ (mixed >> 29)) as usize ^ (mixed >> 47) as usize) & (self.heads.len() - 1)
    }
}

fn corners_of(positions: &[[f32; 3]], triangle: [u32; 3]) -> [[f64; 3]; 3] {
    triangle.map(|corner| positions[corner as usize].map(f64::from))
}

/// Twice the area long, outward where the corners are counter-clockwise.
fn normal([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    cross(sub(b, a), sub(c, a))
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests;
