//! What each part of a liquid is made of, where it is not the same everywhere.
//!
//! About eight points a cell have a viscosity and a density, and move with the liquid: nothing is mixed, so that a jump
//! stays as sharp as a cell however long the liquid flows. A cell has the harmonic mean of the viscosities of its points,
//! as layers that slide on each other do, and the mean of their densities. Where points have moved apart, new ones take the
//! material of the closest; where they crowd, some go.
//!
//! Limit: a layer thinner than half a cell is one with what is around it.

use numerics::parallel;
use numerics::random::Key;
use numerics::vector::{Vec3, add, dot, sub};
use serde::{Deserialize, Serialize};

use crate::level_set::{PhiSampler, PhiView, displacement, floor};
use crate::markers::bins::{Bins, NOWHERE};
use crate::pressure::LEAST_DEPTH;
use crate::rows::{Cell, CellRows};
use crate::step::{Domain, Moving};
use crate::velocity::{Sampler, Site};

use super::phases::PhaseShares;
use super::{CHUNK, is_outside, kept_in};

/// Points that a full cell gets: one in each octant.
const PER_CELL: usize = 8;
/// A liquid cell with fewer gets new ones in its empty octants.
const LEAST: usize = 4;
/// A cell with as many is thinned to [`PER_CELL`].
const CROWD: usize = 16;
/// Distance from the liquid, in cells, from which on a point is dropped.
const LOST: f32 = 1.0;
/// Cells around a cell's own in which a new point looks for the closest, one after the other.
const RINGS: [i32; 4] = [1, 2, 4, 8];
/// Places farther from 0 count as if they were there, cells.
const FARTHEST: f32 = 2_097_152.0;
/// Half the diagonal of a cell.
const HALF_DIAGONAL: f32 = 0.87;
/// Seed of the places of points.
const SEED: u64 = 0x6d61_7474_6572;
/// What stands for a property that is the liquid's own.
const OWN: f32 = -1.0;

/// What a part of a liquid is made of. `None` is what the liquid has where nothing else is said, which may change with time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LiquidMaterial {
    /// Dynamic viscosity, Pa·s.
    pub viscosity: Option<f32>,
    /// Mass of a volume, kg/m³.
    pub density: Option<f32>,
    /// Which of the liquids that do not mix it is; the volume of each is kept.
    pub phase: u32,
}

/// A material as it is kept: viscosity and density are negative where they are the liquid's own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Stored {
    values: [f32; 2],
    phase: u32,
}

impl LiquidMaterial {
    /// Whether it has a viscosity or a density of its own.
    pub fn is_own(&self) -> bool {
        self.viscosity.is_some() || self.density.is_some()
    }

    fn stored(self) -> Stored {
        let values = [self.viscosity, self.density].map(|value| value.unwrap_or(OWN));
        Stored { values, phase: self.phase }
    }

    fn of(Stored { values, phase }: Stored) -> Self {
        let [viscosity, density] = values.map(|value| if value >= 0.0 { Some(value) } else { None });
        Self { viscosity, density, phase }
    }
}

/// The points that say what a liquid is made of. Those of a cell follow each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MaterialPoints {
    points: Vec<Vec3>,
    /// What each is made of.
    values: Vec<Stored>,
    /// How often new points were looked for.
    rounds: u64,
}

/// Liquid that a source filled: φ before and after on the cells of a box.
pub(crate) struct Filled<'a> {
    pub rows: &'a CellRows,
    pub before: &'a [f32],
    pub after: &'a [f32],
}

/// What comes out of liquid, all through some cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Stir {
    cells: Vec<Cell>,
    /// m³/s.
    rate: f64,
    value: Stored,
}

impl Stir {
    /// `rate`, m³/s, of a material.
    pub(crate) fn new(cells: Vec<Cell>, rate: f64, material: LiquidMaterial) -> Self {
        Self { cells, rate, value: material.stored() }
    }
}

/// Viscosity and density of the cells of a liquid that is not the same everywhere.
#[derive(Clone, Debug)]
pub(crate) struct CellMaterials {
    /// Pa·s.
    pub viscosity: Vec<f32>,
    /// kg/m³.
    pub density: Vec<f32>,
}

impl MaterialPoints {
    /// Fills a liquid with points of the material at each place, in cells.
    pub fn filling(view: &PhiView<'_>, material: impl Fn(Vec3) -> LiquidMaterial + Sync) -> Self {
        let within = |cell: Cell| (0..3).all(|axis| view.low[axis] <= cell[axis] && cell[axis] < view.high[axis]);
        let cells = view.rows.filtered(|cell, at| within(cell) && view.phi[at] < HALF_DIAGONAL);
        let points = places(&cells, 0, || {
            let mut sampler = PhiSampler::new(*view);
            move |_: Cell, places: [Vec3; PER_CELL]| places.map(|place| sampler.at(place) < 0.0)
        });
        let values = parallel::tabulate(points.len(), CHUNK, |n| material(points[n]).stored());
        Self { points, values, rounds: 1 }
    }

    /// Where they are, in cells.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// The material of each.
    pub fn materials(&self) -> impl Iterator<Item = LiquidMaterial> {
        self.values.iter().map(|values| LiquidMaterial::of(*values))
    }

    /// Where the phases are.
    pub fn phases(&self) -> PhaseShares {
        let (rows, slots) = self.slots();
        PhaseShares::new(rows, slots.into_iter().zip(self.values.iter().map(|own| own.phase)).collect())
    }

    /// The materials of the points closest to places, in cells.
    pub fn closest_to(&self, places: &[Vec3]) -> Vec<LiquidMaterial> {
        let (rows, slots) = self.slots();
        let near = Near { rows: &rows, bins: &Bins::of_cells(&slots, rows.len()), points: self };
        parallel::tabulate(places.len(), CHUNK, |n| LiquidMaterial::of(near.closest(places[n], |_| true)))
    }

    /// The same of the points of a phase for each place; where there are none near, of any.
    pub fn closest_of_phases(&self, places: &[(Vec3, u32)]) -> Vec<LiquidMaterial> {
        let (rows, slots) = self.slots();
        let near = Near { rows: &rows, bins: &Bins::of_cells(&slots, rows.len()), points: self };
        let material = |(place, phase): (Vec3, u32)| {
            let own = near.closest(place, |own| own.phase == phase);
            LiquidMaterial::of(if own.phase == phase { own } else { near.closest(place, |_| true) })
        };
        parallel::tabulate(places.len(), CHUNK, |n| material(places[n]))
    }

    /// The cells that have points, and where among them that of each point is.
    fn slots(&self) -> (CellRows, Vec<u32>) {
        let cells: Vec<Cell> = self.points.iter().map(|point| point.map(floor)).collect();
        let rows = CellRows::from_cells(&cells);
        let slot = |n: usize| rows.find(cells[n]).map_or(NOWHERE, |at| at as u32);
        let slots = parallel::tabulate(cells.len(), CHUNK, slot);
        (rows, slots)
    }

    pub(crate) fn advance(&mut self, flow: &Moving<'_>, domain: &Domain) {
        parallel::for_each(self.points.chunks_mut(CHUNK), |_, points| {
            let mut way = flow.reader();
            for point in points {
                *point = kept_in(add(*point, displacement(&mut way, *point)), domain);
            }
        });
    }

    /// Gives what a source filled its material.
    pub(crate) fn fill(&mut self, filled: &Filled<'_>, domain: &Domain, material: LiquidMaterial) {
        let Filled { rows, before, after } = *filled;
        let Some((low, high)) = rows.bounds() else { return };
        let value = material.stored();
        let is_new = |sampler: &mut Sampler<'_>, place: Vec3| {
            sampler.value(before, Site::Centre, place) >= 0.0 && sampler.value(after, Site::Centre, place) < 0.0
        };
        let is_near =
            |place: Vec3| (0..3).all(|axis| low[axis] as f32 <= place[axis] && place[axis] <= high[axis] as f32);
        let chunks = self.points.chunks(CHUNK).zip(self.values.chunks_mut(CHUNK));
        parallel::for_each(chunks, |_, (points, values)| {
            let mut sampler = Sampler::new(rows);
            for (point, own) in points.iter().zip(values).filter(|(point, _)| is_near(**point)) {
                if is_new(&mut sampler, *point) {
                    *own = value;
                }
            }
        });
        let near = |at: usize| before[at] > -HALF_DIAGONAL && after[at] < HALF_DIAGONAL;
        let cells = rows.filtered(|cell, at| domain.contains(cell) && near(at));
        let new = places(&cells, self.next_round(), || {
            let mut sampler = Sampler::new(rows);
            move |_: Cell, places: [Vec3; PER_CELL]| places.map(|place| is_new(&mut sampler, place))
        });
        self.values.resize(self.values.len() + new.len(), value);
        self.points.extend(new);
    }

    /// Gives as many of the points as come out of some cells in `seconds` the material of what does; `cell`: the side of a
    /// cell, m. Follow with [`Self::advance`].
    pub(crate) fn stir(&mut self, stir: &Stir, seconds: f64, cell: f64) {
        let rows = CellRows::from_cells(&stir.cells);
        let gained = stir.rate * seconds / (cell * cell * cell * rows.len().max(1) as f64);
        let share = gained / (1.0 + gained);
        // Evenly through their order, from a random one on: as many as that, whatever chance would make of it.
        let mut due = Key::new(SEED).of(self.next_round()).f64();
        for (point, own) in self.points.iter().zip(&mut self.values) {
            if rows.find(point.map(floor)).is_some() {
                due += share;
                if due >= 1.0 {
                    due -= 1.0;
                    *own = stir.value;
                }
            }
        }
    }

    /// Drops points that are off the liquid, thins those that crowd, and fills holes. `level_set`: φ of the cells of `rows`,
    /// which hold the liquid and what is next to it. Returns what the cells are made of, where `own` is the viscosity and
    /// the density of what is not said otherwise.
    pub(crate) fn settle(
        &mut self,
        rows: &CellRows,
        level_set: &[f32],
        view: PhiView<'_>,
        domain: &Domain,
        own: [f32; 2],
    ) -> CellMaterials {
        let slot = |sampler: &mut PhiSampler<'_>, n: usize| {
            let point = self.points[n];
            let is_lost = is_outside(point, domain).is_some() || sampler.at(point) > LOST;
            let at = if is_lost { None } else { rows.find(cell_of(point, domain)) };
            at.map_or(NOWHERE, |at| at as u32)
        };
        let slots = parallel::tabulate_with(self.points.len(), CHUNK, || PhiSampler::new(view), slot);
        let bins = Bins::of_cells(&slots, rows.len());
        let (new, values) = self.in_holes(rows, level_set, view, domain, &bins);
        let kept = bins.thinned(CROWD, PER_CELL);
        self.points = kept.iter().map(|n| self.points[*n as usize]).chain(new).collect();
        self.values = kept.iter().map(|n| self.values[*n as usize]).chain(values).collect();
        self.in_cells(rows, domain, own)
    }

    /// New points of liquid cells that have too few, and their materials.
    fn in_holes(
        &mut self,
        rows: &CellRows,
        level_set: &[f32],
        view: PhiView<'_>,
        domain: &Domain,
        bins: &Bins,
    ) -> (Vec<Vec3>, Vec<Stored>) {
        let holes = rows.filtered(|cell, at| {
            level_set[at] < -LEAST_DEPTH && bins.of(at, at + 1).len() < LEAST && domain.contains(cell)
        });
        let round = self.next_round();
        let points = &self.points;
        let new = places(&holes, round, || {
            let mut sampler = PhiSampler::new(view);
            move |cell: Cell, places: [Vec3; PER_CELL]| {
                let own = rows.find(cell).map_or(&[][..], |at| bins.of(at, at + 1));
                let mut wanted = places.map(|place| sampler.at(place) < 0.0);
                own.iter().for_each(|n| wanted[octant(cell, points[*n as usize])] = false);
                // A cell that the surface hardly reaches has one all the same.
                wanted[0] |= own.is_empty() && !wanted.contains(&true);
                wanted
            }
        });
        let near = Near { rows, bins, points: self };
        let values = parallel::tabulate(new.len(), CHUNK, |n| near.closest(new[n], |_| true));
        (new, values)
    }

    /// The means over the points of each cell; `own` where there are none.
    fn in_cells(&self, rows: &CellRows, domain: &Domain, own: [f32; 2]) -> CellMaterials {
        let mut sums = vec![([0.0_f64; 2], 0_u32); rows.len()];
        for (point, Stored { values, .. }) in self.points.iter().zip(&self.values) {
            let Some(at) = rows.find(cell_of(*point, domain)) else { continue };
            let [viscosity, density] = [0, 1].map(|n| f64::from(if values[n] >= 0.0 { values[n] } else { own[n] }));
            let ([inverse, mass], count) = &mut sums[at];
            *inverse += 1.0 / viscosity;
            *mass += density;
            *count += 1;
        }
        let mean = |pick: &dyn Fn([f64; 2], f64) -> f64, own: f32| {
            let mean = |([inverse, mass], count): &([f64; 2], u32)| match count {
                0 => own,
                count => pick([*inverse, *mass], f64::from(*count)) as f32,
            };
            sums.iter().map(mean).collect()
        };
        CellMaterials {
            viscosity: mean(&|[inverse, _], count| count / inverse, own[0]),
            density: mean(&|[_, mass], count| mass / count, own[1]),
        }
    }

    /// Gives phases of which a piece has too little points of those of which it has too much, from where the two meet: the
    /// closest first, and none that are farther than the next cell. A layer thinner than a cell loses its points to what is
    /// around it, as new ones take the phase of the closest. `lacks`: by piece and phase, solver cells, below 0 what is too much;
    /// `piece_of`: the piece at a place, in cells. Returns whether any changed.
    pub(crate) fn exchange(
        &mut self,
        view: PhiView<'_>,
        piece_of: &(dyn Fn(Vec3) -> Option<usize> + Sync),
        lacks: &mut [Vec<f64>],
    ) -> bool {
        let (rows, slots) = self.slots();
        let bins = Bins::of_cells(&slots, rows.len());
        let near = Near { rows: &rows, bins: &bins, points: self };
        let candidate = |n: usize| {
            let (place, own) = (self.points[n], self.values[n].phase as usize);
            let piece = piece_of(place)?;
            let lack = |phase: usize| lacks[piece].get(phase).copied().unwrap_or_default();
            let closest =
                if lack(own) < 0.0 { near.within(place, 1, |other| lack(other.phase as usize) > 0.0) } else { None };
            closest.map(|(square, other)| (square, n, piece, self.values[other]))
        };
        let candidates = parallel::tabulate(self.points.len(), CHUNK, candidate);
        let mut candidates: Vec<_> = candidates.into_iter().flatten().collect();
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let held = |n: usize| {
            let (slot, cell) = (slots[n] as usize, self.points[n].map(floor));
            let phi = view.rows.find(cell).map_or(view.outside, |at| view.phi[at]);
            f64::from((0.5 - phi).clamp(0.0, 1.0)) / bins.of(slot, slot + 1).len() as f64
        };
        let mut changed = Vec::new();
        for (_, n, piece, to) in candidates {
            let (volume, lacks) = (held(n), &mut lacks[piece]);
            let [from, into] = [self.values[n].phase, to.phase].map(|phase| phase as usize);
            if lacks[from] <= -0.5 * volume && lacks[into] >= 0.5 * volume {
                lacks[from] += volume;
                lacks[into] -= volume;
                changed.push((n, to));
            }
        }
        changed.iter().for_each(|(n, to)| self.values[*n] = *to);
        !changed.is_empty()
    }

    fn next_round(&mut self) -> u64 {
        self.rounds += 1;
        self.rounds
    }
}

/// Points by the cells that they are in.
struct Near<'a> {
    rows: &'a CellRows,
    bins: &'a Bins,
    points: &'a MaterialPoints,
}

impl Near<'_> {
    /// What the closest point to a place that is meant is made of; the liquid's own where there is none near.
    fn closest(&self, place: Vec3, is_meant: impl Fn(&Stored) -> bool) -> Stored {
        let found = RINGS.iter().find_map(|ring| self.within(place, *ring, &is_meant));
        found.map_or(LiquidMaterial::default().stored(), |(_, n)| self.points.values[n])
    }

    /// The closest point that is meant in the cells around that of a place, and the square of its distance.
    fn within(&self, place: Vec3, ring: i32, is_meant: impl Fn(&Stored) -> bool) -> Option<(f32, usize)> {
        let cell = place.map(|x| floor(x.clamp(-FARTHEST, FARTHEST)));
        let mut best: Option<(f32, usize)> = None;
        for n in self.bins.around(self.rows, cell, ring).map(|n| *n as usize) {
            if is_meant(&self.points.values[n]) {
                let way = sub(self.points.points[n], place);
                let square = dot(way, way);
                if best.is_none_or(|(least, _)| square < least) {
                    best = Some((square, n));
                }
            }
        }
        best
    }
}

/// The cell of the domain that a point is in; one on a wall is in that before it.
fn cell_of(point: Vec3, domain: &Domain) -> Cell {
    std::array::from_fn(|axis| floor(point[axis]).clamp(domain.low[axis], domain.high[axis] - 1))
}

/// Which octant of a cell a point is in.
fn octant(cell: Cell, point: Vec3) -> usize {
    let upper = |axis: usize| usize::from(point[axis] - cell[axis] as f32 >= 0.5);
    upper(0) | upper(1) << 1 | upper(2) << 2
}

/// A place in each octant of the cells, where `start` makes what says which of them are wanted, in the order of the cells.
fn places<W: FnMut(Cell, [Vec3; PER_CELL]) -> [bool; PER_CELL]>(
    cells: &CellRows,
    round: u64,
    start: impl Fn() -> W + Sync,
) -> Vec<Vec3> {
    let key = Key::new(SEED).of(round);
    let spans: Vec<_> = cells.spans().collect();
    let parts = parallel::map(spans.chunks(CHUNK), |_, spans| {
        let (mut wanted, mut out) = (start(), Vec::new());
        for ([y, z], span) in spans {
            for cell in (span.start..span.end).map(|x| [x, *y, *z]) {
                let places = octants(key, cell);
                let picked = wanted(cell, places).into_iter().zip(places).filter(|(wanted, _)| *wanted);
                out.extend(picked.map(|(_, place)| place));
            }
        }
        out
    });
    parallel::concat(parts)
}

/// A random place in each octant of a cell.
fn octants(key: Key, cell: Cell) -> [Vec3; PER_CELL] {
    let key = cell.iter().fold(key, |key, x| key.of(u64::from(*x as u32)));
    std::array::from_fn(|octant| {
        let key = key.of(octant as u64);
        std::array::from_fn(|axis| {
            let upper = (octant >> axis & 1) as f32;
            cell[axis] as f32 + 0.5 * (upper + key.of(axis as u64).f32())
        })
    })
}
