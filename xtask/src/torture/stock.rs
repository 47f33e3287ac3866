//! What cases are made from: the example graphs, geometry files, and the catalogue of nodes.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

/// A node type of the catalogue.
#[derive(Clone, Default)]
pub(crate) struct NodeType {
    pub(crate) name: String,
    pub(crate) inputs: Vec<Input>,
    pub(crate) params: Vec<Param>,
    pub(crate) outputs: Vec<Output>,
}

/// An input of a node type.
#[derive(Clone, Default)]
pub(crate) struct Input {
    pub(crate) name: String,
    pub(crate) is_list: bool,
    pub(crate) is_optional: bool,
    /// The component it needs; `None` for any.
    pub(crate) needs: Option<String>,
}

/// An output of a node type.
#[derive(Clone, Default)]
pub(crate) struct Output {
    pub(crate) name: String,
    /// Its components; `None` for those of an input.
    pub(crate) carries: Option<Vec<String>>,
}

/// A param of a node type.
#[derive(Clone, Default)]
pub(crate) struct Param {
    pub(crate) name: String,
    /// What it takes, in the words of the declaration.
    pub(crate) kind: String,
    /// The default; null where it is not a value.
    pub(crate) default: Value,
    /// Words that it takes.
    pub(crate) words: Vec<Value>,
    /// Numbers that it takes: the lowest and the highest.
    pub(crate) hard: [Option<f64>; 2],
    /// Numbers that it usually gets.
    pub(crate) soft: Option<[f64; 2]>,
    pub(crate) is_fixed: bool,
    pub(crate) may_be_masked: bool,
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
            // Runs of a study, which is no graph.
            Some("json") if name == "study.json" => {}
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
        Some(Input { name: named(one)?, is_list: one["list"] == true, is_optional: one["least"] == 0, needs })
    };
    let output = |one: &Value| {
        let carries = one["carries"].as_array();
        let carries = carries.map(|kinds| kinds.iter().filter_map(Value::as_str).map(str::to_owned).collect());
        Some(Output { name: named(one)?, carries })
    };
    Some(NodeType {
        name: named(listed)?,
        inputs: listed["inputs"].as_array()?.iter().filter_map(input).collect(),
        params: listed["params"].as_array()?.iter().filter_map(param).collect(),
        outputs: listed["outputs"].as_array()?.iter().filter_map(output).collect(),
    })
}

fn param(listed: &Value) -> Option<Param> {
    let text = listed["default"].as_str().unwrap_or_default();
    let words: Vec<Value> =
        listed["options"].as_array().into_iter().flatten().map(|option| option["word"].clone()).collect();
    let is_word = words.iter().any(|word| word == text);
    let soft = listed["soft"].as_array().map(|ends| ends.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
    Some(Param {
        name: listed["name"].as_str()?.to_owned(),
        kind: listed["kind"].as_str()?.to_owned(),
        default: if is_word { json!(text) } else { serde_json::from_str(text).unwrap_or_default() },
        words,
        hard: ["low", "high"].map(|end| listed["hard"][end].as_f64()),
        soft: soft.and_then(|ends| ends.try_into().ok()),
        is_fixed: listed["fixed"] == true,
        may_be_masked: listed["mask"] == true,
    })
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
    fn declarations_of_params_are_understood() {
        let listed = json!({"name": "rise", "kind": "a number", "default": "0.5", "hard": {"low": 0.0, "high": null, "open": false},
            "soft": [0.0, 2.0], "fixed": true, "mask": false, "options": []});
        let rise = param(&listed).unwrap();
        assert_eq!((rise.default, rise.hard, rise.soft), (json!(0.5), [Some(0.0), None], Some([0.0, 2.0])));
        assert!(rise.is_fixed && !rise.may_be_masked);
        let words = json!([{"word": "none"}, {"word": "perlin"}]);
        let noise = param(&json!({"name": "noise", "kind": "one of …", "default": "none", "options": words})).unwrap();
        assert_eq!((noise.default, noise.words), (json!("none"), vec![json!("none"), json!("perlin")]));
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
