//! `convect explain`: the plan of a cook, without cooking.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use engine::cook::NodeReport;
use engine::frames::FrameSet;
use engine::graph::{Graph, GraphNode, Link};
use engine::plan::{Request, Window};
use engine::time::Frame;
use serde_json::{Value, json};

use crate::args::{Frames, Setting};
use crate::failure::{Exit, Failure, exit_of_error};
use crate::job::expect;
use crate::report::why_not_needed;
use crate::{load, memory};

/// The arguments of `explain`.
#[derive(Debug, clap::Args)]
pub struct ExplainArgs {
    /// The graph file; - reads it from stdin
    graph: PathBuf,
    /// Frames to plan: 1-48, 1-48x2 (every second), 10, 10.5, 1- (to the scene's end), or a list: 1-4,10 [default: the scene's frames]
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// Explain only this output; repeatable
    #[arg(long = "output", value_name = "NAME")]
    outputs: Vec<String>,
    /// Override a param (node.param=VALUE) or a control (name=VALUE): JSON or a bare word, such as wind.noise=billow; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Setting>,
    /// Explain how `convect job` would cut the cook, instead of the plan
    #[arg(long, conflicts_with_all = ["frames", "outputs"])]
    job: bool,
    /// Number of frames per part [default: as `convect job` chooses]
    #[arg(long, value_name = "N", requires = "job", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    chunk: Option<u32>,
    /// The report of a cook of some or all frames of this graph, from whose times the job's duration is estimated
    #[arg(long, value_name = "REPORT", requires = "job")]
    times: Option<PathBuf>,
    /// Estimate for these numbers of machines
    #[arg(long, value_name = "N,…", requires = "job", default_value = "1,10,100")]
    machines: String,
    /// Print the plan as JSON
    #[arg(long)]
    json: bool,
}

/// Of a request with more frames, only these are planned, so that the answer comes at once.
const MOST_FRAMES: usize = 10_000;

/// Frames farther from frame 0 or the scene's first are not planned where anything depends on frames before: a plan goes
/// through all of these.
const FARTHEST: f64 = 1e6;

/// Prints the plan.
///
/// # Errors
/// If the graph has faults.
pub fn run(args: &ExplainArgs) -> Result<(), Failure> {
    let engine = load::engine(0, memory::ceiling(None))?;
    let graph = load::graph(&args.graph, &args.set)?.map_err(|faults| load::faulty(&args.graph, &faults))?;
    let request = Request {
        outputs: load::outputs(&graph, &args.outputs)?,
        frames: Frames::of_scene(args.frames.as_ref(), &graph.scene)?,
    };
    let planned = Request { frames: request.frames.iter().take(MOST_FRAMES).collect(), ..request.clone() };
    within_reach(&planned.frames, &graph)?;
    let rehearsed = engine.rehearse(&graph, &planned);
    let report = rehearsed.map_err(|error| Failure::new(exit_of_error(&error), error.to_string()))?;
    if args.job {
        let machines = expect::machines(&args.machines)?;
        let (chunk, times) = (args.chunk.map(i64::from), args.times.as_deref());
        let job = expect::Expected::of(&engine, (&graph, &report), chunk, &machines, times)?;
        let text = match args.json {
            true => serde_json::to_string_pretty(&job.to_json()).unwrap_or_default() + "\n",
            false => job.text(),
        };
        return Ok(std::io::stdout().write_all(text.as_bytes())?);
    }
    let text = match args.json {
        true => {
            let nodes: Vec<Value> = report
                .nodes
                .iter()
                .zip(&graph.nodes)
                .map(|(report, node)| to_json(report, &inputs(node, &graph)))
                .collect();
            let plan = json!({"frames": request.frames.len(), "planned_frames": planned.frames.len(), "nodes": nodes});
            serde_json::to_string_pretty(&plan).unwrap_or_default() + "\n"
        }
        false => {
            let (all, frames) = (request.frames.len(), planned.frames.len());
            let mut text = match all {
                1 => "1 frame\n".to_owned(),
                _ if all > frames => format!("{all} frames, of which the first {frames} are planned\n"),
                _ => format!("{all} frames\n"),
            };
            report.nodes.iter().for_each(|node| describe(node, frames, &mut text));
            text
        }
    };
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

/// Refuses frames with a history too long to be gone through at once.
fn within_reach(frames: &FrameSet, graph: &Graph) -> Result<(), Failure> {
    let first = graph.scene.first as f64;
    let history = |frame: Frame| (frame.number() - first).abs().max(frame.number().abs());
    let mut ends = [frames.first(), frames.last()].into_iter().flatten();
    let Some(frame) = ends.rfind(|frame| history(*frame) > FARTHEST) else { return Ok(()) };
    if graph.nodes.iter().all(|node| node.node().is_none_or(|declared| declared.cook.word() == "pure")) {
        return Ok(());
    }
    let line = format!(
        "frame {frame} is {} frames away from frame 0 or the start of the scene, and `explain` would go through all of \
         them; ask for --frames within {FARTHEST}",
        history(frame)
    );
    Err(Failure::new(Exit::CommandLine, line))
}

fn describe(node: &NodeReport, frames: usize, text: &mut String) {
    let id = node.id.as_deref().unwrap_or_default();
    let _ = write!(text, "{id:<16} {:<22} {:<7}", node.type_name, node.time);
    if !node.needed {
        let _ = writeln!(text, "left out: {}", why_not_needed(node));
        return;
    }
    let _ = match (node.varies, node.cooks) {
        (false, 1) if frames > 1 => writeln!(text, "cooked once, the same at all frames"),
        (_, 1) => writeln!(text, "cooked once"),
        (_, n) => match node.window {
            Some(Window { frames: back, every }) => {
                writeln!(text, "{n} steps for {frames} frames: window of {back} frames, restarted every {every}")
            }
            None if node.time == "solver" => writeln!(text, "{n} steps"),
            None => writeln!(text, "cooked {n} times"),
        },
    };
    for line in &node.explained {
        let _ = writeln!(text, "{:<16} {line}", "");
    }
    for stage in &node.left_out {
        let _ = writeln!(text, "{:<16} left out {}: {}", "", stage.stage, stage.why);
    }
}

/// What each input of a node reads: `"id"`, or `"id.output"` of nodes with several outputs.
fn inputs(node: &GraphNode, graph: &Graph) -> Value {
    let name = |link: &Link| {
        let source = &graph.nodes[link.node];
        match source.node().map_or(&[][..], |declared| declared.outputs) {
            outputs @ [_, _, ..] => format!("{}.{}", source.id, outputs[link.port].name),
            _ => source.id.to_string(),
        }
    };
    let declared = node.node().map_or(&[][..], |declared| declared.inputs);
    let wired = declared.iter().zip(node.inputs()).filter(|(_, links)| !links.is_empty());
    let lists = wired.map(|(input, links)| (input.spec().name.to_owned(), links.iter().map(name).collect::<Value>()));
    Value::Object(lists.collect())
}

fn to_json(node: &NodeReport, inputs: &Value) -> Value {
    let left_out: Vec<Value> = match node.needed {
        true => node.left_out.iter().map(|stage| json!({"stage": stage.stage, "why": stage.why})).collect(),
        false => vec![json!({"stage": "all", "why": why_not_needed(node)})],
    };
    json!({
        "id": node.id.as_deref(), "type": node.type_name, "inputs": inputs, "time": node.time, "needed": node.needed,
        "varies": node.varies, "cooks": node.cooks, "left_out": left_out, "explained": node.explained,
        "window": node.window.map(|window| json!({"frames": window.frames, "every": window.every})),
    })
}
