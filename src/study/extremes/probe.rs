//! One cook of a graph with one value, as the child process does it: what came of it is written to stdout as JSON.

use std::io::Write as _;

use engine::cook::{Delivered, Report, Stopped};
use engine::error::{CookError, ErrorKind};
use engine::graph::{Fault, Graph};
use engine::note::Note;
use engine::plan::Request;
use serde_json::{Value, json};

use crate::args::Setting;
use crate::failure::{Failure, cancelled_by_signal};
use crate::study::StudyArgs;
use crate::{load, memory};

/// What a node says of a metric that shows trouble.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trouble {
    pub(super) node: String,
    pub(super) metric: String,
    pub(super) text: String,
}

/// What came of a cook.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Probed {
    /// Frames that every output has, all of them finite.
    pub(super) frames: u64,
    /// The largest coordinate of all outputs, metres.
    pub(super) largest: f64,
    /// Milliseconds a frame.
    pub(super) ms: f64,
    /// Why a value, an input or a result was refused.
    pub(super) refused: Option<String>,
    /// What no graph may cause: a panic, or a node that broke its own declaration.
    pub(super) failed: Option<String>,
    /// Whether it was asked to stop before its last frame.
    pub(super) stopped: bool,
    pub(super) troubles: Vec<Trouble>,
}

impl Probed {
    pub(super) fn refused(why: impl Into<String>) -> Self {
        Self { refused: Some(why.into()), ..Self::default() }
    }

    fn to_json(&self) -> Value {
        let trouble = |one: &Trouble| json!([one.node, one.metric, one.text]);
        json!({
            "frames": self.frames, "largest": self.largest, "ms": self.ms, "refused": self.refused,
            "failed": self.failed, "stopped": self.stopped,
            "troubles": self.troubles.iter().map(trouble).collect::<Vec<_>>(),
        })
    }

    pub(super) fn of_json(text: &[u8]) -> Option<Self> {
        let value: Value = serde_json::from_slice(text).ok()?;
        let string = |value: &Value| value.as_str().map(str::to_owned);
        let trouble =
            |one: &Value| Some(Trouble { node: string(&one[0])?, metric: string(&one[1])?, text: string(&one[2])? });
        Some(Self {
            frames: value["frames"].as_u64()?,
            largest: value["largest"].as_f64()?,
            ms: value["ms"].as_f64()?,
            refused: string(&value["refused"]),
            failed: string(&value["failed"]),
            stopped: value["stopped"].as_bool()?,
            troubles: value["troubles"].as_array()?.iter().map(trouble).collect::<Option<_>>()?,
        })
    }
}

/// Cooks the graph with `set`, `KEY=VALUE` or nothing, and writes what came of it.
///
/// # Errors
/// If the graph cannot be read, or has a fault that is not that of the value.
pub(super) fn run(args: &StudyArgs, set: &str) -> Result<(), Failure> {
    let bytes = load::bytes(&args.graph)?;
    let one: Option<Setting> = if set.is_empty() { None } else { set.parse().ok() };
    let is_own = |key: &str| one.as_ref().is_some_and(|one| one.0 == key);
    let others = args.set.iter().filter(|setting| !is_own(&setting.0)).cloned();
    let settings: Vec<Setting> = others.chain(one.clone()).collect();
    let probed = match load::loaded(&bytes, &args.graph, &settings) {
        Ok(graph) => cook(args, &graph)?,
        Err(faults) => match faults.iter().find(|fault| fault.set.as_deref().is_some_and(is_own)) {
            Some(fault) => Probed::refused(said(fault)),
            // A node says by its params which wires it takes.
            None if one.is_some() => Probed::refused(said(&faults[0])),
            None => return Err(load::faulty(&args.graph, &faults)),
        },
    };
    std::io::stdout().write_all(format!("{}\n", probed.to_json()).as_bytes())?;
    Ok(())
}

/// A fault without its position: the value is not in the file.
fn said(fault: &Fault) -> String {
    fault.hint.as_ref().map_or_else(|| fault.fact.clone(), |hint| format!("{}; {hint}", fault.fact))
}

fn cook(args: &StudyArgs, graph: &Graph) -> Result<Probed, Failure> {
    let engine = load::engine(usize::from(args.threads), memory::ceiling(args.memory))?;
    let request: Request = super::request(args, graph)?;
    let cancel = cancelled_by_signal();
    if let Some(fault) = engine.verify(graph, Some(&request)).first() {
        return Ok(Probed::refused(said(fault)));
    }
    let mut largest = 0.0_f32;
    let mut sink = |finished: &[Delivered]| -> Result<(), Failure> {
        let parts = finished.iter().flat_map(|one| one.geometry.parts());
        let numbers = parts.flat_map(|part| part.positions().as_flattened().iter().copied());
        largest = numbers.fold(largest, |most, x| most.max(x.abs()));
        Ok(())
    };
    let report = match engine.cook(graph, &request, None, &cancel, &mut sink) {
        Ok(report) => report,
        Err(Stopped::Asked(error)) => return Ok(Probed::refused(error.to_string())),
        Err(Stopped::Sink(failure)) => return Err(failure),
    };
    Ok(probed(&report, graph, &request, largest))
}

fn probed(report: &Report, graph: &Graph, request: &Request, largest: f32) -> Probed {
    let delivered = request.outputs.iter().map(|output| report.delivered.get(output).copied().unwrap_or(0));
    let frames = delivered.min().unwrap_or(0);
    let is_bug = |error: &CookError| matches!(error.error.kind, ErrorKind::Panic | ErrorKind::Contract);
    let is_refusal =
        |error: &CookError| matches!(error.error.kind, ErrorKind::Refused | ErrorKind::NotFinite | ErrorKind::File);
    let first = |is: &dyn Fn(&CookError) -> bool| {
        report.errors.iter().find(|(_, error, _)| is(error)).map(|(_, error, _)| error.to_string())
    };
    let is_metric = |note: &&Note| {
        let of_node = graph.nodes.iter().find(|node| note.node.as_deref() == Some(&*node.id));
        let metrics = of_node.and_then(|node| node.node()).map_or(&[][..], |declared| declared.metrics);
        metrics.iter().any(|metric| metric.name == note.kind)
    };
    let trouble = |note: &Note| Trouble {
        node: note.node.as_deref().unwrap_or_default().to_owned(),
        metric: note.kind.to_owned(),
        // What the figure means, too.
        text: note.hint.as_ref().map_or_else(|| note.text.clone(), |hint| format!("{}. {hint}", note.text)),
    };
    Probed {
        frames,
        largest: crate::numbers::decimal(largest),
        ms: report.cooking.as_secs_f64() * 1e3 / (frames.max(1) as f64),
        refused: first(&is_refusal),
        failed: first(&is_bug),
        stopped: report.cancelled,
        troubles: report.notes.iter().filter(is_metric).map(trouble).collect(),
    }
}
