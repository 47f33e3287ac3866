//! A box of 1 m whose pressure is solved for, around a ball: a pool, or a dam with drops.

use liquid::open_share::open_share;
use liquid::pressure::PressureGrid;
use liquid::rows::{Cell, CellRows, Periods};
use numerics::random::Key;
use numerics::trig;
use numerics::vector::{Vec3, length, sub};

/// Share of the flow that is left.
pub(crate) const TOLERANCE: f64 = 1e-5;

/// `n` cells along the box.
pub(crate) struct Scene {
    n: i32,
    pub(crate) rows: CellRows,
    level_set: Vec<f32>,
    open: [Vec<f32>; 3],
}

pub(crate) fn pool([_, y, _]: Vec3) -> f32 {
    y - 0.25
}

pub(crate) fn drops(point: Vec3) -> f32 {
    let random = |n: u64, k: u64| Key::new(3).of(n).of(k).between([0.0, 1.0]);
    let drop = |n: u64| {
        let centre = [random(n, 0), 0.3 + 0.7 * random(n, 1), random(n, 2)];
        length(sub(point, centre)) - 0.02 - 0.04 * random(n, 3)
    };
    (0..60).map(drop).fold((point[0] - 0.35).max(point[1] - 0.55), f32::min)
}

/// The distance from the ball, m.
fn ball(point: Vec3) -> f32 {
    length(sub(point, [0.3, 0.15, 0.5])) - 0.12
}

impl Scene {
    pub(crate) fn new(n: i32, level_set: fn(Vec3) -> f32) -> Self {
        let h = 1.0 / n as f32;
        let rows = CellRows::cuboid([0; 3], [n; 3]);
        let level_set = rows.tabulate(|cell| level_set(cell.map(|i| (i as f32 + 0.5) * h)));
        let open = rows.tabulate_each(|cell| {
            [0, 1, 2].map(|axis| {
                let corner = |(a, b): (i32, i32)| {
                    let mut node = cell;
                    node[(axis + 1) % 3] += a;
                    node[(axis + 2) % 3] += b;
                    ball(node.map(|i| i as f32 * h))
                };
                if cell[axis] == 0 { 0.0 } else { open_share([(0, 0), (1, 0), (1, 1), (0, 1)].map(corner)) }
            })
        });
        Self { n, rows, level_set, open }
    }

    pub(crate) fn grid(&self) -> PressureGrid<'_> {
        PressureGrid {
            rows: &self.rows,
            level_set: &self.level_set,
            weights: [&self.open[0], &self.open[1], &self.open[2]],
            periods: Periods::NONE,
        }
    }

    /// What flows into a cell under gravity and a swirl.
    pub(crate) fn inflow(&self, cell: Cell) -> f64 {
        let Some(at) = self.rows.find(cell) else { return 0.0 };
        let mut sum = 0.0;
        for axis in 0..3 {
            for side in 0..2 {
                let mut face = cell;
                face[axis] += side;
                let beyond = || self.rows.find(face).map_or(0.0, |at| self.open[axis][at]);
                let open = if side == 0 { self.open[axis][at] } else { beyond() };
                let swirl = trig::sin(face[(axis + 1) % 3] as f32 * 19.2 / self.n as f32);
                let speed = if axis == 1 { -9.81 / 24.0 } else { swirl };
                sum += f64::from(open * speed) * if side == 0 { 1.0 } else { -1.0 };
            }
        }
        sum
    }
}
