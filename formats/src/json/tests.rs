//! Json: the text that is written, unusual files that load, invalid files and their errors.

use engine::geometry::{Attr, Column, Component, ENVELOPE, Geometry, Grid, ID, Kind, Owner, SparseField, Volume};

use crate::{Format, FrameStamp};

fn read(text: impl AsRef<[u8]>) -> Geometry {
    crate::read(Format::Json, text.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn fault(text: impl AsRef<[u8]>) -> String {
    crate::read(Format::Json, text.as_ref()).unwrap_err().to_string()
}

fn written(geometry: &Geometry, frame: f64) -> String {
    let mut bytes = Vec::new();
    crate::write(Format::Json, geometry, &FrameStamp { frame, seconds: frame / 24.0 }, &mut bytes).unwrap();
    String::from_utf8(bytes).unwrap()
}

/// Every component, every type of column.
fn everything() -> Geometry {
    let mut curves = Component::curves(vec![2], vec![[0.0, -0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
    curves.set(ENVELOPE, vec![1.0, 0.5]).unwrap();
    curves.set_column(Owner::Element, "shielded", Column::new(vec![0.5_f32])).unwrap();
    curves.set_column(Owner::Once, "a \"name\"", Column::new(vec![[1, 2, 3]])).unwrap();
    let mut mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[1e-45, 3e38, 0.1]; 3]).unwrap();
    mesh.set_column(Owner::Point, "orient", Column::new(vec![[0.0_f32, 0.0, 0.0, 1.0]; 3])).unwrap();
    let mut points = Component::points(vec![[0.0; 3]]);
    points.set(ID, vec![-7]).unwrap();
    let tet = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut tets = Component::tets(vec![[0, 1, 2, 3]], tet).unwrap();
    tets.set_column(Owner::Element, "parts", Column::new(vec![[1, 2, 3, i32::MIN]])).unwrap();
    let grid = Grid { origin: [0.0, 0.5, 0.0], cell: 0.1, size: [1, 1, 1] };
    let mut volume = Volume::new(grid, vec![-0.5], [vec![1.0; 2], vec![2.0; 2], vec![3.0; 2]]).unwrap();
    volume.once_mut().set("mass", Column::new(vec![2.0_f32])).unwrap();
    let mut geometry = Geometry::default().with(curves).with(mesh).with(points).with(tets);
    geometry.put_volume(volume);
    geometry
}

const EVERYTHING: &str = r#"{"frame": 12, "time": 0.5,
 "curves": {"counts": [2], "points": [[0.0, -0.0, 0.0], [0.0, 1.0, 0.0]],
  "point_attributes": {"envelope": [1.0, 0.5]},
  "element_attributes": {"shielded": [0.5]},
  "attributes": {"a \"name\"": [[1, 2, 3]]}},
 "mesh": {"counts": [3], "indices": [0, 1, 2], "points": [[1e-45, 3e+38, 0.1], [1e-45, 3e+38, 0.1], [1e-45, 3e+38, 0.1]],
  "point_attributes": {"orient": [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]},
  "element_attributes": {},
  "attributes": {}},
 "points": {"points": [[0.0, 0.0, 0.0]],
  "point_attributes": {"id": [-7]},
  "attributes": {}},
 "tets": {"indices": [[0, 1, 2, 3]], "points": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
  "point_attributes": {},
  "element_attributes": {"parts": [[1, 2, 3, -2147483648]]},
  "attributes": {}},
 "volume": {"origin": [0.0, 0.5, 0.0], "cell": 0.1, "size": [1, 1, 1],
  "level_set": [-0.5],
  "velocity_x": [1.0, 1.0],
  "velocity_y": [2.0, 2.0],
  "velocity_z": [3.0, 3.0],
  "attributes": {"mass": [2.0]}}}
"#;

#[test]
fn the_written_text_is_as_expected_and_reads_back() {
    assert_eq!(written(&everything(), 12.0), EVERYTHING);
    assert_eq!(read(EVERYTHING), everything());
    let sign = read(EVERYTHING).curves().unwrap().positions()[0][1].to_bits();
    assert_eq!(sign, (-0.0_f32).to_bits());
}

#[test]
fn a_whole_frame_has_no_fraction() {
    let head = |frame| written(&Geometry::default(), frame);
    assert_eq!(head(10.5), "{\"frame\": 10.5, \"time\": 0.4375}\n");
    assert_eq!(head(-3.0), "{\"frame\": -3, \"time\": -0.125}\n");
    assert_eq!(head(0.0), "{\"frame\": 0, \"time\": 0}\n");
    assert_eq!(read(head(1.0)), Geometry::default());
}

#[test]
fn types_can_be_recognised_in_the_text() {
    let column = |rows: &str, name: &str| {
        let text =
            format!(r#"{{"points": {{"points": [[0, 0, 0], [1, 1, 1]], "point_attributes": {{"{name}": {rows}}}}}}}"#);
        read(text).points().unwrap().table(Owner::Point).column(name).unwrap().clone()
    };
    assert_eq!(column("[1, 2]", "mask"), Column::new(vec![1, 2]));
    assert_eq!(column("[1, 2.0]", "mask"), Column::new(vec![1.0_f32, 2.0]));
    assert_eq!(column("[1e0, 2]", "mask"), Column::new(vec![1.0_f32, 2.0]));
    assert_eq!(column("[1, 2]", "envelope"), Column::new(vec![1.0_f32, 2.0]), "the name is well known as float");
    assert_eq!(column("[[1,2,3],[ 4 , 5 , 6 ]]", "mask"), Column::new(vec![[1, 2, 3], [4, 5, 6]]));
    assert_eq!(
        column("[[1,2,3,4],[5,6,7,8.5]]", "mask"),
        Column::new(vec![[1.0_f32, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.5]])
    );
    // The f64 nearest to this lies exactly between two f32, and rounds in the other direction.
    let between = "1.00000005960464478";
    assert_eq!(column(&format!("[{between}, 0.0]"), "mask"), Column::new(vec![between.parse::<f32>().unwrap(), 0.0]));
}

#[test]
fn a_column_without_rows_has_the_type_of_its_name_or_float() {
    let geometry = read(r#"{"points": {"points": [], "point_attributes": {"id": [], "v": [], "mask": []}}}"#);
    let table = geometry.points().unwrap().table(Owner::Point);
    assert_eq!(table.column("id"), Some(&Column::new(Vec::<i32>::new())));
    assert_eq!(table.column("v"), Some(&Column::new(Vec::<[f32; 3]>::new())));
    assert_eq!(table.column("mask"), Some(&Column::new(Vec::<f32>::new())));
}

#[test]
fn unusual_text_gives_the_same_geometry() {
    let plain: Geometry = Component::curves(vec![1], vec![[1.0, 2.0, 3.0]]).unwrap().into();
    for odd in [
        r#"{"curves":{"counts":[1],"points":[[1.0,2.0,3.0]]}}"#,
        "\u{feff}{\"curves\": {\"points\": [[1, 2, 3]], \"counts\": [1]}}",
        "\r\n{ \"time\" : 1 , \"frame\" : 2.5 ,\r\n\"curves\" : { \"counts\" : [ 1 ] , \
         \"points\" : [ [ 1 , 2e0 , 30E-1 ] ] } }\r\n\r\n",
        r#"{"curv\u0065s": {"counts": [1], "attributes": {}, "points": [[1.0, 2.0, 3.0]], "element_attributes": {}}}"#,
    ] {
        assert_eq!(read(odd), plain, "{odd}");
    }
}

#[test]
fn an_invalid_file_is_reported_with_line_column_and_reason() {
    let keys = "`frame`, `time`, `curves`, `mesh`, `points`, `tets`, `volume`";
    for (text, expected) in [
        (
            "[]",
            "line 1, column 0: invalid type: sequence, expected an object with a key per component, such as `curves`",
        ),
        ("{\n\"curve\": {}}", &format!("line 2, column 7: unknown key `curve`, expected one of {keys}")),
        ("{\"points\": {\"points\": []}, \"points\": 1}", "line 1, column 35: `points` appears twice"),
        ("{\"points\": {}}", "line 1, column 14: `points`: `points` is missing"),
        ("{\"points\": []}", "line 1, column 11: invalid type: sequence, expected an object for `points`"),
        (
            "{\"points\": {\"counts\": []}}",
            "line 1, column 20: unknown key `counts`, expected one of `points`, `point_attributes`, `attributes`",
        ),
        (
            "{\"points\": {\"points\": [[1, 2]]}}",
            "line 1, column 30: `points`, row 0: 2 numbers in a list, expected 3 or 4, or a bare number",
        ),
        (
            "{\"points\": {\"points\": [[]]}}",
            "line 1, column 26: `points`, row 0: 0 numbers in a list, expected 3 or 4, or a bare number",
        ),
        ("{\"points\": {\"points\": [1]}}", "line 1, column 27: `points`: `points`: rows of 1 number, expected 3"),
        (
            "{\"points\": {\"points\": [[1, 2, 3], [1, 2, 3, 4]]}}",
            "line 1, column 47: `points`, row 1: 4 numbers, where the rows before have 3",
        ),
        ("{\"points\": {\"points\": [[1, null, 3]]}}", "line 1, column 36: `points`, row 0: `null` is not a number"),
        ("{\"points\": {\"points\": [\"x\"]}}", "line 1, column 27: `points`, row 0: `\\\"x\\\"` is not a number"),
        ("{\"points\": {\"points\": [[1, [2], 3]]}}", "line 1, column 35: `points`, row 0: `[2]` is not a number"),
        (
            "{\"points\": {\"points\": [[1e39, 2, 3]]}}",
            "line 1, column 36: `points`, row 0: 1e39 is out of range, expected at most 3.4e38",
        ),
        ("{\"points\": {\"points\": [[NaN, 2, 3]]}}", "line 1, column 25: expected value"),
        (
            "{\"points\": {\"points\": [], \"attributes\": {\"a\": [3000000000]}}}",
            "line 1, column 58: `a`, row 0: 3000000000 is out of range for a 32-bit integer; write it as 3000000000.0 to make it a float",
        ),
        (
            "{\"points\": {\"points\": [], \"attributes\": {\"a\": [1, 2]}}}",
            "line 1, column 55: `points`: `a` has 2 rows, expected 1",
        ),
        (
            "{\"points\": {\"points\": [], \"attributes\": {\"a\": [1], \"a\": [1]}}}",
            "line 1, column 54: `a` appears twice",
        ),
        (
            "{\"points\": {\"points\": [], \"point_attributes\": {\"P\": []}}}",
            "line 1, column 57: `points`: `P` is an attribute, expected the positions in `points`",
        ),
        (
            "{\"points\": {\"points\": [], \"point_attributes\": {\"v\": [1]}}}",
            "line 1, column 58: `points`: `v` is float, expected float3",
        ),
        (
            "{\"curves\": {\"counts\": [3], \"points\": []}}",
            "line 1, column 41: `curves`: the counts add up to 3 CVs, but there are 0 points",
        ),
        (
            "{\"curves\": {\"counts\": [4294967295, 4294967295], \"points\": []}}",
            "line 1, column 62: `curves`: more than 4,294,967,295 rows",
        ),
        (
            "{\"curves\": {\"counts\": [-1], \"points\": []}}",
            "line 1, column 25: invalid value: integer `-1`, expected u32",
        ),
        (
            "{\"mesh\": {\"counts\": [3], \"indices\": [0, 0, 1], \"points\": [[0, 0, 0]]}}",
            "line 1, column 70: `mesh`: index 1 (corner 2) is out of range: there are 1 points, counted from 0",
        ),
        (
            "{\"tets\": {\"indices\": [[0, 0, 0]], \"points\": []}}",
            "line 1, column 31: invalid length 3, expected an array of length 4",
        ),
        ("{\"points\": {\"points\": [[1, 2", "line 1, column 28: EOF while parsing a list"),
        ("{} x", "line 1, column 4: trailing characters"),
        ("{\"frame\": \"one\"}", "line 1, column 15: invalid type: string \"one\", expected f64"),
    ] {
        assert_eq!(fault(text), expected, "{text}");
    }
    assert_eq!(fault(b"{\"\xff\": 1}"), "byte 2: a byte is not valid UTF-8");
    let deep = format!("{{\"points\": {{\"points\": {}", "[".repeat(100_000));
    assert!(fault(deep).ends_with("EOF while parsing a list"), "and no stack overflow");
}

#[test]
fn an_invalid_volume_is_refused_with_the_reason() {
    let volume = |size: &str, cell: &str, level_set: &str| {
        let arrays = format!(r#""level_set": {level_set}, "velocity_x": [], "velocity_y": [], "velocity_z": []"#);
        let text = format!(r#"{{"volume": {{"origin": [0, 0, 0], "cell": {cell}, "size": {size}, {arrays}}}}}"#);
        fault(text).split_once(": ").unwrap().1.to_owned()
    };
    assert_eq!(volume("[1, 1, 1]", "0.1", "[]"), "`volume`: `level_set` has 0 rows, expected 1");
    assert_eq!(volume("[1, 1, 1]", "0.1", "[1]"), "`volume`: `velocity_x` has 0 rows, expected 2");
    assert_eq!(volume("[1, 1, 1]", "0", "[1]"), "`volume`: `cell` is 0, expected more than 0");
    assert_eq!(volume("[1, 1, 1]", "[1]", "[1]"), "`cell`: `[1]` is not a number");
    let large =
        "`volume`: `level_set`: 2048 × 1024 × 1024 numbers would take 8.0 GiB, expected at most 2147483647 numbers";
    assert_eq!(volume("[2048, 1024, 1024]", "0.1", "[]"), large);
    assert!(volume("[4294967295, 4294967295, 4294967295]", "0.1", "[]").contains("numbers would take"));
    let long = "`volume`: `level_set`: 4294967295 × 0 × 0 numbers, expected at most 16777216 along an axis";
    assert_eq!(volume("[4294967295, 0, 0]", "0.1", "[]"), long);
    let none = r#""size": [0, 0, 0], "level_set": [], "velocity_x": [], "velocity_y": [], "velocity_z": []"#;
    for (keys, expected) in [
        (r#""velocity_cell": -1"#, "`volume`: `velocity_cell` is -1, expected more than 0"),
        (r#""velocity_origin": [1]"#, "`volume`: `velocity_origin` has 1 number, expected 3"),
        (r#""velocity_size": [1, 1, 1]"#, "`volume`: `velocity_x` has 0 rows, expected 2"),
        (r#""background": 0"#, "`volume`: the background of `level_set` is 0.0, expected a distance above 0"),
    ] {
        let text = fault(format!(r#"{{"volume": {{"origin": [0, 0, 0], "cell": 0.1, {none}, {keys}}}}}"#));
        assert_eq!(text.split_once(": ").unwrap().1, expected, "{keys}");
    }
    let text = r#"{"volume": {"origin": [0, 0]}}"#;
    assert_eq!(fault(text), "line 1, column 30: `volume`: `origin` has 2 numbers, expected 3");
}

/// A level set of 3 × 1 × 1 cells with one stored block, velocity on one cell of its own grid.
fn two_grids() -> Geometry {
    let level = Grid { origin: [0.0, 0.5, 0.0], cell: 0.1, size: [3, 1, 1] };
    let velocity = Grid { origin: [0.0, 0.5, 0.0], cell: 0.3, size: [1, 1, 1] };
    let faces = [0, 1, 2].map(|axis| vec![axis as f32; 2]);
    let faces = faces.each_ref().map(Vec::as_slice);
    let mut geometry = Geometry::default();
    geometry.put_volume(Volume::from_dense(level, &[-0.05, 0.05, 0.25], 0.25, velocity, faces).unwrap());
    geometry
}

#[test]
fn a_grid_of_the_velocity_and_a_background_are_written_if_they_differ() {
    let text = written(&two_grids(), 1.0);
    let body = text.split_once(",\n").unwrap().1;
    let expected = r#" "volume": {"origin": [0.0, 0.5, 0.0], "cell": 0.1, "size": [3, 1, 1],
  "velocity_origin": [0.0, 0.5, 0.0], "velocity_cell": 0.3, "velocity_size": [1, 1, 1],
  "level_set": [-0.05, 0.05, 0.25],
  "velocity_x": [0.0, 0.0],
  "velocity_y": [1.0, 1.0],
  "velocity_z": [2.0, 2.0],
  "attributes": {}}}
"#;
    assert_eq!(body, expected);
    assert_eq!(read(&text), two_grids());
    let far = text.replace(r#""size": [3, 1, 1],"#, r#""size": [3, 1, 1], "background": 2.0,"#);
    let volume = read(&far).volume().unwrap().clone();
    assert_eq!(volume.level_set().background(), 2.0);
    let mut geometry = Geometry::default();
    geometry.put_volume(volume);
    assert_eq!(written(&geometry, 1.0), far);
    let same_corner = text.replace(r#""velocity_origin": [0.0, 0.5, 0.0], "#, "");
    assert_eq!(read(&same_corner), two_grids(), "missing keys are those of the level set");
}

#[test]
fn a_volume_too_large_for_dense_arrays_is_refused_before_anything_is_written() {
    let grid = Grid { origin: [0.0; 3], cell: 0.1, size: [4096; 3] };
    let empty = |size, background| SparseField::from_blocks(size, background, [], |_, _| {}).unwrap();
    let faces = [0, 1, 2].map(|axis| empty(grid.faces_size(axis), 0.0));
    let mut geometry = Geometry::default();
    geometry.put_volume(Volume::from_fields(grid, empty(grid.size, 0.3), grid, faces).unwrap());
    let stamp = FrameStamp { frame: 1.0, seconds: 0.0 };
    let error = crate::write(Format::Json, &geometry, &stamp, &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("`level_set`: 4096 × 4096 × 4096 numbers would take 256.0 GiB"), "{error}");
}

#[test]
fn numbers_that_are_not_finite_are_not_written() {
    let fault = |geometry: &Geometry, frame: f64| {
        let stamp = FrameStamp { frame, seconds: 0.0 };
        crate::write(Format::Json, geometry, &stamp, &mut Vec::new()).unwrap_err().to_string()
    };
    let mut points = Component::points(vec![[0.0; 3]; 2]);
    let mask: Attr<f32> = Attr::point("mask");
    points.set(mask, vec![0.0, f32::NAN]).unwrap();
    assert_eq!(fault(&points.into(), 1.0), "`mask` of points is not finite in row 1");
    let grid = Grid { origin: [0.0; 3], cell: f32::MAX, size: [0; 3] };
    let mut geometry = Geometry::default();
    geometry.put_volume(Volume::new(grid, Vec::new(), [const { Vec::new() }; 3]).unwrap());
    geometry.scale_lengths(2.0);
    assert_eq!(fault(&geometry, 1.0), "`cell` of volume is not finite in row 0");
    geometry.remove(Kind::Volume);
    assert_eq!(fault(&geometry, f64::NAN), "the frame is NaN and its time 0 s, expected finite numbers");
}
