//! Colliders that are fast, inside the liquid, inside each other, or hardly meshes.

use super::*;

const POOL: &str = r#"
    "box": { "type": "Mesh_Primitive", "params": { "size": [2, 1, 2], "divisions": 1 } },
    "pool": { "type": "Transform", "inputs": { "geometry": "box" }, "params": { "translate": [0.5, 0, 0.5] } }"#;

/// The pool, and these nodes.
fn pool_and(nodes: &str) -> &'static str {
    format!("{POOL},{nodes}").leak()
}

pub(super) fn extreme_motions_of_colliders_are_met_or_told() {
    let ball = r#""ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.3, 0.3, 0.3], "divisions": 4 } },"#;
    let moved = |translate: &str| {
        pool_and(&format!(
            r#"{ball} "solid": {{ "type": "Transform", "inputs": {{ "geometry": "ball" }}, "params": {{ "translate": {translate} }} }}"#
        ))
    };
    let met = r#""liquid": ["pool"], "colliders": ["solid"]"#;
    hold("47", vec![
        row(
            "a ball at 10 cells a frame through a pool",
            moved(r#"{ "keyframes": [[1, [-0.3, 0.3, 0.5]], [3, [1.36, 0.3, 0.5]]] }"#),
            met,
            r#""viscosity": 0.001"#,
        )
        .fastest(60.0)
        .drift(0.3),
        row(
            "a ball at 10 cells a frame through a pool of 1e5 Pa·s",
            moved(r#"{ "keyframes": [[1, [-0.3, 0.3, 0.5]], [3, [1.36, 0.3, 0.5]]] }"#),
            met,
            r#""viscosity": 1e5"#,
        )
        .fastest(60.0)
        .drift(0.3),
        row("a ball in the liquid from the start", moved("[0.5, 0.3, 0.5]"), met, "").drift(0.02),
        row("a ball elsewhere in each frame", moved(r#"{ "interpolation": "constant", "keyframes": [[1, [0.2, 0.3, 0.2]], [2, [0.8, 0.3, 0.8]], [3, [0.2, 0.5, 0.8]], [4, [0.5, 0.1, 0.5]]] }"#), met, "")
            .fastest(60.0)
            .drift(0.3),
    ]);
}

pub(super) fn extreme_places_of_colliders_are_met_or_told() {
    let solid = |size: &str, translate: &str| {
        format!(
            r#""solid_shape": {{ "type": "Mesh_Primitive", "params": {{ "size": {size}, "divisions": 1 }} }},
               "solid": {{ "type": "Transform", "inputs": {{ "geometry": "solid_shape" }}, "params": {{ "translate": {translate} }} }}"#
        )
    };
    let full = |nodes: String| -> &'static str {
        format!(r#""pool": {{ "type": "Mesh_Primitive", "params": {{ "size": [4, 4, 4], "divisions": 1 }} }}, {nodes}"#)
            .leak()
    };
    let met = r#""liquid": ["pool"], "colliders": ["solid"]"#;
    hold("47", vec![
        row(
            "a piston squeezes a full box",
            full(solid("[2, 0.6, 2]", r#"{ "keyframes": [[1, [0.5, 1.3, 0.5]], [6, [0.5, 1, 0.5]]] }"#)),
            met,
            r#""viscosity": 0.1"#,
        )
        .noted(&["max_divergence"])
        .drift(1.0),
        row(
            "two colliders overlap",
            pool_and(&format!(
                r#"{}, "other": {{ "type": "Transform", "inputs": {{ "geometry": "solid_shape" }}, "params": {{ "translate": [0.6, 0.35, 0.5] }} }}"#,
                solid("[0.3, 0.3, 0.3]", "[0.45, 0.3, 0.5]")
            )),
            r#""liquid": ["pool"], "colliders": ["solid", "other", "solid"]"#,
            "",
        )
        .drift(0.02),
        row("a plate a cell above a pool", pool_and(&solid("[0.5, 0.02, 0.5]", "[0.52, 0.59, 0.5]")), met, "")
            .fastest(1e-3)
            .drift(1e-3),
        row("a box whose top is just above a pool", pool_and(&solid("[0.3, 0.3, 0.3]", "[0.6, 0.37, 0.5]")), met, "")
            .fastest(1e-3)
            .drift(1e-3),
        row("a collider fills the box", pool_and(&solid("[4, 4, 4]", "[0.5, 0.5, 0.5]")), met, ""),
        row("a collider outside the box", pool_and(&solid("[0.2, 0.2, 0.2]", "[9, 9, 9]")), met, ""),
        row("a collider a hundred metres long", pool_and(&solid("[100, 0.1, 0.1]", "[0, 0.3, 0.5]")), met, "").drift(0.02),
    ]);
}

fn mesh(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Component {
    Component::mesh(vec![3; triangles.len()], triangles.concat(), points.to_vec()).unwrap()
}

pub(super) fn extremely_small_meshes_are_colliders_too() {
    let met = r#""liquid": ["pool"], "colliders": ["solid"]"#;
    let against = |what, points: &[[f32; 3]], triangles: &[[u32; 3]]| {
        row(what, POOL, met, "").given("solid", mesh(points, triangles)).drift(0.05)
    };
    let line = [[0.2, 0.3, 0.5], [0.5, 0.3, 0.5], [0.8, 0.3, 0.5]];
    hold(
        "15",
        vec![
            against("a collider without points", &[], &[]),
            against("a collider without faces", &line, &[]),
            against("#17: a collider of a triangle without area", &line, &[[0, 1, 2]]),
            against("#17: a collider of a triangle that is a point", &[[0.5, 0.3, 0.5]; 3], &[[0, 1, 2], [0, 0, 0]]),
            against(
                "#16: a collider of one triangle",
                &[[0.2, 0.3, 0.2], [0.5, 0.35, 0.8], [0.8, 0.3, 0.2]],
                &[[0, 1, 2]],
            ),
        ],
    );
}
