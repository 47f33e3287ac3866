//! Test-only nodes that declare the second order: one that has it, and one whose integrator is wrong.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use engine::graph::Catalogue;
use engine::node::{Accuracy, Trials};
use engine::plan::Request;
use engine::prelude::*;

use super::bench::Subject;
use super::knobs::Knob;
use super::measure::Study;
use super::norms::Norm;
use super::outcome::Goal;
use crate::progress::Progress;
use crate::{load, memory};

params! { PARAMS:
    STEPS: Param<i64> = Param::int("steps", 8, "Steps in which a second is integrated.").within(1.0, 1e6).fixed();
}

const OUT: Output = Output::new("points", &[Kind::Points], "A point that decays towards the origin.");

const ACCURACY: &[Accuracy] = &[Accuracy::larger("steps", Trials::These(&["4", "8", "16", "32"])).order(2.0)];

static MIDPOINT: Node = Node::new("Midpoint", 1, "Decays by the midpoint rule.", Cook::Pure(midpoint))
    .params(PARAMS)
    .outputs(&[&OUT])
    .accuracy(ACCURACY);

static WRONG: Node = Node::new("Wrong", 1, "Decays by Euler's rule.", Cook::Pure(euler))
    .params(PARAMS)
    .outputs(&[&OUT])
    .accuracy(ACCURACY);

static NODES: Catalogue = Catalogue(&[&[&MIDPOINT, &WRONG]]);

/// x' = −x from 1 over a second; `factor` is what a step makes of x.
fn decayed(cx: &Cx, factor: fn(f64) -> f64) -> Result<Outputs> {
    let steps = cx.get(STEPS);
    let x = (0..steps).fold(1.0, |x, _| x * factor(1.0 / steps as f64));
    Ok(OUT.with(Geometry::from(Component::points(vec![[x as f32, 0.0, 0.0]]))))
}

fn midpoint(cx: &Cx) -> Result<Outputs> {
    decayed(cx, |h| 1.0 - h + h * h / 2.0)
}

fn euler(cx: &Cx) -> Result<Outputs> {
    decayed(cx, |h| 1.0 - h)
}

/// The order of a node that a study measures, and what it says of it.
fn studied(node: &str) -> (f64, String) {
    let text = format!(r#"{{ "convect": 1, "nodes": {{ "x": {{ "type": "{node}" }} }}, "outputs": {{ "x": "x" }} }}"#);
    let path = Path::new("x.json");
    let graph = load::loaded_with(NODES, text.as_bytes(), path, &[]).unwrap();
    let subject = Subject {
        catalogue: NODES,
        bytes: text.as_bytes(),
        path,
        fixed: Vec::new(),
        request: Request { outputs: vec![0], frames: vec![Frame::whole(1)].into() },
        norm: Norm::of(&[]).unwrap(),
        threads: 1,
        ceiling: memory::ceiling(None),
        cancel: Arc::new(AtomicBool::new(false)),
        progress: Progress::new(0, true),
        unmatched: OnceLock::new(),
    };
    let knobs = vec![Knob::new(&"x.steps=4,8,16,32".parse().unwrap(), &graph)];
    let folder = tempfile::tempdir().unwrap();
    let mut study = Study::new(&subject, knobs, Goal::None, &graph, &folder.path().join("x.study"), Some(1));
    assert!(!study.measure().unwrap(), "not interrupted");
    let found = study.finish().unwrap();
    let outcome = found.outcome(subject.norm.clone());
    let slope = &outcome.slopes()[0];
    (slope.measured, slope.describe())
}

#[test]
fn a_node_of_first_order_that_says_second_is_caught() {
    let (order, said) = studied("Wrong");
    assert!((order - 1.0).abs() < 0.1 && said.ends_with(", declared 2: lower than declared"), "{said}");
    let (order, said) = studied("Midpoint");
    assert!((order - 2.0).abs() < 0.1 && said.ends_with(" measured, declared 2"), "{said}");
}
