//! Work and error of the integrators: a cantilever of 2 × 0.5 × 0.5 m falling from rest, at two stiffnesses a factor
//! of ten thousand apart.
//!
//! `cargo run --release -p studies --bin soft_study [small|large|huge]…`; threads by `RAYON_NUM_THREADS`. Error: root
//! mean square over the frames of the distance of the tip's centroid from that of a fine reference, ÷ 2 m. Cost and
//! error of the default integrator in the node are measured by `cargo bench --bench softbody`.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

use bodies::mass_spring::{BodySolver, FrameReport, Integrator, Material, Mesh, Pin, SoftBody, SolverFrame, State};
use bodies::tets::cubes;
use numerics::masked::Masked;
use numerics::vector::DVec3;
use std::time::Instant;

const ROUNDS: usize = 3;
const SIZE: [f64; 3] = [2.0, 0.5, 0.5];

struct Beam {
    body: SoftBody,
    pins: Vec<Pin>,
    tip: Vec<usize>,
}

/// Clamped at x = 0. At a factor of 1 the axis-aligned springs of the small beam have 1.9e5 N/m.
fn beam(cells: [usize; 3], times: f64, beta: f64) -> Beam {
    let (points, tets) = cubes(cells, [0.0; 3], SIZE);
    let at = |x: f64| points.iter().zip(0..).filter(move |(p, _)| p[0] == x);
    let pins = at(0.0).map(|(p, particle)| Pin { particle, between: [*p; 2] }).collect();
    let tip = at(SIZE[0]).map(|(_, particle)| particle as usize).collect();
    let plain = |value| Masked::uniform(value);
    let material = Material { density: plain(1000.0), stiffness: plain(3.04e6 * times), damping: plain(beta) };
    let mesh = Mesh { points: &points, tets: &tets, ..Mesh::default() };
    Beam { body: SoftBody::new(&mesh, &material, &[]).expect("a beam"), pins, tip }
}

struct Run {
    tips: Vec<[f64; 3]>,
    wall: f64,
    newton: u32,
    cg: u32,
    caps: u32,
    estimate: f64,
    last: FrameReport,
}

fn run(beam: &Beam, frames: usize, frame: &SolverFrame<'_>) -> Run {
    let mut state = State::at_rest(&beam.body);
    let mut solver = BodySolver::new(&beam.body);
    let mut out =
        Run { tips: Vec::new(), wall: 0.0, newton: 0, cg: 0, caps: 0, estimate: 0.0, last: FrameReport::default() };
    for _ in 0..frames {
        let clock = Instant::now();
        let report = solver.step(&beam.body, &mut state, frame);
        out.wall += clock.elapsed().as_secs_f64() * 1e3 / frames as f64;
        out.newton += report.newton;
        out.cg += report.cg;
        out.caps += report.caps_hit;
        out.estimate += report.error_estimate;
        out.last = report;
        let tip = |axis: usize| beam.tip.iter().map(|p| state.positions[*p][axis]).sum::<f64>() / beam.tip.len() as f64;
        out.tips.push(std::array::from_fn(tip));
    }
    out
}

fn error(run: &Run, reference: &Run) -> f64 {
    let square = |(a, b): (&[f64; 3], &[f64; 3])| (DVec3::from(*a) - DVec3::from(*b)).norm_squared();
    let squares: f64 = run.tips.iter().zip(&reference.tips).map(square).sum();
    (squares / run.tips.len() as f64).sqrt() / SIZE[0]
}

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let sizes = [("small", [32, 8, 8], 24, 64), ("large", [70, 17, 17], 6, 32), ("huge", [96, 24, 24], 6, 16)];
    println!(
        "beam      stiffness volume  integrator      steps     ms  newton  cg/solve caps  err/L    estimate/L  tip z"
    );
    let is_asked = |name: &str| asked.is_empty() || asked.iter().any(|word| word == name);
    for (name, cells, frames, fine) in sizes.into_iter().filter(|size| is_asked(size.0)) {
        for (times, beta, frames) in [(1.0, 1e-3, frames), (1e4, 1e-5, 6)] {
            let beam = beam(cells, times, beta);
            for volume in [0.0, 1.0] {
                let frame = SolverFrame { volume, pins: &beam.pins, ..SolverFrame::default() };
                let accurate = Integrator::Accurate { tolerance: 1e-6 };
                let reference = run(&beam, frames, &SolverFrame { substeps: fine, integrator: accurate, ..frame });
                let mut cases = vec![
                    ("default", Integrator::Default, 0),
                    ("default", Integrator::Default, 2),
                    ("euler", Integrator::Euler, 0),
                ];
                if name == "small" {
                    cases.push(("default", Integrator::Default, 4));
                    for (name, tolerance) in [("tol 1e-3", 1e-3), ("tol 1e-4", 1e-4), ("tol 1e-5", 1e-5)] {
                        cases.push((name, Integrator::Accurate { tolerance }, 0));
                    }
                }
                for (integrator, how, substeps) in cases {
                    let frame = SolverFrame { integrator: how, substeps, ..frame };
                    let runs: Vec<Run> = (0..ROUNDS).map(|_| run(&beam, frames, &frame)).collect();
                    let one = &runs[0];
                    println!(
                        "{name:6} {:6} {times:6.0e} {volume:6}  {integrator:10} {substeps:3}/{:4} {:8.2} {:6.1} {:8.1} {:5} {:9.1e} {:9.1e} {:9.4}",
                        beam.body.len(),
                        one.last.substeps,
                        runs.iter().map(|run| run.wall).fold(f64::INFINITY, f64::min),
                        f64::from(one.newton) / frames as f64,
                        f64::from(one.cg) / f64::from(one.newton),
                        one.caps,
                        error(one, &reference),
                        one.estimate / SIZE[0],
                        one.tips[frames - 1][1],
                    );
                }
            }
        }
    }
}
