//! Which curves stand in the lee: the kernel of Curve_Wind_Shielding (W4).
//!
//! From each CV a ray goes upwind. As all rays are parallel, everything is turned into a frame whose
//! third axis points upwind; there a ray is a box without width, a hit a point in a triangle, and a
//! far offset costs no precision. A CV may ask a cone instead of a ray: what share of it is covered.
//!
//! Promise: for rays, exact to the rounding of the positions and to [`Shield::skin_gap`], without cracks between triangles
//! that share their points; faces stop wind from both sides. For cones, continuous in the wind and in
//! the positions. The same bits on every SIMD path and for any number of threads; finite for any input.
//!
//! A CV on the skin is not sheltered by the triangles it lies on: those whose *plane* is closer than the
//! gap. So a root on the windward side of a closed skin is free, and one on the lee side is sheltered by
//! the skin's other side, at any angle of the wind. Limit: a root buried deeper than the gap is covered
//! by the skin above it.

mod cone;
mod edges;
mod frame;
mod rays;

use crate::lanes::LANES;
use crate::simd::Path;
use crate::tree::TriangleTree;
use crate::vec3::Vec3;
use edges::Edges;
use frame::{Frame, Gap};
use rayon::prelude::*;

/// A mesh that stops the wind.
#[derive(Clone, Copy, Debug)]
pub struct Collider<'a> {
    /// Positions, metres.
    pub points: &'a [Vec3],
    /// Three indices of `points` each; which way round does not matter for rays.
    pub triangles: &'a [[u32; 3]],
}

/// How the wind is stopped.
#[derive(Clone, Copy, Debug)]
pub struct Shield {
    /// Where the wind blows to: any length but 0.
    pub wind: [f64; 3],
    /// How far upwind of a CV something shelters it, metres.
    pub offset: f32,
    /// Half the angle of the cone that a CV looks upwind through, radians, 0…0.5; 0 is a ray.
    pub cone: f32,
    /// A CV this close to a triangle's plane lies on it, metres, if that is more than the least that
    /// positions allow: a hundred-thousandth of the collider's size and a hundredth of the curve's,
    /// whichever is less, but four units in the last place of the CV's largest coordinate.
    pub skin_gap: f32,
}

/// Curves that a task has at least: a task's CVs fill lanes together.
const TASK_CURVES: usize = 32;

/// A collider in the frame of the wind.
struct Obstacle {
    tree: TriangleTree,
    /// What bounds the mesh as a cone sees it; none where there are rays alone.
    edges: Option<Edges>,
    /// The longest side of its bounds.
    size: f32,
}

/// The share of each curve's CVs that `colliders` shelter, 0…1; a curve's CVs are
/// `points[starts[i]..starts[i + 1]]`.
///
/// # Panics
/// Where `starts` falls or ends beyond `points`, or a triangle's index is out of range.
pub fn shield(starts: &[u32], points: &[Vec3], colliders: &[Collider<'_>], shield: &Shield) -> Vec<f32> {
    shield_on(Path::chosen(), starts, points, colliders, shield)
}

/// [`shield()`] on a given SIMD path.
///
/// # Panics
/// As [`shield()`].
pub fn shield_on(path: Path, starts: &[u32], points: &[Vec3], colliders: &[Collider<'_>], shield: &Shield) -> Vec<f32> {
    let curves = starts.len().saturating_sub(1);
    let mut shares = vec![0.0; curves];
    let frame = Frame::of(shield.wind, points, colliders);
    let reach = frame.length(shield.offset);
    let obstacles: Vec<Obstacle> = colliders.iter().map(|collider| obstacle(&frame, collider, shield)).collect();
    if obstacles.iter().all(|obstacle| obstacle.tree.is_empty()) || !(reach > 0.0) {
        return shares;
    }
    let order = frame::neighbours(&frame, starts, points);
    let scene = Scene { path, frame: &frame, obstacles: &obstacles, starts, points, reach, shield };
    let tasks = order.par_chunks(TASK_CURVES);
    let found: Vec<Vec<f32>> = tasks.map_init(Task::default, |task, curves| task.run(&scene, curves)).collect();
    for (curve, share) in order.iter().zip(found.into_iter().flatten()) {
        shares[*curve as usize] = share;
    }
    shares
}

/// A collider turned into the frame.
fn obstacle(frame: &Frame, collider: &Collider<'_>, shield: &Shield) -> Obstacle {
    let points: Vec<Vec3> = collider.points.par_iter().map(|point| frame.at(*point)).collect();
    let tree = TriangleTree::build(&points, collider.triangles);
    let (low, high) = tree.bounds();
    let size = (0..3).fold(0.0_f32, |size, axis| size.max(high[axis] - low[axis]));
    let edges = (shield.cone > 0.0).then(|| Edges::of(&tree, &points, collider.triangles));
    Obstacle { tree, edges, size }
}

/// What all tasks share; positions are the scene's, lengths the frame's.
struct Scene<'a> {
    path: Path,
    frame: &'a Frame,
    obstacles: &'a [Obstacle],
    starts: &'a [u32],
    points: &'a [Vec3],
    reach: f32,
    shield: &'a Shield,
}

/// Memory of a thread: the CVs of some curves, one curve after the other.
#[derive(Default)]
struct Task {
    at: Vec<Vec3>,
    gap: Vec<Gap>,
    covered: Vec<f32>,
}

impl Task {
    /// The share of each of these curves.
    fn run(&mut self, scene: &Scene<'_>, curves: &[u32]) -> Vec<f32> {
        let range = |curve: &u32| scene.starts[*curve as usize] as usize..scene.starts[*curve as usize + 1] as usize;
        self.at.clear();
        self.gap.clear();
        for cvs in curves.iter().map(range) {
            let gap = scene.frame.gap(&scene.points[cvs.clone()], scene.shield.skin_gap);
            self.gap.extend(std::iter::repeat_n(gap, cvs.len()));
            self.at.extend(scene.points[cvs].iter().map(|point| scene.frame.at(*point)));
        }
        self.covered.clear();
        self.covered.resize(self.at.len(), 0.0);
        let looking = self.at.chunks(LANES).zip(self.gap.chunks(LANES)).zip(self.covered.chunks_mut(LANES));
        for ((at, gap), covered) in looking {
            if scene.shield.cone > 0.0 {
                cone::cover(scene.path, scene.obstacles, at, gap, scene.reach, scene.shield.cone, covered);
            } else {
                rays::cover(scene.path, scene.obstacles, at, gap, scene.reach, covered);
            }
        }
        let mut rest = &self.covered[..];
        let share = |curve: &u32| {
            let (mine, after) = rest.split_at(range(curve).len());
            rest = after;
            if mine.is_empty() {
                0.0
            } else {
                (mine.iter().map(|x| f64::from(*x)).sum::<f64>() / mine.len() as f64) as f32
            }
        };
        curves.iter().map(share).collect()
    }
}

#[cfg(test)]
mod tests;
