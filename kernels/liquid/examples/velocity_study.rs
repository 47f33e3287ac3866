//! Times of sampling, continuing and carrying a velocity, on one thread:
//! `cargo run --release -p liquid --features studies --example velocity_study`.

use std::time::Instant;

use liquid::rows::{CellRows, Periods};
use liquid::velocity::{Advection, MacVelocity, Method, Sampler, Scheme, Site, Slopes, extrapolate};
use numerics::trig::sin_cos;
use numerics::vector::{length, sub};

const SIZE: i32 = 64;

#[allow(clippy::disallowed_methods, reason = "a measurement")]
fn best(mut run: impl FnMut()) -> f64 {
    let time = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..7).map(|_| time(&mut run)).fold(f64::MAX, f64::min)
}

fn measure() {
    // A ball of 68k cells, and a band of 7 cells around it.
    let centre = [0.5 * SIZE as f32; 3];
    let inside = |p: [f32; 3]| length(sub(p, centre)) < 25.4;
    let liquid = CellRows::cuboid([0; 3], [SIZE; 3]).filtered(|cell, _| inside(Site::Centre.of(cell)));
    let rows = liquid.dilated(7);
    let wave = |x: f32| 1.0 - sin_cos(x * 0.12).0.abs();
    let faces = rows.tabulate_each(|[x, y, z]| [wave(y as f32), -wave(z as f32 + 3.0), wave(x as f32)]);
    let known = rows.tabulate(|cell| if liquid.find(cell).is_some() { 7_u8 } else { 0 });
    let points: Vec<[f32; 3]> = liquid.iter().flat_map(|cell| Site::FACES.map(|site| site.of(cell))).collect();
    let velocity = MacVelocity::new(rows.clone(), faces);
    let moved: Vec<_> =
        points.iter().map(|[x, y, z]| [x - 1.3 * wave(*y), y + wave(*z) * 0.9, z - 0.2 * wave(*x)]).collect();
    let mut sum = 0.0;
    let time = best(|| {
        let mut sampler = Sampler::new(velocity.rows());
        for point in &moved {
            let u = velocity.at(&mut sampler, *point);
            sum += u[0] + u[1] + u[2];
        }
    });
    println!("{} liquid cells, {} stored ({sum:e})", liquid.len(), rows.len());
    println!("a sample of the vector: {:.1} ns", time * 1e9 / points.len() as f64);

    let time = best(|| {
        let (mut known, mut fields) = (known.clone(), velocity.faces().clone());
        extrapolate(&rows, &mut known, [&mut fields], [Slopes::nearest(0.3)], u32::MAX);
        assert!(known.iter().all(|mask| *mask == 7));
    });
    println!(
        "continued past the liquid: {:.1} ms, {:.1} ns a face",
        time * 1e3,
        time * 1e9 / (3 * (rows.len() - liquid.len())) as f64
    );

    let stored = liquid.dilated(1);
    let wanted = stored.tabulate(|cell| if liquid.find(cell).is_some() { 7_u8 } else { 0 });
    for scheme in [Scheme::SemiLagrangian, Scheme::MacCormack] {
        let bounds = [[-1e3; 3], [1e3; 3]];
        let advection = Advection {
            velocity: &velocity,
            bounds,
            periods: Periods::NONE,
            step: 1.5,
            method: Method::Ralston,
            scheme,
        };
        let time = best(|| drop(advection.carry(velocity.faces(), &stored, &wanted)));
        println!("{scheme:?}: {:.1} ms, {:.0} ns a face", time * 1e3, time * 1e9 / points.len() as f64);
    }
}

fn main() {
    let threads = std::env::args().nth(1).and_then(|word| word.parse().ok()).unwrap_or(1);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(measure);
}
