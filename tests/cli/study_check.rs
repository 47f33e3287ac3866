//! The errors of a study are those that another program finds from separate cooks: `tools/study_check.py`, for each norm.

use std::path::Path;
use std::process::Command;

use super::bench::Bench;
use super::study::{SLUMP, STEPS, SWAY, WALL};

/// Compares a study with what the script makes of separate cooks: 1e-6 relative.
fn agree(graph: &str, fixed: &str, args: &[&str]) {
    let bench = Bench::with_graph(graph);
    let set = if fixed.is_empty() { vec![] } else { vec!["--set", fixed] };
    let study = ["study", "g.json", "--quiet", "--repeats", "1", "--json", "study.json"];
    bench.done(&[&study[..], &set, args].concat());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/study_check.py");
    let mut command = Command::new("python3");
    command.arg(script).args(["g.json", "study.json", "--convect", env!("CARGO_BIN_EXE_convect")]).args(set);
    let output = command.current_dir(bench.path("")).output().unwrap();
    let (said, wrong) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{args:?}: {said}{wrong}");
    let runs = bench.read_json("study.json")["runs"].as_array().unwrap().len();
    assert_eq!(said.lines().filter(|line| line.ends_with("as stated")).count(), runs, "{said}");
    println!("{args:?}: {}", said.lines().last().unwrap_or_default());
}

/// The script needs Python alone, which machines without it need not have.
fn has_python() -> bool {
    let found = Command::new("python3").arg("--version").output().is_ok();
    if !found {
        println!("skipped: python3 is not installed");
    }
    found
}

#[test]
fn errors_of_curves_are_those_of_separate_cooks() {
    let moving = WALL.replace(r#""grass": "bent""#, r#""grass": { "from": "bent", "v": true }"#);
    for norm in ["points", "surface,p99", "bent.length_error", "P", "v"] {
        if has_python() {
            agree(&moving, "bent.method=steps", &["--knob", STEPS, "--norm", norm]);
        }
    }
}

#[test]
fn errors_of_a_soft_body_are_those_of_separate_cooks() {
    let tets = SWAY.replace(r#""soft": "soft" }"#, r#""soft": "soft.tets" }"#);
    for norm in ["points", "surface", "volume"] {
        if has_python() {
            agree(&tets, "", &["--knob", "soft.substeps=2,4,8", "--frames", "1-3", "--norm", norm]);
        }
    }
    if has_python() {
        agree(SWAY, "", &["--knob", "soft.substeps=4,8", "--frames", "1-3", "--norm", "surface"]);
    }
}

#[test]
fn errors_of_a_liquid_are_those_of_separate_cooks() {
    for norm in ["surface", "volume"] {
        if has_python() {
            agree(SLUMP, "", &["--knob", "solve.cell=0.2,0.16,0.13", "--norm", norm]);
        }
    }
}
