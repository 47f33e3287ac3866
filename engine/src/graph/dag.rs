//! The directed acyclic graph of wires: an edge from each node to each node that reads it.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::{Dfs, Reversed, VisitMap};
use petgraph::{Incoming, Outgoing};

use super::Graph;

/// Nodes by index and the wires between them; several wires between the same two nodes are one edge. While a graph file
/// is being loaded it may still contain cycles.
pub(crate) struct Dag(DiGraph<(), ()>);

/// A topological order of the nodes, and the cycles that prevent some of them from having a position in it.
#[derive(Debug, PartialEq)]
pub(super) struct Order {
    /// Indices of nodes, each after all its sources. Where several could be next, the lowest index is first. Nodes on
    /// cycles, and those that depend on them, are left out.
    pub(super) nodes: Vec<usize>,
    /// For each strongly connected component the shortest cycle through its lowest node, starting there: each node is a
    /// source of the next, and the last of the first. Sorted by their lowest nodes.
    pub(super) cycles: Vec<Vec<usize>>,
}

impl Dag {
    /// Builds the graph from the sources of each node.
    pub(super) fn new(sources: &[Vec<usize>]) -> Self {
        let edges = sources.iter().map(Vec::len).sum();
        let mut dag = DiGraph::with_capacity(sources.len(), edges);
        for _ in 0..sources.len() {
            dag.add_node(());
        }
        // petgraph lists the neighbours of a node with the latest edge first: edges added in descending order come out
        // ascending.
        for (node, sources) in sources.iter().enumerate().rev() {
            let mut sources = sources.clone();
            sources.sort_unstable_by_key(|source| Reverse(*source));
            sources.dedup();
            for source in sources {
                dag.add_edge(NodeIndex::new(source), NodeIndex::new(node), ());
            }
        }
        Self(dag)
    }

    /// The wires of a checked graph.
    pub(crate) fn of(graph: &Graph) -> Self {
        let sources = |node: &super::GraphNode| node.inputs().iter().flatten().map(|link| link.node).collect();
        Self::new(&graph.nodes.iter().map(sources).collect::<Vec<_>>())
    }

    /// The nodes that read `node`, without repetition, ascending.
    pub(crate) fn readers(&self, node: usize) -> impl Iterator<Item = usize> {
        self.0.neighbors_directed(NodeIndex::new(node), Outgoing).map(NodeIndex::index)
    }

    /// The nodes that `node` reads, without repetition, ascending.
    pub(crate) fn sources(&self, node: usize) -> impl Iterator<Item = usize> {
        self.0.neighbors_directed(NodeIndex::new(node), Incoming).map(NodeIndex::index)
    }

    /// For each node, whether it is one of `nodes` or an ancestor of one.
    pub(crate) fn upstream(&self, nodes: impl IntoIterator<Item = usize>) -> Vec<bool> {
        let reversed = Reversed(&self.0);
        let mut search = Dfs::empty(reversed);
        for node in nodes {
            search.move_to(NodeIndex::new(node));
            while search.next(reversed).is_some() {}
        }
        self.0.node_indices().map(|node| search.discovered.is_visited(&node)).collect()
    }

    /// The order in which nodes cook.
    pub(super) fn order(&self) -> Order {
        let count = self.0.node_count();
        let mut waiting: Vec<usize> = (0..count).map(|node| self.sources(node).count()).collect();
        let mut ready: BinaryHeap<Reverse<usize>> = (0..count).filter(|n| waiting[*n] == 0).map(Reverse).collect();
        let mut nodes = Vec::with_capacity(count);
        while let Some(Reverse(node)) = ready.pop() {
            nodes.push(node);
            for reader in self.readers(node) {
                waiting[reader] -= 1;
                if waiting[reader] == 0 {
                    ready.push(Reverse(reader));
                }
            }
        }
        let cycles = if nodes.len() == count { Vec::new() } else { self.cycles() };
        Order { nodes, cycles }
    }

    fn cycles(&self) -> Vec<Vec<usize>> {
        let components = kosaraju_scc(&self.0);
        let mut component_of = vec![0; self.0.node_count()];
        for (number, component) in components.iter().enumerate() {
            component.iter().for_each(|node| component_of[node.index()] = number);
        }
        // Components are disjoint, so one table serves all searches.
        let mut reached_from = vec![None; self.0.node_count()];
        let starts = components.iter().filter_map(|component| component.iter().min());
        let mut cycles: Vec<Vec<usize>> =
            starts.filter_map(|start| self.shortest_cycle(start.index(), &component_of, &mut reached_from)).collect();
        cycles.sort();
        cycles
    }

    /// The shortest path from `start` back to it; `None` where there is none.
    fn shortest_cycle(
        &self,
        start: usize,
        component_of: &[usize],
        reached_from: &mut [Option<usize>],
    ) -> Option<Vec<usize>> {
        let mut next = VecDeque::from([start]);
        while let Some(node) = next.pop_front() {
            for reader in self.readers(node).filter(|reader| component_of[*reader] == component_of[start]) {
                if reader == start {
                    let mut path: Vec<usize> = std::iter::successors(Some(node), |node| reached_from[*node]).collect();
                    path.reverse();
                    return Some(path);
                }
                if reached_from[reader].is_none() {
                    reached_from[reader] = Some(node);
                    next.push_back(reader);
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dag(sources: &[&[usize]]) -> Dag {
        Dag::new(&sources.iter().map(|sources| sources.to_vec()).collect::<Vec<_>>())
    }

    fn ordered(sources: &[&[usize]]) -> Order {
        dag(sources).order()
    }

    #[test]
    fn nodes_come_after_their_sources_and_otherwise_in_file_order() {
        assert_eq!(ordered(&[&[], &[], &[1, 0], &[]]).nodes, [0, 1, 2, 3]);
        assert_eq!(ordered(&[&[2], &[], &[1, 1], &[]]).nodes, [1, 2, 0, 3]);
    }

    #[test]
    fn readers_and_sources_are_unique_and_ascending() {
        let dag = dag(&[&[], &[], &[1, 0, 1], &[1], &[2, 1]]);
        assert_eq!(dag.readers(1).collect::<Vec<_>>(), [2, 3, 4]);
        assert_eq!(dag.sources(2).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(dag.readers(4).count() + dag.sources(0).count(), 0);
    }

    #[test]
    fn upstream_is_a_node_and_all_it_depends_on() {
        let dag = dag(&[&[], &[], &[0], &[2, 1], &[1]]);
        assert_eq!(dag.upstream([2]), [true, false, true, false, false]);
        assert_eq!(dag.upstream([2, 4]), [true, true, true, false, true]);
        assert_eq!(dag.upstream([]), [false; 5]);
    }

    #[test]
    fn each_strongly_connected_component_gives_its_shortest_cycle_from_its_first_node() {
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
    fn a_long_chain_does_not_overflow_the_stack() {
        let mut chain: Vec<Vec<usize>> =
            (0..200_000).map(|node: usize| node.checked_sub(1).into_iter().collect()).collect();
        let dag = Dag::new(&chain);
        assert_eq!(dag.order().nodes.len(), chain.len());
        assert!(dag.upstream([199_999]).iter().all(|upstream| *upstream));
        chain[0].push(199_999);
        assert_eq!(Dag::new(&chain).order().cycles[0].len(), chain.len());
    }
}
