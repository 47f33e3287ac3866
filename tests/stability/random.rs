//! Random graphs from the catalogue, with params in and out of range: every result is finite, with the same bits on one thread
//! and on three, or refused with a message; a constant out of its range is always refused.
//!
//! They are cooked for a bounded time: a few seconds, or CONVECT_RANDOM_SECONDS. A finding names its seed, with which
//! CONVECT_RANDOM_SEED repeats that graph alone; seeds that once found something are in random_seeds.txt and run first.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use conformance::range_ends;
use engine::clock::Stopwatch;
use engine::error::ErrorKind;
use engine::geometry::Kind;
use engine::graph::{Graph, GraphOutput, Link, probe};
use engine::node::{Arity, Carries, Node};
use engine::param::{ParamSpec, Shape, Value};
use numerics::random::Key;

use crate::every_node::{Change, Cooked, SOURCES, cook_for, json, judged, needed, wire};

/// Seconds that the graphs take together, unless CONVECT_RANDOM_SECONDS says it.
const SECONDS: f64 = 4.0;

/// The first seed.
const FIRST: u64 = 1;

/// Frames of a graph.
const FRAMES: i64 = 2;

/// Params that set how many cells, tets or curves there are: only their defaults are cheap.
const SIZES: [&str; 6] = ["spacing", "cell", "density", "domain_from", "domain_to", "origin"];

/// The largest whole number that is tried within a range: counts take as long as they are large.
const MOST: f64 = 8.0;

/// Random numbers, one after the other.
struct Dice {
    key: Key,
    count: u64,
}

impl Dice {
    fn next(&mut self) -> Key {
        self.count += 1;
        self.key.of(self.count)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next().u64() % n.max(1) as u64) as usize
    }

    fn happens(&mut self, share: f64) -> bool {
        self.next().f64() < share
    }

    fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.next().f64()
    }
}

/// A graph as text, and whether a param is out of its range.
struct Random {
    text: String,
    is_illegal: bool,
    /// The types of its nodes, for messages.
    types: Vec<&'static str>,
}

fn random(seed: u64) -> Random {
    let mut dice = Dice { key: Key::new(seed), count: 0 };
    // What reads files has no values to begin with.
    let types: Vec<&'static Node> = convect::CATALOGUE.nodes().filter(|node| !node.name.ends_with("_In")).collect();
    let mut carried: BTreeMap<Kind, Vec<String>> = BTreeMap::new();
    let mut random = Random { text: String::new(), is_illegal: false, types: Vec::new() };
    let mut nodes = String::new();
    for number in 0..1 + dice.below(4) {
        let node = types[dice.below(types.len())];
        let mut kinds = BTreeMap::new();
        let mut inputs = Vec::new();
        for input in node.input_specs() {
            let least = match input.arity {
                Arity::One => 1,
                Arity::Optional => 0,
                Arity::Many { least, .. } => least,
            };
            if least == 0 && dice.happens(0.5) {
                continue;
            }
            let plain = wire(node.name, input.name);
            let kind = kind_of(plain);
            let made = kind.and_then(|kind| carried.get(&kind)).filter(|made| !made.is_empty());
            let from = match made {
                Some(made) if dice.happens(0.7) => made[dice.below(made.len())].clone(),
                _ => plain.to_owned(),
            };
            kinds.extend(kind.map(|kind| (input.name, kind)));
            let is_list = matches!(input.arity, Arity::Many { .. });
            inputs.push(if is_list {
                format!(r#""{}": ["{from}"]"#, input.name)
            } else {
                format!(r#""{}": "{from}""#, input.name)
            });
        }
        let needed = needed(node.name);
        let mut params: Vec<String> = if needed.is_empty() { Vec::new() } else { vec![needed.to_owned()] };
        for spec in node.param_specs().iter().filter(|spec| !needed.contains(&format!("\"{}\"", spec.name))) {
            if SIZES.contains(&spec.name) || !dice.happens(0.3) {
                continue;
            }
            let Some((value, is_illegal)) = value(spec, &mut dice) else { continue };
            random.is_illegal |= is_illegal;
            params.push(format!(r#""{}": {value}"#, spec.name));
        }
        let id = format!("n{number}");
        let _ = write!(
            nodes,
            r#"{}"{id}": {{ "type": "{}", "inputs": {{ {} }}, "params": {{ {} }} }}"#,
            if number == 0 { "" } else { ", " },
            node.name,
            inputs.join(", "),
            params.join(", ")
        );
        for output in node.outputs {
            let kind = match output.carries {
                Carries::Kinds([kind]) => Some(*kind),
                Carries::Like(input) => kinds.get(input).copied(),
                _ => None,
            };
            if let Some(kind) = kind {
                carried.entry(kind).or_default().push(format!("{id}.{}", output.name));
            }
        }
        random.types.push(node.name);
    }
    let scene = format!(r#""scene": {{ "frames": [1, {FRAMES}], "seed": {} }}"#, dice.below(1000));
    random.text =
        format!(r#"{{ "convect": 1, {scene}, "outputs": {{ "out": "n0" }}, "nodes": {{ {SOURCES} {nodes} }} }}"#);
    random
}

/// The component that a node of the sources gives.
fn kind_of(wire: &str) -> Option<Kind> {
    match wire {
        "curves" => Some(Kind::Curves),
        "mesh" => Some(Kind::Mesh),
        "tets" => Some(Kind::Tets),
        "points" => Some(Kind::Points),
        // Marked by the nodes that made them: nothing else serves.
        _ => None,
    }
}

/// A value as a graph writes it, and whether it is out of the param's range.
fn value(spec: &ParamSpec, dice: &mut Dice) -> Option<(String, bool)> {
    let ends = range_ends(spec);
    if dice.happens(0.05) && !ends.is_empty() {
        return Some((json(&ends[dice.below(ends.len())].outside)?, true));
    }
    let hard = spec.facts.hard;
    let [low, high] = spec.facts.soft.unwrap_or([hard.low.max(-10.0), hard.high.min(10.0)]);
    let is_whole = matches!(spec.shape, Shape::Int | Shape::Int3);
    // Now and then a thousand times the usual.
    let widen = if !is_whole && dice.happens(0.1) { 1e3 } else { 1.0 };
    let ends = [(low * widen).max(hard.low), (high * widen).min(hard.high)];
    let ends = if is_whole { [ends[0], ends[1].min(MOST).max(ends[0])] } else { ends };
    let mut number = || {
        let x = if dice.happens(0.1) { ends[dice.below(2)] } else { dice.within(ends) };
        if hard.open && x <= hard.low { ends[1] } else { x }
    };
    let value = match spec.shape {
        Shape::Float => Value::Float(number()),
        Shape::Masked => Value::Masked(number(), None),
        Shape::Int => Value::Int(number().floor() as i64),
        Shape::Seed => Value::Int(number().abs() as i64),
        Shape::Vec2 => Value::Vec2([number(), number()]),
        Shape::Vec3 => Value::Vec3([number(), number(), number()]),
        Shape::Int3 => Value::Int3([number().floor() as i64; 3]),
        Shape::Span => {
            let (a, b) = (number() as f32, number() as f32);
            return Some((format!("[{:?}, {:?}]", a.min(b), a.max(b)), false));
        }
        Shape::Bool => return Some((dice.happens(0.5).to_string(), false)),
        Shape::Choice(options) => return Some((format!("{:?}", options[dice.below(options.len())].word), false)),
        _ => return None,
    };
    Some((json(&value)?, false))
}

/// Cooks the last node of a random graph.
fn cooked(random: &Random, threads: usize) -> Result<Cooked, String> {
    let loaded = Graph::load(&random.text, std::path::Path::new("."), convect::CATALOGUE, &[], &probe);
    let mut graph = loaded.map_err(|faults| faults[0].to_string())?;
    let last = format!("n{}", random.types.len() - 1);
    let node = graph.nodes.iter().position(|node| *node.id == *last).unwrap();
    let outputs = graph.nodes[node].node().map_or(1, |node| node.outputs.len());
    let output = |port: usize| GraphOutput {
        name: format!("out{port}").as_str().into(),
        from: Link { node, port },
        attributes: None,
        v: false,
    };
    graph.outputs = (0..outputs).map(output).collect();
    let declared = graph.nodes[node].node().unwrap();
    Ok(cook_for(graph, declared, Change::Nothing, threads, FRAMES))
}

/// What is wrong with the graph of a seed; else whether it was refused.
fn fault(seed: u64) -> Result<bool, String> {
    let random = random(seed);
    let named = |said: &str| format!("seed {seed}, {}: {said}\n{}", random.types.join(", "), random.text);
    let once = match cooked(&random, 1) {
        Err(said) if said.is_empty() => return Err(named("a fault without words")),
        Err(_) => return Ok(true),
        Ok(_) if random.is_illegal => return Err(named("a param out of its range is taken")),
        Ok(once) => once,
    };
    judged(&once).map_err(|said| named(&said))?;
    match cooked(&random, 3) {
        Ok(again) if again == once => Ok(once.errors.iter().any(|(kind, _)| *kind == ErrorKind::Refused)),
        _ => Err(named("other bits on three threads than on one")),
    }
}

#[test]
fn random_graphs_are_finite_or_refused() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<f64>().unwrap());
    if let Some(seed) = number("CONVECT_RANDOM_SEED") {
        println!("{}", random(seed as u64).text);
        fault(seed as u64).unwrap_or_else(|said| panic!("{said}"));
        return;
    }
    let stored = include_str!("random_seeds.txt").lines().filter(|line| !line.starts_with('#'));
    let mut seeds =
        stored.map(|line| line.split_whitespace().next().unwrap().parse().unwrap()).collect::<Vec<u64>>().into_iter();
    let (watch, seconds) = (Stopwatch::start(), number("CONVECT_RANDOM_SECONDS").unwrap_or(SECONDS));
    let (mut wrong, mut tried, mut finite, mut next) = (Vec::new(), 0, 0, FIRST..);
    // At least a few, however slow the machine is.
    while tried < 8 || watch.wall().as_secs_f64() < seconds || seeds.len() > 0 {
        let Some(seed) = seeds.next().or_else(|| next.next()) else { break };
        match fault(seed) {
            Ok(refused) => finite += usize::from(!refused),
            Err(said) => wrong.push(said),
        }
        tried += 1;
    }
    println!("{tried} graphs, {finite} of them finite");
    assert!(wrong.is_empty(), "CONVECT_RANDOM_SEED repeats one of them:\n{}", wrong.join("\n"));
    assert!(finite * 10 > tried, "hardly a graph can be cooked: {finite} of {tried}");
}
