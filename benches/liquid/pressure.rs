//! The pressure solve alone, around a ball: a pool, and a dam with drops.

use engine::clock::Stopwatch;
use liquid::open_share::open_share;
use liquid::pressure::{PressureGrid, PressureSolver, Stop};
use liquid::rows::{Cell, CellRows, Periods};
use numerics::random::Key;
use numerics::trig;
use numerics::vector::{Vec3, length, sub};
use rayon::ThreadPoolBuilder;

use crate::Extent;
use crate::table::Table;

const ROUNDS: usize = 5;

/// Share of the flow that is left.
const TOLERANCE: f64 = 1e-5;

/// A scene of `n` cells along a box of 1 m.
struct Scene {
    name: &'static str,
    n: i32,
    rows: CellRows,
    level_set: Vec<f32>,
    open: [Vec<f32>; 3],
    /// Milliseconds of the fastest set-up and of the fastest solve, and its iterations.
    setup: f64,
    solve: f64,
    iterations: u32,
}

/// A million cells of liquid; in a quick run 64 thousand.
pub(crate) fn solves(extent: Extent, table: &mut Table) {
    let n = extent.choose(64, 160);
    let run = || {
        let mut scenes =
            [Scene::new("pressure of a pool", n, pool), Scene::new("pressure of a dam and drops", n, drops)];
        for _ in 0..extent.choose(2, ROUNDS) {
            scenes.iter_mut().for_each(Scene::run);
        }
        scenes
    };
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    for (scene, most) in pool.install(run).iter().zip([250.0, 430.0]) {
        let most = (n == 160).then_some(most);
        let Scene { name, setup, solve, iterations, .. } = scene;
        let cells = scene.rows.len() as f64 * 1e-6;
        table.add(
            format!("{name} in {n}³ cells to {TOLERANCE:.0e}"),
            *solve,
            most,
            " ms",
            format!("{iterations} iterations"),
        );
        table.add("its set-up", *setup, most.map(|_| 100.0), " ms", format!("{cells:.1} million cells stored"));
    }
}

fn pool([_, y, _]: Vec3) -> f32 {
    y - 0.25
}

fn drops(point: Vec3) -> f32 {
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
    fn new(name: &'static str, n: i32, level_set: fn(Vec3) -> f32) -> Self {
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
        Self { name, n, rows, level_set, open, setup: f64::INFINITY, solve: f64::INFINITY, iterations: 0 }
    }

    /// What flows into a cell under gravity and a swirl.
    fn inflow(&self, cell: Cell) -> f64 {
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

    /// Sets up and solves once.
    fn run(&mut self) {
        let grid = PressureGrid {
            rows: &self.rows,
            level_set: &self.level_set,
            weights: [&self.open[0], &self.open[1], &self.open[2]],
            periods: Periods::NONE,
        };
        let watch = Stopwatch::start();
        let solver = PressureSolver::new(&grid);
        let setup = watch.wall();
        let mut inflow: Vec<f64> = solver.rows().tabulate(|cell| self.inflow(cell));
        let flow = TOLERANCE * liquid::fields::largest(&inflow);
        let mut q = vec![0.0; inflow.len()];
        let watch = Stopwatch::start();
        let solved = solver.solve(&mut inflow, &mut q, Stop { flow, iterations: 200 });
        let solve = watch.wall();
        self.setup = self.setup.min(setup.as_secs_f64() * 1e3);
        self.solve = self.solve.min(solve.as_secs_f64() * 1e3);
        self.iterations = solved.iterations;
    }
}
