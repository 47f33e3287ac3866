//! Viscosities, and liquid that the grid hardly shows.

use super::*;

/// A block that falls into a pool.
const SPLASH: &str = r#"
    "block": { "type": "Mesh_Primitive", "params": { "size": [0.4, 0.4, 0.4], "divisions": 1 } },
    "drop": { "type": "Transform", "inputs": { "geometry": "block" }, "params": { "translate": [0.5, 0.55, 0.5] } },
    "box": { "type": "Mesh_Primitive", "params": { "size": [2, 0.5, 2], "divisions": 1 } },
    "pool": { "type": "Transform", "inputs": { "geometry": "box" }, "params": { "translate": [0.5, 0, 0.5] } }"#;

/// The block and the pool, of materials 1e8 apart.
const TWO_LIQUIDS: &str = r#"
    "block": { "type": "Mesh_Primitive", "params": { "size": [0.4, 0.4, 0.4], "divisions": 1 } },
    "drop": { "type": "Transform", "inputs": { "geometry": "block" }, "params": { "translate": [0.5, 0.44, 0.5] } },
    "thick": { "type": "Fluid_Source", "inputs": { "shape": "drop" }, "params": { "viscosity": 1e5 } },
    "box": { "type": "Mesh_Primitive", "params": { "size": [2, 0.5, 2], "divisions": 1 } },
    "pool": { "type": "Transform", "inputs": { "geometry": "box" }, "params": { "translate": [0.5, 0, 0.5] } },
    "thin": { "type": "Fluid_Source", "inputs": { "shape": "pool" }, "params": { "viscosity": 1e-3 } }"#;

const LIQUID: &str = r#""liquid": ["drop", "pool"]"#;

pub(super) fn extreme_viscosities_are_solved() {
    let splash = |what, params| row(what, SPLASH, LIQUID, params).drift(0.05);
    hold(
        "45",
        vec![
            splash("viscosity 0", r#""viscosity": 0"#),
            splash("viscosity 1e-9 Pa·s", r#""viscosity": 1e-9"#),
            splash("viscosity 1e9 Pa·s", r#""viscosity": 1e9"#),
            splash("viscosity 1e15 Pa·s", r#""viscosity": 1e15"#),
            splash("viscosity 1e30 Pa·s", r#""viscosity": 1e30"#),
            splash(
                "viscosity from 1e-3 to 1e5 Pa·s in a frame, and back",
                r#""viscosity": { "keyframes": [[2, 1e-3], [3, 1e5], [4, 1e5], [5, 1e-3]] }"#,
            ),
            row("1e5 Pa·s in 1e-3 Pa·s", TWO_LIQUIDS, r#""liquid": ["thin", "thick"]"#, "").drift(0.05),
            splash("#7: density 1e-6 kg/m³", r#""density": 1e-6"#),
            splash("#7: density 1e9 kg/m³", r#""density": 1e9"#),
            splash("`slip` 1 at 1e9 Pa·s", r#""viscosity": 1e9, "slip": 1"#),
            splash("viscosity after pressure, at 1e9 Pa·s", r#""viscosity": 1e9, "stokes": "off""#),
            splash("viscosity below 0", r#""viscosity": -1"#).refused("viscosity"),
        ],
    );
}

pub(super) fn extremely_thin_liquid_is_carried_or_told() {
    let sized = |what, nodes| row(what, nodes, r#""liquid": ["placed"]"#, r#""viscosity": 1"#);
    hold("46", vec![
        sized(
            "a sheet of half a cell",
            r#""shape": { "type": "Mesh_Primitive", "params": { "size": [0.6, 0.04, 0.6], "divisions": 1 } },
               "placed": { "type": "Transform", "inputs": { "geometry": "shape" }, "params": { "translate": [0.5, 0.5, 0.5] } }"#,
        )
        .refused("is thinner everywhere than the surface's cells"),
        sized(
            "a sheet of a hundredth of a cell",
            r#""shape": { "type": "Mesh_Primitive", "params": { "size": [0.6, 0.0008, 0.6], "divisions": 1 } },
               "placed": { "type": "Transform", "inputs": { "geometry": "shape" }, "params": { "translate": [0.5, 0.5, 0.5] } }"#,
        )
        .refused("is thinner everywhere than the surface's cells"),
        sized(
            "a sheet upright, of half a cell",
            r#""shape": { "type": "Mesh_Primitive", "params": { "size": [0.6, 0.6, 0.04], "divisions": 1 } },
               "placed": { "type": "Transform", "inputs": { "geometry": "shape" }, "params": { "translate": [0.5, 0.5, 0.5] } }"#,
        )
        .refused("is thinner everywhere than the surface's cells"),
        sized(
            "a drop of half a cell",
            r#""shape": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.04, 0.04, 0.04], "divisions": 4 } },
               "placed": { "type": "Transform", "inputs": { "geometry": "shape" }, "params": { "translate": [0.5, 0.5, 0.5] } }"#,
        )
        .refused("is thinner everywhere than the surface's cells"),
        sized(
            "a mesh without volume",
            r#""shape": { "type": "Mesh_Primitive", "params": { "size": [0.5, 0, 0.5], "divisions": 1 } },
               "placed": { "type": "Transform", "inputs": { "geometry": "shape" }, "params": { "translate": [0.5, 0.5, 0.5] } }"#,
        ),
        sized(
            "an open sheet",
            r#""placed": { "type": "Mesh_Primitive", "params": { "shape": "grid", "size": [0.5, 0, 0.5], "divisions": 2 } }"#,
        )
        .refused("is not closed, so it has no inside"),
        sized(
            "a cell of liquid",
            r#""shape": { "type": "Mesh_Primitive", "params": { "size": [0.083, 0.083, 0.083], "divisions": 1 } },
               "placed": { "type": "Transform", "inputs": { "geometry": "shape" }, "params": { "translate": [0.5416, 0.5416, 0.5416] } }"#,
        )
        .drift(2.0),
    ]);
}

/// A thousand points in one cell of liquid.
pub(super) fn extremely_many_tracers_in_a_cell_are_carried() {
    let points: Vec<String> = (0..1000).map(|n| format!("[0.51, 0.2{:02}, 0.52]", n % 50)).collect();
    let nodes = format!(
        r#""box": {{ "type": "Mesh_Primitive", "params": {{ "size": [2, 0.8, 2], "divisions": 1 }} }},
           "dots": {{ "type": "Point_In", "params": {{ "points": [{}] }} }}"#,
        points.join(", ")
    );
    let nodes: &'static str = nodes.leak();
    hold(
        "54",
        vec![row(
            "a thousand tracers in a cell",
            nodes,
            r#""liquid": ["box"], "tracers": ["dots"]"#,
            r#""gravity": [3, -9, 0]"#,
        )],
    );
}
