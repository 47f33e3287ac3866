//! Balls of liquid that come in between frames: drops that the grid shows again.

use numerics::vector::{Vec3, add, length, scale, sub};

use crate::carried::{Filled, LiquidMaterial};
use crate::level_set::PhiView;
use crate::rows::{Cell, CellRows};
use crate::step::domain::{Domain, Obstacle, Solid};
use crate::step::{Liquid, Surface, Wall};
use crate::velocity::{MacVelocity, Site, resampled};

/// A ball of liquid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiquidBall {
    /// Its centre, in cells.
    pub place: Vec3,
    /// In cells.
    pub radius: f32,
    /// m/s.
    pub velocity: Vec3,
    /// What it is made of, where the liquid knows of materials.
    pub material: LiquidMaterial,
}

/// Cells around a ball whose φ it changes.
const AROUND: f32 = 3.0;
/// Times that a ball is moved out of a solid.
const MOVES: usize = 4;

impl LiquidBall {
    /// The ball moved off walls and a solid that it reaches into; none where its centre stays in one, or leaves the domain.
    pub fn beside(
        self,
        domain: &Domain,
        solid: &dyn Fn(Vec3) -> f32,
        outward: impl Fn(Vec3) -> Option<Vec3>,
    ) -> Option<Self> {
        let mut place = self.place;
        for _ in 0..MOVES {
            let depth = self.radius - solid(place);
            if let Some(out) = outward(place).filter(|_| depth > 0.0) {
                place = add(place, scale(out, depth));
            }
            place = self.within_walls(domain, place);
        }
        let is_in = domain.contains(place.map(|x| x.floor() as i32));
        (is_in && solid(place) > 0.0).then_some(Self { place, ..self })
    }

    fn within_walls(&self, domain: &Domain, place: Vec3) -> Vec3 {
        std::array::from_fn(|axis| {
            let [low, high] = [0, 1].map(|side| domain.bounds()[side][axis]);
            let room = self.radius.min(0.5 * (high - low));
            let mut at = place[axis];
            at = if domain.walls[axis][0].is_solid() { at.max(low + room) } else { at };
            if domain.walls[axis][1].is_solid() { at.min(high - room) } else { at }
        })
    }

    fn distance(&self, point: Vec3) -> f32 {
        length(sub(point, self.place)) - self.radius
    }

    /// The cells `low` ≤ cell < `high` within a distance of it, in the domain.
    fn bounds(&self, by: f32, domain: &Domain) -> [Cell; 2] {
        let reach = self.radius + by;
        let low = |axis: usize| ((self.place[axis] - reach).floor() as i32).max(domain.low[axis]);
        let high = |axis: usize| ((self.place[axis] + reach).ceil() as i32).min(domain.high[axis]);
        [[0, 1, 2].map(low), [0, 1, 2].map(high)]
    }
}

impl<S: Surface> Liquid<S> {
    /// Adds a ball, which moves with its velocity, where it is neither in a solid, as that is at a time, nor in the liquid.
    pub fn add_ball(&mut self, ball: &LiquidBall, solid: Option<Solid<'_>>, time: f64) {
        let (domain, solid) = (self.settings.domain, solid.map(|solid| solid.at(time)));
        let [low, high] = ball.bounds(AROUND, &domain);
        if (0..3).any(|axis| low[axis] >= high[axis]) {
            return;
        }
        let outside = |point: Vec3| solid.map_or(f32::MIN, |solid| -solid.distance(point));
        let box_cells = CellRows::cuboid(low, high);
        let before = phi_on(&box_cells, self.surface.view());
        self.surface.change(low, high, &|point, phi| phi.min(ball.distance(point).max(outside(point))));
        if let Some(materials) = &mut self.motion.materials {
            let after = phi_on(&box_cells, self.surface.view());
            let filled = Filled { rows: &box_cells, before: &before, after: &after };
            materials.fill(&filled, &domain, ball.material);
        }
        self.move_ball(ball, solid, &domain);
    }

    /// Gives the faces of a ball's cells its velocity, where there is no liquid that says otherwise.
    fn move_ball(&mut self, ball: &LiquidBall, solid: Option<Obstacle<'_>>, domain: &Domain) {
        let [low, high] = ball.bounds(0.0, domain);
        let own = CellRows::cuboid(low, high).filtered(|cell, _| ball.distance(Site::Centre.of(cell)) < 0.0);
        let rows = self.motion.rows().union(&domain.clip(&own.dilated(1)));
        let images = domain.periods().images(&rows);
        let mut known = rows.resampled(self.motion.rows(), &self.motion.known, 0);
        let mut faces = resampled(&rows, self.motion.rows(), self.motion.velocity.faces());
        for (at, cell) in rows.iter().enumerate() {
            for axis in 0..3 {
                let mut below = cell;
                below[axis] -= 1;
                let is_own = own.find(cell).is_some() || own.find(below).is_some();
                let is_open = solid.is_none_or(|solid| solid.distance(Site::FACES[axis].of(cell)) > 0.0);
                if is_own && is_open && known[at] >> axis & 1 == 0 {
                    let is_wall = domain.wall_at(axis, cell).is_some_and(Wall::is_solid);
                    faces[axis][at] = if is_wall { 0.0 } else { ball.velocity[axis] };
                    known[at] |= 1 << axis;
                }
            }
        }
        images.fill(&mut known);
        images.fill_each(&mut faces);
        if let Some(gain) = &mut self.motion.gain {
            gain.faces = resampled(&rows, self.motion.velocity.rows(), &gain.faces);
        }
        self.motion.liquid_cells += own.len();
        self.motion.fly_on(&rows);
        self.motion.known = known;
        self.motion.velocity = MacVelocity::new(rows, faces);
    }
}

/// φ on the cells of a box.
fn phi_on(rows: &CellRows, view: PhiView<'_>) -> Vec<f32> {
    rows.resampled(view.rows, view.phi, view.outside)
}
