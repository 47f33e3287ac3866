//! PLY: unusual files that load, invalid files and their errors, and the bytes that are written.

use engine::geometry::{Attr, Column, Component, ENVELOPE, Geometry, N, Owner, SHIELDED, UVW, V};

use crate::obj::CD;
use crate::{Format, FrameStamp};

fn read(file: impl AsRef<[u8]>) -> Geometry {
    crate::read(Format::Ply, file.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn fault(file: impl AsRef<[u8]>) -> String {
    crate::read(Format::Ply, file.as_ref()).unwrap_err().to_string()
}

fn written(geometry: &Geometry) -> Vec<u8> {
    let mut bytes = Vec::new();
    crate::write(Format::Ply, geometry, &FrameStamp { frame: 1.0, seconds: 0.5 }, &mut bytes).unwrap();
    bytes
}

/// An ascii file of these elements and rows.
fn ascii(elements: &str, rows: &str) -> String {
    format!("ply\nformat ascii 1.0\n{elements}end_header\n{rows}")
}

/// The declaration of `count` vertices with these properties.
fn vertex(count: usize, properties: &str) -> String {
    let mut text = format!("element vertex {count}\n");
    for property in properties.split(',') {
        text.push_str(&format!("property {property}\n"));
    }
    text
}

const XYZ: &str = "float x,float y,float z";
const FACE: &str = "property list uchar int vertex_indices\n";

fn triangle() -> Geometry {
    Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]).unwrap().into()
}

fn column(geometry: &Geometry, name: &str) -> Option<Column> {
    geometry.parts().next().unwrap().table(Owner::Point).column(name).cloned()
}

#[test]
fn all_three_encodings_read_the_same() {
    let elements = format!("{}element face 1\n{FACE}", vertex(3, XYZ));
    let text = ascii(&elements, "0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2\n");
    assert_eq!(read(text), triangle());
    let floats = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5_f32];
    let mut little = format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n").into_bytes();
    let mut big =
        format!("ply\r\nformat binary_big_endian 1.0\r\n{}end_header\r\n", elements.replace('\n', "\r\n")).into_bytes();
    floats.iter().for_each(|x| little.extend(x.to_le_bytes()));
    floats.iter().for_each(|x| big.extend(x.to_be_bytes()));
    little.push(3);
    big.push(3);
    [0, 1, 2_i32].iter().for_each(|n| little.extend(n.to_le_bytes()));
    [0, 1, 2_i32].iter().for_each(|n| big.extend(n.to_be_bytes()));
    assert_eq!(read(little), triangle());
    assert_eq!(read(big), triangle());
}

#[test]
fn data_may_start_with_the_bytes_of_a_line_end() {
    let elements = vertex(1, "uchar x,uchar y,uchar z");
    let head = format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n").replace('\n', "\r");
    let file = [head.as_bytes(), b"\n\n\r"].concat();
    assert_eq!(read(file).points().unwrap().positions(), [[10.0, 10.0, 13.0]]);
}

#[test]
fn unusual_text_gives_the_same_geometry() {
    let elements = format!("{}element face 1\n{FACE}", vertex(3, XYZ));
    for odd in [
        ascii(&elements, "0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2"),
        ascii(&elements, "\n  0\t0   0 \n\n1 0 0\n 0 1 0.5\n\n3  0 1 2 \n\n trailing words are ignored\n"),
        ascii(&elements, "0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2\n").replace('\n', "\r\n"),
        ascii(&elements, "0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2\n").replace('\n', "\r"),
        ascii(&format!("comment by hand\n\nobj_info x\n{elements}"), "0 0 0\n1.0 0 0\n0 1e0 .5\n3 0 1 2\n"),
        ascii(
            &elements.replace("float", "float64").replace("uchar int", "int8 uint16").replace("indices", "index"),
            "0 0 0\n1 0 0\n0 1 0.5\n3.0 0 1 2.0\n",
        ),
        ascii(&format!("element face 1\n{FACE}{}", vertex(3, XYZ)), "3 0 1 2\n0 0 0\n1 0 0\n0 1 0.5\n"),
        ascii(
            &format!(
                "element camera 1\nproperty float f\nproperty list uchar int n\n{elements}element none 4000000000\n"
            ),
            "1.5 2 7 8\n0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2\n",
        ),
        ascii(
            &format!(
                "{}element face 1\nproperty list uchar float texcoord\n{FACE}",
                vertex(3, "list uchar int extra,float x,float y,float z")
            ),
            "0 0 0 0\n1 5 1 0 0\n0 0 1 0.5\n2 0.5 nan 3 0 1 2\n",
        ),
        ascii(&elements, "0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2\n").replace("ply\n", "\u{feff}ply\n"),
    ] {
        assert_eq!(read(&odd), triangle(), "{odd}");
    }
}

#[test]
fn well_known_properties_become_well_known_attributes() {
    let text = ascii(
        &vertex(
            1,
            &format!("{XYZ},float nx,float ny,float nz,uchar red,uchar green,uchar blue,uchar alpha,float s,float t"),
        ),
        "0 0 0 0 1 0 255 51 0 128 0.5 0.25\n",
    );
    let geometry = read(text);
    assert_eq!(column(&geometry, N.name), Some(Column::new(vec![[0.0_f32, 1.0, 0.0]])));
    assert_eq!(column(&geometry, CD), Some(Column::new(vec![[1.0_f32, 0.2, 0.0]])));
    assert_eq!(column(&geometry, UVW.name), Some(Column::new(vec![[0.5_f32, 0.25, 0.0]])));
    assert_eq!(column(&geometry, "alpha"), Some(Column::new(vec![128])));
    let floats = read(ascii(&vertex(1, &format!("{XYZ},float red,double green,float blue")), "0 0 0 1 0.5 0.25\n"));
    assert_eq!(column(&floats, CD), Some(Column::new(vec![[1.0_f32, 0.5, 0.25]])));
    let shorts = read(ascii(&vertex(1, &format!("{XYZ},ushort red,ushort green,ushort blue")), "0 0 0 65535 0 0\n"));
    assert_eq!(column(&shorts, CD), Some(Column::new(vec![[1.0_f32, 0.0, 0.0]])));
}

#[test]
fn other_scalars_keep_their_type_and_are_renamed_if_a_well_known_name_conflicts() {
    let properties = "float quality,uint rgba,char c,int width,float v,float id,float w.0,float w.1,float w.2,int u";
    let geometry = read(ascii(&vertex(1, &format!("{XYZ},{properties}")), "0 0 0 0.5 4278190335 -1 2 3 1.5 4 5 6 7\n"));
    for (name, expected) in [
        ("quality", Column::new(vec![0.5_f32])),
        ("rgba", Column::new(vec![0xff00_00ff_u32.cast_signed()])),
        ("c", Column::new(vec![-1])),
        ("width", Column::new(vec![2.0_f32])),
        ("id_", Column::new(vec![1.5_f32])),
        ("w", Column::new(vec![[4.0_f32, 5.0, 6.0]])),
    ] {
        assert_eq!(column(&geometry, name), Some(expected), "{name}");
    }
    assert_eq!(column(&geometry, "uvw"), Some(Column::new(vec![[7.0_f32, 3.0, 0.0]])), "`u v` are texture coordinates");
    let lone = read(ascii(&vertex(1, &format!("{XYZ},float v")), "0 0 0 3\n"));
    assert_eq!(column(&lone, "v_"), Some(Column::new(vec![3.0_f32])), "a scalar `v` is not a velocity");
}

#[test]
fn faces_carry_their_attributes() {
    let elements = format!(
        "{}element face 2\n{FACE}property int part\nproperty float w.0\nproperty float w.1\nproperty float w.2\n",
        vertex(3, XYZ)
    );
    let mesh = read(ascii(&elements, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 7 1 2 3\n3 2 1 0 8 4 5 6\n"));
    let table = mesh.mesh().unwrap().table(Owner::Element);
    assert_eq!(table.column("part"), Some(&Column::new(vec![7, 8])));
    assert_eq!(table.column("w"), Some(&Column::new(vec![[1.0_f32, 2.0, 3.0], [4.0, 5.0, 6.0]])));
}

#[test]
fn edges_are_curves_and_beside_faces_each_component_has_its_own_vertices() {
    let edges = "property int vertex1\nproperty int vertex2\n";
    let alone = ascii(
        &format!("{}element edge 3\n{edges}", vertex(5, XYZ)),
        "0 0 0\n1 0 0\n2 0 0\n3 0 0\n9 0 0\n3 2\n0 1\n1 2\n",
    );
    let curves = read(alone);
    assert_eq!(curves.curves().unwrap().runs().counts().collect::<Vec<_>>(), [4]);
    let xs: Vec<f32> = curves.curves().unwrap().positions().iter().map(|p| p[0]).collect();
    assert_eq!(xs, [3.0, 2.0, 1.0, 0.0]);
    let elements = format!("{}element face 1\n{FACE}element edge 1\n{edges}", vertex(5, XYZ));
    let both = read(ascii(&elements, "0 0 0\n1 0 0\n2 0 0\n3 0 0\n4 0 0\n3 4 2 1\n0 1\n"));
    let mesh = both.mesh().unwrap();
    assert_eq!(mesh.faces().unwrap().corners, [2, 1, 0]);
    assert_eq!(mesh.positions().iter().map(|p| p[0]).collect::<Vec<_>>(), [1.0, 2.0, 4.0]);
    assert_eq!(both.curves().unwrap().positions().iter().map(|p| p[0]).collect::<Vec<_>>(), [0.0, 1.0]);
    assert!(both.points().is_none());
}

#[test]
fn a_file_without_vertices_is_empty_geometry_and_an_empty_file_is_refused() {
    assert_eq!(read(ascii("", "")), Geometry::default());
    assert_eq!(read(ascii(&vertex(0, XYZ), "")), Geometry::default());
    assert_eq!(read(ascii("element vertex 0\nelement face 0\n", "")), Geometry::default());
    assert_eq!(fault(""), "the file is empty");
    let no_face = ascii(&format!("{}element face 0\n{FACE}", vertex(1, XYZ)), "0 0 0\n");
    assert_eq!(read(no_face), Component::points(vec![[0.0; 3]]).into());
}

#[test]
fn an_invalid_header_is_reported_with_its_line() {
    for (text, expected) in [
        ("plywood\n", "line 1: `plywood` is not a PLY header line"),
        ("PLY\n", "line 1: a PLY file starts with a line `ply`"),
        ("ply\n", "line 1: the header has no `end_header`"),
        ("ply\nformat ascii 1.0\nelement vertex 1\npro", "line 4: `pro` is not a PLY header line"),
        ("ply\nend_header\n", "line 2: a header without a `format` line"),
        (
            "ply\nformat text 1.0\n",
            "line 2: `text` is not a PLY encoding, expected `ascii`, `binary_little_endian` or `binary_big_endian`",
        ),
        ("ply\nformat ascii 2.0\n", "line 2: PLY version `2.0`, expected `1.0`"),
        ("ply\nelement vertex many\n", "line 2: `many` is not a number of rows"),
        ("ply\nelement vertex -1\n", "line 2: `-1` is not a number of rows"),
        ("ply\nelement vertex 99999999999999999999\n", "line 2: `99999999999999999999` is not a number of rows"),
        ("ply\nelement vertex\n", "line 2: `element` is not a PLY header line"),
        ("ply\nelement vertex 1\nelement vertex 1\n", "line 3: element `vertex` appears twice"),
        ("ply\nproperty float x\n", "line 2: a property before the first element"),
        ("ply\nelement vertex 1\nproperty float x\nproperty int x\n", "line 4: property `x` appears twice"),
        ("ply\nelement vertex 1\nproperty half x\n", "line 3: `half` is not a PLY type"),
        (
            "ply\nelement vertex 1\nproperty float\n",
            "line 3: expected `property TYPE NAME` or `property list TYPE TYPE NAME`",
        ),
        (
            "ply\nelement vertex 1\nproperty list float int x\n",
            "line 3: the count of a list has a floating-point type, expected an integer",
        ),
    ] {
        assert_eq!(fault(text), expected, "{text}");
    }
}

#[test]
fn a_header_with_many_elements_and_properties_is_read_quickly() {
    let elements: String = (0..40_000).map(|k| format!("element e{k} 0\nproperty int a\n")).collect();
    let properties: String = (0..40_000).map(|k| format!(",int p{k}")).collect();
    let text = ascii(&format!("{elements}{}", vertex(0, &format!("{XYZ}{properties}"))), "");
    assert_eq!(read(text), Geometry::default());
}

#[test]
fn invalid_data_is_reported_with_its_position() {
    let faces = format!("{}element face 1\n{FACE}", vertex(1, XYZ));
    let edges = format!("{}element edge 1\nproperty int vertex1\nproperty int vertex2\n", vertex(1, XYZ));
    for (elements, rows, expected) in [
        (vertex(1, "float x,float y"), "0 0\n", "line 3: element `vertex` has no property `z`"),
        (
            format!("{}element face 1\nproperty int a\n", vertex(1, XYZ)),
            "0 0 0\n1\n",
            "line 7: element `face` has no property `vertex_indices`",
        ),
        (
            format!("{}element edge 1\nproperty int vertex1\n", vertex(1, XYZ)),
            "0 0 0\n1\n",
            "line 7: element `edge` has no property `vertex2`",
        ),
        (vertex(2, XYZ), "0 0 0\n", "line 3: `vertex` has 2 rows, more than fit in the 6 bytes after the header"),
        (
            vertex(4_000_000_000, XYZ),
            "0 0 0\n",
            "line 3: `vertex` has 4000000000 rows, more than fit in the 6 bytes after the header",
        ),
        (
            vertex(usize::MAX, XYZ),
            "0 0 0\n",
            "line 3: `vertex` has 18446744073709551615 rows, more than fit in the 6 bytes after the header",
        ),
        (vertex(2, XYZ), "0.000000 0 0\n", "line 8: `vertex` 1: the file ends"),
        (vertex(1, XYZ), "0 0   \n", "line 8: `vertex` 0: `z`: the line ends"),
        (vertex(1, XYZ), "0 0 0 0\n", "line 8: `vertex` 0: `0` follows the last property of the row"),
        (vertex(1, XYZ), "0 x 0\n", "line 8: `vertex` 0: `y`: `x` is not a number"),
        (vertex(1, XYZ), "0 0 nan\n", "line 8: `vertex` 0: `z`: NaN is not a finite number"),
        (vertex(1, XYZ), "0 0 1e39\n", "line 8: `vertex` 0: `z`: inf is not a finite number"),
        (vertex(1, &format!("{XYZ},int a")), "0 0 0 1.5\n", "line 9: `vertex` 0: `a`: `1.5` is not a whole number"),
        (
            vertex(1, &format!("{XYZ},int a")),
            "0 0 0 5000000000\n",
            "line 9: `vertex` 0: `a`: `5000000000` does not fit 32 bits",
        ),
        (
            faces.clone(),
            "0 0 0\n3 0 0 1\n",
            "line 11: `face` 0: `vertex_indices`: index 1 is out of range: `vertex` has 1 row, counted from 0",
        ),
        (
            faces.clone(),
            "0 0 0\n3 0 0 -1\n",
            "line 11: `face` 0: `vertex_indices`: index -1 is out of range: `vertex` has 1 row, counted from 0",
        ),
        (faces.clone(), "0 0 0\n-3 0 0 0\n", "line 11: `face` 0: `vertex_indices`: a list of -3 items"),
        (faces.clone(), "0 0 0\n4000000000 0 0\n", "line 11: `face` 0: `vertex_indices`: the line ends"),
        (faces, "0 0 0\n2 0 0\n", "face 0 has 2 corners, expected at least 3"),
        (
            edges,
            "0 0 0\n0 1\n",
            "line 12: `edge` 0: `vertex2`: index 1 is out of range: `vertex` has 1 row, counted from 0",
        ),
        (
            format!("{}element curve 1\nproperty uint count\n", vertex(1, XYZ)),
            "0 0 0\n2\n",
            "the counts add up to 2 CVs, but there are 1 points",
        ),
        (
            vertex(1, &format!("{XYZ},uchar convect_component")),
            "0 0 0 3\n",
            "`vertex` 0: `convect_component` is 3, expected 0, 1 or 2",
        ),
    ] {
        // The position is counted from the top: two lines, then the elements.
        let text = ascii(&elements, rows);
        let at = expected.split_once(": ").map_or(expected, |(position, _)| position);
        assert_eq!(fault(&text), expected, "{at} of\n{text}");
    }
    let binary = |rows: usize, bytes: &[u8]| {
        let head =
            format!("ply\nformat binary_little_endian 1.0\n{}element face 1\n{FACE}end_header\n", vertex(rows, XYZ));
        fault([head.as_bytes(), bytes].concat())
    };
    assert_eq!(binary(2, &[0; 23]), "line 3: `vertex` has 2 rows, more than fit in the 23 bytes after the header");
    assert_eq!(
        binary(1, &[[0; 12].as_slice(), &[255, 0, 0, 0, 0]].concat()),
        "byte 186: `face` 0: `vertex_indices`: the file ends"
    );
}

#[test]
fn the_written_bytes_are_as_expected() {
    let mut curves = Component::curves(vec![2, 1], vec![[0.0; 3], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]]).unwrap();
    curves.set(ENVELOPE, vec![1.0, 0.5, 0.25]).unwrap();
    curves.set(V, vec![[0.0; 3]; 3]).unwrap();
    curves.set(SHIELDED, vec![0.5, 0.75]).unwrap();
    let bytes = written(&curves.clone().into());
    let head = "ply\nformat binary_little_endian 1.0\ncomment convect, frame 1, 0.5 s, metres, y up\n\
        element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float envelope\n\
        property float v.0\nproperty float v.1\nproperty float v.2\n\
        element edge 1\nproperty int vertex1\nproperty int vertex2\n\
        element curve 2\nproperty uint count\nproperty float shielded\nend_header\n";
    let (found, data) = bytes.split_at(head.len());
    assert_eq!(str::from_utf8(found).unwrap(), head);
    let rows = [[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.5], [2.0, 0.0, 0.0, 0.25_f32]];
    let mut expected = Vec::new();
    for row in rows {
        row.iter().chain(&[0.0; 3]).for_each(|x| expected.extend(x.to_le_bytes()));
    }
    [0_u32, 1].iter().for_each(|n| expected.extend(n.to_le_bytes()));
    for (count, shielded) in [(2_u32, 0.5_f32), (1, 0.75)] {
        expected.extend(count.to_le_bytes());
        expected.extend(shielded.to_le_bytes());
    }
    assert_eq!(data, expected);
    assert_eq!(read(bytes), curves.into());
}

#[test]
fn colours_are_written_as_bytes_if_lossless() {
    let colours: Attr<[f32; 3]> = Attr::point(CD);
    let mut points = Component::points(vec![[0.0; 3]]);
    points.set(colours, vec![[1.0, 51.0 / 255.0, 0.0]]).unwrap();
    let bytes = written(&points.clone().into());
    assert!(bytes.windows(19).any(|text| text == b"property uchar red\n"));
    assert_eq!(read(bytes), points.clone().into());
    points.set(colours, vec![[1.0, 0.3, -0.0]]).unwrap();
    let bytes = written(&points.clone().into());
    assert!(bytes.windows(19).any(|text| text == b"property float red\n"));
    assert_eq!(read(bytes), points.into());
}

#[test]
fn components_with_different_types_of_an_attribute_are_refused() {
    let mut curves = Component::curves(vec![1], vec![[0.0; 3]]).unwrap();
    curves.set_column(Owner::Point, "mask", Column::new(vec![1])).unwrap();
    let mut points = Component::points(vec![[0.0; 3]]);
    points.set_column(Owner::Point, "mask", Column::new(vec![1.0_f32])).unwrap();
    let geometry = Geometry::default().with(curves).with(points);
    let stamp = FrameStamp { frame: 1.0, seconds: 0.0 };
    let error = crate::write(Format::Ply, &geometry, &stamp, &mut Vec::new()).unwrap_err();
    assert_eq!(error.to_string(), "`mask` has different types on curves and points, and ply has one table for both");
}
