//! The volume that splashes without viscosity lose or gain where nothing corrects it.

use engine::cook::{Engine, Settings};
use engine::graph::Graph;
use serde_json::json;

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

/// The block by how fine its surface and its substeps are, then all shapes for longer.
pub(crate) fn raw(extent: Extent, table: &mut Table) {
    let engine = Engine::new(&Settings { threads: 2, ..Settings::default() }).expect("threads");
    let mut add = |name: &str, cells: u32, graph: &Graph, last: i64| {
        let report = cook(&engine, graph, last);
        let drift = metric(&report, "volume_drift_raw");
        let (least, most) =
            drift.iter().fold((0.0_f64, 0.0_f64), |(least, most), drift| (least.min(*drift), most.max(*drift)));
        table.add(
            format!("{name}, {cells}³ cells: worst volume in {last} frames"),
            100.0 * if -least > most { least } else { most },
            None,
            " %",
            format!(
                "{:.1} to {:+.1} %, {:.0} ms a frame",
                100.0 * least,
                100.0 * most,
                report.cooking.as_secs_f64() * 1e3 / (last - 1) as f64
            ),
        );
    };
    let (cells, last) = extent.choose((24, 18), (32, 40));
    let mut block = |name: &str, more: &str, last: i64| {
        let more = format!(r#", "volume_correction": false{more}"#);
        add(name, cells, &frames::graph(Scene::Block, f64::from(cells), 0.0, &more, last), last);
    };
    for (resolution, cfl) in [(1, 2.0), (1, 1.0), (2, 2.0), (2, 1.0), (3, 1.0)] {
        let name = format!("block, `resolution` {resolution}, `cfl` {cfl}");
        block(&name, &format!(r#", "resolution": {resolution}, "cfl": {cfl}"#), last);
    }
    block("block", "", extent.choose(18, 96));
    for splash in SPLASHES {
        let last = extent.choose(18, splash.frames);
        add(splash.name, splash.cells, &splash.graph(last), last);
    }
}
