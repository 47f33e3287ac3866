//! What cases are made from: the example graphs, geometry files, and the catalogue of nodes.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

/// A node type of the catalogue.
pub(crate) struct NodeType {
    pub(crate) name: String,
    pub(crate) inputs: Vec<Input>,
    pub(crate) params: Vec<Param>,
}

/// An input of a node type.
pub(crate) struct Input {
    pub(crate) name: String,
    pub(crate) is_list: bool,
    /// The component it needs; `None` for any.
    pub(crate) needs: Option<String>,
}

/// A param of a node type.
pub(crate) struct Param {
    pub(crate) name: String,
    /// The default, or null where it is not a value.
    pub(crate) default: Value,
    /// Words and bounds that the declaration names.
    pub(crate) legal: Vec<Value>,
}

/// What cases are made from.
pub(crate) struct Stock {
    /// Example graphs, made small; their files are in `in/`.
    pub(crate) graphs: Vec<Value>,
    /// Geometry files by name, as they lie in `in/`.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    pub(crate) types: Vec<NodeType>,
}

/// Curves of a groom that are kept; the file has thousands.
const MOST_CURVES: usize = 300;

impl Stock {
    /// The stock of the repository at `root`; `program` lists its nodes.
    ///
    /// # Errors
    /// If a file cannot be read or the program does not list its nodes.
    pub(crate) fn load(root: &Path, program: &Path) -> Result<Self, String> {
        let output = Command::new(program).args(["nodes", "--json"]).output();
        let output = output.map_err(|error| format!("`{}` could not be run: {error}", program.display()))?;
        let listed: Value = serde_json::from_slice(&output.stdout)
            .map_err(|error| format!("`{} nodes --json` printed no JSON: {error}", program.display()))?;
        let types = listed.as_array().into_iter().flatten().filter_map(node_type).collect();
        let mut stock = Self { graphs: Vec::new(), files: Vec::new(), types };
        for path in listing(&root.join("graphs"))?.iter().filter(|path| path.is_dir()) {
            for file in listing(path)? {
                let bytes = fs::read(&file).map_err(|error| format!("{}: {error}", file.display()))?;
                stock.take(&file, bytes)?;
            }
        }
        for folder in ["read_obj", "read_ply", "read_json"] {
            for file in listing(&root.join("fuzz/corpus").join(folder))? {
                let bytes = fs::read(&file).map_err(|error| format!("{}: {error}", file.display()))?;
                let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
                stock.files.push((format!("{name}.{}", &folder["read_".len()..]), bytes));
            }
        }
        if stock.graphs.is_empty() || stock.files.is_empty() || stock.types.is_empty() {
            return Err(format!("{} has no graphs, no geometry files or no nodes", root.display()));
        }
        Ok(stock)
    }

    fn take(&mut self, file: &Path, bytes: Vec<u8>) -> Result<(), String> {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match file.extension().and_then(|ending| ending.to_str()) {
            Some("json") => {
                let text = plain_json(&String::from_utf8_lossy(&bytes));
                let mut graph: Value =
                    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", file.display()))?;
                make_small(&mut graph);
                self.graphs.push(graph);
            }
            Some("obj") => self.files.push((name, few_curves(&bytes))),
            _ => {}
        }
        Ok(())
    }

    /// A type by name.
    pub(crate) fn node_type(&self, name: &str) -> Option<&NodeType> {
        self.types.iter().find(|one| one.name == name)
    }
}

/// What a folder contains, in the order of names.
fn listing(folder: &Path) -> Result<Vec<std::path::PathBuf>, String> {
    let read = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut found: Vec<_> = read.flatten().map(|entry| entry.path()).collect();
    found.sort();
    Ok(found)
}

fn node_type(listed: &Value) -> Option<NodeType> {
    let named = |value: &Value| value["name"].as_str().map(str::to_owned);
    let input = |one: &Value| {
        let needs = one["needs"].as_str().map(str::to_owned);
        Some(Input { name: named(one)?, is_list: one["list"] == true, needs })
    };
    let params = listed["params"].as_array()?.iter();
    Some(NodeType {
        name: named(listed)?,
        inputs: listed["inputs"].as_array()?.iter().filter_map(input).collect(),
        params: params
            .filter_map(|one| Some(Param { name: named(one)?, default: default(one), legal: legal(one) }))
            .collect(),
    })
}

fn default(param: &Value) -> Value {
    let text = param["default"].as_str().unwrap_or_default();
    serde_json::from_str(text).unwrap_or_else(|_| if text.is_empty() { Value::Null } else { json!(text) })
}

fn legal(param: &Value) -> Vec<Value> {
    let words = param["options"].as_array().into_iter().flatten().map(|option| option["word"].clone());
    let hard = ["low", "high"].into_iter().map(|end| param["hard"][end].clone());
    let soft = param["soft"].as_array().into_iter().flatten().cloned();
    words.chain(hard).chain(soft).filter(|value| !value.is_null()).collect()
}

/// JSON without comments and trailing commas.
pub(crate) fn plain_json(text: &str) -> String {
    let mut out = String::new();
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' => {
                out.push(c);
                while let Some(inner) = chars.next() {
                    out.push(inner);
                    match inner {
                        '\\' => out.extend(chars.next()),
                        '"' => break,
                        _ => {}
                    }
                }
            }
            '/' if chars.peek() == Some(&'/') => while chars.next_if(|c| *c != '\n').is_some() {},
            '}' | ']' => {
                let kept = out.trim_end();
                out.truncate(kept.strip_suffix(',').unwrap_or(kept).len());
                out.push(c);
            }
            _ => out.push(c),
        }
    }
    out
}

/// Few frames, few curves, and files where the case puts them.
fn make_small(graph: &mut Value) {
    let first = graph["scene"]["frames"][0].as_i64().unwrap_or(1);
    if graph["scene"].is_object() {
        graph["scene"]["frames"] = json!([first, first + 1]);
    }
    for node in graph["nodes"].as_object_mut().into_iter().flat_map(|nodes| nodes.values_mut()) {
        let Some(params) = node.get_mut("params").and_then(Value::as_object_mut) else { continue };
        for (name, most) in [("divisions", 6.0), ("density", 400.0)] {
            if let Some(value) = params.get_mut(name)
                && value.as_f64().is_some_and(|value| value > most)
            {
                *value = if name == "density" { json!(most) } else { json!(most as i64) };
            }
        }
        if let Some(Value::String(file)) = params.get_mut("file") {
            *file = file.replace("../assets/", "in/");
        }
    }
}

/// An obj file with at most [`MOST_CURVES`] lines; the points of others stay out where lines come last.
fn few_curves(bytes: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes);
    let lines = text.lines().filter(|line| line.starts_with("l ")).count();
    if lines <= MOST_CURVES {
        return bytes.to_vec();
    }
    let kept: Vec<&str> = text.lines().filter(|line| line.starts_with("l ")).take(MOST_CURVES).collect();
    let last =
        kept.iter().flat_map(|line| line.split_whitespace().skip(1)).filter_map(|index| index.parse().ok()).max();
    let points = text.lines().filter(|line| line.starts_with("v ")).take(last.unwrap_or(0));
    points.chain(kept).flat_map(|line| [line, "\n"]).collect::<String>().into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_trailing_commas_are_removed_outside_of_texts() {
        let text = "// a\n{\"k\": \"// , }\\\"\", // b\n \"l\": [1, 2, ], }";
        let value: Value = serde_json::from_str(&plain_json(text)).unwrap();
        assert_eq!(value, json!({"k": "// , }\"", "l": [1, 2]}));
    }

    #[test]
    fn graphs_are_made_small() {
        let mut graph = json!({"scene": {"frames": [5, 90]}, "nodes": {
            "a": {"params": {"density": 9000, "divisions": [9, 9, 9]}}, "b": {"params": {"divisions": 32, "file": "../assets/x.obj"}}
        }});
        make_small(&mut graph);
        assert_eq!(graph["scene"]["frames"], json!([5, 6]));
        assert_eq!(graph["nodes"]["a"]["params"], json!({"density": 400.0, "divisions": [9, 9, 9]}));
        assert_eq!(graph["nodes"]["b"]["params"], json!({"divisions": 6, "file": "in/x.obj"}));
    }

    #[test]
    fn of_a_large_groom_the_first_curves_are_kept() {
        let points: String = (0..2000).map(|at| format!("v {at} 0 0\n")).collect();
        let lines: String = (0..1000).map(|at| format!("l {} {}\n", 2 * at + 1, 2 * at + 2)).collect();
        let few = String::from_utf8(few_curves(format!("{points}{lines}").as_bytes())).unwrap();
        assert_eq!(few.lines().count(), 3 * MOST_CURVES);
        assert!(few.ends_with("l 599 600\n"));
    }
}
