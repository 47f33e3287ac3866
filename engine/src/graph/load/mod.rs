//! Loads a graph file: a checked [`Graph`], or all faults at once.
//!
//! The text is parsed as JSON and split into named parts (`document`). Then controls are read (`control`), params
//! become sources (`param`, `literal`, `keyframes`, `expression`), wires are resolved (`wires`, `dag`, `components`)
//! and outputs checked (`outputs`). Each step continues after a fault with what is still valid, and does not report
//! what merely follows from an earlier fault.
//!
//! Promise: a graph that loads satisfies what [`Graph`] promises; any bytes give a graph or faults in the order of the
//! file. Limit: the files that a graph names are opened but their content is not checked.

mod components;
mod control;
mod document;
mod expression;
mod form;
mod keyframes;
mod literal;
mod notes;
mod outputs;
mod param;
mod scene;
mod wires;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use jsonc_parser::common::Ranged;

use self::components::Components;
use self::control::Controls;
use self::document::{Document, NodeText};
use self::param::Reader;
use self::wires::Wire;
use super::dag::{Dag, Order};
use super::fault::{Fault, FaultClass, code};
use super::json::{Json, did_you_mean, shown};
use super::positions::Positions;
use super::syntax::parse;
use super::text::{Text, decode};
use super::{Body, Catalogue, Graph, GraphNode, GraphOutput, Link};
use crate::node::{InputSpec, Node};
use crate::param::{ParamSpec, Source};

/// Checks whether the file at a path can be read: [`probe`], or a substitute in a test.
pub type FileProbe = dyn Fn(&Path) -> std::io::Result<()>;

/// Checks that the file at `path` can be opened.
///
/// # Errors
/// If it does not exist, is not a file, or reading it is not permitted.
pub fn probe(path: &Path) -> std::io::Result<()> {
    crate::files::open(path).map(drop)
}

impl Graph {
    /// Loads a graph from the text of its file. Relative paths are resolved against `folder`; `set` replaces params
    /// (`node.param`) and controls by JSON values or bare words, as `--set` does.
    ///
    /// # Errors
    /// All faults, in the order of the file, then those of `set`.
    pub fn load(
        text: &str,
        folder: &Path,
        catalogue: Catalogue,
        set: &[(String, String)],
        files: &FileProbe,
    ) -> Result<Self, Vec<Fault>> {
        let mut faults = Vec::new();
        let graph = load(text, folder, catalogue, set, files, &mut faults);
        let (notes, mut faults): (Vec<Fault>, Vec<Fault>) =
            faults.into_iter().partition(|fault| fault.class == FaultClass::Note);
        match graph {
            Some(mut graph) if faults.is_empty() => {
                graph.notes = notes.into_iter().map(Fault::into_note).collect();
                graph.notes.extend(notes::of(&graph));
                Ok(graph)
            }
            _ => {
                faults.sort_by(|a, b| a.order().cmp(&b.order()));
                Err(faults)
            }
        }
    }

    /// [`Graph::load`] of a file's bytes: UTF-8, with or without a byte order mark.
    ///
    /// # Errors
    /// As [`Graph::load`], and if the bytes are not UTF-8.
    pub fn load_bytes(
        bytes: &[u8],
        folder: &Path,
        catalogue: Catalogue,
        set: &[(String, String)],
        files: &FileProbe,
    ) -> Result<Self, Vec<Fault>> {
        Self::load(decode(bytes).map_err(|fault| vec![fault])?, folder, catalogue, set, files)
    }
}

/// A node as far as it is valid.
struct Draft<'a> {
    text: NodeText<'a>,
    node: Option<&'static Node>,
    specs: Arc<[ParamSpec]>,
    inputs: Arc<[InputSpec]>,
    params: Arc<[Source]>,
    /// Wires of each input.
    wires: Vec<Vec<Wire<'a>>>,
}

/// The graph, or `None` if faults make it impossible to continue. Only to be used if there are no faults.
fn load(
    text: &str,
    folder: &Path,
    catalogue: Catalogue,
    set: &[(String, String)],
    files: &FileProbe,
    faults: &mut Vec<Fault>,
) -> Option<Graph> {
    let text = Text::new(text.strip_prefix('\u{feff}').unwrap_or(text), None);
    let set: Vec<(&str, Cow<'_, str>)> = set.iter().map(|(key, value)| (&**key, quoted_if_bare(value))).collect();
    let set_texts: Vec<Text<'_>> = set.iter().map(|(key, value)| Text::new(value, Some(key))).collect();
    let set_values: Vec<_> = set_texts.iter().map(|text| parse(text).map_err(|fault| faults.push(fault))).collect();
    let root = parse(&text).map_err(|fault| faults.push(fault)).ok()?;

    let mut document = Document::read(&Json::root(&root, &text), faults)?;
    for (text, value) in set_texts.iter().zip(&set_values) {
        if let Ok(value) = value {
            document.set(Json::root(value, text), faults);
        }
    }

    let scene = scene::read(document.scene.as_ref(), faults);
    let controls = Controls::read(&document.controls, &scene, faults);
    let mut reader =
        Reader { scene: &scene, controls: &controls, folder, files, faults, read: BTreeMap::new(), kind: "" };
    let mut types = BTreeMap::new();
    let mut drafts: Vec<Draft<'_>> = std::mem::take(&mut document.nodes)
        .into_iter()
        .map(|node| draft(node, catalogue, &mut types, &mut reader))
        .collect();
    wires::connect(&mut drafts, faults);

    let order = Dag::new(&wires::sources(&drafts)).order();
    wires::refuse_cycles(&drafts, &order, faults);
    let components = Components::along(&drafts, &order);
    components.refuse_misfits(&drafts, catalogue, faults);
    let outputs = outputs::read(document.outputs.as_ref(), &drafts, faults);
    let written: Vec<_> = outputs.iter().flatten().map(|output| (output.node, output.port)).collect();
    components.refuse_impassable(&drafts, &written, faults);
    if !document.nodes_are_known {
        faults.retain(|fault| fault.code != code::UNKNOWN_NODE);
    }
    let outputs = outputs?;

    let positions = positions(&drafts, document.outputs.as_ref());
    let is_bypassed = |node: &&usize| drafts[**node].text.bypass.is_some();
    let bypassed = order.nodes.iter().filter(is_bypassed).map(|node| drafts[*node].text.entry.name.into()).collect();
    let (nodes, outputs) = assemble(drafts, &order, &components, outputs)?;
    Some(Graph { scene, nodes, outputs, folder: folder.to_owned(), positions, bypassed, notes: Vec::new() })
}

/// A value of `--set`: as it is if it is JSON, or looks like a list, an object, a string or a number with a fault; else as
/// a JSON string, so that words and paths need no quotes.
fn quoted_if_bare(value: &str) -> Cow<'_, str> {
    let text = value.trim();
    let looks_like_a_number = || {
        text.starts_with(|c: char| "+-.".contains(c) || c.is_ascii_digit())
            && text.contains(|c: char| c.is_ascii_digit())
            && !text.contains(|c: char| c.is_alphabetic() && !"eExX".contains(c) || c == '/')
    };
    let is_json = || parse(&Text::new(value, None)).is_ok();
    match text.is_empty() || text.starts_with(['{', '[', '"']) || looks_like_a_number() || is_json() {
        true => value.into(),
        false => serde_json::Value::from(text).to_string().into(),
    }
}

/// What nodes of one type share.
#[derive(Clone)]
struct NodeType {
    specs: Arc<[ParamSpec]>,
    inputs: Arc<[InputSpec]>,
    /// The params of a node that sets none.
    unset: Arc<[Source]>,
}

/// Reads a node's type and params.
fn draft<'a>(
    mut text: NodeText<'a>,
    catalogue: Catalogue,
    types: &mut BTreeMap<&'static str, NodeType>,
    reader: &mut Reader<'a, '_>,
) -> Draft<'a> {
    // With its path it takes as much as the rest of the node.
    let node = text.kind.take().and_then(|kind| {
        let name = kind.string()?;
        let node = catalogue.get(name);
        if node.is_none() {
            let hint = did_you_mean(reader.faults, name, catalogue.names(), "node types")
                .or(Some("`convect nodes` lists the types".into()));
            let fault = kind.fault(code::UNKNOWN_TYPE, format!("there is no node type `{}`", shown(name)));
            reader.faults.push(Fault { hint, ..fault });
        }
        node
    });
    let Some(declared) = node else {
        return Draft { text, node, specs: [].into(), inputs: [].into(), params: [].into(), wires: Vec::new() };
    };
    let of_type = types.entry(declared.name).or_insert_with(|| {
        let specs: Arc<[ParamSpec]> = declared.param_specs().into();
        let unset = reader.params(declared, &specs, &[]).into();
        NodeType { specs, inputs: declared.input_specs().into(), unset }
    });
    let NodeType { specs, inputs, unset } = of_type.clone();
    let params = if text.params.is_empty() { unset } else { reader.params(declared, &specs, &text.params).into() };
    Draft { text, node, specs, inputs, params, wires: Vec::new() }
}

/// The positions of nodes, of the params and inputs that they set, and of outputs.
fn positions<'a>(drafts: &[Draft<'a>], outputs: Option<&Json<'a>>) -> Positions {
    let members = outputs.and_then(|outputs| outputs.members("", &mut Vec::new()).ok()).unwrap_or_default();
    // Its tables are large, and would otherwise grow by doubling.
    let all = |draft: &Draft<'a>| {
        let NodeText { entry, params, inputs, .. } = &draft.text;
        let bytes = std::iter::once(entry).chain(params).chain(inputs).map(|entry| entry.json.path_bytes());
        (1 + params.len() + inputs.len(), bytes.sum::<usize>())
    };
    let of_outputs = (members.len(), members.iter().map(|output| output.json.path_bytes()).sum());
    let (count, bytes) = drafts.iter().map(all).fold(of_outputs, |a, b| (a.0 + b.0, a.1 + b.1));
    let mut positions = Positions::with_capacity(count, bytes);
    for draft in drafts {
        let id = &draft.text.entry;
        positions.record(&id.json.path(), id.json.text, id.key.start);
        for entry in draft.text.params.iter().chain(&draft.text.inputs) {
            positions.record(&entry.json.path(), entry.json.text, entry.json.value.start());
        }
    }
    for output in members {
        positions.record(&output.json.path(), output.json.text, output.key.start);
    }
    positions.sort();
    positions
}

/// Sorts the nodes topologically, and connects what reads a bypassed node to what it passes; `None` if one has a fault.
fn assemble(
    drafts: Vec<Draft<'_>>,
    order: &Order,
    components: &Components,
    outputs: Vec<outputs::Draft>,
) -> Option<(Vec<GraphNode>, Vec<GraphOutput>)> {
    if order.nodes.len() != drafts.len() {
        return None;
    }
    let mut index = vec![0; drafts.len()];
    order.nodes.iter().enumerate().for_each(|(new, old)| index[*old] = new);
    let link = |node: usize, port: Option<usize>| {
        let (node, port) = components.source(node, port?)?;
        Some(Link { node: index[node], port })
    };
    let mut nodes: Vec<Option<GraphNode>> = drafts.iter().map(|_| None).collect();
    for (old, draft) in drafts.into_iter().enumerate() {
        let link = |wire: &Wire<'_>| link(wire.node, wire.port);
        let inputs: Option<Vec<Vec<Link>>> = draft.wires.iter().map(|wires| wires.iter().map(link).collect()).collect();
        let body = Body::Node { node: draft.node?, specs: draft.specs, params: draft.params, inputs: inputs? };
        nodes[index[old]] = Some(GraphNode { id: draft.text.entry.name.into(), body });
    }
    let outputs = outputs.into_iter().map(|output| {
        let from = link(output.node, output.port)?;
        Some(GraphOutput { name: output.name, from, attributes: output.attributes, v: output.v })
    });
    Some((nodes.into_iter().collect::<Option<_>>()?, outputs.collect::<Option<_>>()?))
}
