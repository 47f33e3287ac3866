//! Frames of FluidSolve in a box of 1 m.

use std::convert::Infallible;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use engine::cook::{Delivered, Engine, Report, Settings};
use engine::geometry::{Component, Geometry};
use engine::graph::{Body, Graph, probe};
use engine::plan::Request;
use engine::time::Frame;
use numerics::random::Key;
use numerics::shapes::icosphere;
use serde_json::{Value, json};

use crate::Extent;
use crate::table::Table;

/// Runs of a case of which the least time counts, where a run takes less than half a minute.
const ROUNDS: usize = 3;

/// Largest divergence · Δt that is asked for: the default tolerance.
const DIVERGENCE: f64 = 1e-4;

/// Megabytes that no scene may exceed.
const MEMORY: f64 = 4000.0;

/// The viscosity of a thick liquid, Pa·s.
const THICK: f64 = 100.0;

/// What is in the box.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scene {
    /// A block of 0.4 × 0.6 × 0.4 m in the middle of the floor, which collapses.
    Block,
    /// 5 % of the box, turning about y.
    Shallow,
    /// The whole box, turning about y.
    Full,
    /// Half the box, pushed along x.
    Pool,
    /// A dam and sixty drops.
    Drops,
}

impl Scene {
    const ALL: [Self; 5] = [Self::Block, Self::Shallow, Self::Full, Self::Pool, Self::Drops];

    fn name(self) -> &'static str {
        match self {
            Self::Block => "block",
            Self::Shallow => "5 % of the box",
            Self::Full => "full box",
            Self::Pool => "pool",
            Self::Drops => "drops",
        }
    }

    fn liquid(self) -> Vec<Component> {
        let filled = |height: f32| vec![cuboid([-1.0; 3], [2.0, height, 2.0])];
        match self {
            Self::Block => vec![cuboid([0.3, -1.0, 0.3], [0.7, 0.6, 0.7])],
            Self::Shallow => filled(0.05),
            Self::Full => filled(2.0),
            Self::Pool => filled(0.5),
            Self::Drops => {
                let drop = |n: u64| {
                    let random = |k: u64| Key::new(3).of(n).of(k).between([0.0, 1.0]);
                    ball([random(0), 0.3 + 0.7 * random(1), random(2)], 0.02 + 0.04 * random(3))
                };
                std::iter::once(cuboid([-1.0; 3], [0.35, 0.55, 2.0])).chain((0..60).map(drop)).collect()
            }
        }
    }

    fn params(self) -> &'static str {
        match self {
            Self::Block | Self::Drops => "",
            Self::Shallow | Self::Full => r#", "initial_spin": [0, 1, 0]"#,
            Self::Pool => r#", "initial_velocity": [0.5, 0, 0]"#,
        }
    }
}

/// One run.
#[derive(Clone, Copy)]
struct Case {
    scene: Scene,
    /// Cells along the box.
    cells: u32,
    viscosity: f64,
    threads: usize,
    /// The last frame.
    last: i64,
}

/// What it took.
#[derive(Clone, Copy)]
struct Cost {
    /// Milliseconds of a frame, first frame left out, and of the start.
    ms: f64,
    start_ms: f64,
    /// Substeps of a frame, iterations of a substep, both means.
    substeps: f64,
    iterations: f64,
    /// The largest divergence · Δt.
    divergence: f64,
    /// Liquid cells, mean.
    liquid: f64,
    /// Peak memory of the process, megabytes.
    peak: f64,
}

impl Case {
    fn name(&self) -> String {
        let Self { scene, cells, viscosity, .. } = self;
        format!("{}, {cells}³ cells, {viscosity} Pa·s", scene.name())
    }

    /// Runs a child process of this program.
    fn run(&self) -> Cost {
        let Self { scene, cells, viscosity, threads, last } = self;
        let case =
            json!({ "scene": scene.name(), "cells": cells, "viscosity": viscosity, "threads": threads, "last": last });
        let program = std::env::current_exe().expect("this program");
        let child = Command::new(program).args([CHILD, &case.to_string()]).output().expect("a process");
        assert!(child.status.success(), "{}: {}", self.name(), String::from_utf8_lossy(&child.stderr));
        let found: Value = serde_json::from_slice(&child.stdout).expect("what a child prints");
        let of = |name: &str| found[name].as_f64().expect("a number of a child");
        Cost {
            ms: of("ms"),
            start_ms: of("start_ms"),
            substeps: of("substeps"),
            iterations: of("iterations"),
            divergence: of("divergence"),
            liquid: of("liquid"),
            peak: of("peak"),
        }
    }
}

impl Cost {
    /// Nanoseconds of a liquid cell and a substep.
    fn ns(&self) -> f64 {
        self.ms * 1e6 / (self.liquid * self.substeps)
    }

    fn beside(&self) -> String {
        let Self { start_ms, substeps, iterations, divergence, liquid, peak, .. } = self;
        format!(
            "{substeps:.1} substeps, {iterations:.1} iterations each, max divergence · Δt {divergence:.1e}, {:.0} ns a cell and \
             substep of {liquid:.0} cells, start {start_ms:.0} ms, {peak:.0} MB",
            self.ns()
        )
    }
}

/// Runs cases, those that are short several times, interleaved; the least time of each.
fn run_all(cases: &[Case], extent: Extent) -> Vec<Cost> {
    let mut costs: Vec<Cost> = cases.iter().map(Case::run).collect();
    for _ in 1..extent.choose(1, ROUNDS) {
        for (case, cost) in cases.iter().zip(&mut costs) {
            if cost.ms * case.last as f64 + cost.start_ms < 30e3 {
                let next = case.run();
                *cost = Cost { ms: cost.ms.min(next.ms), start_ms: cost.start_ms.min(next.start_ms), ..*cost };
            }
        }
    }
    costs
}

/// The block at several sizes and viscosities.
pub(crate) fn blocks(extent: Extent, table: &mut Table) {
    let last = extent.choose(7, 25);
    for cells in extent.choose(&[32, 64][..], &[64, 96, 128]) {
        let cases = [0.0, 1.0, THICK, 1e4].map(|viscosity| Case {
            scene: Scene::Block,
            cells: *cells,
            viscosity,
            threads: 2,
            last,
        });
        for (case, cost) in cases.iter().zip(run_all(&cases, extent)) {
            let most = match (case.cells, case.viscosity) {
                (64, 0.0) => Some(300.0),
                (64, _) => Some(600.0),
                _ => None,
            };
            table.add(format!("{}, a frame", case.name()), cost.ms, most, " ms", cost.beside());
            table.add("its max divergence · Δt", cost.divergence, Some(DIVERGENCE), "", "");
            table.add("its peak memory", cost.peak, Some(MEMORY), " MB", "");
        }
    }
}

/// A box with 5 % liquid, ÷ the full one.
pub(crate) fn share_of_box(extent: Extent, table: &mut Table) {
    let cells = extent.choose(48, 96);
    for (viscosity, most) in [(THICK, 0.15), (0.0, 0.3)] {
        let cases = [Scene::Shallow, Scene::Full].map(|scene| Case { scene, cells, viscosity, threads: 2, last: 7 });
        let costs = run_all(&cases, extent);
        let ratio = |of: fn(&Cost) -> f64| of(&costs[0]) / of(&costs[1]);
        for (case, cost) in cases.iter().zip(&costs) {
            table.add(format!("{}, a frame", case.name()), cost.ms, None, " ms", cost.beside());
        }
        table.add("time of 5 % ÷ full", ratio(|cost| cost.ms), Some(most), "", "");
        table.add("memory of 5 % ÷ full", ratio(|cost| cost.peak), Some(0.25), "", "");
    }
}

/// How much longer a cell and a substep take on a larger grid.
pub(crate) fn growth(extent: Extent, table: &mut Table) {
    let sizes = extent.choose([32, 64], [64, 128]);
    for (scene, viscosity, most) in [(Scene::Pool, 0.0, 1.3), (Scene::Drops, 0.0, 2.0), (Scene::Block, THICK, 2.0)] {
        let cases = sizes.map(|cells| Case { scene, cells, viscosity, threads: 2, last: extent.choose(4, 7) });
        let costs = run_all(&cases, extent);
        for (case, cost) in cases.iter().zip(&costs) {
            table.add(format!("{}, a cell and substep", case.name()), cost.ns(), None, " ns", cost.beside());
        }
        table.add("the larger ÷ the smaller", costs[1].ns() / costs[0].ns(), Some(most), "", "");
    }
}

/// One thread and two.
pub(crate) fn threads(extent: Extent, table: &mut Table) {
    for viscosity in [0.0, THICK] {
        let case = |threads| Case {
            scene: Scene::Block,
            cells: extent.choose(32, 64),
            viscosity,
            threads,
            last: extent.choose(4, 25),
        };
        let costs = run_all(&[1, 2].map(case), extent);
        for (threads, cost) in [1, 2].into_iter().zip(&costs) {
            let on = if threads == 1 { "one thread" } else { "two threads" };
            table.add(format!("{} on {on}, a frame", case(threads).name()), cost.ms, None, " ms", cost.beside());
        }
        table.add("two threads ÷ one", costs[1].ms / costs[0].ms, None, "", "");
    }
}

/// The largest scene.
pub(crate) fn memory(extent: Extent, table: &mut Table) {
    let case = Case {
        scene: Scene::Full,
        cells: extent.choose(64, 128),
        viscosity: THICK,
        threads: 2,
        last: extent.choose(2, 3),
    };
    let cost = case.run();
    table.add(format!("{}, peak memory", case.name()), cost.peak, Some(MEMORY), " MB", cost.beside());
}

/// The argument before a case that makes this program a child process of [`Case::run`].
pub(crate) const CHILD: &str = "cook-a-case";

/// The child process: cooks a case twice, its first frame and all frames, and prints what that took.
pub(crate) fn cook_as_child(case: &str) {
    let case: Value = serde_json::from_str(case).expect("a case");
    let number = |name: &str| case[name].as_f64().expect("a number of a case");
    let scene = Scene::ALL.into_iter().find(|scene| case["scene"] == scene.name()).expect("a scene");
    let (threads, last) = (number("threads") as usize, number("last") as i64);
    let graph = graph(scene, number("cells"), number("viscosity"), "", last);
    let cooked = |last| {
        let engine = Engine::new(&Settings { threads, ..Settings::default() }).expect("threads");
        cook(&engine, &graph, last)
    };
    let (start, all) = (cooked(1), cooked(last));
    let frames = (last - 1) as f64;
    let metric = |name: &str| metric(&all, name);
    let sum = |name: &str| metric(name).iter().sum::<f64>();
    let substeps = sum("substeps_used");
    let milliseconds = |report: &Report| report.cooking.as_secs_f64() * 1e3;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok());
    let found = json!({
        "ms": (milliseconds(&all) - milliseconds(&start)).max(0.0) / frames,
        "start_ms": milliseconds(&start),
        "substeps": substeps / frames,
        "iterations": (sum("pressure_iterations") + sum("coupled_iterations")) / substeps,
        "divergence": metric("max_divergence").into_iter().fold(0.0, f64::max),
        "liquid": sum("liquid_cells") / frames,
        "peak": peak.unwrap_or(0.0) * 1024.0 * 1e-6,
    });
    println!("{found}");
}

/// A metric of FluidSolve in the frames after the first.
pub(crate) fn metric(report: &Report, name: &str) -> Vec<f64> {
    let values = report.nodes.iter().find_map(|node| node.metrics.get(name)).expect("a metric of FluidSolve");
    values.iter().filter(|(frame, _)| **frame > Frame::whole(1)).map(|(_, value)| *value).collect()
}

pub(crate) fn cook(engine: &Engine, graph: &Graph, last: i64) -> Report {
    let request = Request { outputs: vec![0], frames: (1..=last).map(Frame::whole).collect() };
    let mut sink = |_: &[Delivered]| -> Result<(), Infallible> { Ok(()) };
    let report = engine.cook(graph, &request, None, &AtomicBool::new(false), &mut sink).expect("it cooks");
    assert!(report.errors.is_empty(), "{}", report.errors[0].1);
    report
}

/// FluidSolve with the liquid of a scene; `more`: other params, after a comma.
pub(crate) fn graph(scene: Scene, cells: f64, viscosity: f64, more: &str, last: i64) -> Graph {
    let liquid = scene.liquid();
    let names: Vec<String> = (0..liquid.len()).map(|n| format!("liquid{n}")).collect();
    let given: String = names.iter().map(|name| format!(r#""{name}": {{ "type": "Mesh_Primitive" }},"#)).collect();
    let text = format!(
        r#"{{
            "convect": 1,
            "scene": {{ "frames": [1, {last}], "fps": 24 }},
            "nodes": {{
                {given}
                "solve": {{
                    "type": "FluidSolve",
                    "inputs": {{ "liquid": {names:?} }},
                    "params": {{
                        "cell": {}, "domain_from": [0, 0, 0], "domain_to": [1, 1, 1], "viscosity": {viscosity}{}{more}
                    }}
                }}
            }},
            "outputs": {{ "surface": "solve.surface" }}
        }}"#,
        1.0 / cells,
        scene.params()
    );
    let mut graph = load(&text);
    for (name, mesh) in names.iter().zip(liquid) {
        let geometry: Geometry = mesh.into();
        let node = graph.nodes.iter_mut().find(|node| *node.id == **name).expect("a node");
        node.body = Body::Given { at: Arc::new(move |_| geometry.clone()), moves: false };
    }
    graph
}

/// A graph of the bench's own.
pub(crate) fn load(text: &str) -> Graph {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    Graph::load(text, folder, convect::CATALOGUE, &[], &probe).unwrap_or_else(|faults| panic!("{}", faults[0]))
}

/// A closed box of quads.
fn cuboid(low: [f32; 3], high: [f32; 3]) -> Component {
    let at = |n: usize| [0, 1, 2].map(|k| if n >> k & 1 == 0 { low[k] } else { high[k] });
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Component::mesh(vec![4; 6], faces.concat(), (0..8).map(at).collect()).expect("a mesh")
}

fn ball(centre: [f32; 3], radius: f32) -> Component {
    let ball = icosphere(f64::from(radius), 2);
    let triangles = ball.triangles();
    let points = ball.points.iter().map(|p| numerics::vector::add(p.map(|x| x as f32), centre)).collect();
    Component::mesh(vec![3; triangles.len()], triangles.into_flattened(), points).expect("a mesh")
}
