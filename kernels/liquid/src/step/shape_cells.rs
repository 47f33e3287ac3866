//! The cells that a source or sink reaches, and how much liquid they hold.

use numerics::vector::Vec3;

use crate::level_set::PhiView;
use crate::pressure::LEAST_DEPTH;
use crate::rows::{Cell, CellRows};
use crate::step::domain::{Domain, Obstacle};
use crate::step::fullness::{Neighbours, fullness};
use crate::step::part::{Ellipsoid, LEAST, Part};
use crate::step::sources::SourceShape;
use crate::velocity::Site;

/// Cells around the bounds of a shape whose φ adding it may change.
const MARGIN: i32 = 2;

/// Half the diagonal of a cell: a shape farther from its middle does not touch it.
const HALF_DIAGONAL: f32 = 0.87;

/// Depth to which a shape inside a solid is filled, in cells: φ on the solid's surface must not see the end.
const INTO_SOLID: f32 = 2.0;

/// Depth to which one is emptied, in cells: rounding would lift liquid that ends on the solid's surface out of it.
const OUT_OF_SOLID: f32 = 0.25;

/// Size of the fillet that is left where what is taken away meets a solid, in cells: the surface would round off a sharp edge,
/// from nothing, and that would be taken in each substep.
const FILLET: f32 = 2.0;

/// Size of the least part that is filled beside liquid, where 0 is that which may be filled anywhere and −1 nothing.
const LEAST_BESIDE: f32 = -0.95;

/// Half the length of a shape that has no end, in cells.
const BEYOND: f32 = 1e3;

/// Changes of volume that count, in cells.
const LEAST_VOLUME: f64 = 1e-5;

/// Depth, in cells, from which on all that is next to a cell is liquid.
const DEEP: f32 = 1.0;

/// Share of a cell that is taken, at least.
const LEAST_TAKEN: f32 = 0.1;

/// The shape of a source or sink at one time, on the cells around it.
pub(super) struct ShapeCells<'a> {
    shape: SourceShape<'a>,
    solid: Option<Obstacle<'a>>,
    time: f64,
    /// What is added to a shape that is too thin for the grid, so that its deepest cell is half a cell deep.
    thickening: f32,
    domain: Domain,
    rows: CellRows,
    low: Cell,
    size: [usize; 3],
    /// The distance of each cell's middle.
    distance: Vec<f32>,
    /// Where filling it goes: the same, with its end inside solids.
    reached: Vec<f32>,
    /// The share of each cell that is neither solid nor beyond a wall.
    open: Vec<f32>,
}

impl<'a> ShapeCells<'a> {
    /// None where the shape is not in the domain.
    pub(super) fn new(shape: SourceShape<'a>, domain: &Domain, solid: Option<Obstacle<'a>>, time: f64) -> Option<Self> {
        let [low, high] = shape.bounds;
        let low: Cell = std::array::from_fn(|n| low[n].saturating_sub(MARGIN).max(domain.low[n] - 1));
        let high: Cell = std::array::from_fn(|n| high[n].saturating_add(MARGIN).min(domain.high[n] + 1));
        if (0..3).any(|axis| low[axis] >= high[axis]) {
            return None;
        }
        let size = [0, 1, 2].map(|axis| (high[axis] - low[axis]) as usize);
        let rows = CellRows::cuboid(low, high);
        let [mut distance, depth, open] = rows.tabulate_each(|cell| {
            let middle = Site::Centre.of(cell);
            let depth = solid.map_or(f32::MIN, |solid| -solid.distance(middle));
            let open = if domain.contains(cell) { (0.5 - depth).clamp(0.0, 1.0) } else { 0.0 };
            [distance_from(shape, time, middle), depth, open]
        });
        let closest = distance.iter().fold(f32::INFINITY, |least, d| if *d < least { *d } else { least });
        if closest > HALF_DIAGONAL {
            return None;
        }
        let thickening = (closest + 0.5).max(0.0);
        distance.iter_mut().for_each(|d| *d -= thickening);
        let reached = distance.iter().zip(&depth).map(|(d, depth)| d.max(depth - INTO_SOLID)).collect();
        Some(Self { shape, solid, time, thickening, domain: *domain, rows, low, size, distance, reached, open })
    }

    /// The cells around the shape.
    pub(super) fn rows(&self) -> &CellRows {
        &self.rows
    }

    /// The distance of a place from the shape.
    pub(super) fn distance(&self, point: Vec3) -> f32 {
        distance_from(self.shape, self.time, point) - self.thickening
    }

    /// The box of cells that changing φ by the shape changes.
    pub(super) fn bounds(&self) -> [Cell; 2] {
        let high = [0, 1, 2].map(|axis| self.low[axis] + self.size[axis] as i32);
        [self.low, high]
    }

    /// φ with a part of the shape added.
    pub(super) fn filled(&self, part: Part) -> impl Fn(Vec3, f32) -> f32 + Sync {
        move |point, phi| {
            let distance = part.distance(point, self.distance(point));
            let reached = match self.solid {
                Some(solid) if distance < phi => distance.max(-solid.distance(point) - INTO_SOLID),
                _ => distance,
            };
            phi.min(reached)
        }
    }

    /// φ with the shape taken away where it is not in a solid: what goes on inside one would be taken again and again.
    pub(super) fn emptied(&self) -> impl Fn(Vec3, f32) -> f32 + Sync {
        move |point, phi| {
            let side = -self.distance(point);
            let left = match self.solid {
                Some(solid) if side > phi => {
                    let floor = solid.distance(point) + OUT_OF_SOLID;
                    let rounded = (FILLET - (floor - side).abs()).max(0.0);
                    floor.min(side) - rounded * rounded / (4.0 * FILLET)
                }
                _ => side,
            };
            phi.max(left)
        }
    }

    /// φ of the cells; beyond walls that next to them.
    pub(super) fn level_set(&self, view: &PhiView<'_>) -> Vec<f32> {
        self.rows.tabulate(|cell| {
            let inner = [0, 1, 2].map(|axis| cell[axis].clamp(self.domain.low[axis], self.domain.high[axis] - 1));
            view.rows.find(inner).map_or(view.outside, |at| view.phi[at])
        })
    }

    /// How much liquid the cells hold, ÷ cell³, by φ in parts of them.
    pub(super) fn volume(&self, phi: &[f32]) -> f64 {
        let held = |at: usize, cell: Cell| {
            if self.open[at] > 0.0 { self.open[at] * fullness(&self.around(phi, cell)) } else { 0.0 }
        };
        let [held] = self.rows.tabulate_with(|| (), |(), cell, at| [held(at, cell)]);
        held.iter().fold(0.0, |sum, held| sum + f64::from(*held))
    }

    /// φ around a cell; beyond the cells, that of the last ones.
    fn around(&self, phi: &[f32], cell: Cell) -> Neighbours {
        let [nx, ny, _] = self.size;
        std::array::from_fn(|n| {
            let [x, y, z] = std::array::from_fn(|axis| {
                let away = (n / [1, 5, 25][axis] % 5) as i32 - 2;
                (cell[axis] - self.low[axis] + away).clamp(0, self.size[axis] as i32 - 1) as usize
            });
            phi[(z * ny + y) * nx + x]
        })
    }

    /// The same, roughly, by φ at their centres.
    fn rough_volume(&self, phi: &[f32]) -> f64 {
        let mut sum = 0.0;
        self.for_each_share(phi, |_, share| sum += f64::from(share));
        sum
    }

    /// Calls `f` with how full of liquid each cell is, in the order of fields.
    fn for_each_share(&self, phi: &[f32], mut f: impl FnMut(usize, f32)) {
        let [nx, ny, nz] = self.size;
        for z in 0..nz {
            for y in 0..ny {
                let row = (z * ny + y) * nx;
                let beside = [
                    (z * ny + y.saturating_sub(1)) * nx,
                    (z * ny + (y + 1).min(ny - 1)) * nx,
                    (z.saturating_sub(1) * ny + y) * nx,
                    ((z + 1).min(nz - 1) * ny + y) * nx,
                ];
                for x in 0..nx {
                    let around = beside.iter().fold(0.0, |sum, row| sum + phi[row + x])
                        + (phi[row + x.saturating_sub(1)] + phi[row + (x + 1).min(nx - 1)]);
                    // The mean of φ over the cell: exact where φ bends as a sphere's does.
                    let mean = 0.75 * phi[row + x] + (1.0 / 24.0) * around;
                    f(row + x, (0.5 - mean).clamp(0.0, 1.0) * self.open[row + x]);
                }
            }
        }
    }

    /// The part of the shape that adds `most`, ÷ cell³, when it is filled: all of it where that adds no more. None where not
    /// even the least piece of it can be filled.
    pub(super) fn part_that_adds(&self, phi: &[f32], most: f64) -> Option<Part> {
        let before = self.rough_volume(phi);
        let mut filled = vec![0.0; phi.len()];
        let mut added = |part: Part| {
            self.fill(phi, part, &mut filled);
            self.rough_volume(&filled) - before
        };
        if added(Part::Whole) <= most.max(LEAST_VOLUME) {
            return Some(Part::Whole);
        }
        let middle = self.middle()?;
        let of_size = |size: f32| Part::Middle(middle.sized(size));
        // Beside liquid nothing is too small to stay.
        let is_wet = self.rows.find(middle.centre.map(|x| x.floor() as i32)).is_some_and(|at| phi[at] < 0.0);
        let (mut enough, mut too_much) = (if is_wet { LEAST_BESIDE } else { 0.0 }, self.size_of_all(&middle));
        if added(of_size(enough)) > most {
            return None;
        }
        for _ in 0..16 {
            let size = 0.5 * (too_much + enough);
            if added(of_size(size)) > most { too_much = size } else { enough = size }
        }
        Some(of_size(enough))
    }

    /// φ of the cells with a part of the shape added.
    fn fill(&self, phi: &[f32], part: Part, filled: &mut [f32]) {
        for (at, cell) in self.rows.iter().enumerate() {
            filled[at] = phi[at].min(part.distance(Site::Centre.of(cell), self.reached[at]));
        }
    }

    /// An ellipsoid about where the shape is open, as long and wide as it; None where it is not.
    pub(super) fn middle(&self) -> Option<Ellipsoid> {
        let share = |at: usize| f64::from((0.5 - self.distance[at]).clamp(0.0, 1.0) * self.open[at]);
        let (mut sum, mut first, mut second) = (0.0, [0.0; 3], [0.0; 3]);
        for (at, cell) in self.rows.iter().enumerate() {
            let (share, middle) = (share(at), Site::Centre.of(cell).map(f64::from));
            sum += share;
            for axis in 0..3 {
                first[axis] += share * middle[axis];
                second[axis] += share * middle[axis] * middle[axis];
            }
        }
        if sum <= 0.0 {
            return None;
        }
        let mean = first.map(|first| first / sum);
        // An ellipsoid's variance along an axis is a fifth of its half length squared.
        let half = |axis: usize| (5.0 * (second[axis] / sum - mean[axis] * mean[axis])).max(0.0).sqrt() as f32;
        let axes = [0, 1, 2].map(|axis| if self.goes_beyond(axis) { BEYOND } else { half(axis) });
        let open = self.open_cells();
        let (centre, deepest) = (mean.map(|x| x as f32), Site::Centre.of(open[self.deepest(&open)?]));
        let is_inside = self.distance(centre) < 0.5 * self.distance(deepest);
        Some(Ellipsoid { centre: if is_inside { centre } else { deepest }, axes })
    }

    /// Whether the shape reaches through a side of the domain: it has no end there.
    fn goes_beyond(&self, axis: usize) -> bool {
        let is_out = |cell: Cell| cell[axis] < self.domain.low[axis] || cell[axis] >= self.domain.high[axis];
        self.rows.iter().zip(&self.distance).any(|(cell, distance)| *distance < 0.0 && is_out(cell))
    }

    /// The cells that are not in a solid or beyond a wall.
    fn open_cells(&self) -> Vec<Cell> {
        self.rows.iter().enumerate().filter(|(at, _)| self.open[*at] > 0.5).map(|(_, cell)| cell).collect()
    }

    /// The size of an ellipsoid that holds all of the shape.
    fn size_of_all(&self, middle: &Ellipsoid) -> f32 {
        let away = |axis: usize| {
            let [low, high] = [self.low[axis], self.low[axis] + self.size[axis] as i32].map(|x| x as f32);
            (middle.centre[axis] - low).max(high - middle.centre[axis]) / middle.axes[axis].max(LEAST)
        };
        let ways = [0, 1, 2].map(away);
        numerics::vector::length(ways).max(1.0)
    }

    /// Whether filling a part of the shape adds liquid.
    pub(super) fn adds(&self, phi: &[f32], part: Part) -> bool {
        let mut filled = vec![0.0; phi.len()];
        self.fill(phi, part, &mut filled);
        self.rough_volume(&filled) - self.rough_volume(phi) > LEAST_VOLUME
    }

    /// Whether there is liquid in the shape to take: enough of a cell that a surface which is cut and made anew does not lose
    /// it again and again without moving.
    pub(super) fn takes(&self, phi: &[f32]) -> bool {
        let emptied: Vec<f32> = phi.iter().zip(&self.distance).map(|(phi, distance)| phi.max(-distance)).collect();
        let mut share = vec![0.0; phi.len()];
        self.for_each_share(phi, |at, full| share[at] = full);
        let mut most = 0.0_f32;
        self.for_each_share(&emptied, |at, left| most = most.max(share[at] - left));
        most > LEAST_TAKEN
    }

    /// The liquid cells whose middle is in the shape, the deepest first.
    pub(super) fn liquid_cells(&self, phi: &[f32]) -> Vec<Cell> {
        let is_liquid = |at: usize| phi[at] < -LEAST_DEPTH && self.open[at] > 0.0 && self.distance[at] < 0.0;
        let mut cells: Vec<Cell> =
            self.rows.iter().enumerate().filter(|(at, _)| is_liquid(*at)).map(|(_, cell)| cell).collect();
        if let Some(deepest) = self.deepest(&cells) {
            cells.swap(0, deepest);
        }
        cells
    }

    /// Those of liquid cells that lie a cell deep, or half as deep as the deepest: divergence of others would partly be that
    /// of air.
    pub(super) fn deep_cells(&self, liquid: Vec<Cell>, phi: &[f32]) -> Vec<Cell> {
        let depth = |cell: &Cell| self.rows.find(*cell).map_or(0.0, |at| -phi[at]);
        let deepest = liquid.iter().map(depth).fold(0.0, f32::max);
        let least = (0.5 * deepest).min(DEEP);
        liquid.into_iter().filter(|cell| depth(cell) >= least).collect()
    }

    fn deepest(&self, cells: &[Cell]) -> Option<usize> {
        let depth = |cell: Cell| self.rows.find(cell).map_or(0.0, |at| self.distance[at]);
        let mut best: Option<(usize, f32)> = None;
        for (n, cell) in cells.iter().enumerate() {
            let distance = depth(*cell);
            if best.is_none_or(|(_, least)| distance < least) {
                best = Some((n, distance));
            }
        }
        best.map(|(n, _)| n)
    }
}

/// The distance of a place from a shape; far where it is not a number.
fn distance_from(shape: SourceShape<'_>, time: f64, point: Vec3) -> f32 {
    let distance = (shape.distance)(time, point);
    if distance.is_nan() { f32::MAX } else { distance }
}
