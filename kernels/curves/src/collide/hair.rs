//! One curve, root to tip.

use super::coherent_turn::WayOut;
use super::crossing::{first_crossing, first_crossing_in};
use super::half_space::HalfSpace;
use super::root_surface::RootSurface;
use super::segment_turn::{Nearby, Segment, Turned};
use super::turn_axes::TurnAxes;
use super::{Collide, Reached, perpendicular};
use nalgebra::Quaternion;
use numerics::masked::Masked;
use numerics::tree::TriangleTree;
use numerics::vector::{self, DQuat, DVec3, Vec3, are_finite, to_f32, to_f64};

/// Length, in gaps, at the start of the first segment that is not tested if the root may lie on the skin.
pub(super) const SKIPPED_GAPS: f64 = 5.0;

/// Number of CVs from which on segments are so short that successive ones meet the same blocks of obstacles. Blocks around a
/// segment of a curve of five hold more than it meets.
const MANY_CVS: usize = 16;

/// How far around a segment these blocks are kept, in mean lengths of the curve's segments.
const KEPT_SEGMENTS: f64 = 3.0;

/// An input curve, and where its result is written.
pub(super) struct Hair<'a> {
    /// Index of its root among all CVs.
    pub(super) first: usize,
    /// Its displacement for `offset_root`.
    pub(super) shift: DVec3,
    /// Where it meets nothing, if known.
    pub(super) half_space: Option<&'a HalfSpace>,
    /// The skin around its root, for `loft`.
    pub(super) around: Option<RootSurface>,
    pub(super) rest: &'a [Vec3],
    pub(super) goal: &'a [Vec3],
    pub(super) out: &'a mut [Vec3],
}

/// Buffers that curves reuse.
#[derive(Default)]
pub(super) struct Scratch<'t> {
    nearby: Nearby<'t>,
    goal: Vec<DVec3>,
    /// Direction of each segment; zero where it has no length.
    directions: Vec<DVec3>,
    axes: TurnAxes,
}

/// State passed from one segment to the next.
struct Carried {
    /// Composition of all rotations so far.
    rotation: DQuat,
    /// Direction of the previous segment; zero at the root.
    before: DVec3,
}

impl Hair<'_> {
    /// Collides the curve and writes the result; `others` are the obstacles besides the skin.
    #[inline(always)]
    pub(super) fn collide<'t>(
        &mut self,
        how: &Collide<'t>,
        others: &'t [&'t TriangleTree],
        scratch: &mut Scratch<'t>,
    ) -> Reached {
        let mut reached = Reached::default();
        self.out.copy_from_slice(self.goal);
        let cvs = self.goal.len();
        if cvs < 2 || !self.is_finite() {
            return reached;
        }
        let shift = self.shift;
        self.set_goals(how, &shift, &mut scratch.goal);
        let Scratch { nearby, goal, directions, axes } = scratch;
        directions.clear();
        axes.clear();
        if shift != DVec3::zeros() {
            self.out[0] = to_f32(goal[0]);
        }
        nearby.keep_around(self.kept_margin());
        let largest = self.goal.iter().fold(0.0, |most: f32, cv| most.max(vector::largest(*cv)));
        let mut carried = Carried { rotation: DQuat::identity(), before: DVec3::zeros() };
        let mut change = LengthChange::default();
        let free_from = self.free_from(how, goal, largest);
        for k in 0..cvs - 1 {
            if k >= free_from && self.out[k] == self.goal[k] && reached.unfreed_segments == 0 {
                self.keep_goals(k, &mut change);
                break;
            }
            let (along, own) = (goal[k + 1] - goal[k], to_f64(self.goal[k + 1]) - to_f64(self.goal[k]));
            let length = own.norm();
            // Most goals are neither displaced nor raised.
            let distance = if same(&along, &own) { length } else { along.norm() };
            if length == 0.0 || distance == 0.0 {
                self.out[k + 1] = self.out[k];
                directions.push(DVec3::zeros());
                change.add(length, 0.0);
                continue;
            }
            let wanted = along / distance;
            let rounding = 1.2e-7 * (f64::from(largest) + length);
            let (segment, ground) = self.segment(how, k, (&wanted, &goal[k..]), [length, rounding], &carried, axes);
            let way_out = ground.map(|(up, rest)| WayOut { up, rest, others });
            // Not if the skin redirects the segment, or if its goal was raised.
            let may_keep_goal = same(&segment.to, &wanted) && same(&goal[k + 1], &to_f64(self.goal[k + 1]));
            let direction = self.turn(how, k, (&segment, way_out.as_ref()), may_keep_goal, nearby, &mut reached);
            change.add(length, (to_f64(self.out[k + 1]) - segment.pivot).norm());
            let is_last = k + 2 == cvs;
            if !is_last {
                carried.rotation = smallest_rotation(&segment.from, &direction, segment.axes) * carried.rotation;
            }
            carried.before = direction;
            directions.push(direction);
        }
        let fell_back = reached.unfreed_segments > 0 && self.fall_back(how, directions);
        if fell_back {
            (reached.unfreed_segments, reached.deepest_overlap, reached.blended_to_rest) = (0, 0.0, 1);
        }
        let blended = self.blend(how, &shift);
        reached.crossings_left = if blended { self.crossings(how) } else { reached.unfreed_segments };
        reached.length_error = if blended || fell_back { self.length_error() } else { change.share() };
        if how.width.value > 0.0 {
            self.measure_clearance(how, nearby, &mut reached);
        }
        reached
    }

    /// The segment from which on all keep their goals if the first of them starts at its own: they meet nothing however they turn.
    /// The number of segments if there is none.
    #[inline(always)]
    fn free_from(&self, how: &Collide<'_>, goal: &[DVec3], largest: f32) -> usize {
        let mut first = self.goal.len() - 1;
        let redirects = how.width.value != 0.0 || how.coherence.value != 0.0 || self.shift != DVec3::zeros();
        let Some(half_space) = self.half_space.filter(|_| !redirects) else { return first };
        let root = to_f64(self.rest[0]);
        while first > 0 {
            let k = first - 1;
            let (pivot, end) = (to_f64(self.goal[k]), to_f64(self.goal[k + 1]));
            let length = (end - pivot).norm();
            let rounding = 1.2e-7 * (f64::from(largest) + length);
            let are_own = same(&goal[k], &pivot) & same(&goal[k + 1], &end);
            let gap = how.gap_at(self.first + k);
            if !are_own || !half_space.frees_any_turn(&root, &pivot, [length, gap, rounding]) {
                break;
            }
            first = k;
        }
        first
    }

    /// Writes the goals of the segments from the one from CV `first` on.
    #[inline(always)]
    fn keep_goals(&mut self, first: usize, change: &mut LengthChange) {
        for k in first..self.goal.len() - 1 {
            let length = (to_f64(self.goal[k + 1]) - to_f64(self.goal[k])).norm();
            self.out[k + 1] = if length == 0.0 { self.out[k] } else { self.goal[k + 1] };
            change.add(length, length);
        }
    }

    /// How far around a segment blocks of obstacles are kept for the next ones, metres; 0 for curves of few segments.
    #[inline(always)]
    fn kept_margin(&self) -> f32 {
        if self.goal.len() < MANY_CVS {
            return 0.0;
        }
        let mut whole = 0.0;
        for k in 1..self.goal.len() {
            whole += (to_f64(self.goal[k]) - to_f64(self.goal[k - 1])).norm();
        }
        (KEPT_SEGMENTS * whole / (self.goal.len() - 1) as f64) as f32
    }

    /// The segment from CV k, about to turn towards the unit vector `wanted`, along the goals from CV k on; with coherence,
    /// the skin's normal under it and its direction at rest.
    #[inline(always)]
    fn segment<'a>(
        &self,
        how: &Collide<'_>,
        k: usize,
        (wanted, goal): (&DVec3, &[DVec3]),
        [length, rounding]: [f64; 2],
        carried: &Carried,
        axes: &'a mut TurnAxes,
    ) -> (Segment<'a>, Option<(DVec3, DVec3)>) {
        let rest = to_f64(self.rest[k + 1]) - to_f64(self.rest[k]);
        let rest = (rest.norm() > 0.0).then(|| rest / rest.norm());
        let from = rest.map_or(*wanted, |rest| carried.rotation * rest);
        axes.push(from);
        let pivot = to_f64(self.out[k]);
        let (mut to, mut way_out) = (*wanted, None);
        if let Some((ground, coherence)) = how.ground(self.first + k, &pivot, length, goal) {
            to = part_way(wanted, &ground.lead_out(&from, wanted, length), &axes.last(), coherence);
            way_out = Some((ground.normal, rest.unwrap_or(*wanted)));
        }
        let width = f64::from(how.width.at(self.first + k));
        let segment = Segment {
            pivot,
            from,
            to,
            axes,
            before: carried.before,
            length,
            half: if width > 0.0 { 0.5 * width + rounding } else { 0.0 },
            is_round: width > 0.0,
            gap: how.gap_at(self.first + k),
            inner: self.untested(how, k),
            rounding,
        };
        (segment, way_out)
    }

    /// Length at the start of the segment from CV k that is not tested.
    #[inline(always)]
    pub(super) fn untested(&self, how: &Collide<'_>, k: usize) -> f64 {
        if k > 0 {
            return 0.0;
        }
        let gap = how.gap_at(self.first);
        if how.offset_root_at(self.first) < gap { SKIPPED_GAPS * gap } else { 0.0 }
    }

    /// Turns the segment from CV k and writes its end; returns its direction.
    #[inline(always)]
    fn turn<'t>(
        &mut self,
        how: &Collide<'t>,
        k: usize,
        (segment, way_out): (&Segment<'_>, Option<&WayOut<'t>>),
        may_keep_goal: bool,
        nearby: &mut Nearby<'t>,
        reached: &mut Reached,
    ) -> DVec3 {
        let is_free = match self.half_space {
            Some(half_space) => half_space.frees(&(to_f64(self.rest[0]) + self.shift), segment),
            None => false,
        };
        // One call for both attempts: what is inlined here is most of the kernel, and compiled once.
        let mut wary: Option<Segment<'_>> = None;
        let (turned, end) = loop {
            let turned = match &wary {
                None if is_free => Turned { direction: segment.to, met: false, clear: true },
                wary => turned_by(how, wary.as_ref().unwrap_or(segment), way_out, nearby),
            };
            let keeps_goal = wary.is_none() && !turned.met && may_keep_goal && self.out[k] == self.goal[k];
            let end = if keeps_goal { self.goal[k + 1] } else { segment.end(&turned.direction) };
            let crossing = match turned.clear {
                true => None,
                false => first_crossing(nearby.blocks(), segment.start(&turned.direction), end),
            };
            if crossing.is_some() && wary.is_none() {
                wary = Some(segment.wary());
                continue;
            }
            if let Some(crossing) = crossing {
                reached.unfreed_segments += 1;
                reached.deepest_overlap = reached.deepest_overlap.max(crossing.depth);
            }
            break (turned, end);
        };
        reached.contacts += u64::from(turned.met);
        self.out[k + 1] = end;
        turned.direction
    }

    /// Number of written segments that cross something.
    #[inline(always)]
    fn crossings(&self, how: &Collide<'_>) -> u64 {
        let mut count = 0;
        for k in 1..self.out.len() {
            count += u64::from(first_crossing_in(how.obstacles, self.out[k - 1], self.out[k]).is_some());
        }
        count
    }

    /// The largest change of a segment's length, relative to the curve's.
    fn length_error(&self) -> f64 {
        let mut change = LengthChange::default();
        let length = |cvs: &[Vec3], k: usize| (to_f64(cvs[k]) - to_f64(cvs[k - 1])).norm();
        for k in 1..self.out.len() {
            change.add(length(self.goal, k), length(self.out, k));
        }
        change.share()
    }

    fn is_finite(&self) -> bool {
        are_finite(self.goal) & are_finite(self.rest)
    }

    /// The CVs' goals: the input, or kept off the skin by a share of their rest heights.
    #[inline(always)]
    pub(super) fn set_goals(&self, how: &Collide<'_>, shift: &DVec3, goals: &mut Vec<DVec3>) {
        goals.clear();
        let around = self.around.as_ref().filter(|_| how.loft.value > 0.0);
        match (how.offset_scale, &how.skin, around) {
            (Some(scale), Some(skin), _) => self.raise_goals(shift, goals, |k, before, step| {
                skin.raised(self.rest[k], before, step, scale.value * self.factor(&scale, k))
            }),
            (None, _, Some(around)) => {
                self.loft_goals(around, shift, goals, |k| {
                    let coherence = how.coherence_at(self.first + k);
                    (how.loft.value * (1.0 - coherence) * self.factor(&how.loft, k)).min(1.0)
                });
            }
            _ => goals.extend(self.goal.iter().map(|cv| to_f64(*cv) + shift)),
        }
    }

    /// What a mask scales a number by at CV k, 0 or more.
    #[inline(always)]
    fn factor(&self, number: &Masked<'_, f64>, k: usize) -> f64 {
        f64::from(number.factor(self.first + k)).max(0.0)
    }

    /// Goals from the root on, each segment replaced by what `raised` makes of its CV, the goal before it, and its step
    /// towards its own goal.
    #[inline(always)]
    fn raise_goals(
        &self,
        shift: &DVec3,
        goals: &mut Vec<DVec3>,
        raised: impl Fn(usize, &DVec3, &DVec3) -> Option<DVec3>,
    ) {
        let mut before = to_f64(self.goal[0]);
        goals.push(before + shift);
        for k in 1..self.goal.len() {
            let (from, to) = (to_f64(self.goal[k - 1]), to_f64(self.goal[k]));
            // Lengths are kept root to tip: only the direction to the goal counts.
            let along = to - before;
            let length = (to - from).norm();
            let step = if along.norm() > 0.0 { along * (length / along.norm()) } else { to - from };
            before += raised(k, &before, &step).unwrap_or(step);
            goals.push(before + shift);
        }
    }

    /// Goals of which none lies lower above the skin around the root than its share of the rest height: a segment whose end
    /// would is turned from rest towards its own goal until it reaches that height, wherever its curve has been led.
    #[inline(always)]
    fn loft_goals(&self, around: &RootSurface, shift: &DVec3, goals: &mut Vec<DVec3>, share: impl Fn(usize) -> f64) {
        let [root, rest_root] = [self.goal, self.rest].map(|cvs| to_f64(cvs[0]));
        let mut before = root;
        goals.push(before + shift);
        for k in 1..self.goal.len() {
            let step = to_f64(self.goal[k]) - to_f64(self.goal[k - 1]);
            let rest = to_f64(self.rest[k]) - to_f64(self.rest[k - 1]);
            let wanted = share(k) * around.height(&(to_f64(self.rest[k]) - rest_root));
            before += around.lofted(&(before - root), &step, &rest, wanted).unwrap_or(step);
            goals.push(before + shift);
        }
    }

    /// Turns each segment back towards its goal by 1 − `blend`; returns whether any turned.
    fn blend(&mut self, how: &Collide<'_>, shift: &DVec3) -> bool {
        let share = |k: usize| f64::from(how.blend.at(self.first + k)).clamp(0.0, 1.0);
        if (0..self.out.len()).all(|k| share(k) == 1.0) {
            return false;
        }
        let mut before = self.out[0];
        self.out[0] = to_f32(to_f64(self.goal[0]) + shift * share(0));
        for k in 1..self.out.len() {
            let (goal, end) = (to_f64(self.goal[k]) - to_f64(self.goal[k - 1]), to_f64(self.out[k]) - to_f64(before));
            before = self.out[k];
            let (Some(to), Some(from)) = (end.try_normalize(0.0), goal.try_normalize(0.0)) else {
                self.out[k] = self.out[k - 1];
                continue;
            };
            self.out[k] = if share(k - 1) == 0.0 && self.out[k - 1] == self.goal[k - 1] {
                self.goal[k]
            } else {
                let axis = perpendicular(&from, &DVec3::zeros());
                let direction = part_way(&from, &to, &axis, share(k - 1));
                to_f32(to_f64(self.out[k - 1]) + direction * goal.norm())
            };
        }
        true
    }
}

/// Whether two vectors are equal. Without the iterator of the library's comparison, which stays a loop.
#[inline(always)]
fn same(a: &DVec3, b: &DVec3) -> bool {
    (a.x == b.x) & (a.y == b.y) & (a.z == b.z)
}

/// How the lengths of a curve's segments change.
#[derive(Default)]
struct LengthChange {
    /// The largest change, and the sum of the lengths before, metres.
    largest: f64,
    whole: f64,
}

impl LengthChange {
    #[inline(always)]
    fn add(&mut self, before: f64, now: f64) {
        self.largest = self.largest.max((now - before).abs());
        self.whole += before;
    }

    /// The largest change, relative to the curve's length; 0 for a curve without length.
    #[inline(always)]
    fn share(&self) -> f64 {
        if self.whole > 0.0 { self.largest / self.whole } else { 0.0 }
    }
}

/// How a segment's turn ends. Not a closure: one as large is not inlined, and compiled without the path's instructions.
#[inline(always)]
fn turned_by<'t>(
    how: &Collide<'t>,
    segment: &Segment<'_>,
    way_out: Option<&WayOut<'t>>,
    nearby: &mut Nearby<'t>,
) -> Turned {
    if let Some(way_out) = way_out
        && let Some(turned) = segment.turn_coherently(how.method, way_out, how.obstacles, nearby)
    {
        return turned;
    }
    segment.turn(how.method, how.obstacles, nearby)
}

/// Spherical interpolation from one unit vector to another; through `axis` × `from` if they are opposite.
pub(super) fn part_way(from: &DVec3, to: &DVec3, axis: &DVec3, share: f64) -> DVec3 {
    let turn = from.cross(to);
    let (sine, cosine) = (turn.norm(), from.dot(to));
    let n = if sine > 1e-9 { turn / sine } else { *axis };
    let (sine, cosine) = libm::sincos(share * libm::atan2(sine, cosine));
    from * cosine + n.cross(from) * sine
}

/// The smallest rotation from one unit vector to another; about the last of `axes` if they are opposite.
fn smallest_rotation(from: &DVec3, to: &DVec3, axes: &TurnAxes) -> DQuat {
    let real = 1.0 + from.dot(to);
    let imaginary = if real > 1e-12 { from.cross(to) } else { axes.last() };
    DQuat::new_normalize(Quaternion::from_parts(if real > 1e-12 { real } else { 0.0 }, imaginary))
}
