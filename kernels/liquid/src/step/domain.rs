//! The box that a liquid is in.

use numerics::vector::Vec3;

use crate::level_set::{OpenSides, Sides, into, outward};
use crate::open_share::open_share;
use crate::rows::{Cell, CellRows, Periods};
use crate::velocity::{FaceFields, Site};

/// What a side of the domain is to the liquid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wall {
    /// Liquid leaves through it into air of pressure 0, and air comes in where liquid moves away.
    Open,
    /// A solid wall.
    #[default]
    Closed,
    /// A solid wall without friction. Without viscosity there is no difference.
    FreeSlip,
    /// None: what goes out comes in at the other side, which is periodic too. Solids and the shapes of sources and sinks do
    /// not repeat.
    Periodic,
}

impl Wall {
    /// Whether liquid does not pass.
    #[inline(always)]
    pub fn is_solid(self) -> bool {
        matches!(self, Self::Closed | Self::FreeSlip)
    }
}

/// The cells `low` ≤ cell < `high`, and the walls around them. An axis with a periodic wall has two, and `low` 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    /// The first cell.
    pub low: Cell,
    /// The cell after the last.
    pub high: Cell,
    /// For x, y and z the wall at the low side and at the high side.
    pub walls: [[Wall; 2]; 3],
}

/// What liquid does not enter. Functions of the time since the start of the frame, s, and a place in cells.
#[derive(Clone, Copy)]
pub struct Solid<'a> {
    /// The distance from it, in cells; negative inside.
    pub distance: &'a (dyn Fn(f64, Vec3) -> f32 + Sync),
    /// How it moves, m/s.
    pub velocity: &'a (dyn Fn(f64, Vec3) -> Vec3 + Sync),
    /// How fast its surface moves along its normal, at most, m/s: substeps are short enough to see it on its way.
    pub speed: f64,
}

impl<'a> Solid<'a> {
    /// A solid that does not move.
    pub fn still(distance: &'a (dyn Fn(f64, Vec3) -> f32 + Sync)) -> Self {
        Self { distance, velocity: &|_, _| [0.0; 3], speed: 0.0 }
    }

    /// The solid at one time.
    pub(crate) fn at(self, time: f64) -> Obstacle<'a> {
        Obstacle { solid: self, time }
    }
}

/// A solid at one time.
#[derive(Clone, Copy)]
pub(crate) struct Obstacle<'a> {
    solid: Solid<'a>,
    time: f64,
}

impl Obstacle<'_> {
    /// The same, were it not moving.
    pub(super) fn stopped(self) -> Self {
        Self { solid: Solid::still(self.solid.distance), time: self.time }
    }

    pub(crate) fn distance(&self, point: Vec3) -> f32 {
        (self.solid.distance)(self.time, point)
    }

    pub(super) fn velocity(&self, point: Vec3) -> Vec3 {
        (self.solid.velocity)(self.time, point)
    }

    /// How fast it moves, at most, m/s.
    pub(super) fn speed(&self) -> f32 {
        self.solid.speed as f32
    }

    /// Whether liquid on the other side of it could reach a place.
    pub(super) fn is_thin_at(&self, place: Vec3) -> bool {
        let solid = |point: Vec3| self.distance(point);
        let Some(normal) = self.normal(place) else { return false };
        let inside = match self.distance(place) {
            height if height < 0.0 => Some((place, -height)),
            height => into(&solid, place, height, normal),
        };
        inside.and_then(|(inside, depth)| Sides::of(&solid, inside, depth)).is_some_and(|sides| sides.is_thin())
    }

    /// The unit vector out of it.
    pub(super) fn normal(&self, point: Vec3) -> Option<Vec3> {
        outward(&|point| self.distance(point), point)
    }
}

impl Domain {
    /// A box of these cells with closed walls.
    pub const fn closed(low: Cell, high: Cell) -> Self {
        Self { low, high, walls: [[Wall::Closed; 2]; 3] }
    }

    /// The corners of the box, in cells.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.low, self.high].map(|corner| corner.map(|x| x as f32))
    }

    /// After how many cells the box repeats along each axis.
    pub fn periods(&self) -> Periods {
        Periods([0, 1, 2].map(|axis| if self.walls[axis][0] == Wall::Periodic { self.high[axis] } else { 0 }))
    }

    /// The sides that are open.
    pub(crate) fn open_sides(&self) -> OpenSides {
        self.walls.map(|walls| walls.map(|wall| wall == Wall::Open))
    }

    /// Whether the cell lies in the box.
    #[inline(always)]
    pub fn contains(&self, cell: Cell) -> bool {
        (0..3).all(|axis| self.low[axis] <= cell[axis] && cell[axis] < self.high[axis])
    }

    /// The part of the rows in the box and one cell beyond each side: cells beyond hold the faces of the wall above and
    /// tangential velocity behind walls. Beyond sides that are periodic they are images.
    pub fn clip(&self, rows: &CellRows) -> CellRows {
        self.clip_with_images(rows, 1)
    }

    /// The corners of what is stored: the box, one cell beyond each side, and `margin` beyond those that are periodic.
    pub(super) fn reach(&self, margin: i32) -> [Cell; 2] {
        let beyond = |axis: usize| if self.walls[axis][0] == Wall::Periodic { margin } else { 1 };
        let corner = |corner: Cell, sign: i32| std::array::from_fn(|axis| corner[axis] + sign * beyond(axis));
        [corner(self.low, -1), corner(self.high, 1)]
    }

    /// The same with as many images beyond periodic sides as `margin`.
    pub(super) fn clip_with_images(&self, rows: &CellRows, margin: i32) -> CellRows {
        let periods = self.periods();
        let within = |rows: &CellRows| rows.clipped(self.low.map(|x| x - 1), self.high.map(|x| x + 1));
        if !periods.any() {
            return within(rows);
        }
        periods.with_images(within(&periods.gathered(rows.clone())), margin)
    }

    /// Where the low face of a cell is a side of the box, which wall that is.
    #[inline(always)]
    pub fn wall_at(&self, axis: usize, cell: Cell) -> Option<Wall> {
        if cell[axis] == self.low[axis] {
            return Some(self.walls[axis][0]);
        }
        (cell[axis] == self.high[axis]).then_some(self.walls[axis][1])
    }

    /// The open share of the low face of each cell along each axis, and the distance of its middle from the closest closed
    /// wall or solid, in cells, negative inside.
    pub(super) fn faces(&self, rows: &CellRows, solid: Option<Obstacle<'_>>) -> [FaceFields<f32>; 2] {
        let distance = |axis: usize, cell: Cell| {
            let middle = Site::FACES[axis].of(cell);
            let mut distance = solid.map_or(f32::MAX, |solid| solid.distance(middle));
            for other in 0..3 {
                let ways = [middle[other] - self.low[other] as f32, self.high[other] as f32 - middle[other]];
                for (wall, way) in self.walls[other].iter().zip(ways) {
                    distance = if wall.is_solid() { distance.min(way) } else { distance };
                }
            }
            distance
        };
        [self.open_shares(rows, solid), rows.tabulate_each(|cell| [0, 1, 2].map(|axis| distance(axis, cell)))]
    }

    /// The share of the shear stress that is dropped at a low face that liquid does not flow through: all beside air
    /// and walls of free slip, `slip` at other solids.
    pub(super) fn slip(&self, axis: usize, cell: Cell, slip: f32) -> f32 {
        let wall_beside = |other: usize| {
            let beyond = [cell[other] < self.low[other], cell[other] >= self.high[other]];
            (0..2)
                .find(|side| other != axis && beyond[*side])
                .map(|side| self.walls[other][side])
                .filter(|wall| *wall != Wall::Periodic)
        };
        match (0..3).find_map(wall_beside) {
            Some(Wall::Open | Wall::FreeSlip) => 1.0,
            Some(Wall::Closed | Wall::Periodic) | None => slip,
        }
    }

    /// The open share of the low face of each cell along each axis.
    pub(super) fn open_shares(&self, rows: &CellRows, solid: Option<Obstacle<'_>>) -> [Vec<f32>; 3] {
        rows.tabulate_each(|cell| [0, 1, 2].map(|axis| self.open_share(axis, cell, solid)))
    }

    /// The velocity of the solid at each low face that it covers in part, m/s; 0 at others and at walls.
    pub(super) fn solid_velocity(
        &self,
        rows: &CellRows,
        open: &FaceFields<f32>,
        solid: Obstacle<'_>,
    ) -> FaceFields<f32> {
        rows.tabulate_with(
            || (),
            |(), cell, at| {
                [0, 1, 2].map(|axis| {
                    let is_wall = self.wall_at(axis, cell).is_some_and(Wall::is_solid);
                    match open[axis][at] < 1.0 && self.contains(cell) && !is_wall {
                        true => solid.velocity(Site::FACES[axis].of(cell))[axis],
                        false => 0.0,
                    }
                })
            },
        )
    }

    fn open_share(&self, axis: usize, cell: Cell, solid: Option<Obstacle<'_>>) -> f32 {
        let within = |other: usize| {
            let high = self.high[other] + i32::from(other == axis);
            self.low[other] <= cell[other] && cell[other] < high
        };
        if !(0..3).all(within) || self.wall_at(axis, cell).is_some_and(Wall::is_solid) {
            return 0.0;
        }
        solid.map_or(1.0, |solid| share_outside(axis, cell, solid))
    }
}

/// The share of a low face outside a solid.
pub(super) fn share_outside(axis: usize, cell: Cell, solid: Obstacle<'_>) -> f32 {
    open_share([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
        let mut corner = cell;
        corner[(axis + 1) % 3] += a;
        corner[(axis + 2) % 3] += b;
        solid.distance(corner.map(|x| x as f32))
    }))
}
