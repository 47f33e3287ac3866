//! The laws of a moving liquid on larger grids:
//! `cargo run --release -p liquid --features studies --example dam_break`.

#[path = "../src/step/tests/plain.rs"]
mod plain;

use liquid::step::{Domain, Liquid, LiquidSettings, Solid, Splitting, Surface, Surroundings};
use liquid::velocity::Scheme;
use numerics::vector::length;
use plain::{PlainLevelSet, Still};

const WEIGHTLESS: Surroundings<'_> = Surroundings::new(&|_| [0.0; 3], &|_| 0.0);
const FALLING: Surroundings<'_> = Surroundings::new(&|_| [0.0, -9.81, 0.0], &|_| 0.0);

/// T = t·√(2g/a) and Z = front ÷ a of a column twice as high as its base a (Martin and Moyce 1952).
const MEASURED: [(f64, f64); 7] =
    [(1.63, 1.89), (1.83, 2.11), (1.98, 2.33), (2.2, 2.56), (2.32, 2.78), (2.51, 3.0), (2.65, 3.22)];

fn block(low: [f32; 3], high: [f32; 3]) -> impl Fn([f32; 3]) -> f32 {
    move |p| (0..3).map(|axis| (low[axis] - p[axis]).max(p[axis] - high[axis])).fold(f32::NEG_INFINITY, f32::max)
}

/// The farthest place on the floor that liquid has reached, in cells.
fn front(liquid: &Liquid<PlainLevelSet>) -> f64 {
    let view = liquid.surface().view();
    let mut front = 0.0;
    for span in view.rows.row(0, 1) {
        for x in span.start..span.end - 1 {
            let (a, b) = (view.phi[span.at(x)], view.phi[span.at(x + 1)]);
            if a < 0.0 && b >= 0.0 {
                front = f64::from(x) + 0.5 + f64::from(a / (a - b));
            }
        }
    }
    front
}

fn dam(base: i32) {
    let domain = Domain::closed([0; 3], [5 * base, 3 * base, 3]);
    let cell = 0.05715 / f64::from(base);
    let column = block([-99.0; 3], [base as f32, 2.0 * base as f32, 99.0]);
    let mut liquid = Liquid::new(LiquidSettings::new(domain, cell), PlainLevelSet::new(domain, column));
    let unit = (0.05715_f64 / (2.0 * 9.81)).sqrt();
    let (mut now, mut line, mut ends) = (0.0, format!("base of {base} cells:"), Vec::new());
    for (time, measured) in MEASURED {
        liquid.step_frame(&FALLING, (time - now) * unit);
        now = time;
        let front = front(&liquid) / f64::from(base);
        ends.push(front);
        line += &format!(" {:.3}", front / measured);
    }
    let slope = (ends[ends.len() - 1] - ends[0]) / (MEASURED[6].0 - MEASURED[0].0);
    println!("{line}, slope {slope:.3}, limit of Z at the end {:.2}, Z {:.2}", 1.0 + 2.0 * now, ends[6]);
}

/// What is left of the angular momentum of a disk of 0.3 n radius with a free surface, turned once.
fn turn(n: i32, splitting: Splitting, scheme: Scheme, substeps: u32) -> f64 {
    let (middle, turn) = (0.5 * n as f32, std::f32::consts::TAU);
    let domain = Domain::closed([0; 3], [n, n, 2]);
    let disk = |[x, y, _]: [f32; 3]| length([x - middle, y - middle, 0.0]) - 0.3 * n as f32;
    let settings = LiquidSettings { splitting, scheme, cfl: 1e9, tolerance: 1e-5, ..LiquidSettings::new(domain, 1.0) };
    let mut liquid = Liquid::new(settings, Still::new(domain, disk));
    liquid.set_velocity(|[x, y, _]| [-turn * (y - middle), turn * (x - middle), 0.0], &WEIGHTLESS);
    let spin = |liquid: &Liquid<Still>| {
        let faces = liquid.motion().velocity().faces();
        let moment = |(at, [x, y, _]): (usize, [i32; 3])| {
            let (x, y) = (f64::from(x) - f64::from(middle), f64::from(y) - f64::from(middle));
            x * f64::from(faces[1][at]) - y * f64::from(faces[0][at])
        };
        liquid.motion().rows().iter().enumerate().map(moment).sum::<f64>()
    };
    let start = spin(&liquid);
    for _ in 0..substeps {
        liquid.step_frame(&WEIGHTLESS, 1.0 / f64::from(substeps));
    }
    spin(&liquid) / start
}

fn turns() {
    println!("Angular momentum kept over a turn of 50, 100, 200 substeps; disks of 9.6, 19.2 and 38.4 cells radius");
    for (splitting, scheme) in [
        (Splitting::Plain, Scheme::MacCormack),
        (Splitting::KeepsSpin, Scheme::SemiLagrangian),
        (Splitting::KeepsSpin, Scheme::MacCormack),
    ] {
        let kept = |n| [50, 100, 200].map(|substeps| format!("{:.4}", turn(n, splitting, scheme, substeps))).join(" ");
        println!("{splitting:?}, {scheme:?}: {} | {} | {}", kept(32), kept(64), kept(128));
    }
}

/// 240 frames of a pool; the largest speed ÷ g·Δt.
fn rest(n: i32, depth: f32, floor: f32, tolerance: f64) -> f64 {
    let domain = Domain::closed([0; 3], [n, n, n.min(16)]);
    let settings = LiquidSettings { tolerance, ..LiquidSettings::new(domain, 1.0 / f64::from(n)) };
    let solid = |_: f64, p: [f32; 3]| p[1] - floor;
    let around = Surroundings { solid: Some(Solid::still(&solid)), ..FALLING };
    let mut liquid = Liquid::new(settings, PlainLevelSet::new(domain, |p| p[1] - depth));
    let mut speed = 0.0_f64;
    for _ in 0..240 {
        let report = liquid.step_frame(&around, 1.0 / 24.0);
        let faces = liquid.motion().velocity().faces().iter().flatten();
        let largest = faces.fold(0.0_f32, |most, u| most.max(u.abs()));
        speed = speed.max(f64::from(largest) * f64::from(report.substeps) / (9.81 / 24.0));
    }
    speed
}

fn rests() {
    println!("Largest speed ÷ g·Δt in 240 frames of a pool, tolerance 1e-4 and 1e-6");
    for (name, n, depth, floor) in
        [("flat floor", 32, 14.3, 0.0), ("floor cuts cells", 32, 14.3, 2.6), ("surface on centres", 32, 14.5, 0.0)]
    {
        println!("{name}, {n}³: {:.1e} {:.1e}", rest(n, depth, floor, 1e-4), rest(n, depth, floor, 1e-6));
    }
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    pool.install(|| {
        println!("Dam break: front ÷ that of Martin and Moyce at T {:?}", MEASURED.map(|(time, _)| time));
        [10, 20, 40].into_iter().for_each(dam);
        turns();
        rests();
    });
}
