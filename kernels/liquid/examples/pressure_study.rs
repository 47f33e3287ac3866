//! The pressure of a million cells around a ball, as `cargo bench --bench liquid -- pressure` has it, to count instructions
//! of: `cargo build -p liquid --features studies --example pressure_study`, then, with the program that this makes,
//! `pressure_study pool|drops CELLS ROUNDS`, and
//! `CONVECT_SIMD=avx2 RAYON_NUM_THREADS=1 valgrind --tool=callgrind --toggle-collect='*a_solve*' pressure_study pool 80 1`.

#[path = "../../../benches/liquid/pressure_scene.rs"]
mod pressure_scene;

use std::env::args;

use liquid::pressure::{PressureGrid, PressureSolver, Stop};
use pressure_scene::{Scene, TOLERANCE, drops, pool};

#[inline(never)]
fn a_solve_setup(grid: &PressureGrid<'_>) -> PressureSolver {
    PressureSolver::new(grid)
}

#[inline(never)]
fn a_solve(solver: &PressureSolver, inflow: &mut [f64]) -> (u32, f64) {
    let flow = TOLERANCE * liquid::fields::largest(inflow);
    let mut q = vec![0.0; inflow.len()];
    let solved = solver.solve(inflow, &mut q, Stop { flow, iterations: 200 });
    (solved.iterations, q.iter().fold(0.0, |sum, q| sum + q))
}

fn main() {
    // All in one thread of the pool, so that callgrind, which collects by thread, sees it.
    let pool = rayon::ThreadPoolBuilder::new().build().expect("a pool");
    pool.install(study);
}

fn study() {
    let args: Vec<String> = args().skip(1).collect();
    let [scene, cells, rounds] = &args[..] else { return println!("pressure_study pool|drops CELLS ROUNDS") };
    let n: i32 = cells.parse().expect("a number");
    let scene = Scene::new(n, if scene == "pool" { pool } else { drops });
    for _ in 0..rounds.parse().expect("a number") {
        let solver = a_solve_setup(&scene.grid());
        let mut inflow = solver.rows().tabulate(|cell| scene.inflow(cell));
        let (iterations, sum) = a_solve(&solver, &mut inflow);
        println!("{} cells, {iterations} iterations, sum {sum:.12e}", solver.stencil().active().len());
    }
}
