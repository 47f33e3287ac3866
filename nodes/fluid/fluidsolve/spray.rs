//! Drops too small for the grid.

use liquid::level_set::outward;
use liquid::step::{Domain, Wall};
use numerics::vector::{add, length, lerp, scale, sub};
use serde::{Deserialize, Serialize};

use super::shapes::Colliders;

/// Parts of a cell in which a drop looks for colliders on its way, and the most of them in a frame.
const STEPS_IN_CELL: f32 = 8.0;
const MOST_STEPS: f32 = 1024.0;

/// A drop too small for the grid. It flies on its own, stays where it hits a collider or a wall, and does not come back into
/// the liquid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SprayDrop {
    /// Where it is, in solver cells.
    pub(super) place: [f32; 3],
    /// m/s.
    pub(super) velocity: [f32; 3],
    /// m³.
    pub(super) volume: f32,
    /// Viscosity, Pa·s, and density, kg/m³, where they are not the solver's.
    pub(super) material: [Option<f32>; 2],
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

#[cfg(test)]
mod tests {
    use engine::prelude::*;
    use liquid::step::Domain;

    use super::*;
    use crate::shared::volume::Lattice;

    fn drop(place: [f32; 3], velocity: [f32; 3]) -> SprayDrop {
        SprayDrop { place, velocity, volume: 1e-9, material: [None; 2] }
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
