use std::path::Path;

use super::*;

fn graph(text: &str) -> Graph {
    Graph::load(text, Path::new("."), crate::CATALOGUE, &[], &|_| Ok(())).unwrap()
}

const LAWN: &str = r#"{
  "convect": 1,
  "nodes": {
    "blades": { "type": "Curve_In", "params": { "points": [[0, 0, 0], [0, 1, 0]] } },
    "ball": { "type": "Gust_Control" },
    "turned": { "type": "Transform", "inputs": { "geometry": "ball" } },
    "gusts": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "blades", "controls": ["ball", "turned"] } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "gusts" }, "params": { "wind_dir": [0, 0, 2] } },
    "block": { "type": "Mesh_Primitive" },
    "soft": { "type": "Lattice_Deform", "inputs": { "geometry": "block" }, "params": { "divisions": [2, 1, 1] } },
    "both": { "type": "Merge", "inputs": { "geometry": ["wind", "soft"] } },
    "moved": { "type": "Transform", "inputs": { "geometry": "both" } }
  },
  "outputs": { "lawn": "both", "ball": "ball", "moved": "moved" }
}"#;

#[test]
fn controls_lattices_and_wind_above_the_outputs_are_guides() {
    let mut lawn = graph(LAWN);
    let guides = Guides::add_to(&mut lawn, &[0, 1]);
    // `ball` is drawn as an output already.
    assert_eq!(guides.outputs(), 3..4);
    assert_eq!((guides.name(3), guides.name(0)), ("controls", ""));
    assert_eq!(&*lawn.nodes[lawn.outputs[3].from.node].id, "turned");
    assert_eq!(guides.wind(&lawn, Frame::whole(1)), Some([0.0, 0.0, 2.0]));
    let lattice = guides.lattices(&lawn, Frame::whole(1)).unwrap();
    let lines = lattice.curves().unwrap();
    assert_eq!((lines.element_count(), lines.point_count()), (4 + 6 + 6, 4 * 3 + 6 * 2 + 6 * 2));
    assert_eq!(lines.positions()[..3], [[-0.5; 3], [0.0, -0.5, -0.5], [0.5, -0.5, -0.5]]);
}

#[test]
fn what_lies_above_a_transform_is_no_guide() {
    let mut lawn = graph(LAWN);
    let guides = Guides::add_to(&mut lawn, &[2]);
    assert!(guides.outputs().is_empty());
    assert_eq!(guides.wind(&lawn, Frame::whole(1)), None);
    assert!(guides.lattices(&lawn, Frame::whole(1)).is_none());
}

#[test]
fn a_mesh_is_its_edges_and_is_visible_where_an_output_has_its_points() {
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh: Geometry = Component::mesh(vec![3, 3], vec![0, 1, 2, 0, 2, 3], corners.clone()).unwrap().into();
    let lines = lines_of(&mesh).unwrap();
    assert_eq!(lines.curves().unwrap().element_count(), 5);
    let points: Geometry = Component::points(corners).into();
    assert!(is_visible(&lines, &[Layer::new("points", &points)]));
    assert!(!is_visible(&lines, &[Layer::guide("points", &points)]));
    assert!(!is_control(&points) && lines_of(&points).is_none());
}

#[test]
fn controls_merged_into_an_output_are_left_to_their_lines() {
    let mut control = Component::points(vec![[0.0; 3]; 7]);
    control.set_column(Owner::Point, RUN, Column::new(vec![7_i32; 7])).unwrap();
    let alone = Geometry::from(control.clone());
    assert!(is_control(&alone) && without_controls(&alone).is_none());
    let curves = Component::curves(vec![2], vec![[0.0; 3], [0.0, 1.0, 0.0]]).unwrap();
    let both = Geometry::from(curves.clone()).with(control);
    let bare = without_controls(&both).unwrap();
    assert!(bare.points().is_none() && bare.curves().is_some());
    let points = Geometry::from(curves).with(Component::points(vec![[0.0; 3]]));
    assert!(without_controls(&points).is_none());
}
