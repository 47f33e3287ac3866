//! Mutations of graphs.

use serde_json::{Map, Value, json};

use super::dice::Dice;
use super::stock::Stock;
use super::values::{edit, expression, extreme, form, number, program, resize, scale};
use super::{generate, params};

/// Changes a graph in one to four ways; three of four graphs only in ways that are legal more often than not.
pub(crate) fn mutate(graph: &mut Value, stock: &Stock, dice: &mut Dice) {
    let is_gentle = !dice.one_in(4);
    let mut count = 1;
    while count < 4 && dice.one_in(2) {
        count += 1;
    }
    for _ in 0..count {
        if is_gentle {
            mutate_gently(graph, stock, dice);
        } else {
            mutate_hard(graph, stock, dice);
        }
    }
}

fn mutate_gently(graph: &mut Value, stock: &Stock, dice: &mut Dice) {
    match dice.below(8) {
        0 => resize(picked(graph, dice, Value::is_number), dice),
        1..4 => generate::grow(graph, stock, dice),
        4 => {
            let keyed = object(graph, "nodes").into_iter().flat_map(Map::values_mut);
            let params = keyed.filter_map(|node| object(node, "params")).flat_map(Map::values_mut);
            let mut lists: Vec<&mut Value> = params.filter(|value| value.is_array() || value.is_number()).collect();
            if let Some(at) = dice.index(lists.len()) {
                resize(lists[at], dice);
            }
        }
        _ => set_param(graph, stock, dice, true),
    }
}

fn mutate_hard(graph: &mut Value, stock: &Stock, dice: &mut Dice) {
    match dice.below(18) {
        0..3 => *picked(graph, dice, |_| true) = extreme(dice),
        3..5 => *picked(graph, dice, Value::is_number) = number(dice),
        5..7 => scale(picked(graph, dice, |value| value.is_number() || value.is_array()), dice),
        7 => remove(graph, dice),
        8 => rename(graph, dice),
        9 => double(graph, dice),
        10 => rewire(graph, dice),
        11..13 => change_expression(graph, dice),
        13 => {
            if let Value::Array(list) = picked(graph, dice, Value::is_array) {
                dice.shuffle(list);
            }
        }
        14..16 => set_param(graph, stock, dice, false),
        16 => generate::grow(graph, stock, dice),
        _ => change_scene(graph, dice),
    }
}

/// `KEY=JSON` of a `--set` that changes a param or a control.
pub(crate) fn setting(graph: &Value, stock: &Stock, dice: &mut Dice) -> String {
    let names: Vec<&String> = graph["nodes"].as_object().into_iter().flat_map(Map::keys).collect();
    let controls: Vec<&String> = graph["controls"].as_object().into_iter().flat_map(Map::keys).collect();
    let (key, value) = match (dice.below(5), dice.index(controls.len()), dice.index(names.len())) {
        (0, Some(at), _) => (controls[at].clone(), extreme(dice)),
        (1, ..) | (_, _, None) => {
            (dice.of(&["", "=", ".", "a.b", "nodes", "scene.frames", "none.none"]).to_owned(), extreme(dice))
        }
        (_, _, Some(at)) => {
            let (param, value) = param_value(&graph["nodes"][names[at]], stock, dice, false);
            (format!("{}.{param}", names[at]), value)
        }
    };
    let text = super::values::text_of(&value);
    // A command line has no place for more.
    let end = text.char_indices().map(|(at, _)| at).take_while(|at| *at < 100_000).last().unwrap_or(0);
    format!("{key}={}", text[..end.max(text.len().min(1))].replace('\0', ""))
}

/// A param of a node and a value for it.
fn param_value(node: &Value, stock: &Stock, dice: &mut Dice, is_gentle: bool) -> (String, Value) {
    let known = node["type"].as_str().and_then(|name| stock.node_type(name));
    let params = known.map_or(&[][..], |known| &known.params);
    let Some(at) = dice.index(params.len()) else { return ("seed".into(), extreme(dice)) };
    let param = &params[at];
    let value = match dice.below(8) {
        0 if !is_gentle => extreme(dice),
        1 if !is_gentle => number(dice),
        2 if !is_gentle => {
            let value = params::plain(param, dice);
            form(dice, &value)
        }
        _ if param.name == "code" => json!(program(dice)),
        _ => params::any_form(param, dice),
    };
    (param.name.clone(), value)
}

/// Gives a node's param a value, one that fits its kind if `is_gentle`.
fn set_param(graph: &mut Value, stock: &Stock, dice: &mut Dice, is_gentle: bool) {
    let Some(nodes) = object(graph, "nodes") else { return };
    let Some(node) = dice.index(nodes.len()).and_then(|at| nodes.values_mut().nth(at)) else { return };
    let (name, value) = param_value(node, stock, dice, is_gentle);
    // A null that is not meant: only geometry would fit.
    if node.is_object() && !(is_gentle && value.is_null()) {
        if !node["params"].is_object() {
            node["params"] = json!({});
        }
        node["params"][name] = value;
    }
}

fn rewire(graph: &mut Value, dice: &mut Dice) {
    let Some(nodes) = object(graph, "nodes") else { return };
    let names: Vec<String> = nodes.keys().cloned().collect();
    let Some(node) = dice.index(nodes.len()).and_then(|at| nodes.values_mut().nth(at)) else { return };
    let mut wire = names[dice.below(names.len())].clone();
    if dice.one_in(5) {
        wire += dice.of(&[".surface", ".none", ".", "..", ".curves"]);
    }
    let Some(inputs) = object(node, "inputs") else { return };
    let Some(input) = dice.index(inputs.len()).and_then(|at| inputs.values_mut().nth(at)) else { return };
    match input {
        Value::Array(list) if dice.one_in(2) => list.push(json!(wire)),
        _ => *input = if dice.one_in(4) { json!([wire, wire]) } else { json!(wire) },
    }
}

fn change_expression(graph: &mut Value, dice: &mut Dice) {
    let is_text = |value: &Value| value.as_str().is_some_and(|text| text.contains(['*', '+', '=', '(']));
    let place = picked(graph, dice, is_text);
    match place {
        Value::String(text) if is_text(&json!(text)) => *text = edit(text, dice),
        Value::Number(_) => *place = json!({"expr": expression(dice, 3)}),
        _ => {}
    }
}

fn change_scene(graph: &mut Value, dice: &mut Dice) {
    let Some(graph) = graph.as_object_mut() else { return };
    let mut value = json!({"frames": [1, 1 + dice.below(4)], "fps": 24, "seed": 1});
    let key = dice.of(&["frames", "fps", "seed"]);
    value[key] = match dice.below(4) {
        0 => extreme(dice),
        1 => json!([number(dice), number(dice)]),
        2 => number(dice),
        _ => json!([-1_000_000_000_i64 * dice.below(2) as i64, 2]),
    };
    graph.insert("scene".into(), value);
}

fn remove(graph: &mut Value, dice: &mut Dice) {
    match picked(graph, dice, |value| value.is_object() || value.is_array()) {
        Value::Object(map) => {
            let key = dice.index(map.len()).and_then(|at| map.keys().nth(at).cloned());
            key.map(|key| map.remove(&key));
        }
        Value::Array(list) => _ = dice.index(list.len()).map(|at| list.remove(at)),
        _ => {}
    }
}

fn rename(graph: &mut Value, dice: &mut Dice) {
    let Value::Object(map) = picked(graph, dice, Value::is_object) else { return };
    let Some(key) = dice.index(map.len()).and_then(|at| map.keys().nth(at).cloned()) else { return };
    let value = map.remove(&key).unwrap_or_default();
    let other = map.keys().nth(dice.below(map.len().max(1))).cloned().unwrap_or_default();
    let new = match dice.below(4) {
        0 => other,
        1 => format!("{key}x"),
        2 => key.repeat(1 << dice.below(8)),
        _ => dice.of(&["", ".", "a/b", "\u{0}", "frame", "é", "-", "con", "value"]).to_owned(),
    };
    map.insert(new, value);
}

fn double(graph: &mut Value, dice: &mut Dice) {
    match picked(graph, dice, |value| value.is_object() || value.is_array()) {
        Value::Object(map) => {
            let pair = dice
                .index(map.len())
                .and_then(|at| map.iter().nth(at))
                .map(|(key, value)| (format!("{key}_2"), value.clone()));
            map.extend(pair);
        }
        Value::Array(list) => {
            if let Some(at) = dice.index(list.len()) {
                let copies = vec![list[at].clone(); 1 + dice.below(3)];
                list.splice(at..at, copies);
            }
        }
        _ => {}
    }
}

/// The object under a key; `None` where there is none, as mutations before may have left it.
fn object<'a>(value: &'a mut Value, key: &str) -> Option<&'a mut Map<String, Value>> {
    value.get_mut(key)?.as_object_mut()
}

/// One of the values that are `wanted`, or any value if none is.
fn picked<'a>(value: &'a mut Value, dice: &mut Dice, wanted: impl Fn(&Value) -> bool) -> &'a mut Value {
    let mut paths = Vec::new();
    collect(value, String::new(), &mut paths);
    let fitting: Vec<&String> = paths.iter().filter(|path| value.pointer(path).is_some_and(&wanted)).collect();
    let path = match dice.index(fitting.len()) {
        Some(at) => fitting[at].clone(),
        None => paths[dice.below(paths.len())].clone(),
    };
    value.pointer_mut(&path).expect("it was found")
}

fn collect(value: &Value, path: String, paths: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            for (key, inner) in map {
                collect(inner, format!("{path}/{}", key.replace('~', "~0").replace('/', "~1")), paths);
            }
        }
        // The elements of long lists are alike.
        Value::Array(list) => {
            list.iter().take(40).enumerate().for_each(|(at, inner)| collect(inner, format!("{path}/{at}"), paths))
        }
        _ => {}
    }
    paths.push(path);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::stock::{Input, NodeType, Output, Param};

    fn stock() -> Stock {
        let param =
            Param { name: "density".into(), kind: "a number".into(), soft: Some([0.0, 9.0]), ..Param::default() };
        let input = Input { name: "geometry".into(), is_list: true, ..Input::default() };
        let output = Output { name: "geometry".into(), carries: Some(vec!["mesh".into()]) };
        let merge = NodeType { name: "Merge".into(), inputs: vec![input], params: vec![param], outputs: vec![output] };
        let types = vec![merge];
        Stock { graphs: Vec::new(), files: vec![("a.obj".into(), Vec::new())], types }
    }

    fn graph() -> Value {
        json!({"convect": 1, "scene": {"frames": [1, 2]}, "controls": {"c": 1},
            "nodes": {"a": {"type": "Merge", "params": {"x": {"expr": "1+time"}}}, "b": {"type": "Merge", "inputs": {"geometry": ["a"]}}},
            "outputs": {"o": "b"}})
    }

    #[test]
    fn a_seed_always_gives_the_same_graph_and_most_seeds_change_it() {
        let mutated = |seed| {
            let mut value = graph();
            mutate(&mut value, &stock(), &mut Dice::new(seed));
            value
        };
        assert_eq!(mutated(9), mutated(9));
        assert!((0..200).filter(|seed| mutated(*seed) != graph()).count() > 150);
    }

    #[test]
    fn settings_name_params_of_the_graph() {
        let settings: Vec<String> = (0..50).map(|seed| setting(&graph(), &stock(), &mut Dice::new(seed))).collect();
        assert!(settings.iter().any(|text| text.starts_with("a.density=")), "{settings:?}");
        assert!(settings.iter().any(|text| text.starts_with("c=")), "{settings:?}");
        assert!(settings.iter().all(|text| !text.contains('\0')));
    }
}
