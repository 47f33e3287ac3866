//! The pressure of a million cells around a ball, as `cargo bench --bench liquid -- pressure` has it, to count instructions
//! of: `cargo build -p liquid --features studies --example pressure_study`, then, with the program that this makes,
//! `pressure_study pool|drops CELLS ROUNDS`, and
//! `CONVECT_SIMD=avx2 RAYON_NUM_THREADS=1 valgrind --tool=callgrind --toggle-collect='*a_solve*' pressure_study pool 80 1`.

use std::env::args;

use liquid::open_share::open_share;
use liquid::pressure::{PressureGrid, PressureSolver, Stop};
use liquid::rows::{Cell, CellRows, Periods};
use numerics::random::Key;
use numerics::trig;
use numerics::vector::{Vec3, length, sub};

/// Share of the flow that is left.
const TOLERANCE: f64 = 1e-5;

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

/// What flows into a cell under gravity and a swirl.
fn inflow(n: i32, rows: &CellRows, open: &[Vec<f32>; 3], cell: Cell) -> f64 {
    let Some(at) = rows.find(cell) else { return 0.0 };
    let mut sum = 0.0;
    for axis in 0..3 {
        for side in 0..2 {
            let mut face = cell;
            face[axis] += side;
            let beyond = || rows.find(face).map_or(0.0, |at| open[axis][at]);
            let open = if side == 0 { open[axis][at] } else { beyond() };
            let swirl = trig::sin(face[(axis + 1) % 3] as f32 * 19.2 / n as f32);
            let speed = if axis == 1 { -9.81 / 24.0 } else { swirl };
            sum += f64::from(open * speed) * if side == 0 { 1.0 } else { -1.0 };
        }
    }
    sum
}

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
    let h = 1.0 / n as f32;
    let phi: fn(Vec3) -> f32 = if scene == "pool" { pool } else { drops };
    let rows = CellRows::cuboid([0; 3], [n; 3]);
    let level_set = rows.tabulate(|cell| phi(cell.map(|i| (i as f32 + 0.5) * h)));
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
    for _ in 0..rounds.parse().expect("a number") {
        let weights = [&open[0][..], &open[1], &open[2]];
        let grid = PressureGrid { rows: &rows, level_set: &level_set, weights, periods: Periods::NONE };
        let solver = a_solve_setup(&grid);
        let mut inflow = solver.rows().tabulate(|cell| inflow(n, &rows, &open, cell));
        let (iterations, sum) = a_solve(&solver, &mut inflow);
        println!("{} cells, {iterations} iterations, sum {sum:.12e}", solver.stencil().active().len());
    }
}
