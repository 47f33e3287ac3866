//! The turn of one segment: first out of anything that it already crosses, then towards its goal until it meets
//! something.

use super::crossing::{Crossing, corners, first_crossing};
use super::sector::Sector;
use super::triangle_filter::Wedge;
use super::turn_axes::TurnAxes;
use super::{ContactMethod, perpendicular};
use numerics::lanes::LANES;
use numerics::tree::{Block, Boxes, Cuboid, Region, TriangleTree};
use numerics::vector::{DVec3, Vec3, to_f32};
use std::f64::consts::PI;

/// How perpendicular to a surface a segment has to be for the shape of the curve to decide the direction out.
const STRAIGHT_IN: f64 = 1e-3;

/// A segment about to turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment<'a> {
    /// The fixed end.
    pub(super) pivot: DVec3,
    /// Its direction, and that of its goal: unit.
    pub(super) from: DVec3,
    pub(super) to: DVec3,
    /// The last of them is the axis about which it turns if the two are opposite.
    pub(super) axes: &'a TurnAxes,
    /// Direction of the previous segment; zero at the root.
    pub(super) before: DVec3,
    pub(super) length: f64,
    /// Half its thickness.
    pub(super) half: f64,
    /// Whether its curve has a width: it is a capsule.
    pub(super) is_round: bool,
    /// Arc length kept from contacts.
    pub(super) gap: f64,
    /// Length next to the pivot that is not tested.
    pub(super) inner: f64,
    /// Rounding error of the written positions.
    pub(super) rounding: f64,
}

/// How a turn ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turned {
    /// Its direction now.
    pub(super) direction: DVec3,
    /// Whether something stopped it before its goal.
    pub(super) met: bool,
    /// Whether nothing was near the swept sector, so that it crosses nothing, however positions are rounded.
    pub(super) clear: bool,
}

/// Blocks of trees that a segment may meet, with a bit for each triangle.
#[derive(Default)]
pub(super) struct Nearby<'t> {
    blocks: Vec<(&'t Block, u16)>,
    kept: Kept<'t>,
}

impl<'t> Nearby<'t> {
    /// From now on what is nearer than `margin` metres to what a segment may meet is kept for the next ones, unless that is
    /// much; 0 keeps nothing. It pays for curves of many short segments: they meet the same few blocks one after another.
    #[inline(always)]
    pub(super) fn keep_around(&mut self, margin: f32) {
        self.kept.margin = if margin > 0.0 { margin } else { 0.0 };
        self.kept.obstacles = 0;
    }

    #[inline(always)]
    pub(super) fn iter(&self) -> std::slice::Iter<'_, (&'t Block, u16)> {
        self.blocks.iter()
    }

    /// Those found.
    #[inline(always)]
    pub(super) fn blocks(&self) -> &[(&'t Block, u16)] {
        &self.blocks
    }

    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }
}

/// Number of blocks that are kept: to go through more takes longer than to find them in a tree.
const MOST_KEPT: usize = 16;

/// The blocks in a box around segments.
#[derive(Default)]
struct Kept<'t> {
    /// How much larger than the box of a segment it is on each side, metres; 0: nothing is kept.
    margin: f32,
    low: Vec3,
    high: Vec3,
    /// Address of the list of trees; 0: of none.
    obstacles: usize,
    /// The blocks, the boxes of their triangles, and a bit for each lane that has one.
    blocks: Vec<(&'t Block, Boxes, u16)>,
}

impl Kept<'_> {
    /// Whether it is of these trees and holds a box.
    #[inline(always)]
    fn holds(&self, obstacles: usize, low: Vec3, high: Vec3) -> bool {
        let mut holds = self.obstacles == obstacles;
        for axis in 0..3 {
            holds &= (low[axis] >= self.low[axis]) & (high[axis] <= self.high[axis]);
        }
        holds
    }
}

impl Segment<'_> {
    /// Turns by `method`. Afterwards `nearby` holds everything that the segment may cross in its new direction.
    #[inline(always)]
    pub(super) fn turn<'t>(
        &self,
        method: ContactMethod,
        obstacles: &[&'t TriangleTree],
        nearby: &mut Nearby<'t>,
    ) -> Turned {
        let (mut from, mut is_out) = (self.from, false);
        loop {
            match self.sweep(from, method, obstacles, nearby) {
                Sweep::Free(turned) => return Turned { met: turned.met || is_out, ..turned },
                Sweep::Stuck if is_out => return Turned { direction: from, met: true, clear: false },
                Sweep::Stuck => match self.turn_out(method, obstacles, nearby) {
                    None => return Turned { direction: from, met: true, clear: false },
                    Some(direction) => (from, is_out) = (direction, true),
                },
            }
        }
    }

    /// For use after a turn that ended in a crossing: obstacles are thickened by the rounding error.
    pub(super) fn wary(&self) -> Self {
        Self { half: self.half + 8.0 * self.rounding, gap: self.gap + 8.0 * self.rounding, ..*self }
    }

    /// The sector of a turn from one unit vector towards another.
    #[inline(always)]
    pub(super) fn sector(&self, from: DVec3, towards: DVec3) -> Sector {
        let axis = from.cross(&towards);
        let sine = axis.norm();
        let n = if sine > 1e-9 { axis / sine } else { perpendicular(&from, &self.axes.last()) };
        Sector {
            pivot: self.pivot,
            u: from,
            v: n.cross(&from),
            n,
            reach: self.length + self.half + self.rounding,
            inner: self.inner,
            half: self.half,
            capsule: self.is_round.then_some(self.length + self.rounding),
            back: self.gap,
        }
    }

    #[inline(always)]
    fn sweep<'t>(
        &self,
        from: DVec3,
        method: ContactMethod,
        obstacles: &[&'t TriangleTree],
        nearby: &mut Nearby<'t>,
    ) -> Sweep {
        let sector = self.sector(from, self.to);
        let (low, high) = sector.bounds(&self.to);
        gather(obstacles, low, high, nearby);
        if nearby.is_empty() {
            return Sweep::Free(Turned { direction: self.to, met: false, clear: true });
        }
        let stop = match method {
            ContactMethod::Exact => first_stop(&sector, &self.to, nearby),
            ContactMethod::Steps(steps) => self.last_free_step(&sector, steps, nearby),
        };
        match stop {
            Stop::Stuck => Sweep::Stuck,
            Stop::Clear => Sweep::Free(Turned { direction: self.to, met: false, clear: true }),
            Stop::None => Sweep::Free(Turned { direction: self.to, met: false, clear: false }),
            Stop::At(direction) => Sweep::Free(Turned { direction, met: true, clear: false }),
        }
    }

    /// The end of the segment in this direction, rounded as written.
    pub(super) fn end(&self, direction: &DVec3) -> Vec3 {
        to_f32(self.pivot + direction * self.length)
    }

    /// The start of its tested part in this direction.
    pub(super) fn start(&self, direction: &DVec3) -> Vec3 {
        to_f32(self.pivot + direction * self.inner)
    }

    #[inline(always)]
    fn crosses(&self, direction: &DVec3, nearby: &Nearby<'_>) -> Option<Crossing> {
        first_crossing(nearby.blocks(), self.start(direction), self.end(direction))
    }

    /// The paper's method: small steps until one crosses.
    #[inline(always)]
    fn last_free_step(&self, sector: &Sector, steps: u32, nearby: &Nearby<'_>) -> Stop {
        let angle = sector.angle_of(&self.to);
        let at = |step: u32| angle * f64::from(step) / f64::from(steps);
        let near = self.near(sector, nearby, angle);
        if self.crosses(&sector.u, nearby).is_some() || near.contain(0.0) {
            return Stop::Stuck;
        }
        for step in 1..=steps {
            let direction = if step == steps { self.to } else { sector.direction(at(step)) };
            if near.contain(at(step)) || self.crosses(&direction, nearby).is_some() {
                return Stop::At(sector.direction(at(step - 1)));
            }
        }
        Stop::None
    }

    /// The angles up to `most` at which a thick segment is too near to something; none of a thin one.
    fn near(&self, sector: &Sector, nearby: &Nearby<'_>, most: f64) -> Taken {
        if self.half > 0.0 { Taken::of(sector, nearby, most, |_| 0.0) } else { Taken::default() }
    }

    /// The normal, on the pivot's side, of the triangle that a thick segment is too near to at its start, and that it must turn
    /// farthest away from.
    fn too_near(&self, sector: &Sector, nearby: &Nearby<'_>) -> Option<DVec3> {
        let mut farthest: Option<(f64, DVec3)> = None;
        for (block, lanes) in nearby.iter() {
            for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
                let corners = corners(block, lane);
                sector.blocked_by(&corners, |blocked| {
                    let angle = blocked.hi.min(-blocked.lo);
                    if angle >= 0.0 && farthest.is_none_or(|(known, _)| angle > known) {
                        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
                        let side = normal.dot(&(self.pivot - corners[0]));
                        farthest = Some((angle, normal * (side.signum() / normal.norm())));
                    }
                });
            }
        }
        farthest.map(|(_, normal)| normal).filter(|normal| normal.x.is_finite())
    }

    /// The nearest free direction on the great circle away from what the segment crosses; `None` if there is none
    /// within half a turn.
    #[inline(always)]
    fn turn_out<'t>(
        &self,
        method: ContactMethod,
        obstacles: &[&'t TriangleTree],
        nearby: &mut Nearby<'t>,
    ) -> Option<DVec3> {
        let crossed = self.crosses(&self.from, nearby).map(|crossed| crossed.normal);
        let too_near = || self.too_near(&self.sector(self.from, self.to), nearby);
        let crossed = crossed.or_else(|| if self.half > 0.0 { too_near() } else { None });
        // Perpendicular to the surface, all directions out are equally near: the one that bends the curve least is
        // chosen.
        let outwards = match crossed {
            Some(normal) => normal + self.before * STRAIGHT_IN,
            None => self.axes.last(),
        };
        let sector = self.sector(self.from, outwards);
        let (low, high) = sector.bounds(&-sector.u);
        gather(obstacles, low, high, nearby);
        let angle = match method {
            ContactMethod::Exact => first_gap(&sector, nearby, PI, |radius| 1.001 * sector.back / radius),
            ContactMethod::Steps(steps) => {
                let at = |step: u32| PI * f64::from(step) / f64::from(steps);
                let near = self.near(&sector, nearby, PI);
                let is_free =
                    |angle: &f64| !near.contain(*angle) && self.crosses(&sector.direction(*angle), nearby).is_none();
                (1..=steps).map(at).find(is_free)
            }
        };
        angle.map(|angle| sector.direction(angle))
    }
}

/// The result of a sweep.
enum Sweep {
    Free(Turned),
    /// It is blocked at its start.
    Stuck,
}

/// Gathers all blocks of the trees that a box meets.
#[inline(always)]
pub(super) fn gather<'t>(obstacles: &[&'t TriangleTree], low: Vec3, high: Vec3, nearby: &mut Nearby<'t>) {
    nearby.blocks.clear();
    let kept = &mut nearby.kept;
    let address = obstacles.as_ptr().addr();
    while kept.margin == 0.0 || !kept.holds(address, low, high) {
        let keeps = kept.margin > 0.0;
        let mut around = Cuboid { low, high };
        if keeps {
            for axis in 0..3 {
                around.low[axis] -= kept.margin;
                around.high[axis] += kept.margin;
            }
            (kept.low, kept.high, kept.obstacles) = (around.low, around.high, address);
            kept.blocks.clear();
        }
        'trees: for tree in obstacles {
            for (index, lanes) in tree.walk(around) {
                let block = &tree.blocks()[index];
                if !keeps {
                    nearby.blocks.push((block, lanes));
                } else if kept.blocks.len() < MOST_KEPT {
                    kept.blocks.push((block, block.boxes(), block.filled()));
                } else {
                    kept.margin = 0.0;
                    break 'trees;
                }
            }
        }
        if !keeps {
            return;
        }
        if kept.margin > 0.0 {
            break;
        }
    }
    let region = Cuboid { low, high };
    for (block, boxes, filled) in &kept.blocks {
        let lanes = region.meeting(boxes) & filled;
        if lanes != 0 {
            nearby.blocks.push((block, lanes));
        }
    }
}

/// Where a sweep stops.
enum Stop {
    /// At the goal: nothing is near.
    Clear,
    /// At the goal.
    None,
    /// In this direction, before something.
    At(DVec3),
    /// It is blocked at its start.
    Stuck,
}

/// Sine of an angle above which rounding does not decide which of two directions a turn comes to first.
const CLEARLY_APART: f64 = 1e-8;

/// How far the sector may turn towards the unit vector `to` in its plane. Removes from `nearby` what it cannot meet.
#[inline(always)]
fn first_stop(sector: &Sector, to: &DVec3, nearby: &mut Nearby<'_>) -> Stop {
    let mut until = [sector.u.dot(to), sector.v.dot(to).max(0.0)];
    let mut wedge = None;
    // The angle of `to` is needed where something is met near it.
    let (mut stop, mut whole, mut clear): (Option<f64>, Option<f64>, bool) = (None, None, true);
    for (block, near) in &mut nearby.blocks {
        *near = within(&mut wedge, sector, until, block, *near);
        let mut lanes = *near;
        clear &= lanes == 0;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let found = sector.obstruction(until, &corners(block, lane));
            if found.at_start {
                return Stop::Stuck;
            }
            let Some(next) = found.stop else { continue };
            if stop.is_some_and(|stop| next >= stop) {
                continue;
            }
            let (sine, cosine) = libm::sincos(next);
            if stop.is_none() {
                // The sine of the angle from there to `to`: both lie in 0…π.
                let left = until[1] * cosine - until[0] * sine;
                let is_before = match left.abs() > CLEARLY_APART {
                    true => left > 0.0,
                    false => next < *whole.get_or_insert_with(|| sector.angle_of(to)),
                };
                if !is_before {
                    continue;
                }
            }
            stop = Some(next);
            until = [cosine, sine];
            wedge = None;
            lanes = within(&mut wedge, sector, until, block, lanes);
        }
    }
    match stop {
        // As `Sector::direction`, whose sine and cosine these are.
        Some(angle) => Stop::At(if angle == 0.0 { sector.u } else { sector.u * until[0] + sector.v * until[1] }),
        None if clear => Stop::Clear,
        None => Stop::None,
    }
}

/// Number of triangles of a block that are tested one by one, rather than to exclude some of them sixteen at a time.
const FEW: u32 = 2;

/// Those `lanes` of a block that may be met up to the angle of this cosine and sine; `wedge` is made where it is needed.
#[inline(always)]
fn within(wedge: &mut Option<Wedge>, sector: &Sector, until: [f64; 2], block: &Block, lanes: u16) -> u16 {
    if lanes.count_ones() <= FEW {
        return lanes;
    }
    let wedge = match wedge {
        Some(wedge) => wedge,
        None => wedge.insert(Wedge::new(sector, until)),
    };
    lanes & wedge.may_meet(block)
}

/// The first angle up to `most` at which nothing is within the angle `kept` from a contact at a radius.
#[inline(always)]
pub(super) fn first_gap(sector: &Sector, nearby: &Nearby<'_>, most: f64, kept: impl Fn(f64) -> f64) -> Option<f64> {
    let mut angle = 0.0;
    for [lo, hi] in Taken::of(sector, nearby, most, kept).0 {
        if lo > angle {
            break;
        }
        if hi >= angle {
            angle = hi;
        }
    }
    (angle <= most).then_some(angle)
}

/// Intervals of angles at which a sector is blocked, by their starts.
#[derive(Default)]
struct Taken(Vec<[f64; 2]>);

impl Taken {
    /// Those up to `most`, each widened by the angle `kept` from a contact at a radius.
    #[inline(always)]
    fn of(sector: &Sector, nearby: &Nearby<'_>, most: f64, kept: impl Fn(f64) -> f64) -> Self {
        let (sine, cosine) = if most < PI { libm::sincos(most) } else { (0.0, -1.0) };
        let wedge = Wedge::new(sector, [cosine, sine]);
        let mut taken: Vec<[f64; 2]> = Vec::new();
        for (block, lanes) in nearby.iter() {
            let mut lanes = lanes & wedge.may_meet(block);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                sector.blocked_by(&corners(block, lane), |blocked| {
                    let [lo, hi] = [blocked.lo - kept(blocked.lo_radius), blocked.hi + kept(blocked.hi_radius)];
                    taken.push([lo, hi]);
                    taken.push([lo - std::f64::consts::TAU, hi - std::f64::consts::TAU]);
                });
            }
        }
        taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Self(taken)
    }

    fn contain(&self, angle: f64) -> bool {
        self.0.iter().any(|[lo, hi]| (*lo..=*hi).contains(&angle))
    }
}

impl Sector {
    /// The angle of the unit vector `to` in its plane: 0…π.
    pub(super) fn angle_of(&self, to: &DVec3) -> f64 {
        libm::atan2(self.u.cross(to).norm(), self.u.dot(to))
    }

    /// Bounds of everything it sweeps while it turns to the unit vector `end` in its plane.
    #[inline(always)]
    pub(super) fn bounds(&self, end: &DVec3) -> (Vec3, Vec3) {
        let (sine, cosine) = (end.dot(&self.v), end.dot(&self.u));
        let past = self.u * sine - self.v * cosine;
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let (u, v) = (self.u[axis], self.v[axis]);
            let (mut least, mut most) = (0.0_f64.min(u).min(end[axis]), 0.0_f64.max(u).max(end[axis]));
            // The farthest points of the whole circle along this axis lie at ±(u, v)/|(u, v)|; one counts where the
            // sector turns past it: forwards from u, and not farther than the end.
            if v >= 0.0 && past[axis] >= 0.0 {
                most = (u * u + v * v).sqrt();
            }
            if v <= 0.0 && past[axis] <= 0.0 {
                least = -(u * u + v * v).sqrt();
            }
            let slack = self.half + (self.back + self.half) + 1e-6 * (self.reach + self.pivot[axis].abs());
            low[axis] = (self.pivot[axis] + least * self.reach - slack) as f32;
            high[axis] = (self.pivot[axis] + most * self.reach + slack) as f32;
        }
        (low, high)
    }
}
