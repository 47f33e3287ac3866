//! Tet_In: tets from a file, or from values given in the graph.

use crate::shared::source::{self, Inline};
use engine::files::File;
use engine::prelude::*;
use std::sync::Arc;

params! { PARAMS:
    FILE: Param<Option<File>> = Param::file("file",
        "A json file with tets. A run of `#` in its name stands for the frame number, as in `dough.####.json`.");
    FRAME: Param<i64> = source::FRAME;
    POINTS: Param<Option<Arc<Vec<[f32; 3]>>>> = Param::inline("points",
        "Positions of points given in the graph instead of a file.").unit(Unit::Metres);
    TETS: Param<Arc<Vec<[u32; 4]>>> = Param::inline("tets",
        "Four point indices per tet, counted from 0. Seen from the fourth point, the first three run \
         counter-clockwise.");
    ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("attributes", "Attributes of \
        points, given in the graph by name, one value per point: `{\"mask\": [0, 0.5, 1]}`.");
    ELEMENT_ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("element_attributes",
        "Attributes of tets, given in the graph by name, one value per tet: `{\"part\": [7, 8]}`.");
    SCALE: Param<f64> = source::SCALE;
}

const OUT: Output = Output::new("tets", &[Kind::Tets], "The tets.");

pub(crate) static NODE: Node = Node::new(
    "Tet_In",
    2,
    "Tets from a file, or from values given in the graph: soft bodies made in other programs. Other geometry in the file is \
     ignored.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&OUT])
.writes(&[&P])
.attributes(|_| [AttrNames::These(Vec::new()), AttrNames::All])
.metrics(&[&source::COMPONENTS])
.checks(|params| source::file_or_inline(params.get(FILE).as_ref(), params.get(POINTS).is_some()));

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut tets = match cx.get(FILE) {
        Some(file) => source::from_file(cx, &file, Kind::Tets)?,
        None => Component::tets(cx.get(TETS).to_vec(), cx.get(POINTS).unwrap_or_default().to_vec())
            .map_err(|error| source::explained(error, TETS.name()))?,
    };
    Inline { points: cx.get(ATTRIBUTES), elements: cx.get(ELEMENT_ATTRIBUTES) }.add_to(&mut tets)?;
    tets.scale_lengths(cx.get(SCALE));
    Ok(OUT.with(Geometry::from(tets)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::source::numbered_files;
    use conformance::{bench, conformance};

    #[test]
    fn conforms_to_its_declaration() {
        let (_folder, files) = numbered_files("json", |frame| {
            format!(
                "{{\"tets\": {{\"indices\": [[0, 1, 2, 3]], \"points\": [[0.0, 0.0, 0.0], [0.0, {frame}.0, 0.0], [1.0, \
                 0.0, 0.0], [0.0, 0.0, 1.0]]}}}}"
            )
        });
        conformance(&NODE)
            .with(move |bench| bench.source(FILE.name(), files.clone()))
            .with(|bench| {
                bench
                    .set(POINTS, Some(Arc::new(vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])))
                    .set(TETS, Arc::new(vec![[0, 1, 2, 3]]))
            })
            .run();
    }

    #[test]
    fn inline_tets_are_checked_against_their_points() {
        let corner = |k: usize| std::array::from_fn(|axis| if axis + 1 == k { 1.0 } else { 0.0 });
        let one = bench(&NODE).set(POINTS, Some(Arc::new((0..4).map(corner).collect())));
        assert_eq!(one.clone().set(TETS, Arc::new(vec![[0, 1, 2, 3]])).cook().part(Kind::Tets).element_count(), 1);
        let error = one.set(TETS, Arc::new(vec![[0, 1, 2, 4]])).try_cook().unwrap_err();
        assert_eq!(error.fact, "`tets` has 4 at index 3, but there are 4 `points`");
    }
}
