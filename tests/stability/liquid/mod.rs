//! FluidSolve at extremes: viscosities, sheets and drops below a cell, colliders, sources and sinks, boxes.
//!
//! Each row of a table is a graph. It is refused for the reason that the row names, or every frame is finite, stays in its
//! box, encloses what it should to within the row's share, moves no faster than the row allows, takes a bounded number of
//! substeps, gives the notes that the row names, and has the same bits on one thread and on five.

mod boxes;
mod colliders;
mod liquids;
mod openings;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use conformance::cook_all;
use engine::cook::{Engine, Settings};
use engine::error::ErrorKind;
use engine::geometry::{Component, Geometry, P, V};
use engine::graph::Body;
use engine::memory::Ceiling;
use engine::note::Note;
use engine::time::Frame;
use numerics::vector::length;

use crate::cooked::{fault, graph, metrics};
use crate::page::{self, Outcome, split};

/// Cells along the side of the box of 1 m.
const CELLS: f64 = 12.0;

/// The part of the page.
const PART: &str = "Liquids";

/// Frames cooked.
fn frames() -> i64 {
    page::frames(6)
}

/// A graph, and what is expected of it.
struct Row {
    what: &'static str,
    /// The nodes besides FluidSolve, which is `solve`.
    nodes: &'static str,
    inputs: &'static str,
    /// Params of FluidSolve beyond those of the box.
    params: &'static str,
    /// Meshes given to nodes, which no node makes.
    given: Vec<(&'static str, Component)>,
    fps: f64,
    /// Bytes that a node may take.
    memory: usize,
    /// Words of a refusal.
    refused: Option<&'static str>,
    /// Metrics that a note must be about.
    noted: &'static [&'static str],
    /// The largest speed, m/s.
    fastest: f32,
    /// How far the volume may be from what it should be, as a share of that.
    drift: f64,
}

/// A row of these nodes, and of these inputs and params of FluidSolve, in JSON.
fn row(what: &'static str, nodes: &'static str, inputs: &'static str, params: &'static str) -> Row {
    Row {
        what,
        nodes,
        inputs,
        params,
        given: Vec::new(),
        fps: 24.0,
        memory: 1 << 30,
        refused: None,
        noted: &[],
        fastest: 20.0,
        drift: 0.01,
    }
}

impl Row {
    fn given(mut self, node: &'static str, mesh: Component) -> Self {
        self.given.push((node, mesh));
        self
    }

    fn refused(self, refused: &'static str) -> Self {
        Self { refused: Some(refused), ..self }
    }

    fn noted(self, noted: &'static [&'static str]) -> Self {
        Self { noted, ..self }
    }

    fn fastest(self, fastest: f32) -> Self {
        Self { fastest, ..self }
    }

    fn drift(self, drift: f64) -> Self {
        Self { drift, ..self }
    }

    fn text(&self) -> String {
        let given = self.given.iter().map(|(name, _)| format!(r#""{name}": {{ "type": "Mesh_Primitive" }},"#));
        let own = |name: &str, value: String| match self.params.contains(&format!("\"{name}\"")) {
            true => String::new(),
            false => format!(r#", "{name}": {value}"#),
        };
        format!(
            r#"{}{}{} "solve": {{ "type": "FluidSolve", "inputs": {{ {} }}, "params": {{ {}{}{}{} }} }}"#,
            given.collect::<String>(),
            self.nodes,
            if self.nodes.is_empty() { "" } else { "," },
            self.inputs,
            if self.params.is_empty() { r#""start_frame": 1"# } else { self.params },
            own("cell", (1.0 / CELLS).to_string()),
            own("domain_from", "[0, 0, 0]".into()),
            own("domain_to", "[1, 1, 1]".into()),
        )
    }

    fn cook(&self, threads: usize) -> Cooked {
        let mut graph = graph(&self.text(), &["solve.surface", "solve.particles", "solve.volume"], frames());
        graph.scene.fps = self.fps;
        for (name, mesh) in &self.given {
            let geometry: Geometry = mesh.clone().into();
            let node = graph.nodes.iter_mut().find(|node| *node.id == **name).unwrap();
            node.body = Body::Given { at: Arc::new(move |_| geometry.clone()), moves: false };
        }
        let settings = Settings {
            threads,
            ceiling: Ceiling { bytes: self.memory, set_by: "this row of the table allows" },
            ..Settings::default()
        };
        let frames: Vec<Frame> = (1..=frames()).map(Frame::whole).collect();
        let (found, mut report) = cook_all(&Engine::new(&settings).unwrap(), &graph, &frames);
        let errors = report.errors.iter().map(|(_, error, _)| (error.error.kind, error.to_string())).collect();
        let notes = std::mem::take(&mut report.notes);
        let metrics = metrics(&graph, report).remove("solve").unwrap_or_default();
        let made = |output: usize| frames.iter().filter_map(|frame| found.get(&(output, *frame)).cloned()).collect();
        Cooked { outputs: [0, 1, 2].map(made), metrics, notes, errors }
    }

    /// What the page says of it, or how it is wrong.
    fn outcome(&self) -> Result<(Outcome, String), String> {
        if let Some(fault) = fault(&self.text(), "solve") {
            return self.refusal(&[(ErrorKind::Refused, fault)]);
        }
        let cooked = self.cook(1);
        if cooked != self.cook(5) {
            return Err("other bits on five threads than on one".into());
        }
        if !cooked.errors.is_empty() {
            return self.refusal(&cooked.errors);
        }
        if let Some(words) = self.refused {
            return Err(format!("it is not refused with \"{words}\""));
        }
        cooked.check(self)
    }

    fn refusal(&self, errors: &[(ErrorKind, String)]) -> Result<(Outcome, String), String> {
        let (kind, said) = &errors[0];
        match self.refused {
            Some(words) if matches!(kind, ErrorKind::Refused | ErrorKind::NotFinite) && said.contains(words) => {
                Ok((Outcome::Refused, said.clone()))
            }
            _ => Err(said.clone()),
        }
    }
}

/// The result.
#[derive(PartialEq)]
struct Cooked {
    /// `surface`, `particles` and `volume` by frame.
    outputs: [Vec<Arc<Geometry>>; 3],
    /// By name and frame.
    metrics: BTreeMap<String, BTreeMap<Frame, f64>>,
    notes: Vec<Note>,
    /// Kind and message.
    errors: Vec<(ErrorKind, String)>,
}

impl Cooked {
    /// Values of a metric at the frames that have it.
    fn metric(&self, name: &str) -> Vec<f64> {
        self.metrics.get(name).map(|values| values.values().copied().collect()).unwrap_or_default()
    }

    fn most(&self, name: &str) -> f64 {
        self.metric(name).into_iter().fold(0.0, |most, x| most.max(x.abs()))
    }

    fn check(&self, row: &Row) -> Result<(Outcome, String), String> {
        if let Some((name, _)) = self.metrics.iter().find(|(_, values)| values.values().any(|x| !x.is_finite())) {
            return Err(format!("`{name}` is not finite"));
        }
        let (mut fastest, mut farthest) = (0.0_f32, 0.0_f32);
        for geometry in &self.outputs[0] {
            let mesh = geometry.mesh().ok_or("there is no surface")?;
            for (point, velocity) in mesh.positions().iter().zip(mesh.get(V).ok_or("there is no `v`")?) {
                if !point.iter().chain(velocity).all(|x| x.is_finite()) {
                    return Err("a point of `surface` is not finite".into());
                }
                fastest = fastest.max(length(*velocity));
                farthest = point.iter().fold(farthest, |most, x| most.max((x - 0.5).abs()));
            }
        }
        let particles = self.outputs[1].iter().filter_map(|geometry| geometry.points());
        if particles.flat_map(|points| points.get(P).unwrap_or_default()).flatten().any(|x| !x.is_finite()) {
            return Err("a particle is not finite".into());
        }
        if farthest > 0.5 + 1e-4 && !row.params.contains("follow") && !row.params.contains("domain_to") {
            return Err(format!("it is {farthest} m from the middle of the box"));
        }
        let mut faults = Vec::new();
        if fastest > row.fastest {
            faults.push("too fast".to_owned());
        }
        let drift = self.metric("volume_drift").last().map_or(0.0, |drift| drift.abs());
        if drift > row.drift {
            faults.push("its volume is too far off".into());
        }
        let (kept, share) = self.balance();
        if share > row.drift {
            faults.push(format!("{kept:.4} m³ of what came are left, off by {share:.1e}"));
        }
        let noted = |metric: &str| self.notes.iter().any(|note| note.kind == metric);
        for metric in row.noted.iter().filter(|metric| !noted(metric)) {
            faults.push(format!("no note is about `{metric}`"));
        }
        let told = self.told(fastest, drift);
        // Most scenes are of boxes that reach beyond the walls, which changes nothing.
        let is_noted =
            self.notes.iter().any(|note| self.metrics.contains_key(note.kind) && note.kind != "liquid_outside");
        let outcome = if is_noted { Outcome::Capped } else { Outcome::Finite };
        if faults.is_empty() { Ok((outcome, told)) } else { Err(format!("{}: {told}", faults.join(", "))) }
    }

    /// What is there at the end or went, m³, and how far that is from what there was and came, as a share of it.
    fn balance(&self) -> (f64, f64) {
        let last = |metric: &str| self.metric(metric).last().copied().unwrap_or(0.0);
        let kept = last("volume") + last("spray") + last("sunk") + last("left_domain");
        let given = self.metric("volume").first().copied().unwrap_or(0.0) + last("sourced");
        (kept, if given > 0.0 { (kept / given - 1.0).abs() } else { kept })
    }

    fn told(&self, fastest: f32, drift: f64) -> String {
        let mut told = format!(
            "{fastest:.1} m/s, volume off by {drift:.0e}, substeps a frame: at most {:.0}",
            self.most("substeps_used")
        );
        let noted: Vec<&str> =
            self.notes.iter().map(|note| note.kind).filter(|kind| self.metrics.contains_key(*kind)).collect();
        if !noted.is_empty() {
            let _ = write!(told, "; notes: {}", noted.join(", "));
        }
        told
    }
}

/// Checks the rows, and records them as `numbers` of NUMERICS B, or as those that a row's name begins with.
fn hold(numbers: &str, rows: Vec<Row>) {
    let mut wrong = Vec::new();
    for row in rows {
        let (numbers, case) = split(numbers, row.what);
        match row.outcome() {
            Ok((outcome, told)) => page::record(PART, numbers, case, outcome, &told),
            Err(fault) => wrong.push(format!("{}: {fault}", row.what)),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

crate::page::groups! {
    boxes::extreme_steps_are_cut_and_capped,
    boxes::extreme_boxes_are_solved_or_refused,
    boxes::extreme_departures_from_the_box_are_told,
    colliders::extreme_motions_of_colliders_are_met_or_told,
    colliders::extreme_places_of_colliders_are_met_or_told,
    colliders::extremely_small_meshes_are_colliders_too,
    liquids::extreme_viscosities_are_solved,
    liquids::extremely_thin_liquid_is_carried_or_told,
    liquids::extremely_many_tracers_in_a_cell_are_carried,
    openings::extreme_sources_give_or_tell,
    openings::extreme_sinks_take_or_tell,
}
