//! Liveness: which attributes of each node's result, and which outputs of a chain, anything downstream, or a file, takes.

use std::collections::{BTreeMap, BTreeSet};

use super::{PlannedNode, Request};
use crate::geometry::{CURVE_ID, ID, Name, P, V};
use crate::graph::{Body, Graph};
use crate::node::AttrNames;
use crate::param::{Source, Value};

/// What is taken of a result, and whether it must be there: see [`crate::node::Node::reads_if_there`]. `None` is everything.
type Taken = Option<BTreeMap<Name, bool>>;

/// Fills in `live` and `outputs_used` of every planned node, from the outputs upwards.
pub(super) fn find(graph: &Graph, request: &Request, nodes: &mut [PlannedNode<'_>]) {
    let mut taken: Vec<Taken> = vec![Some(BTreeMap::new()); graph.nodes.len()];
    for output in request.outputs.iter().map(|place| &graph.outputs[*place]) {
        let asked = output.attributes.as_ref().map(|names| {
            // Of points that are not the same any more there are no velocities: their ids tell.
            let ids = [ID.name, CURVE_ID.name].into_iter().filter(|_| output.v);
            let names = names.iter().cloned().chain([P.name, V.name].into_iter().chain(ids).map(Name::from));
            names.map(|name| (name, true)).collect()
        });
        add(&mut taken[output.from.node], asked);
    }
    for place in (0..graph.nodes.len()).rev().filter(|place| nodes[*place].needed).collect::<Vec<_>>() {
        let names = taken[place].iter().flatten();
        nodes[place].if_there = names.clone().filter(|(_, must)| !**must).map(|(name, _)| name.clone()).collect();
        nodes[place].live = taken[place].as_ref().map(|names| names.keys().cloned().collect());
        let wanted = reads(graph, place, &nodes[place], &taken[place]);
        for link in graph.nodes[place].inputs().iter().flatten() {
            add(&mut taken[link.node], wanted.clone());
        }
    }
    find_outputs(graph, request, nodes);
}

/// Finds which outputs of solvers and windows are used. Other nodes keep all of theirs: sources are cooked by the check of
/// a graph as well, which uses all.
fn find_outputs(graph: &Graph, request: &Request, nodes: &mut [PlannedNode<'_>]) {
    for (planned, node) in nodes.iter_mut().zip(&graph.nodes) {
        if let Some(declared) = node.node().filter(|declared| planned.needed && declared.cook.is_chain()) {
            planned.outputs_used = vec![false; declared.outputs.len()];
        }
    }
    let of_readers = (0..nodes.len()).filter(|place| nodes[*place].needed);
    let links = of_readers.flat_map(|place| graph.nodes[place].inputs().iter().flatten());
    let asked = request.outputs.iter().map(|place| &graph.outputs[*place].from);
    for link in links.chain(asked).copied().collect::<Vec<_>>() {
        if let Some(is_used) = nodes[link.node].outputs_used.get_mut(link.port) {
            *is_used = true;
        }
    }
    // Where all are used, the key is that of a cook of all.
    nodes.iter_mut().filter(|node| !node.outputs_used.contains(&false)).for_each(|node| node.outputs_used.clear());
}

fn add(taken: &mut Taken, more: Taken) {
    match (taken.as_mut(), more) {
        (Some(taken), Some(more)) => {
            for (name, must) in more {
                *taken.entry(name).or_default() |= must;
            }
        }
        _ => *taken = None,
    }
}

/// What a node takes of its inputs, where `taken` is taken of its own result.
fn reads(graph: &Graph, place: usize, planned: &PlannedNode<'_>, taken: &Taken) -> Taken {
    let Body::Node { node, params, .. } = &graph.nodes[place].body else { return Some(BTreeMap::new()) };
    let is_optional = |name: &str| node.if_there.iter().any(|attribute| attribute.spec().0 == name);
    let own = node.reads.iter().map(|attribute| attribute.spec().0);
    let mut reads: BTreeMap<Name, bool> = own.map(|name| (name.into(), !is_optional(name))).collect();
    let mut writes: BTreeSet<Name> = node.writes.iter().map(|attribute| attribute.spec().0.into()).collect();
    if let Some(attributes) = node.attributes {
        let Ok(params) = planned.resolver.at(graph.scene.start()) else { return None };
        let [more_reads, more_writes] = attributes(&params);
        match more_reads {
            AttrNames::These(names) => reads.extend(names.into_iter().map(|name| (name, true))),
            AttrNames::All => return None,
        }
        if let AttrNames::These(names) = more_writes {
            writes.extend(names);
        }
    }
    reads.insert(P.name.into(), true);
    for source in params.iter() {
        match source {
            Source::Masked(_, attribute) | Source::Constant(Value::Masked(_, Some(attribute))) => {
                reads.insert(attribute.clone(), true);
            }
            Source::Keys(keys, _) => reads.extend(keys.keys.iter().filter_map(|(_, value)| match value {
                Value::Masked(_, attribute) => attribute.clone().map(|attribute| (attribute, true)),
                _ => None,
            })),
            _ => {}
        }
    }
    let mut wanted = Some(reads);
    let through = taken.as_ref().map(|taken| {
        let through = taken.iter().filter(|(name, _)| !writes.contains(*name));
        through.map(|(name, must)| (name.clone(), *must)).collect()
    });
    add(&mut wanted, through);
    wanted
}
