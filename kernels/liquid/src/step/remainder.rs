//! The liquid that a surface does not keep as it moves, given back in each region of it.

use numerics::vector::{Vec3, scale, sub};

use crate::fields::add_scaled;
use crate::level_set::{PhiView, floor};
use crate::rows::{Cell, CellRows, Finder, Periods, PlacedSpan};
use crate::step::continuity::Swelling;
use crate::step::domain::{Domain, Obstacle, Wall};
use crate::step::pools::Pools;
use crate::step::shares::{Shares, WHOLE, inner};
use crate::step::sources::SourceShape;
use crate::step::{Moving, Owed, Surface};
use crate::velocity::Site;

/// The side of a region, in cells. It is less along a periodic axis, of which regions make up the whole. Of small regions, the error of where
/// liquid was disturbs a ball that spins.
const SIZE: i32 = 24;

/// A way outward, in cells, by which what a cell gains by one is measured.
const WAY: f32 = 0.1;

/// φ of a cell, in cells, below which it may show a surface.
pub(super) const SHOWN: f32 = 0.5;

/// |φ| of a cell, in cells, up to which what moves the surface is read.
const NEAR: f32 = 4.0;

/// How far a surface moves for what it has lost in a substep, cells, at most.
const MOST: f64 = 0.25;

/// A region with this area of surface, ÷ cell², moves it half by what it lacks itself, half by what it and its neighbours lack
/// together. With less area the neighbours count for more: what few cells lack is mostly noise.
const LITTLE_SURFACE: f64 = 32.0;

/// The area, ÷ cell², of surface that anything can be given to.
const LEAST_SURFACE: f64 = 1.0;

/// How far, in cells, a surface swells in a region at least for another look at what it lacks.
const WORTH_A_LOOK: f64 = 0.03;

/// Stretches of cells that are summed each by itself, so that threads may share the work.
pub(super) const STRETCHES: usize = 64;

/// Distance from a solid, in cells, up to which what is missing belongs to what is beside the solid, and from which on it does not:
/// liquid that comes to a stop there gives up its place to none that still moves.
const BESIDE_SOLID: [f32; 2] = [3.0, 6.0];

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
    lack: Lack,
    /// What cells held when they were last counted; empty before.
    counted: Vec<f32>,
    /// How far the surface last swelled in any region, in cells.
    farthest: f64,
}

impl<'a> Remainder<'a> {
    pub(super) fn of(flow: Option<&'a Moving<'a>>, held: &'a Held, others: &'a Others<'a>, reach: f32) -> Self {
        let [_, solid] = others.counted();
        let regions = Regions::of(&held.rows, others.domain, solid);
        let lack = Lack::none(&regions, held.accounts());
        Self { flow, held, others, reach, regions, lack, counted: Vec::new(), farthest: f64::INFINITY }
    }

    /// Counts these volumes as missing, too.
    pub(super) fn owe(&mut self, owed: &[Owed]) {
        let (finder, mut near) = (Finder::new(&self.held.rows), self.regions.reader());
        for (place, volume) in owed {
            let at = finder.find(inner(self.others.domain, place.map(floor)));
            let account = at.map_or(0, |at| self.held.account(at));
            near(*place).add(&mut self.lack.volume, account, f64::from(*volume));
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
    /// a look: what thin sheets gain is not in proportion to how far they swell, but little where that is little.
    fn swelling(&mut self, surface: &dyn Surface) -> Option<Swelling<'a>> {
        if self.farthest < WORTH_A_LOOK {
            return None;
        }
        self.count(surface);
        let Self { held, others, regions, lack, .. } = &*self;
        let pools = held.pools.as_ref();
        let ways = lack.ways(regions, pools.map_or(1, Pools::count));
        let account = |at: usize| pools.map_or(Some(0), |pools| pools.at(at));
        let swelling = swelling(&ways, regions, &held.rows, surface, (others.domain, account));
        self.farthest = ways.iter().fold(0.0, |farthest, way| way.abs().max(farthest));
        swelling
    }

    /// Takes what cells hold now from what is missing, in place of what they held when they were last counted.
    fn count(&mut self, surface: &dyn Surface) {
        let Self { flow, held, others, reach, regions, .. } = &*self;
        let [_, solid] = others.counted();
        let (shares, is_first) = (Shares::of(surface, others.domain, solid), self.counted.is_empty());
        let parts = held.rows.map_stretches(STRETCHES, |spans| {
            let (mut share, mut way) = (shares.reader(), flow.map(Moving::reader));
            let [mut near, mut near_before, mut near_now] = [(); 3].map(|()| regions.reader());
            let (mut lack, mut counted) = (Lack::none(regions, held.accounts()), Vec::new());
            let finder = Finder::new(&held.rows);
            for (cell, n) in spans.iter().flat_map(cells_of) {
                let ([now, more, less], middle) = share(cell, [0.0, WAY, -WAY]);
                counted.push(now);
                let (before, last) = if is_first { (held.volume[n], 0.0) } else { (0.0, self.counted[n]) };
                let (gain, came) = ((more - less) / (2.0 * WAY), now - last);
                let is_new = came != 0.0 || is_first && more.max(before) > 0.0;
                let is_apart = is_new && flow.is_some() && others.are_near(cell, reach + BESIDE);
                let own = held.account(n);
                if gain != 0.0 || is_apart {
                    let place = near(Site::Centre.of(cell));
                    place.add(&mut lack.area, own, f64::from(gain));
                    place.at.into_iter().for_each(|(at, _)| lack.is_apart[at] |= is_apart);
                }
                if before > 0.0 {
                    near_before(held.middle(n)).add(&mut lack.volume, own, f64::from(before));
                }
                if came != 0.0 {
                    let from = way.as_mut().map_or(middle, |way| {
                        let halfway = sub(middle, scale(way(middle), 0.5));
                        sub(middle, way(halfway))
                    });
                    let account = held.account_of(&finder, others.domain, n, from);
                    near_now(from).add(&mut lack.volume, account, -f64::from(came));
                }
            }
            (lack, counted)
        });
        self.lack.area.fill(0.0);
        self.counted.clear();
        for (lack, counted) in parts {
            self.lack.add(&lack);
            self.counted.extend(counted);
        }
    }
}

/// The cells of a span, and where the value of each is in a field.
pub(super) fn cells_of(([y, z], span): &PlacedSpan) -> impl Iterator<Item = (Cell, usize)> {
    (span.start..span.end).map(move |x| ([x, *y, *z], span.at(x)))
}

/// Regions of the domain, each with a weight that falls linearly from its middle to those of the regions beside. In each, what is beside a
/// solid and what is not have an account of their own.
struct Regions<'a> {
    cells: CellRows,
    solid: Option<Obstacle<'a>>,
    /// Cells along a region's sides.
    width: Vec3,
    /// After how many regions they repeat.
    periods: Periods,
}

impl<'a> Regions<'a> {
    /// Those of `rows`, and those beside.
    fn of(rows: &CellRows, domain: &Domain, solid: Option<Obstacle<'a>>) -> Self {
        let cells = domain.periods().0;
        let periods = cells.map(|period| if period > 0 { ((period + SIZE / 2) / SIZE).max(1) } else { 0 });
        let width = [0, 1, 2].map(|axis| match periods[axis] {
            0 => SIZE as f32,
            regions => cells[axis] as f32 / regions as f32,
        });
        let region = |axis: usize, at: i32| floor((at as f32 + 0.5) / width[axis]);
        let (low, high) = rows.bounds().unwrap_or(([0; 3], [1; 3]));
        let first = [region(1, low[1]), region(2, low[2])];
        let size = [region(1, high[1]) + 1 - first[0], region(2, high[2]) + 1 - first[1]];
        let of_region = |axis: usize, at: i32| {
            let end = |at: i32| (at as f32 * width[axis]).ceil() as i32;
            end(at)..end(at + 1)
        };
        let stored = CellRows::from_ranges(first, size, |y, z, out| {
            for (y, z) in of_region(2, z).flat_map(|z| of_region(1, y).map(move |y| (y, z))) {
                out.extend(rows.row(y, z).iter().map(|span| region(0, span.start)..region(0, span.end - 1) + 1));
            }
        });
        let (stored, periods) = (stored.dilated(1), Periods(periods));
        let cells = if periods.any() { periods.gathered(stored) } else { stored };
        Self { cells, solid, width, periods }
    }

    /// A region and those beside it, where they are stored.
    fn around(&self, [x, y, z]: Cell) -> impl Iterator<Item = usize> {
        let region = move |n: i32| self.periods.home([x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]);
        (0..27).filter_map(move |n| self.cells.find(region(n)))
    }

    /// The regions around a place in cells, and their weights. Fast where successive places are near each other.
    fn reader(&self) -> impl FnMut(Vec3) -> Weights + use<'_> {
        let (mut last, mut at_corners) = ([i32::MIN; 3], [None; 8]);
        move |place| {
            let at = [0, 1, 2].map(|axis| place[axis] / self.width[axis] - 0.5);
            let corner = at.map(floor);
            let t = [0, 1, 2].map(|axis| f64::from(at[axis] - corner[axis] as f32));
            let side = |k: usize| [k & 1, k >> 1 & 1, k >> 2];
            if corner != last {
                last = corner;
                at_corners = std::array::from_fn(|k| {
                    let region = [0, 1, 2].map(|axis| corner[axis] + side(k)[axis] as i32);
                    self.cells.find(self.periods.home(region))
                });
            }
            let at = std::array::from_fn(|k| {
                let along = |axis: usize| if side(k)[axis] == 1 { t[axis] } else { 1.0 - t[axis] };
                at_corners[k].map_or((0, 0.0), |at| (at, along(0) * along(1) * along(2)))
            });
            let [near, far] = BESIDE_SOLID;
            let beside = self.solid.map_or(0.0, |solid| ((far - solid.distance(place)) / (far - near)).clamp(0.0, 1.0));
            Weights { at, beside: f64::from(beside), regions: self.cells.len() }
        }
    }
}

/// What a place counts for in the regions around it.
struct Weights {
    at: [(usize, f64); 8],
    /// The share that counts for what is beside a solid.
    beside: f64,
    regions: usize,
}

impl Weights {
    /// Where each region is in what has, for each account, one value for each, and then one for what is beside a solid in each; and its
    /// weight.
    fn iter(&self, account: usize) -> impl Iterator<Item = (usize, f64)> {
        let first = 2 * account * self.regions;
        let parts = [(first, 1.0 - self.beside), (first + self.regions, self.beside)]
            .into_iter()
            .filter(|(_, share)| *share > 0.0);
        parts.flat_map(|(first, share)| self.at.iter().map(move |(at, weight)| (first + at, share * weight)))
    }

    fn add(&self, sums: &mut [f64], account: usize, value: f64) {
        self.iter(account).for_each(|(at, weight)| sums[at] += weight * value);
    }
}

/// What regions lack.
struct Lack {
    /// The volume that is missing in each, and then beside a solid in each, for each account; ÷ cell³.
    volume: Vec<f64>,
    /// What each gains by a way outward, ÷ that and cell².
    area: Vec<f64>,
    /// Which lose and gain nothing.
    is_apart: Vec<bool>,
}

impl Lack {
    fn none(regions: &Regions<'_>, accounts: usize) -> Self {
        let len = regions.cells.len();
        Self { volume: vec![0.0; 2 * len * accounts], area: vec![0.0; 2 * len * accounts], is_apart: vec![false; len] }
    }

    fn add(&mut self, other: &Self) {
        add_scaled(&mut self.volume, 1.0, &other.volume);
        add_scaled(&mut self.area, 1.0, &other.area);
        self.is_apart.iter_mut().zip(&other.is_apart).for_each(|(own, other)| *own |= other);
    }

    /// How far the surface in each region swells, in cells, for the first of the accounts. What is missing in the others is given to
    /// these: to those of its region by their surface there, or, where there is none, everywhere.
    fn ways(&self, regions: &Regions<'_>, accounts: usize) -> Vec<f64> {
        let (len, mut volume) = (2 * regions.cells.len(), self.volume.clone());
        let (rest, mut left) = (volume.split_off(accounts * len), 0.0);
        for (at, missing) in rest.into_iter().enumerate().filter(|(at, _)| !self.is_apart[at % regions.cells.len()]) {
            let own = (0..accounts).map(|account| account * len + at);
            left += self.share_out(regions, missing, own, &mut volume);
        }
        self.share_out(regions, left, 0..accounts * len, &mut volume);
        let mut ways = vec![0.0; self.volume.len()];
        (0..accounts).for_each(|account| self.set_ways(regions, account * len, &volume, &mut ways));
        ways
    }

    /// Adds what is missing to what these have in `volume`, by their surface; returns it where they have none.
    fn share_out(
        &self,
        regions: &Regions<'_>,
        missing: f64,
        to: impl Iterator<Item = usize> + Clone,
        volume: &mut [f64],
    ) -> f64 {
        let surface = |at: usize| if self.is_apart[at % regions.cells.len()] { 0.0 } else { self.area[at].max(0.0) };
        let sum: f64 = to.clone().map(surface).sum();
        if sum <= LEAST_SURFACE {
            return missing;
        }
        to.for_each(|at| volume[at] += missing * surface(at) / sum);
        0.0
    }

    /// Sets how far the surface in each region swells for the account that begins at `first`, where `volume` is missing.
    fn set_ways(&self, regions: &Regions<'_>, first: usize, volume: &[f64], ways: &mut [f64]) {
        let Self { area, is_apart, .. } = self;
        let len = regions.cells.len();
        let counted = || {
            let own = regions.cells.iter().enumerate().filter(|(at, _)| !is_apart[*at]);
            own.flat_map(move |(at, region)| [first, first + len].map(|first| (first, first + at, region)))
        };
        let (mut left, mut surface) = (0.0, 0.0);
        for (first, at, region) in counted() {
            let around = regions.around(region).filter(|at| !is_apart[*at]).map(|at| first + at);
            let (missing, room) =
                around.fold((0.0, 0.0), |(volumes, areas), at| (volumes + volume[at], areas + area[at]));
            let usual = if room > LEAST_SURFACE { missing / room } else { 0.0 };
            ways[at] = (volume[at] + LITTLE_SURFACE * usual) / (area[at] + LITTLE_SURFACE);
            left += volume[at] - ways[at] * area[at];
            surface += area[at];
        }
        let everywhere = left / f64::max(surface, LEAST_SURFACE);
        counted().for_each(|(_, at, _)| ways[at] = (ways[at] + everywhere).clamp(-MOST, MOST));
    }
}

/// How far a surface swells if it does by `ways`, in cells, in the middle of each region; `None` where that is nothing.
fn swelling<'a>(
    ways: &[f64],
    regions: &Regions<'_>,
    rows: &'a CellRows,
    surface: &dyn Surface,
    (domain, account): (&Domain, impl Fn(usize) -> Option<usize> + Sync),
) -> Option<Swelling<'a>> {
    if ways.iter().all(|way| *way == 0.0) {
        return None;
    }
    let view = surface.view();
    let [by] = rows.tabulate_with(
        || (Finder::new(view.rows), regions.reader()),
        |(phis, near), cell, at| {
            let phi = phis.find(inner(domain, cell)).map_or(view.outside, |at| view.phi[at]);
            let Some(account) = account(at).filter(|_| phi.abs() <= NEAR) else { return [0.0] };
            [near(Site::Centre.of(cell)).iter(account).fold(0.0, |sum, (at, weight)| sum + weight * ways[at]) as f32]
        },
    );
    Some(Swelling::new(rows, by, domain))
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
