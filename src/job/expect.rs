//! `explain --job`: how a cook would be cut, and how long its job is expected to take on several machines.
//!
//! What a node's cook takes is known from the report of an earlier cook. How often it cooks in a task is counted by
//! rehearsing the first, the second and the last task of each step; the others are like the second.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use engine::cook::{Engine, Report};
use engine::frames::FrameSet;
use engine::graph::Graph;
use engine::plan::Request;
use formats::atomic::FileError;
use serde_json::{Value, json};

use super::cut::{Cut, Step, ancestors};
use crate::failure::{Exit, Failure, exit_of_error};

/// Seconds that a task takes on a machine of a farm before it cooks and after: queue, start, files over the network.
const START: f64 = 2.0;

/// What an earlier cook's report says of times.
struct Times {
    /// Seconds of a cook of each node; `None` where the report does not have any.
    nodes: Vec<Option<f64>>,
    /// Seconds that writing a frame of all outputs takes.
    writing: f64,
}

/// What is expected of a job.
pub(crate) struct Expected {
    cut: Cut,
    /// Seconds of each task of each step; empty without times.
    tasks: Vec<Vec<f64>>,
    /// Seconds of one cook of the whole, without a farm.
    alone: f64,
    /// Machines, and the seconds that the job takes on them.
    machines: Vec<(usize, f64)>,
    /// Nodes of which the report has no times.
    unknown: Vec<String>,
}

impl Expected {
    /// Cuts the graph, of which `plan` is the plan, and estimates times from a report, if one is given.
    ///
    /// # Errors
    /// If the report cannot be read, or the plan of a task fails.
    pub(crate) fn of(
        engine: &Engine,
        (graph, plan): (&Graph, &Report),
        chunk: Option<i64>,
        machines: &[usize],
        report: Option<&Path>,
    ) -> Result<Self, Failure> {
        let cut = Cut::of(graph, plan, (graph.scene.first, graph.scene.last), chunk);
        let mut expected = Self { cut, tasks: Vec::new(), alone: 0.0, machines: Vec::new(), unknown: Vec::new() };
        let Some(report) = report else { return Ok(expected) };
        let times = Times::of(report, graph)?;
        let all: Vec<usize> = (0..graph.outputs.len()).collect();
        expected.alone = times.seconds(&rehearsed(engine, graph, &all, expected.cut.frames)?, &|_| true)
            + times.writing * (expected.cut.frames.1 - expected.cut.frames.0 + 1) as f64;
        for step in &expected.cut.steps {
            expected.tasks.push(times.tasks(engine, graph, step)?);
        }
        expected.machines = machines.iter().map(|count| (*count, expected.makespan(*count))).collect();
        let unknown = plan.nodes.iter().zip(&times.nodes).filter(|(node, time)| node.needed && time.is_none());
        expected.unknown = unknown.filter_map(|(node, _)| Some(node.id.as_ref()?.to_string())).collect();
        Ok(expected)
    }

    /// When the last task ends if each machine takes the longest task that is ready, and the merge comes last.
    fn makespan(&self, machines: usize) -> f64 {
        let mut free = vec![0.0_f64; machines.max(1)];
        let mut ends = vec![0.0_f64; self.tasks.len()];
        // A step comes behind those that it depends on.
        let mut waiting: Vec<(usize, f64)> = Vec::new();
        for (at, tasks) in self.tasks.iter().enumerate() {
            waiting.extend(tasks.iter().map(|seconds| (at, *seconds)));
        }
        waiting.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut left: Vec<usize> = self.tasks.iter().map(Vec::len).collect();
        while !waiting.is_empty() {
            let machine = (0..free.len()).min_by(|a, b| free[*a].total_cmp(&free[*b])).unwrap_or(0);
            // When a task can start: once the step before it has ended, if all of that is under way.
            let start = |(step, _): &(usize, f64)| match self.cut.steps[*step].after {
                Some(before) if left[before] > 0 => f64::INFINITY,
                Some(before) => ends[before].max(free[machine]),
                None => free[machine],
            };
            let first = waiting.iter().map(start).fold(f64::INFINITY, f64::min);
            let Some(next) = waiting.iter().position(|task| start(task) <= first) else { break };
            let (step, seconds) = waiting.remove(next);
            free[machine] = first + seconds;
            ends[step] = ends[step].max(free[machine]);
            left[step] -= 1;
        }
        ends.iter().copied().fold(0.0, f64::max) + START
    }

    /// For people.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for (at, step) in self.cut.steps.iter().enumerate() {
            let what = if step.nodes.is_empty() { step.outputs.join(", ") } else { step.nodes.join(", ") };
            let (first, last) = step.parts[0];
            let count = step.parts.len();
            let s = if count == 1 { "" } else { "s" };
            let _ = write!(text, "step {}: {what} in {count} task{s} of {} frames", step.name, last - first + 1);
            if let Some(longest) = self.tasks.get(at).and_then(|tasks| tasks.iter().copied().reduce(f64::max)) {
                let _ = write!(text, ", {longest:.1} s each at most");
            }
            let after = step.after.map(|before| format!(", after {}", self.cut.steps[before].name));
            let _ = writeln!(text, "{}", after.unwrap_or_default());
        }
        self.cut.notes.iter().for_each(|note| {
            let _ = writeln!(text, "note: {note}");
        });
        if self.tasks.is_empty() {
            text += "for the expected time give --times the report of a cook\n";
            return text;
        }
        let _ = writeln!(text, "without a farm {:.1} s", self.alone);
        for (count, seconds) in &self.machines {
            let s = if *count == 1 { "" } else { "s" };
            let _ = writeln!(text, "{count} machine{s} {seconds:.1} s, {:.1} times as fast", self.alone / seconds);
        }
        let _ = writeln!(text, "each task is taken to wait, start and copy for {START} s");
        if !self.unknown.is_empty() {
            let _ = writeln!(text, "the report has no times of {}", self.unknown.join(", "));
        }
        text
    }

    /// For programs.
    pub(crate) fn to_json(&self) -> Value {
        let steps: Vec<Value> = self
            .cut
            .steps
            .iter()
            .enumerate()
            .map(|(at, step)| {
                json!({
                    "name": step.name, "outputs": step.outputs, "nodes": step.nodes, "parts": step.labels(),
                    "after": step.after.map(|before| self.cut.steps[before].name.clone()), "seconds": self.tasks.get(at),
                })
            })
            .collect();
        let machines: Vec<Value> =
            self.machines.iter().map(|(count, seconds)| json!({"machines": count, "seconds": seconds})).collect();
        let alone = (!self.tasks.is_empty()).then_some(self.alone);
        json!({"steps": steps, "notes": self.cut.notes, "seconds_alone": alone, "machines": machines})
    }
}

impl Times {
    fn of(path: &Path, graph: &Graph) -> Result<Self, Failure> {
        let text = fs::read_to_string(path);
        let text = text.map_err(|error| Failure::file(FileError::new(path, "read", error).to_string()))?;
        let report: Value = serde_json::from_str(&text).unwrap_or_default();
        if report["report"] != json!(1) {
            return Err(Failure::file(format!(
                "`{}` is not a report; `convect cook GRAPH --report FILE` writes one",
                path.display()
            )));
        }
        let time = |id: &str| {
            let node = &report["nodes"][id];
            let cooks = node["cooks"].as_f64().filter(|cooks| *cooks > 0.0)?;
            Some(node["wall_ms"].as_f64()? / cooks / 1e3)
        };
        let frames = report["frames"].as_array().map_or(1, Vec::len).max(1) as f64;
        let writing = report["total"]["writing_ms"].as_f64().unwrap_or_default() / frames / 1e3;
        Ok(Self { nodes: graph.nodes.iter().map(|node| time(&node.id)).collect(), writing })
    }

    /// Seconds that the cooks of a plan take, of the nodes that count.
    fn seconds(&self, plan: &Report, counts: &dyn Fn(usize) -> bool) -> f64 {
        let nodes = plan.nodes.iter().zip(&self.nodes).enumerate().filter(|(node, _)| counts(*node));
        nodes.map(|(_, (node, time))| node.cooks as f64 * time.unwrap_or_default()).sum()
    }

    /// Seconds of each task of a step.
    fn tasks(&self, engine: &Engine, graph: &Graph, step: &Step) -> Result<Vec<f64>, Failure> {
        let is_of = |output: &usize| step.outputs.iter().any(|name| graph.outputs[*output].file() == *name);
        let outputs: Vec<usize> = (0..graph.outputs.len()).filter(is_of).collect();
        let from = outputs.iter().flat_map(|output| ancestors(graph, graph.outputs[*output].from.node));
        let plan_of = |part: (i64, i64)| rehearsed(engine, graph, &outputs, part);
        // A task behind a solver reads what comes before it from the cache.
        let is_solver = |plan: &Report, node: &usize| plan.nodes[*node].time == "solver";
        let all: BTreeSet<usize> = from.collect();
        let seconds = |part: (i64, i64)| -> Result<f64, Failure> {
            let plan = plan_of(part)?;
            let solvers = all.iter().copied().filter(|node| is_solver(&plan, node));
            let solved: BTreeSet<usize> = solvers.flat_map(|node| ancestors(graph, node)).collect();
            let cooking = match (step.nodes.is_empty(), step.after) {
                (false, _) => self.seconds(&plan, &|node| solved.contains(&node)),
                (true, Some(_)) => self.seconds(&plan, &|node| !solved.contains(&node)),
                (true, None) => self.seconds(&plan, &|_| true),
            };
            let share = outputs.len() as f64 / graph.outputs.len().max(1) as f64;
            let writing = if step.nodes.is_empty() { self.writing * share * (part.1 - part.0 + 1) as f64 } else { 0.0 };
            Ok(START + cooking + writing)
        };
        let last = step.parts.len() - 1;
        let mut tasks = Vec::with_capacity(step.parts.len());
        for (at, part) in step.parts.iter().enumerate() {
            let like = if at > 1 && at < last { Some(tasks[1]) } else { None };
            tasks.push(like.map_or_else(|| seconds(*part), Ok)?);
        }
        Ok(tasks)
    }
}

fn rehearsed(engine: &Engine, graph: &Graph, outputs: &[usize], part: (i64, i64)) -> Result<Report, Failure> {
    let request = Request { outputs: outputs.to_vec(), frames: FrameSet::whole(part.0, part.1) };
    let report = engine.rehearse(graph, &request);
    report.map_err(|error| Failure::new(exit_of_error(&error), error.to_string()))
}

/// Numbers of machines: `1,10,100`.
///
/// # Errors
/// If one is not a number above 0.
pub(crate) fn machines(text: &str) -> Result<Vec<usize>, Failure> {
    let count = |word: &str| word.trim().parse().ok().filter(|count| (1..=100_000).contains(count));
    let counts: Option<Vec<usize>> = text.split(',').map(count).collect();
    counts.ok_or_else(|| {
        Failure::new(Exit::CommandLine, format!("`{text}` is not a list of numbers of machines; write 1,10,100"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(after: Option<usize>) -> Step {
        Step { name: "s".into(), outputs: Vec::new(), nodes: Vec::new(), parts: vec![(1, 2)], after }
    }

    #[test]
    fn machines_take_the_longest_task_that_is_ready() {
        // 10 s, then four tasks of 3 s behind it; and three tasks of 4 s beside them.
        let cut = Cut { frames: (1, 2), steps: vec![step(None), step(Some(0)), step(None)], notes: Vec::new() };
        let tasks = vec![vec![10.0], vec![3.0; 4], vec![4.0; 3]];
        let job = Expected { cut, tasks, alone: 0.0, machines: Vec::new(), unknown: Vec::new() };
        assert_eq!(job.makespan(1), 34.0 + START);
        // One machine: 10, 3, 3 or 4, …; two: 10 + 3 + 3 beside 4 + 4 + 4 + 3.
        assert_eq!(job.makespan(2), 18.0 + START);
        // The solver, then all parts at once.
        assert_eq!(job.makespan(100), 13.0 + START);
    }

    #[test]
    fn numbers_of_machines_are_listed() {
        assert_eq!(machines("1, 10,100").unwrap(), [1, 10, 100]);
        assert!(machines("0").is_err() && machines("").is_err() && machines("ten").is_err());
    }
}
