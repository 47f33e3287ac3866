//! Mesh_In: a mesh from a file, or from values given in the graph.

use crate::shared::source::{self, Inline};
use engine::files::File;
use engine::prelude::*;
use std::sync::Arc;

params! { PARAMS:
    FILE: Param<Option<File>> = Param::file("file",
        "An obj, ply or json file with polygons. A run of `#` in its name stands for the frame number, as in \
         `skin.####.obj`.");
    FRAME: Param<i64> = source::FRAME;
    POINTS: Param<Option<Arc<Vec<[f32; 3]>>>> = Param::inline("points",
        "Positions of vertices given in the graph instead of a file.").unit(Unit::Metres);
    COUNTS: Param<Arc<Vec<i32>>> = Param::inline("counts", "Number of corners of each face. If empty, all faces are \
        triangles.");
    INDICES: Param<Arc<Vec<i32>>> = Param::inline("indices",
        "The vertex of each face corner, counted from 0, face after face, counter-clockwise as seen from outside.");
    ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("attributes",
        "Attributes of vertices, given in the graph by name, one value per vertex: `{\"mask\": [0, 0.5, 1]}`.");
    ELEMENT_ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("element_attributes",
        "Attributes of faces, given in the graph by name, one value per face: `{\"part\": [7, 8]}`.");
    SCALE: Param<f64> = source::SCALE;
}

const MESH: Output = Output::new("mesh", &[Kind::Mesh], "The mesh.");

pub(crate) static NODE: Node = Node::new(
    "Mesh_In",
    2,
    "A mesh from a file, or from values given in the graph: skins, colliders, bowls. Other geometry in the file is ignored.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&MESH])
.writes(&[&P])
.attributes(|_| [AttrNames::These(Vec::new()), AttrNames::All])
.metrics(&[&source::COMPONENTS])
.checks(|params| source::file_or_inline(params.get(FILE).as_ref(), params.get(POINTS).is_some()));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut mesh = match cx.get(FILE) {
        Some(file) => source::from_file(cx, &file, Kind::Mesh)?,
        None => inline(cx)?,
    };
    Inline { points: cx.get(ATTRIBUTES), elements: cx.get(ELEMENT_ATTRIBUTES) }.add_to(&mut mesh)?;
    mesh.scale_lengths(cx.get(SCALE));
    Ok(MESH.with(Geometry::from(mesh)))
}

fn inline(cx: &Cx) -> Result<Component> {
    let indices = source::wholes(INDICES, &cx.get(INDICES), 0)?;
    let counts = match cx.get(COUNTS).as_slice() {
        [] if !indices.len().is_multiple_of(3) => {
            let fact = format!("`indices` has {} numbers, which is not a multiple of 3", indices.len());
            return Err(Error::refused(fact).hint("write `counts` if faces have more than three corners"));
        }
        [] => vec![3; indices.len() / 3],
        counts => source::wholes(COUNTS, counts, 3)?,
    };
    let mesh = Component::mesh(counts, indices, cx.get(POINTS).unwrap_or_default().to_vec());
    mesh.map_err(|error| source::explained(error, INDICES.name()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::source::numbered_files;
    use conformance::{bench, conformance};

    fn square() -> conformance::Bench {
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
    fn corners_out_of_range_are_refused() {
        let error = |indices: Vec<i32>| square().set(INDICES, Arc::new(indices)).try_cook().unwrap_err().fact;
        assert_eq!(error(vec![0, 1, 4]), "`indices` has 4 at index 2, but there are 4 `points`");
        assert_eq!(error(vec![0, 1]), "`indices` has 2 numbers, which is not a multiple of 3");
        assert_eq!(error(vec![0, 1, -1]), "`indices` has -1 at index 2, counted from 0");
    }

    #[test]
    fn invalid_counts_are_refused() {
        let three = square().set(INDICES, Arc::new(vec![0, 2, 1]));
        let error = |counts: Vec<i32>| three.clone().set(COUNTS, Arc::new(counts)).try_cook().unwrap_err().fact;
        assert_eq!(error(vec![-3]), "`counts` has -3 at index 0, counted from 0");
        assert_eq!(error(vec![2]), "`counts` has 2 at index 0, counted from 0");
        assert_eq!(error(vec![4]), "`counts` adds up to 4 corners, but `indices` has 3");
    }
}
