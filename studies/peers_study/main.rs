//! Work-precision comparison of one TR-BDF2 step a frame with XPBD in small steps and with vertex block descent
//! (VBD), with and without contact: the same springs, dashpots, pressures, masses and contacts, one thread for all.
//!
//! `cargo run --release -p studies --bin peers_study [free] [drop] [roll] [stiff] [only=NAME] [quick] [PATH.svg]`.
//! `only` selects methods whose name contains it; `quick` does one round and uses coarser references. Prints a line
//! for each setting, and writes a plot if a path is given; all four scenes take about ten minutes on an idle core.
//! Settings: ours by steps a frame (auto: one, halved where contacts stay too deep) or tolerance, the peers' by steps
//! × iterations.
//!
//! Error: root mean square over frames and particles of the distance to our solution with 128 steps a frame, ÷ the
//! body's size; `at end`: in the last frame only; `own`: to the same method in very short steps (for ours, VBD's),
//! which separates the treatment of contact from the error in time. Overlap: depth of the deepest particle, in gaps.
//! Lost and least: volume of the body, and of the worst tetrahedron. `passes`: evaluations of all springs a frame,
//! which do not depend on the machine: an iteration of conjugate gradients or a force evaluation of ours, an
//! iteration of XPBD, a sweep of VBD.

#![allow(clippy::disallowed_methods, reason = "measures time and is no node")]

mod model;
mod plot;
mod run;
mod scene;
mod vbd;
mod xpbd;

use bodies::mass_spring::Integrator;
use plot::{Line, Panel};
use run::{Method, Run};
use scene::Scene;

/// Rounds, of which the fastest counts, for settings that take less than [`QUICK_MS`] a frame.
const ROUNDS: usize = 3;
const QUICK_MS: f64 = 70.0;
/// Chebyshev's ρ; with larger values the body does not come to rest on the ground.
const RADIUS: f64 = 0.87;

/// A method with several settings, named as in the plot.
struct Family {
    name: &'static str,
    settings: Vec<(String, Method)>,
}

fn families() -> Vec<Family> {
    let ours = |integrator, steps: &[u32]| {
        let name = |steps: &u32| if *steps == 0 { "auto".to_owned() } else { steps.to_string() };
        steps.iter().map(|steps| (name(steps), Method::Ours { integrator, steps: *steps })).collect()
    };
    let named = |steps: u32, iterations: u32| format!("{steps}x{iterations}");
    let xpbd = |steps: &[u32], iterations| {
        let method = |steps: &u32| (named(*steps, iterations), Method::Xpbd { steps: *steps, iterations });
        steps.iter().map(method).collect()
    };
    let vbd = |settings: &[(u32, u32)], radius| {
        let method = |(steps, iterations): &(u32, u32)| Method::Vbd { steps: *steps, iterations: *iterations, radius };
        settings.iter().map(|setting| (named(setting.0, setting.1), method(setting))).collect()
    };
    let accurate = |name: &str, tolerance| {
        (name.to_owned(), Method::Ours { integrator: Integrator::Accurate { tolerance }, steps: 0 })
    };
    vec![
        Family { name: "ours", settings: ours(Integrator::Default, &[0, 2, 4, 8, 16, 32]) },
        Family { name: "ours, accurate", settings: vec![accurate("1e-3", 1e-3), accurate("1e-4", 1e-4)] },
        Family { name: "ours, implicit Euler", settings: ours(Integrator::Euler, &[0, 4, 16]) },
        Family { name: "XPBD n x 1", settings: xpbd(&[4, 8, 16, 32, 64, 128, 256], 1) },
        Family { name: "XPBD n x 8", settings: xpbd(&[1, 4, 16, 32], 8) },
        Family { name: "VBD n x 8", settings: vbd(&[(1, 8), (4, 8), (16, 8), (32, 8)], 0.0) },
        Family { name: "VBD, other", settings: vbd(&[(16, 1), (64, 1), (1, 40), (4, 40)], 0.0) },
        Family { name: "VBD, Chebyshev", settings: vbd(&[(1, 8), (4, 8), (16, 8), (1, 40), (4, 40)], RADIUS) },
    ]
}

/// The same methods in very short steps.
struct Limits {
    ours: Run,
    xpbd: Run,
    vbd: Run,
}

impl Limits {
    fn new(scene: &Scene, quick: bool) -> Self {
        let fine = |steps: u32| if quick { steps / 4 } else { steps };
        let accurate = Integrator::Accurate { tolerance: 1e-6 };
        Self {
            ours: Run::new(scene, Method::Ours { integrator: accurate, steps: fine(128) }),
            xpbd: Run::new(scene, Method::Xpbd { steps: fine(128), iterations: 8 }),
            vbd: Run::new(scene, Method::Vbd { steps: fine(128), iterations: 8, radius: 0.0 }),
        }
    }

    /// The reference of a method itself. As everything is compared with ours already, ours is compared with VBD's.
    fn of(&self, method: Method) -> &Run {
        match method {
            Method::Ours { .. } | Method::Vbd { .. } => &self.vbd,
            Method::Xpbd { .. } => &self.xpbd,
        }
    }
}

/// Runs a scene with all methods, prints the results and returns what the plot shows.
fn study(scene: &Scene, quick: bool, only: &str) -> Panel {
    let size = scene.body.size();
    let springs = scene.body.springs().len();
    println!("\n{} ({} particles, {springs} springs, {} frames)", scene.title, scene.points.len(), scene.frames);
    println!(
        "{:21} {:>8} {:>9} {:>7} {:>8} {:>8} {:>8} {:>8} {:>7} {:>6} {:>6}",
        "method", "setting", "ms", "passes", "M evals", "error", "own", "at end", "overlap", "lost %", "least"
    );
    let limits = Limits::new(scene, quick);
    let line = |family: &str, setting: &str, run: &Run, own: Option<&Run>| {
        let (error, end) = run.error(&limits.ours, size);
        let own = own.map_or("-".to_owned(), |own| format!("{:.1e}", run.error(own, size).0));
        println!(
            "{family:21} {setting:>8} {:9.2} {:7.0} {:8.2} {error:8.1e} {own:>8} {end:8.1e} {:>7} {:>6} {:>6}",
            run.ms,
            run.passes,
            run.passes * springs as f64 * 1e-6,
            short(run.overlap),
            short(100.0 * run.lost),
            short(run.least),
        );
        error
    };
    for (name, limit) in [("ours", &limits.ours), ("XPBD", &limits.xpbd), ("VBD", &limits.vbd)] {
        line(name, "limit", limit, None);
    }
    let mut families: Vec<(Family, Vec<Run>)> =
        families().into_iter().filter(|family| family.name.contains(only)).map(|family| (family, Vec::new())).collect();
    for round in 0..if quick { 1 } else { ROUNDS } {
        for (family, runs) in &mut families {
            for (at, (_, method)) in family.settings.iter().enumerate() {
                if round == 0 {
                    runs.push(Run::new(scene, *method));
                } else if runs[at].ms < QUICK_MS {
                    runs[at].ms = runs[at].ms.min(Run::new(scene, *method).ms);
                }
            }
        }
    }
    let lines = families.iter().map(|(family, runs)| {
        let point = |((setting, method), run): (&(String, Method), &Run)| {
            let error = line(family.name, setting, run, Some(limits.of(*method)));
            (setting.clone(), run.ms, error)
        };
        Line { name: family.name, points: family.settings.iter().zip(runs).map(point).collect() }
    });
    let lines = lines.collect();
    let apart = |limit: &Run| limit.error(&limits.ours, size).0;
    Panel { title: scene.title, floor: apart(&limits.xpbd).min(apart(&limits.vbd)), lines }
}

/// Formats a number of which only the magnitude matters if it is large.
fn short(value: f64) -> String {
    if value.abs() < 100.0 { format!("{value:.2}") } else { format!("{value:.0e}") }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let is_asked = |name: &str| words.iter().any(|word| word == name);
    // Everything on one thread; an existing pool is what the caller wants.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).build_global();
    let names = ["free", "drop", "roll", "stiff"];
    let any = names.iter().any(|name| is_asked(name));
    let asked = names.into_iter().filter(|name| !any || is_asked(name));
    let only = words.iter().find_map(|word| word.strip_prefix("only=")).unwrap_or("");
    let panels: Vec<Panel> = asked.map(|name| study(&Scene::new(name), is_asked("quick"), only)).collect();
    if let Some(path) = words.iter().find(|word| word.ends_with(".svg"))
        && let Err(error) = std::fs::write(path, plot::svg(&panels))
    {
        println!("`{path}` was not written: {error}");
    }
}
