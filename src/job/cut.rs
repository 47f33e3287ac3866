//! Where a cook is cut.

use std::collections::BTreeSet;

use engine::cook::Report;
use engine::graph::Graph;

/// Frames that are planned; whether a node varies is known from them.
pub(super) const PLANNED: usize = 1000;

/// Parts of a step: engines take about a thousand tasks in one list.
const MOST_PARTS: i64 = 1000;

/// Frames of a part, if nothing asks for more.
const USUAL: i64 = 16;

/// Outputs that are cooked together.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    pub(super) name: String,
    pub(super) outputs: Vec<String>,
    /// First and last frame of each task.
    pub(super) parts: Vec<(i64, i64)>,
}

impl Step {
    /// The parts as `--part` reads them.
    pub(super) fn labels(&self) -> Vec<String> {
        self.parts.iter().map(|(first, last)| format!("{first}-{last}")).collect()
    }
}

/// The steps of a job, which do not depend on each other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cut {
    pub(super) frames: (i64, i64),
    pub(super) steps: Vec<Step>,
    pub(super) notes: Vec<String>,
}

impl Cut {
    /// Cuts a graph, of which `report` is the plan, into parts of `chunk` frames.
    pub(super) fn of(graph: &Graph, report: &Report, chunk: Option<i64>) -> Self {
        let frames = (graph.scene.first, graph.scene.last);
        let mut solved: Vec<(BTreeSet<usize>, Vec<String>)> = Vec::new();
        let (mut still, mut free) = (Vec::new(), Vec::new());
        let (mut longest, mut spacing) = (0, 1);
        for output in &graph.outputs {
            let above = ancestors(graph, output.from.node);
            let solvers: BTreeSet<usize> =
                above.iter().copied().filter(|node| report.nodes[*node].time == "solver").collect();
            let name = output.name.to_string();
            if !report.nodes[output.from.node].varies {
                still.push(name);
            } else if solvers.is_empty() {
                free.push(name);
                for window in above.iter().filter_map(|node| report.nodes[*node].window) {
                    longest = longest.max(window.frames);
                    spacing = spacing.max(window.every);
                }
            } else {
                // Outputs that share a solver are cooked together, so that it runs once.
                let (mut joined, mut names) = (solvers, vec![name]);
                solved.retain(|(others, also)| {
                    let apart = joined.is_disjoint(others);
                    if !apart {
                        joined.extend(others);
                        names.splice(0..0, also.iter().cloned());
                    }
                    apart
                });
                solved.push((joined, names));
            }
        }
        let mut notes = Vec::new();
        let all = frames.1 - frames.0 + 1;
        let usual = USUAL.max(longest).max(div_ceil(all, MOST_PARTS));
        let length = chunk.unwrap_or(div_ceil(usual, spacing) * spacing);
        if length < longest {
            notes.push(format!(
                "parts of {length} frames are shorter than a window of {longest}: each part warms it up, so that windows \
                 take about {:.1} times as many steps; `--chunk {}` does not",
                (length + longest) as f64 / length as f64,
                div_ceil(longest, spacing) * spacing
            ));
        }
        if div_ceil(all, length) > MOST_PARTS {
            notes.push(format!("{} parts are more than some engines take; raise --chunk", div_ceil(all, length)));
        }
        let mut steps = Vec::new();
        for (solvers, outputs) in solved {
            let ids: Vec<&str> = solvers.iter().map(|node| &*graph.nodes[*node].id).collect();
            steps.push(Step { name: format!("solve-{}", ids.join("-")), outputs, parts: vec![frames] });
        }
        if !still.is_empty() {
            steps.push(Step { name: "still".into(), outputs: still, parts: vec![frames] });
        }
        if !free.is_empty() {
            let starts = (0..div_ceil(all, length)).map(|part| frames.0 + part * length);
            let parts = starts.map(|start| (start, (start + length - 1).min(frames.1))).collect();
            steps.push(Step { name: "frames".into(), outputs: free, parts });
        }
        Self { frames, steps, notes }
    }
}

/// `a` ÷ `b`, rounded up; both are above 0.
fn div_ceil(a: i64, b: i64) -> i64 {
    (a + b - 1) / b
}

/// A node and all that it depends on.
fn ancestors(graph: &Graph, node: usize) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    let mut open = vec![node];
    while let Some(node) = open.pop() {
        if found.insert(node) {
            open.extend(graph.nodes[node].inputs().iter().flatten().map(|link| link.node));
        }
    }
    found
}
