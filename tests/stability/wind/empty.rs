//! Empty and degenerate curves and colliders.

use super::*;
use crate::cooked::cook;

fn of(list: Vec<Vec<Point>>) -> Scene {
    Scene::new().fur(move |_| curves(&list))
}

fn on(points: &[Point], triangles: &[[u32; 3]]) -> Scene {
    let (points, triangles) = (points.to_vec(), triangles.to_vec());
    Scene::new().skin(move |_| mesh(&triangles, points.clone()))
}

pub(super) fn empty_and_degenerate_curves_pass_through_every_node() {
    let root = [0.0, 0.5, 0.0];
    let cooked = hold(
        "10",
        [
            ("no curves", of(vec![])),
            ("#11: one CV", of(vec![vec![root]; 3])),
            ("#12: two equal CVs", of(vec![vec![root; 2], vec![root, root, [0.0, 0.8, 0.1]]])),
            ("#13: all CVs equal", of(vec![vec![root; 5]; 20])),
            ("#11: a curve of one CV among others", of([vec![vec![root]], hairs(20, 5, 0.3)].concat())),
            ("#15: an empty mesh", on(&[], &[]).refused(&["grown", "guided"])),
            ("#16: one triangle", on(&[[-1.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, -1.0]], &[[0, 1, 2]])),
            ("#17: one triangle without area", on(&[[-1.0, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]], &[[0, 1, 2]])),
            ("#17: triangles that are points", on(&[[0.0, 0.4, 0.0]; 3], &[[0, 1, 2], [0, 0, 0]])),
            ("#20: no gusts", Scene::new().with("gusts", r#""num_gusts": 0"#)),
        ],
    );
    let none = Scene::new().cook_some(&NODES, &[], 2);
    assert!(none.frames.is_empty() && none.errors.is_empty(), "no frames are no work");
    page::record(PART, "20", "no frames", Outcome::Finite, "nothing is cooked");
    assert_eq!(cooked[0].of(2, "out").unwrap().point_count(), 0);
    assert_eq!(cooked[1].of(2, "out").unwrap().positions(), [root; 3], "a curve of one CV does not bend");
}

pub(super) fn triangles_without_area_among_others_change_nothing() {
    let flat = Scene::new().skin(|_| ball_of(|all| [all, vec![[0, 0, 1], [5, 5, 5], [0, 1, 1]]].concat()));
    let cooked =
        hold("17", [("a ball without such triangles", Scene::new()), ("a ball with triangles without area", flat)]);
    for node in ["lee", "out"] {
        let [plain, flat] = [0, 1].map(|row: usize| cooked[row].of(2, node).unwrap());
        assert_eq!(plain.positions(), flat.positions());
    }
}

pub(super) fn curves_without_a_skin_bend_and_swing() {
    let nodes = r#"
        "fur": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0], [0, 2, 0]] } },
        "gusts": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "fur" }, "params": { "base": 0.5 } },
        "lee": { "type": "Curve_Wind_Shielding", "inputs": { "curves": "gusts" } },
        "wind": { "type": "Curve_Wind", "inputs": { "curves": "lee" } },
        "swing": { "type": "Curve_Jiggle", "inputs": { "curves": "wind" } },
        "out": { "type": "Curve_Wind_Collision", "inputs": { "curves": "swing", "rest": "fur" } }"#;
    let frames = cook(nodes, &["fur", "out"], 12);
    let [still, blown] = [0, 1].map(|output| frames[output][11].curves().unwrap());
    assert!(length_error(blown, still) <= 1e-5);
    let moved = (to_f64(blown.positions()[2]) - to_f64(still.positions()[2])).norm();
    assert!(moved > 0.1);
    page::record(PART, "14", "curves without a skin", Outcome::Finite, &format!("the tip moves by {moved:.2} m"));
    for (node, input) in [("Curve_Attach", "rest_skin"), ("Curve_Interpolate", "skin")] {
        let curves = if node == "Curve_Attach" { "curves" } else { "guides" };
        let alone = format!(
            r#""fur": {{ "type": "Curve_In", "params": {{ "points": [[0, 0, 0], [0, 1, 0]] }} }},
               "n": {{ "type": "{node}", "inputs": {{ "{curves}": "fur" }} }}"#
        );
        let said = fault(&alone, "n").unwrap_or_default();
        assert!(said.contains(&format!("`{input}`")), "{said}");
        record_refused("14", &format!("{node} without a skin"), &said);
    }
}
