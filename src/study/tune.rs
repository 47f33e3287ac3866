//! The tuned graph: the author's text with the picked values in place of the old, and a comment beside each that says why.
//!
//! Only ranges of the text are replaced, so comments, order and spacing stay. A relative path is rewritten where the tuned
//! graph lies in another folder.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use engine::graph::{Body, Graph};
use engine::param::Shape;
use jsonc_parser::ast::{Object, Value};
use jsonc_parser::common::Ranged;
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast};

use super::bench::set_of;
use super::knobs;
use super::outcome::{Goal, Outcome};
use super::table::{brief, shown_error};

/// What the comment beside a picked value begins with.
pub(super) const MARK: &str = "convect study:";

/// A range of the text and what replaces it.
struct Edit {
    start: usize,
    end: usize,
    text: String,
}

/// The text of the graph with the values of run `pick`, to be written to `folder`.
///
/// # Errors
/// If the graph's text has no place for a value.
pub(super) fn tuned(
    outcome: &Outcome,
    pick: usize,
    bytes: &[u8],
    graph: &Graph,
    fixed: &[(String, String)],
    folder: &Path,
) -> Result<String, String> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let parsed = parse_to_ast(text, &CollectOptions::default(), &ParseOptions::default());
    let parsed = parsed.map_err(|error| format!("the graph could not be edited: {error}"))?;
    let Some(Value::Object(root)) = &parsed.value else { return Err("the graph is not an object".into()) };
    let why = why(outcome, pick);
    let picked = set_of(&outcome.knobs, &outcome.runs[pick].setting);
    let is_picked = |key: &str| picked.iter().any(|(knob, _)| knob == key);
    let others = fixed.iter().filter(|(key, _)| !is_picked(key)).map(|pair| (pair, "set for the study"));
    let values: Vec<Setting> = others
        .chain(picked.iter().map(|pair| (pair, why.as_str())))
        .map(|((key, value), why)| Setting {
            key,
            // A comment must not end early.
            text: format!("{} /* {} */", knobs::to_json(value), why.replace("*/", "* /")),
        })
        .collect();
    let mut edits = placed(root, &values)?;
    paths(root, graph, folder, &mut edits);
    Ok(apply(text, edits))
}

/// Why the values were picked.
fn why(outcome: &Outcome, pick: usize) -> String {
    let unit = if outcome.unit.is_empty() { String::new() } else { format!(" {}", outcome.unit) };
    let (measure, statistic) = (outcome.norm.measure.name(), outcome.norm.statistic.name());
    let error = shown_error(outcome, outcome.error(pick).unwrap_or_default());
    let floor = outcome.floor.map_or_else(|| "unknown".into(), |_| format!("{}{unit}", brief(outcome.floor())));
    let goal = match outcome.goal {
        Goal::Tolerance(tolerance) => format!("cheapest within {}{unit}", brief(tolerance)),
        Goal::Budget(ms) => format!("most accurate within {} ms", brief(ms)),
        Goal::None => "picked".into(),
    };
    let ms = outcome.ms(pick).map(brief).unwrap_or_default();
    format!("{MARK} {goal}: {statistic} {measure} error {error}{unit}, floor {floor}, {ms} ms a frame")
}

/// A param or control with its value and comment.
struct Setting<'a> {
    key: &'a str,
    text: String,
}

/// The edits that give params and controls their values.
fn placed(root: &Object<'_>, values: &[Setting<'_>]) -> Result<Vec<Edit>, String> {
    let mut edits = Vec::new();
    // Members of the params that a node lacks.
    let mut missing: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let nodes = root.get_object("nodes").ok_or("the graph has no nodes")?;
    for Setting { key, text } in values {
        let Some((node, param)) = key.split_once('.') else {
            let controls = root.get_object("controls").ok_or("the graph has no controls")?;
            set(controls, key, text, &mut edits);
            continue;
        };
        let body = nodes.get_object(node).ok_or_else(|| format!("the graph has no node `{node}`"))?;
        match body.get_object("params") {
            Some(params) => set(params, param, text, &mut edits),
            None => missing.entry(node).or_default().push(format!("\"{param}\": {text}")),
        }
    }
    for (node, members) in missing {
        if let Some(body) = nodes.get_object(node) {
            insert(body, &format!("\"params\": {{ {} }}", members.join(", ")), &mut edits);
        }
    }
    Ok(edits)
}

/// Replaces or inserts a member of an object.
fn set(object: &Object<'_>, name: &str, text: &str, edits: &mut Vec<Edit>) {
    match object.get(name) {
        Some(member) => {
            let range = member.value.range();
            edits.push(Edit { start: range.start, end: range.end, text: text.to_owned() });
        }
        None => insert(object, &format!("\"{name}\": {text}"), edits),
    }
}

/// Inserts a member at the start of an object, where no comma before it can be missing.
fn insert(object: &Object<'_>, member: &str, edits: &mut Vec<Edit>) {
    let at = object.range.start + 1;
    let comma = if object.properties.is_empty() && !edits.iter().any(|edit| edit.start == at) { "" } else { "," };
    edits.push(Edit { start: at, end: at, text: format!(" {member}{comma}") });
}

/// Rewrites relative paths of files, which are relative to the folder of the graph.
fn paths(root: &Object<'_>, graph: &Graph, folder: &Path, edits: &mut Vec<Edit>) {
    let Some(way) = way(folder, &graph.folder).filter(|way| !way.as_os_str().is_empty()) else { return };
    for node in &graph.nodes {
        let Body::Node { specs, .. } = &node.body else { continue };
        let object = root.get_object("nodes").and_then(|nodes| nodes.get_object(&node.id));
        let Some(params) = object.and_then(|body| body.get_object("params")) else { continue };
        for spec in specs.iter().filter(|spec| spec.shape == Shape::File) {
            let Some(Value::StringLit(path)) = params.get(spec.name).map(|member| &member.value) else { continue };
            if Path::new(&*path.value).is_absolute() {
                continue;
            }
            let moved = tidy(&way.join(&*path.value));
            let text = serde_json::Value::from(moved.to_string_lossy()).to_string();
            edits.push(Edit { start: path.range.start, end: path.range.end, text });
        }
    }
}

/// The path from one folder to another; absolute where there is none between them.
fn way(from: &Path, to: &Path) -> Option<PathBuf> {
    let whole = |folder: &Path| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        folder.canonicalize().ok()
    };
    let (from, to) = (whole(from)?, whole(to)?);
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return Some(to);
    }
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    Some(up.chain(to.components().skip(shared)).collect())
}

/// A path without `a/..`.
fn tidy(path: &Path) -> PathBuf {
    let mut tidied = PathBuf::new();
    for part in path.components() {
        let last = tidied.components().next_back();
        match (part, last) {
            (Component::ParentDir, Some(Component::Normal(_))) => _ = tidied.pop(),
            (Component::CurDir, _) => {}
            _ => tidied.push(part),
        }
    }
    tidied
}

/// The text with all edits made.
fn apply(text: &str, mut edits: Vec<Edit>) -> String {
    // Of two insertions at one place the later comes first, and has a comma.
    edits.reverse();
    edits.sort_by_key(|edit| edit.start);
    let (mut done, mut at) = (String::with_capacity(text.len()), 0);
    for edit in edits {
        if edit.start < at {
            continue;
        }
        done.push_str(&text[at..edit.start]);
        done.push_str(&edit.text);
        at = edit.end;
    }
    done + &text[at..]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edited(text: &str, keys: &[(&str, &str)]) -> String {
        let parsed = parse_to_ast(text, &CollectOptions::default(), &ParseOptions::default()).unwrap();
        let Some(Value::Object(root)) = &parsed.value else { panic!("{text}") };
        let values = keys.iter().map(|(key, value)| Setting { key, text: format!("{value} /* why */") });
        apply(text, placed(root, &values.collect::<Vec<_>>()).unwrap())
    }

    #[test]
    fn values_are_replaced_or_inserted_and_comments_stay() {
        let text =
            "{ \"nodes\": { // all\n \"a\": { \"type\": \"T\", \"params\": { \"x\": 1, /* y */ \"y\": [1, 2], } } } }";
        let expected = text.replace("\"x\": 1", "\"x\": 4 /* why */").replace("{ \"x\"", "{ \"z\": 3 /* why */, \"x\"");
        assert_eq!(edited(text, &[("a.x", "4"), ("a.z", "3")]), expected);
        let bare = "{\"nodes\":{\"a\":{\"type\":\"T\"}}}";
        let with = "{\"nodes\":{\"a\":{ \"params\": { \"x\": 1 /* why */ },\"type\":\"T\"}}}";
        assert_eq!(edited(bare, &[("a.x", "1")]), with);
        let two = with.replace("/ }", "/, \"y\": 2 /* why */ }");
        assert_eq!(edited(bare, &[("a.x", "1"), ("a.y", "2")]), two);
    }

    #[test]
    fn two_values_can_be_inserted_into_one_object() {
        let text = "{\"nodes\":{\"a\":{\"params\":{}}}}";
        let both = edited(text, &[("a.x", "1"), ("a.y", "2")]);
        assert_eq!(both, "{\"nodes\":{\"a\":{\"params\":{ \"y\": 2 /* why */, \"x\": 1 /* why */}}}}");
    }

    #[test]
    fn a_path_goes_up_and_down() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(&path).unwrap();
            path
        };
        assert_eq!(way(&make("out"), &make("graphs/a")), Some(PathBuf::from("../graphs/a")));
        assert_eq!(way(&make("out"), &make("out")), Some(PathBuf::new()));
        assert_eq!(tidy(Path::new("../graphs/a/../assets/x.obj")), PathBuf::from("../graphs/assets/x.obj"));
    }
}
