//! Cost and error of soft bodies: `cargo bench --bench softbody`, or `-- 2k` for that size only.
//!
//! The Softbody node on a block of dough that hangs by one end, rests on the ground, does so at a thousand times the
//! stiffness, or is rolled over by a pin that moves ten thicknesses a frame; on the beam that other solvers were
//! measured on, alone and with such a pin; and on a plastic lump under a pin that rolls across all of it, with friction
//! and without. With and without volume preservation, the lump with. The first frames in order, without
//! the cost of the start; no cache, no files, no self-collision. Errors are relative to sixteen accurate steps a
//! frame, over few frames only: soft dough hanging by one end folds, and after a dozen frames thirty-two steps no
//! longer agree with sixteen. Memory is that of a separate process.
//!
//! Dough that rests without volume preservation buckles by its sixth frame: springs alone do not carry it, also with 2,
//! 4 or 8 steps a frame. Most Newton iterations of that case follow the collapse.

use std::collections::BTreeSet;
use std::convert::Infallible;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bodies::tets::cubes;
use engine::cook::{Delivered, Engine, Report, Settings};
use engine::geometry::{Component, Geometry};
use engine::graph::{Body, Graph, probe};
use engine::plan::Request;
use engine::time::Frame;
use timing::Figures;

mod timing;

/// The program's allocator.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Largest number of runs of a case, and the total time after which it is not repeated.
const ROUNDS: usize = 5;
const ENOUGH: Duration = Duration::from_secs(5);

/// Metres; the default of Softbody.
const THICKNESS: f64 = 1e-3;

/// A resolution.
struct Size {
    name: &'static str,
    dough: [usize; 3],
    beam: [usize; 3],
    /// Number of frames to measure.
    frames: i64,
    /// Whether to measure a single thread too.
    alone: bool,
    /// Whether to measure the lump, which has one resolution.
    lump: bool,
    /// Scenes for which sixteen steps a frame are affordable.
    exact: &'static [Scene],
}

const SIZES: [Size; 3] = [
    Size { name: "2k", dough: [24, 6, 12], beam: [32, 8, 8], frames: 8, alone: true, lump: false, exact: &Scene::ALL },
    Size {
        name: "20k",
        dough: [52, 13, 26],
        beam: [70, 17, 17],
        frames: 6,
        alone: true,
        lump: true,
        exact: &[Scene::Beam, Scene::Free, Scene::Resting],
    },
    Size { name: "100k", dough: [92, 23, 46], beam: [96, 24, 24], frames: 3, alone: false, lump: false, exact: &[] },
];

/// A scene.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scene {
    /// A firm beam of 2 m, held by one end.
    Beam,
    /// The beam with a pin that rolls over it.
    RolledBeam,
    /// Dough held by one end.
    Free,
    Resting,
    Stiff,
    Rolling,
    /// A lump of 17.6k tets under a pin that rolls across all of it, with a coefficient of friction of 1, and of 0.
    RolledLump,
    SlippedLump,
}

impl Scene {
    /// Those at all resolutions.
    const ALL: [Self; 6] = [Self::Beam, Self::RolledBeam, Self::Free, Self::Resting, Self::Stiff, Self::Rolling];
    const LUMPS: [Self; 2] = [Self::RolledLump, Self::SlippedLump];

    fn is_lump(self) -> bool {
        Self::LUMPS.contains(&self)
    }

    /// Number of frames to measure: for the lump, until the pin is across.
    fn frames(self, size: &Size) -> i64 {
        if self.is_lump() { 23 } else { size.frames }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Beam => "beam",
            Self::RolledBeam => "rolled beam",
            Self::Free => "free",
            Self::Resting => "resting",
            Self::Stiff => "stiff",
            Self::Rolling => "rolling",
            Self::RolledLump => "rolled lump",
            Self::SlippedLump => "lump without friction",
        }
    }

    /// Size of the body, metres.
    fn sides(self) -> [f64; 3] {
        match self {
            Self::Beam | Self::RolledBeam => [2.0, 0.5, 0.5],
            Self::RolledLump | Self::SlippedLump => [0.2, 0.04, 0.2],
            _ => [0.24, 0.06, 0.12],
        }
    }
}

/// One line of the results.
struct Case {
    name: String,
    scene: Scene,
    volume: u8,
    threads: usize,
    graph: Graph,
    spent: Duration,
    /// Least time until the first frame, and until the last.
    least: [Duration; 2],
    /// Metrics of the last run, and positions of particles frame by frame.
    report: Report,
    positions: Vec<[f32; 3]>,
}

impl Case {
    fn new(size: &Size, scene: Scene, volume: u8, threads: usize) -> Self {
        let alone = if threads == 1 { ", 1 thread" } else { "" };
        Self {
            name: format!("{} {}, volume {volume}{alone}", size.name, scene.name()),
            graph: graph(size, scene, &format!(r#""volume": {volume}"#)),
            scene,
            volume,
            threads,
            spent: Duration::ZERO,
            least: [Duration::MAX; 2],
            report: Report::default(),
            positions: Vec::new(),
        }
    }

    /// Mean of a metric over the frames after the first.
    fn mean(&self, metric: &str) -> f64 {
        let frames = self.report.nodes.iter().find_map(|node| node.metrics.get(metric)).expect("a metric of Softbody");
        frames.values().sum::<f64>() / frames.len() as f64
    }

    /// Root mean square distance from the result of sixteen steps a frame, relative to the body's longest side.
    fn error(&self, engine: &Engine, size: &Size) -> f64 {
        let params = format!(r#""volume": {}, "integrator": "accurate", "substeps": 16"#, self.volume);
        let (_, exact) = cook(engine, &graph(size, self.scene, &params), 2..=size.frames + 1);
        let square = |(a, b): (&[f32; 3], &[f32; 3])| {
            (0..3).map(|k| f64::from(a[k]) - f64::from(b[k])).map(|x| x * x).sum::<f64>()
        };
        let squares: f64 = self.positions.iter().zip(&exact).map(square).sum();
        (squares / exact.len() as f64).sqrt() / self.scene.sides()[0]
    }
}

fn main() {
    convect::allocator::keep_freed_pages();
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    if let [peak, size, scene] = &words[..]
        && peak == PEAK
    {
        return cook_for_peak(size, scene);
    }
    let asked: BTreeSet<&str> = words.iter().map(String::as_str).collect();
    if let Some(other) = asked.iter().find(|word| SIZES.iter().all(|size| size.name != **word)) {
        eprintln!("unknown size `{other}`; expected 2k, 20k or 100k");
        std::process::exit(2);
    }
    let engines = [1, 2].map(|threads| Engine::new(&Settings { threads, ..Settings::default() }).expect("threads"));
    timing::print_machine(&engines[1]);
    for size in SIZES.iter().filter(|size| asked.is_empty() || asked.contains(size.name)) {
        let mut figures = Figures::default();
        let cases = measure(size, &engines, &mut figures);
        figures.print();
        describe(size, &cases, &engines[1], &figures);
        compare(&cases, &figures);
    }
}

/// Runs all cases of a size in turn, several times.
fn measure(size: &Size, engines: &[Engine; 2], figures: &mut Figures) -> Vec<Case> {
    let case = |scene| {
        let alone = size.alone.then(|| Case::new(size, scene, 1, 1));
        [0, 1].map(|volume| Case::new(size, scene, volume, 2)).into_iter().chain(alone)
    };
    let lumps = Scene::LUMPS.into_iter().filter(|_| size.lump).map(|scene| Case::new(size, scene, 1, 2));
    let mut cases: Vec<Case> = Scene::ALL.into_iter().flat_map(case).chain(lumps).collect();
    for _ in 0..ROUNDS {
        figures.calibrate();
        for case in cases.iter_mut().filter(|case| case.spent < ENOUGH) {
            let engine = &engines[case.threads - 1];
            let (start, _) = cook(engine, &case.graph, 1..=1);
            let (report, positions) = cook(engine, &case.graph, 2..=case.scene.frames(size) + 1);
            let took = [start.cooking, report.cooking];
            case.least = std::array::from_fn(|end| case.least[end].min(took[end]));
            case.spent += took[0] + took[1];
            (case.report, case.positions) = (report, positions);
        }
    }
    for case in &cases {
        figures.add(&*case.name, case.scene.frames(size) as u32, case.least[1].saturating_sub(case.least[0]));
    }
    cases
}

/// Prints cost, error and memory of the cases of a size.
fn describe(size: &Size, cases: &[Case], engine: &Engine, figures: &Figures) {
    println!(
        "\n{:<22} {:>9} {:>7} {:>7} {:>7} {:>7} {:>9} {:>9} {:>8}",
        "a frame of", "ms", "steps", "newton", "cg", "caps", "contacts", "error", "peak MB"
    );
    for case in cases.iter().filter(|case| case.threads == 2) {
        let [steps, newton, cg, caps, contacts] =
            ["substeps_used", "newton", "cg", "caps_hit", "contacts"].map(|metric| case.mean(metric));
        let ms = figures.least(&case.name) * 1e3;
        let error = match size.exact.contains(&case.scene) {
            true => format!("{:.1e}", case.error(engine, size)),
            false => String::new(),
        };
        let peak = if case.volume == 1 { peak(size, case.scene) } else { None };
        let peak = peak.map_or(String::new(), |bytes| format!("{:.0}", bytes * 1e-6));
        println!(
            "{:<22} {ms:>9.2} {steps:>7.1} {newton:>7.1} {cg:>7.0} {caps:>7.1} {contacts:>9.0} {error:>9} {peak:>8}",
            case.name
        );
    }
}

/// Prints the relative cost of contacts and of volume preservation.
fn compare(cases: &[Case], figures: &Figures) {
    let of = |scene: Scene, volume: u8| {
        let case = cases.iter().find(|case| (case.scene, case.volume, case.threads) == (scene, volume, 2));
        figures.least(&case.expect("all were run").name)
    };
    let of_free = |scene| of(scene, 1) / of(Scene::Free, 1);
    let [rolled, rolled_kept] = [0, 1].map(|volume| of(Scene::RolledBeam, volume) / of(Scene::Beam, volume));
    println!("\nrolled beam ÷ beam {rolled:.2} without volumes, {rolled_kept:.2} with, target: at most 2.5");
    for lump in cases.iter().filter(|case| case.scene.is_lump()) {
        let most = if lump.scene == Scene::RolledLump { 25 } else { 10 };
        println!("{}: {:.1} Newton a frame, target: at most {most}", lump.name, lump.mean("newton"));
    }
    println!("rolling ÷ free {:.2}, target: at most 2.5", of_free(Scene::Rolling));
    println!("resting ÷ free {:.2}, stiff ÷ free {:.2}", of_free(Scene::Resting), of_free(Scene::Stiff));
    let volumes = Scene::ALL.map(|scene| format!("{} {:.2}", scene.name(), of(scene, 1) / of(scene, 0)));
    println!("volume 1 ÷ volume 0: {}, target: at most 1.5\n", volumes.join(", "));
}

/// The argument before a size and a scene that makes this program a child process of [`peak`].
const PEAK: &str = "peak";

/// Peak memory of a process that cooks two frames of a scene, bytes; `None` if the system does not tell.
fn peak(size: &Size, scene: Scene) -> Option<f64> {
    let program = std::env::current_exe().expect("this program");
    let child = Command::new(program).args([PEAK, size.name, scene.name()]).output().expect("a process");
    assert!(child.status.success(), "{}", String::from_utf8_lossy(&child.stderr));
    String::from_utf8_lossy(&child.stdout).trim().parse::<f64>().ok().map(|kilobytes| kilobytes * 1024.0)
}

/// The child process: cooks, and prints its peak memory, kB.
fn cook_for_peak(size: &str, scene: &str) {
    let size = SIZES.iter().find(|known| known.name == size).expect("a size");
    let scene = Scene::ALL.into_iter().chain(Scene::LUMPS).find(|known| known.name() == scene).expect("a scene");
    let engine = Engine::new(&Settings { threads: 2, ..Settings::default() }).expect("threads");
    cook(&engine, &graph(size, scene, r#""volume": 1"#), 2..=3);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.strip_suffix("kB"));
    println!("{}", peak.unwrap_or_default());
}

/// Positions of particles, frame after frame.
fn cook(engine: &Engine, graph: &Graph, frames: std::ops::RangeInclusive<i64>) -> (Report, Vec<[f32; 3]>) {
    let request = Request { outputs: vec![0], frames: frames.map(Frame::whole).collect() };
    let mut positions = Vec::new();
    let mut sink = |finished: &[Delivered]| -> Result<(), Infallible> {
        for one in finished {
            positions.extend_from_slice(one.geometry.tets().expect("tets").positions());
        }
        Ok(())
    };
    let report = engine.cook(graph, &request, None, &AtomicBool::new(false), &mut sink).expect("it cooks");
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    (report, positions)
}

/// A Softbody node in a scene, with further params.
fn graph(size: &Size, scene: Scene, params: &str) -> Graph {
    let sides = scene.sides();
    let (cells, low) = match scene {
        Scene::Beam | Scene::RolledBeam => (size.beam, [0.0; 3]),
        _ => (size.dough, [0.0, THICKNESS, 0.0]),
    };
    let (points, tets) = cubes(cells, low, sides);
    let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
    let last = scene.frames(size) + 1;
    let (before, inputs, own) = match scene {
        Scene::Beam => (held(&points), r#""pins": ["pins"]"#, r#""stiffness": 3.04e6, "damping": 1e-3"#),
        Scene::RolledBeam => (
            held(&points) + &BEAM_PIN.rolls(last, sides),
            r#""pins": ["pins"], "colliders": ["pin"]"#,
            r#""stiffness": 3.04e6, "damping": 1e-3"#,
        ),
        Scene::Free => (held(&points), r#""pins": ["pins"]"#, r#""stiffness": 5e3"#),
        Scene::Resting => (String::new(), "", r#""stiffness": 5e3, "ground": true"#),
        Scene::Stiff => (String::new(), "", r#""stiffness": 5e6, "ground": true"#),
        Scene::Rolling => {
            (DOUGH_PIN.rolls(last, sides), r#""colliders": ["pin"]"#, r#""stiffness": 5e3, "ground": true"#)
        }
        Scene::RolledLump => (LUMP.into(), r#""colliders": ["pin"]"#, LUMP_PARAMS),
        Scene::SlippedLump => (LUMP.into(), r#""colliders": ["pin"]"#, LUMP_PARAMS),
    };
    let friction = if scene == Scene::RolledLump { r#", "friction": 1"# } else { "" };
    let friction = if scene == Scene::SlippedLump { r#", "friction": 0"# } else { friction };
    let tets_of = if scene.is_lump() { "lump" } else { "body" };
    let wires = if inputs.is_empty() { String::new() } else { format!(", {inputs}") };
    let text = format!(
        r#"{{
            "convect": 1,
            "scene": {{ "frames": [1, {last}], "fps": 24 }},
            "nodes": {{
                "body": {{ "type": "Tet_In", "params": {{ "points": [], "tets": [] }} }},
                {before}
                "soft": {{
                    "type": "Softbody",
                    "inputs": {{ "bodies": ["{tets_of}"]{wires} }},
                    "params": {{ {own}{friction}, {params}, "self_collision": false }}
                }}
            }},
            "outputs": {{ "body": "soft.tets" }}
        }}"#
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut graph =
        Graph::load(&text, folder, convect::CATALOGUE, &[], &probe).unwrap_or_else(|faults| panic!("{}", faults[0]));
    let body: Geometry = Component::tets(tets, points).expect("tets").into();
    let node = graph.nodes.iter_mut().find(|node| &*node.id == "body").expect("a node");
    node.body = Body::Given { at: Arc::new(move |_| body.clone()), moves: false };
    graph
}

/// Pins that hold the end at x = 0.
fn held(points: &[[f32; 3]]) -> String {
    let end: Vec<[f32; 3]> = points.iter().copied().filter(|p| p[0] == 0.0).collect();
    format!(
        r#""end": {{ "type": "Point_In", "params": {{ "points": {end:?} }} }},
           "pins": {{ "type": "Softbody_Pin", "inputs": {{ "targets": "end" }}, "params": {{ "radius": 1e-5 }} }},"#
    )
}

/// The lump of graphs/dough_rolling, finer, and a pin that comes down, rolls across and turns as it rolls.
const LUMP: &str = r#"
    "sphere": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.2, 0.09, 0.2], "divisions": 13 } },
    "flat": {
        "type": "Attribute_Expr",
        "inputs": { "geometry": "sphere" },
        "params": { "component": "mesh", "code": "P.y = clamp(P.y, -0.02, 0.02)" }
    },
    "placed": { "type": "Transform", "inputs": { "geometry": "flat" }, "params": { "translate": [0, 0.022, 0] } },
    "lump": { "type": "Tetrahedralize", "inputs": { "surface": "placed" } },
    "wood": { "type": "Mesh_Primitive", "params": { "shape": "cylinder", "size": [0.06, 0.3, 0.06], "divisions": 12 } },
    "pin": {
        "type": "Transform",
        "inputs": { "geometry": "wood" },
        "params": {
            "translate": { "keyframes": [[1, [-0.12, 0.064, 0]], [4, [-0.10, 0.054, 0]], [24, [0.10, 0.054, 0]]] },
            "rotate": { "keyframes": [[4, [90, 0, 0]], [14, [90, 0, -190.986]], [24, [90, 0, -381.972]]] }
        }
    },"#;
const LUMP_PARAMS: &str = r#""stiffness": 3e4, "damping": 0.02, "ground": true, "thickness": 2e-3,
    "plastic_yield": 0.05, "plastic_creep": 25"#;

/// A rolling pin that moves ten thicknesses a frame. Metres.
struct Pin {
    radius: f64,
    /// Position of its axis at the first frame, from the end of the body.
    start: f64,
    /// Depth in the first frame, and its increase with each frame.
    deep: f64,
    sinks: f64,
}

/// Reaches the dough within the first frame.
const DOUGH_PIN: Pin = Pin { radius: 0.05, start: -0.04, deep: 0.01, sinks: 0.0 };
/// Follows the beam on its way down.
const BEAM_PIN: Pin = Pin { radius: 0.25, start: 0.3, deep: 0.0, sinks: 0.01 };

impl Pin {
    fn rolls(&self, last: i64, [_, height, depth]: [f64; 3]) -> String {
        let Self { radius, start, deep, sinks } = self;
        let (mut positions, mut turns) = (Vec::new(), Vec::new());
        for frame in 1..=last {
            let passed = (frame - 1) as f64;
            let advance = 10.0 * THICKNESS * passed;
            let low = height - deep - sinks * passed;
            positions.push(format!("[{frame}, [{}, {}, {}]]", start + advance, low + radius, 0.5 * depth));
            turns.push(format!("[{frame}, [90, 0, {}]]", -(advance / radius).to_degrees()));
        }
        let (positions, turns) = (positions.join(", "), turns.join(", "));
        let (across, long) = (2.0 * radius, depth + 0.2);
        format!(
            r#""wood": {{
               "type": "Mesh_Primitive",
               "params": {{ "shape": "cylinder", "size": [{across}, {long}, {across}], "divisions": 12 }}
           }},
           "pin": {{
               "type": "Transform",
               "inputs": {{ "geometry": "wood" }},
               "params": {{
                   "translate": {{ "keyframes": [{positions}] }},
                   "rotate": {{ "keyframes": [{turns}] }}
               }}
           }},"#
        )
    }
}
