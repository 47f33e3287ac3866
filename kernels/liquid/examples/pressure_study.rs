//! Iterations and times of the pressure solve:
//! `cargo run --release -p liquid --features studies --example pressure_study`; `-- 64 128` for boxes of these sizes.

use std::time::Instant;

use liquid::open_share::open_share;
use liquid::pressure::{PressureGrid, PressureSolver, Stop};
use liquid::rows::{Cell, CellRows, Periods};
use numerics::vector::{length, sub};

#[derive(Clone, Copy)]
enum Scene {
    Pool,
    Drops,
}

fn drops() -> Vec<([f32; 3], f32)> {
    let mut state = 12345_u64;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1_u64 << 24) as f32
    };
    (0..60).map(|_| ([next(), 0.3 + 0.7 * next(), next()], 0.02 + 0.04 * next())).collect()
}

fn level_set(scene: Scene, drops: &[([f32; 3], f32)], [x, y, z]: [f32; 3]) -> f32 {
    match scene {
        Scene::Pool => y - 0.25,
        Scene::Drops => {
            let dam = (x - 0.35).max(y - 0.55);
            drops.iter().fold(dam, |phi, (c, r)| phi.min(length(sub([x, y, z], *c)) - r))
        }
    }
}

fn solid(p: [f32; 3]) -> f32 {
    length(sub(p, [0.3, 0.15, 0.5])) - 0.12
}

#[allow(clippy::disallowed_methods, reason = "a measurement")]
fn main() {
    let asked: Vec<i32> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let sizes = if asked.is_empty() { vec![32, 64, 96, 128, 160] } else { asked };
    let drops = drops();
    for (name, scene) in [("pool", Scene::Pool), ("drops", Scene::Drops)] {
        for n in sizes.iter().copied() {
            let h = 1.0 / n as f32;
            let rows = CellRows::cuboid([0; 3], [n; 3]);
            let centre = |cell: Cell| cell.map(|i| (i as f32 + 0.5) * h);
            let level_set = rows.tabulate(|cell| level_set(scene, &drops, centre(cell)));
            let weights = rows.tabulate_each(|cell| {
                [0, 1, 2].map(|axis| {
                    if cell[axis] == 0 {
                        return 0.0;
                    }
                    let corner = |a: i32, b: i32| {
                        let mut node = cell;
                        node[(axis + 1) % 3] += a;
                        node[(axis + 2) % 3] += b;
                        solid(node.map(|i| i as f32 * h))
                    };
                    open_share([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)])
                })
            });
            let grid = PressureGrid {
                rows: &rows,
                level_set: &level_set,
                weights: [&weights[0], &weights[1], &weights[2]],
                periods: Periods::NONE,
            };
            let mut setup = f64::MAX;
            for _ in 0..5 {
                let start = Instant::now();
                let solver = PressureSolver::new(&grid);
                setup = setup.min(start.elapsed().as_secs_f64() * 1e3 + 0.0 * solver.rows().len() as f64);
            }
            let solver = PressureSolver::new(&grid);
            // Gravity, and a swirl.
            let inflow: Vec<f64> = solver.rows().tabulate(|cell| {
                let Some(at) = rows.find(cell) else { return 0.0 };
                let mut sum = 0.0;
                for axis in 0..3 {
                    for side in 0..2 {
                        let mut face = cell;
                        face[axis] += side;
                        let w = if side == 0 {
                            weights[axis][at]
                        } else {
                            rows.find(face).map_or(0.0, |at| weights[axis][at])
                        };
                        let speed =
                            if axis == 1 { -9.81 / 24.0 } else { (f64::from(face[(axis + 1) % 3]) * 0.3).sin() };
                        sum += f64::from(w) * speed * if side == 0 { 1.0 } else { -1.0 };
                    }
                }
                sum
            });
            let mut line = format!("{name} {n}³ {} cells, set-up {setup:.1} ms", solver.stencil().active().len());
            for share in [1e-3, 1e-5, 1e-9] {
                let mut best = f64::MAX;
                let mut iterations = 0;
                for _ in 0..3 {
                    let mut b = inflow.clone();
                    let scale = liquid::fields::largest(&b);
                    let mut q = vec![0.0; b.len()];
                    let start = Instant::now();
                    let solved = solver.solve(&mut b, &mut q, Stop { flow: share * scale, iterations: 200 });
                    best = best.min(start.elapsed().as_secs_f64() * 1e3);
                    iterations = solved.iterations;
                }
                line += &format!(" | {share:e}: {iterations} it {best:.1} ms");
            }
            println!("{line}");
        }
    }
}
