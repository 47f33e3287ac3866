//! Iterations and times of the coupled solve:
//! `cargo run --release -p liquid --features studies --example viscosity_study`.

use std::time::Instant;

use liquid::rows::{Cell, CellRows, Periods};
use liquid::viscosity::{StokesGrid, StokesSolver, StokesStop};
use numerics::vector::{length, sub};

/// A block of 0.4 × 0.6 × 0.4 m on a floor, or a free ball.
fn level_set(is_block: bool, p: [f32; 3]) -> f32 {
    if is_block {
        let d = [(p[0] - 0.5).abs() - 0.2, p[1] - 0.6, (p[2] - 0.5).abs() - 0.2];
        d[0].max(d[1]).max(d[2])
    } else {
        length(sub(p, [0.5, 0.5, 0.5])) - 0.33
    }
}

#[allow(clippy::disallowed_methods, reason = "a measurement")]
fn main() {
    let sizes: Vec<i32> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let sizes = if sizes.is_empty() { vec![32, 64] } else { sizes };
    for is_block in [true, false] {
        for n in &sizes {
            let n = *n;
            let h = 1.0 / n as f32;
            let rows = CellRows::cuboid([0; 3], [n; 3]);
            let centre = |cell: Cell| cell.map(|i| (i as f32 + 0.5) * h);
            let phi = rows.tabulate(|cell| level_set(is_block, centre(cell)) / h);
            let open: [Vec<f32>; 3] =
                rows.tabulate_each(|cell| [0, 1, 2].map(|axis| if cell[axis] == 0 { 0.0 } else { 1.0 }));
            let solid: [Vec<f32>; 3] = rows.tabulate_each(|cell| {
                [0, 1, 2].map(|axis| {
                    let at = |a: usize| cell[a] as f32 + if a == axis { 0.0 } else { 0.5 };
                    (0..3).map(|a| at(a).min(n as f32 - at(a))).fold(f32::MAX, f32::min)
                })
            });
            let density = vec![1.0; rows.len()];
            for mu in [1.0, 1e2, 1e4, 1e8] {
                let viscosity = vec![mu / 24.0 / 1000.0 / (h * h); rows.len()];
                let grid = StokesGrid {
                    rows: &rows,
                    level_set: &phi,
                    open: [&open[0], &open[1], &open[2]],
                    solid_distance: [&solid[0], &solid[1], &solid[2]],
                    density: &density,
                    viscosity: &viscosity,
                    slip: &|_, _| 0.0,
                    periods: Periods::NONE,
                };
                let start = Instant::now();
                let solver = StokesSolver::new(&grid);
                let setup = start.elapsed().as_secs_f64() * 1e3;
                let before: [Vec<f64>; 3] = solver.rows().tabulate_each(|cell| {
                    let swirl = |n: i32| f64::from((n + 40) % 20 - 10) * 0.02;
                    let at = solver.rows().find(cell).unwrap_or_default();
                    let force = [swirl(cell[1]), -9.81 / 24.0 + swirl(cell[2]), swirl(cell[0])];
                    [0, 1, 2].map(|axis| if solver.is_free(axis, at) { force[axis] } else { 0.0 })
                });
                let inflow = vec![0.0; solver.rows().len()];
                let solve = |stop: f64, iterations| {
                    let (mut u, mut q) = (before.clone(), vec![0.0; inflow.len()]);
                    let start = Instant::now();
                    let stop = StokesStop { velocity: stop, flow: stop, iterations };
                    let solved = solver.solve(&before, &mut u, &mut q, &inflow, stop);
                    (u, solved, start.elapsed().as_secs_f64() * 1e3)
                };
                let (exact, best, _) = solve(1e-11, 60);
                let largest = exact.iter().map(|u| liquid::fields::largest(u)).fold(0.0, f64::max);
                let mut line = format!(
                    "{} {n}³ μ {mu:e}: {} cells, set-up {setup:.0} ms; to the end {} it {:.1e} {:.1e}",
                    if is_block { "block" } else { "ball" },
                    solver.rows().len(),
                    best.iterations,
                    best.velocity,
                    best.flow
                );
                for wanted in [1e-3, 1e-6] {
                    let mut iterations = 0;
                    let found = loop {
                        iterations += 1;
                        let (u, solved, ms) = solve(0.0, iterations);
                        let mut error = 0.0_f64;
                        for axis in 0..3 {
                            for at in 0..inflow.len() {
                                if solver.is_free(axis, at) {
                                    error = error.max((u[axis][at] - exact[axis][at]).abs());
                                }
                            }
                        }
                        if error < wanted * largest || iterations > 40 {
                            break format!(
                                " | {wanted:e}: {iterations} it {ms:.0} ms, estimated {:.1e} true {error:.1e} flow {:.1e}",
                                solved.velocity, solved.flow
                            );
                        }
                    };
                    line += &found;
                }
                println!("{line}");
            }
        }
    }
}
