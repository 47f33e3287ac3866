//! Curve_In: curves from a file, or from values given in the graph.

use crate::shared::source::{self, Inline};
use engine::files::File;
use engine::prelude::*;
use std::sync::Arc;

params! { PARAMS:
    FILE: Param<Option<File>> = Param::file("file",
        "An obj, ply or json file with curves. A run of `#` in its name stands for the frame number, as in \
         `fur.####.obj`.");
    FRAME: Param<i64> = source::FRAME;
    POINTS: Param<Option<Arc<Vec<[f32; 3]>>>> = Param::inline("points",
        "Positions of CVs given in the graph instead of a file, root to tip, one curve after the other.").unit(Unit::Metres);
    COUNTS: Param<Arc<Vec<i32>>> = Param::inline("counts",
        "Number of CVs of each curve in `points`. If empty, they all belong to one curve.");
    ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("attributes",
        "Attributes of CVs, given in the graph by name, one value per CV: `{\"mask\": [0, 0.5, 1]}`.");
    ELEMENT_ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("element_attributes",
        "Attributes of curves, given in the graph by name, one value per curve: `{\"clump\": [7, 8]}`.");
    SCALE: Param<f64> = source::SCALE;
    WIDTH_PARAM: Param<f32> = Param::float("width", 0.0,
        "Width of every curve. 0 keeps the widths in the file.").unit(Unit::Metres).at_least(0.0).soft(0.0, 0.01);
}

const CURVES: Output = Output::new("curves", &[Kind::Curves], "The curves.");

pub(crate) static NODE: Node = Node::new(
    "Curve_In",
    2,
    "Reads curves from a file, or from values given in the graph: fur, grass, fibres. Other geometry in the file is \
     ignored; Mesh_In reads its polygons.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&CURVES])
.writes(&[&P, &WIDTH])
.attributes(|_| [AttrNames::These(Vec::new()), AttrNames::All])
.metrics(&[&source::COMPONENTS])
.checks(|params| source::file_or_inline(params.get(FILE).as_ref(), params.get(POINTS).is_some()));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut curves = match cx.get(FILE) {
        Some(file) => source::from_file(cx, &file, Kind::Curves)?,
        None => inline(cx)?,
    };
    Inline { points: cx.get(ATTRIBUTES), elements: cx.get(ELEMENT_ATTRIBUTES) }.add_to(&mut curves)?;
    curves.scale_lengths(cx.get(SCALE));
    let width = cx.get(WIDTH_PARAM);
    if width > 0.0 {
        curves.set(WIDTH, vec![width; curves.point_count()])?;
    }
    Ok(CURVES.with(Geometry::from(curves)))
}

fn inline(cx: &Cx) -> Result<Component> {
    let points = cx.get(POINTS).unwrap_or_default().to_vec();
    let counts = match cx.get(COUNTS).as_slice() {
        [] if points.is_empty() => Vec::new(),
        [] => vec![points.len() as u32],
        counts => source::wholes(COUNTS, counts, 1)?,
    };
    Component::curves(counts, points).map_err(|error| source::explained(error, POINTS.name()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::source::numbered_files;
    use conformance::{bench, conformance};

    fn points(rows: &[[f32; 3]]) -> Option<Arc<Vec<[f32; 3]>>> {
        Some(Arc::new(rows.to_vec()))
    }

    #[test]
    fn conforms_to_its_declaration() {
        let (_folder, files) = numbered_files("obj", |frame| format!("v 0 0 0\nv 0 {frame} 0\nl 1 2\n"));
        conformance(&NODE)
            .with(move |bench| bench.source(FILE.name(), files.clone()))
            .with(|bench| bench.set(POINTS, Some(Arc::new(vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0; 3]]))))
            .run();
    }

    #[test]
    fn inline_points_without_counts_are_one_curve() {
        let out = bench(&NODE).set(POINTS, points(&[[0.0; 3], [0.0, 1.0, 0.0]])).cook();
        assert_eq!(out.curves().runs().starts(), [0, 2]);
    }

    #[test]
    fn inline_curves_carry_their_attributes() {
        let out = bench(&NODE)
            .set(POINTS, points(&[[0.0; 3], [0.0, 1.0, 0.0], [1.0; 3]]))
            .set(COUNTS, Arc::new(vec![2, 1]))
            .set(ATTRIBUTES, Arc::new(vec![("mask".into(), Column::new(vec![0.0_f32, 0.5, 1.0]))]))
            .set(ELEMENT_ATTRIBUTES, Arc::new(vec![("clump".into(), Column::new(vec![7, 8]))]))
            .cook();
        let curves = out.curves();
        assert_eq!(curves.get(Attr::<f32>::point("mask")), Some(&[0.0, 0.5, 1.0][..]));
        assert_eq!(curves.get(Attr::<i32>::element("clump")), Some(&[7, 8][..]));
    }

    #[test]
    fn scale_multiplies_positions_and_leaves_other_attributes() {
        let out = bench(&NODE)
            .set(POINTS, points(&[[1.0, 2.0, 3.0]]))
            .set(ATTRIBUTES, Arc::new(vec![("mask".into(), Column::new(vec![2.0_f32]))]))
            .set(SCALE, 0.01)
            .set(WIDTH_PARAM, 0.5)
            .cook();
        assert_eq!(out.curves().positions(), [[0.01, 0.02, 0.03]]);
        assert_eq!(out.curves().get(Attr::<f32>::point("mask")), Some(&[2.0][..]));
        assert_eq!(out.curves().get(WIDTH), Some(&[0.5][..]), "the width is not scaled");
    }

    #[test]
    fn counts_that_do_not_add_up_are_refused() {
        let two = bench(&NODE).set(POINTS, points(&[[0.0; 3]; 2]));
        let error = two.clone().set(COUNTS, Arc::new(vec![3])).try_cook().unwrap_err();
        assert_eq!(error.fact, "`counts` adds up to 3 CVs, but `points` has 2");
        let error = two.clone().set(COUNTS, Arc::new(vec![2, -1])).try_cook().unwrap_err();
        assert_eq!(error.to_string(), "`counts` has -1 at index 1, counted from 0; expected at least 1");
        let wrong = Arc::new(vec![("mask".into(), Column::new(vec![1.0_f32]))]);
        assert_eq!(two.set(ATTRIBUTES, wrong).try_cook().unwrap_err().fact, "`mask` has 1 row, expected 2");
    }
}
