//! Drops too small for the grid, and their way back into the liquid.

use std::f64::consts::PI;

use liquid::carried::LiquidMaterial;
use liquid::level_set::{PhiSampler, outward};
use liquid::marked::MarkedSurface;
use liquid::step::{Domain, LiquidBall, Wall};
use numerics::vector::{add, length, lerp, scale, sub};
use serde::{Deserialize, Serialize};

use super::drop_bins::DropBins;
use super::shapes::Colliders;

/// Parts of a cell in which a drop looks for colliders on its way, and the most of them in a frame.
const STEPS_IN_CELL: f32 = 8.0;
const MOST_STEPS: f32 = 1024.0;

/// Volume, in solver cells, from which drops at one place are liquid again: the grid shows a ball of it, and keeps it.
const SHOWN: f64 = 8.0;
/// Distance, in solver cells, up to which drops are at one place.
const TOGETHER: f32 = 2.0;
/// Distance, in solver cells, from the surface up to which a drop touches it, however small it is.
const TOUCH: f32 = 0.5;

/// A drop too small for the grid. It flies on its own, stays where it hits a collider or a wall, and is liquid again where it
/// meets the liquid, or enough others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SprayDrop {
    /// Where it is, in solver cells.
    pub(super) place: [f32; 3],
    /// m/s.
    pub(super) velocity: [f32; 3],
    /// m³.
    pub(super) volume: f64,
    /// Viscosity, Pa·s, and density, kg/m³, where they are not the solver's.
    pub(super) material: [Option<f32>; 2],
    /// Which of the liquids that do not mix it is.
    pub(super) phase: u32,
    /// Who it is, for its life: below 0, where no marker is.
    pub(super) id: i32,
}

/// What drops fly in during a step.
pub(super) struct Air<'a> {
    /// m/s².
    pub(super) gravity: [f64; 3],
    /// The length of the step, s.
    pub(super) seconds: f64,
    /// The side of a cell, m.
    pub(super) cell: f64,
    pub(super) domain: &'a Domain,
    pub(super) colliders: &'a Colliders,
}

impl SprayDrop {
    /// Flies on for a step. Whether it is still in the domain: not where it left through an open wall.
    pub(super) fn fly(&mut self, air: &Air<'_>) -> bool {
        let from = self.place;
        for ((place, velocity), gravity) in self.place.iter_mut().zip(&mut self.velocity).zip(air.gravity) {
            let before = f64::from(*velocity);
            let after = before + gravity * air.seconds;
            *velocity = after as f32;
            *place += (0.5 * (before + after) * air.seconds / air.cell) as f32;
        }
        self.meet_colliders(from, air);
        self.meet_walls(air.domain)
    }

    /// Moves out of walls and colliders, where it is to start.
    pub(super) fn put_outside(&mut self, air: &Air<'_>) {
        let depth = -air.colliders.distance(1.0, self.place);
        if depth > 0.0
            && let Some(out) = outward(&|at| air.colliders.distance(1.0, at), self.place)
        {
            self.place = add(self.place, scale(out, depth));
        }
        let [low, high] = air.domain.bounds();
        for axis in 0..3 {
            let [below, above] = air.domain.walls[axis].map(Wall::is_solid);
            let at = &mut self.place[axis];
            *at = if below { at.max(low[axis]) } else { *at };
            *at = if above { at.min(high[axis]) } else { *at };
        }
    }

    /// Its radius, in cells of this side, m.
    fn radius(&self, cell: f64) -> f32 {
        radius(self.volume / (cell * cell * cell))
    }

    /// The ball that it is as liquid, if there is room for its centre.
    fn ball(&self, air: &Air<'_>) -> Option<LiquidBall> {
        let [viscosity, density] = self.material;
        let ball = LiquidBall {
            place: self.place,
            radius: self.radius(air.cell),
            velocity: self.velocity,
            material: LiquidMaterial { viscosity, density, phase: self.phase },
        };
        let distance = |at: [f32; 3]| air.colliders.distance(1.0, at);
        ball.beside(air.domain, &distance, |at| outward(&distance, at))
    }

    /// Stays on the first collider on its way, and moves with it.
    fn meet_colliders(&mut self, from: [f32; 3], air: &Air<'_>) {
        if air.colliders.is_empty() {
            return;
        }
        let to = self.place;
        let steps = (STEPS_IN_CELL * length(sub(to, from))).ceil().clamp(1.0, MOST_STEPS);
        for step in 1..=steps as u32 {
            let share = step as f32 / steps;
            let place = lerp(from, to, share);
            if air.colliders.distance(share, place) < 0.0 {
                let speed = (air.cell / air.seconds) as f32;
                let velocity = air.colliders.velocity(share, place);
                let end = add(place, scale(velocity, 1.0 - share));
                let depth = -air.colliders.distance(1.0, end);
                let out = outward(&|at| air.colliders.distance(1.0, at), end);
                self.place = out.map_or(end, |out| add(end, scale(out, depth.max(0.0))));
                self.velocity = scale(velocity, speed);
                return;
            }
        }
    }

    fn meet_walls(&mut self, domain: &Domain) -> bool {
        let [low, high] = domain.bounds();
        for axis in 0..3 {
            let sides = [self.place[axis] < low[axis], self.place[axis] > high[axis]];
            let Some(side) = sides.into_iter().position(|beyond| beyond) else { continue };
            match domain.walls[axis][side] {
                Wall::Open => return false,
                Wall::Periodic => {
                    let length = high[axis] - low[axis];
                    self.place[axis] = low[axis] + (self.place[axis] - low[axis]).rem_euclid(length);
                }
                Wall::Closed | Wall::FreeSlip => {
                    self.place[axis] = [low, high][side][axis];
                    self.velocity[axis] = 0.0;
                }
            }
        }
        true
    }
}

/// The radius of a ball of that volume.
fn radius(volume: f64) -> f32 {
    libm::cbrt(0.75 / PI * volume) as f32
}

/// Takes out the drops that are in the liquid or touch it. `cell`: the side of a solver cell, m.
pub(super) fn rejoining(spray: &mut Vec<SprayDrop>, surface: &MarkedSurface, cell: f64) -> Vec<SprayDrop> {
    let (size, mut sampler) = (surface.resolution() as f32, PhiSampler::new(surface.level_set().view()));
    let joins = |drop: &mut SprayDrop| {
        let near = drop.radius(cell).max(TOUCH);
        sampler.at(scale(drop.place, size)) < near * size
    };
    spray.extract_if(.., joins).collect()
}

/// Takes out the drops that together hold enough for the grid to show, as balls of liquid with their volumes, m³.
pub(super) fn gathered(spray: &mut Vec<SprayDrop>, air: &Air<'_>) -> Vec<(LiquidBall, f64)> {
    let enough = SHOWN * air.cell * air.cell * air.cell;
    let mut largest: Vec<usize> = (0..spray.len()).collect();
    largest.sort_by(|a, b| spray[*b].volume.total_cmp(&spray[*a].volume));
    let bins = DropBins::new(spray);
    let (mut is_taken, mut balls) = (vec![false; spray.len()], Vec::new());
    for first in largest {
        if is_taken[first] {
            continue;
        }
        let reach = TOGETHER.max(spray[first].radius(air.cell));
        let is_near = |n: &usize| !is_taken[*n] && length(sub(spray[*n].place, spray[first].place)) <= reach;
        let mut own = bins.near(&spray[first], reach, enough);
        own.retain(is_near);
        let together = sum(own.iter().map(|n| &spray[*n]), &spray[first]);
        if together.volume < enough {
            continue;
        }
        if let Some(ball) = together.ball(air) {
            own.iter().for_each(|n| is_taken[*n] = true);
            balls.push((ball, together.volume));
        }
    }
    let mut taken = is_taken.into_iter();
    spray.retain(|_| !taken.next().unwrap_or_default());
    balls
}

/// One drop of several: at the centre of their mass, with their momentum, of what the first is made of.
fn sum<'a>(drops: impl Iterator<Item = &'a SprayDrop> + Clone, first: &SprayDrop) -> SprayDrop {
    let volume = drops.clone().fold(0.0, |sum, drop| sum + drop.volume);
    let mean = |of: &dyn Fn(&SprayDrop) -> [f32; 3]| {
        drops.clone().fold([0.0; 3], |sum, drop| add(sum, scale(of(drop), (drop.volume / volume) as f32)))
    };
    SprayDrop { place: mean(&|drop| drop.place), velocity: mean(&|drop| drop.velocity), volume, ..*first }
}

#[cfg(test)]
mod tests {
    use engine::prelude::*;
    use liquid::step::Domain;
    use numerics::random::Key;

    use super::*;
    use crate::shared::volume::Lattice;

    fn drop(place: [f32; 3], velocity: [f32; 3]) -> SprayDrop {
        SprayDrop { place, velocity, volume: 1e-9, material: [None; 2], phase: 0, id: -1 }
    }

    fn flown(drop: SprayDrop, domain: &Domain, steps: u32) -> Option<SprayDrop> {
        flown_past(&Colliders::default(), drop, domain, steps)
    }

    fn flown_past(colliders: &Colliders, mut drop: SprayDrop, domain: &Domain, steps: u32) -> Option<SprayDrop> {
        let air = Air { gravity: [0.0, -10.0, 0.0], seconds: 0.1, cell: 0.1, domain, colliders };
        (0..steps).all(|_| drop.fly(&air)).then_some(drop)
    }

    #[test]
    fn it_flies_as_thrown() {
        // 1 s at 10 m/s² from 1 m/s upwards: 4 m down, 2 m along x; a cell is 0.1 m.
        let end = flown(drop([50.0, 90.0, 50.0], [2.0, 1.0, 0.0]), &Domain::closed([0; 3], [100; 3]), 10).unwrap();
        assert!((end.place[0] - 70.0).abs() < 1e-3 && (end.place[1] - 50.0).abs() < 1e-3, "{end:?}");
        assert!((end.velocity[1] + 9.0).abs() < 1e-4);
    }

    #[test]
    fn it_stays_on_a_thin_plate_however_fast() {
        let domain = Domain::closed([0; 3], [40; 3]);
        let (lattice, at) = (Lattice { origin: [0.0; 3], cell: 0.1 }, |n: usize| [n & 1, n >> 1 & 1, n >> 2 & 1]);
        // From 0.5 to 3.5 m, between 1.0 and 1.05 m.
        let corner = |n: usize| [[0.5, 3.5][at(n)[0]], [1.0, 1.05][at(n)[1]], [0.5, 3.5][at(n)[2]]];
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let plate = Component::mesh(vec![4; 6], faces.concat(), (0..8).map(corner).collect()).unwrap();
        let colliders = Colliders::still([&plate].into_iter(), &domain, lattice);
        for speed in [0.0, -5.0, -30.0] {
            let end = flown_past(&colliders, drop([20.0, 35.0, 20.0], [0.0, speed, 0.0]), &domain, 20).unwrap();
            assert!((end.place[1] - 10.5).abs() < 0.5, "{speed}: {end:?}");
            assert!(end.velocity[1].abs() < 1.01, "{speed}: {end:?}");
        }
    }

    #[test]
    fn drops_that_hold_enough_together_are_liquid_again() {
        // A cell of 0.1 m: 1e-3 m³.
        let (domain, colliders) = (Domain::closed([0; 3], [20; 3]), Colliders::default());
        let air = Air { gravity: [0.0; 3], seconds: 0.1, cell: 0.1, domain: &domain, colliders: &colliders };
        let of = |x: f32, volume: f64, velocity| SprayDrop { volume, ..drop([x, 0.0, 5.0], velocity) };
        let slow = of(14.0, 5e-3, [0.0; 3]);
        let mut spray = vec![of(4.0, 3e-3, [1.0, 0.0, 0.0]), slow, of(5.0, 6e-3, [4.0, 0.0, 0.0])];
        let balls = gathered(&mut spray, &air);
        let [(ball, volume)] = &balls[..] else { panic!("{balls:?}") };
        assert!((volume - 9e-3).abs() < 1e-12 && spray == [slow]);
        // On the floor, where it has room.
        let expected = [4.0 + 2.0 / 3.0, ball.radius, 5.0];
        assert!(length(sub(ball.place, expected)) < 1e-5 && (ball.velocity[0] - 3.0).abs() < 1e-5, "{ball:?}");
        let radius = f64::from(ball.radius);
        assert!((4.0 / 3.0 * PI * radius * radius * radius - 9.0).abs() < 1e-4);
        assert!(gathered(&mut spray, &air).is_empty() && spray.len() == 1);
    }

    #[test]
    fn which_drops_are_near_takes_no_look_at_all_of_them() {
        let random = |n: u64, k: u64| Key::new(5).of(n).of(k).f32();
        let any = |n: u64| {
            let place = [0, 1, 2].map(|k| 24.0 * random(n, k) - 2.0);
            // A few are larger than the distance up to which drops gather.
            let volume = f64::from((0..40).fold(60.0, |volume, _| volume * random(n, 3)));
            SprayDrop { volume, phase: (random(n, 4) * 2.0) as u32, ..drop(place, [0.0; 3]) }
        };
        let spray: Vec<SprayDrop> = (0..3000).map(any).collect();
        let bins = DropBins::new(&spray);
        let mut found = [0; 2];
        for first in &spray {
            let reach = TOGETHER.max(radius(first.volume));
            let near = |n: &usize| spray[*n].phase == first.phase && length(sub(spray[*n].place, first.place)) <= reach;
            let all: Vec<usize> = (0..spray.len()).filter(near).collect();
            let mut binned = bins.near(first, reach, 0.0);
            assert!(binned.len() < spray.len() / 10 || reach > TOGETHER);
            binned.retain(near);
            assert_eq!(binned, all);
            let volume: f64 = all.iter().map(|n| spray[*n].volume).sum();
            let is_enough = !bins.near(first, reach, SHOWN).is_empty();
            assert!(is_enough || volume < SHOWN);
            found[usize::from(is_enough)] += 1;
        }
        assert!(found.iter().all(|n| *n > 300), "{found:?}");
    }

    #[test]
    fn drops_in_the_liquid_or_at_its_surface_join_it() {
        for resolution in [1, 3] {
            let surface = MarkedSurface::new(Domain::closed([0; 3], [10; 3]), resolution, |p| p[1] - 5.0, 0, 1);
            let at = |y: f32| drop([5.0, y, 5.0], [0.0; 3]);
            let mut spray = vec![at(0.0), at(4.0), at(5.3), at(5.8), at(9.0)];
            assert_eq!(rejoining(&mut spray, &surface, 0.1), [at(0.0), at(4.0), at(5.3)]);
            assert_eq!(spray, [at(5.8), at(9.0)]);
        }
    }

    #[test]
    fn it_starts_outside_of_walls() {
        let (domain, colliders) = (Domain::closed([0; 3], [20; 3]), Colliders::default());
        let air = Air { gravity: [0.0; 3], seconds: 0.1, cell: 0.1, domain: &domain, colliders: &colliders };
        let mut below = drop([5.0, -0.3, 21.0], [0.0; 3]);
        below.put_outside(&air);
        assert_eq!(below.place, [5.0, 0.0, 20.0]);
    }

    #[test]
    fn walls_hold_it_or_let_it_go_or_wrap() {
        let mut domain = Domain::closed([0; 3], [10; 3]);
        let end = flown(drop([5.0; 3], [0.1, 0.0, 0.0]), &domain, 5).unwrap();
        assert!(end.place[1] == 0.0 && end.velocity[1] == 0.0 && end.velocity[0] == 0.1, "{end:?}");
        domain.walls[1][0] = Wall::Open;
        assert_eq!(flown(drop([5.0; 3], [0.0; 3]), &domain, 5), None);
        domain.walls = [[Wall::Periodic; 2]; 3];
        let end = flown(drop([5.0; 3], [-3.0, 0.0, 0.0]), &domain, 4).unwrap();
        assert!((0.0..10.0).contains(&end.place[1]) && (end.place[0] - 3.0).abs() < 1e-4, "{end:?}");
    }
}
