//! `convect study --extremes`: the graph at both ends of the range of each param, one after the other.
//!
//! Each is cooked by a process of its own for a bounded time. A line says what came of it: `finite`, `refused` with the
//! message, or `capped` with what a node could not meet. Anything else is a fault of convect.

mod child;
mod ends;
mod probe;

use std::io::Write as _;
use std::process::Command;
use std::time::Duration;

use engine::graph::Graph;
use engine::plan::Request;
use serde_json::{Value, json};

use super::propose::upstream;
use super::table::brief;
use super::{Budget, StudyArgs, is_stdout};
use crate::args::Frames;
use crate::failure::{Exit, Failure, cancelled_by_signal};
use crate::output::write_whole;
use crate::targets::Targets;
use crate::{load, memory};
use child::Ended;
use probe::Probed;

/// Frames cooked without `--frames`, at most: most solvers that blow up do so within these.
const FRAMES: usize = 24;

/// Values longer than this are cut in the table.
const LONGEST: usize = 44;

/// What came of a cook.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// Every frame is finite, and no node says more than it does of the graph as it is.
    Finite,
    /// There is a message.
    Refused,
    /// Finite as far as it went, but a node could not meet something, or the time was over.
    Capped,
    /// A panic, a crash, or a node that broke its own declaration.
    Failed,
}

impl Outcome {
    fn name(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::Refused => "refused",
            Self::Capped => "capped",
            Self::Failed => "FAILED",
        }
    }
}

/// A line.
struct Row {
    key: String,
    value: String,
    outcome: Outcome,
    message: String,
    probed: Probed,
    /// Whether the param is read, and so was cooked.
    is_read: bool,
}

/// The frames and outputs that are cooked: the first frames of the scene unless `--frames` says which.
fn request(args: &StudyArgs, graph: &Graph) -> Result<Request, Failure> {
    let names: Vec<String> = args.output.iter().cloned().collect();
    let frames = Frames::of_scene(args.frames.as_ref(), &graph.scene)?;
    let frames = if args.frames.is_some() { frames } else { frames.iter().take(FRAMES).collect() };
    Ok(Request { outputs: load::outputs(graph, &names)?, frames })
}

/// Cooks the graph as it is and with each param at both ends of its range, and writes a line for each.
///
/// # Errors
/// If the graph has faults or cannot be cooked as it is, a file cannot be written, or a cook fails in a way that no value
/// may cause.
pub(super) fn run(args: &StudyArgs) -> Result<(), Failure> {
    if let Some(one) = &args.extreme {
        return probe::run(args, one);
    }
    let bytes = load::bytes(&args.graph)?;
    let graph = load::loaded(&bytes, &args.graph, &args.set).map_err(|faults| load::faulty(&args.graph, &faults))?;
    let request = request(args, &graph)?;
    check_target(args, &graph)?;
    let engine = load::engine(usize::from(args.threads), memory::ceiling(args.memory))?;
    let faults = load::as_read_from(&args.graph, engine.verify(&graph, Some(&request)));
    drop(engine);
    if !faults.is_empty() {
        return Err(load::faulty(&args.graph, &faults));
    }
    let mut needed: Vec<usize> =
        request.outputs.iter().flat_map(|output| upstream(&graph, graph.outputs[*output].from.node)).collect();
    needed.sort_unstable();
    needed.dedup();
    let (ends, without) = ends::of(&graph, needed.into_iter());
    let cancel = cancelled_by_signal();
    let Budget(ms) = args.limit;
    let limit = Duration::from_secs_f64(ms / 1e3);
    if !args.quiet {
        let count = 1 + ends.iter().filter(|end| end.is_read).count();
        crate::say!(
            "{count} cooks of {} frames each, which take at most {} s each; {without} params have no range",
            request.frames.len(),
            brief(ms / 1e3)
        );
    }
    let cook = |set: &str| child::run(&mut command(args, set)?, from_stdin(args, &bytes), limit, &cancel);
    let as_it_is = match cook("")? {
        Ended::Probed(probed) => probed,
        Ended::Interrupted => return Err(interrupted(0)),
        Ended::Silenced => return Err(Failure::new(Exit::Cook, too_slow(limit))),
        Ended::Crashed(line) => return Err(Failure::new(Exit::Cook, line)),
    };
    if let Some(why) = as_it_is.failed.as_ref().or(as_it_is.refused.as_ref()) {
        return Err(Failure::new(Exit::Cook, format!("the graph cannot be cooked as it is: {why}")));
    }
    if as_it_is.frames == 0 {
        return Err(Failure::new(Exit::Cook, too_slow(limit)));
    }
    let width = ends.iter().map(|end| shown(&end.key, &end.value).chars().count()).max().unwrap_or(0).max(5);
    let mut rows: Vec<Row> = Vec::new();
    let base = row("", "", Ended::Probed(as_it_is.clone()), &as_it_is, limit);
    print(args, "as it is", width, &base)?;
    for end in &ends {
        let ended = match end.is_read {
            true => cook(&format!("{}={}", end.key, end.value))?,
            false => Ended::Probed(as_it_is.clone()),
        };
        if matches!(ended, Ended::Interrupted) {
            write_json(args, &graph, &request, &base, &rows)?;
            return Err(interrupted(rows.len()));
        }
        let mut row = row(&end.key, &end.value, ended, &as_it_is, limit);
        if !end.is_read {
            (row.outcome, row.is_read) = (Outcome::Finite, false);
            row.message = "not read: the other params leave it out".into();
        }
        print(args, &shown(&end.key, &end.value), width, &row)?;
        rows.push(row);
    }
    write_json(args, &graph, &request, &base, &rows)?;
    verdict(args, &rows)
}

fn check_target(args: &StudyArgs, graph: &Graph) -> Result<(), Failure> {
    let mut targets = Targets::default();
    if !load::is_stdin(&args.graph) {
        targets.reads(&args.graph, "it is the graph");
    }
    graph.files().into_iter().for_each(|path| targets.reads(path, "the graph reads it"));
    if let Some(path) = args.json.as_ref().filter(|path| !is_stdout(path)) {
        targets.writes("--json", Exit::CommandLine, path);
    }
    targets.check()
}

/// The graph's bytes, if the child cannot read it itself.
fn from_stdin<'a>(args: &StudyArgs, bytes: &'a [u8]) -> Option<&'a [u8]> {
    (load::is_stdin(&args.graph) || engine::files::is_handed_over(&args.graph)).then_some(bytes)
}

/// This program, which cooks one value.
fn command(args: &StudyArgs, set: &str) -> Result<Command, Failure> {
    let own = std::env::current_exe();
    let own = own.map_err(|error| Failure::new(Exit::Cook, format!("convect cannot find its own program: {error}")))?;
    let mut command = Command::new(own);
    command.arg("study").args(["--extremes", "--extreme", set]);
    if let Some(output) = &args.output {
        command.args(["--output", output]);
    }
    if let Some(frames) = &args.frames {
        command.arg(format!("--frames={frames}"));
    }
    for setting in &args.set {
        command.arg(format!("--set={}={}", setting.0, setting.1));
    }
    if let Some(memory) = args.memory {
        command.arg(format!("--memory={}", memory.0));
    }
    command.arg(format!("--threads={}", args.threads)).arg("--");
    command.arg(if from_stdin(args, &[]).is_some() { "-".as_ref() } else { args.graph.as_os_str() });
    Ok(command)
}

/// The line of a cook, compared with the graph as it is.
fn row(key: &str, value: &str, ended: Ended, as_it_is: &Probed, limit: Duration) -> Row {
    let is_new = |one: &&probe::Trouble| {
        !as_it_is.troubles.iter().any(|other| (&other.node, &other.metric) == (&one.node, &one.metric))
    };
    let (outcome, message, probed) = match ended {
        Ended::Crashed(line) => (Outcome::Failed, line, Probed::default()),
        Ended::Silenced | Ended::Interrupted => (Outcome::Capped, too_slow(limit), Probed::default()),
        Ended::Probed(probed) => {
            let (outcome, message) = match (&probed.failed, &probed.refused) {
                (Some(why), _) => (Outcome::Failed, why.clone()),
                (None, Some(why)) => (Outcome::Refused, why.clone()),
                (None, None) if probed.stopped && probed.frames == 0 => (Outcome::Capped, too_slow(limit)),
                (None, None) if probed.stopped => (Outcome::Capped, stopped(&probed, limit)),
                (None, None) => match probed.troubles.iter().find(is_new) {
                    Some(trouble) => (Outcome::Capped, trouble.text.clone()),
                    None => (Outcome::Finite, figures(&probed)),
                },
            };
            (outcome, message, probed)
        }
    };
    Row { key: key.into(), value: value.into(), outcome, message, probed, is_read: true }
}

fn figures(probed: &Probed) -> String {
    format!("largest coordinate {} m, {} ms a frame", brief(probed.largest), brief(probed.ms))
}

fn stopped(probed: &Probed, limit: Duration) -> String {
    let s = if probed.frames == 1 { "" } else { "s" };
    format!("{} frame{s} in {} s, all finite; then stopped", probed.frames, brief(limit.as_secs_f64()))
}

fn too_slow(limit: Duration) -> String {
    format!("no frame cooked within {} s; set a longer --limit", brief(limit.as_secs_f64()))
}

/// The param and its value as the table shows them.
fn shown(key: &str, value: &str) -> String {
    let whole = format!("{key} = {value}");
    if whole.chars().count() <= LONGEST {
        return whole;
    }
    format!("{}…", whole.chars().take(LONGEST - 1).collect::<String>())
}

fn print(args: &StudyArgs, what: &str, width: usize, row: &Row) -> Result<(), Failure> {
    let message = row.message.replace('\n', " ");
    let outcome = if row.is_read { row.outcome.name() } else { "-" };
    let line = format!("{what:<width$}  {outcome:<7}  {message}");
    match args.json.as_ref().is_some_and(|path| is_stdout(path)) {
        true => crate::say!("{line}"),
        false => std::io::stdout().write_all(format!("{line}\n").as_bytes())?,
    }
    Ok(())
}

fn write_json(args: &StudyArgs, graph: &Graph, request: &Request, base: &Row, rows: &[Row]) -> Result<(), Failure> {
    let Some(path) = &args.json else { return Ok(()) };
    let text = format!("{:#}\n", to_json(&load::graph_name(&args.graph), graph, request, base, rows));
    match is_stdout(path) {
        true => std::io::stdout().write_all(text.as_bytes())?,
        false => write_whole(path, text.as_bytes())?,
    }
    Ok(())
}

fn to_json(name: &str, graph: &Graph, request: &Request, base: &Row, rows: &[Row]) -> Value {
    let of = |row: &Row| {
        let done = matches!(row.outcome, Outcome::Finite | Outcome::Capped) && row.probed.frames > 0;
        json!({
            "outcome": row.outcome.name().to_lowercase(), "message": row.message, "frames": row.probed.frames,
            "largest": done.then_some(row.probed.largest), "ms": done.then_some(row.probed.ms),
        })
    };
    let row = |row: &Row| {
        let mut value = of(row);
        value["param"] = json!(row.key);
        value["value"] = super::knobs::to_json(&row.value);
        value
    };
    json!({
        "extremes": 1, "graph": name,
        "outputs": request.outputs.iter().map(|output| &*graph.outputs[*output].name).collect::<Vec<_>>(),
        "frames": request.frames.iter().map(|frame| frame.to_json()).collect::<Vec<_>>(),
        "as_it_is": of(base), "rows": rows.iter().map(row).collect::<Vec<_>>(),
    })
}

fn interrupted(rows: usize) -> Failure {
    Failure::new(Exit::Interrupted, format!("interrupted after {rows} values"))
}

fn verdict(args: &StudyArgs, rows: &[Row]) -> Result<(), Failure> {
    let count = |outcome: Outcome| rows.iter().filter(|row| row.outcome == outcome && row.is_read).count();
    if !args.quiet {
        let unread = match rows.iter().filter(|row| !row.is_read).count() {
            0 => String::new(),
            unread => format!(", {unread} not read"),
        };
        crate::say!(
            "{} values: {} finite, {} refused, {} capped{unread}",
            rows.len(),
            count(Outcome::Finite),
            count(Outcome::Refused),
            count(Outcome::Capped)
        );
    }
    match count(Outcome::Failed) {
        0 => Ok(()),
        failed => Err(Failure::new(
            Exit::Cook,
            format!(
                "{failed} of {} values failed; this is a bug in convect, please report it with the graph",
                rows.len()
            ),
        )),
    }
}
