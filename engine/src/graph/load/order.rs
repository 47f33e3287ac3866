//! The order in which nodes cook, and the cycles that leave none.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

/// Nodes by number, each after all its sources; and what cannot be ordered.
#[derive(Debug, PartialEq)]
pub(super) struct Order {
    /// The lowest number first where several could be next. Nodes of cycles, and those behind them, are missing.
    pub(super) nodes: Vec<usize>,
    /// One shortest cycle of each knot of cycles, from its lowest node, each node a source of the next and the last of
    /// the first; knots in the order of their lowest nodes.
    pub(super) cycles: Vec<Vec<usize>>,
}

/// Orders nodes, given the sources of each.
pub(super) fn order(sources: &[Vec<usize>]) -> Order {
    let mut targets = vec![Vec::new(); sources.len()];
    for (node, sources) in sources.iter().enumerate() {
        sources.iter().for_each(|source| targets[*source].push(node));
    }
    let mut waiting: Vec<usize> = sources.iter().map(Vec::len).collect();
    let mut ready: BinaryHeap<Reverse<usize>> = (0..sources.len()).filter(|n| waiting[*n] == 0).map(Reverse).collect();
    let mut order = Vec::with_capacity(sources.len());
    while let Some(Reverse(node)) = ready.pop() {
        order.push(node);
        for target in &targets[node] {
            waiting[*target] -= 1;
            if waiting[*target] == 0 {
                ready.push(Reverse(*target));
            }
        }
    }
    let cycles = if order.len() == sources.len() { Vec::new() } else { cycles(&targets) };
    Order { nodes: order, cycles }
}

fn cycles(targets: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let edges =
        targets.iter().enumerate().flat_map(|(node, targets)| targets.iter().map(move |t| (node as u32, *t as u32)));
    let graph: DiGraph<(), ()> = DiGraph::from_edges(edges);
    let knots: Vec<Vec<usize>> =
        kosaraju_scc(&graph).iter().map(|knot| knot.iter().map(|node: &NodeIndex| node.index()).collect()).collect();
    let mut knot_of = vec![0; targets.len()];
    for (number, knot) in knots.iter().enumerate() {
        knot.iter().for_each(|node| knot_of[*node] = number);
    }
    // Knots share no node, so they share the table.
    let mut reached_from = vec![None; targets.len()];
    let starts = knots.iter().filter_map(|knot| knot.iter().min());
    let mut cycles: Vec<Vec<usize>> =
        starts.filter_map(|start| shortest_cycle(*start, targets, &knot_of, &mut reached_from)).collect();
    cycles.sort();
    cycles
}

/// The shortest way from `start` back to it; `None` where there is none.
fn shortest_cycle(
    start: usize,
    targets: &[Vec<usize>],
    knot_of: &[usize],
    reached_from: &mut [Option<usize>],
) -> Option<Vec<usize>> {
    let mut next = VecDeque::from([start]);
    while let Some(node) = next.pop_front() {
        for target in targets[node].iter().filter(|target| knot_of[**target] == knot_of[start]) {
            if *target == start {
                let mut way: Vec<usize> = std::iter::successors(Some(node), |node| reached_from[*node]).collect();
                way.reverse();
                return Some(way);
            }
            if reached_from[*target].is_none() {
                reached_from[*target] = Some(node);
                next.push_back(*target);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(sources: &[&[usize]]) -> Order {
        order(&sources.iter().map(|sources| sources.to_vec()).collect::<Vec<_>>())
    }

    #[test]
    fn nodes_come_after_their_sources_and_else_in_the_order_of_the_file() {
        assert_eq!(ordered(&[&[], &[], &[1, 0], &[]]).nodes, [0, 1, 2, 3]);
        assert_eq!(ordered(&[&[2], &[], &[1, 1], &[]]).nodes, [1, 2, 0, 3]);
    }

    #[test]
    fn each_knot_gives_its_shortest_cycle_from_its_first_node() {
        assert_eq!(ordered(&[&[0]]).cycles, [[0]]);
        assert_eq!(ordered(&[&[1], &[0], &[1]]), Order { nodes: vec![], cycles: vec![vec![0, 1]] });
        // 4 → 0 → 1 → 2 → 3 → 4, with a short cut 1 → 3.
        assert_eq!(ordered(&[&[4], &[0], &[1], &[2, 1], &[3]]).cycles, [[0, 1, 3, 4]]);
        assert_eq!(
            ordered(&[&[1], &[0], &[3], &[2], &[]]),
            Order { nodes: vec![4], cycles: vec![vec![0, 1], vec![2, 3]] }
        );
    }

    #[test]
    fn a_long_chain_needs_no_deep_stack() {
        let mut chain: Vec<Vec<usize>> =
            (0..200_000).map(|node: usize| node.checked_sub(1).into_iter().collect()).collect();
        assert_eq!(order(&chain).nodes.len(), chain.len());
        chain[0].push(199_999);
        assert_eq!(order(&chain).cycles[0].len(), chain.len());
    }
}
