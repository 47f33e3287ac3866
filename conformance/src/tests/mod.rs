//! For each promise nodes that break it, and nodes of every kind that keep all of them.

mod attributes;
mod checkpoints;
mod declaration;
mod determinism;
mod errors;
mod frames;
mod inputs;
mod left_out;
mod neutral;
mod outputs;
mod params;
mod pass_through;
mod ranges;
mod suite;
mod volumes;

use std::sync::atomic::{AtomicU32, Ordering};

use serde::{Deserialize, Serialize};

use super::{conformance, faults};
use engine::geometry::{Attr, Component, ENVELOPE, Geometry, ID, Kind, Owner, P, SHIELDED, Topology, WIDTH};
use engine::node::{
    AttrNames, Chain, Cook, CurveLoop, Cx, FrameCx, Input, LeftOut, Many, Metric, Node, Opt, Output, Outputs, Past,
    StepCx, Times, Wires,
};
use engine::param::{Maskable, Param, Params, Seed, Unit};
use engine::{Error, Result, choice};

choice! {
    /// The axis to move along.
    enum Way {
        Up = "up": "along y",
        Along = "along": "along x",
    }
}

const CURVES: Input = Input::one("curves", Kind::Curves, "Curves to move.");
const OTHER: Input<Opt> = Input::optional("other", Kind::Curves, "Other curves.");
const SKINS: Input<Many> = Input::many("skins", Kind::Mesh, "Meshes beside them.");
const OUT: Output = Output::like("curves", &CURVES, "The curves, moved.");
const AMOUNT: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).soft(0.0, 1.0);
const SPARE: Param<f32> = Param::float("spare", 0.1, "How much further they move.").within(0.0, 1.0);
const WAY: Param<Way> = Param::choice("way", Way::Up, "The direction in which they move.");
const TWICE: Param<bool> = Param::bool("twice", false, "Moves them twice as far.");
const HEIGHT: Metric = Metric::new("height", Unit::Metres, "How far they were moved.");

/// The curves, moved along y.
fn up(cx: &Cx, by: f32) -> Result<Geometry> {
    let mut curves = cx.input(CURVES).clone();
    if let Some(part) = curves.part_mut(Kind::Curves) {
        part.edit(P).into_iter().flatten().for_each(|p| p[1] += by);
    }
    Ok(curves)
}

/// A node that moves curves by `amount`.
const fn shift(cook: fn(&Cx) -> Result<Outputs>) -> Node {
    Node::new("Shift", 1, "Moves curves.", Cook::Pure(cook))
        .inputs(&[&CURVES])
        .params(&[&AMOUNT])
        .outputs(&[&OUT])
        .reads(&[&P])
        .writes(&[&P])
}

const GOOD: Node = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT))?)));

fn leak(node: Node) -> &'static Node {
    Box::leak(Box::new(node))
}

/// All findings of the suite for a node.
fn findings_of(node: Node) -> Vec<String> {
    faults(leak(node))
}

/// The suite reports this, and possibly consequences.
#[track_caller]
fn finds(node: Node, finding: &str) {
    let found = findings_of(node);
    assert!(found.iter().any(|line| line.contains(finding)), "expected {finding:?}, found {found:#?}");
}

/// The suite reports this and nothing else.
#[track_caller]
fn finds_only(node: Node, finding: &str) {
    let found = findings_of(node);
    assert!(found.len() == 1 && found[0].contains(finding), "expected {finding:?} alone, found {found:#?}");
}

/// The height of the first point.
fn first_y(geometry: &Geometry) -> f32 {
    geometry.parts().next().and_then(|part| part.positions().first()).map_or(0.0, |p| p[1])
}
