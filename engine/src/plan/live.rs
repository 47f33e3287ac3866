//! Attribute liveness: which attributes of each node's result anything downstream, or a file, takes.

use std::collections::{BTreeMap, BTreeSet};

use super::{PlannedNode, Request};
use crate::geometry::{CURVE_ID, ID, Name, P, V};
use crate::graph::{Body, Graph};
use crate::node::AttrNames;
use crate::param::{Source, Value};

/// What is taken of a result, and whether it must be there: see [`crate::node::Node::reads_if_there`]. `None` is everything.
type Taken = Option<BTreeMap<Name, bool>>;

/// Fills in `live` of every planned node, from the outputs upwards.
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
