//! Mesh_In: a mesh from a file, or written into the graph.

use crate::shared::source::{self, Inline};
use engine::files::File;
use engine::prelude::*;
use std::sync::Arc;

params! { PARAMS:
    FILE: Param<Option<File>> = Param::file("file",
        "An obj, ply or json file with polygons. A run of `#` in its name stands for the frame number: `skin.####.obj`.");
    FRAME: Param<i64> = Param::int("frame", 0, "Which file of a numbered sequence is read.")
        .unit(Unit::Frame).default_current_frame();
    POINTS: Param<Option<Arc<Vec<[f32; 3]>>>> = Param::inline("points",
        "Vertices written into the graph instead of a file.").unit(Unit::Metres);
    COUNTS: Param<Arc<Vec<i32>>> = Param::inline("counts", "Corners of each face. Empty, all faces are triangles.");
    INDICES: Param<Arc<Vec<i32>>> = Param::inline("indices",
        "Vertices of the faces' corners, from 0, face after face, counter-clockwise seen from outside.");
    ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("attributes",
        "Attributes added to the mesh, a row a vertex.");
    ELEMENT_ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("element_attributes",
        "Attributes added to the mesh, a row a face.");
    SCALE: Param<f64> = Param::double("scale", 1.0,
        "Multiplies positions, widths and velocities: 0.01 for a file in centimetres.").soft(0.001, 1000.0);
}

const MESH: Output = Output::new("mesh", &[Kind::Mesh], "The mesh.");

/// See the module.
pub static NODE: Node = Node::new(
    "Mesh_In",
    1,
    "A mesh from a file, or written into the graph: skins, colliders, bowls. Other geometry in the file is left.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&MESH])
.writes(&[&P])
.attributes(|_| [AttrNames::These(Vec::new()), AttrNames::All])
.checks(|params| source::file_or_inline(params.get(FILE).as_ref(), params.get(POINTS).is_some()));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut mesh = match cx.get(FILE) {
        Some(file) => source::from_file(&file, Kind::Mesh)?,
        None => inline(cx)?,
    };
    Inline { points: cx.get(ATTRIBUTES), elements: cx.get(ELEMENT_ATTRIBUTES) }.add_to(&mut mesh)?;
    source::scale(&mut mesh, cx.get(SCALE));
    Ok(MESH.with(Geometry::from(mesh)))
}

fn inline(cx: &Cx) -> Result<Component> {
    // A negative number is no row: it becomes one that no mesh has, and is refused as such.
    let whole = |number: &i32| u32::try_from(*number).unwrap_or(u32::MAX);
    let indices: Vec<u32> = cx.get(INDICES).iter().map(whole).collect();
    let counts = match cx.get(COUNTS).as_slice() {
        [] => vec![3; indices.len().div_ceil(3)],
        counts => counts.iter().map(|count| u32::try_from(*count).unwrap_or(0)).collect(),
    };
    Ok(Component::mesh(counts, indices, cx.get(POINTS).unwrap_or_default().to_vec())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::source::numbered_files;
    use engine::testing::{bench, conformance};

    fn square() -> engine::testing::Bench {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
        bench(&NODE).set(POINTS, Some(Arc::new(points.to_vec())))
    }

    #[test]
    fn conforms_to_its_declaration() {
        let (_folder, files) = numbered_files("obj", |frame| format!("v 0 0 0\nv 0 {frame} 0\nv 1 0 0\nf 1 2 3\n"));
        conformance(&NODE)
            .with(move |bench| bench.source(FILE.name(), files.clone()))
            .with(|bench| {
                bench
                    .set(POINTS, Some(Arc::new(vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0; 3]])))
                    .set(INDICES, Arc::new(vec![0, 1, 2]))
            })
            .run();
    }

    #[test]
    fn indices_without_counts_are_triangles() {
        let out = square().set(INDICES, Arc::new(vec![0, 2, 1, 0, 3, 2])).cook();
        assert_eq!(out.mesh().faces().unwrap().iter().collect::<Vec<_>>(), [[0, 2, 1], [0, 3, 2]]);
    }

    #[test]
    fn polygons_keep_their_corners() {
        let out = square().set(INDICES, Arc::new(vec![0, 3, 2, 1])).set(COUNTS, Arc::new(vec![4])).cook();
        assert_eq!(out.mesh().faces().unwrap().face(0), [0, 3, 2, 1]);
    }

    #[test]
    fn corners_that_are_no_vertex_are_refused() {
        let error = |indices: Vec<i32>| square().set(INDICES, Arc::new(indices)).try_cook().unwrap_err().fact;
        assert_eq!(error(vec![0, 1, 4]), "index 4 (corner 2) is out of range: there are 4 points, counted from 0");
        assert_eq!(error(vec![0, 1]), "the counts add up to 3 corners, but there are 2 indices");
        assert!(error(vec![0, 1, -1]).ends_with("is out of range: there are 4 points, counted from 0"));
    }
}
