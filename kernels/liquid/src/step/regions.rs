//! Regions of a liquid, and the liquid that is missing in each.

use numerics::vector::Vec3;

use crate::level_set::floor;
use crate::rows::{Cell, CellRows, Periods};
use crate::step::domain::{Domain, Obstacle};

/// The side of a region, in cells. It is less along a periodic axis, of which regions make up the whole. Of small regions, the error of where
/// liquid was disturbs a ball that spins.
const SIZE: i32 = 24;

/// How far a surface moves for what it has lost in a substep, cells, at most.
const MOST: f64 = 0.25;

/// A region with this area of surface, ÷ cell², moves it half by what it lacks itself, half by what it and its neighbours lack
/// together. With less area the neighbours count for more: what few cells lack is mostly noise.
const LITTLE_SURFACE: f64 = 32.0;

/// The area, ÷ cell², of surface that anything can be given to.
const LEAST_SURFACE: f64 = 1.0;

/// Distance from a solid, in cells, up to which what is missing belongs to what is beside the solid, and from which on it does not:
/// liquid that comes to a stop there gives up its place to none that still moves.
const BESIDE_SOLID: [f32; 2] = [3.0, 6.0];

/// Regions of the domain, each with a weight that falls linearly from its middle to those of the regions beside. In each, what is beside a
/// solid and what is not have an account of their own.
pub(super) struct Regions<'a> {
    /// All of them. Each also names the box between the middles of eight of which it is the lowest.
    cells: CellRows,
    solid: Option<Obstacle<'a>>,
    /// Cells along a region's sides.
    width: Vec3,
    /// After how many regions they repeat.
    periods: Periods,
}

/// Of values at places in a box, Σ v·xⁱ·yʲ·zᵏ, where x, y and z, 0 to 1, say where in the box a place is: i ascends first, then j. Or the
/// factors of these powers, where values are to be read.
type InBox = [f64; 8];

impl<'a> Regions<'a> {
    /// Those of `rows`, and those beside.
    pub(super) fn of(rows: &CellRows, domain: &Domain, solid: Option<Obstacle<'a>>) -> Self {
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
        let periods = Periods(periods);
        // Those at all corners of boxes that places in `rows` are in.
        let cells = stored.dilated(1);
        let cells = if periods.any() { periods.gathered(cells) } else { cells };
        Self { cells, solid, width, periods }
    }

    /// A region and those beside it, where they are stored.
    fn around(&self, [x, y, z]: Cell) -> impl Iterator<Item = usize> {
        let region = move |n: i32| self.periods.home([x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]);
        (0..27).filter_map(move |n| self.cells.find(region(n)))
    }

    /// The region at each corner of a box, where it is stored, x fastest.
    fn corners(&self, of: Cell) -> [Option<usize>; 8] {
        std::array::from_fn(|k| {
            let region = [0, 1, 2].map(|axis| of[axis] + (k as i32 >> axis & 1));
            self.cells.find(self.periods.home(region))
        })
    }

    /// Where a place in cells is between regions; `None` where there are none. Fast where successive places are near each other.
    pub(super) fn reader(&self) -> impl FnMut(Vec3) -> Option<Between> + use<'_> {
        let (mut last, mut of_last) = ([i32::MIN; 3], None);
        move |place| {
            let at = [0, 1, 2].map(|axis| place[axis] / self.width[axis] - 0.5);
            let corner = at.map(floor);
            if corner != last {
                (last, of_last) = (corner, self.cells.find(self.periods.home(corner)));
            }
            let t = [0, 1, 2].map(|axis| f64::from(at[axis] - corner[axis] as f32));
            let [near, far] = BESIDE_SOLID;
            let beside = self.solid.map_or(0.0, |solid| ((far - solid.distance(place)) / (far - near)).clamp(0.0, 1.0));
            Some(Between { at: of_last?, boxes: self.cells.len(), t, beside: f64::from(beside) })
        }
    }

    /// How many there are; and how many boxes.
    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether a region is at a corner of one of these boxes.
    fn at_corners(&self, is_of: &[bool]) -> Vec<bool> {
        let mut out = vec![false; self.cells.len()];
        for (at, _) in self.cells.iter().zip(is_of).filter(|(_, is_of)| **is_of) {
            self.corners(at).into_iter().flatten().for_each(|region| out[region] = true);
        }
        out
    }

    /// What regions have for each account, and then beside a solid, to be read between their middles.
    pub(super) fn to_read(&self, of: &[f64]) -> Vec<InBox> {
        let mut out = vec![[0.0; 8]; of.len()];
        for (n, at) in self.cells.iter().enumerate() {
            let corners = self.corners(at);
            for (of, out) in of.chunks(self.len()).zip(out.chunks_mut(self.len())) {
                let factors = &mut out[n];
                *factors = corners.map(|region| region.map_or(0.0, |region| of[region]));
                for axis in [1, 2, 4] {
                    (0..8).filter(|k| k & axis == 0).for_each(|k| factors[k | axis] -= factors[k]);
                }
            }
        }
        out
    }
}

/// Sums of values at places, in the boxes where there are any.
pub(super) struct Sums {
    /// Which of the sums that of each box is, [`NONE`] where there is none: for each account, and then beside a solid.
    of: Vec<u32>,
    /// The box of each.
    boxes: Vec<u32>,
    values: Vec<InBox>,
}

const NONE: u32 = u32::MAX;

impl Sums {
    pub(super) fn none(regions: &Regions<'_>, accounts: usize) -> Self {
        Self { of: vec![NONE; 2 * accounts * regions.len()], boxes: Vec::new(), values: Vec::new() }
    }

    fn in_box(&mut self, at: usize) -> &mut InBox {
        if self.of[at] == NONE {
            self.of[at] = self.values.len() as u32;
            self.boxes.push(at as u32);
            self.values.push([0.0; 8]);
        }
        &mut self.values[self.of[at] as usize]
    }

    /// Adds a value at a place for an account.
    #[inline]
    pub(super) fn add(&mut self, place: &Between, account: usize, value: f64) {
        let [x, y, z] = place.t;
        for (at, share) in place.parts(account) {
            let (value, sum) = (share * value, self.in_box(at));
            let low = [value, value * x, value * y, value * x * y];
            for k in 0..4 {
                sum[k] += low[k];
                sum[k + 4] += low[k] * z;
            }
        }
    }

    pub(super) fn add_all(&mut self, other: &Self) {
        for (at, values) in other.boxes.iter().zip(&other.values) {
            self.in_box(*at as usize).iter_mut().zip(values).for_each(|(own, value)| *own += value);
        }
    }

    /// Of each region, for each account, the sum of the values weighted for it, and then of those beside a solid.
    fn of_regions(&self, regions: &Regions<'_>) -> Vec<f64> {
        let mut out = vec![0.0; self.of.len()];
        for (n, at) in regions.cells.iter().enumerate() {
            let corners = regions.corners(at);
            for (of, out) in self.of.chunks(regions.len()).zip(out.chunks_mut(regions.len())) {
                let Some(mut weighted) = self.values.get(of[n] as usize).copied() else { continue };
                // The weight at the lower end of an axis is 1 − x.
                for axis in [1, 2, 4] {
                    (0..8).filter(|k| k & axis == 0).for_each(|k| weighted[k] -= weighted[k | axis]);
                }
                for (region, value) in corners.iter().zip(weighted) {
                    region.iter().for_each(|region| out[*region] += value);
                }
            }
        }
        out
    }
}

/// Where a place is between the middles of regions.
pub(super) struct Between {
    /// Its box, of so many.
    at: usize,
    boxes: usize,
    /// How far it is along each axis, 0 to 1.
    t: [f64; 3],
    /// The share of it that counts for what is beside a solid.
    beside: f64,
}

impl Between {
    /// The number of its box.
    pub(super) fn in_box(&self) -> usize {
        self.at
    }

    /// Where its box is in what has, for each account, one value for each box, and then one for what is beside a solid; and how much of
    /// the place counts.
    fn parts(&self, account: usize) -> impl Iterator<Item = (usize, f64)> {
        let first = 2 * account * self.boxes + self.at;
        let parts = [(first, 1.0 - self.beside), (first + self.boxes, self.beside)];
        parts.into_iter().filter(|(_, share)| *share > 0.0)
    }

    /// What is there for an account.
    #[inline]
    pub(super) fn read(&self, of: &[InBox], account: usize) -> f64 {
        let [x, y, z] = self.t;
        let of_part =
            |[a, b, c, d, e, f, g, h]: InBox| (a + b * x + (c + d * x) * y) + (e + f * x + (g + h * x) * y) * z;
        self.parts(account).fold(0.0, |sum, (at, share)| sum + share * of_part(of[at]))
    }
}

/// What regions lack.
pub(super) struct Lack {
    /// The volume that is missing in each, and then beside a solid in each, for each account; ÷ cell³.
    volume: Vec<f64>,
    /// What each gains by a way outward, ÷ that and cell².
    area: Vec<f64>,
    /// Which lose and gain nothing.
    is_apart: Vec<bool>,
}

impl Lack {
    /// `is_apart`: whether something in a box loses or gains by other ways.
    pub(super) fn of(regions: &Regions<'_>, volume: &Sums, area: &Sums, is_apart: &[bool]) -> Self {
        let is_apart = regions.at_corners(is_apart);
        Self { volume: volume.of_regions(regions), area: area.of_regions(regions), is_apart }
    }

    /// What is missing or too much in all regions together that lose and gain.
    pub(super) fn sum(&self) -> f64 {
        let len = self.is_apart.len();
        let counted = self.volume.iter().enumerate().filter(|(at, _)| !self.is_apart[at % len]);
        counted.fold(0.0, |sum, (_, volume)| sum + volume.abs())
    }

    /// How far the surface in each region swells, in cells, for the first of the accounts. What is missing in the others is given to
    /// these: to those of its region by their surface there, or, where there is none, everywhere.
    pub(super) fn ways(&self, regions: &Regions<'_>, accounts: usize) -> Vec<f64> {
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
