//! Curves against meshes: the kernel of Curve_Wind_Collision (W3).
//!
//! Root to tip, each segment starts at its rest direction, rotated along with the previous segments, and turns towards
//! its goal's direction until it meets a triangle. A segment that earlier rotations have pushed through a surface first
//! turns out of it, on the great circle towards the surface's normal there. First contact is a closed form (see
//! [`sector`]). A curve with a segment that no turn frees is blended towards rest (see [`towards_rest`]).
//!
//! Guarantees: segments keep the lengths of the goal up to the rounding of positions; written segments of a curve that
//! crosses nothing at rest cross no triangle; a curve without contacts keeps the goal's bits; the same bits on every SIMD path and number of threads. Limit: surfaces are
//! obstacles, not volumes, so a curve wholly inside a surface stays there.

mod capsule;
mod clearance;
mod coherence;
mod coherent_turn;
mod crossing;
mod hair;
mod half_space;
mod keep_out;
mod kept_half_spaces;
mod rest;
mod root_lift;
mod root_surface;
mod sector;
mod segment_turn;
mod skin;
mod towards_rest;
mod triangle_filter;
mod turn_axes;

use coherence::Ground;
use hair::{Hair, Scratch};
pub use keep_out::{Clearance, KeepOut, KeptOut, keep_out};
use numerics::masked::Masked;
use numerics::parallel;
use numerics::simd::{Path, kernel};
use numerics::tree::TriangleTree;
use numerics::vector::{DVec3, Vec3};
pub use rest::{AtRest, at_rest};
pub use skin::{SkinMesh, SkinSurface, normals};
use std::ops::Range;

/// How a segment's turn is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactMethod {
    /// At first contact, in closed form.
    Exact,
    /// As in the paper: after this many equal steps, at the last one that crosses nothing.
    Steps(u32),
}

/// Obstacles and settings of a collision.
#[derive(Clone)]
pub struct Collide<'a> {
    /// The obstacles' triangles, one tree for each obstacle.
    pub obstacles: &'a [&'a TriangleTree],
    /// The surface that the curves grow on.
    pub skin: Option<SkinSurface<'a>>,
    /// How a turn is stopped.
    pub method: ContactMethod,
    /// How strongly directions into the skin are redirected outwards before a segment turns, 0..1; see [`coherence`]; a mask
    /// has one value for each CV.
    pub coherence: Masked<'a, f64>,
    /// Arc length kept from contacts, metres; a mask has one value for each CV.
    pub gap: Masked<'a, f64>,
    /// Height above the skin to which roots are lifted, metres; 0 leaves them; a mask has one value for each CV, and is read
    /// at roots.
    pub offset_root: Masked<'a, f64>,
    /// Raises goals to at least this multiple of the curves' height above the skin at rest; a mask has one value for each CV.
    pub offset_scale: Option<Masked<'a, f64>>,
    /// Share of its height at rest, above the root's tangent plane, that a CV's goal keeps, 0..1; scaled by
    /// 1 − `coherence`, and not used with `offset_scale`; a mask has one value for each CV.
    pub loft: Masked<'a, f64>,
    /// What is known of the same curves at rest.
    pub at_rest: Option<&'a AtRest>,
    /// Fraction of each segment's collision response that is kept, 0..1.
    pub blend: Masked<'a, f32>,
    /// Diameter of the curves, metres; a mask has one value for each CV.
    pub width: Masked<'a, f32>,
}

/// Distance, in gaps, by which coherence keeps ends off the skin.
const KEPT_GAPS: f64 = 2.0;

/// The largest such distance, in lengths of a segment.
const MOST_KEPT: f64 = 0.25;

impl Collide<'_> {
    /// The skin that the segment from CV `cv` at `pivot`, of this length, is to be redirected out of, if any, and by how much;
    /// its end is kept off it by more than the gap. `goal` holds the curve's goals from that CV on.
    #[inline(always)]
    fn ground(&self, cv: usize, pivot: &DVec3, length: f64, goal: &[DVec3]) -> Option<(Ground, f64)> {
        let coherence = self.coherence_at(cv);
        let skin = self.skin.as_ref().filter(|_| coherence > 0.0)?;
        // As far as the rest of the curve reaches, which shares the room.
        let reach = goal.windows(2).fold(0.0, |reach, ends| reach + (ends[1] - ends[0]).norm());
        let ground = skin.ground(pivot, reach)?;
        let kept = (KEPT_GAPS * self.gap_at(cv)).min(MOST_KEPT * length);
        Some((Ground { height: ground.height - kept, ..ground }.shared_with(goal), coherence))
    }

    #[inline(always)]
    fn coherence_at(&self, cv: usize) -> f64 {
        at_least_0(self.coherence.at(cv)).min(1.0)
    }

    #[inline(always)]
    fn gap_at(&self, cv: usize) -> f64 {
        at_least_0(self.gap.at(cv))
    }

    #[inline(always)]
    fn offset_root_at(&self, cv: usize) -> f64 {
        at_least_0(self.offset_root.at(cv))
    }
}

/// Curves after their collisions.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Collided {
    /// One point for each input point.
    pub points: Vec<Vec3>,
    /// Segments that could not be freed from what they cross: those of curves that cross something at rest too.
    pub unfreed_segments: u64,
    /// Segments that cross something in the written result; with full blend the same as the unfreed ones.
    pub crossings_left: u64,
    /// The same of each curve.
    pub crossings: Vec<i32>,
    /// 1 for each curve blended towards rest, else 0.
    pub blended: Vec<i32>,
    /// Curves blended towards rest because turns left a segment crossing something.
    pub blended_to_rest: u64,
    /// Curves that cross something at rest.
    pub started_inside: u64,
    /// Roots that a move of four times the root offset does not bring that far from all faces of the skin.
    pub low_roots: u64,
    /// Segments stopped before their goal.
    pub contacts: u64,
    /// Largest distance by which a segment reaches through a surface, metres.
    pub deepest_overlap: f64,
    /// Largest |length − goal's length| of a segment ÷ curve length, in the written result.
    pub length_error: f64,
    /// Segments nearer to something than half their width, although their curves are that far away before.
    pub too_near: u64,
    /// The largest share of half a width that these lack.
    pub missing_width: f64,
    /// Curves whose roots, lifted, are nearer to something than half their width.
    pub near_roots: u64,
}

/// Counts and largest values over some curves.
#[derive(Clone, Copy, Default)]
struct Reached {
    unfreed_segments: u64,
    crossings_left: u64,
    blended_to_rest: u64,
    contacts: u64,
    deepest_overlap: f64,
    length_error: f64,
    too_near: u64,
    missing_width: f64,
    near_roots: u64,
}

impl Reached {
    fn and(self, other: Self) -> Self {
        Self {
            unfreed_segments: self.unfreed_segments + other.unfreed_segments,
            contacts: self.contacts + other.contacts,
            crossings_left: self.crossings_left + other.crossings_left,
            blended_to_rest: self.blended_to_rest + other.blended_to_rest,
            deepest_overlap: self.deepest_overlap.max(other.deepest_overlap),
            length_error: self.length_error.max(other.length_error),
            too_near: self.too_near + other.too_near,
            missing_width: self.missing_width.max(other.missing_width),
            near_roots: self.near_roots + other.near_roots,
        }
    }
}

/// Minimum number of CVs in a task: some 100 µs of work.
const TASK_CVS: usize = 256;

/// Collides curves `goal[starts[i]..starts[i + 1]]`, whose rest shapes are the same ranges of `rest`.
///
/// # Panics
/// If `starts` does not run up to the number of points of both.
pub fn collide(starts: &[u32], rest: &[Vec3], goal: &[Vec3], how: &Collide<'_>) -> Collided {
    collide_on(Path::chosen(), starts, rest, goal, how)
}

/// [`collide()`] on a given SIMD path.
///
/// # Panics
/// As [`collide()`].
pub fn collide_on(path: Path, starts: &[u32], rest: &[Vec3], goal: &[Vec3], how: &Collide<'_>) -> Collided {
    let unknown;
    let at_rest = match how.at_rest {
        Some(at_rest) => at_rest,
        None => {
            unknown = AtRest::of(starts.len().saturating_sub(1));
            &unknown
        }
    };
    at_rest.find_on(path, starts, rest, how);
    at_rest.used(path, starts, rest, how);
    let is_skin = |tree: &&TriangleTree| how.skin.as_ref().is_some_and(|skin| std::ptr::eq(*tree, skin.tree));
    let others: Vec<&TriangleTree> = how.obstacles.iter().filter(|tree| !is_skin(tree)).copied().collect();
    let known = Known { at_rest, others: &others };
    let curves = starts.len().saturating_sub(1);
    let (mut points, mut crossings, mut blended) = (vec![[0.0; 3]; goal.len()], vec![0; curves], vec![0; curves]);
    let mut tasks = Vec::new();
    let (mut left, mut left_crossings, mut left_blended) = (&mut points[..], &mut crossings[..], &mut blended[..]);
    let mut first = 0;
    while first < curves {
        let mut end = first;
        while end < curves && ((starts[end] - starts[first]) as usize) < TASK_CVS {
            end += 1;
        }
        let (out, rest) = left.split_at_mut((starts[end] - starts[first]) as usize);
        let (crossings, other_crossings) = left_crossings.split_at_mut(end - first);
        let (blended, other_blended) = left_blended.split_at_mut(end - first);
        tasks.push((first..end, Written { points: out, crossings, blended }));
        (left, left_crossings, left_blended, first) = (rest, other_crossings, other_blended, end);
    }
    let reached =
        parallel::map(tasks, |_, (curves, out)| collide_task(path, curves, starts, [rest, goal], how, known, out));
    let reached = reached.into_iter().fold(Reached::default(), Reached::and);
    Collided {
        points,
        crossings,
        blended,
        started_inside: at_rest.inside(),
        low_roots: at_rest.low_roots(),
        unfreed_segments: reached.unfreed_segments,
        crossings_left: reached.crossings_left,
        blended_to_rest: reached.blended_to_rest,
        contacts: reached.contacts,
        deepest_overlap: reached.deepest_overlap,
        length_error: reached.length_error,
        too_near: reached.too_near,
        missing_width: reached.missing_width,
        near_roots: reached.near_roots,
    }
}

/// What is known of all curves at rest.
#[derive(Clone, Copy)]
struct Known<'a> {
    at_rest: &'a AtRest,
    /// Obstacles besides the skin.
    others: &'a [&'a TriangleTree],
}

/// Where a task writes.
struct Written<'a> {
    points: &'a mut [Vec3],
    crossings: &'a mut [i32],
    blended: &'a mut [i32],
}

kernel! {
    fn collide_task(
        curves: Range<usize>,
        starts: &[u32],
        positions: [&[Vec3]; 2],
        how: &Collide<'_>,
        known: Known<'_>,
        out: Written<'_>,
    ) -> Reached = task;
}

#[inline(always)]
fn task(
    curves: Range<usize>,
    starts: &[u32],
    [rest, goal]: [&[Vec3]; 2],
    how: &Collide<'_>,
    Known { at_rest, others }: Known<'_>,
    out: Written<'_>,
) -> Reached {
    let mut scratch = Scratch::default();
    let mut reached = Reached::default();
    let base = starts[curves.start] as usize;
    for ((curve, crossings), blended) in curves.zip(out.crossings).zip(out.blended) {
        let cvs = starts[curve] as usize..starts[curve + 1] as usize;
        let mut hair = Hair {
            first: cvs.start,
            shift: at_rest.shift(curve),
            half_space: at_rest.half_space(curve),
            around: at_rest.around(curve),
            rest: &rest[cvs.clone()],
            goal: &goal[cvs.clone()],
            out: &mut out.points[cvs.start - base..cvs.end - base],
        };
        let one = hair.collide(how, others, &mut scratch);
        (*crossings, *blended) = (one.crossings_left as i32, one.blended_to_rest as i32);
        reached = reached.and(one);
    }
    reached
}

/// A masked number, which may be negative, NaN or infinite, as one that is not.
#[inline(always)]
fn at_least_0(number: f64) -> f64 {
    if number > 0.0 { number.min(f64::from(f32::MAX)) } else { 0.0 }
}

/// A unit vector perpendicular to the unit vector `to`: along the perpendicular part of `near`, if there is one.
fn perpendicular(to: &DVec3, near: &DVec3) -> DVec3 {
    let side = near - to * to.dot(near);
    let length = side.norm();
    if length > 1e-6 {
        return side / length;
    }
    let [x, y, z] = [to.x.abs(), to.y.abs(), to.z.abs()];
    let away = if x <= y && x <= z {
        DVec3::x()
    } else if y <= z {
        DVec3::y()
    } else {
        DVec3::z()
    };
    let side = to.cross(&away);
    side / side.norm()
}

#[cfg(test)]
mod tests;
