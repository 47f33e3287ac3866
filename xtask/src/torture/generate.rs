//! Nodes that fit: of any type, wired to outputs that carry what they need, with params in their ranges, so that most
//! graphs cook.

use serde_json::{Map, Value, json};

use super::dice::Dice;
use super::params::{CONTROLS, any_form};
use super::stock::{Input, NodeType, Stock};

/// Inputs that only make sense with the output of one node type.
const MAKERS: [(&str, &str); 4] =
    [("pins", "Softbody_Pin"), ("goals", "Softbody_Goal"), ("controls", "Gust_Control"), ("body", "Tetrahedralize")];

/// Nodes that make other elements than their first input has, although it has the same component.
const REMAKERS: [&str; 2] = ["Merge", "Curve_Interpolate"];

/// Nodes that need a node that need a node, at most.
const DEEPEST: usize = 3;

/// Something that an input can be wired to.
#[derive(Clone)]
struct Wire {
    text: String,
    components: Vec<String>,
    node_type: String,
    /// Wires with one number have the same elements, perhaps moved.
    kin: usize,
}

/// A graph that grows.
pub(crate) struct Growing<'a> {
    stock: &'a Stock,
    nodes: Map<String, Value>,
    wires: Vec<Wire>,
}

/// A new graph of up to ten nodes besides its sources.
pub(crate) fn graph(stock: &Stock, dice: &mut Dice) -> Value {
    let mut growing = Growing { stock, nodes: starters(dice), wires: Vec::new() };
    growing.collect_wires();
    for _ in 0..2 + dice.below(9) {
        growing.add_any(dice);
    }
    let first = dice.below(3) as i64 - 1;
    let fps = [24.0, 24.0, 24.0, 25.0, 29.97, 1.0, 1000.0][dice.below(7)];
    let direction =
        [json!([1, 0, 0.3]), json!({"expr": "vec(cos(time), 0.1, sin(time))"}), json!({"expr": ["1", "0", "time"]})];
    let strength = [json!(0.4), json!({"expr": "0.5 + 0.3*sin(frame)"}), json!({"keyframes": [[1, 0], [3, 0.9]]})];
    json!({
        "convect": 1,
        "scene": {"frames": [first, first + 1 + dice.below(4) as i64], "fps": fps, "seed": dice.below(9)},
        "controls": {CONTROLS[0]: direction[dice.below(3)], CONTROLS[1]: strength[dice.below(3)]},
        "outputs": growing.outputs(dice),
        "nodes": growing.nodes,
    })
}

/// Adds a fitting node to `graph`, and makes it an output or the input of another.
pub(crate) fn grow(graph: &mut Value, stock: &Stock, dice: &mut Dice) {
    let Some(nodes) = graph["nodes"].as_object() else { return };
    let mut growing = Growing { stock, nodes: nodes.clone(), wires: Vec::new() };
    growing.collect_wires();
    let old = growing.wires.clone();
    growing.add_any(dice);
    let (mut nodes, Some(last)) = (growing.nodes, growing.wires.pop()) else { return };
    // What read a wire of the same elements then reads the new one.
    let inputs = old.iter().filter(|wire| wire.kin == last.kin).map(|wire| wire.text.clone()).collect::<Vec<_>>();
    let readers = nodes.iter_mut().filter(|(id, _)| **id != last.text).map(|(_, node)| node);
    let mut ports = readers.filter_map(|node| node.get_mut("inputs")?.as_object_mut()).flat_map(Map::values_mut);
    let replaced = ports.find(|port| port.as_str().is_some_and(|text| inputs.iter().any(|input| input == text)));
    match replaced {
        Some(port) if dice.one_in(3) => *port = json!(last.text),
        _ => {
            if let Some(outputs) = graph["outputs"].as_object_mut() {
                outputs.insert("added".into(), output(&last.text, dice));
            }
        }
    }
    graph["nodes"] = Value::Object(nodes);
}

/// A mesh and curves on it, both with an attribute `mask`.
fn starters(dice: &mut Dice) -> Map<String, Value> {
    let shape = dice.of(&["box", "sphere", "cylinder", "capsule", "grid", "torus", "bowl", "plate"]);
    let source = json!({"type": "Mesh_Primitive", "params": {"shape": shape, "divisions": 1 + dice.below(8)}});
    let masked = |input: &str, component: &str| {
        let params = json!({"component": component, "code": "mask = clamp(0.5 + P.y, 0, 1)"});
        json!({"type": "Attribute_Expr", "inputs": {"geometry": input}, "params": params})
    };
    let density = [1, 50, 400][dice.below(3)];
    let grown = json!({"type": "Curve_Scatter", "inputs": {"skin": "skin"}, "params": {"density": density}});
    let nodes =
        [("source", source), ("skin", masked("source", "mesh")), ("grown", grown), ("fur", masked("grown", "curves"))];
    nodes.into_iter().map(|(id, node)| (id.to_owned(), node)).collect()
}

fn output(wire: &str, dice: &mut Dice) -> Value {
    match dice.below(10) {
        0 => json!({"from": wire, "v": true}),
        1 => json!({"from": wire, "attributes": ["P", "mask"]}),
        _ => json!(wire),
    }
}

impl Growing<'_> {
    /// The outputs of a new graph: its last wires, rarely two names that differ only by case.
    fn outputs(&self, dice: &mut Dice) -> Map<String, Value> {
        let names = if dice.one_in(20) { ["d", "D"] } else { ["last", "other"] };
        let count = 1 + dice.below(2);
        let wires = self.wires.iter().rev().step_by(1 + dice.below(2)).take(count);
        names.into_iter().zip(wires).map(|(name, wire)| (name.to_owned(), output(&wire.text, dice))).collect()
    }

    /// Takes the outputs of the nodes as wires.
    fn collect_wires(&mut self) {
        let mut rest: Vec<(String, Value)> = self.nodes.iter().map(|(id, node)| (id.clone(), node.clone())).collect();
        while !rest.is_empty() {
            let before = rest.len();
            rest.retain(|(id, node)| {
                let Some(known) = node["type"].as_str().and_then(|name| self.stock.node_type(name)) else {
                    return false;
                };
                // An optional input, and one that is missing, carries nothing.
                let text = known.inputs.first().map(|input| &node["inputs"][&input.name]);
                let text = text.and_then(|wire| wire.as_str().or_else(|| wire[0].as_str()));
                let first = text.map(|text| self.wires.iter().find(|wire| wire.text == text).cloned());
                if let Some(None) = first {
                    return true;
                }
                self.take_outputs(id, known, first.flatten());
                false
            });
            if rest.len() == before {
                break;
            }
        }
    }

    /// Takes the outputs of a node whose first input is wired to `first`.
    fn take_outputs(&mut self, id: &str, node: &NodeType, first: Option<Wire>) {
        for (at, output) in node.outputs.iter().enumerate() {
            let inherited = || first.as_ref().map(|wire| wire.components.clone());
            let components = output.carries.clone().or_else(inherited).unwrap_or_default();
            let has_elements_of = |wire: &&Wire| wire.components == components;
            let kept = first.as_ref().filter(has_elements_of).filter(|_| !REMAKERS.contains(&&node.name[..]));
            let kin = kept.map_or(self.wires.len() + 1000 * self.nodes.len(), |wire| wire.kin);
            let text = if at == 0 { id.to_owned() } else { format!("{id}.{}", output.name) };
            self.wires.push(Wire { text, components, node_type: node.name.clone(), kin });
        }
    }

    /// Adds a node of any type.
    fn add_any(&mut self, dice: &mut Dice) {
        if let Some(at) = dice.index(self.stock.types.len()) {
            self.add(&self.stock.types[at].name, dice, 0);
        }
    }

    /// Adds a node; nothing if a wire that it needs cannot be made.
    fn add(&mut self, name: &str, dice: &mut Dice, depth: usize) -> Option<()> {
        let node = self.stock.node_type(name)?.clone();
        let (mut inputs, mut wired): (Map<String, Value>, Vec<Wire>) = Default::default();
        for input in &node.inputs {
            if input.is_optional && wired.len() + 1 < node.inputs.len() && dice.one_in(3) {
                continue;
            }
            let count = if input.is_list { 1 + dice.below(2) } else { 1 };
            let wires: Option<Vec<Wire>> = (0..count).map(|_| self.wire(input, &wired, dice, depth)).collect();
            let wires = match wires {
                None if input.is_optional => continue,
                wires => wires?,
            };
            let texts: Vec<&String> = wires.iter().map(|wire| &wire.text).collect();
            inputs.insert(input.name.clone(), if input.is_list { json!(texts) } else { json!(texts[0]) });
            wired.extend(wires);
        }
        let id = format!("n{}", self.nodes.len());
        let mut added = json!({"type": name, "inputs": inputs, "params": params(&node, &wired, dice)});
        let passes = node.outputs.iter().all(|output| output.carries.is_none()) || dice.one_in(8);
        if !inputs.is_empty() && passes && dice.one_in(10) {
            added["bypass"] = json!(true);
        }
        if dice.one_in(20) {
            added["note"] = json!("ß\u{1f43b} \"a note\"");
        }
        self.nodes.insert(id.clone(), added);
        self.take_outputs(&id, &node, wired.into_iter().next());
        Some(())
    }

    /// A wire for `input` of a node whose other inputs are `wired`.
    fn wire(&mut self, input: &Input, wired: &[Wire], dice: &mut Dice, depth: usize) -> Option<Wire> {
        let maker = MAKERS.iter().find(|(name, _)| *name == input.name).map(|(_, maker)| *maker);
        let fits = |wire: &&Wire| {
            maker.is_none_or(|maker| wire.node_type == maker)
                && input.needs.as_ref().is_none_or(|needs| wire.components.contains(needs))
        };
        let fitting: Vec<Wire> = self.wires.iter().filter(fits).cloned().collect();
        // Two inputs for one component are mostly for the same elements, here and there.
        let same = |wire: &&Wire| input.needs.as_ref().is_some_and(|needs| wire.components.contains(needs));
        let kin = wired.iter().filter(|_| !input.is_list).find(same);
        let kin: Vec<&Wire> = fitting.iter().filter(|wire| kin.is_some_and(|kin| kin.kin == wire.kin)).collect();
        if !kin.is_empty() && !dice.one_in(8) {
            return Some(kin[dice.below(kin.len())].clone());
        }
        if (fitting.is_empty() || dice.one_in(6)) && depth < DEEPEST {
            let made = maker.unwrap_or_else(|| match input.needs.as_deref() {
                Some("curves") => dice.of(&["Curve_Scatter", "Curve_In"]),
                Some("points") => "Point_In",
                Some("tets") => dice.of(&["Tetrahedralize", "Tetrahedralize", "Tet_In"]),
                _ => dice.of(&["Mesh_Primitive", "Mesh_Primitive", "Mesh_In"]),
            });
            self.add(made, dice, depth + 1)?;
            return self.wires.iter().rev().find(|wire| fits(wire)).cloned();
        }
        // Mostly one of the last, so that chains become long.
        let last = if dice.one_in(4) { fitting.len() } else { fitting.len().min(3) };
        dice.index(last).map(|back| fitting[fitting.len() - 1 - back].clone())
    }
}

/// Params of a new node whose inputs are `wired`.
fn params(node: &NodeType, wired: &[Wire], dice: &mut Dice) -> Map<String, Value> {
    let mut params = if wired.is_empty() { sources(&node.name, dice) } else { Map::new() };
    let component = wired.first().and_then(|wire| wire.components.first());
    for param in &node.params {
        match &param.name[..] {
            "component" if !dice.one_in(20) => _ = component.map(|kind| params.insert("component".into(), json!(kind))),
            "code" => _ = params.insert("code".into(), json!(code(dice))),
            // On a primitive as large as a house it would be the whole cost.
            "density" if node.name.starts_with("Curve") => _ = params.insert("density".into(), json!(dice.below(400))),
            _ if dice.one_in(4) => {
                let value = any_form(param, dice);
                if !value.is_null() {
                    params.insert(param.name.clone(), value);
                }
            }
            _ => {}
        }
    }
    params
}

/// A program that cooks, or any other.
fn code(dice: &mut Dice) -> String {
    const CODES: [&str; 7] = [
        "P = P + 0.02*noise(P*3 + time)",
        "mask = rand(seed + P.x)",
        "envelope = clamp(P.y, 0, 1)",
        "width = 0.001*(1 + frame)",
        "Cd = abs(sin(P*5))",
        "let a = length(P)\nP.x = P.x + 0.1*sin(a*9 + time)",
        "P = P/(P.x - P.x)",
    ];
    if dice.one_in(5) { super::values::program(dice) } else { dice.of(&CODES).to_owned() }
}

/// Geometry of a source node: a file, or a few points in the graph, with doubled ones among them.
fn sources(node: &str, dice: &mut Dice) -> Map<String, Value> {
    let points: Vec<[f64; 3]> = (0..4 + dice.below(5))
        .map(|at| [at as f64 * 0.1, (at % 3) as f64 * 0.2, [0.0, 0.3][usize::from(at % 4 == 3)]])
        .collect();
    // A curve of one CV among them; rarely there are more points than curves take.
    let counts = &[1, points.len() - 3, 2][..if dice.one_in(9) { 2 } else { 3 }];
    let value = match node {
        "Curve_In" if dice.one_in(3) => json!({"file": "in/fur_bear_10k_curves.obj"}),
        "Curve_In" => json!({"points": points, "counts": counts}),
        "Mesh_In" if dice.one_in(3) => json!({"file": dice.of(&["in/hand.obj", "in/bear.obj"])}),
        "Mesh_In" => json!({"points": points, "indices": [0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3]}),
        "Point_In" => json!({"points": points}),
        "Tet_In" => json!({"points": points, "tets": [[0, 1, 2, 3]]}),
        _ => json!({}),
    };
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::stock::Output;

    fn stock() -> Stock {
        let input = |name: &str, needs: Option<&str>| Input {
            name: name.into(),
            needs: needs.map(str::to_owned),
            ..Input::default()
        };
        let node = |name: &str, inputs: Vec<Input>, carries: Option<&str>| NodeType {
            name: name.into(),
            inputs,
            outputs: vec![Output { name: "out".into(), carries: carries.map(|kind| vec![kind.to_owned()]) }],
            ..NodeType::default()
        };
        let types = vec![
            node("Mesh_Primitive", vec![], Some("mesh")),
            node("Attribute_Expr", vec![input("geometry", None)], None),
            node("Curve_Scatter", vec![input("skin", Some("mesh"))], Some("curves")),
            node("Curve_Attach", vec![input("curves", Some("curves")), input("skin", Some("mesh"))], Some("curves")),
        ];
        Stock { graphs: Vec::new(), files: Vec::new(), types }
    }

    #[test]
    fn wires_know_what_they_carry() {
        let stock = stock();
        let mut growing = Growing { stock: &stock, nodes: starters(&mut Dice::new(1)), wires: Vec::new() };
        growing.collect_wires();
        let carried: Vec<(&str, &str)> =
            growing.wires.iter().map(|wire| (&wire.text[..], &wire.components[0][..])).collect();
        assert_eq!(carried, [("source", "mesh"), ("skin", "mesh"), ("grown", "curves"), ("fur", "curves")]);
        assert_eq!(growing.wires[2].kin, growing.wires[3].kin, "the same curves");
        assert_ne!(growing.wires[1].kin, growing.wires[2].kin);
    }

    #[test]
    fn added_nodes_read_what_fits() {
        let stock = stock();
        for seed in 0..50 {
            let graph = graph(&stock, &mut Dice::new(seed));
            let nodes = graph["nodes"].as_object().unwrap();
            assert!(nodes.len() >= 4 && !graph["outputs"].as_object().unwrap().is_empty());
            for node in nodes.values().filter(|node| node["type"] == "Curve_Attach") {
                let skin = &nodes[node["inputs"]["skin"].as_str().unwrap()];
                assert!(skin["type"] == "Mesh_Primitive" || skin["type"] == "Attribute_Expr", "{graph}");
            }
        }
    }

    #[test]
    fn a_graph_that_is_there_grows_by_a_node() {
        let mut value = json!({"nodes": starters(&mut Dice::new(1)), "outputs": {"o": "fur"}});
        grow(&mut value, &stock(), &mut Dice::new(4));
        assert!(value["nodes"].as_object().unwrap().len() > 4);
    }
}
