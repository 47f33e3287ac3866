//! Point_In: loose points from a file, or from values given in the graph.

use crate::shared::source::{self, Inline};
use engine::files::File;
use engine::prelude::*;
use std::sync::Arc;

params! { PARAMS:
    FILE: Param<Option<File>> = Param::file("file",
        "An obj, ply or json file with points. A run of `#` in its name stands for the frame number, as in \
         `drops.####.ply`.");
    FRAME: Param<i64> = source::FRAME;
    POINTS: Param<Option<Arc<Vec<[f32; 3]>>>> = Param::inline("points",
        "Positions of points given in the graph instead of a file.").unit(Unit::Metres);
    ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("attributes", "Attributes of \
        points, given in the graph by name, one value per point: `{\"mask\": [0, 0.5, 1]}`.");
    SCALE: Param<f64> = source::SCALE;
}

const OUT: Output = Output::new("points", &[Kind::Points], "The points.");

pub(crate) static NODE: Node = Node::new(
    "Point_In",
    2,
    "Loose points from a file, or from values given in the graph: particles, pins. Other geometry in the file is ignored.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&OUT])
.writes(&[&P])
.attributes(|_| [AttrNames::These(Vec::new()), AttrNames::All])
.metrics(&[&source::COMPONENTS])
.checks(|params| source::file_or_inline(params.get(FILE).as_ref(), params.get(POINTS).is_some()));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut points = match cx.get(FILE) {
        Some(file) => source::from_file(cx, &file, Kind::Points)?,
        None => Component::points(cx.get(POINTS).unwrap_or_default().to_vec()),
    };
    Inline { points: cx.get(ATTRIBUTES), elements: Arc::default() }.add_to(&mut points)?;
    points.scale_lengths(cx.get(SCALE));
    Ok(OUT.with(Geometry::from(points)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::source::numbered_files;
    use conformance::{bench, conformance};

    #[test]
    fn conforms_to_its_declaration() {
        let (_folder, files) = numbered_files("obj", |frame| format!("v 0 0 0\nv 0 {frame} 0\np 1 2\n"));
        conformance(&NODE)
            .with(move |bench| bench.source(FILE.name(), files.clone()))
            .with(|bench| bench.set(POINTS, Some(Arc::new(vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0; 3]]))))
            .run();
    }

    #[test]
    fn inline_points_carry_their_attributes() {
        let out = bench(&NODE)
            .set(POINTS, Some(Arc::new(vec![[1.0; 3], [2.0; 3]])))
            .set(ATTRIBUTES, Arc::new(vec![("id".into(), Column::new(vec![5, 6]))]))
            .set(SCALE, 2.0)
            .cook();
        assert_eq!(out.part(Kind::Points).positions(), [[2.0; 3], [4.0; 3]]);
        assert_eq!(out.part(Kind::Points).get(ID), Some(&[5, 6][..]));
    }
}
