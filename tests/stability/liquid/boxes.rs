//! Boxes, time steps and gravity.

use super::*;

const DAM: &str = r#"
    "column": { "type": "Mesh_Primitive", "params": { "size": [0.8, 1.2, 4], "divisions": 1 } }"#;

const LIQUID: &str = r#""liquid": ["column"]"#;

fn dam(what: &'static str, params: &'static str) -> Row {
    row(what, DAM, LIQUID, params).drift(0.05)
}

pub(super) fn extreme_steps_are_cut_and_capped() {
    hold(
        "51",
        vec![
            dam(
                "#50: gravity turns over in a frame",
                r#""gravity": { "keyframes": [[3, [0, -9.81, 0]], [4, [0, 9.81, 0]]] }"#,
            ),
            dam(
                "#50: gravity turns over between frames",
                r#""gravity": { "interpolation": "constant", "keyframes": [[1, [0, -9.81, 0]], [2.5, [0, 9.81, 0]], [3.5, [9.81, 0, 0]]] }"#,
            ),
            dam("#41: gravity 1e4 m/s²", r#""gravity": [0, -1e4, 0], "max_substeps": 8"#)
                .fastest(2e3)
                .drift(1.0)
                .noted(&["long_substeps"]),
            Row { fps: 4.0, ..dam("frames of ¼ s", "") },
            Row { fps: 4.0, ..dam("frames of ¼ s in at most two substeps", r#""max_substeps": 2"#) }
                .drift(1.0)
                .noted(&["long_substeps"]),
            Row { fps: 1e-3, ..dam("#9: frames of 1000 s", r#""viscosity": 10, "max_substeps": 2"#) }
                .fastest(1e4)
                .drift(1.0)
                .noted(&["long_substeps"]),
            Row { fps: 1e6, ..dam("#9: frames of a millionth of a second", "") },
            dam("#9: time stands still", r#""time_scale": 0"#),
            dam("1000 m/s at the start", r#""initial_velocity": [1000, 0, 0], "max_substeps": 8"#)
                .fastest(2e3)
                .drift(1.0)
                .noted(&["long_substeps"]),
            dam("1000 turns a second at the start", r#""initial_spin": [0, 6283, 0]"#)
                .fastest(2e4)
                .drift(1.0)
                .noted(&["long_substeps"]),
        ],
    );
}

pub(super) fn extreme_boxes_are_solved_or_refused() {
    let whole = r#""column": { "type": "Mesh_Primitive", "params": { "size": [4, 4, 4], "divisions": 1 } }"#;
    let sized = |what, params| row(what, DAM, LIQUID, params).drift(1.0);
    hold(
        "52",
        vec![
            sized("a box of 2³ cells", r#""cell": 0.5"#),
            sized("#19: a box of one cell", r#""cell": 1"#).refused("is thinner everywhere than the surface's cells"),
            row("#19: a box of one cell, full", whole, LIQUID, r#""cell": 1"#),
            row("#19: a box of 2 × 2 × 12 cells, full", whole, LIQUID, r#""domain_to": [0.16666, 0.16666, 1]"#),
            sized(
                "#6: cells of a micrometre",
                r#""cell": 1e-6, "domain_to": [12e-6, 12e-6, 12e-6], "max_substeps": 4"#,
            ),
            row("#6: cells of 100 m", DAM, LIQUID, r#""cell": 100, "domain_to": [1000, 1000, 1000]"#)
                .refused("is thinner everywhere than the surface's cells"),
            row("more than memory holds", DAM, LIQUID, r#""cell": 0.001"#).refused("GiB"),
            row("more cells than can be counted", DAM, LIQUID, r#""cell": 1e-8"#).refused("cells long"),
            row("#18: a box without volume", DAM, LIQUID, r#""domain_to": [1, 0, 1]"#)
                .refused("which is not above `domain_from`"),
        ],
    );
}

pub(super) fn extreme_departures_from_the_box_are_told() {
    let open = r#""wall_x_min": "open", "wall_x_max": "open", "wall_y_min": "open", "wall_y_max": "open",
        "wall_z_min": "open", "wall_z_max": "open", "#;
    let leaves = |rest: &str| -> &'static str { format!("{open} {rest}").leak() };
    hold(
        "53",
        vec![
            dam("liquid falls out of the box", leaves(r#""viscosity": 0.1"#)),
            dam("liquid leaves at 100 m/s", leaves(r#""initial_velocity": [100, 0, 0], "max_substeps": 8"#))
                .fastest(300.0)
                .drift(3.0)
                .noted(&["long_substeps", "liquid_outside"]),
            row("liquid is outside from the start", DAM, LIQUID, r#""domain_from": [5, 5, 5], "domain_to": [6, 6, 6]"#),
            dam("liquid without a box falls", r#""follow": true"#),
            dam("#18: no liquid", r#""domain_from": [0, 0.7, 0]"#),
        ],
    );
}
