//! Sources and sinks where liquid can hardly come or go.

use super::*;

const SHAPES: &str = r#"
    "box": { "type": "Mesh_Primitive", "params": { "size": [2, 0.6, 2], "divisions": 1 } },
    "pool": { "type": "Transform", "inputs": { "geometry": "box" }, "params": { "translate": [0.5, 0, 0.5] } },
    "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.3, 0.3, 0.3], "divisions": 4 } },
    "in_box": { "type": "Transform", "inputs": { "geometry": "ball" }, "params": { "translate": [0.5, 0.5, 0.5] } },
    "in_pool": { "type": "Transform", "inputs": { "geometry": "ball" }, "params": { "translate": [0.5, 0.2, 0.5] } },
    "around": { "type": "Transform", "inputs": { "geometry": "ball" }, "params": { "scale": [1.6, 1.6, 1.6], "translate": [0.5, 0.5, 0.5] } },
    "far": { "type": "Transform", "inputs": { "geometry": "ball" }, "params": { "translate": [5, 5, 5] } },
    "large": { "type": "Mesh_Primitive", "params": { "size": [4, 4, 4], "divisions": 1 } }"#;

/// The shapes, a source and a sink.
fn openings(source: &str, sink: &str) -> &'static str {
    format!(r#"{SHAPES}, "source": {{ "type": "Fluid_Source", {source} }}, "sink": {{ "type": "Fluid_Sink", {sink} }}"#)
        .leak()
}

const IDLE_SINK: &str = r#""inputs": { "shape": "far" }"#;
const IDLE_SOURCE: &str = r#""inputs": { "shape": "far" }, "params": { "active": false }"#;

pub(super) fn extreme_sources_give_or_tell() {
    let from = r#""liquid": ["pool"], "sources": ["source"], "colliders": []"#;
    let sourced =
        |what, source: &str, inputs| row(what, openings(source, IDLE_SINK), inputs, r#""max_substeps": 4"#).drift(0.05);
    let rated = |shape: &str| format!(r#""inputs": {{ "shape": "{shape}" }}, "params": {{ "rate": 0.05 }}"#);
    hold(
        "48",
        vec![
            sourced(
                "a source inside a collider",
                r#""inputs": { "shape": "in_box" }, "params": { "rate": 0.05 }"#,
                r#""liquid": ["pool"], "sources": ["source"], "colliders": ["around"]"#,
            )
            .noted(&["withheld"]),
            sourced("a source outside the box", &rated("far"), from).noted(&["withheld"]),
            sourced("a source at 1e6 m³/s", r#""inputs": { "shape": "in_box" }, "params": { "rate": 1e6 }"#, from)
                .fastest(f32::INFINITY)
                .drift(1.0)
                .noted(&["long_substeps", "volume_drift"]),
            sourced(
                "a nozzle at 1000 m/s",
                r#""inputs": { "shape": "in_box" }, "params": { "velocity": [0, -1000, 0] }"#,
                from,
            )
            .fastest(2000.0)
            .drift(1.0)
            .noted(&["long_substeps", "cfl_reached"]),
            sourced(
                "#49: a source in a sealed box that is full",
                &rated("in_box"),
                r#""liquid": ["large"], "sources": ["source"]"#,
            )
            .noted(&["withheld"]),
            sourced("a source of all the box", r#""inputs": { "shape": "large" }"#, from),
        ],
    );
}

pub(super) fn extreme_sinks_take_or_tell() {
    let sunk = |what, sink: &str, inputs| row(what, openings(IDLE_SOURCE, sink), inputs, "").drift(0.05);
    let to = r#""liquid": ["pool"], "sources": ["source"], "sinks": ["sink"]"#;
    hold(
        "48",
        vec![
            sunk("a sink over everything", r#""inputs": { "shape": "large" }"#, to),
            sunk("a sink outside the box", r#""inputs": { "shape": "far" }"#, to),
            sunk("a sink at 1e6 m³/s", r#""inputs": { "shape": "in_pool" }, "params": { "rate": 1e6 }"#, to)
                .fastest(f32::INFINITY)
                .drift(1.0)
                .noted(&["withheld"]),
            sunk(
                "#49: a sink in a full sealed box",
                r#""inputs": { "shape": "in_box" }, "params": { "rate": 0.05 }"#,
                r#""liquid": ["large"], "sinks": ["sink"]"#,
            )
            .drift(1.0),
            row(
                "a source and a sink in one place",
                openings(r#""inputs": { "shape": "in_pool" }"#, r#""inputs": { "shape": "in_pool" }"#),
                to,
                "",
            )
            .drift(0.3),
        ],
    );
}
