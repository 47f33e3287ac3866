//! The parts of a graph file: which keys there are, and which there must be. What the parts say is read elsewhere.

use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json, did_you_mean, find, is_name, keep, refuse_unknown, shown};

/// The number of the format that is read.
const FORMAT: i64 = 1;

/// A graph file in parts.
pub(super) struct Document<'a> {
    pub(super) scene: Option<Json<'a>>,
    pub(super) controls: Vec<Entry<'a>>,
    pub(super) nodes: Vec<NodeText<'a>>,
    pub(super) outputs: Option<Json<'a>>,
}

/// A node in parts.
pub(super) struct NodeText<'a> {
    /// Its id and the whole of it.
    pub(super) entry: Entry<'a>,
    /// The value of its `type`, a text.
    pub(super) kind: Option<Json<'a>>,
    pub(super) inputs: Vec<Entry<'a>>,
    pub(super) params: Vec<Entry<'a>>,
}

/// The fault of an object that lacks a key.
pub(super) fn missing(json: &Json<'_>, key: &str, hint: &str) -> Fault {
    json.fault(code::MISSING_KEY, format!("the key `{key}` is missing")).hint(hint)
}

/// Puts a fault for a name that is not made as names are.
pub(super) fn check_name(entry: &Entry<'_>, what: &str, faults: &mut Vec<Fault>) {
    if !is_name(entry.name) {
        let fault = entry.fault(code::BAD_NAME, format!("`{}` cannot be the name of {what}", shown(entry.name)));
        faults.push(fault.hint("names are made of letters, digits, `_` and `-`, and start with a letter or `_`"));
    }
}

impl<'a> Document<'a> {
    /// The parts of the file whose whole value is `root`; `None` where it is not a graph of this format at all.
    pub(super) fn read(root: &Json<'a>, faults: &mut Vec<Fault>) -> Option<Self> {
        const KEYS: [&str; 6] = ["convect", "scene", "controls", "nodes", "outputs", "$schema"];
        let members = root.members("an object {\"convect\": 1, \"nodes\": {…}, \"outputs\": {…}}", faults);
        let entries = keep(members, faults)?;
        match find(&entries, "convect") {
            None => faults.push(missing(root, "convect", "a graph starts with \"convect\": 1")),
            Some(entry) => match entry.json.whole("the format number 1") {
                Ok(FORMAT) => {}
                Ok(number) => {
                    let fact = format!("the file has format {number}, this convect reads format {FORMAT}");
                    let fault = entry.json.fault(code::FORMAT, fact);
                    // Whatever else such a file says may mean something else.
                    faults.clear();
                    faults.push(match number > FORMAT {
                        true => fault.hint("a newer convect wrote it"),
                        false => fault.hint("write \"convect\": 1"),
                    });
                    return None;
                }
                Err(fault) => faults.push(fault),
            },
        }
        refuse_unknown(&entries, &KEYS, "keys of a graph", faults);

        let part = |name: &str| find(&entries, name).map(|entry| entry.json.clone());
        if let Some(schema) = part("$schema")
            && schema.string().is_none()
        {
            faults.push(schema.unexpected("a text"));
        }
        let controls = named(part("controls").as_ref(), "controls {\"name\": value, …}", "a control", faults);
        let nodes = part("nodes");
        if nodes.is_none() {
            faults.push(missing(root, "nodes", "nodes are written \"nodes\": {\"id\": {\"type\": \"…\"}, …}"));
        }
        let nodes = named(nodes.as_ref(), "nodes {\"id\": {\"type\": \"…\"}, …}", "a node", faults);
        let outputs = part("outputs");
        if outputs.is_none() {
            faults.push(missing(root, "outputs", "name what is to come out: \"outputs\": {\"name\": \"node\"}"));
        }
        let nodes = nodes.into_iter().map(|entry| NodeText::read(entry, faults)).collect();
        Some(Self { scene: part("scene"), controls, nodes, outputs })
    }

    /// Replaces or adds what a `--set` sets, whose key is its text's.
    pub(super) fn set(&mut self, value: Json<'a>, faults: &mut Vec<Fault>) {
        let key = value.text.set.unwrap_or_default();
        let Some((id, param)) = key.split_once('.') else {
            let path = format!("controls.{key}");
            return match self.controls.iter_mut().find(|control| control.name == key) {
                Some(control) => *control = Entry::of_set(control.name, value.at_path(&path)),
                None => {
                    let fault = value.fault(code::UNKNOWN_SET, format!("there is no control `{}`", shown(key)));
                    let names = self.controls.iter().map(|control| control.name);
                    let hint = match self.nodes.iter().any(|node| node.entry.name == key) {
                        true => Some(format!("a param of the node is set with `{key}.param=…`")),
                        false => did_you_mean(key, names, "controls"),
                    };
                    faults.push(Fault { hint, ..fault });
                }
            };
        };
        let Some(node) = self.nodes.iter_mut().find(|node| node.entry.name == id) else {
            let fault = value.fault(code::UNKNOWN_SET, format!("there is no node `{}`", shown(id)));
            let hint = did_you_mean(id, self.nodes.iter().map(|node| node.entry.name), "nodes");
            return faults.push(Fault { hint, ..fault });
        };
        let value = value.at_path(&format!("nodes.{id}.params.{param}"));
        match node.params.iter_mut().find(|entry| entry.name == param) {
            Some(entry) => *entry = Entry::of_set(param, value),
            None => node.params.push(Entry::of_set(param, value)),
        }
    }
}

/// The members of an object of things with names; none where it is absent or something else.
fn named<'a>(json: Option<&Json<'a>>, expected: &str, what: &str, faults: &mut Vec<Fault>) -> Vec<Entry<'a>> {
    let Some(members) = json.map(|json| json.members(expected, faults)) else { return Vec::new() };
    let entries = keep(members, faults).unwrap_or_default();
    entries.iter().for_each(|entry| check_name(entry, what, faults));
    entries
}

impl<'a> NodeText<'a> {
    fn read(entry: Entry<'a>, faults: &mut Vec<Fault>) -> Self {
        let members = entry.json.members("a node {\"type\": \"…\", \"inputs\": {…}, \"params\": {…}}", faults);
        let Some(entries) = keep(members, faults) else {
            return Self { entry, kind: None, inputs: Vec::new(), params: Vec::new() };
        };
        refuse_unknown(&entries, &["type", "inputs", "params"], "keys of a node", faults);
        let part = |name: &str| find(&entries, name).map(|entry| entry.json.clone());
        let kind = match part("type") {
            None => {
                faults.push(missing(&entry.json, "type", "`convect nodes` lists the types"));
                None
            }
            Some(kind) if kind.string().is_none() => {
                faults.push(kind.unexpected("the name of a node type"));
                None
            }
            kind => kind,
        };
        let mut members = |name: &str, expected: &str| {
            let members = part(name).map(|json| json.members(expected, faults));
            members.and_then(|members| keep(members, faults)).unwrap_or_default()
        };
        let inputs = members("inputs", "inputs {\"name\": \"node\", …}");
        let params = members("params", "params {\"name\": value, …}");
        Self { entry, kind, inputs, params }
    }
}
