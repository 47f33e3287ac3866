//! The order of prims: a crate file's tree is sorted by path, and the order in which prims are traversed is a list.

use std::collections::BTreeMap;

use super::layer::{Layer, NONE, Value};
use crate::Result;

/// Puts the prims under each node into the order of its `primChildren`; those that are not in the list come last.
///
/// # Errors
/// If a list is damaged.
pub(super) fn sort_children(layer: &mut Layer) -> Result<()> {
    for node in 0..layer.nodes.len() as u32 {
        let children: Vec<u32> = layer.children(node).collect();
        if children.len() < 2 {
            continue;
        }
        let Some(Value::Texts(listed)) = layer.value_of(node, "primChildren")? else { continue };
        let places: BTreeMap<&str, usize> = listed.iter().enumerate().map(|(place, name)| (&**name, place)).collect();
        let mut ordered = children;
        ordered.sort_by_key(|child| places.get(layer.name(*child)).copied().unwrap_or(usize::MAX));
        layer.nodes[node as usize].child = ordered[0];
        for (place, child) in ordered.iter().enumerate() {
            layer.nodes[*child as usize].next = ordered.get(place + 1).copied().unwrap_or(NONE);
        }
    }
    Ok(())
}
