//! The liquid that a surface does not keep as it moves, given back in each region of it.

use std::mem::replace;

use numerics::vector::{Vec3, scale, sub};

use crate::level_set::{PhiView, floor};
use crate::rows::{Cell, CellRows, Finder, PlacedSpan};
use crate::step::continuity::Swelling;
use crate::step::domain::{Domain, Obstacle, Wall};
use crate::step::pools::Pools;
use crate::step::regions::{Lack, Regions, Sums};
use crate::step::shares::{Shares, WHOLE, inner};
use crate::step::sources::SourceShape;
use crate::step::{Moving, Owed, Surface};
use crate::velocity::Site;

/// A way outward, in cells, by which what a cell gains by one is measured.
const WAY: f32 = 0.1;

/// φ of a cell, in cells, below which it may show a surface.
pub(super) const SHOWN: f32 = 0.5;

/// |φ| of a cell, in cells, up to which what moves the surface is read.
pub(super) const NEAR: f32 = 4.0;

/// How far, in cells, a surface swells in a region at least for another look at what it lacks.
const WORTH_A_LOOK: f64 = 0.03;

/// What is missing after the surface has swelled ÷ what was before, above which another look is not worth its time.
const STUCK: f64 = 0.5;

/// How far a surface swells in any region, in cells, at least: less is rounding.
const LEAST_WAY: f64 = 1e-7;

/// Stretches of cells that are summed each by itself, so that threads may share the work.
pub(super) const STRETCHES: usize = 64;

/// Cells, besides its way, within which liquid comes in or goes by other ways: through an open side, a source or a sink.
const BESIDE: f32 = 2.0;

/// The liquid in cells.
pub(super) struct Held {
    /// All cells that have liquid, and those that it may come to.
    rows: CellRows,
    /// The volume in each, ÷ that of a cell.
    volume: Vec<f32>,
    /// Its middle, in cells.
    middle: [Vec<f32>; 3],
    /// Which liquid is on which side, where it is beside a thin solid that counts.
    pools: Option<Pools>,
}

impl Held {
    /// `rows`: the cells of a velocity that moves nothing farther than `reach` cells.
    pub(super) fn of(rows: &CellRows, surface: &dyn Surface, others: &Others<'_>, reach: f32) -> Self {
        // A surface on smaller cells has sheets too thin to be liquid for the velocity, which may be far from what is.
        let view = surface.view();
        let beyond = view.rows.filtered(|cell, at| view.phi[at] < WHOLE && rows.find(cell).is_none());
        let rows = rows.union(&beyond.dilated(reach.ceil() as i32 + 1));
        let [solid, _] = others.counted();
        let shares = Shares::of(surface, others.domain, solid);
        let [volume, x, y, z] = rows.tabulate_with(
            || shares.reader(),
            |share, cell, _| {
                let ([share], [x, y, z]) = share(cell, [0.0]);
                [share, x, y, z]
            },
        );
        let thin = solid.filter(|_| others.is_thin);
        let pools = thin.map(|solid| Pools::of(&rows, &volume, others.domain, solid, reach));
        Self { rows, volume, middle: [x, y, z], pools }
    }

    fn middle(&self, at: usize) -> Vec3 {
        [0, 1, 2].map(|axis| self.middle[axis][at])
    }

    /// The cells that liquid has reached through a thin solid.
    pub(super) fn come_through(&self, view: &PhiView<'_>) -> Option<CellRows> {
        let pools = self.pools.as_ref()?;
        let cells = self
            .rows
            .filtered(|cell, at| pools.is_sealed(at) && view.rows.find(cell).is_some_and(|at| view.phi[at] < SHOWN));
        (!cells.is_empty()).then_some(cells)
    }

    /// How many accounts there are; with pools, the last one is for liquid that is in none of them.
    fn accounts(&self) -> usize {
        self.pools.as_ref().map_or(1, |pools| pools.count() + 1)
    }

    /// The account of the liquid in a cell.
    fn account(&self, at: usize) -> usize {
        self.pools.as_ref().and_then(|pools| pools.at(at)).unwrap_or(0)
    }

    /// The account of liquid that is in a cell now and was at a place before.
    fn account_of(&self, finder: &Finder<'_>, domain: &Domain, at: usize, before: Vec3) -> usize {
        let Some(pools) = &self.pools else { return 0 };
        let there = finder.find(inner(domain, before.map(floor))).and_then(|at| pools.at(at));
        there.unwrap_or_else(|| self.account(at))
    }
}

/// What takes liquid away, brings some, or has its surface go on into it, in other ways than by its flow.
pub(super) struct Others<'a> {
    pub domain: &'a Domain,
    /// The solid at the start and at the end of the substep.
    pub solids: Option<[Obstacle<'a>; 2]>,
    /// Whether cells beside the solid hold what flows to them: not where it passes over liquid.
    pub is_counted: bool,
    /// Whether liquid is beside a thin part of it.
    pub is_thin: bool,
    /// Sources and sinks, and when.
    pub shapes: &'a [SourceShape<'a>],
    pub time: f64,
}

impl<'a> Others<'a> {
    /// The solid beside which cells hold what flows to them, at the start and at the end.
    fn counted(&self) -> [Option<Obstacle<'a>>; 2] {
        let solids = self.solids.filter(|_| self.is_counted);
        [0, 1].map(|end| solids.map(|solids| solids[end]))
    }

    /// Whether one is within `reach` cells of a cell.
    fn are_near(&self, cell: Cell, reach: f32) -> bool {
        let Self { domain, shapes, time, .. } = self;
        let place = Site::Centre.of(cell);
        let is_open = |axis: usize| {
            let [below, above] = domain.walls[axis].map(|wall| wall == Wall::Open);
            let [low, high] = domain.bounds().map(|corner| corner[axis]);
            below && place[axis] - low < reach || above && high - place[axis] < reach
        };
        let within = |SourceShape { distance, bounds: [low, high] }: &SourceShape<'_>| {
            let is_beside = (0..3).all(|n| place[n] > low[n] as f32 - reach && place[n] < high[n] as f32 + reach);
            is_beside && distance(*time, place) < reach
        };
        let is_beside = |[_, solid]: [Obstacle<'_>; 2]| !self.is_counted && solid.distance(place) < reach;
        (0..3).any(is_open) || shapes.iter().any(within) || self.solids.is_some_and(is_beside)
    }
}

/// What a surface has not kept, moved by a flow that moves nothing farther than `reach` cells: in each region of the liquid, what is
/// missing there of what cells `held` before. Liquid belongs to the regions around where it was. Regions in which `others` are near
/// liquid lose and gain nothing.
pub(super) struct Remainder<'a> {
    /// `None` where nothing has moved: then nothing comes or goes by other ways, either.
    flow: Option<&'a Moving<'a>>,
    held: &'a Held,
    others: &'a Others<'a>,
    reach: f32,
    regions: Regions<'a>,
    /// The volume that is missing, and whether others are near, by box.
    missing: Sums,
    is_apart: Vec<bool>,
    /// What cells held when they were last counted; empty before.
    counted: Vec<f32>,
    /// How far the surface last swelled in any region, in cells.
    farthest: f64,
    /// What regions lacked in all when cells were last counted, and whether that was not much less than the time before.
    lacked: f64,
    is_stuck: bool,
}

impl<'a> Remainder<'a> {
    pub(super) fn of(flow: Option<&'a Moving<'a>>, held: &'a Held, others: &'a Others<'a>, reach: f32) -> Self {
        let [_, solid] = others.counted();
        let regions = Regions::of(&held.rows, others.domain, solid);
        let (missing, is_apart) = (Sums::none(&regions, held.accounts()), vec![false; regions.len()]);
        let (counted, farthest, lacked, is_stuck) = (Vec::new(), f64::INFINITY, f64::INFINITY, false);
        Self { flow, held, others, reach, regions, missing, is_apart, counted, farthest, lacked, is_stuck }
    }

    /// Counts these volumes as missing, too.
    pub(super) fn owe(&mut self, owed: &[Owed]) {
        let (finder, mut near) = (Finder::new(&self.held.rows), self.regions.reader());
        for (place, volume) in owed {
            let at = finder.find(inner(self.others.domain, place.map(floor)));
            let account = at.map_or(0, |at| self.held.account(at));
            near(*place).iter().for_each(|place| self.missing.add(place, account, f64::from(*volume)));
        }
    }

    /// Moves the surface for what is missing, at most `looks` times.
    pub(super) fn give_back(mut self, surface: &mut dyn Surface, looks: u32) {
        for _ in 0..looks {
            let Some(swelling) = self.swelling(surface) else { return };
            surface.swell(&swelling);
        }
    }

    /// How far the surface swells for what is missing; `None` where nothing is, or what is missing since it last swelled is not worth
    /// a look: what thin sheets gain is not in proportion to how far they swell, but little where that is little. Nor is it where swelling
    /// has not halved what was missing: some regions have no surface to gain by.
    fn swelling(&mut self, surface: &dyn Surface) -> Option<Swelling<'a>> {
        if self.farthest < WORTH_A_LOOK || self.is_stuck {
            return None;
        }
        let lack = self.count(surface);
        let lacked = replace(&mut self.lacked, lack.sum());
        self.is_stuck = self.lacked > STUCK * lacked;
        let ways = lack.ways(&self.regions, self.held.pools.as_ref().map_or(1, Pools::count));
        self.farthest = ways.iter().fold(0.0, |farthest, way| way.abs().max(farthest));
        (self.farthest > LEAST_WAY).then(|| self.swelling_by(&ways, surface))
    }

    /// How far the surface swells if it does by `ways`, in cells, in the middle of each region.
    fn swelling_by(&self, ways: &[f64], surface: &dyn Surface) -> Swelling<'a> {
        let Self { held, regions, .. } = self;
        let (view, domain, ways) = (surface.view(), self.others.domain, regions.to_read(ways));
        let account = |at: usize| held.pools.as_ref().map_or(Some(0), |pools| pools.at(at));
        let [by] = held.rows.tabulate_with(
            || (Finder::new(view.rows), regions.reader()),
            |(phis, near), cell, at| {
                let phi = phis.find(inner(domain, cell)).map_or(view.outside, |at| view.phi[at]);
                let Some(account) = account(at).filter(|_| phi.abs() <= NEAR) else { return [0.0] };
                [near(Site::Centre.of(cell)).map_or(0.0, |place| place.read(&ways, account) as f32)]
            },
        );
        Swelling::new(&held.rows, by, domain)
    }

    /// Takes what cells hold now from what is missing, in place of what they held when they were last counted; what regions then lack.
    fn count(&mut self, surface: &dyn Surface) -> Lack {
        let Self { flow, held, others, reach, regions, .. } = &*self;
        let [_, solid] = others.counted();
        let (shares, is_first) = (Shares::of(surface, others.domain, solid), self.counted.is_empty());
        let parts = held.rows.map_stretches(STRETCHES, |spans| {
            let (mut share, mut way) = (shares.reader(), flow.map(Moving::reader));
            let [mut near, mut near_before, mut near_now] = [(); 3].map(|()| regions.reader());
            let [mut missing, mut area] = [(); 2].map(|()| Sums::none(regions, held.accounts()));
            let (mut apart, mut counted) = (Vec::new(), Vec::new());
            let finder = Finder::new(&held.rows);
            for (cell, n) in spans.iter().flat_map(cells_of) {
                let ([now, more, less], middle) = share(cell, [0.0, WAY, -WAY]);
                counted.push(now);
                let (before, last) = if is_first { (held.volume[n], 0.0) } else { (0.0, self.counted[n]) };
                let (gain, came) = ((more - less) / (2.0 * WAY), now - last);
                let is_new = came != 0.0 || is_first && more.max(before) > 0.0;
                let is_apart = is_new && flow.is_some() && others.are_near(cell, reach + BESIDE);
                let own = held.account(n);
                if (gain != 0.0 || is_apart)
                    && let Some(place) = near(Site::Centre.of(cell))
                {
                    area.add(&place, own, f64::from(gain));
                    if is_apart && apart.last() != Some(&place.in_box()) {
                        apart.push(place.in_box());
                    }
                }
                if before > 0.0
                    && let Some(place) = near_before(held.middle(n))
                {
                    missing.add(&place, own, f64::from(before));
                }
                if came != 0.0 {
                    let from = way.as_mut().map_or(middle, |way| {
                        let halfway = sub(middle, scale(way(middle), 0.5));
                        sub(middle, way(halfway))
                    });
                    let account = held.account_of(&finder, others.domain, n, from);
                    near_now(from).iter().for_each(|place| missing.add(place, account, -f64::from(came)));
                }
            }
            (missing, area, apart, counted)
        });
        let mut all = Sums::none(&self.regions, self.held.accounts());
        self.counted.clear();
        for (missing, area, apart, counted) in parts {
            self.missing.add_all(&missing);
            all.add_all(&area);
            apart.into_iter().for_each(|at| self.is_apart[at] = true);
            self.counted.extend(counted);
        }
        Lack::of(&self.regions, &self.missing, &all, &self.is_apart)
    }
}

/// The cells of a span, and where the value of each is in a field.
pub(super) fn cells_of(([y, z], span): &PlacedSpan) -> impl Iterator<Item = (Cell, usize)> {
    (span.start..span.end).map(move |x| ([x, *y, *z], span.at(x)))
}

#[cfg(test)]
mod tests {
    use numerics::vector::{add, length};

    use super::*;
    use crate::marked::MarkedSurface;
    use crate::step::domain::Solid;
    use crate::step::{Liquid, LiquidSettings, Surroundings};
    use crate::velocity::MacVelocity;

    const FRAME: f64 = 1.0 / 24.0;

    /// How much of what cells hold may be lost or gained in 60 frames, by `resolution`.
    const HELD: [f64; 3] = [0.0, 1e-3, 1e-2];

    /// All of it belongs to the same eight regions.
    const DOMAIN: Domain = Domain::closed([12; 3], [32; 3]);

    const NOTHING: Surroundings<'_> = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);

    const NONE: Others<'_> =
        Others { domain: &DOMAIN, solids: None, is_counted: false, is_thin: false, shapes: &[], time: 0.0 };

    fn ball(middle: Vec3, radius: f32) -> MarkedSurface {
        MarkedSurface::new(DOMAIN, 1, |p| length(sub(p, middle)) - radius, 0, 1)
    }

    fn volume(surface: &MarkedSurface) -> f64 {
        surface.volume(DOMAIN.low, DOMAIN.high, None)
    }

    /// A ball that has moved by 1.5 cells and shrunk from 5.2 to 5 cells, near others or not: the volume that it gets back, ÷ that
    /// which it has lost.
    fn returned(others: &Others<'_>) -> f64 {
        let middle = [21.2, 22.1, 21.7];
        let rows = CellRows::cuboid(DOMAIN.low, DOMAIN.high);
        let before = ball(middle, 5.2);
        let held = Held::of(&rows, &before, others, 1.5);
        let mut after = ball(add(middle, [1.5, 0.0, 0.0]), 5.0);
        let len = rows.len();
        let velocity = MacVelocity::new(rows, [vec![1.5; len], vec![0.0; len], vec![0.0; len]]);
        let flow = Moving { velocity: &velocity, step: 1.0, periods: DOMAIN.periods(), solid: None };
        let small = volume(&after);
        Remainder::of(Some(&flow), &held, others, 1.5).give_back(&mut after, 2);
        (volume(&after) - small) / (volume(&before) - small)
    }

    #[test]
    fn a_ball_gets_back_what_it_has_lost() {
        let returned = returned(&NONE);
        assert!((returned - 1.0).abs() < 0.04, "{returned}");
    }

    /// A sheet of three quarters of a cell at half the cells of the solver, 8 cells from where the velocity is known.
    #[test]
    fn sheets_beyond_the_velocity_are_held_too() {
        let sheet = |p: Vec3| (p[1] - 30.1).abs() - 0.375;
        let surface = MarkedSurface::new(DOMAIN, 2, |p| (length(sub(p, [22.0; 3])) - 4.0).min(sheet(p)), 0, 1);
        let rows = CellRows::cuboid([16; 3], [28, 22, 28]);
        let held = Held::of(&rows, &surface, &NONE, 1.5);
        let sum: f64 = held.volume.iter().map(|volume| f64::from(*volume)).sum();
        let volume = 0.75 * 20.0 * 20.0 + 4.0 / 3.0 * std::f64::consts::PI * 64.0;
        assert!((sum / volume - 1.0).abs() < 0.01, "{sum} {volume}");
        // What it may come to: two and a half cells on.
        assert!(held.rows.find([13, 28, 13]).is_some() && held.rows.find([13, 20, 13]).is_none());
    }

    #[test]
    fn liquid_beside_other_ways_in_and_out_is_left_alone() {
        let open = Domain {
            walls: [[Wall::Closed, Wall::Open], [Wall::Closed; 2], [Wall::Closed; 2]],
            high: [30, 32, 32],
            ..DOMAIN
        };
        let (floor, drain) =
            (|_: f64, p: Vec3| p[1] - 15.0, |_: f64, p: Vec3| length(sub(p, [22.0, 28.0, 22.0])) - 1.0);
        let shapes = [SourceShape { distance: &drain, bounds: [[21, 27, 21], [23, 29, 23]] }];
        let solid = Solid::still(&floor);
        for others in [
            Others { domain: &open, ..NONE },
            Others { solids: Some([solid.at(0.0); 2]), ..NONE },
            Others { shapes: &shapes, ..NONE },
        ] {
            assert_eq!(returned(&others), 0.0);
        }
    }

    #[test]
    fn liquid_is_given_where_it_comes_down() {
        let mut liquid = Liquid::new(LiquidSettings::new(DOMAIN, 1.0), ball([22.0; 3], 6.0));
        let before = volume(liquid.surface());
        liquid.give(&[], &NOTHING, 0.0);
        assert_eq!(volume(liquid.surface()), before);
        liquid.give(&[([22.0, 28.2, 22.0], 9.0), ([16.0, 22.0, 22.0], 3.0)], &NOTHING, 0.0);
        let gained = volume(liquid.surface()) - before;
        assert!((gained / 12.0 - 1.0).abs() < 0.03, "{gained}");
    }

    /// A dam, `width` cells wide, that breaks in a closed box, perhaps with a solid, without any correction, 60 frames: the largest
    /// drift of what the mesh encloses, and of what cells hold, outside the solid.
    fn drifts(resolution: u32, width: f32, viscosity: f64, solid: Option<Solid<'_>>) -> [f64; 2] {
        let domain = Domain::closed([0; 3], [24, 16, 6]);
        let distance = |time: f64, p: Vec3| solid.map_or(f32::INFINITY, |solid| (solid.distance)(time, p));
        let viscosity = |_| viscosity;
        let mut surface = MarkedSurface::new(domain, resolution, |p| (p[0] - width).max(p[1] - 12.0), 0, 1);
        surface.meet(&|p| distance(0.0, p));
        let volumes = |surface: &MarkedSurface, time: f64| {
            let solid = |p: Vec3| distance(time, p);
            [surface.volume(domain.low, domain.high, Some(&solid)), surface.held(Some(&solid))]
        };
        let start = volumes(&surface, 0.0);
        let mut liquid = Liquid::new(LiquidSettings::new(domain, 0.02), surface);
        (0..60).fold([0.0; 2], |most, n| {
            let begin = f64::from(n) * FRAME;
            let distance = |time: f64, p: Vec3| distance(begin + time, p);
            let velocity = |time: f64, p: Vec3| solid.map_or([0.0; 3], |solid| (solid.velocity)(begin + time, p));
            let mut around = Surroundings::new(&|_| [0.0, -9.81, 0.0], &viscosity);
            let speed = solid.map_or(0.0, |solid| solid.speed);
            around.solid = solid.map(|_| Solid { distance: &distance, velocity: &velocity, speed });
            liquid.step_frame(&around, FRAME);
            let now = volumes(liquid.surface(), begin + FRAME);
            [0, 1].map(|k| f64::max(most[k], (now[k] / start[k] - 1.0).abs()))
        })
    }

    #[test]
    fn a_closed_box_keeps_its_volume() {
        for (resolution, width, most) in [(1, 9.0, 0.03), (2, 9.0, 0.02), (2, 9.05, 0.02), (2, 9.2, 0.02)] {
            let [shown, held] = drifts(resolution, width, 0.0, None);
            assert!(shown < most && held < HELD[resolution as usize], "{resolution}, {width}: {shown}, {held}");
        }
    }

    /// A post, a ball on the floor, a slope and stairs; each cuts cells.
    #[test]
    fn a_closed_box_keeps_its_volume_around_a_solid() {
        type Distance = fn(f64, Vec3) -> f32;
        let post: Distance = |_, p| (p[0] - 15.3).abs().max((p[2] - 3.2).abs()) - 1.4;
        let ball: Distance = |_, p| length(sub(p, [15.0, 1.7, 3.1])) - 2.6;
        let slope: Distance = |_, p| (p[1] - 0.3 * p[0] + 2.0) * 0.957_8;
        let stairs: Distance = |_, p| (p[0] - 11.3).max(p[1] - 4.2).min((p[0] - 17.4).max(p[1] - 2.1));
        for (name, solid) in [("post", post), ("ball", ball), ("slope", slope), ("stairs", stairs)] {
            for (resolution, viscosity) in [(1, 0.0), (2, 0.0), (1, 1.0), (1, 20.0)] {
                let [shown, held] = drifts(resolution, 9.0, viscosity, Some(Solid::still(&solid)));
                assert!(
                    shown < 0.02 && held < HELD[resolution as usize],
                    "{name}, {resolution}, {viscosity} Pa·s: {shown}, {held}"
                );
            }
        }
    }

    /// A ball that goes through the dam from above, and a paddle of 1.6 cells that pushes it along.
    #[test]
    fn a_closed_box_keeps_its_volume_around_what_moves() {
        const SPEED: f32 = 6.0;
        let ball = |time: f64, p: Vec3| {
            let way = SPEED * time as f32;
            length(sub(p, [5.0 + way, 14.0 - 0.7 * way, 3.1])) - 2.6
        };
        let paddle = |time: f64, p: Vec3| (p[0] - 2.0 - SPEED * time as f32).abs().max((p[1] - 5.0).abs() - 2.2) - 0.8;
        let to_metres = 0.02 * SPEED;
        let of_ball = |_: f64, _: Vec3| [to_metres, -0.7 * to_metres, 0.0];
        let of_paddle = |_: f64, _: Vec3| [to_metres, 0.0, 0.0];
        for viscosity in [0.0, 1.0] {
            for (name, solid) in [
                ("ball", Solid { distance: &ball, velocity: &of_ball, speed: 1.23 * f64::from(to_metres) }),
                ("paddle", Solid { distance: &paddle, velocity: &of_paddle, speed: f64::from(to_metres) }),
            ] {
                let [shown, held] = drifts(1, 9.0, viscosity, Some(solid));
                assert!(shown < 0.03 && held < HELD[1], "{name}, {viscosity} Pa·s: {shown}, {held}");
            }
        }
    }
}
