//! `NAME.study`: the runs of a study so far, so that an interrupted one goes on where it stopped.
//!
//! The runs are used only if everything that they depend on is the same: the graph, its files, the knobs, the frames, the
//! norm, the threads and the program. Otherwise the file is written anew.

use std::path::{Path, PathBuf};

use engine::clock::Stopwatch;
use engine::graph::Graph;
use engine::key::{ContentKey, Hasher};
use serde_json::{Value, json};

use super::bench::{Cost, NodeCost, Run, Subject};
use super::knobs::Knob;
use super::norms::Errors;
use crate::CATALOGUE;
use crate::failure::Failure;
use crate::output::write_whole;

/// The format of the file; one of another is measured anew.
const FORMAT: u32 = 2;

/// The runs are written no more often than this, in seconds.
const INTERVAL: f64 = 1.0;

/// The file of finished runs.
pub(super) struct Store {
    path: PathBuf,
    key: ContentKey,
    written: Stopwatch,
}

/// What the file held.
#[derive(Default)]
pub(super) struct Stored {
    pub(super) runs: Vec<Run>,
    /// Whether times had shown that a knob's values were given from fine to coarse.
    pub(super) reversed: Vec<bool>,
    pub(super) floor: Option<Errors>,
    pub(super) reference: Vec<(String, String)>,
    pub(super) why: String,
    pub(super) is_beyond: bool,
    /// What the storage of positions may change of an error.
    pub(super) rounding: f64,
}

impl Store {
    pub(super) fn new(path: PathBuf, subject: &Subject<'_>, knobs: &[Knob], graph: &Graph) -> Self {
        Self { path, key: key(subject, knobs, graph), written: Stopwatch::start() }
    }

    /// The runs in the file, if there are any of this study.
    pub(super) fn load(&self) -> Option<Stored> {
        let value: Value = serde_json::from_slice(&std::fs::read(&self.path).ok()?).ok()?;
        (value["convect_study"] == FORMAT && value["key"] == self.key.to_string()).then_some(())?;
        let pair = |pair: &Value| Some((pair[0].as_str()?.to_owned(), pair[1].as_str()?.to_owned()));
        Some(Stored {
            runs: value["runs"].as_array()?.iter().map(run_of).collect::<Option<_>>()?,
            reversed: value["reversed"].as_array()?.iter().map(Value::as_bool).collect::<Option<_>>()?,
            floor: errors_of(&value["floor"]),
            reference: value["reference"].as_array()?.iter().map(pair).collect::<Option<_>>()?,
            why: value["why"].as_str()?.to_owned(),
            is_beyond: value["is_beyond"].as_bool()?,
            rounding: value["rounding"].as_f64()?,
        })
    }

    /// Writes the runs, unless that was done just now and this is not the `last` time.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn save(&mut self, stored: &Stored, last: bool) -> Result<(), Failure> {
        if !last && self.written.wall().as_secs_f64() < INTERVAL {
            return Ok(());
        }
        let value = json!({
            "convect_study": FORMAT, "key": self.key.to_string(), "reversed": stored.reversed,
            "floor": stored.floor.map(Errors::to_json), "reference": stored.reference, "why": stored.why,
            "is_beyond": stored.is_beyond, "rounding": stored.rounding, "runs": stored.runs.iter().map(run_to_json).collect::<Vec<_>>(),
        });
        write_whole(&self.path, format!("{value:#}\n").as_bytes())?;
        self.written = Stopwatch::start();
        Ok(())
    }
}

/// The key of everything that the runs depend on.
fn key(subject: &Subject<'_>, knobs: &[Knob], graph: &Graph) -> ContentKey {
    let mut key = Hasher::default();
    key.text(env!("CARGO_PKG_VERSION")).i64(subject.bytes.len() as i64).bytes(subject.bytes);
    key.text(&subject.path.display().to_string()).text(&subject.norm.measure.name()).i64(subject.threads as i64);
    for node in CATALOGUE.nodes() {
        key.text(node.name).i64(i64::from(node.version));
    }
    for (name, value) in &subject.fixed {
        key.text(name).text(value);
    }
    for knob in knobs {
        key.text(&knob.key).i64(knob.values.len() as i64);
        knob.values.iter().for_each(|value| _ = key.text(value));
    }
    for file in graph.files() {
        let about = std::fs::metadata(&file).ok();
        let changed = about.as_ref().and_then(|about| about.modified().ok());
        let changed = changed.and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
        key.text(&file.display().to_string()).i64(about.map_or(-1, |about| about.len() as i64));
        key.i64(changed.map_or(-1, |at| at.as_nanos() as i64));
    }
    key.i64(subject.request.outputs.first().map_or(-1, |output| *output as i64));
    subject.request.frames.iter().for_each(|frame| _ = key.i64(frame.ticks()));
    key.finish()
}

fn run_to_json(run: &Run) -> Value {
    match &run.result {
        Ok((cost, errors)) => json!({
            "setting": run.setting, "error": errors.to_json(), "ms": cost.ms, "cpu_ms": cost.cpu_ms,
            "peak_bytes": cost.peak_bytes, "repeats": cost.repeats,
            "nodes": cost.nodes.iter().map(|node| json!([node.id, node.ms, node.cpu_ms, node.bytes])).collect::<Vec<_>>(),
        }),
        Err(why) => json!({"setting": run.setting, "failed": why}),
    }
}

fn run_of(value: &Value) -> Option<Run> {
    let setting =
        value["setting"].as_array()?.iter().map(|index| Some(index.as_u64()? as usize)).collect::<Option<_>>()?;
    if let Some(why) = value["failed"].as_str() {
        return Some(Run { setting, result: Err(why.to_owned()) });
    }
    let node = |node: &Value| {
        Some(NodeCost {
            id: node[0].as_str()?.to_owned(),
            ms: node[1].as_f64()?,
            cpu_ms: node[2].as_f64()?,
            bytes: node[3].as_u64()? as usize,
        })
    };
    let cost = Cost {
        ms: value["ms"].as_f64()?,
        cpu_ms: value["cpu_ms"].as_f64()?,
        peak_bytes: value["peak_bytes"].as_u64()? as usize,
        nodes: value["nodes"].as_array()?.iter().map(node).collect::<Option<_>>()?,
        repeats: value["repeats"].as_u64()? as u32,
    };
    Some(Run { setting, result: Ok((cost, errors_of(&value["error"])?)) })
}

fn errors_of(value: &Value) -> Option<Errors> {
    Some(Errors { mean: value["mean"].as_f64()?, p99: value["p99"].as_f64()?, max: value["max"].as_f64()? })
}

/// Where the runs of an output's study are stored.
pub(super) fn path(folder: &Path, output: &str) -> PathBuf {
    folder.join(format!("{output}.study"))
}
