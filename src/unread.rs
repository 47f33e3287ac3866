//! Notes on files of which a part is read by no node.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use engine::cook::Report;
use engine::graph::{Body, Graph};
use engine::note::{Note, kind};
use engine::param::Source;

/// The metric in which nodes say how many components their files have.
const COMPONENTS: &str = "components";

/// A note for each file with more components than all nodes that read it take: those that the node gives and nothing reads
/// are not taken.
pub fn notes(graph: &Graph, report: &Report) -> Vec<Note> {
    let read = graph.nodes.iter().flat_map(|node| node.inputs().iter().flatten());
    let read: BTreeSet<_> = read.chain(graph.outputs.iter().map(|output| &output.from)).copied().collect();
    // By path: the outputs of nodes that are read, by name, which is that of the component; and the most components.
    let mut files: BTreeMap<&Path, (BTreeSet<&str>, usize, usize)> = BTreeMap::new();
    for (index, (node, cooked)) in graph.nodes.iter().zip(&report.nodes).enumerate() {
        let Body::Node { node: declared, params, .. } = &node.body else { continue };
        let path = params.iter().find_map(|source| match source {
            Source::File { path, .. } => Some(&**path),
            _ => None,
        });
        let Some(path) = path.filter(|_| declared.metrics.iter().any(|metric| metric.name == COMPONENTS)) else {
            continue;
        };
        let taken = read.iter().filter(|link| link.node == index).map(|link| declared.outputs[link.port].name);
        let values = cooked.metrics.get(COMPONENTS).into_iter().flat_map(BTreeMap::values);
        let most = values.fold(0.0_f64, |most, value| most.max(*value)) as usize;
        let (all, count, first) = files.entry(path).or_insert((BTreeSet::new(), 0, index));
        all.extend(taken);
        if most > *count {
            (*count, *first) = (most, index);
        }
    }
    let unread = files.into_iter().filter(|(_, (taken, count, _))| *count > taken.len());
    let note = |(path, (taken, count, index)): (&Path, (BTreeSet<&str>, usize, usize))| {
        let node = &graph.nodes[index];
        let what = taken.into_iter().collect::<Vec<&str>>().join(", ");
        let path = path.display();
        let text =
            format!("`{}` ({}): `{path}` has {count} components, of which {what} is read", node.id, node.type_name());
        let hint = format!(
            "`convect stats {path}` lists them. Curve_In, Mesh_In, Point_In and Tet_In read one each; Usd_In has an output for \
             each, and reads less with `prim`."
        );
        Note::new(kind::UNREAD_COMPONENTS, text).of_node(&node.id).hint(hint)
    };
    unread.map(note).collect()
}
