//! graphs/*/study.json and docs/error_and_time.md: each scene with a param that trades accuracy for time has a study of it, whose
//! numbers are sound and whose knobs exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use engine::node::Node;
use serde_json::Value;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn scenes() -> Vec<String> {
    let folders =
        fs::read_dir(root().join("graphs")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut scenes: Vec<String> = folders.filter(|name| graph_file(name).is_file()).collect();
    scenes.sort();
    scenes
}

fn graph_file(scene: &str) -> PathBuf {
    root().join("graphs").join(scene).join(format!("{scene}.json"))
}

/// The type of each node of a scene, by id.
fn types(scene: &str) -> Vec<(String, &'static Node)> {
    let text = fs::read_to_string(graph_file(scene)).unwrap();
    let graph = engine::graph::Graph::load(
        &text,
        graph_file(scene).parent().unwrap(),
        convect::CATALOGUE,
        &[],
        &engine::graph::probe,
    );
    let graph = graph.unwrap_or_else(|faults| panic!("{scene}: {}", faults[0]));
    let node = |name: &str| convect::CATALOGUE.nodes().find(|node| node.name == name).unwrap();
    graph.nodes.iter().map(|one| (one.id.to_string(), node(one.type_name()))).collect()
}

fn study(scene: &str) -> Option<Value> {
    let text = fs::read_to_string(root().join("graphs").join(scene).join("study.json")).ok()?;
    Some(serde_json::from_str(&text).unwrap_or_else(|error| panic!("{scene}/study.json: {error}")))
}

#[test]
fn every_scene_whose_nodes_trade_accuracy_for_time_has_a_study_a_plot_and_a_paragraph() {
    let page = fs::read_to_string(root().join("docs/error_and_time.md")).unwrap();
    let mut missing = Vec::new();
    for scene in scenes() {
        let trades = types(&scene).iter().any(|(_, node)| !node.accuracy.is_empty());
        let has_study = study(&scene).is_some();
        if trades != has_study {
            missing.push(format!("{scene}: {}", if trades { "no study.json" } else { "a study of no declared param" }));
        }
        if has_study
            && !(page.contains(&format!("studies/{scene}.svg"))
                && root().join(format!("docs/studies/{scene}.svg")).is_file())
        {
            missing.push(format!("{scene}: no plot on docs/error_and_time.md"));
        }
    }
    assert!(missing.is_empty(), "run tools/studies.sh and explain the plots:\n{}", missing.join("\n"));
}

#[test]
fn stored_studies_name_knobs_that_exist_and_hold_sound_numbers() {
    let expected: BTreeSet<&str> =
        ["floor", "frames", "front", "graph", "knobs", "norm", "output", "pick", "reference", "runs", "study", "unit"]
            .into();
    for scene in scenes() {
        let Some(found) = study(&scene) else { continue };
        let keys: BTreeSet<&str> = found.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, expected, "{scene}");
        assert_eq!(
            (&found["study"], &found["graph"]),
            (&Value::from(1), &Value::from(format!("graphs/{scene}/{scene}.json")))
        );
        let types = types(&scene);
        let knobs: Vec<&str> = found["knobs"].as_array().unwrap().iter().map(|knob| knob.as_str().unwrap()).collect();
        for knob in &knobs {
            let (id, param) = knob.split_once('.').unwrap();
            let node =
                types.iter().find(|(known, _)| known == id).unwrap_or_else(|| panic!("{scene}: no node `{id}`")).1;
            assert!(
                node.accuracy.iter().any(|accuracy| accuracy.param == param),
                "{scene}: {} does not declare `{param}`",
                node.name
            );
            let spec = node.param_specs().into_iter().find(|spec| spec.name == param).unwrap();
            for run in found["runs"].as_array().unwrap() {
                let value = run["settings"][knob].as_f64();
                assert!(
                    value.is_none_or(|x| x <= spec.facts.hard.high && x >= spec.facts.hard.low),
                    "{scene}: {knob} {value:?}"
                );
            }
        }
        let number = |value: &Value| value.as_f64().filter(|x| x.is_finite() && *x >= 0.0);
        let runs = found["runs"].as_array().unwrap();
        for run in runs {
            assert_eq!(
                run["settings"].as_object().unwrap().keys().collect::<BTreeSet<_>>().len(),
                knobs.len(),
                "{scene}"
            );
            if run["failed"].is_null() {
                let numbers =
                    [&run["error"]["mean"], &run["error"]["p99"], &run["error"]["max"], &run["ms"], &run["cpu_ms"]];
                assert!(numbers.iter().all(|value| number(value).is_some()), "{scene}: {run}");
            }
        }
        // On the front a run that takes longer errs less; errors below the floor count as the floor.
        let floor = number(&found["floor"]["mean"]).unwrap_or(0.0);
        let mut front: Vec<[f64; 2]> = found["front"]
            .as_array()
            .unwrap()
            .iter()
            .map(|run| {
                let run = &runs[run.as_u64().unwrap() as usize];
                [run["ms"].as_f64().unwrap(), run["error"]["mean"].as_f64().unwrap().max(floor)]
            })
            .collect();
        front.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert!(!front.is_empty() && front.windows(2).all(|pair| pair[1][1] < pair[0][1]), "{scene}: {front:?}");
    }
}

/// Orders that nodes declare; each is measured by a test in study.rs.
#[test]
fn every_declared_order_is_one_that_a_test_measures() {
    let measured = ["Curve_Jiggle.tolerance 1", "Curve_Wind_Collision.rotation_steps 1", "Softbody.substeps 2"];
    let mut declared: Vec<String> = Vec::new();
    for node in convect::CATALOGUE.nodes() {
        let orders = node.accuracy.iter().filter_map(|accuracy| Some((accuracy.param, accuracy.order?)));
        declared.extend(orders.map(|(param, order)| format!("{}.{param} {order}", node.name)));
    }
    declared.sort();
    assert_eq!(declared, measured);
}
