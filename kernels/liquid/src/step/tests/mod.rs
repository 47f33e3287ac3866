//! The laws that a liquid keeps, on small grids; `examples/dam_break.rs` has them on larger ones.

mod balls;
mod dam;
mod decoupled;
mod force;
mod free_spin;
mod leaks;
mod materials;
mod outflow;
mod periodic;
mod plain;
mod pushed;
mod rest;
mod runs;
mod sources;
mod spin;
mod splash;
mod spreading;
mod streams;
mod tank;
mod thin;
mod viscous;

use super::*;
use crate::level_set::PhiView;
use crate::rows::Cell;
use crate::velocity::Site;
use numerics::vector::{Vec3, length};
use plain::PlainLevelSet;

const WEIGHTLESS: Surroundings<'_> = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
const FALLING: Surroundings<'_> = Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 0.0);

/// The distance from a box.
fn block(low: Vec3, high: Vec3) -> impl Fn(Vec3) -> f32 {
    move |p| (0..3).map(|axis| (low[axis] - p[axis]).max(p[axis] - high[axis])).fold(f32::NEG_INFINITY, f32::max)
}

/// A cylinder that turns in one that stands, in a box of liquid.
struct Cylinders {
    /// Cells of the box along x and y.
    n: i32,
    /// The radii, in cells.
    a: f32,
    b: f32,
}

impl Cylinders {
    fn new(n: i32) -> Self {
        Self { n, a: 0.1575 * n as f32, b: 0.43 * n as f32 }
    }

    fn domain(&self) -> Domain {
        let walls = [[Wall::Closed; 2], [Wall::Closed; 2], [Wall::FreeSlip; 2]];
        Domain { walls, ..Domain::closed([0; 3], [self.n, self.n, 2]) }
    }

    fn radius(&self, p: Vec3) -> f32 {
        let middle = 0.5 * self.n as f32;
        length([p[0] - middle, p[1] - middle, 0.0])
    }

    fn distance(&self, p: Vec3) -> f32 {
        (self.radius(p) - self.a).min(self.b - self.radius(p))
    }

    /// The inner one turns by 1 m/s at a distance of the box's side.
    fn velocity(&self, p: Vec3) -> Vec3 {
        let (middle, size) = (0.5 * self.n as f32, self.n as f32);
        let rate = if self.radius(p) < 0.3 * size { 1.0 / size } else { 0.0 };
        [rate * (middle - p[1]), rate * (p[0] - middle), 0.0]
    }

    /// The largest error of the velocity along y on the line through the middle, ÷ the speed of the inner cylinder, where it
    /// should be `exact` of the radius.
    fn worst(&self, motion: &Motion, exact: impl Fn(f32) -> f32) -> f32 {
        let (mut worst, mut count) = (0.0_f32, 0);
        for (at, cell) in motion.rows().iter().enumerate().filter(|(_, cell)| self.domain().contains(*cell)) {
            let p = Site::FACES[1].of(cell);
            let r = self.radius(p);
            if cell[1] == self.n / 2 && p[0] > 0.5 * self.n as f32 && r > self.a + 1.0 && r < self.b - 1.0 {
                let error = (motion.velocity().faces()[1][at] - exact(r)).abs();
                worst = worst.max(error / (self.a / self.n as f32));
                count += 1;
            }
        }
        assert!(count > self.n / 5, "{count}");
        worst
    }
}

/// Mass, ÷ density · cell³, by cells cut straight.
fn volume(view: &PhiView<'_>, domain: &Domain) -> f64 {
    let share =
        |(at, cell): (usize, [i32; 3])| if domain.contains(cell) { (0.5 - view.phi[at]).clamp(0.0, 1.0) } else { 0.0 };
    view.rows.iter().enumerate().map(|cell| f64::from(share(cell))).sum()
}

/// Kinetic energy ÷ density · cell³, m²/s², where `share` of each cell is liquid.
fn kinetic_energy(motion: &Motion, share: impl Fn([i32; 3]) -> f64) -> f64 {
    let mut energy = 0.0;
    for (at, cell) in motion.rows().iter().enumerate() {
        for axis in 0..3 {
            let mut below = cell;
            below[axis] -= 1;
            let u = f64::from(motion.velocity().faces()[axis][at]);
            energy += 0.25 * (share(cell) + share(below)) * u * u;
        }
    }
    energy
}

/// The largest speed in frames of 1/24 s of a liquid that should rest; ÷ g·Δt.
fn fastest(liquid: &mut Liquid<impl Surface>, around: &Surroundings<'_>, frames: u32) -> f64 {
    let speed = (0..frames).fold(0.0, |most, _| {
        liquid.step_frame(around, 1.0 / 24.0);
        f64::max(most, largest(liquid))
    });
    speed * 24.0 / 9.81
}

/// The largest speed on a face, m/s.
fn largest(liquid: &Liquid<impl Surface>) -> f64 {
    liquid.motion().largest_speed()
}
