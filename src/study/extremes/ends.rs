//! The values at both ends of a param's range, as `--set` takes them.

use engine::graph::{Body, Graph, GraphNode};
use engine::param::{ParamSpec, Params, Shape, Source, Unset, Value};

use crate::study::knobs::number_text;

/// Where a range has no end: this many times the usual value.
const FAR: f64 = 1e6;

/// The same of whole numbers, which may be counts of elements.
const MANY: f64 = 1e3;

/// A direction has no range: its shortest and its longest vectors.
const DIRECTIONS: [&str; 2] = ["[0, -1e-20, 0]", "[1e20, 1e20, 1e20]"];

/// Whole turns and a part of one, degrees.
const TURNS: [&str; 2] = ["[-1e6, -1e6, -1e6]", "[1e6, 1e6, 1e6]"];

/// A param of a graph at an end of its range.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct End {
    /// `node.param`.
    pub(super) key: String,
    /// The value.
    pub(super) value: String,
    /// Whether the param is read with the other params as the graph has them.
    pub(super) is_read: bool,
}

/// Every end of every param of these nodes, and how many params have no range.
pub(super) fn of(graph: &Graph, nodes: impl Iterator<Item = usize>) -> (Vec<End>, usize) {
    let (mut ends, mut without) = (Vec::new(), 0);
    for node in nodes.map(|index| &graph.nodes[index]) {
        let Body::Node { specs, params: sources, .. } = &node.body else { continue };
        let params = at_start(node, graph);
        for (spec, source) in specs.iter().zip(sources.iter()) {
            let values = values(spec, source);
            // The frame of a single file is not read.
            if values.is_empty() || spec.facts.unset == Unset::CurrentFrame {
                without += 1;
                continue;
            }
            let is_read = spec.facts.when.zip(params.as_ref()).is_none_or(|(when, params)| when(params));
            let end = |value| End { key: format!("{}.{}", node.id, spec.name), value, is_read };
            ends.extend(values.into_iter().map(end));
        }
    }
    (ends, without)
}

/// The params of a node at the scene's first frame.
fn at_start(node: &GraphNode, graph: &Graph) -> Option<Params> {
    let Body::Node { specs, params, .. } = &node.body else { return None };
    let (frame, clock) = (graph.scene.start().number(), graph.scene.clock());
    Some(Params::new(specs.clone(), params.iter().map(|source| source.at(frame, clock)).collect()))
}

/// The values at the ends of a param's range, the lower first; the other words of a choice. None for texts, files and lists.
fn values(spec: &ParamSpec, source: &Source) -> Vec<String> {
    let [low, high] = range(spec);
    let both = |text: &dyn Fn(f64) -> String| vec![text(low), text(high)];
    match spec.shape {
        Shape::Float => both(&float),
        Shape::Int => both(&number_text),
        Shape::Masked => both(&|x| match source.mask() {
            Some(attribute) => format!("{{\"value\": {}, \"attribute\": {attribute:?}}}", float(x)),
            None => float(x),
        }),
        Shape::Seed => vec!["0".into(), u32::MAX.to_string()],
        Shape::Vec2 | Shape::Span => both(&|x| list::<2>(x, &float)),
        Shape::Vec3 if spec.facts.direction => DIRECTIONS.map(String::from).to_vec(),
        Shape::Vec3 => both(&|x| list::<3>(x, &float)),
        Shape::Int3 => both(&|x| list::<3>(x, &number_text)),
        Shape::Turn => TURNS.map(String::from).to_vec(),
        Shape::Ramp => both(&|y| format!("{{\"ramp\": [[0, {0}], [1, {0}]]}}", float(y))),
        Shape::Bool => {
            let other = |value: &bool| !matches!(source, Source::Constant(Value::Bool(own)) if own == value);
            [false, true].iter().filter(|value| other(value)).map(bool::to_string).collect()
        }
        Shape::Choice(options) => {
            let own = match source {
                Source::Constant(Value::Choice(own)) => Some(*own),
                _ => None,
            };
            let others = options.iter().enumerate().filter(|(index, _)| Some(*index) != own);
            others.map(|(_, option)| option.word.to_owned()).collect()
        }
        Shape::Text
        | Shape::Texts
        | Shape::File
        | Shape::Vec3s
        | Shape::Ints
        | Shape::Tets
        | Shape::Columns
        | Shape::Code => Vec::new(),
    }
}

fn list<const N: usize>(x: f64, text: &dyn Fn(f64) -> String) -> String {
    format!("[{}]", [(); N].map(|()| text(x)).join(", "))
}

/// A number as a graph has it, large ones with an exponent.
fn float(x: f64) -> String {
    if x.abs() >= 1e6 { format!("{x:e}") } else { number_text(x) }
}

/// The ends of a param's hard range. Where it has none, that many times its usual value; where the end itself is refused, as
/// small a share of it.
fn range(spec: &ParamSpec) -> [f64; 2] {
    let hard = spec.facts.hard;
    let is_whole = matches!(spec.shape, Shape::Int | Shape::Int3);
    let factor = if is_whole { MANY } else { FAR };
    let usual = match spec.facts.soft {
        Some([low, high]) => low.abs().max(high.abs()),
        None => largest(&spec.default),
    };
    let usual = if usual > 0.0 { usual } else { 1.0 };
    let far = factor * usual;
    let high = if hard.high.is_finite() { hard.high } else { far.max(hard.low + usual) };
    let low = match (hard.low.is_finite(), hard.open) {
        (true, true) if is_whole => hard.low + 1.0,
        (true, true) => hard.low + usual / factor,
        (true, false) => hard.low,
        (false, _) => -far,
    };
    if is_whole { [low.ceil(), high.floor()] } else { [low, high] }
}

/// The largest magnitude among the numbers of a value.
fn largest(value: &Value) -> f64 {
    let of = |numbers: &[f64]| numbers.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    match value {
        Value::Vec2(v) | Value::Span(v) => of(v),
        Value::Vec3(v) => of(v),
        Value::Int3(v) => of(&v.map(|i| i as f64)),
        Value::Ramp(ramp) => ramp.keys().iter().fold(0.0, |most, [_, y]| most.max(f64::from(y.abs()))),
        value => value.number().abs(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::param::{Maskable, Param, ParamDecl};

    fn of(spec: &ParamSpec) -> Vec<String> {
        values(spec, &Source::Constant(spec.default.clone()))
    }

    #[test]
    fn ends_are_those_of_the_hard_range_or_far_beyond_the_usual_one() {
        assert_eq!(of(&Param::<f32>::float("x", 0.5, "").within(0.0, 1.0).spec()), ["0", "1"]);
        assert_eq!(of(&Param::<f32>::float("x", 0.5, "").above(0.0).soft(0.1, 2.0).spec()), ["2e-6", "2e6"]);
        assert_eq!(of(&Param::<f32>::float("x", 3.0, "").spec()), ["-3e6", "3e6"]);
        assert_eq!(of(&Param::<i64>::int("n", 8, "").at_least(1.0).spec()), ["1", "8000"]);
        assert_eq!(of(&Param::<[f32; 3]>::vec3("v", [0.0; 3], "").spec())[1], "[1e6, 1e6, 1e6]");
        assert_eq!(of(&Param::<[f64; 3]>::direction("d", [1.0, 0.0, 0.0], "").spec()), DIRECTIONS);
        assert_eq!(of(&Param::<bool>::bool("b", true, "").spec()), ["false"]);
    }

    #[test]
    fn a_mask_stays() {
        let spec = Param::<Maskable>::maskable("x", 0.5, "").within(0.0, 1.0).spec();
        let source = Source::Constant(Value::Masked(0.5, Some("soft".into())));
        assert_eq!(values(&spec, &source)[1], r#"{"value": 1, "attribute": "soft"}"#);
    }

    #[test]
    fn every_end_of_every_param_of_the_catalogue_is_accepted_as_the_value_of_a_graph() {
        let mut count = 0;
        for node in crate::CATALOGUE.nodes() {
            for spec in node.param_specs() {
                for value in values(&spec, &Source::Constant(spec.default.clone())) {
                    let json = crate::study::knobs::to_json(&value);
                    let text = format!(
                        r#"{{"convect": 1, "nodes": {{"n": {{"type": "{}", "params": {{"{}": {json}}}}}}}, "outputs": {{}}}}"#,
                        node.name, spec.name
                    );
                    let Err(faults) = crate::load::loaded(text.as_bytes(), std::path::Path::new("g.json"), &[]) else {
                        count += 1;
                        continue;
                    };
                    let of_param = format!("nodes.n.params.{}", spec.name);
                    let fault = faults.iter().find(|fault| fault.path.starts_with(&of_param));
                    assert!(fault.is_none(), "{}.{} = {value}: {}", node.name, spec.name, fault.unwrap());
                    count += 1;
                }
            }
        }
        assert!(count > 200, "{count}");
    }
}
