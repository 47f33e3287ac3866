//! The volume that splashes without viscosity lose or gain where nothing corrects it.

use engine::cook::{Engine, Settings};
use engine::graph::Graph;
use serde_json::{Value, json};

use crate::Extent;
use crate::frames::{self, Scene, cook, load, metric};
use crate::table::Table;

/// A shape of Mesh_Primitive that falls into an empty box of 1 m.
struct Splash {
    name: &'static str,
    shape: &'static str,
    size: [f64; 3],
    /// Where its middle is, m, and how it is turned, degrees.
    translate: [f64; 3],
    rotate: [f64; 3],
    /// Cells along the box.
    cells: u32,
    frames: i64,
}

/// The bounds of creases in `kernels/liquid/src/step/shares.rs` were chosen on the block and the torus; the others had no part in that.
#[rustfmt::skip]
const SPLASHES: [Splash; 4] = [
    Splash { name: "torus", shape: "torus", size: [0.5, 0.2, 0.5], translate: [0.5, 0.6, 0.5], rotate: [60.0, 20.0, 0.0], cells: 28, frames: 96 },
    Splash { name: "ball", shape: "sphere", size: [0.5; 3], translate: [0.42, 0.6, 0.55], rotate: [0.0; 3], cells: 32, frames: 60 },
    Splash { name: "leaning box", shape: "box", size: [0.3, 0.7, 0.3], translate: [0.5; 3], rotate: [0.0, 20.0, 35.0], cells: 32, frames: 60 },
    Splash { name: "slab at a wall", shape: "box", size: [0.25, 0.8, 0.9], translate: [0.15, 0.45, 0.5], rotate: [0.0; 3], cells: 32, frames: 60 },
];

impl Splash {
    fn graph(&self, last: i64) -> Graph {
        let Self { shape, size, translate, rotate, .. } = self;
        let graph = json!({
            "convect": 1,
            "scene": { "frames": [1, last], "fps": 24 },
            "nodes": {
                "shape": { "type": "Mesh_Primitive", "params": { "shape": shape, "size": size } },
                "placed": {
                    "type": "Transform",
                    "inputs": { "geometry": "shape" },
                    "params": { "translate": translate, "rotate": rotate }
                },
                "solve": {
                    "type": "FluidSolve",
                    "inputs": { "liquid": ["placed"] },
                    "params": {
                        "cell": 1.0 / f64::from(self.cells), "domain_from": [0, 0, 0], "domain_to": [1, 1, 1],
                        "viscosity": 0, "volume_correction": false
                    }
                }
            },
            "outputs": { "surface": "solve.surface" }
        });
        load(&graph.to_string())
    }
}

/// Liquid and colliders, still ones or ones that move, in a box without sources and sinks.
struct Meeting {
    name: &'static str,
    cell: f64,
    domain: [[f64; 3]; 2],
    frames: i64,
    /// Meshes, of which "liquid" is the liquid, and "collider" what it meets.
    meshes: Value,
}

impl Meeting {
    fn all() -> [Self; 6] {
        let primitive = |shape: &str, size: [f64; 3]| json!({ "type": "Mesh_Primitive", "params": { "shape": shape, "size": size } });
        let placed =
            |of: &str, params: Value| json!({ "type": "Transform", "inputs": { "geometry": of }, "params": params });
        let step = |n: f64| primitive("box", [0.2, 0.45 - 0.15 * n, 0.3]);
        let step_at = |of: &str, n: f64| placed(of, json!({ "translate": [-0.4 + 0.2 * n, -0.075 - 0.075 * n, 0] }));
        let block = primitive("box", [0.6, 0.2, 0.6]);
        let pool = placed("block", json!({ "translate": [0, -0.2, 0] }));
        let cube = [[-0.3; 3], [0.3; 3]];
        [
            Self {
                name: "stairs",
                cell: 0.02,
                domain: [[-0.5, -0.3, -0.15], [0.5, 0.5, 0.15]],
                frames: 48,
                meshes: json!({
                    "block": primitive("box", [0.15, 0.3, 0.25]),
                    "liquid": placed("block", json!({ "translate": [-0.4, 0.3, 0] })),
                    "a": step(0.0), "b": step(1.0), "c": step(2.0),
                    "top": step_at("a", 0.0), "middle": step_at("b", 1.0), "bottom": step_at("c", 2.0),
                    "collider": { "type": "Merge", "inputs": { "geometry": ["top", "middle", "bottom"] } }
                }),
            },
            Self {
                name: "a thin bowl",
                cell: 0.0125,
                domain: [[-0.35, -0.15, -0.35], [0.35; 3]],
                frames: 36,
                meshes: json!({
                    "ball": primitive("sphere", [0.24; 3]),
                    "liquid": placed("ball", json!({ "translate": [0.02, 0.15, 0] })),
                    "collider": { "type": "Mesh_Primitive", "params": { "shape": "bowl", "size": [0.5, 0.22, 0.5], "thickness": 0.008 } }
                }),
            },
            Self {
                name: "a mug that tips over",
                cell: 0.0125,
                domain: [[-0.4, -0.3, -0.25], [0.25, 0.3, 0.25]],
                frames: 48,
                meshes: json!({
                    "ball": primitive("sphere", [0.2; 3]),
                    "liquid": placed("ball", json!({ "translate": [0, -0.02, 0] })),
                    "mug": { "type": "Mesh_Primitive", "params": { "shape": "bowl", "size": [0.3, 0.3, 0.3], "thickness": 0.03 } },
                    "collider": placed("mug", json!({ "rotate": { "keyframes": [[12, [0, 0, 0]], [36, [0, 0, 110]]] } }))
                }),
            },
            Self {
                name: "a ball that drifts by below",
                cell: 0.02,
                domain: cube,
                frames: 48,
                meshes: json!({
                    "block": primitive("box", [0.2; 3]),
                    "liquid": placed("block", json!({ "translate": [0, 0.1, 0] })),
                    "ball": primitive("sphere", [0.2; 3]),
                    "collider": placed("ball", json!({ "translate": { "keyframes": [[1, [0, -0.2, 0]], [48, [0.1, -0.1, 0.1]]] } }))
                }),
            },
            Self {
                name: "a ball that dips into a pool",
                cell: 0.02,
                domain: cube,
                frames: 48,
                meshes: json!({
                    "block": block, "liquid": pool, "ball": primitive("sphere", [0.24; 3]),
                    "collider": placed("ball", json!({
                        "translate": { "keyframes": [[1, [0, 0.1, 0]], [12, [0, -0.1, 0]], [24, [0, -0.1, 0]], [36, [0, 0.12, 0]]] }
                    }))
                }),
            },
            Self {
                name: "a paddle that stirs a pool",
                cell: 0.02,
                domain: cube,
                frames: 48,
                meshes: json!({
                    "block": block, "liquid": pool, "paddle": primitive("box", [0.3, 0.25, 0.06]),
                    "collider": placed("paddle", json!({
                        "translate": [0, -0.15, 0], "rotate": { "keyframes": [[1, [0, 0, 0]], [48, [0, 360, 0]]] }
                    }))
                }),
            },
        ]
    }

    fn graph(&self, viscosity: f64, is_corrected: bool, last: i64) -> Graph {
        let mut nodes = self.meshes.clone();
        nodes["solve"] = json!({
            "type": "FluidSolve",
            "inputs": { "liquid": ["liquid"], "colliders": ["collider"] },
            "params": {
                "cell": self.cell, "domain_from": self.domain[0], "domain_to": self.domain[1],
                "viscosity": viscosity, "volume_correction": is_corrected
            }
        });
        let scene = json!({ "frames": [1, last], "fps": 24 });
        load(
            &json!({ "convect": 1, "scene": scene, "nodes": nodes, "outputs": { "surface": "solve.surface" } })
                .to_string(),
        )
    }
}

/// The block by how fine its surface and its substeps are, then all shapes for longer, then liquid that meets colliders.
pub(crate) fn raw(extent: Extent, table: &mut Table) {
    let engine = Engine::new(&Settings { threads: 2, ..Settings::default() }).expect("threads");
    let drift = |graph: &Graph, last: i64| {
        let report = cook(&engine, graph, last);
        let drift = metric(&report, "volume_drift");
        let (least, most) =
            drift.iter().fold((0.0_f64, 0.0_f64), |(least, most), drift| (least.min(*drift), most.max(*drift)));
        (report, [least, most, drift[drift.len() - 1]])
    };
    let mut add = |name: &str, graph: &Graph, last: i64, more: &str| {
        let (report, [least, most, end]) = drift(graph, last);
        table.add(
            format!("{name}: worst volume in {last} frames"),
            100.0 * if -least > most { least } else { most },
            None,
            " %",
            format!(
                "{:.1} to {:+.1} %, {:+.1} % at the end{more}, {:.0} ms a frame",
                100.0 * least,
                100.0 * most,
                100.0 * end,
                report.cooking.as_secs_f64() * 1e3 / (last - 1) as f64
            ),
        );
    };
    let (cells, last) = extent.choose((24, 18), (32, 40));
    let mut block = |name: &str, more: &str, last: i64| {
        let more = format!(r#", "volume_correction": false{more}"#);
        let name = format!("{name}, {cells}³ cells");
        add(&name, &frames::graph(Scene::Block, f64::from(cells), 0.0, &more, last), last, "");
    };
    for (resolution, cfl) in [(1, 2.0), (1, 1.0), (2, 2.0), (2, 1.0), (3, 1.0)] {
        let name = format!("block, `resolution` {resolution}, `cfl` {cfl}");
        block(&name, &format!(r#", "resolution": {resolution}, "cfl": {cfl}"#), last);
    }
    block("block", "", extent.choose(18, 96));
    for splash in SPLASHES {
        let last = extent.choose(18, splash.frames);
        add(&format!("{}, {}³ cells", splash.name, splash.cells), &splash.graph(last), last, "");
    }
    for meeting in Meeting::all() {
        let last = extent.choose(18, meeting.frames);
        for viscosity in [0.0, 1.0, 20.0] {
            let (_, [least, most, _]) = drift(&meeting.graph(viscosity, true, last), last);
            let corrected = format!("; corrected {:.2} to {:+.2} %", 100.0 * least, 100.0 * most);
            let name = format!("{}, {viscosity} Pa·s", meeting.name);
            add(&name, &meeting.graph(viscosity, false, last), last, &corrected);
        }
    }
}
