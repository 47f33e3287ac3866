//! Depth: no graph overflows the stack, however long its chains of nodes are.

use engine::graph::Link;
use engine::node::Node;

use crate::builder::TestGraph;
use crate::nodes::{ADD, CLOCK, FOLLOW, SOURCE, SUM};

/// `count` nodes in a row over two points; the last is the output.
fn chain(count: usize, node: &'static Node, moves: bool) -> TestGraph {
    let mut graph = TestGraph::new(1, 2);
    let mut last = graph.add("source", &SOURCE).done();
    if moves {
        last = graph.add("moving", &CLOCK).wire("points", last).done();
    }
    for _ in 1..count {
        last = graph.add("node", node).wire("points", last).done();
    }
    graph.output(last);
    graph
}

#[test]
fn a_chain_of_thirty_thousand_nodes_cooks() {
    let cooked = chain(30_000, &ADD, true).cook(1..=1);
    assert!(cooked.x(1.0).is_finite() && cooked.report.nodes.iter().all(|node| node.cooks == 1));
}

#[test]
fn a_chain_of_three_thousand_windows_cooks() {
    for moves in [false, true] {
        let cooked = chain(3_000, &FOLLOW, moves).cook(1..=1);
        assert!(cooked.x(1.0).is_finite() && cooked.report.errors.is_empty());
    }
}

#[test]
fn a_node_with_fifty_thousand_wires_cooks() {
    let mut graph = TestGraph::new(1, 1);
    let source = graph.add("source", &SOURCE).done();
    let ends: Vec<Link> = (0..50_000).map(|_| source).collect();
    let sum = ends.into_iter().fold(graph.add("sum", &SUM), |sum, end| sum.wire("points", end));
    let sum = sum.done();
    graph.output(sum);
    assert!(graph.cook(1..=1).report.errors.is_empty());
}
