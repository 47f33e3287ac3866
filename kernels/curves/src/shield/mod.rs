//! Which curves are in the lee of colliders: the kernel of Curve_Wind_Shielding (W4).
//!
//! A ray is cast upwind from each CV. As all rays are parallel, everything is rotated into a frame whose third axis
//! points upwind; there a ray is a box without width, a hit test is a point-in-triangle test, and a large offset costs
//! no precision. Instead of a ray a CV may use a cone: the result is the fraction of the cone that is covered.
//!
//! Guarantees: rays are exact up to the rounding of positions and [`Shield::skin_gap`], do not pass between triangles
//! that share points, and are stopped by either side of a face. The covered fraction of a cone is a continuous function
//! of the wind, but for steps of at most 1/16 where layers overlap (see [`layers`]). The same bits on every SIMD path and number of threads; finite for any input.
//!
//! Shelter may fade with the distance of what is hit ([`Shield::distance`]); of several hits the nearest counts.
//!
//! A CV on the skin is not sheltered by the triangles it lies on: those whose *plane* is closer than the gap. So a root
//! on the windward side of a closed skin is exposed, and one on the lee side is sheltered by the opposite side of the
//! skin, at any angle of the wind. Limit: a root buried deeper than the gap is covered by the skin above it.

mod cone;
mod cone_blocks;
mod edges;
mod facing;
mod frame;
mod layers;
mod rays;
mod views;

use edges::Edges;
pub use edges::Neighbours;
use frame::Frame;
use numerics::lanes::{F32x16, LANES, get};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::tree::{Block, TriangleTree};
use numerics::trig;
use numerics::vector::{self, Vec3};
use views::Views;

/// A mesh that stops the wind.
#[derive(Clone, Copy, Debug)]
pub struct Collider<'a> {
    /// Positions, metres.
    pub points: &'a [Vec3],
    /// Three indices of `points` each; their winding does not matter for rays.
    pub triangles: &'a [[u32; 3]],
    /// A tree over them, if there is one already.
    pub tree: Option<&'a TriangleTree>,
    /// Their [`Neighbours`], if known; used for cones.
    pub neighbours: Option<&'a Neighbours>,
}

impl<'a> Collider<'a> {
    /// A collider without precomputed tree and neighbours.
    pub fn of(points: &'a [Vec3], triangles: &'a [[u32; 3]]) -> Self {
        Self { points, triangles, tree: None, neighbours: None }
    }
}

/// How shelter is measured.
#[derive(Clone, Copy, Debug)]
pub struct Shield<'a> {
    /// Direction that the wind blows towards, of any length; nothing is sheltered from a wind of 0.
    pub wind: [f64; 3],
    /// Largest distance upwind at which a collider shelters a CV, metres; a mask has one value for each CV.
    pub offset: Masked<'a, f32>,
    /// A hit at a distance s counts max(0, 1 − s ÷ distance) to the power of `falloff`; 0: it counts 1 at any.
    pub distance: f32,
    /// See `distance`; 0 or more.
    pub falloff: f32,
    /// Half the opening angle of the cone, radians, 0…0.5; 0 is a ray.
    pub cone: f32,
    /// A CV this close to a triangle's plane lies on it, metres. At least the smaller of 1e-5 of the collider's size
    /// and 1e-2 of the curve's, and 4 ulp of the CV's largest coordinate.
    pub skin_gap: f32,
}

/// How shelter fades with the distance of what is hit, in the units of the frame.
#[derive(Clone, Copy)]
struct Fade {
    distance: f32,
    power: f32,
}

impl Fade {
    /// How much a hit at this distance counts, 0…1.
    #[inline(always)]
    fn weight(self, distance: f32) -> f32 {
        let left = 1.0 - distance / self.distance;
        let left = if left > 0.0 { left } else { 0.0 };
        let left = if left < 1.0 { left } else { 1.0 };
        let power = if self.power == 1.0 { left } else { trig::pow(left, self.power) };
        // 0 to the power of 0 is 1.
        if left > 0.0 { power } else { 0.0 }
    }
}

/// How far upwind colliders shelter.
#[derive(Clone, Copy)]
struct Reach {
    end: f32,
    fade: Option<Fade>,
}

impl Reach {
    /// Beyond this distance nothing counts.
    #[inline(always)]
    fn farthest(&self) -> f32 {
        match self.fade {
            Some(fade) if fade.distance < self.end => fade.distance,
            _ => self.end,
        }
    }
}

/// Number of CVs that are sorted together: enough to be dense, few enough to stay in a cache.
const SORTED_CVS: usize = 1 << 18;

/// Number of groups of sixteen CVs in a task: some 30 µs of work.
const TASK_GROUPS: usize = 32;

/// Number of curves that a task averages over.
const TASK_CURVES: usize = 1024;

/// Number of points that a task transforms into the frame.
const TASK_POINTS: usize = 4096;

/// A collider in the frame of the wind.
struct Obstacle {
    tree: TriangleTree,
    /// Twice the area of each triangle, one entry for each block.
    areas: Vec<F32x16>,
    /// Neighbours of each triangle, which cones need; `None` for rays.
    edges: Option<Edges>,
    /// The longest side of its bounds.
    size: f32,
    /// Number of triangles, unused lanes included, and the same per area of its bounds across the wind.
    triangles: f32,
    density: f32,
}

/// The fraction of each curve's CVs that `colliders` shelter, 0…1; a curve's CVs are
/// `points[starts[i]..starts[i + 1]]`.
///
/// # Panics
/// If `starts` decreases or ends beyond `points`, or a triangle's index is out of range.
pub fn shield(starts: &[u32], points: &[Vec3], colliders: &[Collider<'_>], shield: &Shield<'_>) -> Vec<f32> {
    shield_on(Path::chosen(), starts, points, colliders, shield)
}

/// [`shield()`] on a given SIMD path.
///
/// # Panics
/// As [`shield()`].
pub fn shield_on(
    path: Path,
    starts: &[u32],
    points: &[Vec3],
    colliders: &[Collider<'_>],
    shield: &Shield<'_>,
) -> Vec<f32> {
    let curves = starts.len().saturating_sub(1);
    let Some(frame) = Frame::of(shield.wind, points, colliders) else { return vec![0.0; curves] };
    let reach = frame.length(shield.offset.value);
    if curves == 0 || reach.is_nan() || reach <= 0.0 {
        return vec![0.0; curves];
    }
    let fade = (shield.distance > 0.0).then(|| Fade { distance: frame.length(shield.distance), power: shield.falloff });
    let obstacle = |collider: &Collider<'_>| Obstacle::of(&frame, collider, shield.cone > 0.0);
    let mut shares = vec![0.0; curves];
    let mut left = shares.as_mut_slice();
    let mut batches = batches(starts).into_iter();
    let first = batches.next().map(|batch| &starts[batch]).unwrap_or_default();
    let (obstacles, mut views) =
        rayon::join(|| colliders.iter().map(obstacle).collect::<Vec<_>>(), || Views::of(&frame, first, points, shield));
    if obstacles.iter().all(|obstacle| obstacle.tree.is_empty()) {
        return vec![0.0; curves];
    }
    let look = |views: &Views, covered: &mut [f32]| {
        let tasks = covered.chunks_mut(TASK_GROUPS * LANES).zip(views.sorted().chunks(TASK_GROUPS * LANES));
        parallel::for_each(tasks, |_, (covered, cvs)| {
            for (covered, cvs) in covered.chunks_mut(LANES).zip(cvs.chunks(LANES)) {
                let group = || views.group(cvs);
                match fade {
                    None if shield.cone > 0.0 => {
                        cone::cover(path, &obstacles, &group()[..cvs.len()], shield.cone, covered);
                    }
                    Some(fade) if shield.cone > 0.0 => {
                        cone::cover_fading(path, &obstacles, &group()[..cvs.len()], fade, shield.cone, covered);
                    }
                    None => rays::cover(path, &obstacles, views.all(), cvs, covered),
                    Some(fade) => rays::cover_nearest(path, &obstacles, views.all(), cvs, fade, covered),
                }
            }
        });
    };
    let mut covered = Vec::new();
    loop {
        covered.clear();
        covered.resize(views.len(), 0.0);
        look(&views, &mut covered);
        let (mine, rest) = left.split_at_mut(views.curves());
        parallel::fill(mine, TASK_CURVES, |curve| share(views.of_curve(curve), &covered));
        left = rest;
        let Some(batch) = batches.next() else { return shares };
        views = Views::of(&frame, &starts[batch], points, shield);
    }
}

/// Runs of curves with about `SORTED_CVS` CVs, as ranges of `starts` that include the end.
fn batches(starts: &[u32]) -> Vec<std::ops::Range<usize>> {
    let (mut batches, mut first) = (Vec::new(), 0);
    for curve in 1..starts.len() {
        if curve + 1 == starts.len() || (starts[curve] - starts[first]) as usize >= SORTED_CVS {
            batches.push(first..curve + 1);
            first = curve;
        }
    }
    batches
}

/// The mean over a curve's CVs, given their indices in `covered`; 0 without CVs.
fn share(cvs: &[u32], covered: &[f32]) -> f32 {
    let sum: f64 = cvs.iter().map(|cv| f64::from(covered[*cv as usize])).sum();
    if cvs.is_empty() { 0.0 } else { (sum / cvs.len() as f64) as f32 }
}

kernel! { avx512
    /// Twice the area of each triangle.
    fn write_areas(blocks: &[Block], areas: &mut [F32x16]) = write_areas_body;
}

#[inline(always)]
fn write_areas_body(blocks: &[Block], areas: &mut [F32x16]) {
    for (areas, block) in areas.iter_mut().zip(blocks) {
        let [a, b, c] = &block.corners;
        for lane in 0..LANES {
            let [a, b, c] = [get(a, lane), get(b, lane), get(c, lane)];
            areas.0[lane] = vector::length(vector::cross(vector::sub(b, a), vector::sub(c, a)));
        }
    }
}

impl Obstacle {
    /// A collider in the frame.
    fn of(frame: &Frame, collider: &Collider<'_>, with_edges: bool) -> Self {
        let (path, mut points) = (Path::chosen(), vec![[0.0; 3]; collider.points.len()]);
        let tasks = points.chunks_mut(TASK_POINTS).zip(collider.points.chunks(TASK_POINTS));
        parallel::for_each(tasks, |_, (framed, points)| frame::write_framed(path, frame, points, framed));
        let tree = match collider.tree {
            Some(tree) => tree.moved(&points),
            None => TriangleTree::build(&points, collider.triangles),
        };
        let mut areas = vec![F32x16::splat(0.0); tree.blocks().len()];
        let tasks = areas.chunks_mut(TASK_GROUPS).zip(tree.blocks().chunks(TASK_GROUPS));
        parallel::for_each(tasks, |_, (areas, blocks)| write_areas(path, blocks, areas));
        let (low, high) = tree.bounds();
        let size = (0..3).fold(0.0_f32, |size, axis| size.max(high[axis] - low[axis]));
        let edges = with_edges.then(|| match collider.neighbours {
            Some(neighbours) => Edges::of(&tree, &points, neighbours),
            None => Edges::of(&tree, &points, &Neighbours::of(&points, collider.triangles)),
        });
        let triangles = (LANES * tree.blocks().len()) as f32;
        let density = triangles / ((high[0] - low[0]) * (high[1] - low[1]));
        Self { tree, areas, edges, size, triangles, density }
    }
}

#[cfg(test)]
mod tests;
