//! Where a cook is cut.

use std::collections::BTreeSet;

use engine::cook::Report;
use engine::graph::Graph;

use crate::output::by_file;

/// Frames that are planned; whether a node varies is known from them.
pub(super) const PLANNED: usize = 1000;

/// Parts of a step: engines take about a thousand tasks in one list.
const MOST_PARTS: i64 = 1000;

/// Frames of a part, if nothing asks for more.
const USUAL: i64 = 16;

/// Tasks that cook the same in different frames.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    pub(super) name: String,
    pub(super) outputs: Vec<String>,
    /// Nodes that are cooked into the cache instead of the outputs, for the steps behind.
    pub(super) nodes: Vec<String>,
    /// First and last frame of each task.
    pub(super) parts: Vec<(i64, i64)>,
    /// Position of the step that must be done before; `None`: none.
    pub(super) after: Option<usize>,
}

impl Step {
    /// The parts as `--part` reads them.
    pub(super) fn labels(&self) -> Vec<String> {
        self.parts.iter().map(|(first, last)| format!("{first}-{last}")).collect()
    }
}

/// The steps of a job, each behind those that it depends on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cut {
    pub(super) frames: (i64, i64),
    pub(super) steps: Vec<Step>,
    pub(super) notes: Vec<String>,
}

/// Outputs that have solvers in common, or none.
#[derive(Default)]
struct Group {
    solvers: BTreeSet<usize>,
    outputs: Vec<usize>,
    /// The longest of the windows that can be cut, and the frames between their starts.
    window: (i64, i64),
    /// Whether other nodes come after the solvers.
    goes_on: bool,
}

impl Group {
    fn joins(&mut self, other: Self) {
        self.solvers.extend(other.solvers);
        self.outputs.extend(other.outputs);
        self.outputs.sort_unstable();
        self.window = (self.window.0.max(other.window.0), self.window.1.max(other.window.1));
        self.goes_on |= other.goes_on;
    }
}

impl Cut {
    /// Cuts frames of a graph, of which `report` is the plan, into parts of `chunk` frames.
    pub(super) fn of(graph: &Graph, report: &Report, frames: (i64, i64), chunk: Option<i64>) -> Self {
        let mut cut = Self { frames, steps: Vec::new(), notes: Vec::new() };
        let (still, groups) = groups(graph, report);
        let names = |outputs: &[usize]| {
            by_file(graph, outputs).iter().map(|outputs| graph.outputs[outputs[0]].file().to_owned()).collect()
        };
        let whole = |name: String, outputs: &[usize]| Step {
            name,
            outputs: names(outputs),
            nodes: Vec::new(),
            parts: vec![frames],
            after: None,
        };
        let (cut_up, solved): (Vec<Group>, Vec<Group>) =
            groups.into_iter().partition(|group| group.solvers.is_empty() || group.goes_on);
        let ids = |group: &Group| group.solvers.iter().map(|node| graph.nodes[*node].id.to_string()).collect();
        for group in solved {
            let ids: Vec<String> = ids(&group);
            cut.steps.push(whole(format!("solve-{}", ids.join("-")), &group.outputs));
        }
        if !still.is_empty() {
            cut.steps.push(whole("still".into(), &still));
        }
        for group in cut_up {
            let parts = cut.parts(group.window, chunk);
            let ids: Vec<String> = ids(&group);
            let (mut name, mut after) = ("frames".to_owned(), None);
            if !ids.is_empty() {
                // The same outputs are asked, because what of a solver's results is used is a part of their keys.
                name = format!("after-{}", ids.join("-"));
                after = Some(cut.steps.len());
                let solve = whole(format!("solve-{}", ids.join("-")), &group.outputs);
                cut.steps.push(Step { nodes: ids, ..solve });
            }
            cut.steps.push(Step { name, outputs: names(&group.outputs), nodes: Vec::new(), parts, after });
        }
        cut
    }

    /// Parts of all frames, for nodes whose longest window and spacing of windows are `window`.
    fn parts(&mut self, (longest, spacing): (i64, i64), chunk: Option<i64>) -> Vec<(i64, i64)> {
        let (first, last) = self.frames;
        let all = last - first + 1;
        let usual = USUAL.max(longest).max(div_ceil(all, MOST_PARTS));
        let spacing = spacing.max(1);
        let length = chunk.unwrap_or(div_ceil(usual, spacing) * spacing);
        if length < longest {
            self.notes.push(format!(
                "parts of {length} frames are shorter than a window of {longest}: each part warms it up, so that windows \
                 take about {:.1} times as many steps; `--chunk {}` does not",
                (length + longest) as f64 / length as f64,
                div_ceil(longest, spacing) * spacing
            ));
        }
        if div_ceil(all, length) > MOST_PARTS {
            self.notes.push(format!("{} parts are more than some engines take; raise --chunk", div_ceil(all, length)));
        }
        let starts = (0..div_ceil(all, length)).map(|part| first + part * length);
        starts.map(|start| (start, (start + length - 1).min(last))).collect()
    }
}

/// Outputs that do not vary; and the others by the solvers that they depend on. Those in one file stay together.
fn groups(graph: &Graph, report: &Report) -> (Vec<usize>, Vec<Group>) {
    let (mut still, mut groups): (Vec<usize>, Vec<Group>) = (Vec::new(), Vec::new());
    let all: Vec<usize> = (0..graph.outputs.len()).collect();
    let is_solver = |node: usize| report.nodes[node].time == "solver";
    for outputs in by_file(graph, &all) {
        let from: Vec<usize> = outputs.iter().map(|output| graph.outputs[*output].from.node).collect();
        if !from.iter().any(|node| report.nodes[*node].varies) {
            still.extend(outputs);
            continue;
        }
        let mut group = Group { outputs, ..Group::default() };
        for node in &from {
            let above = ancestors(graph, *node);
            group.solvers.extend(above.iter().copied().filter(|node| is_solver(*node)));
            for window in above.iter().filter_map(|node| report.nodes[*node].window) {
                group.window = (group.window.0.max(window.frames), group.window.1.max(window.every));
            }
        }
        let is_cut = |node: &usize| report.nodes[*node].varies && !is_solver(*node);
        group.goes_on = !group.solvers.is_empty() && from.iter().any(is_cut);
        // Outputs that share a solver are cooked together, so that it runs once.
        let together = |other: &Group| {
            !other.solvers.is_disjoint(&group.solvers) || (other.solvers.is_empty() && group.solvers.is_empty())
        };
        let (joined, apart): (Vec<Group>, Vec<Group>) = groups.into_iter().partition(together);
        joined.into_iter().for_each(|other| group.joins(other));
        groups = apart;
        groups.push(group);
    }
    (still, groups)
}

/// `a` ÷ `b`, rounded up; both are above 0.
fn div_ceil(a: i64, b: i64) -> i64 {
    (a + b - 1) / b
}

/// A node and all that it depends on.
pub(super) fn ancestors(graph: &Graph, node: usize) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    let mut open = vec![node];
    while let Some(node) = open.pop() {
        if found.insert(node) {
            open.extend(graph.nodes[node].inputs().iter().flatten().map(|link| link.node));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(window: (i64, i64), frames: (i64, i64), chunk: Option<i64>) -> (Vec<(i64, i64)>, Vec<String>) {
        let mut cut = Cut { frames, steps: Vec::new(), notes: Vec::new() };
        (cut.parts(window, chunk), cut.notes)
    }

    #[test]
    fn parts_are_as_long_as_windows_and_start_with_them() {
        assert_eq!(cut((0, 1), (1, 40), None).0, [(1, 16), (17, 32), (33, 40)]);
        assert_eq!(cut((20, 20), (1, 48), None).0, [(1, 20), (21, 40), (41, 48)]);
        assert_eq!(cut((20, 8), (0, 48), None).0, [(0, 23), (24, 47), (48, 48)]);
        let (parts, notes) = cut((20, 20), (1, 20), Some(10));
        assert_eq!((parts, notes.len()), (vec![(1, 10), (11, 20)], 1));
        assert!(notes[0].contains("about 3.0 times as many steps; `--chunk 20` does not"), "{}", notes[0]);
    }

    #[test]
    fn long_scenes_have_a_thousand_parts_at_most() {
        let (parts, notes) = cut((0, 1), (1, 100_000), None);
        assert_eq!((parts.len(), parts[0], notes.len()), (1000, (1, 100), 0));
        assert_eq!(
            cut((0, 1), (1, 100_000), Some(10)).1,
            ["10000 parts are more than some engines take; raise --chunk"]
        );
    }
}
