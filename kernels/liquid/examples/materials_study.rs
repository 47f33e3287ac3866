//! What liquids of several materials cost: a drop into a pool, with and without materials of their own, on one thread.
//! `cargo run --release -p liquid --features studies --example materials_study`.

use std::time::Instant;

use liquid::carried::LiquidMaterial;
use liquid::marked::MarkedSurface;
use liquid::step::{Domain, Liquid, LiquidSettings, Surroundings};
use numerics::vector::{length, sub};

const FRAMES: u32 = 24;

/// A drop of 0.4 n cells across above a pool of 0.3 n cells: seconds, substeps and iterations of a second.
#[allow(clippy::disallowed_methods, reason = "a measurement")]
fn drop(n: i32, viscosities: [f64; 2], densities: [f64; 2], is_split: bool) {
    let size = n as f32;
    let centre = [0.5 * size, 0.6 * size, 0.5 * size];
    let domain = Domain::closed([0; 3], [n; 3]);
    let distance = |p: [f32; 3]| (length(sub(p, centre)) - 0.2 * size).min(p[1] - 0.3 * size);
    let settings = LiquidSettings { density: densities[1], ..LiquidSettings::new(domain, 1.0 / f64::from(n)) };
    let mut liquid = Liquid::new(settings, MarkedSurface::new(domain, 1, distance, 0, 1));
    let [viscosity, density] = [viscosities[0] as f32, densities[0] as f32];
    if is_split {
        let own = LiquidMaterial { viscosity: Some(viscosity), density: Some(density), phase: 0 };
        liquid.set_materials(|p| if p[1] > 0.35 * size { own } else { LiquidMaterial::default() });
    }
    let pool = viscosities[1];
    let (start, mut line) = (Instant::now(), [0_u32; 5]);
    for _ in 0..FRAMES {
        let report = liquid.step_frame(&Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| pool), 1.0 / 24.0);
        let counts = [
            report.substeps,
            report.viscous_substeps,
            report.pressure_iterations,
            report.coupled_iterations,
            report.solves_cut_short,
        ];
        line.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    let [substeps, viscous, pressure, coupled, cut] = line;
    println!(
        "{n}³, {viscosities:?} Pa·s, {densities:?} kg/m³, {}: {:.2} s, {substeps} substeps, {pressure} iterations of pressure, \
         {coupled} of {viscous} coupled solves, {cut} cut short",
        if is_split { "split" } else { "one" },
        start.elapsed().as_secs_f64()
    );
}

fn main() {
    let run = || {
        for n in [32, 48] {
            drop(n, [0.0, 0.0], [1000.0, 1000.0], false);
            drop(n, [0.0, 0.0], [1000.0, 1000.0], true);
            drop(n, [0.0, 0.0], [2000.0, 1000.0], true);
            drop(n, [1.0, 1.0], [1000.0, 1000.0], false);
            drop(n, [1.0, 1.0], [1000.0, 1000.0], true);
            drop(n, [100.0, 0.001], [1400.0, 1000.0], true);
            drop(n, [1e5, 0.1], [1400.0, 1000.0], true);
        }
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread").install(run);
}
