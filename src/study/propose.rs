//! Knobs worth a study: what the nodes that an output depends on declare, as commands ready to run.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use engine::graph::{Body, Graph, GraphNode};
use engine::node::{Accuracy, Trials};
use engine::param::{Source, Value};

use crate::numbers::short;

/// A command for each knob.
pub(super) fn text(graph: &Graph, output: usize, graph_name: &str) -> String {
    let needed = upstream(graph, graph.outputs[output].from.node);
    let name = &graph.outputs[output].name;
    let mut text = String::new();
    for index in needed.iter().copied() {
        let node = &graph.nodes[index];
        // Where points come and go between the knob and the output, they cannot be matched.
        let norm = if changes_topology(graph, index, &needed) { " --norm surface" } else { "" };
        for accuracy in node.node().map_or(&[][..], |declared| declared.accuracy) {
            let key = format!("{}.{}", node.id, accuracy.param);
            let order = accuracy.order.map(|order| format!(", order {}", short(order))).unwrap_or_default();
            let _ = match values(node, accuracy) {
                Some(values) => writeln!(text, "# {} of {}{order}", accuracy.param, node.type_name()).and_then(|()| {
                    writeln!(text, "convect study {graph_name} --knob {key}={} --output {name}{norm}", values.join(","))
                }),
                None => writeln!(
                    text,
                    "# {} of {}{order}: its value is animated or chosen by the node; set one, and try it with its half and double",
                    key,
                    node.type_name()
                ),
            };
        }
    }
    match text.is_empty() {
        true => format!(
            "no node of the output `{name}` declares a param that trades accuracy for time; any param can be a knob: \
             --knob node.param=VALUE,VALUE,…\n"
        ),
        false => text,
    }
}

/// Whether a node, or one of `needed` that depends on it, makes points come and go.
fn changes_topology(graph: &Graph, node: usize, needed: &BTreeSet<usize>) -> bool {
    let mut after = BTreeSet::from([node]);
    for index in needed.range(node + 1..) {
        if graph.nodes[*index].inputs().iter().flatten().any(|link| after.contains(&link.node)) {
            after.insert(*index);
        }
    }
    after.iter().any(|index| graph.nodes[*index].node().is_some_and(|declared| declared.changes_topology))
}

/// The nodes that a node depends on, and itself.
pub(super) fn upstream(graph: &Graph, node: usize) -> BTreeSet<usize> {
    let mut needed = BTreeSet::from([node]);
    // Each node comes after those it reads.
    for index in (0..=node).rev() {
        if needed.contains(&index) {
            needed.extend(graph.nodes[index].inputs().iter().flatten().map(|link| link.node));
        }
    }
    needed
}

/// The values to compare, as `--knob` takes them.
fn values(node: &GraphNode, accuracy: &Accuracy) -> Option<Vec<String>> {
    match accuracy.trials {
        Trials::These(values) => Some(values.iter().map(|value| (*value).to_owned()).collect()),
        Trials::Times(factors) => {
            let Body::Node { specs, params, .. } = &node.body else { return None };
            let place = specs.iter().position(|spec| spec.name == accuracy.param)?;
            let Source::Constant(Value::Float(current)) = &params[place] else { return None };
            (*current > 0.0).then(|| factors.iter().map(|factor| short(current * factor)).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::node::Node;
    use engine::param::Shape;

    /// What a node's declarations of accuracy name that it does not have, or that `--knob` does not take.
    fn faults(node: &Node) -> Vec<String> {
        let (specs, mut faults) = (node.param_specs(), Vec::new());
        for accuracy in node.accuracy {
            let fault = |what: String| format!("{}, `{}`: {what}", node.name, accuracy.param);
            if !specs.iter().any(|spec| spec.name == accuracy.param) {
                faults.push(fault("no such param".into()));
            }
            for (other, word) in accuracy.exact.iter().chain(&accuracy.needs) {
                match specs.iter().find(|spec| spec.name == *other).map(|spec| spec.shape) {
                    Some(Shape::Choice(options)) if options.iter().any(|option| option.word == *word) => {}
                    Some(_) => faults.push(fault(format!("`{other}` cannot be `{word}`"))),
                    None => faults.push(fault(format!("no param `{other}`"))),
                }
            }
            if let Trials::These(values) = accuracy.trials {
                let knob = format!("node.{}={}", accuracy.param, values.join(","));
                faults.extend(knob.parse::<crate::study::knobs::KnobArg>().err().map(fault));
            }
        }
        faults
    }

    #[test]
    fn every_declared_accuracy_names_a_param_and_values_of_it() {
        assert_eq!(crate::CATALOGUE.nodes().flat_map(faults).collect::<Vec<_>>(), [""; 0]);
        assert!(crate::CATALOGUE.nodes().filter(|node| !node.accuracy.is_empty()).count() >= 4);
    }
}
