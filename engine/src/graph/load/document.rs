//! The structure of a graph file: known and required keys. The values are read elsewhere.

use crate::graph::fault::{Fault, code};
use crate::graph::json::{
    Entry, Json, did_you_mean, find, is_misspelt, is_name, keep, member_path, refuse_unknown, shown,
};

/// The format number that this version reads.
const FORMAT: i64 = 1;

/// The parts of a graph file.
pub(super) struct Document<'a> {
    pub(super) scene: Option<Json<'a>>,
    pub(super) controls: Vec<Entry<'a>>,
    pub(super) nodes: Vec<NodeText<'a>>,
    /// Whether `nodes` is complete. It is not if the key is missing or its value is not an object.
    pub(super) nodes_are_known: bool,
    pub(super) outputs: Option<Json<'a>>,
}

/// The parts of a node. Of those that are dropped soon or rare, only the place is kept: a graph may have a million nodes.
pub(super) struct NodeText<'a> {
    /// Its id and its whole value.
    pub(super) entry: Entry<'a>,
    /// The value of its `type`, which may be of the wrong JSON type.
    pub(super) kind: Option<Box<Json<'a>>>,
    pub(super) inputs: Vec<Entry<'a>>,
    pub(super) params: Vec<Entry<'a>>,
    /// The value of `bypass`, if the node is bypassed.
    pub(super) bypass: Option<Box<Json<'a>>>,
}

/// The fault of an object that lacks a key.
pub(super) fn missing(json: &Json<'_>, key: &str, hint: &str) -> Fault {
    json.fault(code::MISSING_KEY, format!("the key `{key}` is missing")).hint(hint)
}

/// Looks up a required key. Adds a fault if it is missing, unless an unknown key looks like a misspelling of it.
fn required<'a>(
    json: &Json<'a>,
    entries: &[Entry<'a>],
    known: &[&str],
    key: &str,
    hint: &str,
    faults: &mut Vec<Fault>,
) -> Option<Json<'a>> {
    let found = find(entries, key).map(|entry| entry.json.clone());
    if found.is_none() && !is_misspelt(entries, known.iter().copied(), key) {
        faults.push(missing(json, key, hint));
    }
    found
}

/// Adds a fault if a name is not valid.
pub(super) fn check_name(entry: &Entry<'_>, what: &str, faults: &mut Vec<Fault>) {
    if !is_name(entry.name) {
        let fault = entry.fault(code::BAD_NAME, format!("\"{}\" is not a valid name for {what}", shown(entry.name)));
        faults.push(
            fault.hint("use letters a-z and A-Z, digits, `_` and `-`; the first character must be a letter or `_`"),
        );
    }
}

impl<'a> Document<'a> {
    /// The parts of the file whose value is `root`; `None` if it is not a graph of this format.
    pub(super) fn read(root: &Json<'a>, faults: &mut Vec<Fault>) -> Option<Self> {
        const KEYS: [&str; 6] = ["convect", "scene", "controls", "nodes", "outputs", "$schema"];
        let members = root.members("an object {\"convect\": 1, \"nodes\": {…}, \"outputs\": {…}}", faults);
        let entries = keep(members, faults)?;
        let required = |key, hint, faults: &mut _| required(root, &entries, &KEYS, key, hint, faults);
        let number = required("convect", "a graph starts with \"convect\": 1", faults)
            .and_then(|json| Some((keep(json.whole("the format number 1"), faults)?, json)));
        if let Some((number, json)) = number
            && number != FORMAT
        {
            let fault = json.fault(
                code::FORMAT,
                format!("the graph has format {number}, but this version of convect reads format {FORMAT}"),
            );
            // In another format everything else may have another meaning.
            faults.clear();
            let hint = if number > FORMAT {
                "the graph was made for a newer one: update convect"
            } else {
                "write \"convect\": 1"
            };
            faults.push(fault.hint(hint));
            return None;
        }
        refuse_unknown(&entries, &KEYS, "keys of a graph", faults);

        let part = |name: &str| find(&entries, name).map(|entry| entry.json.clone());
        if let Some(schema) = part("$schema")
            && schema.string().is_none()
        {
            faults.push(schema.unexpected("a string"));
        }
        let controls = named(part("controls").as_ref(), "controls {\"name\": value, …}", "a control", faults);
        let nodes = required("nodes", "nodes are written \"nodes\": {\"id\": {\"type\": \"…\"}, …}", faults);
        let nodes_are_known = nodes.as_ref().is_some_and(Json::is_object);
        let nodes = named(nodes.as_ref(), "nodes {\"id\": {\"type\": \"…\"}, …}", "a node", faults);
        let outputs = required("outputs", "name at least one output: \"outputs\": {\"name\": \"node\"}", faults);
        let nodes = nodes.into_iter().map(|entry| NodeText::read(entry, faults)).collect();
        Some(Self { scene: part("scene"), controls, nodes, nodes_are_known, outputs })
    }

    /// Applies a `--set`: replaces a control, or replaces or adds a param. The key is that of the value's text.
    pub(super) fn set(&mut self, value: Json<'a>, faults: &mut Vec<Fault>) {
        let key = value.text.set.unwrap_or_default();
        let Some((id, param)) = key.split_once('.') else {
            let path = member_path("controls", key);
            return match self.controls.iter_mut().find(|control| control.name == key) {
                Some(control) => *control = Entry::of_set(control.name, value.at_path(&path)),
                None => {
                    let fact = match key {
                        "" => "the name before `=` is missing".into(),
                        _ => format!("there is no control `{}`", shown(key)),
                    };
                    let fault = value.fault(code::UNKNOWN_SET, fact);
                    let names = self.controls.iter().map(|control| control.name);
                    let hint = match self.nodes.iter().any(|node| node.entry.name == key) {
                        true => Some(format!("`{0}` is a node; set one of its params with `{0}.param=…`", shown(key))),
                        false if self.controls.is_empty() => {
                            Some("a param of a node is set with `node.param=…`".into())
                        }
                        false => did_you_mean(faults, key, names, "controls"),
                    };
                    faults.push(Fault { hint, ..fault });
                }
            };
        };
        let Some(node) = self.nodes.iter_mut().find(|node| node.entry.name == id) else {
            let fault = value.fault(code::UNKNOWN_SET, format!("there is no node `{}`", shown(id)));
            let hint = did_you_mean(faults, id, self.nodes.iter().map(|node| node.entry.name), "nodes");
            return faults.push(Fault { hint, ..fault });
        };
        let value = value.at_path(&member_path(&(member_path("nodes", id) + ".params"), param));
        match node.params.iter_mut().find(|entry| entry.name == param) {
            Some(entry) => *entry = Entry::of_set(param, value),
            None => node.params.push(Entry::of_set(param, value)),
        }
    }
}

/// The members of an object whose keys are names; empty if it is absent or not an object.
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
            return Self { entry, kind: None, inputs: Vec::new(), params: Vec::new(), bypass: None };
        };
        const KEYS: [&str; 5] = ["type", "inputs", "params", "bypass", "note"];
        refuse_unknown(&entries, &KEYS, "keys of a node", faults);
        let part = |name: &str| find(&entries, name).map(|entry| entry.json.clone());
        let kind = required(&entry.json, &entries, &KEYS, "type", "`convect nodes` lists the types", faults);
        let no_text = kind.as_ref().filter(|kind| kind.string().is_none());
        faults.extend(no_text.map(|kind| kind.unexpected("the name of a node type")));
        let mut members = |name: &str, expected: &str| {
            let members = part(name).map(|json| json.members(expected, faults));
            members.and_then(|members| keep(members, faults)).unwrap_or_default()
        };
        let inputs = members("inputs", "inputs {\"name\": \"node\", …}");
        let params = members("params", "params {\"name\": value, …}");
        let note = part("note").filter(|note| note.string().is_none());
        faults.extend(note.map(|note| note.unexpected("a string")));
        let bypass = part("bypass").filter(|bypass| keep(bypass.bool(), faults).unwrap_or(false));
        Self { entry, kind: kind.map(Box::new), inputs, params, bypass: bypass.map(Box::new) }
    }
}
