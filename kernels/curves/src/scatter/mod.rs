//! Points spread evenly over triangles: no two close together, and no crowd beside a void.
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

use numerics::random::Key;
use rayon::prelude::*;

/// Of √(area ÷ candidates). The nearest neighbours of n points on a plane come to lie 0.48·√(area ÷ n) apart at least
/// and 0.73 on average (random ones 0 and 0.5). At 0.6 it is 0.42 and 0.69; at 1.3 0.57 and 0.78, for twice the time.
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
    /// Least coordinates of all corners: places are kept relative to it, so that none is negative and a cast rounds down.
    low: [f64; 3],
}

impl<'a> Surface<'a> {
    /// The triangles, rows of `positions` (metres).
    ///
    /// # Panics
    /// Where a corner is out of range.
    pub fn new(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]]) -> Self {
        let normals: Vec<[f64; 3]> =
            triangles.par_iter().map(|corners| normal(corners_of(positions, *corners))).collect();
        let mut area = 0.0;
        let ends = normals.iter().map(|normal| {
            area += 0.5 * length(*normal);
            area
        });
        let ends = ends.collect();
        // Of the triangles' corners alone: a stray point far away would cost all others their digits.
        let corners = || triangles.as_flattened().iter().map(|corner| positions[*corner as usize]);
        let least = |k: usize| corners().map(|p| f64::from(p[k])).fold(f64::INFINITY, f64::min);
        Self { positions, triangles, ends, normals, low: [least(0), least(1), least(2)] }
    }

    /// Area of all triangles, m².
    pub fn area(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// `count` spots, in the order in which they were found.
    pub fn spread(&self, count: usize, key: Key) -> Vec<Spot> {
        let mut spots = Vec::with_capacity(count);
        let mut kept = Kept::new(self.spacing(0));
        let last = MOST_TRIES * count as u64;
        let mut tried = 0;
        while self.area() > 0.0 && spots.len() < count && tried < last {
            let round = tried..(tried + FIRST_ROUND.max(tried / 4)).min(last);
            kept.refine(self.spacing(round.start));
            // First, on all threads, against what earlier rounds kept; then, in order, against this round's own.
            let fit: Vec<(u64, Spot, [f64; 3])> = round
                .clone()
                .into_par_iter()
                .map(|i| {
                    let spot = self.candidate(i, key);
                    let corners = corners_of(self.positions, self.triangles[spot.triangle as usize]);
                    (i, spot, sub(spot.mix(corners), self.low))
                })
                .filter(|(i, spot, at)| !self.is_crowded(&kept, 0, spot, *at, self.spacing(*i)))
                .collect();
            let earlier = spots.len();
            for (i, spot, at) in fit {
                if spots.len() < count && !self.is_crowded(&kept, earlier, &spot, at, self.spacing(i)) {
                    kept.add(at, spot.triangle);
                    spots.push(spot);
                }
            }
            tried = round.end;
        }
        spots
    }

    /// How far candidate `i` must be from all kept before it, metres.
    fn spacing(&self, i: u64) -> f64 {
        SPACING * (self.area() / (i + 1) as f64).sqrt()
    }

    /// Candidate `i`: along the list of triangles by multiples of the golden ratio, within its triangle's rows too, and
    /// at random across.
    fn candidate(&self, i: u64, key: Key) -> Spot {
        let along = key.u64().wrapping_add(i.wrapping_mul(GOLDEN));
        // Never rounded up to the very end, where no triangle begins.
        let target = ((along >> 11) as f64 / (1_u64 << 53) as f64 * self.area()).min(self.area().next_down());
        let triangle = self.ends.partition_point(|end| *end <= target);
        let start = if triangle == 0 { 0.0 } else { self.ends[triangle - 1] };
        let share = (target - start) / (self.ends[triangle] - start);
        let (down, across) = (share.sqrt(), key.of(i).f64());
        Spot { triangle: triangle as u32, weights: [1.0 - down, down * (1.0 - across), down * across] }
    }

    /// Whether any kept point from the `first` on is too near.
    fn is_crowded(&self, kept: &Kept, first: usize, spot: &Spot, at: [f64; 3], spacing: f64) -> bool {
        let facing = self.normals[spot.triangle as usize];
        kept.any_near(at, first, |point| {
            let apart = sub(point.at, at);
            dot(apart, apart) < spacing * spacing && dot(facing, self.normals[point.triangle as usize]) > 0.0
        })
    }
}

/// Points that are kept (none with a negative coordinate), found again by place: in cubes at least twice as wide as the
/// spacing, so that eight of them hold all that is nearer. Cubes share chains by chance, which costs time and no answer.
struct Kept {
    points: Vec<Point>,
    cubes_per_metre: f64,
    /// Newest point of each chain.
    heads: Vec<u32>,
}

struct Point {
    at: [f64; 3],
    triangle: u32,
    /// The next older point of its chain.
    older: u32,
}

/// The end of a chain.
const NONE: u32 = u32::MAX;

/// Cubes are made anew once they are this much wider than they must be: at 2 a cube holds four times as many points, at
/// 1 they would be made anew every round.
const TOO_WIDE: f64 = 1.3;

impl Kept {
    fn new(spacing: f64) -> Self {
        Self { points: Vec::new(), cubes_per_metre: 0.5 / spacing, heads: vec![NONE; FIRST_ROUND as usize] }
    }

    /// Makes the cubes fit a spacing that has shrunk.
    fn refine(&mut self, spacing: f64) {
        let needed = 0.5 / spacing;
        if needed <= TOO_WIDE * self.cubes_per_metre {
            return;
        }
        self.cubes_per_metre = needed;
        // Until cubes are made anew, points become about twice as many.
        self.heads = vec![NONE; (4 * self.points.len()).max(FIRST_ROUND as usize).next_power_of_two()];
        for place in 0..self.points.len() {
            let chain = self.chain_of(self.points[place].at);
            self.points[place].older = self.heads[chain];
            self.heads[chain] = place as u32;
        }
    }

    fn add(&mut self, at: [f64; 3], triangle: u32) {
        let chain = self.chain_of(at);
        self.points.push(Point { at, triangle, older: self.heads[chain] });
        self.heads[chain] = (self.points.len() - 1) as u32;
    }

    /// Whether `holds` of any point from the `first` on that lies in the eight cubes around `at`.
    #[inline]
    fn any_near(&self, at: [f64; 3], first: usize, holds: impl Fn(&Point) -> bool) -> bool {
        let cube = at.map(|x| x * self.cubes_per_metre);
        let own = cube.map(|x| x as i64);
        // In each direction the neighbour that is nearer; the own cube, which most likely answers, goes first.
        let next = [0, 1, 2].map(|k| if cube[k] - (own[k] as f64) < 0.5 { -1 } else { 1 });
        (0..8).any(|corner: i64| {
            let cube = [0, 1, 2].map(|k| own[k].wrapping_add(next[k] * (corner >> k & 1)));
            let mut place = self.heads[self.chain(cube)];
            // A chain runs from its newest point to its oldest.
            while place != NONE && place as usize >= first {
                let point = &self.points[place as usize];
                if holds(point) {
                    return true;
                }
                place = point.older;
            }
            false
        })
    }

    fn chain_of(&self, at: [f64; 3]) -> usize {
        self.chain(at.map(|x| (x * self.cubes_per_metre) as i64))
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
