//! Frames of a block that collapses, 0.4 × 0.6 × 0.4 m in a box of 1 m, as FluidSolve makes them, to count instructions of:
//! `cargo build -p liquid --features studies --example block_study`, then, with the program that this makes,
//! `block_study save STATE CELLS PA_S FRAME`, and
//! `CONVECT_SIMD=avx2 RAYON_NUM_THREADS=1 valgrind --tool=callgrind --toggle-collect='*a_frame*' block_study run STATE FRAMES`.

use std::env::args;
use std::fs::{read, write};

use liquid::marked::MarkedSurface;
use liquid::step::{Domain, Liquid, LiquidReport, LiquidSettings, Motion, Surroundings};
use liquid::volumes::{VolumeReport, VolumeTargets, cap};

/// Cells along the box, viscosity in Pa·s.
type Scene = (i32, f64);

/// What a frame starts from.
type State = (MarkedSurface, Motion, VolumeTargets);

/// Cells past the liquid that the velocity of the output goes on.
const OUTPUT: i32 = 7;

fn settings(cells: i32) -> LiquidSettings {
    LiquidSettings::new(Domain::closed([0; 3], [cells; 3]), 1.0 / f64::from(cells))
}

fn start(cells: i32) -> State {
    let settings = settings(cells);
    let (low, high) = ([0.3, -1.0, 0.3], [0.7, 0.6, 0.7]);
    let distance = |point: [f32; 3]| {
        let at = point.map(|x| x / cells as f32);
        let beyond = |axis: usize| (low[axis] - at[axis]).max(at[axis] - high[axis]);
        cells as f32 * (0..3).map(beyond).fold(f32::NEG_INFINITY, f32::max)
    };
    let mut surface = MarkedSurface::new(settings.domain, 1, distance, 0, 0);
    let targets = VolumeTargets::new(&mut surface, settings.cell, None);
    let mut liquid = Liquid::new(settings, surface);
    liquid.set_velocity(|_| [0.0; 3], &Surroundings::new(&|_| [0.0; 3], &|_| 0.0));
    let (surface, motion) = liquid.into_parts();
    (surface, motion, targets)
}

/// A frame with its output: substeps, correction, velocity past the liquid, mesh.
#[inline(never)]
fn a_frame((cells, viscosity): Scene, state: &mut State) -> (LiquidReport, VolumeReport, usize) {
    let (surface, motion, targets) = state;
    let settings = settings(cells);
    let viscosity = |_: f64| viscosity;
    let around = Surroundings::new(&|_| [0.0, -9.81, 0.0], &viscosity);
    let mut liquid = Liquid::resume(settings, surface.clone(), std::mem::take(motion));
    let report = liquid.step_frame(&around, 1.0 / 24.0);
    (*surface, *motion) = liquid.into_parts();
    let way = report.cfl_reached * f64::from(report.substeps);
    let corrected = targets.correct_within(surface, None, None, cap(way));
    let liquid = Liquid::resume(self::settings(cells), surface.clone(), motion.clone());
    let continued = liquid.velocity(OUTPUT).rows().len();
    let mesh = surface.mesh(None);
    (report, corrected, continued + mesh.points.len())
}

fn print(frame: u32, (report, corrected, size): (LiquidReport, VolumeReport, usize)) {
    let LiquidReport { substeps, cfl_reached, pressure_iterations, coupled_iterations, max_divergence, .. } = report;
    println!(
        "frame {frame}: {substeps} substeps, cfl {cfl_reached:.2}, {} iterations, divergence {max_divergence:.1e}, {} cells, raw drift \
         {:.4}, drift {:.1e}, {} pieces, output {size}",
        pressure_iterations + coupled_iterations,
        report.liquid_cells,
        corrected.raw_drift,
        corrected.drift,
        corrected.pieces
    );
}

fn main() {
    // All in one thread of the pool, so that callgrind, which collects by thread, sees it.
    let pool = rayon::ThreadPoolBuilder::new().build().expect("a pool");
    pool.install(study);
}

fn study() {
    let args: Vec<String> = args().skip(1).collect();
    let number = |n: usize| args[n].parse::<f64>().expect("a number");
    match args.first().map(String::as_str) {
        Some("save") => {
            let scene: Scene = (number(2) as i32, number(3));
            let mut state = start(scene.0);
            for frame in 1..=number(4) as u32 {
                print(frame, a_frame(scene, &mut state));
            }
            write(&args[1], postcard::to_stdvec(&(scene, state)).expect("a state")).expect("a file");
        }
        Some("run") => {
            let file = read(&args[1]).expect("a file");
            let (scene, mut state): (Scene, State) = postcard::from_bytes(&file).expect("a state");
            for frame in 1..=number(2) as u32 {
                print(frame, a_frame(scene, &mut state));
            }
        }
        _ => println!("block_study save STATE CELLS PA_S FRAME, or run STATE FRAMES"),
    }
}
