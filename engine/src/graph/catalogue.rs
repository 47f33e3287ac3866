//! Catalogues: the node types that a graph may use.

use crate::node::Node;

/// The families' lists of node types, joined.
#[derive(Clone, Copy, Debug)]
pub struct Catalogue(pub &'static [&'static [&'static Node]]);

impl Catalogue {
    /// All types, family by family.
    pub fn nodes(self) -> impl Iterator<Item = &'static Node> {
        self.0.iter().flat_map(|family| family.iter().copied())
    }

    /// The node type with that name.
    pub fn get(self, name: &str) -> Option<&'static Node> {
        self.nodes().find(|node| node.name == name)
    }

    /// The names of all types, family by family.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        self.nodes().map(|node| node.name)
    }
}
