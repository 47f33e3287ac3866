//! Cases: a folder's files, and the commands that are run there one after the other.

use super::dice::Dice;
use super::stock::Stock;
use super::{file_cases, graph_cases, kill_cases};

/// One case, made from a seed.
pub(crate) struct Case {
    pub(crate) kind: &'static str,
    /// Files by their path in the folder; every one must keep its bytes.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// Symbolic links: path and target.
    pub(crate) links: Vec<(&'static str, String)>,
    /// Pipes that nobody writes to.
    pub(crate) pipes: Vec<&'static str>,
    pub(crate) steps: Vec<Step>,
}

/// What is done in the folder.
pub(crate) enum Step {
    /// One call, or several at once.
    Calls(Vec<Call>),
    /// Some files below a folder are damaged.
    Damage(&'static str, u64),
    /// The last cooks into two folders must end alike and write the same files, unless one of them was stopped.
    Same(&'static str, &'static str),
}

/// One run of the program.
#[derive(Clone, Default)]
pub(crate) struct Call {
    pub(crate) args: Vec<String>,
    /// The file that is stdin.
    pub(crate) stdin: Option<&'static str>,
    /// Whether stdout is `/dev/full`.
    pub(crate) full_stdout: bool,
    /// The largest file it may write, in blocks of 512 bytes.
    pub(crate) blocks: Option<u64>,
    /// A signal, and after how many milliseconds it is sent.
    pub(crate) signal: Option<(&'static str, u64)>,
    /// Whether the command is in order, so that only code 0 is right.
    pub(crate) succeeds: bool,
}

impl Call {
    pub(crate) fn new(args: &[&str]) -> Self {
        Self { args: args.iter().map(|arg| (*arg).to_owned()).collect(), ..Self::default() }
    }

    pub(crate) fn and(mut self, args: &[&str]) -> Self {
        self.args.extend(args.iter().map(|arg| (*arg).to_owned()));
        self
    }
}

pub(crate) const FORMATS: [&str; 5] = ["usdc", "usda", "obj", "ply", "json"];

impl Case {
    /// The case of `seed`.
    pub(crate) fn of(seed: u64, stock: &Stock) -> Self {
        let mut dice = Dice::new(seed);
        let dice = &mut dice;
        match dice.below(20) {
            0..4 => graph_cases::mutated(stock, dice),
            4..8 => graph_cases::generated(stock, dice),
            8 => graph_cases::settings(stock, dice),
            9 => graph_cases::looked_at(stock, dice),
            10..12 => file_cases::damaged_geometry(stock, dice),
            12 => file_cases::odd_inputs(stock, dice),
            13 => file_cases::folders(stock, dice),
            14..16 => file_cases::colliding_targets(stock, dice),
            16 => graph_cases::command_line(stock, dice),
            17 => file_cases::no_room(stock, dice),
            _ => kill_cases::killed(stock, dice),
        }
    }

    pub(crate) fn new(kind: &'static str, graph: &str, stock: &Stock) -> Self {
        let mut files = vec![("g.json".to_owned(), graph.as_bytes().to_vec())];
        for (name, bytes) in &stock.files {
            // Every case has the small ones, so that mutated names find something.
            if bytes.len() < 2000 || graph.contains(name.as_str()) {
                files.push((format!("in/{name}"), bytes.clone()));
            }
        }
        Self { kind, files, links: Vec::new(), pipes: Vec::new(), steps: Vec::new() }
    }

    pub(crate) fn call(mut self, call: Call) -> Self {
        self.steps.push(Step::Calls(vec![call]));
        self
    }
}

/// A cook of the case's graph into the folder `out`.
pub(crate) fn cook(format: &str, out: &str) -> Call {
    Call::new(&["cook", "g.json", "--out", out, "--format", format])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::stock::{NodeType, Param};
    use crate::torture::values::text_of;
    use serde_json::json;

    fn stock() -> Stock {
        let param = Param { name: "file".into(), kind: "a path".into(), ..Param::default() };
        let types = vec![NodeType { name: "Mesh_In".into(), params: vec![param], ..NodeType::default() }];
        let graph = json!({"convect": 1, "scene": {"frames": [3, 4]}, "nodes": {"a": {"type": "Mesh_In", "params": {"file": "in/large.obj"}}},
            "outputs": {"o": "a"}});
        let files = vec![("a.obj".into(), b"v 0 0 0\n".to_vec()), ("large.obj".into(), b"v 0 0 0\n".repeat(1000))];
        Stock { graphs: vec![graph], files, types }
    }

    #[test]
    fn every_kind_appears_and_every_case_calls_the_program() {
        let kinds: std::collections::BTreeSet<&str> = (0..300)
            .map(|seed| {
                let case = Case::of(seed, &stock());
                assert!(case.steps.iter().any(|step| matches!(step, Step::Calls(_))), "{seed}");
                case.kind
            })
            .collect();
        assert_eq!(kinds.len(), 11, "{kinds:?}");
    }

    #[test]
    fn a_case_has_the_files_that_its_graph_names() {
        let case = Case::new("graph", &text_of(&stock().graphs[0]), &stock());
        assert_eq!(
            case.files.iter().map(|(path, _)| &path[..]).collect::<Vec<_>>(),
            ["g.json", "in/a.obj", "in/large.obj"]
        );
        assert_eq!(Case::new("graph", "{}", &stock()).files.len(), 2);
    }
}
