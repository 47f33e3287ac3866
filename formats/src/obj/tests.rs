//! OBJ: unusual files that load, invalid files and their errors, and the text that is written.

use engine::geometry::{Attr, Column, Component, Geometry, N, Owner, P, UVW};

use super::CD;
use crate::{Format, FrameStamp};

const COLOUR: Attr<[f32; 3]> = Attr::point(CD);

fn read(text: impl AsRef<[u8]>) -> Geometry {
    crate::read(Format::Obj, text.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn fault(text: impl AsRef<[u8]>) -> String {
    crate::read(Format::Obj, text.as_ref()).unwrap_err().to_string()
}

fn written(geometry: &Geometry) -> String {
    let mut bytes = Vec::new();
    crate::write(Format::Obj, geometry, &FrameStamp { frame: 10.5, seconds: 0.4375 }, &mut bytes).unwrap();
    String::from_utf8(bytes).unwrap()
}

fn counts(component: &Component) -> Vec<u32> {
    match component.faces() {
        Some(faces) => faces.runs.counts().collect(),
        None => component.runs().counts().collect(),
    }
}

fn corners(geometry: &Geometry) -> Vec<u32> {
    geometry.mesh().unwrap().faces().unwrap().corners.clone()
}

fn xs(component: Option<&Component>) -> Vec<f32> {
    component.unwrap().positions().iter().map(|p| p[0]).collect()
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn polylines_are_curves_root_first() {
    let geometry = read("v 0 0 0\nv 1 0 0\nv 2 0 0\nl 3 2\nl 1 2 3\nl 1\n");
    let curves = geometry.curves().unwrap();
    assert_eq!(counts(curves), [2, 3, 1]);
    assert_eq!(xs(Some(curves)), [2.0, 1.0, 0.0, 1.0, 2.0, 0.0]);
    assert_eq!(geometry.kinds().count(), 1);
}

#[test]
fn polygons_stay_polygons_concave_or_not() {
    let geometry = read("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\nf 1 2 4\n");
    assert_eq!(counts(geometry.mesh().unwrap()), [5, 3]);
    assert_eq!(corners(&geometry), [0, 1, 2, 3, 4, 0, 1, 3]);
}

#[test]
fn vertices_and_p_lines_are_points_in_file_order() {
    for text in ["v 3 0 0\nv 1 0 0\nv 2 0 0\n", "v 3 0 0\nv 1 0 0\nv 2 0 0\np 3 1\np 2\n"] {
        assert_eq!(xs(read(text).points()), [3.0, 1.0, 2.0]);
    }
}

#[test]
fn with_several_kinds_each_component_has_the_vertices_it_references() {
    let text = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 0 0\nv 5 0 0\nl 5 4\nf 6 2 3\np 3 1 3\n";
    let geometry = read(text);
    assert_eq!(xs(geometry.curves()), [4.0, 3.0]);
    assert_eq!(xs(geometry.mesh()), [1.0, 2.0, 5.0]);
    assert_eq!(corners(&geometry), [2, 0, 1]);
    assert_eq!(xs(geometry.points()), [0.0, 2.0]);
}

#[test]
fn with_one_kind_unreferenced_vertices_are_kept() {
    assert_eq!(read(format!("{TRIANGLE}v 9 9 9\nf 1 2 3\n")).mesh().unwrap().point_count(), 4);
}

#[test]
fn unusual_text_gives_the_same_geometry() {
    let plain = read(format!("{TRIANGLE}f 1 2 3\n"));
    for odd in [
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
        "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
        "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "\n\n  v\t0   0 0  \n\t v +1 0. .0 \nv -0e5 1E0 0\n\n f  1\t2 3  # a face\n\n",
        "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n 2 \\  \n 3",
        "# C:\\grooms\\\nv 0 0 0\nv 1 0 0\nv 0 1 0\n#\nf 1 2 3 #x\\\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n",
        "v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0\n",
        "v 0 0 0 1\nv 1 0 0 0.5\nv 0 1 0 1\nf 1 2 3\n",
        "mtllib a.mtl\no a\ng b c\nv 0 0 0\nv 1 0 0\nv 0 1 0\ns off\nusemtl m\nf 1/ 2/ 3/\n\
         vp 1 2\ncstype bezier\nwhatever 1\n",
    ] {
        assert_eq!(read(odd), plain, "{odd:?}");
    }
}

#[test]
fn a_line_may_be_long() {
    let count = 100_000_u32;
    let mut text = "v 1 2 3\n".repeat(count as usize);
    text.push('l');
    (1..=count).for_each(|k| text.push_str(&format!(" {k}")));
    assert_eq!(counts(read(&text).curves().unwrap()), [count]);
}

#[test]
fn colours_are_read_if_every_vertex_has_one() {
    let coloured = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0 0.5\nv 0 1 0 0 0 0.25\n";
    let geometry = read(format!("{coloured}f 1 2 3\n"));
    let colours: &[[f32; 3]] = &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.25]];
    assert_eq!(geometry.mesh().unwrap().get(COLOUR), Some(colours));
    let geometry = read(format!("v 9 9 9\n{coloured}f 1 2 3\n"));
    assert_eq!(geometry.mesh().unwrap().get(COLOUR), None);
    let geometry = read(format!("v 9 9 9\n{coloured}f 2 3 4\nl 1 2\n"));
    assert_eq!(geometry.mesh().unwrap().get(COLOUR), Some(colours));
    assert_eq!(geometry.curves().unwrap().get(COLOUR), None);
}

#[test]
fn normals_and_texture_coordinates_are_read_if_unambiguous() {
    let both = "vt 0.5 1\nvt 0 0\nvn 0 0 1\n";
    let geometry = read(format!("{TRIANGLE}{both}f 1/2/1 2/2/1 3/1/1\n"));
    let mesh = geometry.mesh().unwrap();
    assert_eq!(mesh.get(N), Some([[0.0, 0.0, 1.0]; 3].as_slice()));
    assert_eq!(mesh.get(UVW), Some([[0.0; 3], [0.0; 3], [0.5, 1.0, 0.0]].as_slice()));
    let seam = read(format!("{TRIANGLE}{both}f 1/2 2/2 3/1\nf 1/1 3/1 2/2\n"));
    assert_eq!(seam.mesh().unwrap().get(UVW), None, "vertex 1 has two");
    let part = read(format!("{TRIANGLE}{both}f 1//1 2//1 3\n"));
    assert_eq!(part.mesh().unwrap().get(N), None, "vertex 3 has none");
    let broken = read(format!("{TRIANGLE}vn nan nan nan\nf 1//1 2//1 3//1\n"));
    assert_eq!(broken.mesh().unwrap().get(N), None, "not a direction");
}

#[test]
fn a_vertex_that_curves_share_has_texture_coordinates_in_each() {
    let geometry = read("v 0 0 0\nv 1 0 0\nvt 0\nvt 0.5\nvt 1\nl 1/1 2/2\nl 1/3 2/3\n");
    let us: Vec<f32> = geometry.curves().unwrap().get(UVW).unwrap().iter().map(|uvw| uvw[0]).collect();
    assert_eq!(us, [0.0, 0.5, 1.0, 1.0]);
}

#[test]
fn a_file_of_comments_is_empty_geometry_and_an_empty_file_is_refused() {
    for text in ["# nothing\n", "\n", "o a\ng b\n", "mtllib a.mtl"] {
        assert_eq!(read(text), Geometry::default());
    }
    assert_eq!(fault(""), "the file is empty");
    assert_eq!(fault("\u{feff}"), "the file is empty");
}

#[test]
fn an_invalid_line_is_reported_with_the_reason() {
    for (text, expected) in [
        ("v 0 0\n", "line 1: `v` has 2 numbers, expected 3, 4, 6 or 7"),
        ("v 0 0 0\nv\n", "line 2: `v` has 0 numbers, expected 3, 4, 6 or 7"),
        ("v 0 0 0 1 1\n", "line 1: `v` has 5 numbers, expected 3, 4, 6 or 7"),
        ("v 0 0 0 1 1 1 1 1 1\n", "line 1: `v` has 9 numbers, expected 3, 4, 6 or 7"),
        ("v 0 0,5 0\n", "line 1: `0,5` is not a number"),
        ("v 0 nan 0\n", "line 1: `nan` is not a finite number"),
        ("#\n#\nv 0 -inf 0\n", "line 3: `-inf` is not a finite number"),
        ("v 0 1e39 0\n", "line 1: `1e39` is not a finite number"),
        ("v 0 0 0\nvn 0 1\n", "line 2: `vn` has 2 numbers, expected 3"),
        ("v 0 0 0\nvt\n", "line 2: `vt` has 0 numbers, expected 1"),
        ("v 0 0 0\nvt x\n", "line 2: `x` is not a number"),
        ("v 0 0 0\nf 1 1\n", "line 2: 2 corners, expected at least 3"),
        ("v 0 0 0\nl\n", "line 2: 0 CVs, expected at least 1"),
        ("v 0 0 0\np # none\n", "line 2: 0 points, expected at least 1"),
        ("v 0 0 0\nf 1 1 2\n", "line 2: `v` index 2 is out of range: expected 1 to 1, or -1 to -1"),
        ("v 0 0 0\nl 1 -2\n", "line 2: `v` index -2 is out of range: expected 1 to 1, or -1 to -1"),
        ("l 1\n", "line 1: `v` index 1 is out of range: there are none"),
        ("v 0 0 0\np 0\n", "line 2: `0` has the index 0, but indices start at 1"),
        ("v 0 0 0\np 4294967296\n", "line 2: `v` index 4294967296 is out of range: expected 1 to 1, or -1 to -1"),
        ("v 0 0 0\np 99999999999999999999\n", "line 2: `99999999999999999999` is not a vertex index"),
        (
            "v 0 0 0\np -9223372036854775808\n",
            "line 2: `v` index -9223372036854775808 is out of range: expected 1 to 1, or -1 to -1",
        ),
        ("v 0 0 0\nf 1/2 1 1\n", "line 2: `vt` index 2 is out of range: there are none"),
        ("v 0 0 0\nf 1//1 1 1\n", "line 2: `vn` index 1 is out of range: there are none"),
        ("v 0 0 0\nf 1/1/1/1 1 1\n", "line 2: `1/1/1/1` has 4 parts, expected `v/vt/vn` at most"),
        ("v 0 0 0\nf /1 1 1\n", "line 2: `/1` is not a vertex index"),
        ("v 0 0 0\nf 1.5 1 1\n", "line 2: `1.5` is not a vertex index"),
        ("v 0 0 0\nv 0 0 \\\n\\\nx\n", "line 2: `x` is not a number"),
        ("solid cube\nfacet normal 0 0 1\n", "line 1: `solid` is not an obj statement, and the file has no vertex"),
        ("v 0 0 0\n\0\0\0\0\n", "line 2: a NUL byte, expected text: the file is damaged or binary"),
        ("v 0 0 \0\n", "line 1: `\\0` is not a number"),
    ] {
        assert_eq!(fault(text), expected, "{text:?}");
    }
}

#[test]
fn the_written_text_is_as_expected() {
    let mut curves = Component::curves(vec![2, 1], vec![[0.0; 3], [0.1, -0.0, 1e-7], [1.0, 2.0, 3.0]]).unwrap();
    curves.set(UVW, vec![[0.5, 0.0, 0.0]; 3]).unwrap();
    let mut mesh = Component::mesh(vec![3], vec![0, 2, 1], vec![[0.0; 3]; 3]).unwrap();
    mesh.set(N, vec![[0.0, 0.0, 1.0]; 3]).unwrap();
    let mut points = Component::points(vec![[7.0; 3]]);
    points.set_column(Owner::Point, CD, Column::new(vec![[0.25_f32, 0.5, 1.0]])).unwrap();
    let geometry = Geometry::default().with(points).with(mesh).with(curves);
    let expected = "# convect, frame 10.5, 0.4375 s, metres, y up
o curves
v 0.0 0.0 0.0
v 0.1 -0.0 1e-7
v 1.0 2.0 3.0
vt 0.5 0.0 0.0
vt 0.5 0.0 0.0
vt 0.5 0.0 0.0
l 1/1 2/2
l 3/3
o mesh
v 0.0 0.0 0.0
v 0.0 0.0 0.0
v 0.0 0.0 0.0
vn 0.0 0.0 1.0
vn 0.0 0.0 1.0
vn 0.0 0.0 1.0
f 4//1 6//3 5//2
o points
v 7.0 7.0 7.0 0.25 0.5 1.0
p 7
";
    assert_eq!(written(&geometry), expected);
    assert_eq!(read(expected), geometry);
    assert_eq!(read(expected).curves().unwrap().get(P).unwrap()[1][1].to_bits(), (-0.0_f32).to_bits());
}

#[test]
fn an_empty_geometry_is_a_comment() {
    let empty = Geometry::default().with(Component::points(Vec::new()));
    assert_eq!(written(&empty), "# convect, frame 10.5, 0.4375 s, metres, y up\n");
    assert_eq!(read(written(&empty)), Geometry::default());
}
