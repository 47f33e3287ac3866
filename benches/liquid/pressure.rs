//! The pressure solve alone, around a ball: a pool, and a dam with drops.

use engine::clock::Stopwatch;
use liquid::pressure::{PressureSolver, Stop};
use numerics::vector::Vec3;
use rayon::ThreadPoolBuilder;

use crate::Extent;
use crate::pressure_scene::{Scene, TOLERANCE, drops, pool};
use crate::table::Table;

const ROUNDS: usize = 5;

/// A scene, and the fastest of its runs.
struct Case {
    name: &'static str,
    scene: Scene,
    /// Milliseconds of the fastest set-up and of the fastest solve, and its iterations.
    setup: f64,
    solve: f64,
    iterations: u32,
}

/// A million cells of liquid; in a quick run 64 thousand.
pub(crate) fn solves(extent: Extent, table: &mut Table) {
    let n = extent.choose(64, 160);
    let run = || {
        let mut cases = [Case::new("pressure of a pool", n, pool), Case::new("pressure of a dam and drops", n, drops)];
        for _ in 0..extent.choose(2, ROUNDS) {
            cases.iter_mut().for_each(Case::run);
        }
        cases
    };
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    for (case, most) in pool.install(run).iter().zip([250.0, 430.0]) {
        let most = (n == 160).then_some(most);
        let Case { name, scene, setup, solve, iterations } = case;
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

impl Case {
    fn new(name: &'static str, n: i32, level_set: fn(Vec3) -> f32) -> Self {
        let scene = Scene::new(n, level_set);
        Self { name, scene, setup: f64::INFINITY, solve: f64::INFINITY, iterations: 0 }
    }

    /// Sets up and solves once.
    fn run(&mut self) {
        let grid = self.scene.grid();
        let watch = Stopwatch::start();
        let solver = PressureSolver::new(&grid);
        let setup = watch.wall();
        let mut inflow: Vec<f64> = solver.rows().tabulate(|cell| self.scene.inflow(cell));
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
